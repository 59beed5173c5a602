/* SPDX-License-Identifier: Apache-2.0 */
#include "fmi/fmu/mission.h"

#include "flight/msg/computer.h"
#include "fmi/fmu/flight.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* The head of the state. */
typedef struct State {
    int64_t up;       /* [ns] when the computer begins anew after a reset; -1: it is up */
    uint32_t entered; /* how often a mode began */
    uint32_t resets;  /* the last count of the line */
    uint32_t publish; /* 1: some of the configuration is changed */
    uint32_t uplink;  /* [bytes] of packets that wait for the next instant */
    CommandState commands;
} State;

/* An instance. Behind it, in the same memory, are the parts of the state, then those that are no part of it. */
typedef struct System {
    const FmuHost *host;
    CommandTable commands;
    TelemetryTable telemetry;
    CommandServices services;
    uint8_t *mission;      /* the mission's struct, the first part */
    uint8_t *start, *seen; /* two more: with its parameters as they were at the start, and when they were last seen */
    State *state;
    uint32_t *fired;         /* a counter for each event */
    uint8_t *uplink;         /* the packets that wait */
    size_t size;             /* [bytes] of the state */
    uint8_t *scratch;        /* as large as the mission */
    uint8_t *downlink;       /* the packets that the last advance() or begin() has sent */
    size_t downlink_n, room; /* [bytes] */
    int64_t t;               /* [ns] the instant of flight that runs */
} System;

static void report(const System *s, FmuSeverity severity, const char *category, const char *text)
{
    s->host->log(s->host->user, severity, category, text);
}

static size_t rounded(size_t n)
{
    return (n + 15u) / 16u * 16u;
}

/* The instance of a mission's struct, its first part. */
static System *instance_of(void *mission)
{
    return (System *)(void *)((uint8_t *)mission - rounded(sizeof(System)));
}

/* Begin at t, with the inputs as they are. */
static void restart(System *s, int64_t t)
{
    const FmuMission *m = &fmu_mission;
    memcpy(s->scratch, s->mission + m->inputs, m->inputs_size);
    m->restart(s->mission, t);
    memcpy(s->mission + m->inputs, s->scratch, m->inputs_size);
    memcpy(s->seen, s->mission, m->size);
    s->state->publish = 0u;
}

/* What commands do to the instance. */
static void reset(void *mission, int64_t t)
{
    restart(instance_of(mission), t);
}

static void set_rate(void *mission, uint16_t output, int on, uint16_t every)
{
    telemetry_rate(&instance_of(mission)->telemetry, output, on, every);
}

/* The parts of an instance's memory, in their order; the state ends before PACKET. */
enum { MISSION, START, SEEN, STATE, FIRED, STAGED, QUEUE, UPLINK, RATES, PACKET, SCRATCH, PARTS };

static void *create(const FmuHost *host)
{
    const FmuMission *m = &fmu_mission;
    const size_t n_rates = 3u + (size_t)m->telemetry->n_outputs + COMMAND_STREAMS, room = m->commands->room,
                 sizes[PARTS] = {m->size,
                                 m->size,
                                 m->size,
                                 sizeof(State),
                                 m->layout->n_events * sizeof(uint32_t),
                                 m->staged,
                                 room,
                                 room,
                                 n_rates * sizeof(TelemetryRate),
                                 m->packet,
                                 m->size};
    size_t at[PARTS + 1] = {rounded(sizeof(System))};
    for (size_t i = 0u; i < PARTS; i++) {
        at[i + 1u] = at[i] + rounded(sizes[i]);
    }
    uint8_t *memory = calloc(1u, at[PARTS]);
    if (memory == NULL) {
        host->log(host->user, FMU_ERROR, "errors", "there is no memory for another instance");
        return NULL;
    }
    System *s = (System *)(void *)memory;
    s->host = host;
    s->commands = *m->commands;
    s->telemetry = *m->telemetry;
    if (m->services != NULL) {
        s->services = *m->services;
        s->commands.services = &s->services;
    }
    s->commands.reset = reset;
    s->commands.telemetry = set_rate;
    s->mission = memory + at[MISSION];
    s->start = memory + at[START];
    s->seen = memory + at[SEEN];
    s->state = (State *)(void *)(memory + at[STATE]);
    s->fired = (uint32_t *)(void *)(memory + at[FIRED]);
    s->commands.staged = memory + at[STAGED];
    s->commands.queue = memory + at[QUEUE];
    s->uplink = memory + at[UPLINK];
    s->telemetry.rates = (TelemetryRate *)(void *)(memory + at[RATES]);
    s->size = at[PACKET] - at[MISSION];
    s->telemetry.packet = memory + at[PACKET];
    s->scratch = memory + at[SCRATCH];
    m->init(s->mission);
    memcpy(s->start, s->mission, m->size);
    memcpy(s->seen, s->mission, m->size);
    return s;
}

static void destroy(void *self)
{
    System *s = self;
    if (s != NULL) {
        free(s->downlink);
        free(s);
    }
}

static const FmuLayout *layout(const void *self)
{
    (void)self;
    return fmu_mission.layout;
}

static void *memory(void *self, uint32_t block)
{
    const FmuMission *m = &fmu_mission;
    return ((System *)self)->mission + (block < m->commands->n_blocks
                                            ? m->parameters[block].offset
                                            : m->messages[block - m->commands->n_blocks].offset);
}

static int changed(void *self, uint32_t block)
{
    System *s = self;
    const CommandBlock *b = &s->commands.blocks[block];
    const MissionParameters *p = &fmu_mission.parameters[block];
    if (!flight_keeps_rules(s->host, b, p->path, s->mission + p->offset)) {
        return -1;
    }
    s->state->publish |= b->configuration;
    return 0;
}

/* Publish the configuration whose parameters were changed since they were last seen. */
static void publish_changed(System *s, int64_t t)
{
    for (uint16_t i = 0u; i < s->commands.n_blocks; i++) {
        const MissionParameters *p = &fmu_mission.parameters[i];
        if (s->commands.blocks[i].configuration && memcmp(s->mission + p->offset, s->seen + p->offset, p->size) != 0) {
            s->commands.publish(s->mission, i, t);
            memcpy(s->seen + p->offset, s->mission + p->offset, p->size);
        }
    }
    s->state->publish = 0u;
}

static CommandContext context_of(System *s)
{
    return (CommandContext){&s->state->commands, &s->commands, s->mission, s->t, 0u};
}

static void begin_commands(System *s)
{
    command_begin(&s->state->commands);
    telemetry_begin(&s->telemetry);
}

static uint16_t mode_of(const System *s)
{
    return s->telemetry.mode(s->mission);
}

static uint32_t resets(const System *s)
{
    uint32_t count = 0u;
    if (fmu_mission.reset != FMU_NO_RESET) {
        memcpy(&count, s->mission + (size_t)fmu_mission.reset + offsetof(ComputerReset, count), sizeof count);
    }
    return count;
}

/* Whether the computer is down at t, an instant of flight. At the first instant at which it is up again, flight begins
 * anew. */
static int is_down(System *s, int64_t t)
{
    const FmuMission *m = &fmu_mission;
    State *state = s->state;
    if (state->up < 0 && resets(s) != state->resets) {
        memcpy(s->scratch, s->mission, m->size);
        m->restart(s->scratch, exec_later(t, m->down));
        state->up = m->next(s->scratch);
        report(s, FMU_WARNING, "events", "the computer was reset");
    }
    if (state->up < 0 || t < state->up) {
        return state->up >= 0;
    }
    state->up = -1;
    state->resets = resets(s);
    for (uint32_t i = 0u; i < s->commands.n_blocks; i++) {
        const MissionParameters *p = &m->parameters[i];
        memcpy(s->mission + p->offset, s->start + p->offset, p->size);
    }
    begin_commands(s);
    restart(s, t);
    return 0;
}

/* ---- packets */

/* Keep a unit for the importer. */
static void send_unit(void *user, const uint8_t *unit, uint32_t n)
{
    System *s = user;
    if (s->downlink_n + n > s->room) {
        const size_t room = 2u * s->room + n + 1024u;
        uint8_t *more = realloc(s->downlink, room);
        if (more == NULL) {
            report(s, FMU_WARNING, "warnings", "there is no memory for the packets that flight sends: some are lost");
            return;
        }
        s->downlink = more;
        s->room = room;
    }
    memcpy(s->downlink + s->downlink_n, unit, n);
    s->downlink_n += n;
}

/* n = 0: flight's instant ends. */
static void send_packet(void *user, const uint8_t *packet, uint32_t n)
{
    System *s = user;
    if (s->services.wrap != NULL) {
        const CommandContext context = context_of(s);
        s->services.wrap(&context, packet, n, send_unit, s);
    } else if (n > 0u) {
        send_unit(s, packet, n);
    }
}

static void send_report(void *user, const CommandReport *r, const uint8_t *data)
{
    System *s = user;
    char text[96];
    if (r->reason != 0u) {
        (void)snprintf(text, sizeof text, "the command %u of code %u is refused for reason %u", (unsigned)r->sequence,
                       (unsigned)r->code, (unsigned)r->reason);
        report(s, FMU_WARNING, "commands", text);
    }
    telemetry_report(&s->telemetry, r, data, send_packet, s);
}

/* Flight's commands at its instant t: those that came, and those that it has stored. */
static void command(System *s)
{
    const CommandContext context = context_of(s);
    State *state = s->state;
    uint32_t at = 0u;
    while (at < state->uplink) {
        const uint32_t n = (uint32_t)flight_unit_size(s->uplink + at, state->uplink - at, s->services.unwrap != NULL);
        (void)command_receive(&context, s->uplink + at, n, send_report, s);
        at += n;
    }
    state->uplink = 0u;
    const uint32_t executed = state->commands.counters.executed;
    command_execute(&state->commands, &s->commands, s->mission, s->t, send_report, s);
    if (state->commands.counters.executed != executed) { /* commands publish what they write */
        memcpy(s->seen, s->mission, fmu_mission.size);
    }
}

static void send_telemetry(System *s)
{
    const CommandContext context = context_of(s);
    telemetry_send(&s->telemetry, s->mission, s->t, &s->state->commands, send_packet, s);
    if (s->commands.services != NULL) {
        s->services.telemetry(&s->telemetry, &context, send_report, send_packet, s);
        send_packet(s, NULL, 0u);
    }
}

static int uplink(void *self, const uint8_t *packets, size_t n)
{
    System *s = self;
    if (n > s->commands.room - s->state->uplink) {
        char text[96];
        (void)snprintf(text, sizeof text, "flight takes %lu bytes of packets at an instant; found %lu",
                       (unsigned long)s->commands.room, (unsigned long)(s->state->uplink + n));
        report(s, FMU_ERROR, "errors", text);
        return -1;
    }
    memcpy(s->uplink + s->state->uplink, packets, n);
    s->state->uplink += (uint32_t)n;
    return 0;
}

static const uint8_t *downlink(const void *self, size_t *n)
{
    const System *s = self;
    *n = s->downlink_n;
    return s->downlink;
}

/* ---- time */

/* Count what happened at t. Returns whether anything did. */
static int count(System *s, int64_t t, uint16_t before)
{
    const FmuMission *m = &fmu_mission;
    int happened = 0;
    if (s->commands.n_modes > 0u && mode_of(s) != before) {
        s->state->entered++;
        happened = 1;
        report(s, FMU_OK, "modes", m->modes[mode_of(s)]);
    }
    for (uint32_t i = 0u; i < m->layout->n_events; i++) {
        ExecEvent event;
        memcpy(&event, s->mission + m->events[i], sizeof event);
        if (event.fired_at == t) {
            s->fired[i]++;
            happened = 1;
            report(s, FMU_OK, "events", m->event_names[i]);
        }
    }
    if (happened) { /* an event publishes what it sets */
        memcpy(s->seen, s->mission, m->size);
    }
    return happened;
}

/* An instant of flight. Returns whether a mode changed or an event fired. */
static int instant(System *s, int64_t t)
{
    if (is_down(s, t)) {
        return 0;
    }
    const uint16_t before = mode_of(s);
    s->t = t;
    if (s->state->publish) {
        publish_changed(s, t);
    }
    command(s);
    fmu_mission.tick(s->mission, t);
    send_telemetry(s);
    return count(s, t, before);
}

/* Parameters that flight itself has changed, at the instant 0 of an earlier beginning, are again as they were. */
static void take_back(System *s)
{
    for (uint16_t i = 0u; i < s->commands.n_blocks; i++) {
        const MissionParameters *p = &fmu_mission.parameters[i];
        for (size_t k = p->offset; k < (size_t)p->offset + p->size; k++) {
            s->mission[k] = s->mission[k] == s->seen[k] ? s->start[k] : s->mission[k];
        }
    }
}

static int begin(void *self)
{
    System *s = self;
    take_back(s);
    memset(s->fired, 0, fmu_mission.layout->n_events * sizeof *s->fired);
    const uint32_t waiting = s->state->uplink;
    memset(s->state, 0, sizeof *s->state);
    s->state->up = -1;
    s->state->uplink = waiting;
    s->state->entered = s->commands.n_modes > 0u;
    s->downlink_n = 0u;
    begin_commands(s);
    restart(s, 0);
    memcpy(s->start, s->mission, fmu_mission.size);
    (void)instant(s, 0);
    return 0;
}

static int advance(void *self, int64_t until, int stop, int64_t *reached)
{
    System *s = self;
    State *state = s->state;
    s->downlink_n = 0u;
    for (;;) {
        const int64_t due = state->up >= 0 ? state->up : fmu_mission.next(s->mission);
        if (due > until) {
            break;
        }
        const int happened = instant(s, due);
        if (happened && stop) {
            *reached = due;
            return 0;
        }
    }
    *reached = until;
    return 0;
}

static int32_t mode(const void *self, uint32_t process)
{
    (void)process;
    const System *s = self;
    return s->commands.n_modes > 0u ? mode_of(s) : -1;
}

static int enter(void *self, uint32_t process, int32_t wanted)
{
    System *s = self;
    (void)process;
    if (!flight_may_enter(s->host, &s->commands, s->mission, (uint16_t)wanted, fmu_mission.modes[wanted])) {
        return -1;
    }
    s->commands.enter(s->mission, (uint16_t)wanted);
    return 0;
}

static uint32_t fired(const void *self, uint32_t event)
{
    return ((const System *)self)->fired[event];
}

static uint32_t entered(const void *self, uint32_t process)
{
    (void)process;
    return ((const System *)self)->state->entered;
}

static size_t state_size(void *self)
{
    return ((System *)self)->size;
}

static int save(void *self, void *bytes)
{
    System *s = self;
    memcpy(bytes, s->mission, s->size);
    return 0;
}

static int restore(void *self, const void *bytes, size_t size)
{
    System *s = self;
    if (size != s->size) {
        report(s, FMU_ERROR, "errors", "the state is that of another FMU");
        return -1;
    }
    memcpy(s->mission, bytes, size);
    return 0;
}

const FmuSystem fmu_system = {fmu_token, create, destroy, layout,     memory, changed, begin,  advance, mode,
                              enter,     fired,  entered, state_size, save,   restore, uplink, downlink};
