/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_AVIONICS_PROPULSION_CARD_H
#define WORLD_AVIONICS_PROPULSION_CARD_H

#include "flight/msg/avionics.h"
#include "world/msg/fault.h"
#include "world/msg/power.h"
#include "world/msg/propulsion.h"

/** A propulsion card: opens its thrusters at the burn times that flight has written last, while flight arms it. A burn
 *  whose start has passed opens at once, and closes at its end. The card refuses one that is shorter than min_on, is
 *  over when it comes, or is of no thruster of its own.
 *  Pressure sensors show whether a thruster gives thrust. Its housekeeping counts the steps with a thrust, and those
 *  with an open valve, so that flight finds a valve that is stuck, however seldom it looks.
 *  The channels of its faults: 0 to 7 the drivers of its valves, 8 the card itself; each works where its channel, which
 *  is 1, is at least 0.5, so that DEAD and LOW lose it. Without power, and lost, the card shuts all valves, and its
 *  housekeeping stands still.
 *  Let it run before the spacecraft in its task: a burn that flight commands for now then opens without delay.
 *  Source: thesis section 5.4.2. */
typedef struct PropulsionCard {
    struct {
        PropulsionCommand command; ///< optional: without it no thruster opens
        ThrusterOutput thrust;     ///< optional: for its pressure sensors; without it they show what the card drives
        FaultSet injected;         ///< optional: faults, besides the planned ones
        LoadSupply power;          ///< optional: without it the card is on
    } in;
    struct {
        ThrusterTimes thrusters;
        PropulsionState state;
    } out;
    struct {
        uint32_t n;        ///< [-] required, in [1, 8]: number of thrusters
        uint32_t load;     ///< [-] in [0, 31]: the card's load in the power unit
        int64_t min_on;    ///< [ns] >= 0: the shortest burn
        uint32_t n_faults; ///< [-] in [0, 4]: number of planned faults
        uint32_t spare;
        Fault faults[FAULTS_MAX]; ///< count n_faults: planned
    } par;
    struct {
        int64_t taken[THRUSTERS_MAX];  ///< [ns] the start of the burn of each that began or was refused last; -1: none
        double impulse[THRUSTERS_MAX]; ///< [N s] of each at the last update
        uint32_t open;                 ///< [-] thrusters whose burn is under way, a bit for each
        uint32_t driven;               ///< [-] thrusters that it had open in the last step, a bit for each
    } mem;
} PropulsionCard;

#endif
