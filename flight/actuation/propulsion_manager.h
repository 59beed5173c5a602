/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_ACTUATION_PROPULSION_MANAGER_H
#define FLIGHT_ACTUATION_PROPULSION_MANAGER_H

#include "flight/msg/thrusters.h"

/** Write the times at which thrusters shall be open as burn times to their propulsion card, and watch the card: what
 *  it has counted from one update to the next. A thruster is stuck open if it gave thrust in each step of the card,
 *  though it was to be shut in some, for `persistence`; one such step behind a pulse may be its thrust that falls. One
 *  is stuck shut if it gave no thrust whenever it was open, for so long from the first time to the last, and stays so
 *  until it gives thrust or flight is reset. Let it run after the module that gives the times, in its task.
 *  Source: thesis section 5.4.2. */
typedef struct PropulsionManager {
    struct {
        ThrusterTimes times; ///< optional: without it no thruster opens
        PropulsionState card;
    } in;
    struct {
        PropulsionCommand command;
        PropulsionHealth health;
        ThrusterAvailability availability; ///< of those that are not stuck shut, and none of a silent card
    } out;
    struct {
        uint32_t n;           ///< [-] required, in [1, 8]: number of thrusters
        uint32_t armed;       ///< [-] in [0, 1]: 1: the card shall burn
        int64_t persistence;  ///< [ns] >= 0: how long a thruster differs before it is stuck; its thrust falls sooner
        int64_t silent_after; ///< [ns] >= 0: how long the card's counter may stand still; 0: for ever
    } par;
    struct {
        int64_t open[THRUSTERS_MAX];     ///< [ns] since when each gives thrust while it is shut; -1: it does not
        int64_t shut[THRUSTERS_MAX];     ///< [ns] since when each gives none whenever it is open; -1: it does
        int64_t counted;                 ///< [ns] when the card's counter changed
        uint32_t driven[THRUSTERS_MAX];  ///< [-] the card's, then
        uint32_t flowing[THRUSTERS_MAX]; ///< [-] the card's, then
        uint32_t counter;                ///< [-] the card's
        uint32_t spare;
    } mem;
} PropulsionManager;

void propulsion_manager_reset(PropulsionManager *m);
void propulsion_manager_update(PropulsionManager *m, Tick t);

#endif
