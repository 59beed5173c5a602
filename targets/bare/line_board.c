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

/* Memory for the boards, and for what the outside knows of it. */
#ifndef FLEDGE_LINE_BYTES
#define FLEDGE_LINE_BYTES 65536
#endif

#define LONGEST_SILENCE INT64_C(2000000000) /* [ns] of an outside that is asked to acknowledge the end */

enum { KEPT = 0x4c494e45, POSITION = 4, SHOUTS = 3 };

/* What a reset leaves as it is. */
typedef struct Kept {
    uint32_t mark;     /* KEPT: the rest is of the program before the reset */
    uint32_t starts;   /* of the program */
    uint32_t recorded; /* bytes of the record that the line has got */
    uint32_t spare;
} Kept;

typedef struct Bytes {
    size_t n;
    uint8_t bytes[LINE_PAYLOAD];
} Bytes;

static LineEnd line;
static LineMirror mirror;
static uint64_t memory[FLEDGE_LINE_BYTES / 8];
static Kept *kept;
static Bytes text, record; /* what is not in the line's window yet */
static const RegisterWindow *clock_window;
static uint32_t greetings; /* sessions so far */
static uint32_t ended;     /* the session whose run has ended, as counted by `greetings` */
static uint32_t flying;    /* the session whose run flight is in */
static int has_flown;      /* flight has answered since the start of the program */
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
    while (!is_over() && !line_put(&line, kind, flags, tick, bytes, n)) {
        pump();
    }
}

static void flush_text(void)
{
    if (text.n > 0u) {
        put(LINE_TEXT, 0u, text.bytes, text.n);
        text.n = 0u;
    }
}

static void flush_record(uint32_t flags)
{
    if (record.n > POSITION) {
        put(LINE_RECORD, flags, record.bytes, record.n);
        record.n = 0u;
    }
}

/* Nothing can be done but to say so. */
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
    if ((m->flags & LINE_LAST) != 0u) {
        line_mirror_finish(&mirror);
    }
}

/* A session begins: both ends know nothing of each other's memory. */
static void take_hello(const LineMessage *m)
{
    greetings++;
    if ((m->hello.flags & LINE_GO_ON) == 0u) {
        kept->recorded = 0u;
    } else if (has_flown) {
        stop("the outside goes on with a run as after a reset, but this board was not reset\n");
    }
    if (line.welcome.boot == 0u) { /* no two boards are greeted at the same nanosecond of their times */
        const uint64_t mixed =
            ((uint64_t)board_time() ^ m->hello.session ^ (uint64_t)kept->starts << 32) * UINT64_C(0x9E3779B97F4A7C15);
        line.welcome.boot = (uint32_t)(mixed >> 32) | 1u;
    }
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

void *bare_keep(size_t size)
{
    bare_kept = sizeof *kept + size;
    kept = board_keep(bare_kept);
    if (kept == NULL) {
        stop("this board cannot keep as many bytes as the record needs through a reset\n");
    }
    if (kept->mark != KEPT) {
        memset(kept, 0, sizeof *kept + size);
        kept->mark = KEPT;
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
        put(LINE_WORDS, last ? LINE_LAST : 0u, payload, n);
    }
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
    record.n = 0u;
}

void bare_idle(void)
{
    flush_text();
    flying = greetings;
    pump();
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

void bare_recording(int on)
{
    (void)on; /* the line carries text and the record side by side */
}

void bare_record(const void *bytes, size_t n)
{
    const uint8_t *p = bytes;
    if ((line.hello.flags & LINE_RECORDS) == 0u) {
        return;
    }
    while (n > 0u && !is_over()) {
        if (record.n == 0u) {
            for (uint32_t i = 0u; i < POSITION; i++) {
                record.bytes[i] = (uint8_t)(kept->recorded >> (8u * i));
            }
            record.n = POSITION;
        }
        const size_t room = sizeof record.bytes - record.n, part = n < room ? n : room;
        memcpy(record.bytes + record.n, p, part);
        record.n += part;
        kept->recorded += (uint32_t)part;
        p += part;
        n -= part;
        if (record.n == sizeof record.bytes) {
            flush_record(0u);
        }
    }
    if (is_over()) {
        record.n = 0u;
    }
}

void bare_record_flush(void)
{
    flush_record(LINE_ASK);
    while (!is_over() && !line_is_flushed(&line)) {
        pump();
    }
}

__attribute__((weak)) void bare_say_figures(void) {}

void bare_end(int status)
{
    const uint8_t byte = (uint8_t)status;
    flush_record(0u);
    flush_text();
    put(LINE_END, LINE_ASK, &byte, 1u);
    while (!is_over() && !line_is_flushed(&line) && board_time() - line.heard < LONGEST_SILENCE) {
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
    for (int i = 0; i < SHOUTS; i++) { /* nobody acknowledges it */
        board_send(frame, size);
    }
}
