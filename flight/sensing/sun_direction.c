/* SPDX-License-Identifier: Apache-2.0 */
/* With unit axes n_i, cosines c_i and weights w_i of the lit sensors,
 * s solves (sum w_i n_i n_i^T) s = sum w_i c_i n_i. */
#include "flight/sensing/sun_direction.h"

#include <string.h>

#include "flight/math/mat.h"

/* What one converter says. */
typedef struct View {
    double cosine[SUN_SENSORS_MAX];
    uint32_t lit;
    int finite; /* all cosines */
    Vec3 s_B;
    int rank;      /* of the lit sensors' axes; 0 if they give no direction */
    double misfit; /* how far the readings are from those of a Sun in the direction s_B */
} View;

static double weight(const SunDirection *m, uint32_t i)
{
    return m->par.weight[i] > 0.0 ? m->par.weight[i] : 1.0;
}

static View see(const SunDirection *m, const SunSensorCounts *counts, uint32_t which)
{
    View v;
    Mat3 S = {{{0.0}}};
    Vec3 sum = vec3(0.0, 0.0, 0.0);
    v.lit = 0u;
    v.finite = 1;
    for (uint32_t i = 0u; i < m->par.n; i++) {
        const Vec3 n = vec_unit(m->par.axes_B[i]);
        v.cosine[i] = (m->par.offset[which] + m->par.scale[which] * counts->counts[i]) / m->par.current[i];
        v.finite = v.finite && isfinite(v.cosine[i]);
        if (v.cosine[i] >= m->par.dark) {
            const double w = weight(m, i);
            v.lit |= 1u << i;
            sum = vec_add(sum, vec_scale(w * v.cosine[i], n));
            for (int j = 0; j < 3; j++) {
                for (int k = 0; k < 3; k++) {
                    S.m[j][k] += w * n.v[j] * n.v[k];
                }
            }
        }
    }
    const Vec3 s = mat_vec(mat_sym_pinv(S, &v.rank), sum);
    v.rank = v.rank >= 2 && vec_norm(s) > 0.0 ? v.rank : 0;
    v.s_B = v.rank > 0 ? vec_unit(s) : s;
    v.misfit = 0.0;
    for (uint32_t i = 0u; i < m->par.n; i++) {
        const double cosine = v.rank > 0 ? vec_dot(vec_unit(m->par.axes_B[i]), v.s_B) : 1.0;
        const double fits = cosine < m->par.dark ? 0.0 : cosine;
        const double reads = v.cosine[i] < m->par.dark ? 0.0 : v.cosine[i];
        v.misfit += weight(m, i) * (reads - fits) * (reads - fits);
    }
    if (v.lit == 0u) {
        v.misfit = 1.0; /* an eclipse: likelier than one lit sensor, not likelier than a Sun that fits */
    }
    return v;
}

static void say(SunDirection *m, int64_t t, SunDirectionEventId id, EventSeverity severity, uint32_t which)
{
    event_say(&m->out.event, t, (FlightEvent){.id = id, .severity = severity, .arguments = {which}});
}

void sun_direction_reset(SunDirection *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

void sun_direction_update(SunDirection *m, Tick t)
{
    const View view[2] = {see(m, &m->in.a, 0u), see(m, &m->in.b, 1u)};
    const Head head[2] = {m->in.a.head, m->in.b.head};
    SunSensorStatus *status = &m->out.status;
    status->miscompare = 0u;
    for (uint32_t i = 0u; i < m->par.n && head_written(head[0]) && head_written(head[1]); i++) {
        if (!(fm_abs(view[0].cosine[i] - view[1].cosine[i]) <= m->par.differ)) {
            status->miscompare |= 1u << i;
            if (++m->mem.differed[i] >= m->par.persistence && (status->sensors >> i & 1u) == 0u) {
                status->sensors |= 1u << i;
                say(m, t.t, SUN_DIRECTION_SENSOR, EVENT_LOW, i);
            }
        }
    }
    if (status->miscompare != 0u && status->faulty == 0u) {
        const uint32_t worse = view[1].misfit > view[0].misfit ? 1u : 0u;
        if (++m->mem.suspected[worse] >= m->par.persistence) {
            status->faulty = 1u << worse;
            say(m, t.t, SUN_DIRECTION_FAULTY, EVENT_HIGH, status->faulty);
        }
    }
    status->head = head_next(status->head, t.t, quality_min(quality_through(head[0]), quality_through(head[1])));

    /* While they differ, the one that fits. */
    const int better = status->miscompare != 0u && view[1].misfit < view[0].misfit;
    const uint32_t used = status->faulty == 1u || !head_written(head[0]) || (status->faulty == 0u && better) ? 1u : 0u;
    SunCosines *cosines = &m->out.cosines;
    if (head_written(head[used]) && view[used].finite) {
        cosines->head = head_next(cosines->head, t.t, quality_through(head[used]));
        cosines->n = m->par.n;
        cosines->lit = view[used].lit;
        for (uint32_t i = 0u; i < m->par.n; i++) {
            cosines->cosine[i] = view[used].cosine[i];
            cosines->weight[i] = weight(m, i);
            cosines->axes_B[i] = vec_unit(m->par.axes_B[i]);
        }
    } else {
        cosines->head = head_held(cosines->head);
    }
    const Quality quality =
        quality_min(quality_through(head[used]), view[used].rank == 3 ? QUALITY_GOOD : QUALITY_DEGRADED);
    if (head_written(head[used]) && view[used].rank > 0 && vec_finite(view[used].s_B)) {
        m->out.heading.head = head_next(m->out.heading.head, t.t, quality);
        m->out.heading.s_B = view[used].s_B;
    } else {
        m->out.heading.head = head_held(m->out.heading.head);
    }
}
