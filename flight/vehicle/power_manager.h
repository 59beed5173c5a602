/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_VEHICLE_POWER_MANAGER_H
#define FLIGHT_VEHICLE_POWER_MANAGER_H

#include "flight/msg/avionics.h"
#include "flight/msg/protection.h"

/** Keep the loads of the power unit as the ground wants them: switch them, and clear a trip after a time, so that a
 *  latch-up ends. A load that has tripped more often than allowed stays off. Each update changes the heartbeat.
 *  The next command waits until the power unit has obeyed the last one. A card whose counter stands still for
 *  `silent_after` is silent: its loads count as off, and are not switched until it reports again. */
typedef struct PowerManager {
    struct {
        PowerTelemetry power;
        UnitTable units; ///< optional: the loads of units follow it
    } in;
    struct {
        PowerCommand command;
        PowerState state;
    } out;
    struct {
        uint32_t on;             ///< [-] the loads that shall be on, a bit for each; not of those that units decide
        uint32_t clears;         ///< [-] how many trips of a load are cleared
        int64_t clear_after;     ///< [ns] >= 0: how long a tripped load stays off
        int64_t silent_after;    ///< [ns] >= 0: how long a card's counter may stand still; 0: for ever
        uint32_t reset_computer; ///< [-] in [0, 1]: 1: ask the power unit to reset the computer
        uint32_t silent;         ///< [-] in [0, 1]: 1: the heartbeat stops
    } par;
    struct {
        int64_t tripped_at[LOADS_MAX];       ///< [ns] when the trip of each load was seen; -1: it is not tripped
        uint32_t cleared[LOADS_MAX];         ///< [-] trips of each load
        int64_t counted[SWITCH_CARDS + 1];   ///< [ns] when the counter of each card changed, the controller's last
        uint32_t counters[SWITCH_CARDS + 1]; ///< [-] the counter of each card
        uint32_t spare;
    } mem;
} PowerManager;

void power_manager_reset(PowerManager *m);
void power_manager_update(PowerManager *m, Tick t);

#endif
