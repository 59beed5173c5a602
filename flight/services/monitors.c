/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/services/monitors.h"

#include "ccsds/bytes.h"

#include <string.h>

/* ---- checks */

/* Look at a new writing of its output. NaN is wrong. */
static int is_wrong(const Monitor *one, MonitorMemory *memory, const void *numbers)
{
    const double value = exec_measured((ExecMeasure)one->measure, (FledgeType)one->type, numbers, one->n);
    const double change = value - memory->last;
    const int first = memory->sequence == 0u;
    memory->last = value;
    switch (one->kind) {
    case MONITOR_LIMITS: return !(value >= one->low && value <= one->high);
    case MONITOR_DELTA: return !first && !(change >= one->low && change <= one->high);
    case MONITOR_EXPECTED: return !(value >= one->low && value <= one->low);
    default: return 0;
    }
}

static void say(Monitors *m, MonitorsEventId id, EventSeverity severity, uint32_t place, double value, int64_t t)
{
    event_say(&m->out.event, t, (FlightEvent){.id = id, .severity = severity, .arguments = {place, value}});
}

static void look(Monitors *m, uint32_t place, const CommandContext *context)
{
    const Monitor *one = &m->par.monitors[place];
    MonitorMemory *memory = &m->mem.watched[place];
    const uint32_t bit = 1u << place;
    const uint32_t bad = m->mem.bad & bit;
    m->mem.bad &= ~bit;
    if (one->on == 0u || one->kind == MONITOR_NOTHING) {
        *memory = (MonitorMemory){.event = exec_armed()};
        return;
    }
    uint32_t size = 0u;
    const uint8_t *output = one->output < context->table->n_outputs
                                ? context->table->services->output(context->mission, (uint16_t)one->output, &size)
                                : NULL;
    if (element_span(one->type, one->offset, one->n, size) == 0u) { /* it names no number */
        m->mem.bad |= bit;
        if (bad == 0u) {
            say(m, MONITORS_BAD, EVENT_LOW, place, 0.0, context->t);
        }
        return;
    }
    Head head;
    memcpy(&head, output, sizeof head);
    if (head_written(head) && head.sequence != memory->sequence) {
        memory->wrong = (uint32_t)is_wrong(one, memory, output + one->offset);
        memory->sequence = head.sequence;
    }
    const int was = memory->event.armed < 0, wrong = memory->wrong != 0u;
    if (exec_fires(&memory->event, wrong, !wrong, one->hold, (int32_t)one->count, 0, context->t)) {
        m->mem.fired++;
        m->mem.pending |= one->list > 0u ? bit : 0u;
        say(m, MONITORS_FIRED, EVENT_MEDIUM, place, memory->last, context->t);
    } else if (was && memory->event.armed > 0) {
        say(m, MONITORS_RIGHT, EVENT_INFO, place, memory->last, context->t);
    }
}

/* ---- what it has for flight */

/* A command of its own. */
static uint32_t write_start(const CommandTable *table, uint32_t list, uint32_t sequence, uint8_t *packet)
{
    const uint32_t n = 16u;
    uint8_t sum = 0xFFu;
    memset(packet, 0, n);
    ccsds_put16(packet, table->stream);
    ccsds_put16(packet + 2, 0xC000u | (sequence & 0x3FFFu));
    ccsds_put16(packet + 4, n - 7u);
    packet[6] = COMMAND_CONTROL;
    ccsds_put16(packet + COMMAND_HEADER, table->version);
    ccsds_put16(packet + COMMAND_HEADER + 2, list);
    ccsds_put16(packet + COMMAND_HEADER + 4, LIST_START);
    for (uint32_t i = 0u; i < n; i++) {
        sum ^= packet[i];
    }
    packet[7] = sum;
    return n;
}

static uint32_t take(const CommandContext *context, void *module, uint8_t *packet, CommandReport *report)
{
    Monitors *m = module;
    if (m->mem.begun == 0u || m->mem.looked != context->t) {
        for (uint32_t i = 0u; i < MONITORS; i++) {
            look(m, i, context);
        }
        m->mem.begun = 1u;
        m->mem.looked = context->t;
    }
    for (uint32_t i = 0u; i < MONITORS; i++) {
        if ((m->mem.pending >> i & 1u) != 0u) {
            m->mem.pending &= ~(1u << i);
            report->from = (uint16_t)(COMMAND_OF_MONITOR + i);
            return write_start(context->table, m->par.monitors[i].list, m->mem.fired, packet);
        }
    }
    return 0u;
}

static int64_t next(const void *module)
{
    const Monitors *m = module;
    for (uint32_t i = 0u; i < MONITORS; i++) {
        if (m->par.monitors[i].on != 0u) {
            return 0; /* at each instant */
        }
    }
    return INT64_MAX;
}

const CommandService monitors_service = {.take = take, .next = next};

/* ---- the module */

void monitors_reset(Monitors *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
    for (uint32_t i = 0u; i < MONITORS; i++) {
        m->mem.watched[i].event = exec_armed();
    }
}

void monitors_update(Monitors *m, Tick t)
{
    MonitorState *s = &m->out.state;
    s->on = s->wrong = s->held = 0u;
    for (uint32_t i = 0u; i < MONITORS; i++) {
        const MonitorMemory *memory = &m->mem.watched[i];
        s->on |= (m->par.monitors[i].on != 0u ? 1u : 0u) << i;
        s->wrong |= (memory->wrong != 0u ? 1u : 0u) << i;
        s->held |= (memory->event.armed < 0 ? 1u : 0u) << i;
    }
    s->bad = m->mem.bad;
    s->fired = m->mem.fired;
    s->head = head_next(s->head, t.t, m->mem.bad != 0u ? QUALITY_DEGRADED : QUALITY_GOOD);
}
