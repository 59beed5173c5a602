/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_PROTECTION_GYRO_SELECT_H
#define FLIGHT_PROTECTION_GYRO_SELECT_H

#include "flight/msg/protection.h"
#include "flight/msg/sensors.h"
#include "flight/protection/unit_choice.h"

/** The rate of the gyro that is in use, by the table of units, as `StarSelect` takes star trackers. */
typedef struct GyroSelect {
    struct {
        GyroRate a;
        GyroRate b;
        UnitTable units; ///< optional: without it both are in use
    } in;
    struct {
        GyroRate rate;
        UnitChoice choice;
    } out;
    struct {
        uint32_t places[2]; ///< [-] in [0, 31]: of the units a and b in the table
    } par;
    struct {
        ChoiceMemory memory;
    } mem;
} GyroSelect;

void gyro_select_reset(GyroSelect *m);
void gyro_select_update(GyroSelect *m, Tick t);

#endif
