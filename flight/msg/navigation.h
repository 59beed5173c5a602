/* SPDX-License-Identifier: Apache-2.0 */
/* What filters of the navigation report of themselves. */
#ifndef FLIGHT_MSG_NAVIGATION_H
#define FLIGHT_MSG_NAVIGATION_H

#include "flight/math/vec.h"
#include "flight/msg/avionics.h"

/** How an attitude filter stands. */
typedef struct AttitudeFilterState {
    Head head;
    Vec3 bias_B;       ///< [rad/s] bias of the gyro, B components
    Vec3 attitude_std; ///< [rad]   standard deviations of the attitude's error about the axes of B
    Vec3 bias_std;     ///< [rad/s] standard deviations of the bias' error
    double misfit;     ///< [-]     of the last measured attitude: its normalised innovation squared, on average 3
    uint32_t used;     ///< [-]     measured attitudes that were used
    uint32_t rejected; ///< [-]     measured attitudes that did not fit
    uint32_t late;     ///< [-]     measured attitudes of a time that the filter can no longer use
    uint32_t restarts; ///< [-]     how often the filter began anew
} AttitudeFilterState;

/** A direction that the body sees and that flight knows: of the Sun, the field, the horizon, a star. */
typedef struct SeenDirection {
    Head head;  ///< of the measurement
    Vec3 d_B;   ///< [-]   as measured: unit vector, B components
    Vec3 d_N;   ///< [-]   as known at the same time: unit vector, N components
    double std; ///< [rad] > 0: standard deviation of the angle between the two, about each axis across it
} SeenDirection;

/** Whether a direction can be used: it is not missing or stale, has unit vectors, and its error is > 0 and finite. */
static inline int direction_speaks(const SeenDirection *seen)
{
    return seen->head.quality >= QUALITY_DEGRADED && fm_abs(vec_norm2(seen->d_B) - 1.0) < 1e-3 &&
           fm_abs(vec_norm2(seen->d_N) - 1.0) < 1e-3 && seen->std > 0.0 && isfinite(seen->std);
}

/** The quality of a pair of fields, the measured and the known one. */
typedef struct FieldAgreement {
    Head head;
    double differ;    ///< [-] of the last pair: how much stronger the measured field is, relative to the known one
    uint32_t taken;   ///< [-] pairs
    uint32_t refused; ///< [-] pairs
} FieldAgreement;

/** What became of the last attempt to compute an attitude from directions. */
typedef enum FixFinding {
    FIX_NONE = 0,     ///< none was made
    FIX_SOUND = 1,    ///< the attitude is good
    FIX_DEGRADED = 2, ///< it is made from degraded directions
    FIX_MISFIT = 3,   ///< it is degraded: the directions contradict each other
    FIX_ALONE = 4,    ///< fewer than two directions of about the same time: it is held
    FIX_PARALLEL = 5, ///< no two of the directions are far enough apart: it is held
    FIX_INVALID = 6   ///< the result is not finite: it is held
} FixFinding;

/** How an attitude from directions stands. */
typedef struct AttitudeFixState {
    Head head;
    double misfit;      ///< [-]   of the last: the sum of squares of what does not fit, by errors; on average 2 n - 3
    double std;         ///< [rad] of the last: standard deviation of its error about all three axes together
    uint32_t n;         ///< [-]   directions that the last was made from
    FixFinding finding; ///< [-]   of the last attempt
    uint32_t fixes;     ///< [-]   attitudes since the reset
    uint32_t failed;    ///< [-]   attempts without an attitude
} AttitudeFixState;

#define VECTOR_SOURCES 4

/** How a filter of attitude and biases by directions and field stands. Of arrays, the first three entries are of the
 *  directions, and the last of the field. */
typedef struct VectorFilterState {
    Head head;
    Vec3 bias_B;                       ///< [rad/s] bias of the gyro, B components
    Vec3 field_bias_B;                 ///< [T]     bias of the magnetometer, B components
    Vec3 attitude_std;                 ///< [rad]   standard deviations of the attitude's error about the axes of B
    Vec3 bias_std;                     ///< [rad/s] of the error of the gyro's bias
    Vec3 field_bias_std;               ///< [T]     of the error of the magnetometer's bias
    double misfit[VECTOR_SOURCES];     ///< [-] of the last: normalised innovation squared, on average 2, of fields 3
    uint32_t used[VECTOR_SOURCES];     ///< [-] measurements that were used
    uint32_t rejected[VECTOR_SOURCES]; ///< [-] measurements that did not fit, or are none
    uint32_t late;                     ///< [-] measurements that were too old
    uint32_t restarts;                 ///< [-] how often the filter lost the attitude or left it for another one
} VectorFilterState;

/** What coarse sun sensors see: the first n entries count. */
typedef struct SunCosines {
    Head head;
    uint32_t n;                     ///< [-] in [0, 8]: number of sensors
    uint32_t lit;                   ///< [-] those that see the Sun, a bit for each
    double cosine[SUN_SENSORS_MAX]; ///< [-] count n: of the angle between their axes and the Sun
    double weight[SUN_SENSORS_MAX]; ///< [-] count n: proportional to the inverse of their errors' variance
    Vec3 axes_B[SUN_SENSORS_MAX];   ///< [-] count n: where they look, unit vectors
} SunCosines;

/** How the filter of the direction to the Sun stands. */
typedef struct SunLineState {
    Head head;
    double std;        ///< [rad]   standard deviation of the direction's error, both axes together
    double rate_std;   ///< [rad/s] and of the rate's error across the direction
    uint32_t used;     ///< [-]     sensors that the last update used
    uint32_t rejected; ///< [-]     lit sensors whose cosines did not fit, since the reset
    uint32_t restarts; ///< [-]     how often the filter began anew
    uint32_t spare;
} SunLineState;

/** How the filter of the orbit stands. */
typedef struct OrbitFilterState {
    Head head;
    Vec3 position_std; ///< [m]     standard deviations of the position's error, N components
    Vec3 velocity_std; ///< [m/s]   standard deviations of the velocity's error, N components
    double along;      ///< [m/s^2] acceleration along the velocity that the field does not explain: drag is < 0
    double along_std;  ///< [m/s^2] standard deviation of its error
    double misfit;     ///< [-]     of the last fix: its normalised innovation squared, on average 6
    uint32_t used;     ///< [-]     fixes that were used
    uint32_t rejected; ///< [-]     fixes that did not fit, repeat the one before, or are no orbit
    uint32_t late;     ///< [-]     fixes of a time that the filter can no longer use
    uint32_t restarts; ///< [-]     how often the filter began anew
} OrbitFilterState;

#endif
