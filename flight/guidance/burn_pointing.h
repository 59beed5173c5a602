/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_GUIDANCE_BURN_POINTING_H
#define FLIGHT_GUIDANCE_BURN_POINTING_H

#include "flight/msg/attitude.h"
#include "flight/msg/burn.h"

/** Point r1 along the thrust of a commanded change of velocity. At the start of the burn, r1 is along dv_N and r3 as
 *  near as possible to the axis of the commanded rate, or, where there is none, to the axis of N farthest from r1; R
 *  turns at the commanded rate, also before the start, so that the body enters the burn with that rate.
 *  TrackingError turns the engines' axis onto r1 (sigma_BcB). A command of no length holds the last reference,
 *  degraded.
 *  Source: Schaub and Junkins, chapter 3, for a frame that turns at a constant rate. */
typedef struct BurnPointing {
    struct {
        DeltaVCommand command;
    } in;
    struct {
        AttReference reference;
    } out;
} BurnPointing;

void burn_pointing_reset(BurnPointing *m);
void burn_pointing_update(BurnPointing *m, Tick t);

#endif
