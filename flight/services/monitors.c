/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/services/monitors.h"

#include <string.h>

/* ---- checks */

static void publish(Monitors *m, MonitorsEventId id, EventSeverity severity, uint32_t place, double value, int64_t t)
{
    event_publish(&m->out.event, t, (FlightEvent){.id = id, .severity = severity, .arguments = {place, value}});
}

static void evaluate(Monitors *m, uint32_t place, const CommandContext *context)
{
    const Monitor *monitor = &m->par.monitors[place];
    MonitorMemory *memory = &m->mem.watched[place];
    const uint32_t bit = 1u << place;
    const uint32_t bad = m->mem.bad & bit;
    m->mem.bad &= ~bit;
    /* undecided: there are no others */
    switch (monitor_evaluate(monitor, memory, context)) {
    case MONITOR_BAD:
        m->mem.bad |= bit;
        if (bad == 0u) {
            publish(m, MONITORS_BAD, EVENT_LOW, place, 0.0, context->t);
        }
        break;
    case MONITOR_FIRES:
        m->mem.fired++;
        m->mem.pending |= monitor->list > 0u ? bit : 0u;
        publish(m, MONITORS_FIRED, EVENT_MEDIUM, place, memory->last, context->t);
        break;
    case MONITOR_ENDS: publish(m, MONITORS_RIGHT, EVENT_INFO, place, memory->last, context->t); break;
    case MONITOR_SAME: break;
    }
}

/* ---- what it has for flight */

static uint32_t take(const CommandContext *context, void *module, uint8_t *packet, CommandReport *report)
{
    Monitors *m = module;
    if (m->mem.begun == 0u || m->mem.evaluated != context->t) {
        for (uint32_t i = 0u; i < MONITORS; i++) {
            evaluate(m, i, context);
        }
        m->mem.begun = 1u;
        m->mem.evaluated = context->t;
    }
    for (uint32_t i = 0u; i < MONITORS; i++) {
        if ((m->mem.pending >> i & 1u) != 0u) {
            m->mem.pending &= ~(1u << i);
            report->origin = (uint16_t)(COMMAND_OF_MONITOR + i);
            return monitor_start(context->table, m->par.monitors[i].list, m->mem.fired, packet);
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
        m->mem.watched[i] = monitor_new();
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
