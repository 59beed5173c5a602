/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/guidance/burn_memory.h"

#include <string.h>

enum { START = 0, BEGUN = 2, GAINED = 4, PHASE = 6, ABORT_SHIFT = 8 }; /* words of the slot; PHASE: abort above it */

#define MARK 0x424D0000u /* of what it stores */

void burn_memory_reset(BurnMemory *m)
{
    memset(&m->out, 0, sizeof m->out);
    m->mem.seen = m->mem.begun = m->mem.waited = 0u;
}

static void publish(BurnMemory *m, int64_t t, BurnMemoryEventId id, EventSeverity severity, double first, double second,
                    double third)
{
    event_publish(&m->out.event, t, (FlightEvent){.id = id, .severity = severity, .arguments = {first, second, third}});
}

/* A burn that ran before a reset does not any more. */
static void cut(BurnMemory *m, int64_t t)
{
    if (m->mem.burn.phase == BURN_RUNS || m->mem.burn.phase == BURN_CUT) {
        m->mem.burn.phase = BURN_CUT;
        m->mem.changed = 1u;
        publish(m, t, BURN_MEMORY_CUT, EVENT_HIGH, m->mem.burn.gained, tick_seconds(m->mem.burn.start), 0.0);
    }
}

/* ---- non-volatile memory */

static void put64(uint32_t *words, const void *from)
{
    uint64_t bits;
    memcpy(&bits, from, sizeof bits);
    words[0] = (uint32_t)(bits >> 32);
    words[1] = (uint32_t)bits;
}

static void get64(const uint32_t *words, void *to)
{
    const uint64_t bits = (uint64_t)words[0] << 32 | words[1];
    memcpy(to, &bits, sizeof bits);
}

static void pack(const BurnState *kept, uint32_t *words)
{
    put64(words + START, &kept->start);
    put64(words + BEGUN, &kept->begun);
    put64(words + GAINED, &kept->gained);
    words[PHASE] = (uint32_t)kept->phase | (uint32_t)kept->abort << ABORT_SHIFT;
}

static void unpack(BurnMemory *m, const uint32_t *words, int64_t t)
{
    const int has = nvm_has(words, MARK);
    double gained;
    get64(words + GAINED, &gained);
    if (has < 0 || (has > 0 && !isfinite(gained))) {
        publish(m, t, BURN_MEMORY_DAMAGED, EVENT_MEDIUM, m->par.slot - 1u, 0.0, 0.0);
    } else if (has > 0 && m->mem.burn.phase == BURN_NONE) {
        get64(words + START, &m->mem.burn.start);
        get64(words + BEGUN, &m->mem.burn.begun);
        m->mem.burn.gained = gained;
        m->mem.burn.phase = (BurnPhase)(words[PHASE] & ((1u << ABORT_SHIFT) - 1u));
        m->mem.burn.abort = (BurnAbort)(words[PHASE] >> ABORT_SHIFT);
        cut(m, t);
    }
}

static void keep(BurnMemory *m, int64_t t)
{
    const NvmCode done = nvm_answered(&m->out.request, &m->in.reply, m->par.slot, t);
    m->mem.waited += m->mem.waited < BURN_MEMORY_PATIENCE;
    if (done == NVM_RETRIEVE && m->mem.restored == 0u && m->in.reply.refused == 0u) {
        unpack(m, m->in.reply.data, t);
    }
    m->mem.restored |= done != NVM_NOTHING;
    if (done != NVM_NOTHING && m->mem.changed != 0u) {
        pack(&m->mem.burn, m->out.request.data);
        nvm_store(&m->out.request, MARK);
        m->mem.changed = 0u;
    }
}

/* ---- the burn */

static void follow(BurnMemory *m, Tick t)
{
    const BurnState *state = &m->in.state;
    BurnState *kept = &m->mem.burn;
    const int fresh = head_written(state->head) && state->head.sequence != m->mem.seen && isfinite(state->gained) &&
                      isfinite(state->to_go);
    const BurnPhase before = kept->phase;
    m->mem.seen = state->head.sequence;
    if (fresh && (state->phase == BURN_RUNS || state->phase == BURN_COMPLETE || state->phase == BURN_ABORTED)) {
        const int other = kept->start != state->start || before != state->phase;
        m->mem.changed |= other || kept->gained != state->gained;
        *kept = *state;
        if (other && state->phase == BURN_RUNS && before == BURN_CUT) {
            publish(m, t.t, BURN_MEMORY_RESUMED, EVENT_MEDIUM, state->gained, state->to_go, 0.0);
        } else if (other && state->phase == BURN_RUNS) {
            publish(m, t.t, BURN_MEMORY_BEGUN, EVENT_INFO, state->to_go, 0.0, 0.0);
        } else if (other && state->phase == BURN_COMPLETE) {
            publish(m, t.t, BURN_MEMORY_ENDED, EVENT_INFO, state->gained, state->to_go, 0.0);
        } else if (other) {
            publish(m, t.t, BURN_MEMORY_ABORTED, EVENT_HIGH, state->abort, state->gained, state->to_go);
        }
    } else if (before == BURN_RUNS && data_lost(t, kept->head.t, m->par.silent)) {
        kept->phase = BURN_ABORTED;
        kept->abort = BURN_LEFT;
        m->mem.changed = 1u;
        publish(m, t.t, BURN_MEMORY_ABORTED, EVENT_HIGH, BURN_LEFT, kept->gained, kept->to_go);
    }
}

void burn_memory_update(BurnMemory *m, Tick t)
{
    if (m->mem.begun == 0u) {
        cut(m, t.t);
        m->mem.begun = 1u;
        m->mem.seen = m->in.state.head.sequence; /* of before the reset */
    }
    keep(m, t.t);
    follow(m, t);
    const int known = m->par.slot == 0u || m->mem.restored != 0u || m->mem.waited >= BURN_MEMORY_PATIENCE;
    const Head head = head_next(m->out.kept.head, t.t, known ? QUALITY_GOOD : QUALITY_DEGRADED);
    m->out.kept = m->mem.burn;
    m->out.kept.head = head;
}
