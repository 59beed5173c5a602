/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_VEHICLE_NVM_SHARE_H
#define FLIGHT_VEHICLE_NVM_SHARE_H

#include "flight/msg/avionics.h"

enum { NVM_CLIENTS = 4 };

/** Lets several modules use the one non-volatile memory: passes on their requests, one after the other in turn, and
 *  gives each the reply to its own. A module sees what it would see alone: a reply with the number of its request. */
typedef struct NvmShare {
    struct {
        NvmPacket reply; ///< of the memory
        NvmPacket ask_a; ///< optional: requests of a module
        NvmPacket ask_b; ///< optional: of another one
        NvmPacket ask_c; ///< optional: of a third one
        NvmPacket ask_d; ///< optional: of a fourth one
    } in;
    struct {
        NvmPacket request;
        NvmPacket reply_a;
        NvmPacket reply_b;
        NvmPacket reply_c;
        NvmPacket reply_d;
    } out;
    struct {
        uint32_t served;    ///< [-] the module whose request is under way, or was the last one
        uint32_t under_way; ///< [-] 1: it is
        uint32_t number;    ///< [-] that this module gave it
        uint32_t spare;
    } mem;
} NvmShare;

void nvm_share_reset(NvmShare *m);
void nvm_share_update(NvmShare *m, Tick t);

#endif
