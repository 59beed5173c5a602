/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_AVIONICS_PROPULSION_CARD_H
#define WORLD_AVIONICS_PROPULSION_CARD_H

#include "flight/msg/avionics.h"

#define BURNS_QUEUED 16

/** A propulsion card: queues burns of thrusters, with a start and a duration each, and opens them at their times, for
 *  each thruster one after the other in the order in which they came. It acts only while it is armed twice: by
 *  flight's commands, and by its switch in the power unit. Disarmed, it closes all thrusters and empties the queue.
 *  It refuses burns that are shorter than min_on, of no thruster, that come while it is disarmed, or for which there is
 *  no room. A command acts from the update that sees it.
 *  Source: thesis section 5.4.2. */
typedef struct PropulsionCard {
    struct {
        BurnCommand burn;     ///< optional: without it nothing burns
        PowerTelemetry power; ///< optional: without it the switch is on
    } in;
    struct {
        ThrusterTimes thrusters;
        PropulsionState state;
    } out;
    struct {
        uint32_t n;     ///< [-] required, in [1, 8]: number of thrusters
        uint32_t load;  ///< [-] in [0, 7]: the card's load in the power unit
        int64_t min_on; ///< [ns] >= 0: the shortest burn
    } par;
    struct {
        int64_t start[BURNS_QUEUED];     ///< [ns] of each burn that waits
        int64_t duration[BURNS_QUEUED];  ///< [ns] of each burn that waits
        uint32_t thruster[BURNS_QUEUED]; ///< [-] of each burn that waits
    } mem;
} PropulsionCard;

#endif
