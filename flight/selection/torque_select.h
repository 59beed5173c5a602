/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_SELECTION_TORQUE_SELECT_H
#define FLIGHT_SELECTION_TORQUE_SELECT_H

#include "flight/msg/vehicle.h"
#include "flight/selection/newest.h"

/** The newest of several torques, of equally new ones the first, as it is; never one that is not finite. So
 *  control laws that stand in tasks of different modes drive one set of actuators:
 *  a module that its mode has suspended writes nothing new. It stands behind them in its task, and its own task in each
 *  of their modes. */
typedef struct TorqueSelect {
    struct {
        BodyTorque a;
        BodyTorque b; ///< optional: of another module
        BodyTorque c; ///< optional: of another module
    } in;
    struct {
        BodyTorque torque;
    } out;
    struct {
        NewestMemory memory;
    } mem;
} TorqueSelect;

void torque_select_reset(TorqueSelect *m);
void torque_select_update(TorqueSelect *m, Tick t);

#endif
