/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/services/files.h"

#include "ccsds/cfdp.h"
#include "ccsds/store/memory_store.h"

#include <string.h>

enum { CHOSEN = 10, OWN = 12, TRANSACTION = 14 };                            /* [bytes] places in commands */
enum { VERSION = 4, MODULE = 6, SIZE = 8, CHECK = 12 };                      /* and in a table */
enum { FILES_PAST = 32, FILES_WORK = 1024, FILES_PARTS = 4, DIVIDER = '>' }; /* PARTS: of a file, read in an update */

#define TABLE_MAGIC 0x464C5442u /* FLTB */
#define SECOND INT64_C(1000000000)

static const char unfinished[] = ".cfdp"; /* what names of files begin with that are not whole */
static const char boot[] = "boot";        /* the directory of the tables of the start */

typedef struct FilesProtocol {
    CfdpLive live;
    CfdpTransaction transactions[FILES_TRANSACTIONS];
    CfdpRange ranges[FILES_TRANSACTIONS * FILES_RANGES];
    CfdpPast past[FILES_PAST];
} FilesProtocol;

/* The header has room for them. */
typedef char FilesProtocolFits[sizeof(FilesProtocol) <= 8u * (size_t)FILES_PROTOCOL ? 1 : -1];
typedef char FilesStoreFits[MEMORY_STORE_BYTES(FILES_PAGES) == (size_t)FILES_STORE ? 1 : -1];

/* The entity of the protocol around the module's memory, while something is done. */
typedef struct Entity {
    Cfdp cfdp;
    CfdpRemote ground;
    Files *files;
    int64_t t;
    uint8_t work[FILES_WORK];
} Entity;

static FilesProtocol *protocol_of(Files *m)
{
    return (FilesProtocol *)(void *)m->mem.protocol;
}

static MemoryStore *store_of(Files *m)
{
    return (MemoryStore *)(void *)m->mem.store;
}

/* ---- events of the protocol */

static FilesJob *job_of(Files *m, uint64_t transaction)
{
    for (uint32_t i = 0u; i < FILES_TRANSACTIONS; i++) {
        FilesJob *job = &m->mem.jobs[i];
        if (job->used != 0u && job->ended == 0u && job->transaction == transaction) {
            return job;
        }
    }
    return NULL;
}

static void publish(Files *m, int64_t t, FilesEventId id, EventSeverity severity, const CfdpEvent *of)
{
    event_publish(&m->out.event, t,
                  (FlightEvent){.id = id,
                                .severity = severity,
                                .arguments = {(double)of->id.source, (double)of->id.sequence, (double)of->size,
                                              severity >= EVENT_LOW ? (double)of->condition : 0.0}});
}

static void end(Files *m, int64_t t, const CfdpEvent *event)
{
    const int good = event->what == CFDP_EVENT_ENDED && event->condition == 0u && event->incomplete == 0u;
    FilesJob *job = event->receiver != 0u ? NULL : job_of(m, event->id.sequence);
    if (!good) {
        m->mem.failed++;
        m->mem.condition = event->condition;
        publish(m, t, FILES_FAILED, EVENT_MEDIUM, event);
    } else if (event->to[0] != '\0') { /* else it had messages alone */
        m->mem.received += event->receiver != 0u;
        m->mem.sent += event->receiver == 0u;
        publish(m, t, event->receiver != 0u ? FILES_RECEIVED : FILES_SENT, EVENT_INFO, event);
    }
    if (job != NULL) {
        job->ended = 1u;
        job->good = good ? 1u : 0u;
        job->condition = event->condition;
    }
}

static void notify(void *user, const CfdpEvent *event)
{
    const Entity *e = user;
    switch (event->what) {
    case CFDP_EVENT_ENDED:
    case CFDP_EVENT_ABANDONED: end(e->files, e->t, event); break;
    case CFDP_EVENT_FAULT:
        e->files->mem.condition = event->condition;
        publish(e->files, e->t, FILES_FAULT, EVENT_LOW, event);
        break;
    case CFDP_EVENT_SUSPENDED: publish(e->files, e->t, FILES_SUSPENDED, EVENT_LOW, event); break;
    case CFDP_EVENT_RESUMED: publish(e->files, e->t, FILES_RESUMED, EVENT_INFO, event); break;
    default: break;
    }
}

/* ---- the entity */

static int64_t timer(double seconds, int64_t otherwise)
{
    return seconds <= 0.0 ? otherwise : seconds < 1e9 ? (int64_t)(seconds * 1e9) : INT64_MAX;
}

static uint8_t limit(uint32_t value)
{
    return (uint8_t)(value != 0u ? value : 10u);
}

/* Its own store begins, if the recorder does not give it back first. */
static void begin_store(Files *m)
{
    if (store_of(m)->pages == 0u) {
        memory_store_begin(store_of(m), sizeof m->mem.store);
    }
    if (m->par.kept == 0u && store_of(m)->mounted == 0u) {
        memory_store_mount(store_of(m));
    }
}

/* Put the entity around the module's memory; leave() keeps what it changes. */
static void enter(Entity *e, const CommandContext *context, Files *m)
{
    FilesProtocol *p = protocol_of(m);
    const CfdpStore *host = context->table->services->store;
    const int own = host == NULL || m->par.kept != 0u;
    e->files = m;
    e->t = context->t;
    e->ground = (CfdpRemote){.entity = m->par.ground,
                             .ack_timer = timer(m->par.ack_timer, 10 * SECOND),
                             .nak_timer = timer(m->par.nak_timer, 10 * SECOND),
                             .inactivity = timer(m->par.inactivity, 300 * SECOND),
                             .check_timer = timer(m->par.check_timer, 10 * SECOND),
                             .keep_alive = timer(m->par.keep_alive, 0),
                             .keep_alive_limit = m->par.behind,
                             .segment = (uint16_t)(m->par.segment != 0u ? m->par.segment : (uint32_t)FILES_SEGMENT),
                             .ack_limit = limit(m->par.ack_limit),
                             .nak_limit = limit(m->par.nak_limit),
                             .check_limit = limit(m->par.check_limit),
                             .immediate = (uint8_t)m->par.immediate,
                             .checksum = (uint8_t)m->par.checksum,
                             .crc = (uint8_t)m->par.crc,
                             .allowed = (uint8_t)m->par.allowed,
                             .frozen = (uint8_t)m->par.frozen};
    memcpy(e->ground.handlers, m->par.handlers, sizeof e->ground.handlers);
    const CfdpSetup setup = {.entity = m->par.entity,
                             .store = own ? memory_store_files(store_of(m)) : *host,
                             .notify = notify,
                             .user = e,
                             .remotes = &e->ground,
                             .remotes_n = 1u,
                             .transactions = p->transactions,
                             .transactions_n = FILES_TRANSACTIONS,
                             .ranges = p->ranges,
                             .ranges_n = FILES_RANGES,
                             .past = p->past,
                             .past_n = FILES_PAST,
                             .work = e->work,
                             .work_n = FILES_WORK,
                             .entity_bytes = 2u,
                             .sequence_bytes = 4u};
    begin_store(m);
    if (m->mem.begun == 0u) {
        m->mem.begun = 1u;
        /* By the time, so that no number comes twice after a reset of the computer, which forgets them. */
        cfdp_begin(&e->cfdp, &setup, (uint64_t)(context->t / SECOND) * 16u + 1u);
    } else {
        e->cfdp.set = setup;
        e->cfdp.live = p->live;
    }
}

static void leave(const Entity *e)
{
    protocol_of(e->files)->live = e->cfdp.live;
}

/* After an update, once: the time, then what has come. */
static void run(const CommandContext *context, Files *m)
{
    if (m->mem.updated == 0u) {
        return;
    }
    m->mem.updated = 0u;
    if (m->par.kept != 0u && store_of(m)->mounted == 0u) {
        return; /* what has come waits */
    }
    Entity e;
    enter(&e, context, m);
    for (uint32_t i = 0u; i < FILES_PARTS; i++) {
        cfdp_time(&e.cfdp, m->mem.t);
    }
    for (uint32_t at = 0u, n; at < m->mem.used; at += n) {
        n = ccsds_get16(m->mem.input + at);
        at += 2u;
        cfdp_take(&e.cfdp, m->mem.input + at, n);
    }
    m->mem.used = 0u;
    const double more = m->par.rate * tick_seconds(m->mem.dt);
    m->mem.budget = m->mem.budget < 0.0 ? m->mem.budget + more : more;
    leave(&e);
}

static void arrive(const CommandContext *context, void *module, const uint8_t *bytes, uint32_t n)
{
    Files *m = module;
    if (n + 2u > (uint32_t)FILES_INPUT - m->mem.used) {
        m->mem.lost++;
        event_publish(&m->out.event, context->t,
                      (FlightEvent){.id = FILES_LOST, .severity = EVENT_LOW, .arguments = {m->mem.lost}});
        return;
    }
    ccsds_put16(m->mem.input + m->mem.used, n);
    memcpy(m->mem.input + m->mem.used + 2u, bytes, n);
    m->mem.used += n + 2u;
}

static uint32_t telemetry(const CommandContext *context, void *module, uint8_t *content)
{
    Files *m = module;
    run(context, m);
    if (m->mem.begun == 0u || m->mem.t != context->t || m->mem.budget <= 0.0) {
        return 0u;
    }
    Entity e;
    enter(&e, context, m);
    const uint32_t n = (uint32_t)cfdp_next(&e.cfdp, NULL, content, COMMAND_DATA_MAX);
    leave(&e);
    m->mem.budget -= n;
    return n;
}

/* [%] of its file that a transaction has sent. */
static uint32_t percent_of(Files *m, uint64_t sequence)
{
    for (uint32_t i = 0u; i < FILES_TRANSACTIONS; i++) {
        const CfdpTransaction *t = &protocol_of(m)->transactions[i];
        if (t->state != (uint8_t)CFDP_FREE && t->id.source == m->par.entity && t->id.sequence == sequence &&
            t->size != 0u) {
            return (uint32_t)(100u * t->progress / t->size);
        }
    }
    return 0u;
}

static int report(const CommandContext *context, void *module, CommandReport *done)
{
    Files *m = module;
    run(context, m);
    for (uint32_t i = 0u; i < FILES_TRANSACTIONS; i++) {
        FilesJob *job = &m->mem.jobs[i];
        const uint32_t percent = job->used != 0u && job->ended == 0u ? percent_of(m, job->transaction) / 10u * 10u : 0u;
        if (job->used == 0u || (job->ended == 0u && percent <= job->percent)) {
            continue;
        }
        done->sequence = job->command;
        done->code = COMMAND_FILE_SEND;
        done->origin = job->origin;
        if (job->ended == 0u) {
            done->executed = COMMAND_UNDER_WAY;
            done->detail = (uint16_t)percent;
            job->percent = percent;
        } else {
            done->reason = (uint16_t)(job->good != 0u ? COMMAND_OK : COMMAND_FAILED);
            done->detail = (uint16_t)job->condition;
            job->used = 0u;
        }
        return 1;
    }
    return 0;
}

/* ---- names in commands */

/* The name of a command; to send, also FROM>TO. Returns 0 if one is empty, too long, or that of an unfinished file. */
static int read_names(const uint8_t *packet, uint32_t n, char from[CFDP_NAME], char to[CFDP_NAME])
{
    uint32_t at = FILES_NAME, first = 0u, second = 0u;
    for (; at < n && packet[at] != (uint8_t)DIVIDER; at++) {
        if (packet[at] == 0u || first == (uint32_t)CFDP_NAME - 1u) {
            return 0;
        }
        from[first++] = (char)packet[at];
    }
    from[first] = '\0';
    if (at == n) {
        memcpy(to, from, first + 1u);
        second = first;
    }
    for (at++; at < n; at++) {
        if (packet[at] == 0u || packet[at] == (uint8_t)DIVIDER || second == (uint32_t)CFDP_NAME - 1u) {
            return 0;
        }
        to[second++] = (char)packet[at];
    }
    to[second] = '\0';
    return first > 0u && second > 0u && (packet[6] == (uint8_t)COMMAND_FILE_SEND || n == FILES_NAME + first) &&
           memcmp(from, unfinished, sizeof unfinished - 1u) != 0;
}

static CommandReason check(const uint8_t *packet, uint32_t n)
{
    const uint32_t chosen = ccsds_get16(packet + CHOSEN);
    char from[CFDP_NAME], to[CFDP_NAME];
    switch (packet[6]) {
    case COMMAND_FILE_SEND:
        return (chosen == 1u || chosen == 2u) && read_names(packet, n, from, to) ? COMMAND_OK : COMMAND_VALUE;
    case COMMAND_FILE_CONTROL:
        return chosen <= (uint32_t)FILE_CANCEL && ccsds_get16(packet + OWN) <= 1u ? COMMAND_OK : COMMAND_VALUE;
    case COMMAND_FILE_REMOVE: return chosen == 0u && read_names(packet, n, from, to) ? COMMAND_OK : COMMAND_VALUE;
    default: return read_names(packet, n, from, to) ? COMMAND_OK : COMMAND_VALUE;
    }
}

/* ---- commands */

static CommandReason reason_of(int refusal)
{
    return refusal >= 0              ? COMMAND_OK
           : refusal == CFDP_ABSENT  ? COMMAND_PLACE
           : refusal == CFDP_FULL    ? COMMAND_FULL
           : refusal == CFDP_REFUSED ? COMMAND_VALUE
                                     : COMMAND_FAILED;
}

static CommandReason send(Entity *e, const CommandContext *context, int class1, const char *from, const char *to,
                          CommandReport *report)
{
    Files *m = e->files;
    const CfdpPut put = {.destination = m->par.ground,
                         .from = from,
                         .to = to,
                         .class1 = (uint8_t)class1,
                         .priority = (uint8_t)m->par.priority};
    FilesJob *job = m->mem.jobs;
    while (job < m->mem.jobs + FILES_TRANSACTIONS && job->used != 0u) {
        job++;
    }
    CfdpId id = {0, 0};
    const int result = job == m->mem.jobs + FILES_TRANSACTIONS ? CFDP_FULL : cfdp_put(&e->cfdp, &put, &id);
    if (result >= 0) {
        *job = (FilesJob){
            .transaction = id.sequence, .command = context->sequence, .origin = context->state->from, .used = 1u};
        report->executed = COMMAND_STARTED;
        report->detail = (uint16_t)id.sequence;
    }
    return reason_of(result);
}

static CommandReason control(Entity *e, const uint8_t *packet)
{
    const Files *m = e->files;
    const CfdpId id = {ccsds_get16(packet + OWN) != 0u ? m->par.entity : m->par.ground,
                       ccsds_get32(packet + TRANSACTION)};
    const uint32_t action = ccsds_get16(packet + CHOSEN);
    const int done = action == (uint32_t)FILE_SUSPEND  ? cfdp_suspend(&e->cfdp, id)
                     : action == (uint32_t)FILE_RESUME ? cfdp_resume(&e->cfdp, id)
                                                       : cfdp_cancel(&e->cfdp, id);
    return done ? COMMAND_OK : COMMAND_PLACE;
}

static CommandReason read_table(const CfdpStore *store, int file, const CommandTable *table, uint16_t module)
{
    uint8_t head[FILES_TABLE_HEADER];
    const uint32_t size = table->blocks[module].size;
    if (store->size(store->user, file) != (int64_t)size + FILES_TABLE_HEADER) {
        return COMMAND_LENGTH;
    }
    if (store->read(store->user, file, 0u, head, sizeof head) < 0 ||
        store->read(store->user, file, sizeof head, table->staged, size) < 0) {
        return COMMAND_FAILED;
    }
    return ccsds_get32(head) != TABLE_MAGIC                                ? COMMAND_VALUE
           : ccsds_get16(head + VERSION) != table->version                 ? COMMAND_VERSION
           : ccsds_get16(head + MODULE) != module                          ? COMMAND_PLACE
           : ccsds_get32(head + SIZE) != size                              ? COMMAND_LENGTH
           : ccsds_get16(head + CHECK) != command_crc(table->staged, size) ? COMMAND_CRC
                                                                           : COMMAND_OK;
}

/* The module of a table; COMMAND_ALL: it is none. */
static uint16_t module_of(const CfdpStore *store, int file)
{
    uint8_t head[FILES_TABLE_HEADER];
    return store->read(store->user, file, 0u, head, sizeof head) < 0 || ccsds_get32(head) != TABLE_MAGIC
               ? (uint16_t)COMMAND_ALL
               : ccsds_get16(head + MODULE);
}

/* *of: the module, or COMMAND_ALL: the one that the file names. */
static CommandReason load(const Entity *e, const CommandContext *context, uint16_t *of, const char *name,
                          uint16_t *detail)
{
    const CfdpStore *store = &e->cfdp.set.store;
    const int file = store->open(store->user, name, CFDP_OPEN_READ);
    if (file < 0) {
        return reason_of(file);
    }
    const uint16_t module = *of = *of != (uint16_t)COMMAND_ALL ? *of : module_of(store, file);
    CommandReason reason = module == (uint16_t)COMMAND_ALL      ? COMMAND_VALUE
                           : module >= context->table->n_blocks ? COMMAND_PLACE
                                                                : read_table(store, file, context->table, module);
    store->close(store->user, file);
    context->state->staging = 0u; /* its memory is used here */
    if (reason == COMMAND_OK) {
        reason = command_activate(context, module, detail);
    }
    if (reason == COMMAND_OK) {
        e->files->mem.tables++;
        event_publish(&e->files->out.event, context->t,
                      (FlightEvent){.id = FILES_LOADED,
                                    .severity = EVENT_INFO,
                                    .arguments = {module, context->table->blocks[module].size}});
    }
    return reason;
}

static int write_table(const CfdpStore *store, int file, const CommandContext *context, uint16_t module)
{
    const uint32_t size = context->table->blocks[module].size;
    uint8_t part[COMMAND_DATA_MAX] = {0};
    ccsds_put32(part, TABLE_MAGIC);
    ccsds_put16(part + VERSION, context->table->version);
    ccsds_put16(part + MODULE, module);
    ccsds_put32(part + SIZE, size);
    ccsds_put16(part + CHECK, command_block_crc(context, module));
    int result = store->write(store->user, file, 0u, part, FILES_TABLE_HEADER);
    for (uint32_t at = 0u; at < size && result >= 0; at += (uint32_t)COMMAND_DATA_MAX) {
        const uint32_t n = size - at < (uint32_t)COMMAND_DATA_MAX ? size - at : (uint32_t)COMMAND_DATA_MAX;
        command_block(context, module, at, n, part);
        result = store->write(store->user, file, (uint32_t)FILES_TABLE_HEADER + at, part, n);
    }
    return result;
}

static CommandReason dump(const Entity *e, const CommandContext *context, uint16_t module, const char *name)
{
    static const char table[] = ".cfdp-table"; /* a name that the ground cannot use, until it is whole */
    const CfdpStore *store = &e->cfdp.set.store;
    const int file = store->open(store->user, table, CFDP_OPEN_NEW);
    if (file < 0) {
        return reason_of(file);
    }
    int result = write_table(store, file, context, module);
    store->close(store->user, file);
    result = result < 0 ? result : store->rename(store->user, table, name);
    if (result < 0) {
        (void)store->remove(store->user, table);
    }
    return reason_of(result);
}

static CommandReason execute(const CommandContext *context, void *module, const uint8_t *packet, CommandReport *report,
                             uint8_t *data)
{
    uint16_t chosen = ccsds_get16(packet + CHOSEN);
    const uint32_t code = packet[6];
    char from[CFDP_NAME], to[CFDP_NAME];
    CommandReason reason = COMMAND_OK;
    Entity e;
    (void)data;
    if (code != (uint32_t)COMMAND_FILE_CONTROL) {
        (void)read_names(packet, (uint32_t)ccsds_get16(packet + 4) + 7u, from, to);
    }
    if ((code == (uint32_t)COMMAND_TABLE_LOAD || code == (uint32_t)COMMAND_TABLE_DUMP) &&
        chosen >= context->table->n_blocks) {
        return COMMAND_PLACE;
    }
    enter(&e, context, module);
    switch (code) {
    case COMMAND_FILE_SEND: reason = send(&e, context, chosen == 1u, from, to, report); break;
    case COMMAND_FILE_CONTROL: reason = control(&e, packet); break;
    case COMMAND_FILE_REMOVE: reason = reason_of(e.cfdp.set.store.remove(e.cfdp.set.store.user, from)); break;
    case COMMAND_TABLE_LOAD: reason = load(&e, context, &chosen, from, &report->detail); break;
    default: reason = dump(&e, context, chosen, from); break;
    }
    leave(&e);
    return reason;
}

/* ---- tables of the start */

/* The first name behind another one. */
typedef struct Following {
    const char *last;
    char name[FILES_BOOT_NAME];
} Following;

static int follow(void *to, const char *name)
{
    Following *f = to;
    size_t n = 0u;
    while (name[n] != '\0' && n < (size_t)CFDP_NAME) {
        n++;
    }
    if (n == 0u || n + sizeof boot >= (size_t)CFDP_NAME || name[n - 1u] == '/') {
        return 0;
    }
    char given[FILES_BOOT_NAME] = "";
    memcpy(given, name, n);
    if (memcmp(given, f->last, sizeof given) > 0 && (f->name[0] == '\0' || memcmp(given, f->name, sizeof given) < 0)) {
        memcpy(f->name, given, sizeof given);
    }
    return 0;
}

static int boots(const Files *m)
{
    const MemoryStore *store = (const MemoryStore *)(const void *)m->mem.store;
    return m->par.boot != 0u && m->mem.booted == 0u && (m->par.kept == 0u || store->mounted != 0u);
}

/* The next table of the start counts, or is refused. It is no command of its own. */
static uint32_t take(const CommandContext *context, void *module, uint8_t *packet, CommandReport *report)
{
    Files *m = module;
    (void)packet;
    (void)report;
    if (!boots(m)) {
        return 0u;
    }
    Entity e;
    enter(&e, context, m);
    const CfdpStore *store = &e.cfdp.set.store;
    Following next = {m->mem.last, ""};
    if (store->list(store->user, boot, follow, &next) < 0) {
        (void)store->make_directory(store->user, boot); /* for the ground's tables */
    }
    m->mem.booted = next.name[0] == '\0';
    if (m->mem.booted == 0u) {
        char name[sizeof boot + FILES_BOOT_NAME] = "boot/";
        memcpy(name + sizeof boot, next.name, sizeof next.name);
        memcpy(m->mem.last, next.name, sizeof next.name);
        uint16_t of = COMMAND_ALL, detail = 0u;
        const CommandReason reason = load(&e, context, &of, name, &detail);
        if (reason != COMMAND_OK) {
            event_publish(&m->out.event, context->t,
                          (FlightEvent){.id = FILES_REFUSED,
                                        .severity = EVENT_MEDIUM,
                                        .arguments = {m->mem.tried, reason, of, detail}});
        }
        m->mem.tried++;
    }
    leave(&e);
    return 0u;
}

static int64_t next(const void *module)
{
    const Files *m = module;
    return m->par.boot != 0u && m->mem.booted == 0u ? 0 : INT64_MAX; /* at each instant, for the store may be back */
}

const CommandService files_service = {.first = COMMAND_FILE_SEND,
                                      .n = 5u,
                                      .check = check,
                                      .execute = execute,
                                      .take = take,
                                      .next = next,
                                      .arrive = arrive,
                                      .telemetry = telemetry,
                                      .report = report,
                                      .stream = STREAM_FILES};

/* ---- the module */

static void mirror(Files *m, Tick t)
{
    begin_store(m);
    MemoryStore *store = store_of(m);
    const uint32_t before = store->mounted;
    mirror_update(&m->mem.mirror, store, &m->in.recorded, &m->out.request, t);
    if (store->mounted == before) {
        return;
    }
    const CfdpStore files = memory_store_files(store);
    char name[] = ".cfdp0"; /* what was being received before the reset */
    for (uint32_t i = 0u; i < FILES_TRANSACTIONS; i++) {
        name[sizeof name - 2u] = (char)('0' + i);
        files.remove(files.user, name);
    }
}

void files_reset(Files *m)
{
    memset(&m->out, 0, sizeof m->out); /* the memory stays, so that transactions go on */
}

void files_update(Files *m, Tick t)
{
    FilesState *s = &m->out.state;
    const FilesProtocol *p = protocol_of(m);
    m->mem.t = t.t;
    m->mem.dt = t.dt;
    m->mem.updated = 1u;
    if (m->par.kept != 0u) {
        mirror(m, t);
    }
    s->receiving = s->sending = s->refused = 0u;
    for (uint32_t i = 0u; i < FILES_TRANSACTIONS; i++) {
        s->receiving += p->transactions[i].state >= (uint8_t)CFDP_RECEIVING;
        s->sending +=
            p->transactions[i].state != (uint8_t)CFDP_FREE && p->transactions[i].state < (uint8_t)CFDP_RECEIVING;
    }
    for (uint32_t i = 0u; i < (uint32_t)CCSDS_FAULTS; i++) {
        s->refused += p->live.faults[i];
    }
    s->sent = p->live.sent;
    s->taken = p->live.taken;
    s->lost = m->mem.lost;
    s->received = m->mem.received;
    s->delivered = m->mem.sent;
    s->failed = m->mem.failed;
    s->condition = m->mem.condition;
    s->waiting = m->mem.mirror.left;
    s->dropped = store_of(m)->lost;
    s->booted = m->mem.booted;
    s->tables = m->mem.tables;
    s->free = store_of(m)->free * (uint32_t)MEMORY_DATA;
    s->used = store_of(m)->pages * (uint32_t)MEMORY_DATA - s->free;
    s->head = head_next(s->head, t.t, QUALITY_GOOD);
}
