/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_NAVIGATION_TIME_CORRELATION_H
#define FLIGHT_NAVIGATION_TIME_CORRELATION_H

#include "flight/msg/avionics.h"
#include "flight/msg/ephemeris.h"

/** The ephemerides' time, TDB, by the clock on board: time = time_0 + (1 + drift) (clock - clock_0), as the ground
 *  determined it last. The ground sends the three parameters together. UtcCorrelation gives UTC. */
typedef struct TimeCorrelation {
    struct {
        VehicleTimeState vehicle; ///< optional: the vehicle's clock; without it, flight's time is the clock
    } in;
    struct {
        EphemerisTime time;
    } out;
    struct {
        int64_t clock_0; ///< [ns] of the clock, when they were compared
        int64_t time_0;  ///< [ns] assumed: of the ephemerides, then
        double drift;    ///< [-] in [-0.001, 0.001]: how much faster the ephemerides' time goes
    } par;
} TimeCorrelation;

void time_correlation_reset(TimeCorrelation *m);
void time_correlation_update(TimeCorrelation *m, Tick t);

#endif
