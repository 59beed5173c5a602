/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_NAVIGATION_UTC_CORRELATION_H
#define FLIGHT_NAVIGATION_UTC_CORRELATION_H

#include "flight/msg/avionics.h"
#include "flight/msg/ephemeris.h"

/** UTC by the clock on board: time = time_0 + (1 + drift) (clock - clock_0), as the ground determined it last. The
 *  ground sends the three parameters together, anew after a leap second. TimeCorrelation gives TDB. */
typedef struct UtcCorrelation {
    struct {
        VehicleTimeState vehicle; ///< optional: the vehicle's clock; without it, flight's time is the clock
    } in;
    struct {
        UtcTime time;
    } out;
    struct {
        int64_t clock_0; ///< [ns] of the clock, when they were compared
        int64_t time_0;  ///< [ns] assumed: UTC since 2000-01-01T12:00:00, then
        double drift;    ///< [-] in [-0.001, 0.001]: how much faster UTC goes
    } par;
} UtcCorrelation;

void utc_correlation_reset(UtcCorrelation *m);
void utc_correlation_update(UtcCorrelation *m, Tick t);

#endif
