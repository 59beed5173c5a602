/* SPDX-License-Identifier: Apache-2.0 */
/* Telemetry transfer frames (CCSDS 132.0-B-3), and the reading of AOS frames (732.0-B-4).
 *
 *     byte 0  version (2 bits, 0), spacecraft (10 bits), virtual channel (3 bits), 1 with an operational control field
 *          2  count of the master channel's frames        3  count of the virtual channel's
 *          4  secondary header (1 bit), 0, 0, 3 (2 bits), first header pointer (11 bits)
 *          6  the zone of packets; then 4 bytes of operational control (a CLCW) and 2 of check, if the channel has them
 *
 * All frames of a channel have one size. Packets span frames; idle packets and frames fill. */
#ifndef CCSDS_TM_FRAME_H
#define CCSDS_TM_FRAME_H

#include "ccsds/packet_zone.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { TM_FRAME_HEADER = 6, TM_FRAME_MAX = 2048, TM_CHANNELS = 8, TM_CONTROL = 4, TM_CHECK = 2 };
enum { AOS_FRAME_HEADER = 6, AOS_CHANNELS = 64 };
enum { TM_RECALLED = 16 }; ///< frames of a virtual channel that a receiver knows again

/** What is the same for all frames of a physical channel. */
typedef struct TmChannel {
    uint16_t spacecraft; ///< 10 bits
    uint16_t size;       ///< [bytes] of a frame
    uint8_t control;     ///< 1: frames end with an operational control field
    uint8_t check;       ///< 1: frames end with a CRC
} TmChannel;

/** [bytes] of packets in a frame. */
static inline size_t tm_zone(const TmChannel *channel)
{
    return channel->size - (size_t)TM_FRAME_HEADER - (channel->control ? (size_t)TM_CONTROL : 0u) -
           (channel->check ? (size_t)TM_CHECK : 0u);
}

/** The content of a frame. */
typedef struct TmFrame {
    const uint8_t *zone;
    size_t n;         ///< [bytes] of the zone
    uint32_t first;   ///< first header pointer
    uint32_t control; ///< the operational control field
    uint32_t count;   ///< of the virtual channel
    uint16_t spacecraft;
    uint16_t check; ///< the CRC of the frame, also if the channel sends none
    uint8_t virtual_channel;
    uint8_t master_count;
    uint8_t has_control; ///< 1: there is one
} TmFrame;

/** Read a frame of n bytes. */
CcsdsFault tm_frame_read(const TmChannel *channel, const uint8_t *bytes, size_t n, TmFrame *frame);

/** Read an AOS frame of n bytes, whose zone is an M_PDU. before: [bytes] between its header and the M_PDU, of a header
 * error control and an insert zone; check: it ends with a CRC; control: with an operational control field in front of
 * that. */
CcsdsFault aos_frame_read(const uint8_t *bytes, size_t n, size_t before, int control, int check, TmFrame *frame);

typedef void (*TmSink)(void *user, const uint8_t *frame, size_t n);

/** Protects the zone of a virtual channel's frame, whose first and last bytes are kept for that. Returns 0 if it
 * cannot: the frame is then not sent. */
typedef int (*TmProtect)(void *user, uint8_t virtual_channel, uint8_t *zone, size_t n);

/** One virtual channel of a sender, with the frame that is being filled. */
typedef struct TmVirtual {
    uint8_t *frame; ///< memory for a frame
    size_t n;       ///< [bytes] of its zone that are filled
    uint32_t first;
    uint8_t number;
    uint8_t count;
    uint8_t before; ///< [bytes] of the zone that are kept for `protect`
    uint8_t behind;
    TmProtect protect; ///< NULL: without
    void *protector;
} TmVirtual;

/** A sender: the master channel. */
typedef struct TmSender {
    TmChannel channel;
    TmSink sink;
    void *user;
    uint32_t control;     ///< the operational control field of the frames that follow
    uint32_t unprotected; ///< frames that were not sent, because their protection failed
    uint8_t count;
} TmSender;

/** Returns 0 if the channel cannot be: its size, its spacecraft. */
int tm_sender_begin(TmSender *sender, const TmChannel *channel, TmSink sink, void *user);

void tm_virtual_begin(TmVirtual *vc, uint8_t number, uint8_t *frame);

/** Put a packet into the frames of a virtual channel. Frames go to the sink as they are full. */
void tm_send(TmSender *sender, TmVirtual *vc, const uint8_t *packet, size_t n);

/** Send what waits in a frame, filled with an idle packet. What is left of a frame may be too short for one; then the
 * idle packet goes on in the next frame, which waits. */
void tm_flush(TmSender *sender, TmVirtual *vc);

/** Send a frame of idle data, on a virtual channel that has no packets waiting. */
void tm_idle(TmSender *sender, TmVirtual *vc);

/** One virtual channel of a receiver. */
typedef struct TmReceiver {
    PacketZone zone;
    uint32_t count;  ///< that is expected
    uint32_t counts; ///< 256 for TM, 2^24 for AOS
    uint32_t frames;
    uint32_t missing;           ///< frames, by the counts
    uint32_t repeated;          ///< frames that came before, and were not taken again
    uint64_t came[TM_RECALLED]; ///< by count % TM_RECALLED: 1, count (24 bits), check (16 bits); 0: none
    uint8_t begun;
} TmReceiver;

/** memory: for the packet that spans frames. Returns 0 if it has less than ENCAPSULATION_HEADER_MAX bytes. */
int tm_receiver_begin(TmReceiver *receiver, uint32_t counts, uint8_t *memory, size_t room, PacketSink sink, void *user);

/** Take a frame of this virtual channel. One that repeats one of the last TM_RECALLED, by count and CRC, is passed
 * over; else its count, which is not the expected one, would tell of almost all counts as missing. The limit: after a
 * gap, frames with equal content (idle data) within TM_RECALLED counts are taken for repetitions, so that `missing` is
 * too small then. */
void tm_receive(TmReceiver *receiver, const TmFrame *frame);

#ifdef __cplusplus
}
#endif

#endif
