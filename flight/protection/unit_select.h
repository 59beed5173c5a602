/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_PROTECTION_UNIT_SELECT_H
#define FLIGHT_PROTECTION_UNIT_SELECT_H

#include "flight/msg/protection.h"
#include "flight/msg/sensors.h"

/** What a choice among units remembers. */
typedef struct ChoiceMemory {
    uint32_t sequence; ///< [-] of the message that was passed on last
    uint32_t passed;   ///< [-] place + 1 of its unit; 0: none
} ChoiceMemory;

/** The attitude of the star tracker that is in use, by the table of units: of several the first that speaks. It passes
 *  the message on as a wire does, with its time and quality. `choice` says which, and how long ago each has measured: a
 *  rule of the fault protection about that sees a silent one. */
typedef struct StarSelect {
    struct {
        StarAttitude a;
        StarAttitude b;
        UnitTable units; ///< optional: without it both are in use
    } in;
    struct {
        StarAttitude attitude;
        UnitChoice choice;
    } out;
    struct {
        uint32_t places[2]; ///< [-] in [0, 31]: of the units a and b in the table
    } par;
    struct {
        ChoiceMemory memory;
    } mem;
} StarSelect;

void star_select_reset(StarSelect *m);
void star_select_update(StarSelect *m, Tick t);

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
