/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_VEHICLE_POWER_MANAGER_H
#define FLIGHT_VEHICLE_POWER_MANAGER_H

#include "flight/msg/avionics.h"

/** Keep the loads of the power unit as the ground wants them: switch them, and clear a trip after a time, so that a
 *  latch-up ends. A load that has tripped more often than allowed stays off. Each update changes the heartbeat.
 *  The next command waits until the power unit has obeyed the last one. */
typedef struct PowerManager {
    struct {
        PowerTelemetry power;
    } in;
    struct {
        PowerCommand command;
    } out;
    struct {
        uint32_t on;             ///< [-] the loads that shall be on, a bit for each
        uint32_t clears;         ///< [-] how many trips of a load are cleared
        int64_t clear_after;     ///< [ns] >= 0: how long a tripped load stays off
        uint32_t reset_computer; ///< [-] in [0, 1]: 1: ask the power unit to reset the computer
        uint32_t silent;         ///< [-] in [0, 1]: 1: the heartbeat stops
    } par;
    struct {
        int64_t tripped_at[LOADS_MAX]; ///< [ns] when the trip of each load was seen; -1: it is not tripped
        uint32_t cleared[LOADS_MAX];   ///< [-] trips of each load
    } mem;
} PowerManager;

void power_manager_reset(PowerManager *m);
void power_manager_update(PowerManager *m, Tick t);

#endif
