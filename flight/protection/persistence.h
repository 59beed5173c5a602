/* SPDX-License-Identifier: Apache-2.0 */
/* Private to flight/protection: how long something must last before it counts. */
#ifndef FLIGHT_PROTECTION_PERSISTENCE_H
#define FLIGHT_PROTECTION_PERSISTENCE_H

#include "flight/math/vec.h"
#include "flight/msg/protection.h"

/** Judge a value, as a part of its limit, that was computed from inputs of a time `of`, the worst of which has a
 *  quality. `persistence` updates in a row beyond the limit trip the protection. It stays tripped until as many as
 *  `release` in a row were within (0: until a reset). What is not known, because data are missing, stale, not newer
 *  than those of the last judgement, or not finite, changes no count. */
static inline void judge(ProtectionState *s, Judgement *m, int64_t t, int64_t of, Quality quality, double value,
                         uint32_t persistence, uint32_t release)
{
    if (quality <= QUALITY_STALE || !isfinite(value) || (m->any && of <= m->last && t > m->last)) {
        s->unknown++;
        s->head = head_next(s->head, t, QUALITY_DEGRADED);
        return;
    }
    m->last = of;
    m->any = 1u;
    const int beyond = value > 1.0;
    s->value = value;
    /* undecided: a guard; a count ends after 2^32 updates */
    s->count = !beyond ? 0u : s->count < UINT32_MAX ? s->count + 1u : s->count;
    /* undecided: a guard; a count ends after 2^32 updates */
    m->within = beyond ? 0u : m->within < UINT32_MAX ? m->within + 1u : m->within;
    if (!s->tripped && s->count >= persistence) {
        s->tripped = 1u;
        s->trips++;
    } else if (s->tripped && release > 0u && m->within >= release) {
        s->tripped = 0u;
    }
    s->head = head_next(s->head, t, quality);
}

#endif
