/* SPDX-License-Identifier: Apache-2.0 */
/* Packets over a link of frames: the two ends, each as one state machine. The spacecraft's end takes telecommand
 * frames, bare or in CLTUs, gives the packets in them, and puts packets of telemetry into frames of one length with the
 * CLCW. The ground's end does the reverse, starts COP-1 by itself and again when it ends, and reports what became of
 * each command. Both count what they refuse. They have no clock: the ground's takes the time from its caller.
 *
 * Frames are protected (sdls.h) if the caller gives `security`; a program that gives none links nothing of it. Then the
 * ground waits for authentic telemetry, and numbers commands from that one's number on: a spacecraft which forgot what
 * came begins both at a number that was never used. */
#ifndef CCSDS_SPACE_LINK_H
#define CCSDS_SPACE_LINK_H

#include "ccsds/cop1.h"
#include "ccsds/sdls.h"
#include "ccsds/sync.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    SPACE_LINK_UNIT = CLTU_SIZE((int)TC_FRAME_MAX),           ///< [bytes] of the largest telecommand
    SPACE_LINK_FRAME = (int)SYNC_MARKER_BYTES + TM_FRAME_MAX, ///< [bytes] of the largest frame of telemetry
    SPACE_LINK_PACKET = 4096,                                 ///< [bytes] of the longest command of the ground
    SPACE_LINK_WINDOW = 64                                    ///< frames of FOP-1 that wait for the CLCW, at most
};

/** What both ends must agree on. */
typedef struct SpaceLinkSetup {
    TcChannel commands;
    TmChannel telemetry;
    uint8_t virtual_channel; ///< of telemetry
    uint8_t map;             ///< of commands with segment headers
    uint8_t cltu;            ///< 1: commands come in CLTUs; 0: as bare frames
    uint8_t tc_random;       ///< 1: commands are randomised
    uint8_t tm_random;       ///< 1: telemetry is
    uint8_t marker;          ///< 1: frames of telemetry have a marker in front
    uint8_t window;          ///< of FARM-1
    uint8_t cop1;            ///< of the ground: 1: commands go in sequence (AD); 0: once, and nothing is known (BD)
} SpaceLinkSetup;

/** Frame security: the caller's associations and cipher, and the functions that the link calls (sdls_functions). */
typedef struct SpaceLinkSecurity {
    Sdls *sdls;
    const SdlsFunctions *functions;
} SpaceLinkSecurity;

/* ---- the spacecraft */

/** The state of the spacecraft's end: plain memory, without pointers and gaps. */
typedef struct SpaceLinkCraft {
    Farm farm;
    uint32_t packets;              ///< that came
    uint32_t corrected;            ///< codeblocks of CLTUs with one wrong bit
    uint32_t faults[CCSDS_FAULTS]; ///< CLTUs and frames that were refused, by CcsdsFault
    uint32_t frames;               ///< of telemetry that were sent
    uint32_t unprotected;          ///< of telemetry that were not, because their protection failed
    uint32_t reported;             ///< the last CLCW
    uint32_t filled;               ///< bytes of the frame that is being filled
    uint32_t first;                ///< its first header pointer
    uint32_t joined;               ///< bytes of the unit whose segments come
    uint8_t open;                  ///< 1: its first segment came
    uint8_t count;                 ///< of frames of the virtual channel
    uint8_t master_count;          ///< of those of the master channel
    uint8_t received;              ///< 1: a frame came since the last CLCW
    uint8_t frame[TM_FRAME_MAX];   ///< that is being filled
    uint8_t unit[TC_FRAME_MAX];    ///< whose segments come
} SpaceLinkCraft;

/** spi: the association that protected the packet; 0: none. */
typedef void (*SpaceLinkCommands)(void *user, const uint8_t *packet, size_t n, uint16_t spi);

/** Returns 0 if there is no such link: a spacecraft, channel, size or window that cannot be. */
int space_link_is_possible(const SpaceLinkSetup *setup, int secured);

/** All begins anew. */
void space_link_craft_begin(SpaceLinkCraft *craft, const SpaceLinkSetup *setup);

/** Bytes came: whole CLTUs, or whole frames one behind the other. room: whether the packets of a frame can be kept;
 * else FARM-1 lets the ground wait. */
void space_link_craft_take(SpaceLinkCraft *craft, const SpaceLinkSetup *setup, const SpaceLinkSecurity *security,
                           const uint8_t *bytes, size_t n, int room, SpaceLinkCommands sink, void *user);

/** Send a packet. Frames go to the sink as they are full. */
void space_link_craft_send(SpaceLinkCraft *craft, const SpaceLinkSetup *setup, const SpaceLinkSecurity *security,
                           const uint8_t *packet, size_t n, TmSink sink, void *user);

/** There is room for commands again; send what waits. With nothing to send, an idle frame goes out if `idle`,
 * or with a CLCW or security if a frame came, the CLCW has changed, or none went out yet. */
void space_link_craft_flush(SpaceLinkCraft *craft, const SpaceLinkSetup *setup, const SpaceLinkSecurity *security,
                            int idle, TmSink sink, void *user);

/* ---- the ground */

typedef enum SpaceLinkAnswer {
    SPACE_LINK_SENT = 1,      ///< without COP-1: nothing more will be known
    SPACE_LINK_CONFIRMED = 2, ///< the spacecraft has it
    SPACE_LINK_FAILED = 3     ///< it may have arrived or not
} SpaceLinkAnswer;

/** Where what the ground's end makes goes. */
typedef struct SpaceLinkSinks {
    void (*unit)(void *user, const uint8_t *bytes, size_t n); ///< to the spacecraft
    PacketSink packet;                                        ///< of telemetry
    void (*answer)(void *user, SpaceLinkAnswer answer, uint32_t tag);
    void *user;
} SpaceLinkSinks;

/** The ground's end. It must not move. */
typedef struct SpaceLinkGround {
    SpaceLinkSetup setup;
    SpaceLinkSecurity security;
    SpaceLinkSinks sinks;
    Fop fop;
    Clcw clcw;       ///< the last one
    uint32_t clcws;  ///< how many came
    uint32_t alerts; ///< how often COP-1 ended, by `alert`
    uint8_t alert;   ///< FopAlert
    uint8_t known;   ///< 1: the service ran before, so `next` is the number of its next frame
    uint8_t next;
    uint8_t moves;     ///< 1: the receiver's number is to be set to `next`
    uint8_t authentic; ///< 1: authentic telemetry came
    int64_t asks;      ///< [ns] when it may ask for a CLCW
    uint32_t tag;      ///< of the packet that is being sent; its bytes that are sent, of n; 0: none
    uint32_t failed;   ///< the tag that failed last, plus 1
    size_t n, at;
    TmReceiver receiver;
    SyncReader sync;
    size_t had;                    ///< [bytes] of a frame without a marker
    uint8_t searches;              ///< 1: the last one was damaged
    uint32_t skipped;              ///< [bytes] between frames
    uint32_t faults[CCSDS_FAULTS]; ///< frames that were refused
    FopUnit units[SPACE_LINK_WINDOW + 1];
    uint8_t memory[(SPACE_LINK_WINDOW + 1) * TC_FRAME_MAX];
    uint8_t packet[SPACE_LINK_PACKET];
    uint8_t frame[TM_FRAME_MAX];
    uint8_t whole[SPACE_PACKET_MAX];
} SpaceLinkGround;

/** security: NULL: none. timer: [ns] after which a frame is sent again; limit: how often it is sent. */
void space_link_ground_begin(SpaceLinkGround *ground, const SpaceLinkSetup *setup, const SpaceLinkSecurity *security,
                             const SpaceLinkSinks *sinks, int64_t timer, uint8_t limit);

/** Whether it takes a command. */
int space_link_ground_is_ready(const SpaceLinkGround *ground);

/** Send the packets of a command, n bytes. tag: below 2^31 - 1; answers name it. Returns 0 if it is not ready, or if
 * they are too long. */
int space_link_ground_send(SpaceLinkGround *ground, uint32_t tag, const uint8_t *packet, size_t n);

/** Bytes came: frames, or any parts of a stream of them. */
void space_link_ground_take(SpaceLinkGround *ground, const uint8_t *bytes, size_t n);

/** It is t [ns]. */
void space_link_ground_time(SpaceLinkGround *ground, int64_t t);

/** [ns] when it needs the time again; INT64_MAX: never. */
int64_t space_link_ground_due(const SpaceLinkGround *ground);

#ifdef __cplusplus
}
#endif

#endif
