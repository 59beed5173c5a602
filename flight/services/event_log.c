/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/services/event_log.h"

#include <string.h>

static const ExecRun runs[] = {{8u, 1u}, {4u, 2u}, {2u, 2u}, {4u, 1u}, {8u, 4u}}; /* of an EventRecord */

/* The rules of an output. */
static EventFilter rules_of(const EventLog *m, uint32_t output)
{
    for (uint32_t i = 0u; i < EVENT_FILTERS; i++) {
        if (m->par.filters[i].on != 0u && m->par.filters[i].output == output) {
            return m->par.filters[i];
        }
    }
    return (EventFilter){1u, output, m->par.least, m->par.most};
}

static void keep(EventLog *m, EventSource *source, uint16_t output, const FlightEvent *e)
{
    EventRecord *record = &m->mem.records[m->mem.number % EVENTS_KEPT];
    record->t = e->head.t;
    record->number = ++m->mem.number;
    record->before = source->before;
    record->output = output;
    record->severity = (uint16_t)e->severity;
    record->id = e->id;
    memcpy(record->arguments, e->arguments, sizeof record->arguments);
    source->before = 0u;
}

/* Take the event of an output into the log, if it is new and the rules allow it. */
static void log_event(EventLog *m, EventSource *source, uint16_t output, const FlightEvent *e)
{
    if (!head_written(e->head) || (e->head.sequence == source->sequence && e->head.t == source->t)) {
        return;
    }
    /* A module that was reset counts from 1 again. */
    const uint32_t replaced = e->count - 1u - (e->count > source->count ? source->count : 0u);
    const EventFilter rules = rules_of(m, output);
    source->t = e->head.t;
    source->sequence = e->head.sequence;
    source->count = e->count;
    source->before += replaced;
    m->mem.replaced += replaced;
    if ((uint32_t)e->severity < rules.least) {
        m->mem.below++;
        return;
    }
    if (source->logged == 0u || tick_seconds(tick_since(source->t, source->begun)) >= m->par.window) {
        source->begun = source->t;
        source->logged = 0u;
    }
    if (rules.most > 0u && source->logged >= rules.most) {
        m->mem.suppressed++;
        source->before++;
        return;
    }
    source->logged++;
    keep(m, source, output, e);
}

static void log_all(EventLog *m, const CommandContext *context)
{
    const CommandServices *services = context->table->services;
    if (m->mem.begun == 0u && context->t <= m->mem.seen) { /* the records are of another run */
        m->mem.number = m->mem.sent = 0u;
    }
    m->mem.begun = 1u;
    m->mem.seen = context->t;
    m->mem.unseen = services->n_events > EVENT_SOURCES ? services->n_events - EVENT_SOURCES : 0u;
    for (uint32_t i = 0u; i < services->n_events && i < EVENT_SOURCES; i++) {
        uint32_t size;
        FlightEvent e;
        memcpy(&e, services->output(context->mission, services->events[i], &size), sizeof e);
        log_event(m, &m->mem.sources[i], services->events[i], &e);
    }
}

static uint32_t telemetry(const CommandContext *context, void *module, uint8_t *content)
{
    EventLog *m = module;
    uint32_t number;
    if (m->mem.sent == m->mem.number) {
        log_all(m, context);
    }
    const uint32_t oldest = m->mem.number > EVENTS_KEPT ? m->mem.number - EVENTS_KEPT + 1u : 1u;
    m->mem.again = m->mem.again > oldest ? m->mem.again : oldest;
    if (m->mem.sent < m->mem.number) {
        number = ++m->mem.sent;
    } else if (m->mem.left > 0u && m->mem.again <= m->mem.until) {
        number = m->mem.again++;
        m->mem.left--;
    } else {
        return 0u;
    }
    memcpy(content, &m->mem.records[(number - 1u) % EVENTS_KEPT], sizeof(EventRecord));
    exec_big_endian(runs, 5u, content, 0u, sizeof(EventRecord));
    return sizeof(EventRecord);
}

static CommandReason check(const uint8_t *packet, uint32_t n)
{
    (void)packet;
    (void)n;
    return COMMAND_OK;
}

static CommandReason execute(const CommandContext *context, void *module, const uint8_t *packet, CommandReport *report,
                             uint8_t *data)
{
    EventLog *m = module;
    (void)context;
    (void)packet;
    (void)report;
    (void)data;
    m->mem.again = 1u;
    m->mem.until = m->mem.number;
    return COMMAND_OK;
}

const CommandService event_log_service = {.first = COMMAND_EVENTS,
                                          .n = 1u,
                                          .check = check,
                                          .execute = execute,
                                          .telemetry = telemetry,
                                          .stream = STREAM_EVENTS};

/* ---- the module */

void event_log_reset(EventLog *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(m->mem.sources, 0, sizeof m->mem.sources);
    m->mem.begun = m->mem.left = m->mem.until = 0u;
    m->mem.below = m->mem.suppressed = m->mem.replaced = 0u;
}

void event_log_update(EventLog *m, Tick t)
{
    EventLogState *s = &m->out.state;
    m->mem.left = EVENTS_AT_ONCE;
    s->kept = m->mem.number < EVENTS_KEPT ? m->mem.number : EVENTS_KEPT;
    s->logged = m->mem.number;
    s->below = m->mem.below;
    s->suppressed = m->mem.suppressed;
    s->replaced = m->mem.replaced;
    s->unseen = m->mem.unseen;
    s->head = head_next(s->head, t.t, m->mem.unseen != 0u ? QUALITY_DEGRADED : QUALITY_GOOD);
}
