/* SPDX-License-Identifier: Apache-2.0 */
/* Security of frames (CCSDS 355.0-B-2): telecommands and telemetry that only the owner of a key can make, and read if
 * they are encrypted too.
 *
 *     byte 0  association (SPI)                      of the field between a frame's header and its trailer; behind
 *          2  fixed part of the number               the segment header of a telecommand
 *          6  number of the frame, 8 bytes           both parts: the initialisation vector
 *         14  data, encrypted if the association says so
 *             message authentication code, 16 bytes: of what identifies the channel, the association and the data
 *
 * The cipher is AES-GCM, of somebody else (SdlsCipher). The authenticated bits in front of the data are the virtual
 * channel, the segment header and the association: counts of frames are set later, by FOP-1 and by the master channel.
 * So a telecommand is protected before FOP-1 sees it, and sent again as it is. On board the standard checks after
 * FARM-1, where a forged frame takes the number of a true one, which then is lost without notice. Here the check
 * comes first and changes nothing; sdls_accept() follows when FARM-1 has accepted. The link shows no difference. Frames
 * of type BC have no protection: the standard has none for them. */
#ifndef CCSDS_SDLS_H
#define CCSDS_SDLS_H

#include "ccsds/tc_frame.h"
#include "ccsds/tm_frame.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    SDLS_HEADER = 14,   ///< [bytes]
    SDLS_TAG = 16,      ///< [bytes]
    SDLS_OVERHEAD = 30, ///< [bytes] that the data of a frame loses
    SDLS_VECTOR = 12,   ///< [bytes]
    SDLS_WINDOW = 256   ///< the largest window
};

typedef enum SdlsService { SDLS_AUTHENTICATE = 1, SDLS_ENCRYPT = 2 } SdlsService; ///< the second includes the first

/** What a cipher is to do. */
typedef struct SdlsText {
    const uint8_t *head; ///< to authenticate
    size_t head_size;    ///< [bytes]
    uint8_t *data;       ///< to authenticate and, if `encrypt`, to encrypt or decrypt in place
    size_t n;            ///< [bytes]
    uint8_t encrypt;     ///< 1 or 0
    uint8_t opening;     ///< 1: what came; 0: what goes
} SdlsText;

/** AES-GCM, with the keys. It works on the text by the key of that id, and writes the code into `tag`. Returns 0 if it
 * has no such key. */
typedef struct SdlsCipher {
    int (*run)(void *user, uint16_t key, const uint8_t vector[SDLS_VECTOR], const SdlsText *text,
               uint8_t tag[SDLS_TAG]);
    void *user;
} SdlsCipher;

/** The states of an association. */
typedef enum SdlsState { SDLS_UNKEYED = 0, SDLS_KEYED = 1, SDLS_OPERATIONAL = 2 } SdlsState;

/** A security association: how the frames of one virtual channel, in one direction, are protected. */
typedef struct SdlsAssociation {
    uint16_t spi;        ///< its number in frames, 1 to 65534
    uint8_t telecommand; ///< 1: of telecommands; 0: of telemetry
    uint8_t virtual_channel;
    uint8_t service; ///< SdlsService
    uint16_t window; ///< how far behind the newest frame another may come, 1 to SDLS_WINDOW; with COP-1 below 256
    uint16_t key;    ///< its id
    uint32_t fixed; ///< of the vector. Associations that share a key must differ in it: a vector used twice reveals all
    uint8_t state;  ///< SdlsState
    uint64_t next;  ///< the number of the next frame; at the receiver, the newest that was accepted + 1
    uint32_t seen[SDLS_WINDOW / 32]; ///< a bit for each number in the window, by its remainder
    uint32_t accepted;
    uint32_t free; ///< at a receiver: the bits of `fixed` that the sender may choose, as one without memory does
} SdlsAssociation;

/** One end of a link. The memory and the cipher are the caller's. */
typedef struct Sdls {
    SdlsCipher cipher;
    SdlsAssociation *associations;
    uint32_t n;
    uint32_t faults[CCSDS_FAULTS]; ///< frames that were refused. ASSOCIATION: of none that is in operation here;
                                   ///< REPLAY: also what FOP-1 sent again although it had arrived
} Sdls;

/* The life of an association (355.1-B). Each returns 0 if the state does not allow it. */

/** Give it a key. next: the number of the first frame. The owner keeps numbers over a reset: with the same key, a
 * sender goes on behind all that it used, a receiver with what it had. */
int sdls_rekey(SdlsAssociation *association, uint16_t key, uint64_t next);
int sdls_start(SdlsAssociation *association);
int sdls_stop(SdlsAssociation *association);
int sdls_expire(SdlsAssociation *association);

/** A frame that was checked, to be accepted. */
typedef struct SdlsReceipt {
    SdlsAssociation *association; ///< NULL: of a frame without protection
    uint64_t number;
} SdlsReceipt;

/** Protect the data of a telecommand, of type AD or BD, before FOP-1: its part and MAP must be set. The first
 * association of the channel that is in operation does it. memory: TC_FRAME_MAX bytes, where `frame->data` points
 * afterwards. */
CcsdsFault sdls_tc_protect(Sdls *sdls, const TcChannel *channel, TcFrame *frame, uint8_t *memory);

/** Check a telecommand that was read, before FARM-1. Its data is then without protection, in `memory` of TC_FRAME_MAX
 * bytes. Control commands pass. */
CcsdsFault sdls_tc_check(Sdls *sdls, const TcChannel *channel, TcFrame *frame, uint8_t *memory, SdlsReceipt *receipt);

/** FARM-1 accepted it: it is refused from now on. */
void sdls_accept(const SdlsReceipt *receipt);

/** Protect a virtual channel of telemetry, idle frames too. Call it after tm_virtual_begin(). A frame that no
 * association protects is not sent; sender->unprotected counts it. */
void sdls_tm_protect(Sdls *sdls, TmVirtual *vc);

/** Check a telemetry frame that was read, and accept it. Its zone is then without protection, in `memory` of
 * TM_FRAME_MAX bytes. */
CcsdsFault sdls_tm_open(Sdls *sdls, TmFrame *frame, uint8_t *memory);

/** These functions as data: a caller that only gets a pointer to them need not link them. */
typedef struct SdlsFunctions {
    CcsdsFault (*tc_protect)(Sdls *sdls, const TcChannel *channel, TcFrame *frame, uint8_t *memory);
    CcsdsFault (*tc_check)(Sdls *sdls, const TcChannel *channel, TcFrame *frame, uint8_t *memory, SdlsReceipt *receipt);
    void (*accept)(const SdlsReceipt *receipt);
    void (*tm_protect)(Sdls *sdls, TmVirtual *vc);
    CcsdsFault (*tm_open)(Sdls *sdls, TmFrame *frame, uint8_t *memory);
} SdlsFunctions;

extern const SdlsFunctions sdls_functions;

/** What a host gives to flight software that is built without it. */
typedef struct SdlsProvider {
    SdlsCipher cipher; ///< with the keys
    const SdlsFunctions *functions;
    uint64_t since; ///< [ns] when flight's time began, on a clock that no reset sets back; 0: that time itself is one
} SdlsProvider;

#ifdef __cplusplus
}
#endif

#endif
