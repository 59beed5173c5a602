/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_AVIONICS_POWER_UNIT_H
#define WORLD_AVIONICS_POWER_UNIT_H

#include "flight/msg/avionics.h"
#include "flight/msg/computer.h"
#include "world/msg/fault.h"
#include "world/msg/power.h"

/** A power unit of a controller card and four switch cards with eight loads each: switches loads on command, trips one
 *  whose current is too high for too long, and reports currents and voltage in counts. It resets the computer on
 *  command, at given times, and if flight's heartbeat stays away. Loads are resistors at a source with an inner
 *  resistance. A latch-up adds a current to a load until that is off. A tripped load stays off until a command clears
 *  its trip and switches it on.
 *  A card can be lost. The loads of a switch card are then off, and stay off until a command after its return; a
 *  controller obeys no command and resets nothing. The reports of a card that is lost stand still.
 *  The channels of its faults: 0 to 3 the switch cards, 4 the controller; a card works where its channel, which is 1,
 *  is at least 0.5, so that DEAD and LOW lose it.
 *  The source may be a battery, which solar panels charge: when it is empty, the bus has no voltage until it is charged
 *  to 5 % again.
 *  Assumptions: the battery's voltage does not depend on its charge; currents follow at once; a command acts from the
 *  update that sees it.
 *  Source: thesis sections 5.3.2 and 5.4.2; Ohm's law. */
typedef struct PowerUnit {
    struct {
        PowerCommand command; ///< optional: without it the loads stay as they are
        ArrayPower array;     ///< optional: what charges the battery
        FaultSet injected;    ///< optional: faults, besides the planned ones
    } in;
    struct {
        PowerTelemetry telemetry;
        ComputerReset computer;
        LoadSupply supply; ///< for the units behind the loads
    } out;
    struct {
        uint32_t n;               ///< [-] required, in [1, 32]: number of loads
        uint32_t on;              ///< [-] the loads that are on at the beginning, a bit for each
        double volts;             ///< [V] required, > 0, <= 1e6: of the source without load
        double inner;             ///< [ohm] >= 0, <= 1e6: its inner resistance
        double load[LOADS_MAX];   ///< [ohm] required, count n, >= 1e-6: each load
        double trip[LOADS_MAX];   ///< [A] count n, >= 0: current above which a load is tripped; 0: never
        int64_t trip_after;       ///< [ns] >= 0: how long it may be above
        double count_current;     ///< [A] required, >= 1e-9: of one count
        double count_volts;       ///< [V] required, >= 1e-9: of one count
        int64_t latch_up_at;      ///< [ns] >= 0: when a latch-up begins, if its load is on then
        double latch_up_current;  ///< [A] >= 0, <= 1e6: that it adds; 0: there is none
        uint32_t latch_up_load;   ///< [-] in [0, 31]: its load
        uint32_t n_faults;        ///< [-] in [0, 4]: number of planned faults
        double reset_at[4];       ///< [s] >= 0, <= 5e8: resets of the computer from outside; 0: none
        double battery;           ///< [J] >= 0, <= 1e12: energy that the battery holds; 0: the source never empties
        double charge;            ///< [-] in [0, 1], initial: how full the battery is
        int64_t watchdog;         ///< [ns] >= 0: without a new heartbeat for so long the computer is reset; 0: never
        Fault faults[FAULTS_MAX]; ///< count n_faults: planned
    } par;
    struct {
        double energy;           ///< [J] in the battery
        double drawn;            ///< [W] from the source since the last update
        double above[LOADS_MAX]; ///< [s] how long the current of each load has been too high
        int64_t beat;            ///< [ns] when the heartbeat last changed, or the computer was reset
        uint32_t switched;       ///< [-] the loads that are on, a bit for each
        uint32_t tripped;        ///< [-] the loads that a trip has switched off, a bit for each
        uint32_t heartbeat;      ///< [-] the last one
        uint32_t number;         ///< [-] of the last command
        uint32_t latched;        ///< [-] 1: the latch-up is there
        uint32_t empty;          ///< [-] 1: the battery is empty
        uint64_t saturated;      ///< [-] updates in which it was empty
    } mem;
} PowerUnit;

#endif
