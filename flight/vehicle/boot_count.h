/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_VEHICLE_BOOT_COUNT_H
#define FLIGHT_VEHICLE_BOOT_COUNT_H

#include "flight/msg/avionics.h"
#include "flight/msg/computer.h"

/** Count the starts of the computer in non-volatile memory: after each start it retrieves the first word of a slot,
 *  adds one, and stores it. The rest of the slot stays. A refused request is not repeated.
 *  The mission names the input `computer` as what resets the computer; the module itself does not read it. */
typedef struct BootCount {
    struct {
        NvmPacket reply;
        InterconnectState interconnect; ///< optional: its count of resets tells which starts were by a watchdog
        ComputerReset computer;         ///< optional: resets of the computer
    } in;
    struct {
        NvmPacket request;
        BootState boot;
    } out;
    struct {
        uint32_t slot; ///< [-] of the memory
        uint32_t spare;
    } par;
} BootCount;

void boot_count_reset(BootCount *m);
void boot_count_update(BootCount *m, Tick t);

#endif
