/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/sensing/body_direction.h"

#include <string.h>

void body_direction_reset(BodyDirection *m)
{
    memset(&m->out, 0, sizeof m->out);
}

/* A position that a good or degraded input gave for a time, at the time of the measurement. */
static Vec3 moved(Head head, Vec3 r, Vec3 v, int64_t measured, int64_t now)
{
    return vec_add(r, vec_scale(tick_seconds(tick_since(measured, data_time(head, now))), v));
}

void body_direction_update(BodyDirection *m, Tick t)
{
    const Head heading = m->in.heading.head, body = m->in.body.head, orbit = m->in.orbit.head;
    SeenDirection *seen = &m->out.seen;
    const int is_new = !head_written(seen->head) || heading.t > seen->head.t || seen->head.t > t.t;
    if (heading.t > t.t || (!is_new && heading.quality == QUALITY_GOOD)) {
        return; /* it waits, or was given */
    }
    Vec3 r_PB_N = vec3(0.0, 0.0, 0.0);
    Quality known = quality_through(orbit);
    if (m->par.central == 0u) {
        r_PB_N = moved(body, m->in.body.r_PN_N, m->in.body.v_PN_N, heading.t, t.t);
        known = quality_min(quality_through(body), quality_optional(orbit));
    }
    if (head_written(orbit)) {
        r_PB_N = vec_sub(r_PB_N, moved(orbit, m->in.orbit.r_BN_N, m->in.orbit.v_BN_N, heading.t, t.t));
    }
    const Quality quality = quality_min(quality_through(heading), known);
    const SeenDirection next = {head_next(seen->head, heading.t, quality), vec_unit(m->in.heading.s_B),
                                vec_unit(r_PB_N), m->par.std};
    if (is_new && direction_speaks(&next)) {
        *seen = next;
    } else {
        seen->head = head_held(seen->head);
    }
}
