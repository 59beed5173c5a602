/* SPDX-License-Identifier: Apache-2.0 */
/* Telecommand transfer frames (CCSDS 232.0-B-4), with segment headers, and the word by which the spacecraft answers
 * (CLCW).
 *
 *     byte 0  version (2 bits, 0), bypass, control command, 0, 0, spacecraft (10 bits)
 *          2  virtual channel (6 bits), size - 1 (10 bits)
 *          4  number of the frame
 *          5  of data: a segment header, that is part (2 bits) and MAP (6 bits), if the channel has them; then the data
 *             and, if the channel has one, a CRC */
#ifndef CCSDS_TC_FRAME_H
#define CCSDS_TC_FRAME_H

#include "ccsds/space_packet.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { TC_FRAME_HEADER = 5, TC_FRAME_MAX = 1024, TC_MAPS = 64, TC_CHANNELS = 64 };

/** AD: in sequence, and sent again if it is lost. BD: expedited. BC: a command to the receiver itself. */
typedef enum TcType { TC_AD = 0, TC_BC = 1, TC_BD = 2 } TcType;

/** The commands in frames of type BC. */
typedef enum TcControl { TC_UNLOCK = 1, TC_SET = 2 } TcControl;

/** What is the same for all frames of a virtual channel. */
typedef struct TcChannel {
    uint16_t spacecraft;     ///< 10 bits
    uint8_t virtual_channel; ///< 6 bits
    uint8_t segments;        ///< 1: frames of data have a segment header
    uint8_t check;           ///< 1: frames end with a CRC
} TcChannel;

/** The content of a frame. */
typedef struct TcFrame {
    const uint8_t *data; ///< behind the segment header
    size_t n;            ///< [bytes] of it
    size_t size;         ///< [bytes] of the frame: what follows it fills the codeblock
    uint8_t type;        ///< TcType
    uint8_t number;
    uint8_t part;    ///< SpacePacketPart; without segment headers SPACE_PACKET_WHOLE
    uint8_t map;     ///< without segment headers 0
    uint8_t control; ///< TcControl, of type BC
    uint8_t value;   ///< of TC_SET: the number of the next frame
} TcFrame;

/** Read the frame with which n bytes begin. */
CcsdsFault tc_frame_read(const TcChannel *channel, const uint8_t *bytes, size_t n, TcFrame *frame);

/** Write a frame of data, of type AD or BD; `part` and `map` count if the channel has segment headers. Returns its
 * size, 0 if the data does not fit into TC_FRAME_MAX. */
size_t tc_frame_write(const TcChannel *channel, const TcFrame *frame, uint8_t *bytes);

/** Write a frame of type BC. Returns its size. */
size_t tc_control_write(const TcChannel *channel, TcControl control, uint8_t value, uint8_t *bytes);

/** [bytes] of data that fit into a frame. */
static inline size_t tc_room(const TcChannel *channel)
{
    return (size_t)TC_FRAME_MAX - TC_FRAME_HEADER - (channel->segments ? 1u : 0u) - (channel->check ? 2u : 0u);
}

/** Join the segments of one MAP: take the data of a frame that was accepted. Returns 1 if a unit is whole. */
static inline int tc_join(PartJoiner *joiner, const TcFrame *frame)
{
    return part_join(joiner, frame->part, frame->data, frame->n, CCSDS_GAP);
}

/** The communications link control word (232.0-B-4, 4.2): the state of the receiver of commands. */
typedef struct Clcw {
    uint8_t virtual_channel;
    uint8_t no_rf; ///< flags, 1 or 0
    uint8_t no_bit_lock;
    uint8_t lockout;
    uint8_t wait;
    uint8_t retransmit;
    uint8_t bypasses; ///< 2 bits: the count of frames of types BC and BD that were accepted
    uint8_t next;     ///< the number of the next frame
} Clcw;

uint32_t clcw_word(const Clcw *clcw);

/** Returns 0 if the word is no CLCW of COP-1. */
int clcw_read(uint32_t word, Clcw *clcw);

#ifdef __cplusplus
}
#endif

#endif
