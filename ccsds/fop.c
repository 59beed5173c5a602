/* SPDX-License-Identifier: Apache-2.0 */
#include "ccsds/cop1.h"

#include <string.h>

/* ---- actions (232.1-B-2, 5.2) */

static void restart_timer(Fop *fop)
{
    fop->expires = fop->now > INT64_MAX - fop->timer ? INT64_MAX : fop->now + fop->timer;
}

static FopUnit *unit_at(Fop *fop, uint32_t i)
{
    return &fop->units[(fop->first + i) % (fop->capacity + 1u)];
}

static uint8_t *data_of(Fop *fop, const FopUnit *unit)
{
    return fop->memory + (size_t)(unit - fop->units) * fop->room;
}

/* Drop the oldest unit that was sent. */
static void drop(Fop *fop, FopAnswer answer)
{
    const uint32_t tag = unit_at(fop, 0u)->tag;
    fop->first = (fop->first + 1u) % (fop->capacity + 1u);
    fop->sent--;
    fop->notify(fop->user, answer, tag, 0u);
}

static void purge(Fop *fop)
{
    while (fop->sent != 0u) {
        drop(fop, FOP_FAILED);
    }
    if (fop->waiting != 0u) {
        fop->waiting = 0u;
        fop->notify(fop->user, FOP_REJECTED, unit_at(fop, 0u)->tag, 0u);
    }
    fop->controlling = 0u;
    if (fop->suspended == (uint8_t)FOP_CHECKING) {
        fop->notify(fop->user, FOP_FAILED, fop->directive, 0u);
    }
    fop->suspended = 0u;
}

static void alert(Fop *fop, FopAlert why)
{
    const int pending = fop->state == (uint8_t)FOP_CHECKING || fop->state == (uint8_t)FOP_CONTROLLING;
    fop->expires = INT64_MAX;
    fop->state = FOP_INITIAL;
    purge(fop);
    if (pending) {
        fop->notify(fop->user, FOP_FAILED, fop->directive, 0u);
    }
    fop->notify(fop->user, FOP_ALERT, 0u, why);
}

static void initialise(Fop *fop)
{
    purge(fop);
    fop->transmissions = 1u;
}

/* Hand a frame to the link. Returns 0 if the link refuses it, which ends the service. */
static int send(Fop *fop, TcType type, uint8_t number, const uint8_t *data, size_t n)
{
    const int took = fop->send(fop->user, type, number, data, n);
    fop->ready[type] = took != 0;
    if (took < 0) {
        alert(fop, FOP_ALERT_LLIF);
    }
    return took >= 0;
}

static void look_for_directive(Fop *fop)
{
    if (fop->ready[TC_BC] != 0u && fop->controlling == 2u) {
        fop->controlling = 1u;
        (void)send(fop, TC_BC, 0u, fop->control, sizeof fop->control);
    }
}

static void look_for_unit(Fop *fop)
{
    while (fop->ready[TC_AD] != 0u) {
        uint32_t i = 0u;
        while (i < fop->sent && unit_at(fop, i)->again == 0u) {
            i++;
        }
        FopUnit *unit = unit_at(fop, i);
        if (i == fop->sent) { /* none is to be retransmitted: the one that waits */
            if (fop->waiting == 0u || fop->sent >= fop->window) {
                return;
            }
            fop->waiting = 0u;
            unit->number = fop->number++;
            if (fop->sent++ == 0u) {
                fop->transmissions = 1u;
            }
            restart_timer(fop);
            fop->notify(fop->user, FOP_ACCEPTED, unit->tag, 0u);
        }
        unit->again = 0u;
        if (!send(fop, TC_AD, unit->number, data_of(fop, unit), unit->n)) {
            return;
        }
    }
}

static void retransmit(Fop *fop)
{
    fop->transmissions++;
    restart_timer(fop);
    for (uint32_t i = 0u; i < fop->sent; i++) {
        unit_at(fop, i)->again = 1u;
    }
}

static void send_control(Fop *fop, TcControl control, uint8_t value)
{
    fop->control[0] = (uint8_t)control;
    fop->control[1] = value;
    fop->controlling = 1u;
    fop->transmissions = 1u;
    restart_timer(fop);
    (void)send(fop, TC_BC, 0u, fop->control, sizeof fop->control);
}

/* ---- the state table (232.1-B-2, table 5-1): CLCWs and the timer */

enum {
    REMOVE = 0x01, /* what is acknowledged */
    CANCEL = 0x02, /* the timer */
    RESEND = 0x04,
    LOOK = 0x08,
    CONFIRM = 0x10, /* the directive */
    ALERT = 0x20,
    SUSPEND = 0x40,
    RESEND_CONTROL = 0x80
};

typedef enum Event {
    E1,
    E2,
    E3,
    E4,
    E5,
    E6,
    E7,
    E101,
    E102,
    E8,
    E9,
    E10,
    E11,
    E12,
    E103,
    E13,
    E14,
    E15,
    E16,
    E104,
    E17,
    E18,
    EVENTS
} Event;

/* What is done, and the state that follows, by the state 1 to 5; 0: stays. In state 6 all are ignored. */
typedef struct Cell {
    uint8_t act;
    uint8_t next;
} Cell;

#define STAYS                                                                                                          \
    {                                                                                                                  \
        0u, 0u                                                                                                         \
    }
#define ALERTS                                                                                                         \
    {                                                                                                                  \
        ALERT, FOP_INITIAL                                                                                             \
    }
#define SUSPENDS                                                                                                       \
    {                                                                                                                  \
        SUSPEND, FOP_INITIAL                                                                                           \
    }

static const struct {
    uint8_t alert;
    Cell cells[5];
} table[EVENTS] = {
    [E1] = {FOP_ALERT_SYNCH, {STAYS, ALERTS, ALERTS, {CONFIRM | CANCEL, 1}, {CONFIRM | CANCEL, 1}}},
    [E2] = {0, {{REMOVE | CANCEL | LOOK, 1}, {REMOVE | CANCEL | LOOK, 1}, {REMOVE | CANCEL | LOOK, 1}, STAYS, STAYS}},
    [E3] = {FOP_ALERT_CLCW, {ALERTS, ALERTS, ALERTS, ALERTS, ALERTS}},
    [E4] = {FOP_ALERT_SYNCH, {ALERTS, ALERTS, ALERTS, ALERTS, STAYS}},
    [E5] = {FOP_ALERT_SYNCH, {STAYS, ALERTS, ALERTS, STAYS, STAYS}},
    [E6] = {0, {{REMOVE | LOOK, 1}, {REMOVE | LOOK, 1}, {REMOVE | LOOK, 1}, STAYS, STAYS}},
    [E7] = {FOP_ALERT_CLCW, {ALERTS, ALERTS, ALERTS, STAYS, STAYS}},
    [E101] = {FOP_ALERT_LIMIT, {{REMOVE | ALERT, 6}, {REMOVE | ALERT, 6}, {REMOVE | ALERT, 6}, STAYS, STAYS}},
    [E102] = {FOP_ALERT_LIMIT, {ALERTS, ALERTS, ALERTS, STAYS, STAYS}},
    [E8] = {0, {{REMOVE | RESEND | LOOK, 2}, {REMOVE | RESEND | LOOK, 2}, {REMOVE | RESEND | LOOK, 2}, STAYS, STAYS}},
    [E9] = {0, {{REMOVE, 3}, {REMOVE, 3}, {REMOVE, 3}, STAYS, STAYS}},
    [E10] = {0, {{RESEND | LOOK, 2}, STAYS, {RESEND | LOOK, 2}, STAYS, STAYS}},
    [E11] = {0, {{0, 3}, {0, 3}, STAYS, STAYS, STAYS}},
    [E12] = {0, {{0, 2}, STAYS, {0, 2}, STAYS, STAYS}},
    [E103] = {0, {{0, 3}, {0, 3}, STAYS, STAYS, STAYS}},
    [E13] = {FOP_ALERT_NNR, {ALERTS, ALERTS, ALERTS, ALERTS, STAYS}},
    [E14] = {FOP_ALERT_LOCKOUT, {ALERTS, ALERTS, ALERTS, ALERTS, STAYS}},
    [E15] = {FOP_ALERT_CLCW, {ALERTS, ALERTS, ALERTS, ALERTS, ALERTS}},
    [E16] = {FOP_ALERT_T1, {{RESEND | LOOK, 0}, {RESEND | LOOK, 0}, STAYS, ALERTS, {RESEND_CONTROL, 0}}},
    [E104] = {0, {{RESEND | LOOK, 0}, {RESEND | LOOK, 0}, STAYS, SUSPENDS, {RESEND_CONTROL, 0}}},
    [E17] = {FOP_ALERT_T1, {ALERTS, ALERTS, ALERTS, ALERTS, ALERTS}},
    [E18] = {FOP_ALERT_T1, {SUSPENDS, SUSPENDS, SUSPENDS, SUSPENDS, ALERTS}},
};

static void handle(Fop *fop, Event event, uint8_t acknowledged)
{
    if (fop->state == (uint8_t)FOP_INITIAL) {
        return;
    }
    const Cell cell = table[event].cells[fop->state - 1u];
    if ((cell.act & REMOVE) != 0) {
        while (fop->sent != 0u && unit_at(fop, 0u)->number != acknowledged) {
            drop(fop, FOP_CONFIRMED);
        }
        fop->expected = acknowledged;
        fop->transmissions = 1u;
    }
    if ((cell.act & ALERT) != 0) {
        alert(fop, (FopAlert)table[event].alert);
        return;
    }
    if ((cell.act & SUSPEND) != 0) {
        fop->suspended = fop->state;
        fop->state = FOP_INITIAL;
        fop->notify(fop->user, FOP_SUSPENDED, 0u, 0u);
        return;
    }
    if (cell.next != 0u) {
        fop->state = cell.next;
    }
    if ((cell.act & CANCEL) != 0) {
        fop->expires = INT64_MAX;
    }
    if ((cell.act & CONFIRM) != 0) {
        fop->controlling = 0u;
        fop->notify(fop->user, FOP_CONFIRMED, fop->directive, 0u);
    }
    if ((cell.act & RESEND) != 0) {
        retransmit(fop);
    }
    if ((cell.act & LOOK) != 0) {
        look_for_unit(fop);
    }
    if ((cell.act & RESEND_CONTROL) != 0) {
        fop->transmissions++;
        restart_timer(fop);
        fop->controlling = 2u;
        look_for_directive(fop);
    }
}

void fop_clcw(Fop *fop, const Clcw *clcw)
{
    const uint8_t n = clcw->next;
    const int none = n == fop->expected, wait = clcw->wait != 0u; /* none: nothing new is acknowledged */
    Event event = E13;
    if (clcw->lockout != 0u) {
        event = E14;
    } else if (n == fop->number) {
        event = clcw->retransmit != 0u ? E4 : wait ? E3 : none ? E1 : E2;
    } else if ((uint8_t)(n - fop->expected) < (uint8_t)(fop->number - fop->expected)) {
        if (clcw->retransmit == 0u) {
            event = wait ? E7 : none ? E5 : E6;
        } else if (fop->limit == 1u) {
            event = none ? E102 : E101;
        } else if (!none) {
            event = wait ? E9 : E8;
        } else if (fop->transmissions < fop->limit) {
            event = wait ? E11 : E10;
        } else {
            event = wait ? E103 : E12;
        }
    }
    handle(fop, event, n);
}

void fop_invalid_clcw(Fop *fop)
{
    handle(fop, E15, 0u);
}

void fop_time(Fop *fop, int64_t t)
{
    fop->now = t;
    if (fop->expires <= t) {
        fop->expires = INT64_MAX;
        handle(fop,
               fop->transmissions < fop->limit ? (fop->timeout != 0u ? E104 : E16)
               : fop->timeout != 0u            ? E18
                                               : E17,
               0u);
    }
}

/* ---- requests */

void fop_begin(Fop *fop, FopUnit *units, uint8_t *memory, uint32_t room, uint32_t capacity, int64_t timer, FopSend send,
               FopNotify notify, void *user)
{
    memset(fop, 0, sizeof *fop);
    fop->units = units;
    fop->memory = memory;
    fop->room = room;
    fop->capacity = capacity;
    fop->window = (uint8_t)(capacity < 255u ? capacity : 255u);
    fop->timer = timer;
    fop->send = send;
    fop->notify = notify;
    fop->user = user;
    fop->state = FOP_INITIAL;
    fop->expires = INT64_MAX;
    fop->limit = 1u;
    fop->transmissions = 1u;
    fop->ready[TC_AD] = fop->ready[TC_BC] = fop->ready[TC_BD] = 1u;
}

void fop_transfer(Fop *fop, uint32_t tag, const uint8_t *data, size_t n)
{
    if (fop->state > (uint8_t)FOP_RETRANSMIT_WAIT || fop->waiting != 0u || n == 0 || n > fop->room || n > 0xFFFFu) {
        fop->notify(fop->user, FOP_REJECTED, tag, 0u);
        return;
    }
    FopUnit *unit = unit_at(fop, fop->sent);
    unit->tag = tag;
    unit->n = (uint16_t)n;
    unit->again = 0u;
    memcpy(data_of(fop, unit), data, n);
    fop->waiting = 1u;
    if (fop->state != (uint8_t)FOP_RETRANSMIT_WAIT) {
        look_for_unit(fop);
    }
}

void fop_bypass(Fop *fop, uint32_t tag, const uint8_t *data, size_t n)
{
    if (fop->ready[TC_BD] == 0u || n == 0) {
        fop->notify(fop->user, FOP_REJECTED, tag, 0u);
        return;
    }
    fop->notify(fop->user, FOP_ACCEPTED, tag, 0u);
    (void)send(fop, TC_BD, 0u, data, n);
}

/* Whether a directive can be done now. */
static int is_possible(const Fop *fop, FopDirective directive, uint32_t value)
{
    const int initial = fop->state == (uint8_t)FOP_INITIAL;
    switch (directive) {
    case FOP_INITIATE:
    case FOP_INITIATE_CHECK: return initial;
    case FOP_INITIATE_UNLOCK: return initial && fop->ready[TC_BC] != 0u;
    case FOP_INITIATE_SET: return initial && fop->ready[TC_BC] != 0u && value <= 0xFFu;
    case FOP_TERMINATE: return 1;
    case FOP_RESUME: return initial && fop->suspended != 0u;
    case FOP_SET_NUMBER: return initial && fop->suspended == 0u && value <= 0xFFu;
    case FOP_SET_WINDOW: return value >= 1u && value <= 0xFFu && value <= fop->capacity;
    case FOP_SET_TIMER: return value >= 1u;
    case FOP_SET_LIMIT: return value >= 1u && value <= 0xFFu;
    case FOP_SET_TIMEOUT: return value <= 1u;
    default: return 0;
    }
}

void fop_directive(Fop *fop, uint32_t tag, FopDirective directive, uint32_t value)
{
    if (!is_possible(fop, directive, value)) {
        fop->notify(fop->user, FOP_REJECTED, tag, 0u);
        return;
    }
    fop->notify(fop->user, FOP_ACCEPTED, tag, 0u);
    /* undecided: is_possible() refuses others */
    switch (directive) {
    case FOP_INITIATE:
        initialise(fop);
        fop->state = FOP_ACTIVE;
        break;
    case FOP_INITIATE_CHECK:
        initialise(fop);
        fop->directive = tag;
        fop->state = FOP_CHECKING;
        restart_timer(fop);
        return;
    case FOP_INITIATE_UNLOCK:
    case FOP_INITIATE_SET:
        initialise(fop);
        fop->directive = tag;
        fop->state = FOP_CONTROLLING;
        if (directive == FOP_INITIATE_SET) {
            fop->number = fop->expected = (uint8_t)value;
        }
        send_control(fop, directive == FOP_INITIATE_SET ? TC_SET : TC_UNLOCK, (uint8_t)value);
        return;
    case FOP_TERMINATE:
        if (fop->state != (uint8_t)FOP_INITIAL || fop->suspended != 0u) {
            alert(fop, FOP_ALERT_TERM);
        }
        break;
    case FOP_RESUME:
        fop->state = fop->suspended;
        fop->suspended = 0u;
        restart_timer(fop);
        break;
    case FOP_SET_NUMBER: fop->number = fop->expected = (uint8_t)value; break;
    case FOP_SET_WINDOW: fop->window = (uint8_t)value; break;
    case FOP_SET_TIMER: fop->timer = (int64_t)value * 1000000; break;
    case FOP_SET_LIMIT: fop->limit = (uint8_t)value; break;
    case FOP_SET_TIMEOUT: fop->timeout = (uint8_t)value; break;
    }
    fop->notify(fop->user, FOP_CONFIRMED, tag, 0u);
}

void fop_ready(Fop *fop, TcType type, int good)
{
    fop->ready[type] = 1u;
    if (!good) {
        alert(fop, FOP_ALERT_LLIF);
    } else if (type == TC_AD && fop->state <= (uint8_t)FOP_RETRANSMIT) {
        look_for_unit(fop);
    } else if (type == TC_BC && fop->state == (uint8_t)FOP_CONTROLLING) {
        look_for_directive(fop);
    }
}
