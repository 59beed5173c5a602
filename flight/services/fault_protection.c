/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/services/fault_protection.h"

#include <string.h>

enum { UNIT = 10, STATE = 12, EVEN = 14 };       /* [bytes] places in COMMAND_UNIT */
enum { STATES = 0, RESPONSES = 2, PRESENT = 6 }; /* words of the slot of the non-volatile memory */

#define MARK 0x46500000u /* of what it stores */
#define NO_UNIT (-1)

static int has(uint32_t set, uint32_t i)
{
    return (set >> i & 1u) != 0u;
}

static void publish(FaultProtection *m, int64_t t, FaultProtectionEventId id, EventSeverity severity, double first,
                    double second, double third, double fourth)
{
    event_publish(&m->out.event, t,
                  (FlightEvent){.id = id, .severity = severity, .arguments = {first, second, third, fourth}});
}

/* ---- units */

static int is_redundant(const FaultProtection *m, uint32_t unit)
{
    return m->mem.state[unit] == UNIT_REDUNDANT;
}

static int is_powered(const FaultProtection *m, uint32_t unit)
{
    return m->mem.state[unit] == UNIT_PRIMARY || (is_redundant(m, unit) && m->par.units[unit].warm != 0u);
}

/* How many units of a kind are in use, or were primary at the start. */
static uint32_t count_of(const FaultProtection *m, uint32_t kind, int at_start)
{
    uint32_t n = 0u;
    for (uint32_t i = 0u; i < UNITS_MAX; i++) {
        const UnitState state = at_start ? m->par.units[i].start : m->mem.state[i];
        n += m->par.units[i].kind == kind && state == UNIT_PRIMARY;
    }
    return n;
}

static int is_lost(const FaultProtection *m, uint32_t kind)
{
    return count_of(m, kind, 1) > 0u && count_of(m, kind, 0) == 0u;
}

static void become(FaultProtection *m, uint32_t unit, UnitState state)
{
    if (m->mem.state[unit] != state) {
        m->mem.state[unit] = state;
        m->mem.touched |= 1u << unit;
        m->mem.changed = 1u;
        m->mem.kept = 0u;
    }
}

/* The first redundant unit of the kind of another one; UNITS_MAX: there is none. */
static uint32_t spare_of(const FaultProtection *m, uint32_t unit)
{
    uint32_t i = 0u;
    while (i < UNITS_MAX && (i == unit || !is_redundant(m, i) || m->par.units[i].kind != m->par.units[unit].kind)) {
        i++;
    }
    return i;
}

/* Let a unit become something, and another one take over if it was needed. Returns that one, or NO_UNIT. */
static int set_state(FaultProtection *m, uint32_t unit, UnitState state)
{
    const uint32_t kind = m->par.units[unit].kind;
    const int leaves = m->mem.state[unit] == UNIT_PRIMARY && state != UNIT_PRIMARY;
    become(m, unit, state);
    const uint32_t spare = spare_of(m, unit);
    if (!leaves || spare == UNITS_MAX || count_of(m, kind, 0) >= count_of(m, kind, 1)) {
        return NO_UNIT;
    }
    become(m, spare, UNIT_PRIMARY);
    return (int)spare;
}

/* Units that are new in the parameters begin, others end. A number that is no state is no unit. */
static void follow_parameters(FaultProtection *m)
{
    for (uint32_t i = 0u; i < UNITS_MAX; i++) {
        const UnitState given = m->par.units[i].start, start = given <= UNIT_FAULTED ? given : UNIT_ABSENT;
        if (start == UNIT_ABSENT || m->mem.state[i] == UNIT_ABSENT) {
            m->mem.state[i] = start;
        }
    }
}

static void write_table(FaultProtection *m, int64_t t)
{
    UnitTable *table = &m->out.table;
    const Head head = head_next(table->head, t, m->mem.bad != 0u ? QUALITY_DEGRADED : QUALITY_GOOD);
    *table = (UnitTable){.head = head,
                         .fired_at = m->mem.fired > 0u ? m->mem.fired_at : -1,
                         .fired = m->mem.fired,
                         .responses = m->mem.responses,
                         .bad = m->mem.bad,
                         .kept = m->mem.kept,
                         .waits = m->par.slot > 0u && m->mem.restored == 0u && m->mem.waited < FAULT_PATIENCE};
    uint32_t used[UNITS_MAX] = {0}, needed[UNITS_MAX] = {0};
    for (uint32_t i = 0u; i < UNITS_MAX; i++) {
        const FaultUnit *unit = &m->par.units[i];
        const UnitState state = m->mem.state[i];
        const uint32_t kind = unit->kind % UNITS_MAX;
        table->state[i] = state;
        table->used |= (state == UNIT_PRIMARY ? 1u : 0u) << i;
        table->faulted |= (state == UNIT_FAULTED ? 1u : 0u) << i;
        table->loads |= state == UNIT_ABSENT ? 0u : unit->loads;
        table->powered |= is_powered(m, i) ? unit->loads : 0u;
        table->left[kind] = (uint8_t)(table->left[kind] + (state == UNIT_PRIMARY || state == UNIT_REDUNDANT));
        used[kind] += state == UNIT_PRIMARY;
        needed[kind] += unit->start == UNIT_PRIMARY;
    }
    for (uint32_t i = 0u; i < UNITS_MAX; i++) {
        table->reduced |= (used[i] < needed[i] ? 1u : 0u) << i;
        table->lost |= (used[i] == 0u && needed[i] > 0u ? 1u : 0u) << i;
    }
    for (uint32_t i = 0u; i < FAULT_RULES; i++) {
        const uint32_t limit = m->par.rules[i].limit;
        table->wrong |= (m->mem.watched[i].wrong != 0u ? 1u : 0u) << i;
        table->stopped |= (limit > 0u && m->mem.responded[i] >= limit ? 1u : 0u) << i;
    }
}

/* ---- rules */

static int rests(const FaultProtection *m, const FaultRule *rule)
{
    if (rule->unit == 0u || rule->unit > UNITS_MAX || rule->becomes > UNIT_FAULTED) {
        return rule->unit != 0u; /* what is not there: a wrong table, or damaged memory */
    }
    const UnitState state = m->mem.state[rule->unit - 1u];
    return state == UNIT_ABSENT || state == UNIT_FAULTED || state == rule->becomes ||
           (rule->becomes == UNIT_FAULTED && !is_powered(m, rule->unit - 1u));
}

static void respond(FaultProtection *m, uint32_t place, int64_t t)
{
    const FaultRule *rule = &m->par.rules[place];
    const double value = m->mem.watched[place].last;
    uint8_t *responded = &m->mem.responded[place];
    if (rule->limit > 0u && *responded >= rule->limit) {
        publish(m, t, FAULT_PROTECTION_STOPPED, EVENT_LOW, place, value, 0.0, 0.0);
        return;
    }
    if (*responded < FAULT_LIMIT) {
        ++*responded;
        m->mem.changed = 1u;
        m->mem.kept = 0u;
    }
    m->mem.responses++;
    m->mem.fired = place + 1u;
    m->mem.fired_at = t;
    m->mem.modes |= (rule->mode > 0u ? 1u : 0u) << place;
    m->mem.lists |= (rule->check.list > 0u ? 1u : 0u) << place;
    if (rule->unit == 0u) {
        publish(m, t, FAULT_PROTECTION_FIRED, EVENT_MEDIUM, place, value, NO_UNIT, NO_UNIT);
        return;
    }
    const uint32_t unit = rule->unit - 1u, kind = m->par.units[unit].kind;
    const int was_lost = is_lost(m, kind);
    const int successor = rule->becomes == UNIT_ABSENT ? NO_UNIT : set_state(m, unit, rule->becomes);
    if (is_lost(m, kind) && !was_lost) {
        publish(m, t, FAULT_PROTECTION_LOST, EVENT_HIGH, place, value, unit, kind);
    } else {
        publish(m, t, FAULT_PROTECTION_FIRED, EVENT_MEDIUM, place, value, unit, successor);
    }
}

static void evaluate(FaultProtection *m, uint32_t place, const CommandContext *context)
{
    const FaultRule *rule = &m->par.rules[place];
    MonitorMemory *memory = &m->mem.watched[place];
    const uint32_t bit = 1u << place, bad = m->mem.bad & bit;
    m->mem.bad &= ~bit;
    if (rests(m, rule)) {
        *memory = monitor_new();
        return;
    }
    /* undecided: there are no others */
    switch (monitor_evaluate(&rule->check, memory, context)) {
    case MONITOR_BAD:
        m->mem.bad |= bit;
        if (bad == 0u) {
            publish(m, context->t, FAULT_PROTECTION_BAD, EVENT_LOW, place, 0.0, 0.0, 0.0);
        }
        break;
    case MONITOR_FIRES: respond(m, place, context->t); break;
    case MONITOR_ENDS:
    case MONITOR_SAME: break;
    }
}

/* ---- what it has for flight */

/* A run whose time begins anew begins as built. */
static void begin(FaultProtection *m, int64_t t)
{
    if (t < m->mem.evaluated) {
        memset(&m->mem, 0, sizeof m->mem);
        fault_protection_reset(m);
    }
    follow_parameters(m);
}

static uint32_t take(const CommandContext *context, void *module, uint8_t *packet, CommandReport *report)
{
    FaultProtection *m = module;
    if (m->mem.begun == 0u || m->mem.evaluated != context->t) {
        begin(m, context->t);
        const uint32_t before = m->mem.responses + m->mem.begun;
        for (uint32_t i = 0u; i < FAULT_RULES; i++) {
            evaluate(m, i, context);
        }
        m->mem.begun = 1u;
        m->mem.evaluated = context->t;
        if (m->mem.responses + m->mem.begun != before) { /* or it is the first instant */
            write_table(m, context->t);
        }
    }
    for (uint32_t i = 0u; i < FAULT_RULES; i++) {
        const FaultRule *rule = &m->par.rules[i];
        report->origin = (uint16_t)(COMMAND_OF_RULE + i);
        if (has(m->mem.modes, i)) {
            const uint16_t mode = (uint16_t)(rule->mode - 1u);
            m->mem.modes &= ~(1u << i);
            if (!command_may_enter(context, mode)) {
                publish(m, context->t, FAULT_PROTECTION_GUARDED, EVENT_MEDIUM, i, mode, 0.0, 0.0);
            }
            return monitor_command(context->table, COMMAND_MODE, &mode, 1u, m->mem.responses, packet);
        }
        if (has(m->mem.lists, i)) {
            m->mem.lists &= ~(1u << i);
            return monitor_start(context->table, rule->check.list, m->mem.responses, packet);
        }
    }
    return 0u;
}

static int64_t next(const void *module)
{
    const FaultProtection *m = module;
    uint32_t watches = m->mem.modes | m->mem.lists;
    for (uint32_t i = 0u; i < FAULT_RULES; i++) {
        watches |= m->par.rules[i].check.on;
    }
    return watches != 0u ? 0 : INT64_MAX; /* at each instant */
}

/* ---- its command */

static CommandReason check(const uint8_t *packet, uint32_t n)
{
    const uint32_t unit = ccsds_get16(packet + UNIT), state = ccsds_get16(packet + STATE);
    (void)n;
    return unit >= UNITS_MAX && unit != COMMAND_ALL ? COMMAND_PLACE
           : state > UNIT_FAULTED || (unit == COMMAND_ALL && state != 0u) || ccsds_get16(packet + EVEN) > 1u
               ? COMMAND_VALUE
               : COMMAND_OK;
}

/* Clear the fault of a unit, and what counts against the rules that accuse it. */
static void clear(FaultProtection *m, uint32_t unit)
{
    const uint32_t kind = m->par.units[unit].kind;
    if (m->mem.state[unit] == UNIT_FAULTED) {
        become(m, unit, count_of(m, kind, 0) < count_of(m, kind, 1) ? UNIT_PRIMARY : UNIT_REDUNDANT);
    }
    for (uint32_t i = 0u; i < FAULT_RULES; i++) {
        if (m->par.rules[i].unit == unit + 1u) {
            m->mem.responded[i] = 0u;
        }
    }
}

static CommandReason execute(const CommandContext *context, void *module, const uint8_t *packet, CommandReport *report,
                             uint8_t *data)
{
    FaultProtection *m = module;
    const uint32_t unit = ccsds_get16(packet + UNIT);
    const UnitState state = (UnitState)ccsds_get16(packet + STATE);
    int successor = NO_UNIT;
    (void)report;
    (void)data;
    begin(m, context->t);
    if (unit == COMMAND_ALL) {
        for (uint32_t i = 0u; i < UNITS_MAX; i++) {
            clear(m, i);
        }
        memset(m->mem.responded, 0, sizeof m->mem.responded);
    } else if (m->mem.state[unit] == UNIT_ABSENT) {
        return COMMAND_PLACE;
    } else if (state == UNIT_ABSENT) {
        clear(m, unit);
    } else {
        const uint32_t kind = m->par.units[unit].kind;
        if (m->mem.state[unit] == UNIT_PRIMARY && state != UNIT_PRIMARY && count_of(m, kind, 0) == 1u &&
            spare_of(m, unit) == UNITS_MAX && ccsds_get16(packet + EVEN) == 0u) {
            return COMMAND_LAST;
        }
        successor = set_state(m, unit, state);
    }
    m->mem.changed = 1u;
    m->mem.kept = 0u;
    publish(m, context->t, FAULT_PROTECTION_SET, EVENT_INFO, unit == COMMAND_ALL ? NO_UNIT : (double)unit,
            unit == COMMAND_ALL ? 0.0 : (double)m->mem.state[unit], successor, 0.0);
    write_table(m, context->t);
    return COMMAND_OK;
}

const CommandService fault_protection_service = {
    .first = COMMAND_UNIT, .n = 1u, .check = check, .execute = execute, .take = take, .next = next};

/* ---- non-volatile memory */

/* The states but UNIT_ABSENT in 2 bits each, and how often rules have responded in 4. */
static void pack(const FaultProtection *m, uint32_t *words)
{
    memset(words, 0, NVM_WORDS * sizeof *words);
    for (uint32_t i = 0u; i < UNITS_MAX; i++) {
        const uint32_t state = (uint32_t)m->mem.state[i];
        words[STATES + i / 16u] |= (state > 0u ? state - 1u : 0u) << 2u * (i % 16u);
        words[PRESENT] |= (state > 0u ? 1u : 0u) << i;
    }
    for (uint32_t i = 0u; i < FAULT_RULES; i++) {
        words[RESPONSES + i / 8u] |= (uint32_t)m->mem.responded[i] << 4u * (i % 8u);
    }
}

/* What was stored counts for the units that have not changed since the start; where both together leave too few of a
 * kind in use, spares take over. */
static void unpack(FaultProtection *m, const uint32_t *words, int64_t t)
{
    const int has_states = nvm_has(words, MARK);
    if (has_states == 0) {
        return;
    }
    if (has_states < 0) {
        publish(m, t, FAULT_PROTECTION_DAMAGED, EVENT_MEDIUM, m->par.slot - 1u, 0.0, 0.0, 0.0);
        return;
    }
    for (uint32_t i = 0u; i < UNITS_MAX; i++) {
        if (m->mem.state[i] != UNIT_ABSENT && has(words[PRESENT], i) && !has(m->mem.touched, i)) {
            m->mem.state[i] = (UnitState)(1u + (words[STATES + i / 16u] >> 2u * (i % 16u) & 3u));
        }
    }
    for (uint32_t i = 0u; i < FAULT_RULES; i++) {
        const uint8_t before = (uint8_t)(words[RESPONSES + i / 8u] >> 4u * (i % 8u) & 0xFu);
        m->mem.responded[i] = before > m->mem.responded[i] ? before : m->mem.responded[i];
    }
    for (uint32_t i = 0u; i < UNITS_MAX; i++) {
        const uint32_t kind = m->par.units[i].kind;
        if (is_redundant(m, i) && count_of(m, kind, 0) < count_of(m, kind, 1)) {
            become(m, i, UNIT_PRIMARY);
        }
    }
    uint32_t used = 0u, faulted = 0u;
    for (uint32_t i = 0u; i < UNITS_MAX; i++) {
        used += m->mem.state[i] == UNIT_PRIMARY;
        faulted += m->mem.state[i] == UNIT_FAULTED;
    }
    publish(m, t, FAULT_PROTECTION_RESTORED, EVENT_INFO, used, faulted, 0.0, 0.0);
}

static void keep(FaultProtection *m, int64_t t)
{
    const NvmPacket *reply = &m->in.reply;
    NvmPacket *request = &m->out.request;
    m->mem.waited += m->mem.waited < FAULT_PATIENCE;
    const NvmCode done = nvm_answered(request, reply, m->par.slot, t);
    if (done == NVM_NOTHING) {
        return;
    }
    if (done == NVM_RETRIEVE && reply->refused == 0u) {
        unpack(m, reply->data, t);
    }
    m->mem.restored = 1u;
    m->mem.kept = m->mem.changed == 0u && done == NVM_STORE && reply->refused == 0u;
    if (m->mem.changed != 0u || done == NVM_RETRIEVE) {
        pack(m, request->data);
        nvm_store(request, MARK);
        m->mem.changed = 0u;
    }
}

/* ---- the module */

void fault_protection_reset(FaultProtection *m)
{
    memset(&m->out, 0, sizeof m->out);
    for (uint32_t i = 0u; i < FAULT_RULES; i++) {
        m->mem.watched[i] = monitor_new();
    }
    m->mem.begun = m->mem.modes = m->mem.lists = m->mem.bad = m->mem.fired = m->mem.responses = 0u;
    m->mem.kept = 0u;
}

void fault_protection_update(FaultProtection *m, Tick t)
{
    begin(m, t.t);
    keep(m, t.t);
    write_table(m, t.t);
}
