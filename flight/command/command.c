/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/command/command.h"

#include "ccsds/bytes.h"

#include <string.h>

enum { VERSION = 8, FIRST = 10, SECOND = 12, THIRD = 14, COUNT = 16, TURNS = 18 }; /* [bytes] places in a packet */

#define SEQUENCES 0x3FFFu /* the largest */

static uint16_t word(const uint8_t *packet, uint32_t at)
{
    return ccsds_get16(packet + at);
}

static uint32_t long_word(const uint8_t *packet, uint32_t at)
{
    return ccsds_get32(packet + at);
}

static uint32_t offset_of(const uint8_t *packet)
{
    return long_word(packet, SECOND);
}

static uint32_t length_of(const uint8_t *packet)
{
    return (uint32_t)word(packet, 4) + 7u;
}

uint16_t command_crc(const uint8_t *bytes, uint32_t n)
{
    return ccsds_crc16(bytes, n);
}

/* Between the order of this machine and big-endian, in place. */
static void swap(const CommandBlock *block, uint8_t *bytes, uint32_t from, uint32_t to)
{
    exec_big_endian(block->runs, block->n_runs, bytes, from, to);
}

/* ---- acceptance */

static int has_length(uint32_t code, uint32_t n)
{
    static const uint8_t lengths[COMMAND_CODES] = {8u, 8u, 12u, 0u,  0u,  14u, 12u, 10u, 14u, 18u, 16u, 0u,  22u, 12u,
                                                   0u, 0u, 14u, 16u, 12u, 0u,  0u,  18u, 0u,  0u,  0u,  12u, 10u, 16u};
    const uint32_t least = code == (uint32_t)COMMAND_PDU         ? (uint32_t)COMMAND_HEADER
                           : code >= (uint32_t)COMMAND_FILE_SEND ? (uint32_t)SECOND
                                                                 : (uint32_t)COMMAND_DATA;
    return lengths[code] != 0u ? n == lengths[code] : n > least && n <= (uint32_t)COMMAND_MAX;
}

/* Whether n > 0 bytes of a block from its byte `at` are whole numbers. */
static int has_numbers(const CommandBlock *block, uint32_t at, uint32_t n)
{
    return at < block->size && n <= block->size - at && exec_number_at(block->runs, block->n_runs, at) != 0u &&
           (at + n == block->size || exec_number_at(block->runs, block->n_runs, at + n) != 0u);
}

static CommandReason check_block(const CommandTable *table, uint32_t code, const uint8_t *packet, uint32_t n)
{
    const uint16_t module = word(packet, FIRST);
    if (module >= table->n_blocks) {
        return COMMAND_PLACE;
    }
    const CommandBlock *block = &table->blocks[module];
    switch (code) {
    case COMMAND_CHECK: return COMMAND_OK;
    case COMMAND_PUBLISH: return block->configuration != 0u ? COMMAND_OK : COMMAND_VALUE;
    case COMMAND_COMMIT: return COMMAND_OK;
    case COMMAND_READ: n = word(packet, COUNT); break;
    default: n -= (uint32_t)COMMAND_DATA; break;
    }
    return n > 0u && n <= (uint32_t)COMMAND_DATA_MAX && has_numbers(block, offset_of(packet), n) ? COMMAND_OK
                                                                                                 : COMMAND_PLACE;
}

static CommandReason check_procedure(const CommandProcedures *procedures, uint32_t code, const uint8_t *packet,
                                     uint32_t n)
{
    if (procedures == NULL || (code == (uint32_t)COMMAND_EVALUATE && procedures->evaluates == 0u)) {
        return COMMAND_ABSENT;
    }
    if (code == (uint32_t)COMMAND_EVALUATE) {
        return word(packet, FIRST) != 0u || long_word(packet, SECOND) == 0u ? COMMAND_VALUE : COMMAND_OK;
    }
    if (word(packet, FIRST) >= procedures->n) {
        return COMMAND_PLACE;
    }
    const uint32_t first = code == (uint32_t)COMMAND_STOP_PROCEDURE ? 0u : long_word(packet, SECOND);
    switch (code) {
    case COMMAND_STAGE_PROCEDURE:
        return first <= procedures->room && n - (uint32_t)COMMAND_DATA <= procedures->room - first ? COMMAND_OK
                                                                                                   : COMMAND_PLACE;
    case COMMAND_START_PROCEDURE:
        return first > procedures->room                        ? COMMAND_PLACE
               : first == 0u || long_word(packet, TURNS) == 0u ? COMMAND_VALUE
                                                               : COMMAND_OK;
    default: return COMMAND_OK;
    }
}

/* What does not depend on the commands before it. stream: on which it should have come. */
static CommandReason check(const CommandTable *table, uint32_t stream, const uint8_t *packet, uint32_t n)
{
    uint8_t sum = 0u;
    if (n < (uint32_t)COMMAND_HEADER || n != length_of(packet)) {
        return COMMAND_LENGTH;
    }
    for (uint32_t i = 0u; i < n; i++) {
        sum ^= packet[i];
    }
    const uint32_t code = packet[6];
    if (sum != 0xFFu) {
        return COMMAND_CHECKSUM;
    }
    if (word(packet, 0) != stream || (word(packet, 2) & 0xC000u) != 0xC000u) {
        return COMMAND_STREAM;
    }
    if (code >= (uint32_t)COMMAND_CODES) {
        return COMMAND_UNKNOWN;
    }
    if (!has_length(code, n)) {
        return COMMAND_LENGTH;
    }
    if (code > (uint32_t)COMMAND_RESET_COUNTERS && code != (uint32_t)COMMAND_PDU &&
        word(packet, VERSION) != table->version) {
        return COMMAND_VERSION;
    }
    switch (code) {
    case COMMAND_MODE: return word(packet, FIRST) < table->n_modes ? COMMAND_OK : COMMAND_PLACE;
    case COMMAND_ARM:
        return word(packet, FIRST) >= table->n_events ? COMMAND_PLACE
               : word(packet, SECOND) > 1u            ? COMMAND_VALUE
                                                      : COMMAND_OK;
    case COMMAND_TELEMETRY:
        return word(packet, FIRST) > table->n_outputs && word(packet, FIRST) != COMMAND_ALL ? COMMAND_PLACE
               : word(packet, SECOND) > 1u || word(packet, THIRD) == 0u                     ? COMMAND_VALUE
                                                                                            : COMMAND_OK;
    case COMMAND_WRITE:
    case COMMAND_STAGE:
    case COMMAND_COMMIT:
    case COMMAND_PUBLISH:
    case COMMAND_READ:
    case COMMAND_CHECK: return check_block(table, code, packet, n);
    case COMMAND_STAGE_PROCEDURE:
    case COMMAND_START_PROCEDURE:
    case COMMAND_STOP_PROCEDURE:
    case COMMAND_EVALUATE: return check_procedure(table->procedures, code, packet, n);
    case COMMAND_STORE:
    case COMMAND_DELETE:
    case COMMAND_CONTROL:
    case COMMAND_LIST:
    case COMMAND_PDU:
    case COMMAND_FILE_SEND:
    case COMMAND_FILE_CONTROL:
    case COMMAND_FILE_REMOVE:
    case COMMAND_TABLE_LOAD:
    case COMMAND_TABLE_DUMP:
    case COMMAND_EVENTS:
    case COMMAND_UNIT: return table->services == NULL ? COMMAND_ABSENT : table->services->check(table, packet, n);
    default: return COMMAND_OK;
    }
}

static void count(CommandState *s, CommandReason reason, CommandStage stage)
{
    if (reason != COMMAND_OK) {
        s->counters.refused++;
        s->counters.reasons[reason]++;
    } else if (stage == COMMAND_DONE) {
        s->counters.executed++;
    } else if (stage == COMMAND_ACCEPTED) {
        s->counters.accepted++;
    }
}

void command_report(CommandState *s, const CommandReport *report, const uint8_t *data, CommandSink sink, void *user)
{
    count(s, (CommandReason)report->reason, (CommandStage)report->executed);
    s->recent[s->reported++ % (uint32_t)COMMAND_RECENT] = *report;
    sink(user, report, data);
}

void command_begin(CommandState *s)
{
    memset(s, 0, sizeof *s);
    s->t = -1;
}

/* Whether a link has not brought a command of this sequence yet, nor one behind it. */
static int is_ahead(const CommandLink *link, uint16_t sequence)
{
    const uint32_t by = ((uint32_t)sequence - link->last) & SEQUENCES;
    return link->begun == 0u || (by > 0u && by <= SEQUENCES / 2u);
}

/* Whether the present sender may neither give this command nor store it. Its length and code are right. */
static int is_barred(const CommandState *s, const uint8_t *packet)
{
    const uint8_t stored = packet[6] == (uint8_t)COMMAND_STORE ? packet[COMMAND_STORED + 6] : packet[6];
    return ((s->barred >> packet[6] | s->barred >> (stored & 63u)) & 1u) != 0u;
}

static CommandReason accept(CommandState *s, const CommandTable *table, uint32_t stream, CommandLink *link,
                            const uint8_t *packet, uint32_t n, CommandSink sink, void *user)
{
    CommandReport report = {s->t, 0u, 0u, 0u, (uint16_t)check(table, stream, packet, n), 0u, 0u, s->from, 0u};
    if (n >= (uint32_t)COMMAND_HEADER) {
        report.sequence = word(packet, 2) & SEQUENCES;
        report.code = packet[6];
    }
    const int pdu = report.code == (uint16_t)COMMAND_PDU;
    if (pdu) { /* CFDP repeats and orders what it needs itself */
        link = NULL;
    }
    if (report.reason == COMMAND_OK && link != NULL && !is_ahead(link, report.sequence)) {
        report.reason = COMMAND_SEQUENCE;
        report.detail = link->last;
    }
    if (report.reason == COMMAND_OK && s->barred != 0u && is_barred(s, packet)) {
        report.reason = COMMAND_ROLE;
    }
    if (report.reason == COMMAND_OK && n > table->room - s->waiting) {
        report.reason = COMMAND_BUSY;
    }
    if (report.reason == COMMAND_OK) {
        memcpy(table->queue + s->waiting, packet, n);
        s->waiting += n;
        if (link != NULL) {
            link->begun = 1u;
            link->last = report.sequence;
        }
    }
    if (!pdu || report.reason != COMMAND_OK) {
        command_report(s, &report, packet, sink, user);
    }
    return (CommandReason)report.reason;
}

CommandReason command_accept(CommandState *s, const CommandTable *table, CommandLink *link, const uint8_t *packet,
                             uint32_t n, CommandSink sink, void *user)
{
    return accept(s, table, table->stream, link, packet, n, sink, user);
}

CommandReason command_receive(const CommandContext *context, const uint8_t *unit, uint32_t n, CommandSink sink,
                              void *user)
{
    const CommandServices *services = context->table->services;
    return services != NULL && services->unwrap != NULL
               ? services->unwrap(context, unit, n, sink, user)
               : command_accept(context->state, context->table, &context->state->ground, unit, n, sink, user);
}

/* ---- execution */

/* The rule of an initial value that two versions of a block's bytes from `from` to `to` differ in; else n_rules. */
static uint16_t changed_start(const CommandBlock *block, const uint8_t *before, const uint8_t *after, uint32_t from,
                              uint32_t to)
{
    uint16_t i = 0u;
    for (; i < block->n_rules; i++) {
        const CommandRule *rule = &block->rules[i];
        const uint32_t end = rule->offset + rule->n * element_size(rule->number);
        for (uint32_t at = rule->offset; (rule->flags & COMMAND_START) != 0u && at < end; at++) {
            if (at >= from && at < to && before[at - from] != after[at - from]) {
                return i;
            }
        }
    }
    return i;
}

/* Whether a block may become `after`, of which the bytes from `from` on were `before`. */
static CommandReason check_change(const CommandState *s, const CommandBlock *block, const uint8_t *before,
                                  const uint8_t *after, uint32_t from, uint32_t n, uint16_t *detail)
{
    uint32_t element;
    const uint16_t start = changed_start(block, before, after + from, from, from + n);
    if (s->t >= 0 && start < block->n_rules) {
        *detail = start;
        return COMMAND_INITIAL;
    }
    const CommandRule *broken = command_check(block->rules, block->n_rules, after, &element);
    if (broken != NULL) {
        *detail = (uint16_t)(broken - block->rules);
        return COMMAND_RULE;
    }
    return COMMAND_OK;
}

/* big_endian: 1: so are the bytes; 0: they are as in memory. */
static CommandReason write_parameters(const CommandState *s, const CommandBlock *block, uint8_t *memory, uint32_t at,
                                      const uint8_t *bytes, uint32_t n, int big_endian, uint16_t *detail)
{
    uint8_t before[COMMAND_DATA_MAX];
    memcpy(before, memory + at, n);
    memcpy(memory + at, bytes, n);
    if (big_endian) {
        swap(block, memory + at, at, at + n);
    }
    const CommandReason reason = check_change(s, block, before, memory, at, n, detail);
    if (reason != COMMAND_OK) {
        memcpy(memory + at, before, n);
    }
    return reason;
}

/* The parameters of a module have changed. */
static void publish(const CommandContext *context, uint16_t module)
{
    if (context->table->blocks[module].configuration != 0u) {
        context->table->publish(context->mission, module, context->t);
    }
}

CommandReason command_write(const CommandContext *context, uint16_t module, uint32_t at, const uint8_t *bytes,
                            uint32_t n, uint16_t *detail)
{
    const CommandTable *table = context->table;
    CommandReason reason = COMMAND_PLACE;
    if (module < table->n_blocks && n > 0u && n <= (uint32_t)COMMAND_DATA_MAX &&
        has_numbers(&table->blocks[module], at, n)) {
        const CommandBlock *block = &table->blocks[module];
        uint8_t *memory = table->parameters(context->mission, module);
        reason = write_parameters(context->state, block, memory, at, bytes, n, 0, detail);
        if (reason == COMMAND_OK) {
            publish(context, module);
        }
    }
    count(context->state, reason, COMMAND_DONE);
    return reason;
}

static CommandReason enter(const CommandContext *context, uint16_t mode)
{
    if (!command_may_enter(context, mode)) {
        return COMMAND_GUARDED;
    }
    context->table->enter(context->mission, mode);
    return COMMAND_OK;
}

CommandReason command_enter(const CommandContext *context, uint16_t mode)
{
    const CommandReason reason = mode < context->table->n_modes ? enter(context, mode) : COMMAND_PLACE;
    count(context->state, reason, COMMAND_DONE);
    return reason;
}

static void stage(CommandState *s, const CommandTable *table, const uint8_t *packet)
{
    const uint16_t module = word(packet, FIRST);
    if (s->staging != module + 1u) {
        memset(table->staged, 0, table->blocks[module].size);
        s->staging = (uint16_t)(module + 1u);
    }
    memcpy(table->staged + offset_of(packet), packet + COMMAND_DATA, length_of(packet) - (uint32_t)COMMAND_DATA);
}

CommandReason command_activate(const CommandContext *context, uint16_t module, uint16_t *detail)
{
    const CommandTable *table = context->table;
    const CommandBlock *block = &table->blocks[module];
    uint8_t *memory = table->parameters(context->mission, module);
    swap(block, table->staged, 0u, block->size);
    const CommandReason reason = check_change(context->state, block, memory, table->staged, 0u, block->size, detail);
    if (reason != COMMAND_OK) {
        swap(block, table->staged, 0u, block->size);
        return reason;
    }
    memcpy(memory, table->staged, block->size);
    context->state->staging = 0u;
    publish(context, module);
    return COMMAND_OK;
}

static CommandReason commit(const CommandContext *context, const uint8_t *packet, uint16_t *detail)
{
    const uint16_t module = word(packet, FIRST);
    const CommandTable *table = context->table;
    return context->state->staging != module + 1u ? COMMAND_NOT_STAGED
           : command_crc(table->staged, table->blocks[module].size) != word(packet, SECOND)
               ? COMMAND_CRC
               : command_activate(context, module, detail);
}

void command_block(const CommandContext *context, uint16_t module, uint32_t at, uint32_t n, uint8_t *bytes)
{
    memcpy(bytes, (const uint8_t *)context->table->parameters(context->mission, module) + at, n);
    swap(&context->table->blocks[module], bytes, at, at + n);
}

uint16_t command_block_crc(const CommandContext *context, uint16_t module)
{
    const uint32_t size = context->table->blocks[module].size, most = COMMAND_DATA_MAX;
    uint8_t part[COMMAND_DATA_MAX];
    uint16_t crc = 0xFFFFu;
    for (uint32_t at = 0u; at < size; at += most) { /* no number lies across the end of a part */
        const uint32_t n = size - at < most ? size - at : most;
        command_block(context, module, at, n, part);
        crc = ccsds_crc16_more(crc, part, n);
    }
    return crc;
}

static CommandReason start(const CommandContext *context, const uint8_t *packet)
{
    const CommandProcedures *procedures = context->table->procedures;
    const uint16_t slot = word(packet, FIRST);
    const uint32_t n = long_word(packet, SECOND);
    return command_crc(procedures->slots + slot * procedures->room, n) != word(packet, COUNT)
               ? COMMAND_CRC
               : procedures->start(context, slot, n, long_word(packet, TURNS));
}

static CommandReason execute(CommandState *s, const CommandTable *table, void *mission, const uint8_t *packet,
                             CommandReport *report, uint8_t *data)
{
    const uint16_t place = length_of(packet) >= (uint32_t)SECOND ? word(packet, FIRST) : 0u;
    const CommandContext context = {s, table, mission, report->t, report->sequence};
    CommandReason reason = COMMAND_OK;
    switch (report->code) {
    case COMMAND_MODE: reason = enter(&context, place); break;
    case COMMAND_WRITE:
        reason =
            write_parameters(s, &table->blocks[place], table->parameters(mission, place), offset_of(packet),
                             packet + COMMAND_DATA, length_of(packet) - (uint32_t)COMMAND_DATA, 1, &report->detail);
        if (reason == COMMAND_OK) {
            publish(&context, place);
        }
        break;
    case COMMAND_COMMIT: reason = commit(&context, packet, &report->detail); break;
    case COMMAND_STAGE: stage(s, table, packet); break;
    case COMMAND_PUBLISH: table->publish(mission, place, report->t); break;
    case COMMAND_RESET_FLIGHT:
        table->reset(mission, report->t);
        s->staging = 0u;
        break;
    case COMMAND_ARM: table->arm(mission, place, word(packet, SECOND) != 0u); break;
    case COMMAND_READ:
        report->n = word(packet, COUNT);
        command_block(&context, place, offset_of(packet), report->n, data);
        break;
    case COMMAND_CHECK:
        report->n = 6u;
        ccsds_put32(data, table->blocks[place].size);
        ccsds_put16(data + 4, command_block_crc(&context, place));
        break;
    case COMMAND_TELEMETRY: table->telemetry(mission, place, word(packet, SECOND) != 0u, word(packet, THIRD)); break;
    case COMMAND_STAGE_PROCEDURE:
        memcpy(table->procedures->slots + place * table->procedures->room + offset_of(packet), packet + COMMAND_DATA,
               length_of(packet) - (uint32_t)COMMAND_DATA);
        break;
    case COMMAND_START_PROCEDURE: reason = start(&context, packet); break;
    case COMMAND_STOP_PROCEDURE: reason = table->procedures->stop(&context, place); break;
    case COMMAND_EVALUATE:
        reason = table->procedures->evaluate(&context, packet + COMMAND_DATA,
                                             length_of(packet) - (uint32_t)COMMAND_DATA, offset_of(packet));
        break;
    case COMMAND_STORE:
    case COMMAND_DELETE:
    case COMMAND_CONTROL:
    case COMMAND_LIST:
    case COMMAND_FILE_SEND:
    case COMMAND_FILE_CONTROL:
    case COMMAND_FILE_REMOVE:
    case COMMAND_TABLE_LOAD:
    case COMMAND_TABLE_DUMP:
    case COMMAND_EVENTS:
    case COMMAND_UNIT: reason = table->services->execute(&context, packet, report, data); break;
    default: break;
    }
    return reason;
}

/* Execute what waits. */
static void execute_queue(CommandState *s, const CommandTable *table, void *mission, int64_t t, CommandSink sink,
                          void *user)
{
    uint8_t data[COMMAND_DATA_MAX];
    for (uint32_t at = 0u; at < s->waiting; at += length_of(table->queue + at)) {
        const uint8_t *packet = table->queue + at;
        if (packet[6] == (uint8_t)COMMAND_PDU) {
            const CommandContext context = {s, table, mission, t, 0u};
            (void)table->services->execute(&context, packet, NULL, NULL);
            continue;
        }
        CommandReport report = {t, word(packet, 2) & SEQUENCES, packet[6], 1u, COMMAND_OK, 0u, 0u, s->from, 0u};
        report.reason = (uint16_t)execute(s, table, mission, packet, &report, data);
        command_report(s, &report, data, sink, user);
        if (report.code == COMMAND_RESET_COUNTERS) {
            memset(&s->counters, 0, sizeof s->counters);
        }
    }
    s->waiting = 0u;
}

void command_execute(CommandState *s, const CommandTable *table, void *mission, int64_t t, CommandSink sink, void *user)
{
    execute_queue(s, table, mission, t, sink, user);
    s->t = t;
    if (table->services != NULL) {
        const CommandContext context = {s, table, mission, t, 0u};
        table->services->run(&context, sink, user);
    }
}

/* ---- services */

/* The place of the service of a function code; n: there is none. */
static uint32_t service_of(const CommandServices *services, uint32_t code)
{
    for (uint32_t i = 0u; i < services->n; i++) {
        const CommandService *service = services->list[i];
        if (code == (uint32_t)COMMAND_PDU ? service->arrive != NULL
                                          : code >= service->first && code - service->first < service->n) {
            return i;
        }
    }
    return services->n;
}

CommandReason command_service_check(const CommandTable *table, const uint8_t *packet, uint32_t n)
{
    const uint32_t place = service_of(table->services, packet[6]);
    return place == table->services->n         ? COMMAND_ABSENT
           : packet[6] == (uint8_t)COMMAND_PDU ? COMMAND_OK
                                               : table->services->list[place]->check(packet, n);
}

CommandReason command_service_execute(const CommandContext *context, const uint8_t *packet, CommandReport *report,
                                      uint8_t *data)
{
    const CommandServices *services = context->table->services;
    const uint32_t place = service_of(services, packet[6]);
    void *module = services->module(context->mission, place);
    if (packet[6] == (uint8_t)COMMAND_PDU) {
        services->list[place]->arrive(context, module, packet + COMMAND_HEADER,
                                      length_of(packet) - (uint32_t)COMMAND_HEADER);
        return COMMAND_OK;
    }
    if (packet[6] == (uint8_t)COMMAND_STORE) {
        const CommandReason reason = check(context->table, word(packet, 0), packet + COMMAND_STORED,
                                           length_of(packet) - (uint32_t)COMMAND_STORED);
        if (reason != COMMAND_OK) {
            return reason;
        }
    }
    return services->list[place]->execute(context, module, packet, report, data);
}

/* Execute what a service has; `left`: how many commands this instant may still have. Returns what is left then. */
static uint32_t run_service(const CommandContext *context, uint32_t place, uint32_t left, CommandSink sink, void *user)
{
    const CommandTable *table = context->table;
    CommandState *s = context->state;
    void *module = table->services->module(context->mission, place);
    uint8_t packet[COMMAND_STORED_MAX];
    for (; left > 0u && table->services->list[place]->take != NULL; left--) {
        CommandReport report = {context->t, 0u, 0u, 1u, COMMAND_OK, 0u, 0u, 0u, 0u};
        const uint32_t n = table->services->list[place]->take(context, module, packet, &report);
        if (n == 0u) {
            break;
        }
        s->from = report.origin;
        if (report.reason == COMMAND_OK) {
            (void)accept(s, table, word(packet, 0), NULL, packet, n, sink, user); /* a link has checked its stream */
            execute_queue(s, table, context->mission, context->t, sink, user);
        } else {
            report.sequence = word(packet, 2) & SEQUENCES;
            report.code = packet[6];
            command_report(s, &report, packet, sink, user);
        }
        s->from = 0u;
    }
    return left;
}

void command_service_run(const CommandContext *context, CommandSink sink, void *user)
{
    uint32_t left = (uint32_t)COMMAND_AT_ONCE;
    for (uint32_t i = 0u; i < context->table->services->n; i++) {
        left = run_service(context, i, left, sink, user);
    }
}

/* ---- frames */

/* The place of the service that speaks frames; the table names these functions only if there is one. */
static uint32_t speaker(const CommandServices *services)
{
    uint32_t i = 0u;
    while (services->list[i]->wrap == NULL) {
        i++;
    }
    return i;
}

/* The receiver of the packets of a unit. */
typedef struct Unit {
    const CommandContext *context;
    CommandSink sink;
    void *user;
} Unit;

static void take_packet(void *user, const uint8_t *packet, uint32_t n, uint64_t barred)
{
    const Unit *unit = user;
    CommandState *s = unit->context->state;
    s->barred = barred;
    (void)command_accept(s, unit->context->table, &s->ground, packet, n, unit->sink, unit->user);
    s->barred = 0u;
}

CommandReason command_service_unwrap(const CommandContext *context, const uint8_t *bytes, uint32_t n, CommandSink sink,
                                     void *user)
{
    const CommandServices *services = context->table->services;
    const uint32_t place = speaker(services);
    Unit unit = {context, sink, user};
    services->list[place]->unwrap(context, services->module(context->mission, place), bytes, n, take_packet, &unit);
    return COMMAND_OK;
}

void command_service_wrap(const CommandContext *context, const uint8_t *packet, uint32_t n, CommandBytes sink,
                          void *user)
{
    const CommandServices *services = context->table->services;
    const uint32_t place = speaker(services);
    services->list[place]->wrap(context, services->module(context->mission, place), packet, n, sink, user);
}
