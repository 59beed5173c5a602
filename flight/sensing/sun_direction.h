/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_SENSING_SUN_DIRECTION_H
#define FLIGHT_SENSING_SUN_DIRECTION_H

#include "flight/msg/avionics.h"
#include "flight/msg/event.h"
#include "flight/msg/navigation.h"
#include "flight/msg/sun.h"

/** What two redundant converters of the sun sensors say of each other. */
typedef struct SunSensorStatus {
    Head head;
    uint32_t faulty;     ///< [-] converters that are out of use: 1: A, 2: B
    uint32_t miscompare; ///< [-] channels that differ now, a bit for each
    uint32_t sensors;    ///< [-] channels that have ever differed for long, a bit for each
    uint32_t spare;
} SunSensorStatus;

/** What it says. */
typedef enum SunDirectionEventId {
    SUN_DIRECTION_FAULTY = 1, ///< high, converter [-]: a converter is out of use from now on; 1: A, 2: B
    SUN_DIRECTION_SENSOR = 2  ///< low, sensor [-]: what the converters read of a sensor has differed for long
} SunDirectionEventId;

/** The direction to the Sun by coarse sun sensors that two converters read, of which one may fail. The direction is
 *  that whose cosines are nearest to the readings of the lit sensors, in the sum of weighted squares. The two
 *  converters are compared channel by channel; while channels differ, the one whose readings fit a unit vector worse
 *  is suspected, and after `persistence` such updates it is out of use until a reset of the module. A is preferred to
 *  B. By lit sensors that span only a plane, the direction is one in that plane, degraded; by fewer it is held,
 *  degraded.
 *  Source: least squares; thesis section 5.4.3 for the test of the converters. */
typedef struct SunDirection {
    struct {
        SunSensorCounts a;
        SunSensorCounts b;
    } in;
    struct {
        SunHeading heading;
        SunCosines cosines; ///< of the converter that is used
        SunSensorStatus status;
        FlightEvent event;
    } out;
    struct {
        uint32_t n;                      ///< [-] required, in [1, 8]: number of sensors
        uint32_t persistence;            ///< [-] required, > 0: updates with a difference that condemn a converter
        Vec3 axes_B[SUN_SENSORS_MAX];    ///< [-] required, count n, non-zero: where they look
        double current[SUN_SENSORS_MAX]; ///< [A] required, count n, > 0: of a sensor that faces the Sun
        double scale[2];                 ///< [A] required, > 0: of one count of A and of B
        double offset[2];                ///< [A] of the count 0
        double weight[SUN_SENSORS_MAX];  ///< [-] count n, >= 0: proportional to the inverse of the variance of a
                                         ///< sensor's error; 0: 1
        double dark;                     ///< [-] required, in [0, 1]: below this cosine a sensor counts as dark
        double differ;                   ///< [-] required, > 0: a difference of cosines that counts
    } par;
    struct {
        uint32_t suspected[2];              ///< [-] updates in which A and B were suspected
        uint32_t differed[SUN_SENSORS_MAX]; ///< [-] updates in which a channel differed
    } mem;
} SunDirection;

void sun_direction_reset(SunDirection *m);
void sun_direction_update(SunDirection *m, Tick t);

#endif
