/* SPDX-License-Identifier: Apache-2.0 */
/* The registers of boards over a serial line: a link of messages, in order and each once, over a stream of bytes that
 * loses, changes and adds bytes; and a mirror, which makes messages of what has changed in the boards' memory.
 *
 *     sync F1 ED | length | kind | flags | sequence | acknowledged | session | tick | payload     | CRC-32
 *     2 bytes      2        1      1       2          2              4         4      0 to 512      4
 *
 * All numbers are little-endian. The CRC, that of mcap_crc.h, is of all bytes before it. The receiver takes a frame of
 * its session if it is the next one, and requests the rest again (go-back-N, LINE_WINDOW frames) if one is missing or
 * damaged; behind bytes that are no frame it looks for the next sync. A part of a frame that silence follows is kept
 * until its rest comes, or a whole frame. The sender also repeats what was not acknowledged for some time.
 *
 * The outside requests an acknowledgement when nothing has come for 250 ms.
 *
 * A session begins with the HELLO of the outside, which repeats it until the board has answered by a WELCOME. In
 * frames, `session` is its number XOR that of the board's start, so none passes between ends that do not know of each
 * other. A board answers such a frame by a WELCOME, of session 0 if it was not greeted since its start: so the outside
 * learns that the board has started anew. Neither end keeps anything of an earlier session.
 *
 * Nothing here does I/O or needs a heap. Each end gives the bytes that come to line_input, sends the frames that
 * line_output gives, and does both many times a second, or at the time that line_wake tells. Of one end all calls come
 * from one thread. */
#ifndef REGISTERS_LINE_H
#define REGISTERS_LINE_H

#include "record/mcap_crc.h"
#include "registers/window.h"

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum {
    LINE_VERSION = 1,
    LINE_HEAD = 18,     ///< [bytes] before the payload
    LINE_PAYLOAD = 512, ///< [bytes] at most
    LINE_FRAME = LINE_HEAD + LINE_PAYLOAD + 4,
    LINE_WINDOW = 8,      ///< frames that an end sends before one of them is acknowledged
    LINE_BOARD = 1 << 20, ///< words of the largest board that the mirror carries
    LINE_BOARDS = 16,     ///< how many boards
    LINE_NAME = 48,       ///< [bytes] of a name with its 0
    LINE_BUILD = 20       ///< [bytes] of the build id of an ELF
};

typedef enum LineKind {
    LINE_HELLO = 1,   ///< outside, out of sequence: a LineHello
    LINE_WELCOME = 2, ///< board, out of sequence: a LineWelcome
    LINE_CONTROL = 3, ///< out of sequence, no payload: acknowledges, or asks for what is missing
    LINE_SHOUT = 4,   ///< board, out of sequence: text about a fault; it comes, or is lost
    LINE_WORDS = 5,   ///< what has changed in the boards' memory; the last one of an exchange has LINE_LAST
    LINE_RECORD = 6,  ///< board: the position in the record (4 bytes), then bytes of it
    LINE_TEXT = 7,    ///< board: text for the console, of any length
    LINE_END = 8      ///< board: the run has ended, with this exit status (1 byte)
} LineKind;

enum {
    LINE_LAST = 1 << 0, ///< of WORDS: the memory is now as the other end has it
    LINE_ASK = 1 << 1,  ///< acknowledge at once
    LINE_AGAIN = 1 << 2 ///< of CONTROL: send again from the acknowledged sequence on
};

enum {
    LINE_RECORDS = 1 << 0, ///< of a hello: send the record
    LINE_GO_ON = 1 << 1    ///< of a hello: the same run goes on, after the board was reset
};

typedef struct LineHello {
    uint32_t version; ///< LINE_VERSION
    uint32_t session; ///< any number but 0, another one for each session
    uint32_t flags;   ///< LINE_RECORDS | LINE_GO_ON
    uint32_t baud;    ///< of the line [bits/s], by which both ends know how long frames take; 0: 115200
    uint64_t hash;    ///< of what both ends must agree on, as the outside has it
} LineHello;

typedef struct LineWelcome {
    uint32_t version;
    uint32_t session; ///< 0: the board waits for a hello
    uint32_t boot;    ///< a number that another board, or this one after a reset, does not have; 0: not greeted yet
    uint32_t starts;  ///< of the program since power-on, if the board knows: 1, 2 ...
    uint64_t hash;
    uint8_t build[LINE_BUILD]; ///< all 0: the board does not know
    char target[LINE_NAME];
    char mission[LINE_NAME];
} LineWelcome;

/** A message that has come. */
typedef struct LineMessage {
    LineKind kind;
    uint32_t flags;
    uint32_t tick;
    const uint8_t *bytes; ///< valid until the function returns
    uint32_t n;
    LineHello hello;     ///< of HELLO
    LineWelcome welcome; ///< of WELCOME
} LineMessage;

typedef void (*LineTake)(void *user, const LineMessage *message);

typedef struct LineCounts {
    uint32_t frames_sent, frames_taken; ///< of all kinds; taken: whole, also if they came before
    uint32_t resent;
    uint32_t damaged;   ///< frames, or what began like one
    uint32_t stray;     ///< [bytes] that belong to no frame
    uint32_t foreign;   ///< frames of another session
    uint32_t unordered; ///< frames that came twice, or before a missing one
    uint64_t bytes_sent, bytes_taken;
} LineCounts;

/** A message that waits for its acknowledgement. */
typedef struct LineSent {
    uint8_t kind, flags;
    uint16_t n;
    uint32_t tick;
    uint8_t bytes[LINE_PAYLOAD];
} LineSent;

/** One end of a link. The members are line.c's own, but all may read `counts` and `received_at`. */
typedef struct LineEnd {
    LineTake take;
    void *user;
    int is_board;
    int open;            ///< outside: welcomed; board: greeted
    int greet;           ///< a HELLO or WELCOME is to be sent
    uint32_t session;    ///< 0: none
    uint32_t past;       ///< the session before
    LineHello hello;     ///< outside: of this end; board: of the session
    LineWelcome welcome; ///< board: of this end; outside: of the session
    int64_t received_at; ///< [ns] when the last whole frame of this session came
    int64_t probed;      ///< [ns] when the outside last probed the board
    int64_t greeted;     ///< [ns] when the last HELLO or WELCOME was sent
    LineCounts counts;

    uint16_t base;     ///< the first sequence that is not acknowledged
    uint16_t next;     ///< the first that is free
    uint16_t unsent;   ///< the next one to be sent; base to next
    uint16_t furthest; ///< the first that was never sent
    int64_t sent;      ///< [ns] when the oldest one was sent, or the last acknowledgement came
    uint32_t repeats;  ///< by time, since the last acknowledgement
    LineSent window[LINE_WINDOW];

    uint16_t expected;    ///< the sequence that is taken next
    uint16_t owed;        ///< frames taken and not acknowledged
    int owe_now;          ///< acknowledge at once
    int missing;          ///< a frame is missing: request it
    int64_t owed_since;   ///< [ns]
    int64_t requested_at; ///< [ns] when the missing frame was last requested
    uint16_t requested;   ///< the sequence of that request
    int has_requested;

    int64_t came; ///< [ns] when the last byte came
    int doubtful; ///< the frame that `in` begins with was followed by silence
    size_t n;     ///< bytes in `in`
    uint8_t in[LINE_FRAME];
    uint8_t out[LINE_FRAME];
    uint32_t shout; ///< CRC of the last one
    McapCrc crc;
} LineEnd;

/** The outside's end: begin a session. What the end had of an earlier one is forgotten, but its counts and the bytes of
 *  a frame that has come in part. Zero the memory before the first time. */
void line_greet(LineEnd *e, const LineHello *hello, LineTake take, void *user, int64_t now);

/** The board's end: wait for the greeting. welcome->session and ->version are set here. */
void line_await(LineEnd *e, const LineWelcome *welcome, LineTake take, void *user, int64_t now);

/** Bytes that have come. Each message goes to `take`, at once, which calls neither line_input nor line_output. HELLO:
 *  the session is a new one, and the window is empty; WELCOME: each that comes in an open session, and before that the
 *  first one of this session. */
void line_input(LineEnd *e, const void *bytes, size_t n, int64_t now);

/** The next frame that is to be sent now, valid until the next call; NULL: there is none. */
const uint8_t *line_output(LineEnd *e, int64_t now, size_t *n);

/** [ns] until line_output has a frame even if no byte comes; at most 100 ms. */
int64_t line_wake(const LineEnd *e, int64_t now);

/** Whether the session is open. Only then messages pass. */
int line_is_open(const LineEnd *e);

/** How many messages line_put takes now, 0 to LINE_WINDOW; 0 if the session is not open. */
uint32_t line_room(const LineEnd *e);

/** Put a message into the window. Returns 0 if there is no room. */
int line_put(LineEnd *e, LineKind kind, uint32_t flags, uint32_t tick, const void *bytes, size_t n);

/** Whether all messages are acknowledged. */
int line_is_flushed(const LineEnd *e);

/** Make a frame with text out of sequence, of at most LINE_PAYLOAD bytes, without a change of the end: for a handler of
 *  faults. `number` tells one text from another, so a frame may be sent more than once. Returns its size. */
size_t line_shout(const LineEnd *e, const char *text, size_t n, uint32_t number, uint8_t frame[LINE_FRAME]);

/* ---- the mirror
 *
 * The payload of WORDS is runs: count (1 byte), board (1), the first word (2), then so many words of 4 bytes as they
 * lie in memory. Both ends begin with a shadow of zeros, which is what the other end's memory holds. */

typedef struct LineMirror {
    const RegisterWindow *windows;
    uint32_t n_windows;
    uint32_t *shadow;
    uint32_t board, word; ///< where line_mirror_take goes on
    uint32_t at;          ///< the same, as an index of the shadow
    uint32_t from, to;    ///< the indices between which line_mirror_finish has something to do
} LineMirror;

/** [bytes] of the shadow; 0 if a board has more than LINE_BOARD words, or there are more than LINE_BOARDS. */
size_t line_mirror_size(const RegisterBoard *const *boards, uint32_t n);

/** Begin with a shadow of zeros. The windows' memory stays as it is. */
void line_mirror_begin(LineMirror *m, const RegisterWindow *windows, uint32_t n, void *shadow);

/** Make the next payload of words that differ from the shadow, and bring them into the shadow. Returns its size, up to
 *  LINE_PAYLOAD. *last: 1 if nothing more differs; the call after that begins anew. */
uint32_t line_mirror_take(LineMirror *m, uint8_t *payload, int *last);

/** Bring a payload that has come into the shadow. Returns 0 if it is none of these boards; nothing was done then. */
int line_mirror_put(LineMirror *m, const uint8_t *payload, uint32_t n);

/** After the last one: bring the shadow into the memory. */
void line_mirror_finish(LineMirror *m);

#ifdef __cplusplus
}
#endif

#endif
