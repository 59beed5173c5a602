/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/services/stored_commands.h"

#include "ccsds/bytes.h"
#include "flight/exec/task.h"

#include <string.h>

enum { CRC = 10, LIST = 12, STEP = 14, TIME = 16 };              /* [bytes] places in COMMAND_STORE */
enum { CHOSEN = 10, ACTION = 12, CHOSEN_STEP = 12, CHECK = 14 }; /* and in the others */
enum { ROW = 16 };                                               /* [bytes] of a command in a report */

#define NEVER INT64_MAX
#define MARK 0x53430000u /* of what it stores in the non-volatile memory */

static int has(uint32_t set, uint32_t list)
{
    return (set >> list & 1u) != 0u;
}

/* list, step, time and packet: as the ground sends them */
static uint16_t crc_of(const StoredCommand *c)
{
    uint8_t bytes[COMMAND_STORED - LIST + COMMAND_STORED_MAX];
    /* undecided: take() looks at the size before */
    const uint32_t size = c->size <= COMMAND_STORED_MAX ? c->size : COMMAND_STORED_MAX;
    ccsds_put16(bytes, c->list);
    ccsds_put16(bytes + STEP - LIST, c->step);
    ccsds_put32(bytes + TIME - LIST, (uint32_t)((uint64_t)c->time >> 32));
    ccsds_put32(bytes + TIME - LIST + 4, (uint32_t)c->time);
    memcpy(bytes + COMMAND_STORED - LIST, c->packet, size);
    return ccsds_crc16(bytes, (uint32_t)(COMMAND_STORED - LIST) + size);
}

/* ---- what is due */

/* Whether a command of a list comes before a time and step of it. */
static int is_before(const StoredCommand *c, int64_t time, int64_t step)
{
    return c->time < time || (c->time == time && c->step < step);
}

/* Whether the non-volatile memory has that a command of list 0 is over, before it is executed. */
static int is_kept(const StoredCommands *m, const StoredCommand *c)
{
    return c->list != 0u || m->par.slot == 0u || m->mem.waited >= (uint32_t)STORED_PATIENCE ||
           is_before(c, m->mem.kept.time, m->mem.kept.step);
}

/* [ns] Of flight: when a command is due, as things stand. */
static int64_t due_at(const StoredCommands *m, const StoredCommand *c)
{
    if (c->size == 0u || c->list >= STORED_LISTS) {
        return NEVER;
    }
    const StoredList *list = &m->mem.lists[c->list];
    if ((list->state & STORED_HELD) != 0u) {
        return NEVER;
    }
    if (c->list == 0u && m->par.slot != 0u && is_before(c, m->mem.over.time, m->mem.over.step)) {
        return NEVER;
    }
    if (c->list == 0u) {
        return m->par.clocked != 0u && m->mem.known == 0u ? NEVER : tick_since(c->time, m->mem.ahead);
    }
    return (list->state & STORED_RUNS) == 0u || is_before(c, list->time, list->step) ? NEVER
                                                                                     : exec_later(list->begun, c->time);
}

/* Whether another list asks for another mode when a command is due. */
static int conflicts(const StoredCommands *m, const StoredCommand *c)
{
    const int64_t due = c->packet[6] == (uint8_t)COMMAND_MODE ? due_at(m, c) : NEVER;
    for (uint32_t i = 0u; due < NEVER && i < STORED_COMMANDS; i++) {
        const StoredCommand *other = &m->par.commands[i];
        if (other->list != c->list && other->packet[6] == (uint8_t)COMMAND_MODE && due_at(m, other) == due &&
            ccsds_get16(other->packet + CHOSEN) != ccsds_get16(c->packet + CHOSEN)) {
            return 1;
        }
    }
    return 0;
}

/* The place of the command that is due first, of those that may be executed or all, and when; STORED_COMMANDS: none. */
static uint32_t first(const StoredCommands *m, int all, int64_t *due)
{
    uint32_t found = STORED_COMMANDS;
    *due = NEVER;
    for (uint32_t i = 0u; i < STORED_COMMANDS; i++) {
        const StoredCommand *c = &m->par.commands[i];
        const int64_t t = all || is_kept(m, c) ? due_at(m, c) : NEVER;
        const StoredCommand *best = &m->par.commands[found < STORED_COMMANDS ? found : i];
        if (t < *due || (t == *due && t < NEVER &&
                         (c->list < best->list || (c->list == best->list && is_before(c, best->time, best->step))))) {
            found = i;
            *due = t;
        }
    }
    return found;
}

static void publish(StoredCommands *m, int64_t t, StoredCommandsEventId id, EventSeverity severity, uint32_t list,
                    uint32_t step, double late)
{
    event_publish(&m->out.event, t, (FlightEvent){.id = id, .severity = severity, .arguments = {list, step, late}});
}

static void end_list(StoredCommands *m, uint32_t list, int64_t t)
{
    if (m->mem.lists[list].state != 0u) {
        m->mem.lists[list].state = 0u;
        publish(m, t, STORED_COMMANDS_ENDED, EVENT_INFO, list, 0u, 0.0);
    }
}

/* Sequences of which nothing is left have ended. */
static void end_lists(StoredCommands *m, int64_t t)
{
    uint32_t left = 0u;
    for (uint32_t i = 0u; i < STORED_COMMANDS; i++) {
        const StoredCommand *c = &m->par.commands[i];
        if (c->size > 0u && c->list < STORED_LISTS &&
            !is_before(c, m->mem.lists[c->list].time, m->mem.lists[c->list].step)) {
            left |= 1u << c->list;
        }
    }
    for (uint32_t i = 1u; i < STORED_LISTS; i++) {
        if (!has(left, i)) {
            end_list(m, i, t);
        }
    }
}

static uint32_t take(const CommandContext *context, void *module, uint8_t *packet, CommandReport *report)
{
    StoredCommands *m = module;
    int64_t due;
    const uint32_t place = first(m, 0, &due);
    if (place == STORED_COMMANDS || due > context->t) {
        return 0u;
    }
    StoredCommand *c = &m->par.commands[place];
    const uint32_t n = c->size;
    const double late = tick_seconds(tick_since(context->t, due));
    memcpy(packet, c->packet, sizeof c->packet);
    report->origin = (uint16_t)(COMMAND_OF_LIST + c->list);
    const CommandReason reason = n > COMMAND_STORED_MAX || crc_of(c) != c->crc ? COMMAND_CRC
                                 : has(m->par.inhibited, c->list)              ? COMMAND_INHIBITED
                                 : m->par.late > 0.0 && late > m->par.late     ? COMMAND_LATE
                                                                               : COMMAND_OK;
    report->reason = (uint16_t)reason;
    m->mem.released += reason == COMMAND_OK;
    m->mem.skipped += reason != COMMAND_OK;
    switch (reason) {
    case COMMAND_CRC: publish(m, context->t, STORED_COMMANDS_DAMAGED, EVENT_HIGH, c->list, c->step, 0.0); break;
    case COMMAND_INHIBITED: publish(m, context->t, STORED_COMMANDS_INHIBITED, EVENT_LOW, c->list, c->step, 0.0); break;
    case COMMAND_LATE: publish(m, context->t, STORED_COMMANDS_LATE, EVENT_MEDIUM, c->list, c->step, late); break;
    default: break;
    }
    if (c->list == 0u) {
        m->mem.over = (StoredPlace){c->time, (int64_t)c->step + 1};
        memset(c, 0, sizeof *c);
    } else {
        m->mem.lists[c->list].time = c->time;
        m->mem.lists[c->list].step = c->step + 1u;
        end_lists(m, context->t);
    }
    return n;
}

static int64_t next(const void *module)
{
    const StoredCommands *m = module;
    int64_t due;
    (void)first(m, 1, &due);
    return m->par.clocked != 0u && m->mem.known == 0u ? 0 : due; /* 0: at each instant, for the clock may be known */
}

/* ---- its commands */

static CommandReason check(const uint8_t *packet, uint32_t n)
{
    const uint32_t list = ccsds_get16(packet + CHOSEN), action = ccsds_get16(packet + ACTION);
    switch (packet[6]) {
    case COMMAND_STORE:
        return n < (uint32_t)COMMAND_STORED + (uint32_t)COMMAND_HEADER ||
                       n > (uint32_t)COMMAND_STORED + COMMAND_STORED_MAX
                   ? COMMAND_LENGTH
               : ccsds_crc16(packet + LIST, n - (uint32_t)LIST) != ccsds_get16(packet + CRC) ? COMMAND_CRC
               : ccsds_get16(packet + LIST) >= STORED_LISTS                                  ? COMMAND_PLACE
               : (packet[TIME] & 0x80u) != 0u || ccsds_get16(packet + STEP) == COMMAND_ALL   ? COMMAND_VALUE
                                                                                             : COMMAND_OK;
    case COMMAND_DELETE: return list < STORED_LISTS || list == COMMAND_ALL ? COMMAND_OK : COMMAND_PLACE;
    case COMMAND_CONTROL:
        return list >= STORED_LISTS && list != COMMAND_ALL ? COMMAND_PLACE
               : action > LIST_ALLOW || (action == LIST_START && list == COMMAND_ALL) ||
                       (action <= LIST_STOP && list == 0u)
                   ? COMMAND_VALUE
                   : COMMAND_OK;
    default: return list < STORED_LISTS ? COMMAND_OK : COMMAND_PLACE;
    }
}

/* The place of a list's step, else a free one, else STORED_COMMANDS. */
static uint32_t place_of(const StoredCommands *m, uint32_t list, uint32_t step)
{
    uint32_t found = STORED_COMMANDS;
    for (uint32_t i = 0u; i < STORED_COMMANDS; i++) {
        const StoredCommand *c = &m->par.commands[i];
        if (c->size > 0u && c->list == list && c->step == step) {
            return i;
        }
        found = c->size == 0u && found == STORED_COMMANDS ? i : found;
    }
    return found;
}

static CommandReason store(StoredCommands *m, const uint8_t *packet, int64_t t)
{
    const uint16_t list = ccsds_get16(packet + LIST), step = ccsds_get16(packet + STEP);
    const uint32_t place = place_of(m, list, step);
    if (place == STORED_COMMANDS) {
        return COMMAND_BUSY;
    }
    const uint32_t n = (uint32_t)ccsds_get16(packet + 4) + 7u - (uint32_t)COMMAND_STORED;
    StoredCommand c = {.time = (int64_t)((uint64_t)ccsds_get32(packet + TIME) << 32 | ccsds_get32(packet + TIME + 4)),
                       .list = list,
                       .step = step,
                       .size = (uint16_t)n,
                       .crc = ccsds_get16(packet + CRC)};
    memcpy(c.packet, packet + COMMAND_STORED, n);
    if (conflicts(m, &c)) {
        return COMMAND_CONFLICT;
    }
    m->par.commands[place] = c;
    if (list == 0u && is_before(&c, m->mem.over.time, m->mem.over.step)) {
        m->mem.over = m->mem.kept = (StoredPlace){c.time, step};
    }
    end_lists(m, t);
    return COMMAND_OK;
}

static CommandReason erase(StoredCommands *m, uint32_t list, uint32_t step, int64_t t)
{
    uint32_t n = 0u;
    for (uint32_t i = 0u; i < STORED_COMMANDS; i++) {
        StoredCommand *c = &m->par.commands[i];
        if (c->size > 0u && (list == COMMAND_ALL || c->list == list) && (step == COMMAND_ALL || c->step == step)) {
            memset(c, 0, sizeof *c);
            n++;
        }
    }
    end_lists(m, t);
    return n > 0u || list == COMMAND_ALL || step == COMMAND_ALL ? COMMAND_OK : COMMAND_PLACE;
}

/* Write a list's commands into the rows of a report, in their order. */
static uint32_t report_list(const StoredCommands *m, uint32_t list, uint8_t *data)
{
    const StoredCommand *last = NULL;
    uint32_t n = 0u;
    for (;;) {
        const StoredCommand *found = NULL;
        for (uint32_t i = 0u; i < STORED_COMMANDS; i++) {
            const StoredCommand *c = &m->par.commands[i];
            if (c->size > 0u && c->list == list && (last == NULL || is_before(last, c->time, c->step)) &&
                (found == NULL || is_before(c, found->time, found->step))) {
                found = c;
            }
        }
        if (found == NULL) {
            return n;
        }
        uint8_t *row = data + n;
        ccsds_put32(row, (uint32_t)((uint64_t)found->time >> 32));
        ccsds_put32(row + 4, (uint32_t)found->time);
        ccsds_put16(row + 8, found->step);
        ccsds_put16(row + 10, found->size);
        ccsds_put16(row + 12, found->crc);
        ccsds_put16(row + 14, found->packet[6]);
        n += (uint32_t)ROW;
        last = found;
    }
}

static CommandReason start(StoredCommands *m, uint32_t i, uint16_t crc, int64_t t)
{
    StoredList *list = &m->mem.lists[i];
    uint8_t rows[STORED_COMMANDS * ROW];
    const uint32_t n = report_list(m, i, rows);
    if (n == 0u) {
        return COMMAND_PLACE;
    }
    if (crc != 0u && ccsds_crc16(rows, n) != crc) {
        return COMMAND_CRC;
    }
    if ((list->state & STORED_RUNS) != 0u) {
        return COMMAND_RUNNING;
    }
    if (has(m->par.inhibited, i)) {
        return COMMAND_INHIBITED;
    }
    const StoredList before = *list;
    *list = (StoredList){t, 0, 0, 0u, STORED_RUNS};
    for (uint32_t k = 0u; k < STORED_COMMANDS; k++) {
        if (m->par.commands[k].list == i && conflicts(m, &m->par.commands[k])) {
            *list = before;
            return COMMAND_CONFLICT;
        }
    }
    publish(m, t, STORED_COMMANDS_STARTED, EVENT_INFO, i, 0u, 0.0);
    return COMMAND_OK;
}

/* Stop, hold or release a list. */
static CommandReason control(StoredCommands *m, uint32_t i, uint32_t action, int64_t t)
{
    StoredList *list = &m->mem.lists[i];
    const int held = (list->state & STORED_HELD) != 0u;
    if ((i > 0u && (list->state & STORED_RUNS) == 0u) || (action == LIST_HOLD && held) ||
        (action == LIST_RELEASE && !held)) {
        return COMMAND_RUNNING;
    }
    if (action == LIST_STOP) {
        end_list(m, i, t);
    } else if (action == LIST_HOLD) {
        list->state |= STORED_HELD;
        list->held = t;
    } else {
        list->state &= ~(uint32_t)STORED_HELD;
        list->begun = exec_later(list->begun, tick_since(t, list->held));
    }
    return COMMAND_OK;
}

static CommandReason control_lists(StoredCommands *m, uint32_t list, uint32_t action, uint16_t crc, int64_t t)
{
    const uint32_t all = list == COMMAND_ALL;
    const uint32_t set = all ? (1u << STORED_LISTS) - 1u : 1u << list;
    CommandReason reason = COMMAND_OK;
    switch (action) {
    case LIST_START: return start(m, list, crc, t);
    case LIST_INHIBIT: m->par.inhibited |= set; break;
    case LIST_ALLOW: m->par.inhibited &= ~set; break;
    default:
        for (uint32_t i = action == LIST_STOP; i < STORED_LISTS; i++) {
            reason = has(set, i) ? control(m, i, action, t) : reason;
        }
    }
    return all ? COMMAND_OK : reason;
}

static CommandReason execute(const CommandContext *context, void *module, const uint8_t *packet, CommandReport *report,
                             uint8_t *data)
{
    StoredCommands *m = module;
    const uint32_t list = ccsds_get16(packet + CHOSEN);
    switch (packet[6]) {
    case COMMAND_STORE: return store(m, packet, context->t);
    case COMMAND_DELETE: return erase(m, list, ccsds_get16(packet + CHOSEN_STEP), context->t);
    case COMMAND_CONTROL:
        return control_lists(m, list, ccsds_get16(packet + ACTION), ccsds_get16(packet + CHECK), context->t);
    default: report->n = (uint16_t)report_list(m, list, data); return COMMAND_OK;
    }
}

const CommandService stored_commands_service = {
    .first = COMMAND_STORE, .n = 4u, .check = check, .execute = execute, .take = take, .next = next};

/* ---- non-volatile memory */

static void put_place(uint32_t *words, StoredPlace place)
{
    words[0] = (uint32_t)((uint64_t)place.time >> 32);
    words[1] = (uint32_t)place.time;
    words[2] = (uint32_t)place.step;
}

static StoredPlace get_place(const uint32_t *words)
{
    return (StoredPlace){(int64_t)((uint64_t)words[0] << 32 | words[1]), words[2]};
}

/* What was executed before leaves the store, whatever brought it back. */
static void drop_over(StoredCommands *m, int64_t t)
{
    uint32_t n = 0u;
    for (uint32_t i = 0u; i < STORED_COMMANDS; i++) {
        StoredCommand *c = &m->par.commands[i];
        if (c->size > 0u && c->list == 0u && is_before(c, m->mem.over.time, m->mem.over.step)) {
            memset(c, 0, sizeof *c);
            n++;
        }
    }
    if (n > 0u) {
        publish(m, t, STORED_COMMANDS_OVER, EVENT_INFO, n, 0u, 0.0);
    }
}

/* Let the memory have all that is due, of list 0. */
static void keep(StoredCommands *m, int64_t t)
{
    NvmPacket *request = &m->out.request;
    const NvmPacket *reply = &m->in.reply;
    const NvmCode done = nvm_answered(request, reply, m->par.slot, t);
    m->mem.waited += m->mem.waited < (uint32_t)STORED_PATIENCE;
    if (done == NVM_NOTHING || reply->refused != 0u) {
        return;
    }
    m->mem.waited = 0u;
    if (done == NVM_STORE) {
        m->mem.kept = m->mem.wanted;
    } else if (m->mem.restored == 0u && nvm_has(reply->data, MARK) > 0) {
        m->mem.over = m->mem.kept = get_place(reply->data);
    }
    m->mem.restored = 1u;
    drop_over(m, t);
    m->mem.wanted = m->mem.kept;
    for (uint32_t i = 0u; i < STORED_COMMANDS; i++) {
        const StoredCommand *c = &m->par.commands[i];
        if (c->list == 0u && due_at(m, c) <= t && !is_before(c, m->mem.wanted.time, m->mem.wanted.step)) {
            m->mem.wanted = (StoredPlace){c->time, (int64_t)c->step + 1};
        }
    }
    if (m->mem.wanted.time != m->mem.kept.time || m->mem.wanted.step != m->mem.kept.step) {
        memset(request->data, 0, sizeof request->data);
        put_place(request->data, m->mem.wanted);
        nvm_store(request, MARK);
    }
}

/* ---- the module */

void stored_commands_reset(StoredCommands *m)
{
    const StoredPlace over = m->mem.over, kept = m->mem.kept;
    const uint32_t restored = m->mem.restored;
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
    m->mem.over = over;
    m->mem.kept = kept;
    m->mem.restored = restored;
}

void stored_commands_update(StoredCommands *m, Tick t)
{
    StoredState *s = &m->out.state;
    int64_t due;
    if (head_written(m->in.clock.head)) {
        m->mem.ahead = tick_since(m->in.clock.time, m->in.clock.head.t);
        m->mem.known = 1u;
    }
    if (m->par.slot != 0u) {
        keep(m, t.t);
    }
    (void)first(m, 1, &due);
    s->next = due == NEVER ? -1 : due;
    s->running = s->held = s->stored = 0u;
    for (uint32_t i = 0u; i < STORED_LISTS; i++) {
        s->running |= ((m->mem.lists[i].state & STORED_RUNS) != 0u ? 1u : 0u) << i;
        s->held |= ((m->mem.lists[i].state & STORED_HELD) != 0u ? 1u : 0u) << i;
    }
    for (uint32_t i = 0u; i < STORED_COMMANDS; i++) {
        s->stored += m->par.commands[i].size > 0u;
    }
    s->inhibited = m->par.inhibited;
    s->released = m->mem.released;
    s->skipped = m->mem.skipped;
    s->head = head_next(s->head, t.t,
                        m->par.clocked != 0u && m->mem.known == 0u ? QUALITY_DEGRADED
                        : m->par.clocked != 0u                     ? quality_through(m->in.clock.head)
                                                                   : QUALITY_GOOD);
}
