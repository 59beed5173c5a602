/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_PROTECTION_RATE_LIMIT_H
#define FLIGHT_PROTECTION_RATE_LIMIT_H

#include "flight/msg/protection.h"
#include "flight/msg/sensors.h"

/** Trip where the body turns faster than a limit for `persistence` updates in a row, and stay so until it was within
 *  for `release` updates in a row. An event of the mission acts on `tripped`. A rate that is missing, old or not
 *  finite changes no count; the state is then degraded, and counts it as unknown.
 *  Source: thesis section 5.4.3, for protections that need persistence. */
typedef struct RateLimit {
    struct {
        GyroRate rate;
    } in;
    struct {
        ProtectionState state;
    } out;
    struct {
        double rate_max;      ///< [rad/s] required, > 0: largest size of the rate
        uint32_t persistence; ///< [-] required, > 0: updates in a row beyond the limit that trip
        uint32_t release;     ///< [-] updates in a row within the limit that release; 0: only a reset does
    } par;
    struct {
        Judgement judgement; ///< of the last update
    } mem;
} RateLimit;

void rate_limit_reset(RateLimit *m);
void rate_limit_update(RateLimit *m, Tick t);

#endif
