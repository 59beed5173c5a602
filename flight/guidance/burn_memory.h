/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_GUIDANCE_BURN_MEMORY_H
#define FLIGHT_GUIDANCE_BURN_MEMORY_H

#include "flight/msg/avionics.h"
#include "flight/msg/burn.h"
#include "flight/msg/event.h"

enum { BURN_MEMORY_PATIENCE = 10 };

/** Its events, of a burn. */
typedef enum BurnMemoryEventId {
    BURN_MEMORY_BEGUN = 1,   ///< info, left [m/s]: the engines have opened
    BURN_MEMORY_RESUMED = 2, ///< medium, gained [m/s], left [m/s]: they have opened again
    BURN_MEMORY_ENDED = 3,   ///< info, gained [m/s], left [m/s]: the burn is complete
    BURN_MEMORY_ABORTED = 4, ///< high, why [-], gained [m/s], left [m/s]: by BurnAbort
    BURN_MEMORY_CUT = 5,     ///< high, gained [m/s], start [s]: a reset has cut off the burn, which may go on
    BURN_MEMORY_DAMAGED = 6  ///< medium, slot [-]: what the non-volatile memory has does not keep its checksum
} BurnMemoryEventId;

/** Keeps where the last burn that has begun stands, over a change of the mode, a reset of flight, and, in a slot of the
 *  non-volatile memory, over one of the computer. It stands in a task that no mode suspends, and says what happens.
 *
 *  A burn that ran when flight or the computer was reset is BURN_CUT from then on: BurnPlan begins with it, and
 *  BurnExecution lets it go on where it was, if flight lets them: an event of flight.py may enter their mode. A burn
 *  that ran when its mode was left, so that its state is older than `silent`, is aborted as BURN_LEFT: it is not known
 *  whether to go on. What has ended or was aborted is not flown again.
 *
 *  The slot is written as often as the memory answers. What the engines gave after the last writing before a reset is
 *  not counted: that of an answer and of the two updates for which BurnExecution opens them. Until the memory has been
 *  read, 10 updates at most, the output is degraded, and BurnPlan and BurnExecution wait for it. */
typedef struct BurnMemory {
    struct {
        BurnState state; ///< of the execution
        NvmPacket reply; ///< optional: of the non-volatile memory
    } in;
    struct {
        BurnState kept;
        NvmPacket request;
        FlightEvent event;
    } out;
    struct {
        double silent; ///< [s] in [0, 1e6]: how old the state of a burn that runs may be; 0: ten updates
        uint32_t slot; ///< [-] place + 1 in the non-volatile memory; 0: none
        uint32_t spare;
    } par;
    struct {
        BurnState burn;    ///< what is kept
        uint32_t seen;     ///< [-] sequence of the state that was seen last
        uint32_t begun;    ///< [-] 1: there was an update since the reset
        uint32_t changed;  ///< [-] 1: there is something to be stored
        uint32_t restored; ///< [-] 1: the memory has answered since the computer began
        uint32_t waited;   ///< [-] updates since then, up to 10
        uint32_t spare;
    } mem;
} BurnMemory;

void burn_memory_reset(BurnMemory *m);
void burn_memory_update(BurnMemory *m, Tick t);

#endif
