/* SPDX-License-Identifier: Apache-2.0 */
/* Example:
 *
 *     static SunDirection m = {.par = {
 *         .n = 2, .axes_B = {{{1, 0, 0}}, {{0, 1, 0}}}, .current = {0.1, 0.1}, .dark = 0.05, .differ = 0.1}};
 *     sun_direction_reset(&m);
 *     m.in.currents.head = (Head){0, QUALITY_GOOD, 1};
 *     m.in.currents.current[0] = m.in.currents.current[1] = 0.07; // [A] the Sun is between both
 *     sun_direction_update(&m, (Tick){.t = 0, .dt = 0});
 */
#ifndef FLIGHT_SENSING_SUN_DIRECTION_H
#define FLIGHT_SENSING_SUN_DIRECTION_H

#include "flight/msg/avionics.h"
#include "flight/msg/navigation.h"
#include "flight/msg/sun.h"

/** The direction to the Sun by any set of up to eight coarse sun sensors, one on each face of a cube for instance: by
 *  their currents, or by the counts of one converter that reads them all.
 *  The direction is the unit vector whose cosines are nearest to the readings, in the sum of weighted squares. A dark
 *  sensor says that the Sun is not in its field of view, if no albedo and no obstacle is there.
 *  The direction is good where lit sensors that do not lie in a plane see it. Two lit sensors alone see the Sun at two
 *  places, mirrored by the plane of their axes, and one sees it on a cone: where the direction in that plane, or along
 *  that axis, explains the readings within `differ`, it is that one, degraded. Else, and where no direction explains
 *  them, as in a half-shadow or with a faulty sensor, it is held, degraded; in an eclipse, too. SunLine goes on from
 *  `cosines` with fewer sensors, and through the dark; SunPyramids finds faults of sensors in two pyramids.
 *  `differ` is to be beyond the noise; `dark` above what albedo gives.
 *  Source: least squares. */
typedef struct SunDirection {
    struct {
        SunCurrents currents;   ///< optional: without a scale
        SunSensorCounts counts; ///< optional: with one
    } in;
    struct {
        SunHeading heading;
        SunCosines cosines;
    } out;
    struct {
        uint32_t n; ///< [-] required, in [1, 8]: number of sensors
        uint32_t spare;
        Vec3 axes_B[SUN_SENSORS_MAX];    ///< [-] required, count n, non-zero: where they look
        double current[SUN_SENSORS_MAX]; ///< [A] required, count n, > 0: of a sensor that faces the Sun
        double view[SUN_SENSORS_MAX];    ///< [rad] count n, in [0, 1.5707963267948966]: half the angle of its field of
                                         ///< view; 0: the whole hemisphere
        double weight[SUN_SENSORS_MAX];  ///< [-] count n, >= 0: proportional to the inverse of the variance of a
                                         ///< sensor's error; 0: 1
        double scale;                    ///< [A] >= 0: of one count; 0: it reads `currents`
        double offset;                   ///< [A] of the count 0
        double dark;                     ///< [-] required, in [0, 1]: below this cosine a sensor counts as dark
        double differ; ///< [-] required, > 0: contradiction, the root of the sum of weighted squares of cosines
    } par;
} SunDirection;

void sun_direction_reset(SunDirection *m);
void sun_direction_update(SunDirection *m, Tick t);

#endif
