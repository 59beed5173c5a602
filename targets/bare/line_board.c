/* SPDX-License-Identifier: Apache-2.0 */
/* A board on a serial line, over the five functions of port.h: the boards of the mission are memory here, which the
 * outside mirrors. A run is a session of the line. If the board is reset, the outside greets it again, gives it the
 * memory as it was, and the run goes on. */
#include "registers/line.h"
#include "targets/bare/bare.h"
#include "targets/bare/fault.h"
#include "targets/bare/memory.h"
#include "targets/bare/port.h"

#include <string.h>

/* Memory for the boards, and for the outside's copy of it. */
#ifndef FLEDGE_LINE_BYTES
#define FLEDGE_LINE_BYTES 65536
#endif

#define LONGEST_SILENCE INT64_C(2000000000) /* [ns] of an outside that is asked to acknowledge the end */

enum { KEPT = 0x4c494e45, POSITION = 4, SHOUTS = 3, RING = 4096 };

/* A reset does not change this: bytes of the record until the outside has them. */
typedef struct Kept {
    uint32_t mark;     /* own_mark(): the rest is of the program before the reset */
    uint32_t starts;   /* of the program */
    uint32_t recorded; /* bytes of the record so far */
    uint32_t safe;     /* how many of them the outside has acknowledged */
    uint8_t ring[RING];
} Kept;

typedef struct Bytes {
    size_t n;
    uint8_t bytes[LINE_PAYLOAD];
} Bytes;

static LineEnd line;
static LineMirror mirror;
static uint64_t memory[FLEDGE_LINE_BYTES / 8];
static Kept *kept;
static Bytes text; /* not in the line's window yet */
static const RegisterWindow *clock_window;
static uint32_t greetings;            /* sessions so far */
static uint32_t ended;                /* the session whose run has ended, as counted by `greetings` */
static uint32_t flying;               /* the session whose run flight is in */
static int has_flown;                 /* flight has answered since the start of the program */
static uint32_t sent;                 /* bytes of the record that are in the line's window, or were */
static uint32_t sent_by[LINE_WINDOW]; /* the same when each frame of the window was put */
static uint16_t acknowledged;         /* sequence of the line, at the last poll */
static int has_come;                  /* all words of an exchange are in the shadow */
static uint16_t answer_end;           /* sequence behind the last answer */
static uint32_t shouts;

size_t bare_kept;

/* Defined by a linker script that keeps the note of the build id (--build-id). */
extern const uint8_t fledge_build_note[] __attribute__((weak));

/* ---- the line */

static void pump(void)
{
    uint8_t bytes[128];
    size_t n;
    for (const uint8_t *frame; (frame = line_output(&line, board_time(), &n)) != NULL;) {
        board_send(frame, n);
    }
    n = board_receive(bytes, sizeof bytes);
    line_input(&line, bytes, n, board_time());
    if (line.base != acknowledged) {
        acknowledged = line.base;
        kept->safe = sent_by[(uint16_t)(acknowledged - 1u) % LINE_WINDOW];
    }
    board_watch();
}

/* Whether the outside has begun another run, while flight is still in the one before. */
static int is_over(void)
{
    return flying != greetings;
}

/* Put a message into the window, as soon as there is room. */
static void put(LineKind kind, uint32_t flags, const void *bytes, size_t n)
{
    const uint32_t tick = register_load(clock_window, clock_window->board->clock + REGISTER_CLOCK_TICK);
    while (!is_over() && line_room(&line) == 0u) {
        pump();
    }
    if (!is_over()) {
        sent_by[line.next % LINE_WINDOW] = sent;
        (void)line_put(&line, kind, flags, tick, bytes, n);
    }
}

static void flush_text(void)
{
    if (text.n > 0u) {
        put(LINE_TEXT, 0u, text.bytes, text.n);
        text.n = 0u;
    }
}

/* Send the next bytes of the record: whole frames, or the rest. Returns 0 if there are not so many. */
static int send_record(int whole)
{
    uint8_t payload[LINE_PAYLOAD];
    const uint32_t left = kept->recorded - sent;
    const uint32_t n = left < LINE_PAYLOAD - POSITION ? left : LINE_PAYLOAD - POSITION;
    if (n == 0u || (whole && n < LINE_PAYLOAD - POSITION)) {
        return 0;
    }
    for (uint32_t i = 0; i < POSITION; i++) {
        payload[i] = (uint8_t)(sent >> (8u * i));
    }
    for (uint32_t i = 0u; i < n; i++) {
        payload[POSITION + i] = kept->ring[(sent + i) % RING];
    }
    sent += n;
    put(LINE_RECORD, sent == kept->recorded ? LINE_ASK : 0u, payload, POSITION + n);
    return !is_over();
}

/* Only a report is possible. */
static void stop(const char *why) __attribute__((noreturn));

static void stop(const char *why)
{
    for (;;) {
        const int64_t begin = board_time();
        uint8_t bytes[16];
        bare_shout(why, strlen(why));
        while (board_time() - begin < INT64_C(1000000000)) {
            (void)board_receive(bytes, sizeof bytes);
            board_watch();
        }
    }
}

static void take_words(const LineMessage *m)
{
    if (!line_mirror_put(&mirror, m->bytes, m->n)) {
        stop("the outside has sent words of boards that this program does not have: build it anew\n");
    }
    has_come |= (m->flags & LINE_LAST) != 0u;
}

/* A session begins: both ends know nothing of each other's memory. */
static void take_hello(const LineMessage *m)
{
    greetings++;
    if ((m->hello.flags & LINE_GO_ON) == 0u) {
        kept->recorded = kept->safe = 0u;
    } else if (has_flown) {
        stop("the outside goes on with a run as after a reset, but this board was not reset\n");
    }
    if (line.welcome.boot == 0u) { /* no two boards are greeted at the same nanosecond of their times */
        const uint64_t mixed =
            ((uint64_t)board_time() ^ m->hello.session ^ (uint64_t)kept->starts << 32) * UINT64_C(0x9E3779B97F4A7C15);
        line.welcome.boot = (uint32_t)(mixed >> 32) | 1u;
    }
    sent = kept->safe; /* frames on their way are sent again */
    acknowledged = 0u;
    has_come = 0;
    line_mirror_begin(&mirror, mirror.windows, mirror.n_windows, mirror.shadow);
    line_mirror_finish(&mirror);
}

static void take(void *user, const LineMessage *m)
{
    (void)user;
    if (m->kind == LINE_HELLO) {
        take_hello(m);
    } else if (m->kind == LINE_WORDS) {
        take_words(m);
    }
}

/* ---- the board */

/* The note: sizes of its name and of its content, its type, the name, the content. */
static void copy_build_id(uint8_t *to)
{
    uint32_t sizes[2];
    if (fledge_build_note != NULL) {
        memcpy(sizes, fledge_build_note, sizeof sizes);
        if (sizes[1] == LINE_BUILD) {
            memcpy(to, fledge_build_note + 12u + sizes[0], LINE_BUILD);
        }
    }
}

/* Of this program, with its kept memory where it is: pointers that another one has left there are of no use. */
static uint32_t own_mark(void)
{
    uint8_t build[LINE_BUILD] = {0};
    uint32_t begin;
    copy_build_id(build);
    memcpy(&begin, build, sizeof begin);
    return KEPT ^ begin ^ (uint32_t)(uintptr_t)kept;
}

void *bare_keep(size_t size)
{
    bare_kept = sizeof *kept + size;
    kept = board_keep(bare_kept);
    if (kept == NULL) {
        stop("this board cannot keep as many bytes as the record needs through a reset\n");
    }
    if (kept->mark != own_mark()) {
        memset(kept, 0, sizeof *kept + size);
        kept->mark = own_mark();
    }
    kept->starts++;
    return kept + 1;
}

/* Flight has finished the tick: the answer. */
static void ring(void *user, uint32_t interrupt)
{
    int last = 0;
    (void)user;
    if (interrupt != UINT32_MAX) { /* not the clock's */
        return;
    }
    has_flown = 1;
    while (!last && !is_over()) {
        uint8_t payload[LINE_PAYLOAD];
        const uint32_t n = line_mirror_take(&mirror, payload, &last);
        put(LINE_WORDS, last ? LINE_LAST | LINE_ASK : 0u, payload, n);
    }
    answer_end = line.next;
    size_t n;
    for (const uint8_t *frame; (frame = line_output(&line, board_time(), &n)) != NULL;) {
        board_send(frame, n);
    }
}

static void copy_name(char *to, const char *from)
{
    size_t i = 0u;
    for (; i + 1u < LINE_NAME && from[i] != '\0'; i++) {
        to[i] = from[i];
    }
    to[i] = '\0';
}

static void place_windows(const MissionHost *mission, RegisterWindow *windows)
{
    const MissionIo *io = mission->io;
    size_t at = 0u;
    for (uint32_t i = 0u; i < io->n_boards; i++) {
        windows[i] = register_window(io->boards[i], (volatile uint32_t *)(void *)(memory + at));
        at += (io->boards[i]->size + 7u) / 8u;
        if (at > sizeof memory / 8u) {
            break;
        }
    }
    const size_t shadow = (line_mirror_size(io->boards, io->n_boards) + 7u) / 8u;
    if (at + shadow > sizeof memory / 8u || (shadow == 0u && at > 0u)) {
        stop("the boards of the mission are larger than FLEDGE_LINE_BYTES\n");
    }
    clock_window = &windows[mission_io_clock(io)];
    windows[mission_io_clock(io)].ring = ring;
    if (greetings == 0u) { /* else the outside may have sent words already */
        line_mirror_begin(&mirror, windows, io->n_boards, memory + at);
    }
}

void bare_begin(const MissionHost *mission, RegisterWindow *windows)
{
    place_windows(mission, windows);
    if (greetings == 0u) {
        LineWelcome welcome;
        memset(&welcome, 0, sizeof welcome);
        welcome.starts = kept->starts;
        welcome.hash = mission_host_hash(mission);
        copy_build_id(welcome.build);
        copy_name(welcome.target, TARGET);
        copy_name(welcome.mission, mission->name);
        line_await(&line, &welcome, take, NULL, board_time());
    }
    while (greetings == ended) {
        pump();
    }
    flying = greetings;
}

/* A tick begins when all of the record is safe: so a reset while flight computes, or waits, costs nothing of it. */
void bare_idle(void)
{
    flush_text();
    flying = greetings;
    (void)send_record(0);
    pump();
    if (has_come && kept->safe == kept->recorded) {
        has_come = 0;
        line_mirror_finish(&mirror);
    }
}

void bare_watch(void)
{
    board_watch();
}

int64_t bare_now(void)
{
    return board_time();
}

void bare_say(const char *words)
{
    for (; *words != '\0'; words++) {
        if (text.n == sizeof text.bytes) {
            if (!line_is_open(&line)) {
                return;
            }
            flush_text();
        }
        text.bytes[text.n++] = (uint8_t)*words;
    }
}

/* The line carries text and the record side by side. */
void bare_recording(BareRecording state)
{
    if (state == BARE_RECORD_BEGINS) {
        kept->recorded = kept->safe = sent = 0u;
        memset(sent_by, 0, sizeof sent_by); /* frames that are under way are of no record */
    }
}

int bare_records(void)
{
    return (line.hello.flags & LINE_RECORDS) != 0u;
}

void bare_record(const void *bytes, size_t n)
{
    const uint8_t *p = bytes;
    while (n > 0u && !is_over()) {
        if (kept->recorded - kept->safe == RING) {
            if (!send_record(1)) {
                pump();
            }
            continue;
        }
        kept->ring[kept->recorded % RING] = *p++;
        kept->recorded++;
        n--;
    }
}

/* The record is kept, and need not have been sent. But the outside must have the answer to its tick: else flight
 * would answer it again after a reset, and record it twice. */
void bare_record_flush(void)
{
    while (line_room(&line) > 0u && send_record(1)) {
    }
    while (!is_over() && (uint16_t)(answer_end - line.base - 1u) < LINE_WINDOW) {
        pump();
    }
}

__attribute__((weak)) void bare_say_figures(void) {}

void bare_end(int status)
{
    const uint8_t byte = (uint8_t)status;
    while (send_record(0)) {
    }
    flush_text();
    put(LINE_END, LINE_ASK, &byte, 1u);
    while (!is_over() && !line_is_flushed(&line) && board_time() - line.received_at < LONGEST_SILENCE) {
        pump();
    }
    ended = flying;
}

void bare_shout(const char *words, size_t n)
{
    uint8_t frame[LINE_FRAME];
    if (line.take == NULL) { /* the line was not begun */
        mcap_crc_init(&line.crc);
    }
    const size_t size = line_shout(&line, words, n, ++shouts, frame);
    for (int i = 0; i < SHOUTS; i++) { /* it is not acknowledged */
        board_send(frame, size);
    }
}
