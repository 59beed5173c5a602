/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_SERVICES_SPACE_LINK_H
#define FLIGHT_SERVICES_SPACE_LINK_H

#include "ccsds/space_link.h"
#include "flight/command/command.h"
#include "flight/msg/services.h"

enum { LINK_ROLES = 4 };

/** A sender of commands: the holder of a key, with an association of its own. Role i has the association i + 1. */
typedef struct LinkRole {
    uint64_t barred; ///< [-] bit i: it may not give the function code i, nor store such a command
    uint32_t key;    ///< [-] in [0, 65535]: the id of its key; 0: there is no such role
    uint32_t spare;
} LinkRole;

/** The numbers of an association. */
typedef struct LinkNumbers {
    uint64_t next;                   ///< [-] of the next frame; of commands, the newest that was accepted + 1
    uint32_t seen[SDLS_WINDOW / 32]; ///< [-] which of those before it were accepted
    uint32_t accepted;               ///< [-] frames
    uint32_t spare;
} LinkNumbers;

/** Lets flight speak frames with the ground instead of packets: a unit of its queue of commands has CLTUs or
 *  telecommand frames, one of its queue of telemetry is a frame (ccsds/space_link.h). Telemetry of an instant leaves at
 *  its end; an idle frame does if the ground is to get a CLCW, or after `idle`.
 *
 *  All zeros but the spacecraft are the settings with which others begin: bare telecommand frames without segments,
 *  expedited or in sequence, and telemetry frames of 1024 bytes, both with a CRC.
 *
 *  A reset of flight by command keeps the link as it is. After one of the computer FARM-1 begins anew, and secured
 *  commands need numbers from that time on (SdlsProvider): the ground takes them from secured telemetry. */
typedef struct SpaceLink {
    struct {
        LinkState state;
    } out;
    struct {
        uint32_t spacecraft;        ///< [-] required, initial, in [0, 1023]: its id
        uint32_t command_channel;   ///< [-] initial, in [0, 63]: virtual channel of commands
        uint32_t telemetry_channel; ///< [-] initial, in [0, 7]: virtual channel of telemetry
        uint32_t frame_size;        ///< [-] initial, in [0, 2048]: bytes of a frame of telemetry; 0: 1024
        uint32_t cop1;          ///< [-] initial, in [0, 1]: 1: telemetry has the CLCW, and the ground sends in sequence
        uint32_t window;        ///< [-] initial, in [0, 254]: of FARM-1, even; 0: 128
        uint32_t cltu;          ///< [-] initial, in [0, 1]: 1: commands come in CLTUs
        uint32_t segments;      ///< [-] initial, in [0, 1]: 1: with segment headers
        uint32_t map;           ///< [-] initial, in [0, 63]: of the segment headers
        uint32_t tc_random;     ///< [-] initial, in [0, 1]: 1: randomised
        uint32_t tm_random;     ///< [-] initial, in [0, 1]: 1: telemetry is randomised
        uint32_t marker;        ///< [-] initial, in [0, 1]: 1: with a marker in front of each frame
        uint32_t secured;       ///< [-] initial, in [0, 2]: 1: frames are authenticated; 2: encrypted, too
        uint32_t telemetry_key; ///< [-] initial, in [0, 65535]: the id of the key of telemetry, if they are
        double idle;            ///< [s] initial, >= 0: after so long without a frame, one goes out; 0: none does
        LinkRole roles[LINK_ROLES]; ///< initial: the keys of commands
    } par;
    struct {
        int64_t sent;                                              ///< [ns] the last instant with a frame
        LinkNumbers numbers[LINK_ROLES + 1];                       ///< of the roles, and of telemetry
        uint32_t frames;                                           ///< [-] that were sent until the last instant
        uint32_t craft[sizeof(SpaceLinkCraft) / sizeof(uint32_t)]; ///< [-] a SpaceLinkCraft
    } mem;
} SpaceLink;

void space_link_reset(SpaceLink *m);
void space_link_update(SpaceLink *m, Tick t);

/** How flight's executive drives it. */
extern const CommandService space_link_service;

#endif
