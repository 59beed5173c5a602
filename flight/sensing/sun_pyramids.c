/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/sensing/sun_pyramids.h"

#include <string.h>

#include "flight/sensing/sun_fit.h"

/* Which sensors speak and are in use. */
static uint32_t sample(SunPyramids *m, SunView *v)
{
    uint32_t used = 0u;
    memset(v, 0, sizeof *v);
    for (uint32_t which = 0u; which < 2u; which++) {
        const SunSensorCounts *in = which == 0u ? &m->in.a : &m->in.b;
        const uint32_t first = which * SUN_PYRAMID;
        const size_t size = SUN_PYRAMID * sizeof in->counts[0];
        m->mem.still[which] = memcmp(m->mem.counts + first, in->counts, size) == 0 ? m->mem.still[which] + 1u : 0u;
        memcpy(m->mem.counts + first, in->counts, size);
        for (uint32_t i = first; i < first + SUN_PYRAMID; i++) {
            v->axis[i] = vec_unit(m->par.axes_B[i]);
            v->weight[i] = m->par.weight[i] > 0.0 ? m->par.weight[i] : 1.0;
            v->cosine[i] = (m->par.offset[which] + m->par.scale[which] * in->counts[i - first]) / m->par.current[i];
            /* undecided: a guard; counts are integers, and the parameters finite and not 0 */
            if (in->head.quality >= QUALITY_DEGRADED && isfinite(v->cosine[i])) {
                used |= 1u << i & ~m->out.status.unused;
                v->lit |= v->cosine[i] >= m->par.dark ? 1u << i : 0u;
            }
        }
    }
    return used;
}

/* A contradiction: which converter it is of (2: either, or none), and by which sensor alone (bits). A fault that
 * explains it speaks against its converter (shown); the other one must be far from any that does (possible). */
static uint32_t blame(SunPyramids *m, const SunView *v, const uint32_t of[2], uint32_t *single)
{
    const double limit = m->par.differ;
    SunFit own[2];
    int dark[2], shown[2] = {0}, possible[2] = {0};
    *single = 0u;
    for (uint32_t k = 0u; k < 2u; k++) {
        own[k] = sun_fit(v, of[k]);
        dark[k] = (v->lit & of[k]) == 0u;
        for (uint32_t i = 0u; i < SUN_SENSORS_MAX; i++) {
            if ((of[k] >> i & 1u) != 0u) {
                const double others = sun_fit(v, (of[0] | of[1]) & ~(1u << i)).misfit;
                *single |= others <= limit ? 1u << i : 0u;
                possible[k] = possible[k] || others <= 2.0 * limit;
            }
        }
    }
    m->mem.lit = dark[0] || dark[1] ? m->mem.lit : 0u;
    for (uint32_t k = 0u; k < 2u; k++) {
        const SunFit witness = own[1u - k];
        const int known = (m->out.status.faulty >> k & 1u) != 0u, fell = dark[k] && (m->mem.lit & of[k]) != 0u;
        const int still = 2u * m->mem.still[k] > m->par.persistence;
        shown[k] = (*single & of[k]) != 0u ||
                   (of[k] != 0u && witness.misfit <= limit && (own[k].dimmed > limit || known || fell));
        possible[k] = possible[k] || (of[k] != 0u && witness.dimmed <= 2.0 * limit &&
                                      (own[k].dimmed > 0.5 * limit || known || dark[k] || still));
    }
    for (uint32_t k = 0u; k < 2u; k++) {
        if (shown[k] && (!possible[1u - k] || m->out.status.faulty == 1u << k)) {
            return k;
        }
    }
    return 2u;
}

static void publish(SunPyramids *m, int64_t t, SunPyramidsEventId id, EventSeverity severity, double which,
                    double sensors)
{
    event_publish(&m->out.event, t, (FlightEvent){.id = id, .severity = severity, .arguments = {which, sensors}});
}

static void forget(SunPyramids *m)
{
    memset(m->mem.suspected, 0, sizeof m->mem.suspected);
    memset(m->mem.alone, 0, sizeof m->mem.alone);
}

/* A contradiction speaks against `which`. The sensors that are to be left out. */
static uint32_t count(SunPyramids *m, int64_t t, uint32_t which, uint32_t single)
{
    const uint32_t first = which * SUN_PYRAMID;
    uint32_t out = ((1u << SUN_PYRAMID) - 1u) << first;
    m->mem.suspected[which]++;
    for (uint32_t i = first; i < first + SUN_PYRAMID; i++) {
        m->mem.alone[i] += single == 1u << i ? 1u : 0u;
        if (m->mem.alone[i] > 1u && 2u * m->mem.alone[i] > m->mem.suspected[which] &&
            (m->out.status.faulty >> which & 1u) == 0u) {
            out = 1u << i;
        }
    }
    if (m->mem.suspected[which] >= m->par.persistence + m->mem.suspected[1u - which]) {
        m->out.status.faulty |= 1u << which;
        m->out.status.unused |= out;
        forget(m);
        publish(m, t, SUN_PYRAMIDS_FAULTY, EVENT_HIGH, 1u << which, out);
    }
    return out;
}

void sun_pyramids_reset(SunPyramids *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

void sun_pyramids_update(SunPyramids *m, Tick t)
{
    SunView v;
    SunPyramidsStatus *status = &m->out.status;
    uint32_t used = sample(m, &v), single = 0u;
    const uint32_t of[2] = {used & 0x0Fu, used & 0xF0u};
    SunFit f = sun_fit(&v, used);
    const int whole = f.misfit <= m->par.differ;
    m->mem.dimmed = whole || f.dimmed > m->par.differ ? 0u : m->mem.dimmed + 1u;
    const int sound = whole || (m->mem.dimmed > 0u && m->mem.dimmed <= m->par.persistence);
    status->suspects = 0u;
    if (sound) {
        m->mem.lit = whole ? v.lit : m->mem.lit;
        if (++m->mem.sound >= m->par.persistence) {
            forget(m);
        }
    } else {
        const uint32_t which = blame(m, &v, of, &single);
        status->suspects = which < 2u ? 1u << which : 3u;
        m->mem.sound = 0u;
        if (which < 2u) {
            used &= ~count(m, t.t, which, single & of[which]);
        } else {
            used = (v.lit & of[0]) == 0u ? of[1] : (v.lit & of[1]) == 0u ? of[0] : 0u;
        }
        f = sun_fit(&v, used);
        const int lasts = status->unresolved >= m->par.persistence;
        used = which < 2u || (lasts && f.rank >= 2 && f.misfit <= m->par.differ) ? used : 0u;
    }
    status->unresolved = status->suspects == 3u ? status->unresolved + 1u : 0u;
    if (status->unresolved == m->par.persistence) {
        forget(m);
        publish(m, t.t, SUN_PYRAMIDS_UNRESOLVED, EVENT_MEDIUM, 0.0, 0.0);
    }
    Quality quality = QUALITY_GOOD;
    for (uint32_t k = 0u; k < 2u; k++) {
        const Head head = k == 0u ? m->in.a.head : m->in.b.head;
        quality = (used >> k * SUN_PYRAMID & 0x0Fu) != 0u ? quality_min(quality, quality_through(head)) : quality;
    }
    status->head = head_next(status->head, t.t, used != 0u ? quality : QUALITY_DEGRADED);
    if (used != 0u) {
        m->out.cosines = sun_cosines(&v, SUN_SENSORS_MAX, v.lit & used, head_next(m->out.cosines.head, t.t, quality));
    } else {
        m->out.cosines.head = head_held(m->out.cosines.head);
    }
    /* undecided: a guard; no inputs are known at which this alone is not finite */
    if (used != 0u && f.rank >= 2 && f.misfit <= m->par.differ && vec_finite(f.s_B)) {
        quality = quality_min(quality, sound ? QUALITY_GOOD : QUALITY_DEGRADED);
        m->out.heading = (SunHeading){head_next(m->out.heading.head, t.t, quality), f.s_B};
    } else {
        m->out.heading.head = head_held(m->out.heading.head);
    }
}
