/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_PROTECTION_STAR_SELECT_H
#define FLIGHT_PROTECTION_STAR_SELECT_H

#include "flight/msg/protection.h"
#include "flight/msg/sensors.h"
#include "flight/protection/unit_choice.h"

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

#endif
