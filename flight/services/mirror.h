/* SPDX-License-Identifier: Apache-2.0 */
/* A copy of a store of files in the recorder, which outlives resets of the computer: after a start all pages that were
 * ever written are read back, then those that change are written, one page at an update. Until they are back, the store
 * is not mounted, and gives CFDP_BROKEN. A page that the recorder could not keep is left empty: its file is dropped. A
 * page that it does not take any more has its content moved. */
#ifndef FLIGHT_SERVICES_MIRROR_H
#define FLIGHT_SERVICES_MIRROR_H

#include "ccsds/store/memory_store.h"
#include "flight/msg/avionics.h"

#ifdef __cplusplus
extern "C" {
#endif

/** How far it is. All zero: a start. It may stay where the request is reset. */
typedef struct Mirror {
    uint32_t page;      ///< [-] the next to be read back
    uint32_t waits;     ///< [-] 1: for the answer to its request
    uint32_t damaged;   ///< [-] pages that the recorder could not read
    uint32_t worn;      ///< [-] pages that it did not take
    uint32_t left;      ///< [-] pages that are to be read back, or to be written
    uint32_t requested; ///< [-] the page of its request
} Mirror;

/** At each update, after the files were used: read the answer, make the next request. The store has begun
 * (memory_store_begin); it is mounted here. */
void mirror_update(Mirror *mirror, MemoryStore *store, const RecorderReply *reply, RecorderRequest *request, Tick t);

#ifdef __cplusplus
}
#endif

#endif
