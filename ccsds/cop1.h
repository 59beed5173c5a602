/* SPDX-License-Identifier: Apache-2.0 */
/* The communications operation procedure COP-1 (CCSDS 232.1-B-2): frames of type AD arrive once and in order, or the
 * sender knows. FARM-1 accepts frames on board; FOP-1 sends them, and sends again what the CLCW reports as missing.
 * Neither has a clock: FOP-1 takes the time from its caller, and returns until when it waits. */
#ifndef CCSDS_COP1_H
#define CCSDS_COP1_H

#include "ccsds/tc_frame.h"

#ifdef __cplusplus
extern "C" {
#endif

/* ---- FARM-1 */

typedef enum FarmState { FARM_OPEN = 1, FARM_WAIT = 2, FARM_LOCKOUT = 3 } FarmState;

/** The receiver of one virtual channel. */
typedef struct Farm {
    uint8_t state; ///< FarmState
    uint8_t next;  ///< V(R), the number of the next frame
    uint8_t retransmit;
    uint8_t wait;
    uint8_t bypasses; ///< FARM-B counter, of which the CLCW has two bits
    uint8_t window;   ///< W, even, 2 to 254: half of it ahead of `next`, half behind
    uint8_t spare[2];
    uint32_t accepted;
    uint32_t discarded;
} Farm;

/** Returns 0 if there is no such window. */
int farm_begin(Farm *farm, uint8_t window);

/** Take a frame that was read without a fault. room: whether its data can be kept. Returns 1 if it is accepted; that of
 * a frame of type BC is then done. FARM-1 accepts any frame of type BD: the caller discards what waits, if that takes
 * its room. */
int farm_frame(Farm *farm, const TcFrame *frame, int room);

/** There is room again. */
void farm_room(Farm *farm);

/** The content of the CLCW; flags of the radio are 0. */
Clcw farm_clcw(const Farm *farm, uint8_t virtual_channel);

/* ---- FOP-1 */

typedef enum FopState {
    FOP_ACTIVE = 1,
    FOP_RETRANSMIT = 2,      ///< without wait
    FOP_RETRANSMIT_WAIT = 3, ///< the receiver has no room
    FOP_CHECKING = 4,        ///< initialising: a CLCW is awaited
    FOP_CONTROLLING = 5,     ///< initialising: a frame of type BC is under way
    FOP_INITIAL = 6
} FopState;

/** How FOP-1 answers a request. */
typedef enum FopAnswer {
    FOP_ACCEPTED = 1,
    FOP_REJECTED = 2,
    FOP_CONFIRMED = 3, ///< a frame arrived; a directive is done
    FOP_FAILED = 4,    ///< it may have arrived or not
    FOP_ALERT = 5,     ///< the service ended; what: FopAlert
    FOP_SUSPENDED = 6  ///< the timer expired; FOP_RESUME goes on
} FopAnswer;

typedef enum FopAlert {
    FOP_ALERT_LIMIT = 1,   ///< a frame was sent as often as allowed
    FOP_ALERT_T1 = 2,      ///< the same, and no CLCW came
    FOP_ALERT_LOCKOUT = 3, ///< the receiver is locked: FOP_INITIATE_UNLOCK
    FOP_ALERT_SYNCH = 4,   ///< the CLCW contradicts what was sent
    FOP_ALERT_NNR = 5,     ///< the CLCW has a number that was not sent
    FOP_ALERT_CLCW = 6,    ///< the CLCW's flags contradict one another
    FOP_ALERT_LLIF = 7,    ///< the link refused a frame
    FOP_ALERT_TERM = 8     ///< FOP_TERMINATE
} FopAlert;

typedef enum FopDirective {
    FOP_INITIATE = 1,        ///< without a check of the CLCW
    FOP_INITIATE_CHECK = 2,  ///< when a CLCW shows that both ends agree
    FOP_INITIATE_UNLOCK = 3, ///< after an unlock
    FOP_INITIATE_SET = 4,    ///< after the receiver's number is set to `value`
    FOP_TERMINATE = 5,
    FOP_RESUME = 6,
    FOP_SET_NUMBER = 7,  ///< V(S)
    FOP_SET_WINDOW = 8,  ///< K, 1 to 255
    FOP_SET_TIMER = 9,   ///< T1_Initial, in units of 1 ms
    FOP_SET_LIMIT = 10,  ///< how often a frame is sent, at least 1
    FOP_SET_TIMEOUT = 11 ///< TT: 0 alert, 1 suspend, when the timer expires after the last transmission
} FopDirective;

/** The link below: send a frame's data. type: TcType. of BC: data[0] is TcControl, data[1] its value. Returns 1 if the
 * link takes it and is ready for the next, 0 if it takes it and is busy until fop_ready(), -1 if it refuses. */
typedef int (*FopSend)(void *user, TcType type, uint8_t number, const uint8_t *data, size_t n);

/** tag: of the request, which its user chose; of FOP_ALERT and FOP_SUSPENDED: 0. what: FopAlert. */
typedef void (*FopNotify)(void *user, FopAnswer answer, uint32_t tag, uint32_t what);

/** A frame's data that may have to be sent again. */
typedef struct FopUnit {
    uint32_t tag;
    uint16_t n;
    uint8_t number;
    uint8_t again; ///< to be retransmitted
} FopUnit;

/** The sender of one virtual channel. */
typedef struct Fop {
    FopSend send;
    FopNotify notify;
    void *user;
    FopUnit *units;  ///< memory for window + 1: those that were sent, a ring, and the one that waits
    uint8_t *memory; ///< `room` bytes for each of them
    uint32_t room;
    uint32_t capacity;  ///< of the ring: the largest window
    uint32_t first;     ///< the oldest of the ring
    uint32_t sent;      ///< how many are in the ring
    uint32_t directive; ///< the tag of the directive that is not done yet
    int64_t timer;      ///< [ns] T1_Initial
    int64_t expires;    ///< [ns] when the timer expires; INT64_MAX: it does not run
    int64_t now;        ///< [ns]
    uint8_t state;      ///< FopState
    uint8_t number;     ///< V(S), of the next frame
    uint8_t expected;   ///< NN(R), the oldest that is not acknowledged
    uint8_t window;     ///< K
    uint8_t limit;
    uint8_t transmissions;
    uint8_t timeout;     ///< TT
    uint8_t suspended;   ///< SS: the state that FOP_RESUME goes back to, 0: none
    uint8_t waiting;     ///< 1: a unit waits
    uint8_t ready[3];    ///< by TcType: the link takes a frame
    uint8_t control[2];  ///< the frame of type BC that is under way
    uint8_t controlling; ///< 1: there is one; 2: to be retransmitted
    uint8_t spare[2];
} Fop;

/** units: capacity + 1 of them, 2 to 256; memory: room bytes for each. timer: [ns]. Begins in FOP_INITIAL. */
void fop_begin(Fop *fop, FopUnit *units, uint8_t *memory, uint32_t room, uint32_t capacity, int64_t timer, FopSend send,
               FopNotify notify, void *user);

/** Send data in sequence (AD). It is rejected while another unit waits for the window, or outside of the service. */
void fop_transfer(Fop *fop, uint32_t tag, const uint8_t *data, size_t n);

/** Send data without sequence (BD). */
void fop_bypass(Fop *fop, uint32_t tag, const uint8_t *data, size_t n);

void fop_directive(Fop *fop, uint32_t tag, FopDirective directive, uint32_t value);

/** A CLCW arrived. */
void fop_clcw(Fop *fop, const Clcw *clcw);

/** A word arrived that is no valid CLCW. */
void fop_invalid_clcw(Fop *fop);

/** It is t [ns]: the timer may expire. */
void fop_time(Fop *fop, int64_t t);

/** The link is ready for the next frame of a type. good: 0 if it could not send the last one. */
void fop_ready(Fop *fop, TcType type, int good);

#ifdef __cplusplus
}
#endif

#endif
