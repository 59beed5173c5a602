/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_SERVICES_HOUSEKEEPING_H
#define FLIGHT_SERVICES_HOUSEKEEPING_H

#include "flight/command/command.h"
#include "flight/exec/element.h"
#include "flight/msg/services.h"

enum { HOUSEKEEPING_REPORTS = 8, HOUSEKEEPING_CHOICES = 16 };

/** Numbers of an output. */
typedef struct HousekeepingChoice {
    uint16_t output; ///< [-] place in the dictionary
    uint16_t offset; ///< [-] bytes from the output's beginning
    uint16_t type;   ///< [-] FledgeType of each
    uint16_t n;      ///< [-] how many in a row
} HousekeepingChoice;

/** A packet of numbers that were chosen. */
typedef struct HousekeepingReport {
    int64_t period; ///< [ns] >= 0: from packet to packet; 0: at each update
    uint32_t on;    ///< [-] in [0, 1]: 1: it is sent
    uint32_t n;     ///< [-] in [0, 16]: how many choices count
    HousekeepingChoice choices[HOUSEKEEPING_CHOICES];
} HousekeepingReport;

/** Sends numbers of outputs that the ground chooses, in up to 8 reports, each with its period.
 *
 *  A report is sent when it was turned on or its period was changed, and after each multiple of its period, at the end
 *  of the instant of the next update. Its packet has, big-endian:
 *
 *      byte 0  64 bits: the instant [ns]
 *           8  16 bits: the report
 *          10  16 bits: the CRC of its choices that count, each number big-endian: with what it is read
 *          12  16 bits: bit i: choice i is left out, for it names no number, or there is no room
 *          14  16 bits: the bytes of the numbers
 *          16  the numbers, each in its own type
 *
 *  Reports are parameters: commands write and read them and turn them on or off, and a reset of flight keeps them. */
typedef struct Housekeeping {
    struct {
        HousekeepingState state;
    } out;
    struct {
        HousekeepingReport reports[HOUSEKEEPING_REPORTS];
    } par;
    struct {
        int64_t turn[HOUSEKEEPING_REPORTS]; ///< [-] periods until the last packet
        uint32_t on;                        ///< [-] bit i: report i was on at the last update
        uint32_t due;                       ///< [-] bit i: report i is to be sent
        uint32_t bad;                       ///< [-] bit i: the last packet of report i left out a choice
        uint32_t sent;                      ///< [-] packets
    } mem;
} Housekeeping;

void housekeeping_reset(Housekeeping *m);
void housekeeping_update(Housekeeping *m, Tick t);

/** How flight's executive drives it. */
extern const CommandService housekeeping_service;

#endif
