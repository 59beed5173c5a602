/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/actuation/propulsion_manager.h"

#include <string.h>

void propulsion_manager_reset(PropulsionManager *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
    for (uint32_t i = 0u; i < THRUSTERS_MAX; i++) {
        m->mem.open[i] = -1;
        m->mem.shut[i] = -1;
    }
}

/* Another number wherever the content is another one, so that the card's answer shows which command it obeys. */
static void write_times(PropulsionManager *m)
{
    const ThrusterTimes *times = &m->in.times;
    PropulsionCommand *command = &m->out.command;
    PropulsionCommand next = *command;
    next.armed = m->par.armed;
    for (uint32_t i = 0u; i < THRUSTERS_MAX; i++) {
        const int burns = head_written(times->head) && i < m->par.n && times->off[i] > times->on[i];
        next.start[i] = burns ? times->on[i] : 0;
        next.duration[i] = burns ? tick_since(times->off[i], times->on[i]) : 0;
    }
    if (!head_written(command->head)) {
        next.number = m->in.card.number;
    }
    if (!head_written(command->head) || memcmp(&next, command, sizeof next) != 0) {
        next.number++;
        next.number += next.number == 0u;
    }
    *command = next;
}

/* Whether a condition has held for `persistence`; *since [ns] is when it began, or -1. */
static int lasts(int holds, int64_t *since, int64_t t, int64_t persistence)
{
    *since = !holds ? -1 : *since < 0 ? t : *since;
    return holds && tick_since(t, *since) >= persistence;
}

/* What the card has counted of a thruster in so many of its steps. One that was found stuck shut stays so until it
 * gives thrust, although it may not be opened any more. */
static void judge(PropulsionManager *m, uint32_t i, uint32_t steps, int64_t t)
{
    PropulsionHealth *health = &m->out.health;
    const uint32_t driven = m->in.card.driven[i] - m->mem.driven[i],
                   flowing = m->in.card.flowing[i] - m->mem.flowing[i];
    const uint32_t bit = 1u << i, falls = driven != 0u;
    const int open = flowing >= steps && driven + falls < steps;
    if (lasts(open, &m->mem.open[i], t, m->par.persistence)) {
        health->stuck_open |= bit;
    } else {
        health->stuck_open &= ~bit;
    }
    if (flowing != 0u) {
        m->mem.shut[i] = -1;
        health->stuck_shut &= ~bit;
    } else if (driven != 0u && lasts(1, &m->mem.shut[i], t, m->par.persistence)) {
        health->stuck_shut |= bit;
    }
    m->mem.driven[i] = m->in.card.driven[i];
    m->mem.flowing[i] = m->in.card.flowing[i];
}

static void watch(PropulsionManager *m, int64_t t)
{
    const PropulsionState *card = &m->in.card;
    PropulsionHealth *health = &m->out.health;
    const int first = !head_written(health->head);
    const uint32_t steps = first ? 0u : card->counter - m->mem.counter;
    if (first || steps != 0u) {
        m->mem.counter = card->counter;
        m->mem.counted = t;
    }
    health->silent = m->par.silent_after > 0 && tick_since(t, m->mem.counted) >= m->par.silent_after;
    health->disarmed = m->par.armed != 0u && (card->armed == 0u || health->silent != 0u);
    /* undecided: a guard of the array; the bounds of the parameter are within */
    for (uint32_t i = 0u; i < m->par.n && i < THRUSTERS_MAX; i++) {
        if (first) {
            m->mem.driven[i] = card->driven[i];
            m->mem.flowing[i] = card->flowing[i];
        } else if (steps != 0u) {
            judge(m, i, steps, t);
        } else if (health->silent != 0u) {
            m->mem.open[i] = -1;
            health->stuck_open &= ~(1u << i);
        }
        m->out.availability.available[i] = (health->stuck_shut >> i & 1u) == 0u && health->silent == 0u;
    }
}

void propulsion_manager_update(PropulsionManager *m, Tick t)
{
    PropulsionCommand *command = &m->out.command;
    PropulsionHealth *health = &m->out.health;
    ThrusterAvailability *availability = &m->out.availability;
    if (!head_written(m->in.card.head)) {
        command->head = head_held(command->head);
        health->head = head_held(health->head);
        availability->head = head_held(availability->head);
        return;
    }
    write_times(m);
    watch(m, t.t);
    const Quality known = quality_through(m->in.card.head);
    command->head = head_next(command->head, t.t, quality_min(known, quality_optional(m->in.times.head)));
    health->head = head_next(health->head, t.t, known);
    availability->head = head_next(availability->head, t.t, known);
}
