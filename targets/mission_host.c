/* SPDX-License-Identifier: Apache-2.0 */
#include "targets/mission_host.h"

#include <string.h>

/* Where reports and packets go. */
typedef struct Link {
    const MissionHost *host;
    const RegisterWindow *w;
    MissionIoCounts *counts;
    const CommandContext *context;
} Link;

static void send_unit(void *user, const uint8_t *unit, uint32_t n)
{
    const Link *link = user;
    (void)mission_io_send(link->host->io, link->w, link->host->io->telemetry, unit, n, link->counts);
}

/* n = 0: flight's instant ends. */
static void send_packet(void *user, const uint8_t *packet, uint32_t n)
{
    const Link *link = user;
    const CommandServices *services = link->host->commands->services;
    if (services != NULL && services->wrap != NULL) {
        services->wrap(link->context, packet, n, send_unit, user);
    } else if (n > 0u) {
        send_unit(user, packet, n);
    }
}

static void send_report(void *user, const CommandReport *report, const uint8_t *data)
{
    const Link *link = user;
    telemetry_report(link->host->telemetry, report, data, send_packet, user);
}

static void begin(const MissionHost *host, int64_t t)
{
    host->restart(t);
    command_begin(host->state);
    telemetry_begin(host->telemetry);
}

void mission_host_exchange(const MissionHost *host, const RegisterWindow *w, int64_t t, MissionIoCounts *counts)
{
    const CommandContext context = {host->state, host->commands, host->mission, t, 0u};
    Link link = {host, w, counts, &context};
    const MissionIo *io = host->io;
    uint32_t n;
    if (t < 0) {
        begin(host, 0);
        (void)mission_io_restarted(io, w, host->start);
        mission_io_forget(io, w);
        while (mission_io_receive(io, w, io->commands, io->packet, io->room, counts) != 0u) {
        } /* commands of the last run */
    } else {
        if (mission_io_restarted(io, w, host->start)) {
            host->init();
            begin(host, t);
        }
        while ((n = mission_io_receive(io, w, io->commands, io->packet, io->room, counts)) != 0u) {
            (void)command_receive(&context, io->packet, n, send_report, &link);
        }
        /* Before the inputs are read, because a reset of flight forgets them. */
        command_execute(host->state, host->commands, host->mission, t, send_report, &link);
        mission_io_read(io, w, host->mission, t, counts);
        host->tick(t);
        telemetry_send(host->telemetry, host->mission, t, host->state, send_packet, &link);
        if (host->commands->services != NULL) {
            host->commands->services->telemetry(host->telemetry, &context, send_report, send_packet, &link);
            send_packet(&link, NULL, 0u);
        }
    }
    mission_io_write(io, w, host->mission, counts);
}

McapStatus mission_record_open(MissionRecord *r, const MissionHost *host, McapWrite write, void *user,
                               const char *target)
{
    const McapPair run[] = {{"mission", host->name}, {"target", target}};
    McapConfig config = {.write = write, .user = user};
    config.schemas = host->schemas;
    config.channels = host->channels;
    config.schemas_max = host->n_schemas;
    config.channels_max = host->n_channels;
    memset(r, 0, sizeof *r);
    McapStatus status = mcap_open(&r->writer, &config);
    if (status == MCAP_OK) {
        r->open = 1u;
        status = mcap_metadata(&r->writer, "run", run, 2u);
    }
    for (uint32_t i = 0u; i < host->io->n_messages && status == MCAP_OK; i++) {
        const MissionDefinition *d = &host->definitions[host->topics[i].definition];
        uint16_t schema, channel;
        if (host->io->messages[i].direction == MISSION_IN) {
            continue;
        }
        status = mcap_add_schema(&r->writer, d->name, d->text, &schema);
        if (status == MCAP_OK) {
            status = mcap_add_channel(&r->writer, host->topics[i].topic, schema, MCAP_ORDER_NATIVE, 0, 0u, &channel);
        }
        if (status == MCAP_OK && r->first == 0u) {
            r->first = channel; /* the ids of the other channels follow */
        }
    }
    return status;
}

/* A message of the executive, kind 0: the mode, 1: its activity. Its topic begins with the first one. */
static McapStatus record_executive_message(MissionRecord *r, const MissionHost *host, uint32_t kind,
                                           const void *message, size_t n)
{
    const MissionExecutive *e = host->executive;
    McapStatus status = MCAP_OK;
    Head head;
    uint16_t schema;
    memcpy(&head, message, sizeof head);
    if (r->executive[kind] == 0u) {
        status = mcap_add_schema(&r->writer, e->definitions[kind].name, e->definitions[kind].text, &schema);
        if (status == MCAP_OK) {
            status = mcap_add_channel(&r->writer, kind == 0u ? e->mode_topic : e->activity_topic, schema,
                                      MCAP_ORDER_NATIVE, 0, 0u, &r->executive[kind]);
        }
    }
    return status == MCAP_OK ? mcap_message(&r->writer, r->executive[kind], head.t, head.sequence, message, n) : status;
}

/* Actions of the executive since the last instant, in the order of the desktop (sim/runtime.cpp): a reset, commands,
 * events, the mode. */
static McapStatus record_executive(MissionRecord *r, const MissionHost *host, int64_t t)
{
    const MissionExecutive *e = host->executive;
    const CommandState *s = host->state;
    McapStatus status = MCAP_OK;
    if (host->start->resets != r->resets) {
        r->resets = host->start->resets;
        r->reported = 0u;
        activity_reset(&r->activity, t, r->resets);
        status = record_executive_message(r, host, 1u, &r->activity, sizeof r->activity);
    }
    if (s->reported < r->reported) { /* the commands have begun anew */
        r->reported = 0u;
    }
    if (s->reported - r->reported > (uint32_t)COMMAND_RECENT) { /* the state keeps no more */
        r->reported = s->reported - (uint32_t)COMMAND_RECENT;
    }
    for (; r->reported < s->reported && status == MCAP_OK; r->reported++) {
        const CommandReport *report = &s->recent[r->reported % (uint32_t)COMMAND_RECENT];
        if (report->executed <= (uint16_t)COMMAND_DONE) { /* how far it is needs no record */
            activity_command(&r->activity, report);
            status = record_executive_message(r, host, 1u, &r->activity, sizeof r->activity);
        }
    }
    for (uint16_t i = 0u; i < host->commands->n_events && status == MCAP_OK; i++) {
        const ExecEvent *event = e->event(host->mission, i);
        if (event->fired_at == t) {
            activity_event(&r->activity, t, i, e->events[i].name, e->events[i].when, event->refused);
            status = record_executive_message(r, host, 1u, &r->activity, sizeof r->activity);
        }
    }
    const uint16_t mode = host->commands->n_modes > 0u ? e->mode(host->mission) : 0u;
    if (host->commands->n_modes > 0u && status == MCAP_OK && activity_mode_began(&r->mode, mode)) {
        activity_mode(&r->mode, t, mode, e->modes[mode]);
        status = record_executive_message(r, host, 0u, &r->mode, sizeof r->mode);
    }
    return status;
}

McapStatus mission_record_take(MissionRecord *r, const MissionHost *host, int64_t t)
{
    uint16_t channel = r->first;
    McapStatus status = MCAP_OK;
    for (uint32_t i = 0u; i < host->io->n_messages && status == MCAP_OK; i++) {
        const MissionMessage *m = &host->io->messages[i];
        if (m->direction != MISSION_IN) {
            Head head;
            const uint8_t *message = (const uint8_t *)host->mission + m->offset;
            memcpy(&head, message, sizeof head);
            status = mcap_message(&r->writer, channel++, t, head.sequence, message, m->size);
        }
    }
    return status == MCAP_OK ? record_executive(r, host, t) : status;
}

McapStatus mission_record_close(MissionRecord *r)
{
    if (r->open == 0u) {
        return MCAP_CLOSED;
    }
    r->open = 0u;
    return mcap_close(&r->writer);
}

/* ---- the hash: FNV-1a */

static uint64_t add_number(uint64_t hash, uint64_t v)
{
    for (int shift = 0; shift < 64; shift += 8) {
        hash = (hash ^ (v >> shift & 0xFFu)) * UINT64_C(0x100000001B3);
    }
    return hash;
}

static uint64_t add_text(uint64_t hash, const char *text)
{
    while (*text != '\0') {
        hash = (hash ^ (uint8_t)*text++) * UINT64_C(0x100000001B3);
    }
    return add_number(hash, 0u);
}

uint64_t mission_host_hash(const MissionHost *host)
{
    const MissionIo *io = host->io;
    uint64_t hash = add_text(UINT64_C(0xCBF29CE484222325), host->name);
    for (uint32_t i = 0u; i < io->n_messages; i++) {
        const MissionMessage *m = &io->messages[i];
        const MissionTopic *topic = &host->topics[i];
        hash = add_text(add_text(add_text(hash, m->path), m->type), host->definitions[topic->definition].text);
        hash = add_number(hash, m->size | (uint64_t)m->direction << 32 | (uint64_t)topic->latency << 40);
    }
    for (uint32_t i = 0u; i < host->n_rates; i++) {
        hash = add_number(add_number(hash, (uint64_t)host->rates[i].period), (uint64_t)host->rates[i].offset);
    }
    for (uint32_t i = 0u; i < io->n_boards; i++) {
        hash = add_number(hash, io->boards[i]->hash);
    }
    for (uint32_t i = 0u; i < io->n_lanes; i++) {
        const MissionLane *row = &io->lanes[i];
        hash = add_number(hash, row->message | (uint64_t)row->board << 16 | (uint64_t)row->lane << 32 |
                                    (uint64_t)row->field << 48);
        hash = add_number(hash, row->type != NULL ? 1u : 2u);
    }
    return hash;
}
