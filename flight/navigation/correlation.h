/* SPDX-License-Identifier: Apache-2.0 */
/* Private to TimeCorrelation and UtcCorrelation: another clock's time, by the clock on board. */
#ifndef FLIGHT_NAVIGATION_CORRELATION_H
#define FLIGHT_NAVIGATION_CORRELATION_H

#include "flight/msg/avionics.h"

/* a + b, or the nearest that an int64_t holds. */
static inline int64_t correlation_later(int64_t a, int64_t b)
{
    return tick_since(a, b == INT64_MIN ? INT64_MAX : -b);
}

/** [ns] time_0 + (1 + drift) (clock - clock_0). The clock is the vehicle's; while that is not written, it is t. */
static inline int64_t correlated_time(VehicleTimeState vehicle, int64_t t, int64_t clock_0, int64_t time_0,
                                      double drift)
{
    const int64_t since = tick_since(head_written(vehicle.head) ? vehicle.time : t, clock_0);
    const double gained = drift * (double)since;
    return correlation_later(correlation_later(time_0, since), (int64_t)(gained + (gained < 0.0 ? -0.5 : 0.5)));
}

#endif
