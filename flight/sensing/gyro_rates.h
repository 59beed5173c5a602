/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_SENSING_GYRO_RATES_H
#define FLIGHT_SENSING_GYRO_RATES_H

#include "flight/msg/avionics.h"
#include "flight/msg/sensors.h"

/** The mean rate since the last reading, from the angles that the electronics of gyros count. Counts wrap around: a
 *  turn is that of less than half their range. Without a new sample the rate is held, also at the first
 *  one and at one whose counter has begun anew; one beyond rate_max is refused.
 *  Assumptions: the electronics' clock is that of the ticks. */
typedef struct GyroRates {
    struct {
        GyroRegisters registers;
    } in;
    struct {
        GyroRate rate;
    } out;
    struct {
        uint32_t bits; ///< [-] required, in [2, 32]: of a count
        uint32_t spare;
        double scale;    ///< [rad] required, > 0, <= 1: angle of one count
        int64_t tick;    ///< [ns] required, in [1, 1000000000]: of the time tags
        double rate_max; ///< [rad/s] >= 0: about an axis; 0: any
    } par;
    struct {
        uint32_t angle[3]; ///< [-] counts of the last reading
        uint32_t time;     ///< [-] its tag
        uint32_t counter;  ///< [-] of its sample
        uint32_t known;    ///< [-] 1: there is one
        uint32_t refused;  ///< [-] rates beyond rate_max
        uint32_t spare2;
    } mem;
} GyroRates;

void gyro_rates_reset(GyroRates *m);
void gyro_rates_update(GyroRates *m, Tick t);

#endif
