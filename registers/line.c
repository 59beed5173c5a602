/* SPDX-License-Identifier: Apache-2.0 */
#include "registers/line.h"

#include <string.h>

#define MS INT64_C(1000000)
#define GREET_NS (100 * MS)  /* from one greeting to the next */
#define SILENCE_NS (50 * MS) /* after which the rest of a frame may not come */
#define OWED_NS (5 * MS)     /* how long an acknowledgement waits for a frame that carries it */
#define OWED_MAX 3           /* frames that one acknowledgement is for, if it goes alone */
#define PROBE_NS (250 * MS)  /* of silence after which the outside asks whether the board is there */
#define LATENCY_NS (60 * MS) /* of drivers and adapters, there and back, and of programs that wait for a processor */
#define LONGEST_NS (1000 * MS)
#define USUAL_BAUD 115200u
#define SYNC_0 0xF1u
#define SYNC_1 0xEDu

enum { HELLO_SIZE = 24, WELCOME_SIZE = 24 + LINE_BUILD + 2 * LINE_NAME };

/* ---- numbers in bytes */

static void put16(uint8_t *p, uint32_t v)
{
    p[0] = (uint8_t)v;
    p[1] = (uint8_t)(v >> 8);
}

static void put32(uint8_t *p, uint32_t v)
{
    put16(p, v);
    put16(p + 2, v >> 16);
}

static void put64(uint8_t *p, uint64_t v)
{
    put32(p, (uint32_t)v);
    put32(p + 4, (uint32_t)(v >> 32));
}

static uint16_t get16(const uint8_t *p)
{
    return (uint16_t)(p[0] | (uint32_t)p[1] << 8);
}

static uint32_t get32(const uint8_t *p)
{
    return get16(p) | (uint32_t)get16(p + 2) << 16;
}

static uint64_t get64(const uint8_t *p)
{
    return get32(p) | (uint64_t)get32(p + 4) << 32;
}

/* ---- greetings */

static uint32_t write_hello(const LineHello *h, uint8_t *p)
{
    put32(p, h->version);
    put32(p + 4, h->session);
    put32(p + 8, h->flags);
    put32(p + 12, h->baud);
    put64(p + 16, h->hash);
    return HELLO_SIZE;
}

static int read_hello(LineHello *h, const uint8_t *p, uint32_t n)
{
    if (n < HELLO_SIZE) {
        return 0;
    }
    *h = (LineHello){get32(p), get32(p + 4), get32(p + 8), get32(p + 12), get64(p + 16)};
    return h->session != 0u;
}

static uint32_t write_welcome(const LineWelcome *w, uint8_t *p)
{
    put32(p, w->version);
    put32(p + 4, w->session);
    put32(p + 8, w->boot);
    put32(p + 12, w->starts);
    put64(p + 16, w->hash);
    memcpy(p + 24, w->build, LINE_BUILD);
    memcpy(p + 24 + LINE_BUILD, w->target, LINE_NAME);
    memcpy(p + 24 + LINE_BUILD + LINE_NAME, w->mission, LINE_NAME);
    return WELCOME_SIZE;
}

static int read_welcome(LineWelcome *w, const uint8_t *p, uint32_t n)
{
    if (n < WELCOME_SIZE) {
        return 0;
    }
    w->version = get32(p);
    w->session = get32(p + 4);
    w->boot = get32(p + 8);
    w->starts = get32(p + 12);
    w->hash = get64(p + 16);
    memcpy(w->build, p + 24, LINE_BUILD);
    memcpy(w->target, p + 24 + LINE_BUILD, LINE_NAME);
    memcpy(w->mission, p + 24 + LINE_BUILD + LINE_NAME, LINE_NAME);
    w->target[LINE_NAME - 1] = '\0';
    w->mission[LINE_NAME - 1] = '\0';
    return 1;
}

/* ---- sessions */

/* What was sent and taken in an earlier session is forgotten. */
static void begin_session(LineEnd *e, uint32_t session)
{
    e->past = e->session;
    e->session = session;
    e->base = e->next = e->unsent = e->furthest = 0u;
    e->repeats = 0u;
    e->expected = e->owed = 0u;
    e->owe_now = e->missing = e->has_requested = 0;
}

static void begin(LineEnd *e, LineTake take, void *user, int is_board, uint32_t session, int64_t now)
{
    mcap_crc_init(&e->crc);
    e->take = take;
    e->user = user;
    e->is_board = is_board;
    e->open = 0;
    e->greet = 1;
    e->greeted = now - GREET_NS;
    e->received_at = e->probed = now;
    begin_session(e, session);
}

void line_greet(LineEnd *e, const LineHello *hello, LineTake take, void *user, int64_t now)
{
    begin(e, take, user, 0, hello->session, now);
    e->welcome.boot = 0u;
    e->hello = *hello;
    e->hello.version = LINE_VERSION;
}

void line_await(LineEnd *e, const LineWelcome *welcome, LineTake take, void *user, int64_t now)
{
    begin(e, take, user, 1, 0u, now);
    e->past = 0u;
    e->n = 0u;
    e->doubtful = 0;
    e->welcome = *welcome;
    e->welcome.version = LINE_VERSION;
    e->welcome.session = 0u;
}

int line_is_open(const LineEnd *e)
{
    return e->open;
}

/* ---- sending */

static uint16_t in_window(const LineEnd *e)
{
    return (uint16_t)(e->next - e->base);
}

uint32_t line_room(const LineEnd *e)
{
    return e->open ? LINE_WINDOW - (uint32_t)in_window(e) : 0u;
}

int line_is_flushed(const LineEnd *e)
{
    return e->base == e->next;
}

int line_put(LineEnd *e, LineKind kind, uint32_t flags, uint32_t tick, const void *bytes, size_t n)
{
    if (line_room(e) == 0u || n > LINE_PAYLOAD) {
        return 0;
    }
    LineSent *s = &e->window[e->next % LINE_WINDOW];
    s->kind = (uint8_t)kind;
    s->flags = (uint8_t)flags;
    s->n = (uint16_t)n;
    s->tick = tick;
    if (n > 0u) {
        memcpy(s->bytes, bytes, n);
    }
    e->next++;
    return 1;
}

/* The payload is in the frame already. */
static size_t write_frame(const LineEnd *e, uint8_t *frame, LineKind kind, uint32_t flags, uint32_t sequence,
                          uint32_t tick, uint32_t n)
{
    frame[0] = SYNC_0;
    frame[1] = SYNC_1;
    put16(frame + 2, n);
    frame[4] = (uint8_t)kind;
    frame[5] = (uint8_t)flags;
    put16(frame + 6, sequence);
    put16(frame + 8, e->expected);
    put32(frame + 10, e->session ^ e->welcome.boot);
    put32(frame + 14, tick);
    put32(frame + LINE_HEAD + n, mcap_crc_update(&e->crc, 0u, frame, LINE_HEAD + n));
    return LINE_HEAD + n + 4u;
}

static const uint8_t *send(LineEnd *e, LineKind kind, uint32_t flags, uint32_t sequence, uint32_t tick, uint32_t n,
                           size_t *size)
{
    *size = write_frame(e, e->out, kind, flags, sequence, tick, n);
    e->counts.frames_sent++;
    e->counts.bytes_sent += *size;
    return e->out;
}

/* [ns] without an acknowledgement after which the window is sent again. */
static int64_t repeat_after(const LineEnd *e)
{
    const uint32_t baud = e->hello.baud != 0u ? e->hello.baud : USUAL_BAUD;
    int64_t bytes = 0;
    for (uint16_t i = e->base; i != e->furthest; i++) {
        bytes += e->window[i % LINE_WINDOW].n + LINE_FRAME - LINE_PAYLOAD;
    }
    const int64_t least = LATENCY_NS + 2 * bytes * 10 * 1000 * MS / baud;
    const int64_t most = least > LONGEST_NS ? least : LONGEST_NS; /* of a slow line */
    const int64_t after = least << (e->repeats < 4u ? e->repeats : 4u);
    return after < most ? after : most;
}

/* How long this end waits before it requests a missing frame again: the frame may be on its way. */
static int64_t request_again_after(const LineEnd *e)
{
    const uint32_t baud = e->hello.baud != 0u ? e->hello.baud : USUAL_BAUD;
    return LATENCY_NS + (int64_t)LINE_WINDOW * LINE_FRAME * 10 * 1000 * MS / baud;
}

static int is_silent(const LineEnd *e, int64_t now)
{
    return e->n > 0u && !e->doubtful && now - e->came >= SILENCE_NS;
}

/* The rest of a frame may be lost, or be held back until other bytes push it: request it again, and keep its begin. */
static void doubt(LineEnd *e, int64_t now)
{
    if (is_silent(e, now)) {
        e->doubtful = 1;
        e->missing |= e->open;
    }
}

const uint8_t *line_output(LineEnd *e, int64_t now, size_t *n)
{
    doubt(e, now);
    if (e->greet && now - e->greeted >= GREET_NS) {
        e->greeted = now;
        if (e->is_board) {
            e->greet = 0;
            return send(e, LINE_WELCOME, 0u, 0u, 0u, write_welcome(&e->welcome, e->out + LINE_HEAD), n);
        }
        return send(e, LINE_HELLO, 0u, 0u, 0u, write_hello(&e->hello, e->out + LINE_HEAD), n);
    }
    if (!e->open) {
        return NULL;
    }
    if (e->base != e->furthest && now - e->sent >= repeat_after(e)) {
        e->repeats++;
        e->unsent = e->base;
        e->sent = now;
    }
    if (e->missing && e->has_requested && e->requested == e->expected &&
        now - e->requested_at < request_again_after(e)) {
        e->missing = 0;
    }
    if (e->missing) {
        e->missing = e->owe_now = 0;
        e->owed = 0u;
        e->has_requested = 1;
        e->requested_at = now;
        e->requested = e->expected;
        return send(e, LINE_CONTROL, LINE_AGAIN, 0u, 0u, 0u, n);
    }
    if (e->unsent != e->next) {
        const LineSent *s = &e->window[e->unsent % LINE_WINDOW];
        const uint16_t sequence = e->unsent++;
        const uint32_t ask = in_window(e) == LINE_WINDOW && e->unsent == e->next ? LINE_ASK : 0u;
        if (sequence == e->base) {
            e->sent = now;
        }
        if (sequence == e->furthest) {
            e->furthest++;
        } else {
            e->counts.resent++;
        }
        e->owed = 0u;
        e->owe_now = 0;
        memcpy(e->out + LINE_HEAD, s->bytes, s->n);
        return send(e, (LineKind)s->kind, s->flags | ask, sequence, s->tick, s->n, n);
    }
    if (!e->is_board && now - e->received_at >= PROBE_NS && now - e->probed >= PROBE_NS) {
        e->probed = now;
        return send(e, LINE_CONTROL, LINE_ASK, 0u, 0u, 0u, n);
    }
    if (e->owe_now || e->owed >= OWED_MAX || (e->owed > 0u && now - e->owed_since >= OWED_NS)) {
        e->owed = 0u;
        e->owe_now = 0;
        return send(e, LINE_CONTROL, 0u, 0u, 0u, 0u, n);
    }
    return NULL;
}

static int64_t sooner(int64_t wake, int64_t at, int64_t now)
{
    return at - now >= wake ? wake : at > now ? at - now : 0;
}

int64_t line_wake(const LineEnd *e, int64_t now)
{
    int64_t wake = 100 * MS;
    if (e->n > 0u && !e->doubtful) {
        wake = sooner(wake, e->came + SILENCE_NS, now);
    }
    if (e->greet) {
        wake = sooner(wake, e->greeted + GREET_NS, now);
    }
    if (e->open) {
        if (e->unsent != e->next || e->owe_now || e->owed >= OWED_MAX || e->missing) {
            wake = 0;
        }
        if (e->owed > 0u) {
            wake = sooner(wake, e->owed_since + OWED_NS, now);
        }
        if (!e->is_board) {
            wake = sooner(wake, (e->received_at > e->probed ? e->received_at : e->probed) + PROBE_NS, now);
        }
        if (e->base != e->furthest) {
            wake = sooner(wake, e->sent + repeat_after(e), now);
        }
    }
    return wake;
}

size_t line_shout(const LineEnd *e, const char *text, size_t n, uint32_t number, uint8_t frame[LINE_FRAME])
{
    n = n < LINE_PAYLOAD ? n : LINE_PAYLOAD;
    memcpy(frame + LINE_HEAD, text, n);
    return write_frame(e, frame, LINE_SHOUT, 0u, number, 0u, (uint32_t)n);
}

/* ---- receiving */

/* The other end has all before `sequence`. */
static void acknowledge(LineEnd *e, uint16_t sequence, int64_t now)
{
    const uint16_t gained = (uint16_t)(sequence - e->base);
    if (gained == 0u || gained > (uint16_t)(e->furthest - e->base)) {
        return; /* nothing new, or of long ago */
    }
    if ((uint16_t)(e->unsent - e->base) < gained) {
        e->unsent = sequence;
    }
    e->base = sequence;
    e->sent = now;
    e->repeats = 0u;
}

/* A frame of the sequence. */
static void take_next(LineEnd *e, const LineMessage *m, uint16_t sequence, int64_t now)
{
    if (sequence != e->expected) {
        e->counts.unordered++;
        if ((uint16_t)(sequence - e->expected) < LINE_WINDOW) {
            e->missing = 1;
        } else {
            e->owe_now = 1; /* it came before: the acknowledgement was lost */
        }
        return;
    }
    e->expected++;
    if (e->owed == 0u) {
        e->owed_since = now;
    }
    e->owed++;
    e->owe_now |= (m->flags & LINE_ASK) != 0u;
    e->missing = 0;
    e->take(e->user, m);
}

static void take_hello(LineEnd *e, LineMessage *m, int64_t now)
{
    if (!e->is_board || !read_hello(&m->hello, m->bytes, m->n) || m->hello.session == e->past) {
        return;
    }
    e->greet = 1;
    e->greeted = now - GREET_NS;
    if (e->open && m->hello.session == e->session) {
        return; /* the answer was lost */
    }
    begin_session(e, m->hello.session);
    e->hello = m->hello;
    e->welcome.session = e->session;
    e->open = 1;
    e->take(e->user, m);
}

static void take_welcome(LineEnd *e, LineMessage *m)
{
    if (e->is_board || !read_welcome(&m->welcome, m->bytes, m->n)) {
        return;
    }
    if (!e->open) {
        if (m->welcome.session != e->session) {
            return;
        }
        e->open = 1;
        e->greet = 0;
        e->welcome = m->welcome;
    }
    e->take(e->user, m);
}

static int is_for_board(LineKind kind)
{
    return kind == LINE_WORDS;
}

static int is_from_board(LineKind kind)
{
    return kind == LINE_WORDS || kind == LINE_RECORD || kind == LINE_TEXT || kind == LINE_END;
}

static void take_frame(LineEnd *e, const uint8_t *frame, uint32_t n, int64_t now)
{
    LineMessage m;
    memset(&m, 0, sizeof m);
    m.kind = (LineKind)frame[4];
    m.flags = frame[5];
    m.tick = get32(frame + 14);
    m.bytes = frame + LINE_HEAD;
    m.n = n;
    e->counts.frames_taken++;
    if (m.kind == LINE_HELLO) {
        e->received_at = now;
        take_hello(e, &m, now);
        return;
    }
    if (m.kind == LINE_WELCOME) {
        e->received_at = now;
        take_welcome(e, &m);
        return;
    }
    if (m.kind == LINE_SHOUT) {
        const uint32_t crc = get32(frame + LINE_HEAD + n);
        if (!e->is_board && crc != e->shout) {
            e->shout = crc;
            e->take(e->user, &m);
        }
        return;
    }
    if (!e->open || get32(frame + 10) != (e->session ^ e->welcome.boot)) {
        e->counts.foreign++;
        e->greet |= e->is_board;
        return;
    }
    e->received_at = now;
    acknowledge(e, get16(frame + 8), now);
    if (m.kind == LINE_CONTROL) {
        e->owe_now |= (m.flags & LINE_ASK) != 0u;
        if ((m.flags & LINE_AGAIN) != 0u && e->base != e->furthest) {
            e->unsent = e->base;
            e->sent = now;
        }
    } else if (e->is_board ? is_for_board(m.kind) : is_from_board(m.kind)) {
        take_next(e, &m, get16(frame + 6), now);
    }
}

/* Drop the first `n` bytes, and all before the next that may begin a frame. */
static void drop(LineEnd *e, size_t n, int are_stray)
{
    size_t keep = n;
    while (keep < e->n && (e->in[keep] != SYNC_0 || (keep + 1u < e->n && e->in[keep + 1u] != SYNC_1))) {
        keep++;
    }
    e->counts.stray += (uint32_t)(keep - (are_stray ? 0u : n));
    e->n -= keep;
    memmove(e->in, e->in + keep, e->n);
}

/* [bytes] of the frame that begins there; 0: it is none, or damaged. More than there are: its rest has not come. */
static size_t frame_at(const LineEnd *e, size_t at)
{
    const uint8_t *p = e->in + at;
    const size_t have = e->n - at;
    if (have < 4u) {
        return LINE_FRAME;
    }
    const uint32_t n = get16(p + 2);
    const size_t size = LINE_HEAD + n + 4u;
    if (n > LINE_PAYLOAD) {
        return 0u;
    }
    return have < size || get32(p + LINE_HEAD + n) == mcap_crc_update(&e->crc, 0u, p, LINE_HEAD + n) ? size : 0u;
}

/* Whether a whole frame stands behind the first sync. */
static int is_passed(const LineEnd *e)
{
    for (size_t at = 1u; at + 1u < e->n; at++) {
        if (e->in[at] == SYNC_0 && e->in[at + 1u] == SYNC_1) {
            const size_t size = frame_at(e, at);
            if (size > 0u && size <= e->n - at) {
                return 1;
            }
        }
    }
    return 0;
}

/* Take the frames in `in`. A doubtful one that is not whole is given up once a whole one stands behind its begin. */
static void parse(LineEnd *e, int64_t now)
{
    if (e->n > 0u && (e->in[0] != SYNC_0 || (e->n > 1u && e->in[1] != SYNC_1))) {
        drop(e, 0u, 1);
    }
    while (e->n > 0u) {
        const size_t size = frame_at(e, 0u);
        if (size > e->n && !(e->doubtful && is_passed(e))) {
            return;
        }
        if (size == 0u || size > e->n) {
            e->doubtful = e->doubtful && size > e->n; /* the rest of a frame behind a damaged one may still come */
            e->counts.damaged++;
            e->missing |= e->open;
            drop(e, 1u, 1);
        } else {
            e->doubtful = 0;
            take_frame(e, e->in, (uint32_t)(size - LINE_HEAD - 4u), now);
            drop(e, size, 0);
        }
    }
    e->doubtful = 0;
}

void line_input(LineEnd *e, const void *bytes, size_t n, int64_t now)
{
    const uint8_t *p = bytes;
    doubt(e, now);
    if (n > 0u) {
        e->came = now;
        e->counts.bytes_taken += n;
    }
    while (n > 0u) {
        const size_t room = sizeof e->in - e->n, part = n < room ? n : room;
        memcpy(e->in + e->n, p, part);
        e->n += part;
        p += part;
        n -= part;
        parse(e, now);
    }
}

/* ---- the mirror */

enum { RUN_HEAD = 4, RUN_MAX = 127 };

static uint32_t words_of(const RegisterWindow *w)
{
    return w->board->size / 4u;
}

size_t line_mirror_size(const RegisterBoard *const *boards, uint32_t n)
{
    size_t size = 0;
    for (uint32_t i = 0u; i < n; i++) {
        if (boards[i]->size / 4u > LINE_BOARD) {
            return 0;
        }
        size += boards[i]->size / 4u * 4u;
    }
    return n <= LINE_BOARDS ? size : 0;
}

void line_mirror_begin(LineMirror *m, const RegisterWindow *windows, uint32_t n, void *shadow)
{
    m->windows = windows;
    m->n_windows = n;
    m->shadow = shadow;
    m->board = m->word = m->at = 0u;
    for (uint32_t i = 0u; i < n; i++) {
        for (uint32_t k = 0u; k < words_of(&windows[i]); k++) {
            m->shadow[m->at++] = 0u;
        }
    }
    m->from = 0u;
    m->to = m->at;
    m->at = 0u;
}

/* Whether the word at the cursor differs. */
static int differs(const LineMirror *m)
{
    return register_load_bytes(&m->windows[m->board], m->word * 4u) != m->shadow[m->at];
}

uint32_t line_mirror_take(LineMirror *m, uint8_t *payload, int *last)
{
    uint32_t n = 0u;
    for (; m->board < m->n_windows; m->board++, m->word = 0u) {
        const RegisterWindow *w = &m->windows[m->board];
        while (m->word < words_of(w)) {
            if (!differs(m)) {
                m->word++;
                m->at++;
                continue;
            }
            if (n + RUN_HEAD + 4u > LINE_PAYLOAD) {
                *last = 0;
                return n;
            }
            uint8_t *head = payload + n;
            uint32_t count = 0u;
            n += RUN_HEAD;
            head[1] = (uint8_t)(m->board | m->word >> 16 << 4);
            put16(head + 2, m->word & 0xFFFFu);
            while (m->word < words_of(w) && differs(m) && count < RUN_MAX && n + 4u <= LINE_PAYLOAD) {
                const uint32_t v = register_load_bytes(w, m->word * 4u);
                m->shadow[m->at] = v;
                memcpy(payload + n, &v, 4);
                n += 4u;
                count++;
                m->word++;
                m->at++;
            }
            head[0] = (uint8_t)count;
        }
    }
    m->board = m->word = m->at = 0u;
    *last = 1;
    return n;
}

/* Check a payload, or bring it into the shadow. */
static int runs(LineMirror *m, const uint8_t *payload, uint32_t n, int store)
{
    for (uint32_t i = 0u; i < n;) {
        if (n - i < RUN_HEAD) {
            return 0;
        }
        const uint32_t count = payload[i], board = payload[i + 1u] & 0xFu;
        const uint32_t word = (uint32_t)(payload[i + 1u] >> 4) << 16 | get16(payload + i + 2u);
        i += RUN_HEAD;
        if (count == 0u || count * 4u > n - i || board >= m->n_windows || word + count > words_of(&m->windows[board])) {
            return 0;
        }
        if (store) {
            uint32_t at = word;
            for (uint32_t b = 0u; b < board; b++) {
                at += words_of(&m->windows[b]);
            }
            memcpy(m->shadow + at, payload + i, (size_t)count * 4u);
            m->from = at < m->from ? at : m->from;
            m->to = at + count > m->to ? at + count : m->to;
        }
        i += count * 4u;
    }
    return 1;
}

int line_mirror_put(LineMirror *m, const uint8_t *payload, uint32_t n)
{
    return runs(m, payload, n, 0) && runs(m, payload, n, 1);
}

void line_mirror_finish(LineMirror *m)
{
    uint32_t first = 0u; /* the index of the window's first word */
    for (uint32_t i = 0u; i < m->n_windows; i++) {
        const uint32_t n = words_of(&m->windows[i]);
        const uint32_t from = m->from > first ? m->from - first : 0u;
        const uint32_t to = m->to > first ? m->to - first : 0u;
        for (uint32_t k = from; k < to && k < n; k++) {
            register_store_bytes(&m->windows[i], k * 4u, m->shadow[first + k]);
        }
        first += n;
    }
    m->from = first;
    m->to = 0u;
}
