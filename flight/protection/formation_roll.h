/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_PROTECTION_FORMATION_ROLL_H
#define FLIGHT_PROTECTION_FORMATION_ROLL_H

#include "flight/msg/event.h"
#include "flight/msg/orbit.h"
#include "flight/msg/relative.h"

/** Its events. */
typedef enum FormationRollEventId {
    FORMATION_ROLL_LOST = 1, ///< medium, members [-]: they are not heard any more, a bit for each
    FORMATION_ROLL_HEARD = 2 ///< info, members [-]: they are heard, for the first time or again
} FormationRollEventId;

/** Which members of a formation are heard, by their beacons.
 *  A member is heard while its beacon is neither missing nor stale: give the wires a `stale_after`. One that was heard
 *  since the reset and is not any more is lost. */
typedef struct FormationRoll {
    struct {
        BodyState a; ///< optional: member 0
        BodyState b; ///< optional: member 1
        BodyState c; ///< optional: member 2
        BodyState d; ///< optional: member 3
        BodyState e; ///< optional: member 4
        BodyState f; ///< optional: member 5
        BodyState g; ///< optional: member 6
        BodyState h; ///< optional: member 7
    } in;
    struct {
        FormationState state;
        FlightEvent event;
    } out;
    struct {
        int64_t last[ROLL_MEMBERS]; ///< [ns] time of the newest message of each that was heard
        uint32_t known;             ///< [-] members that were heard since the reset
        uint32_t spare;
    } mem;
} FormationRoll;

void formation_roll_reset(FormationRoll *m);
void formation_roll_update(FormationRoll *m, Tick t);

#endif
