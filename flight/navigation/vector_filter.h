/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_NAVIGATION_VECTOR_FILTER_H
#define FLIGHT_NAVIGATION_VECTOR_FILTER_H

#include "flight/msg/attitude.h"
#include "flight/msg/magnetics.h"
#include "flight/msg/navigation.h"
#include "flight/msg/sensors.h"

/** What the filter estimates, of a time. */
typedef struct VectorEstimate {
    int64_t t;         ///< [ns] of which it is: of the last rate
    Vec3 sigma_BN;     ///< [-] the attitude
    Vec3 bias_B;       ///< [rad/s] bias of the gyro
    Vec3 field_bias_B; ///< [T] bias of the magnetometer
    double root[9][9]; ///< [SI] root of the covariance of a small turn of the attitude, and of both biases
} VectorEstimate;

/** The attitude from a gyro and any directions, and from the magnetic field, by a multiplicative extended Kalman
 *  filter in square-root form. It estimates the small turn x from its attitude to the true one, the gyro's bias and the
 *  magnetometer's bias. With C for the turn by which its attitude carries N to B, a direction and a field are
 *      d_B = C d_N + C d_N x x,   B_B = C B_N + C B_N x x + bias.
 *  It begins with the attitude of `start`, from Quest or Triad or a star tracker; one whose error exceeds 0.15 rad
 *  waits for a better. What it may have in common with the magnetometer's bias doubles both variances. Then each good
 *  measurement counts once, if it is up to `age_max` old, as if it were of the time of the last rate, with the body
 *  turned there by that rate. Older ones are counted as late, and one of a time to come waits. Degraded ones do not
 *  count: a direction that was carried through the dark is none.
 *  One whose normalised innovation exceeds the gate is rejected, and one that repeats the last of its source to the
 *  last digit, as a stuck sensor does: that has no effect at all. After `persistence` other rejections in a row of one
 *  source the output is degraded until one fits; and if `start` contradicts the attitude too, the filter begins anew
 *  with it and forgets the biases. So it leaves a wrong attitude, and a stuck sensor does not draw it away. Where the
 *  attitude is not known to 0.3 rad, it begins anew with `start`, and the biases stay.
 *  The output is degraded until `persistence` measurements counted, and where the standard deviation about any axis of
 *  B exceeds `good`: with one direction alone, it is good as long as the gyro carries. A gap of the gyro up to `hold`
 *  is bridged, degraded; after a longer one the output is held, degraded, until there are rates and `start` again.
 *  Assumptions: errors of measurements are independent, which those of filtered directions are not; over `age_max`,
 *  the rate stays as it is.
 *  Sources: E. J. Lefferts, F. L. Markley, M. D. Shuster, JGCD 5(5), 1982; J. E. Potter's form of a measurement, in
 *  G. J. Bierman, Factorization Methods for Discrete Sequential Estimation, 1977; F. L. Markley, JGCD 26(2), 2003. */
typedef struct VectorFilter {
    struct {
        GyroRate gyro;
        StarAttitude start;     ///< an attitude to begin with
        SeenDirection first;    ///< optional: of the Sun, the horizon, a star
        SeenDirection second;   ///< optional: one more
        SeenDirection third;    ///< optional: one more
        MeasuredField field;    ///< optional: without it, the magnetometer's bias is not estimated
        KnownField known_field; ///< optional: needed with the field
    } in;
    struct {
        NavAttitude attitude;
        VectorFilterState state;
    } out;
    struct {
        double rate_noise;     ///< [rad^2/s] required, > 0: the square of the noise density of the rates
        double bias_walk;      ///< [rad^2/s^3] required, > 0: the variance that the gyro's bias gains per second
        double bias_std;       ///< [rad/s] required, > 0: standard deviation of the gyro's bias at the start
        double field_noise;    ///< [T] >= 0: of measured and known field together, about each axis; 0: no field counts
        double field_walk;     ///< [T^2/s] >= 0: the variance that the magnetometer's bias gains per second
        double field_bias_std; ///< [T] >= 0: standard deviation of the magnetometer's bias at the start
        double gate;           ///< [-] required, > 0: normalised innovation above which a measurement does not fit
        double hold;           ///< [s] required, > 0: longest gap between rates that can be bridged
        double age_max;        ///< [s] required, > 0: of a measurement that counts
        double good;           ///< [rad] required, > 0: largest standard deviation about an axis of a good attitude
        uint32_t persistence;  ///< [-] required, > 0: rejections until a source is in doubt; measurements until good
        uint32_t spare;
    } par;
    struct {
        VectorEstimate at;                 ///< the estimate
        Vec3 rate;                         ///< [rad/s] the last rate, as the gyro gave it
        Vec3 before;                       ///< [rad/s] the one before
        int64_t before_t;                  ///< [ns] its time
        int64_t now;                       ///< [ns] of the last update
        int64_t begun;                     ///< [ns] time of the last attitude of `start` that was looked at
        int64_t seen[VECTOR_SOURCES];      ///< [ns] times of the last measurements that were looked at
        Vec3 last[VECTOR_SOURCES];         ///< [SI] those measurements
        double misfit[VECTOR_SOURCES];     ///< [-] as VectorFilterState has it, and what follows
        uint32_t used[VECTOR_SOURCES];     ///< [-] used
        uint32_t rejected[VECTOR_SOURCES]; ///< [-] rejected
        uint32_t doubt[VECTOR_SOURCES];    ///< [-] rejections in a row
        uint32_t known[VECTOR_SOURCES];    ///< [-] 1: a measurement was looked at
        uint32_t late;                     ///< [-] late
        uint32_t restarts;                 ///< [-] restarts
        uint32_t rates;                    ///< [-] rates that are known, up to 2
        uint32_t running;                  ///< [-] 1 and the measurements since the start, to `persistence`; 0: none
        uint32_t any;                      ///< [-] 1: an attitude of `start` was looked at
        uint32_t spare2;
    } mem;
} VectorFilter;

void vector_filter_reset(VectorFilter *m);
void vector_filter_update(VectorFilter *m, Tick t);

#endif
