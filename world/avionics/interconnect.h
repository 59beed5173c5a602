/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_AVIONICS_INTERCONNECT_H
#define WORLD_AVIONICS_INTERCONNECT_H

#include "flight/msg/avionics.h"
#include "flight/msg/computer.h"

#define NVM_SLOTS 16

/** The interconnect of the avionics: stores and retrieves packets of non-volatile memory on request, and reports what
 *  it did. The memory outlives resets of the computer; a run begins with it empty.
 *  Source: thesis sections 5.3.2 and 5.4.2. */
typedef struct Interconnect {
    struct {
        NvmPacket request;      ///< optional: without it the memory stays as it is
        ComputerReset computer; ///< optional: counted for its report
    } in;
    struct {
        NvmPacket reply;
        InterconnectState state;
    } out;
    struct {
        uint32_t slots; ///< [-] required, in [1, 16]: of the memory
        uint32_t spare;
    } par;
    struct {
        uint32_t memory[NVM_SLOTS][NVM_WORDS]; ///< [-] the content of the slots
    } mem;
} Interconnect;

#endif
