/* SPDX-License-Identifier: Apache-2.0 */
/* With unit axes n_i, cosines c_i and weights w_i, J(s) = sum w_i (c_i - n_i . s)^2 over lit sensors, and over dark
 * ones that s would light. Without |s| = 1, J is convex: its minimum is the start. On the unit sphere, Gauss-Newton
 * steps in the tangent plane go on from there; the pseudo-inverse takes the shortest where few sensors are lit. */
#include "flight/sensing/sun_pyramids.h"

#include <string.h>

#include "flight/math/mat.h"

/* Steps until both minima stand. */
#define STEPS 6

/* What the converters say. */
typedef struct View {
    double cosine[SUN_SENSORS_MAX];
    uint32_t lit;
} View;

/* What some of the sensors say. All dark: the rank 0, and no misfit. */
typedef struct Fit {
    Vec3 s_B;
    int rank;      /* of the lit sensors' axes */
    double misfit; /* of the nearest direction: the root of the sum of weighted squares */
    double dimmed; /* of a Sun that is evenly dimmed: this one, or that of the nearest vector below the length 1 */
} Fit;

static double weight(const SunPyramids *m, uint32_t i)
{
    return m->par.weight[i] > 0.0 ? m->par.weight[i] : 1.0;
}

static double rest(const SunPyramids *m, const View *v, uint32_t i, Vec3 s)
{
    const double cosine = vec_dot(vec_unit(m->par.axes_B[i]), s);
    if ((v->lit >> i & 1u) != 0u) {
        return v->cosine[i] - cosine;
    }
    const double reads = v->cosine[i] > 0.0 ? v->cosine[i] : 0.0;
    return cosine > reads ? reads - cosine : 0.0;
}

static double misfit(const SunPyramids *m, const View *v, uint32_t sensors, Vec3 s)
{
    double sum = 0.0;
    for (uint32_t i = 0u; i < SUN_SENSORS_MAX; i++) {
        const double r = (sensors >> i & 1u) != 0u ? rest(m, v, i, s) : 0.0;
        sum += weight(m, i) * r * r;
    }
    return fm_sqrt(sum);
}

static Vec3 step(const SunPyramids *m, const View *v, uint32_t sensors, Vec3 s, int on_sphere, int *rank)
{
    Mat3 S = {{{0.0}}};
    Vec3 sum = vec3(0.0, 0.0, 0.0);
    for (uint32_t i = 0u; i < SUN_SENSORS_MAX; i++) {
        const double r = rest(m, v, i, s), w = weight(m, i);
        if ((sensors >> i & 1u) == 0u || ((v->lit >> i & 1u) == 0u && r == 0.0)) {
            continue;
        }
        Vec3 n = vec_unit(m->par.axes_B[i]);
        n = on_sphere ? vec_sub(n, vec_scale(vec_dot(n, s), s)) : n;
        sum = vec_add(sum, vec_scale(w * r, n));
        for (int j = 0; j < 3; j++) {
            for (int k = 0; k < 3; k++) {
                S.m[j][k] += w * n.v[j] * n.v[k];
            }
        }
    }
    const Vec3 next = vec_add(s, mat_vec(mat_sym_pinv(S, rank), sum));
    return on_sphere ? vec_unit(next) : next;
}

static Fit fit(const SunPyramids *m, const View *v, uint32_t sensors)
{
    Fit f = {.rank = 0};
    int rank;
    if ((v->lit & sensors) == 0u) {
        return f;
    }
    Vec3 d = step(m, v, sensors, f.s_B, 0, &f.rank);
    for (int k = 1; k < STEPS; k++) {
        d = step(m, v, sensors, d, 0, &rank);
    }
    f.s_B = vec_unit(d);
    f.misfit = misfit(m, v, sensors, f.s_B);
    Vec3 s = f.s_B;
    for (int k = 0; k < STEPS; k++) { /* steps may go too far where a sensor faces the Sun */
        s = step(m, v, sensors, s, 1, &rank);
        const double next = misfit(m, v, sensors, s);
        f.s_B = next < f.misfit ? s : f.s_B;
        f.misfit = next < f.misfit ? next : f.misfit;
    }
    f.dimmed = vec_norm2(d) < 1.0 ? misfit(m, v, sensors, d) : f.misfit;
    return f;
}

/* Which sensors speak and are in use. */
static uint32_t look(SunPyramids *m, View *v)
{
    uint32_t used = 0u;
    v->lit = 0u;
    for (uint32_t which = 0u; which < 2u; which++) {
        const SunSensorCounts *in = which == 0u ? &m->in.a : &m->in.b;
        const uint32_t first = which * SUN_PYRAMID;
        const size_t size = SUN_PYRAMID * sizeof in->counts[0];
        m->mem.still[which] = memcmp(m->mem.counts + first, in->counts, size) == 0 ? m->mem.still[which] + 1u : 0u;
        memcpy(m->mem.counts + first, in->counts, size);
        for (uint32_t i = first; i < first + SUN_PYRAMID; i++) {
            v->cosine[i] = (m->par.offset[which] + m->par.scale[which] * in->counts[i - first]) / m->par.current[i];
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
static uint32_t blame(SunPyramids *m, const View *v, const uint32_t of[2], uint32_t *single)
{
    const double limit = m->par.differ;
    Fit own[2];
    int dark[2], shown[2] = {0}, possible[2] = {0};
    *single = 0u;
    for (uint32_t k = 0u; k < 2u; k++) {
        own[k] = fit(m, v, of[k]);
        dark[k] = (v->lit & of[k]) == 0u;
        for (uint32_t i = 0u; i < SUN_SENSORS_MAX; i++) {
            if ((of[k] >> i & 1u) != 0u) {
                const double others = fit(m, v, (of[0] | of[1]) & ~(1u << i)).misfit;
                *single |= others <= limit ? 1u << i : 0u;
                possible[k] = possible[k] || others <= 2.0 * limit;
            }
        }
    }
    m->mem.lit = dark[0] || dark[1] ? m->mem.lit : 0u;
    for (uint32_t k = 0u; k < 2u; k++) {
        const Fit witness = own[1u - k];
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

static void say(SunPyramids *m, int64_t t, SunPyramidsEventId id, EventSeverity severity, double which, double sensors)
{
    event_say(&m->out.event, t, (FlightEvent){.id = id, .severity = severity, .arguments = {which, sensors}});
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
        say(m, t, SUN_PYRAMIDS_FAULTY, EVENT_HIGH, 1u << which, out);
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
    View v;
    SunPyramidsStatus *status = &m->out.status;
    uint32_t used = look(m, &v), single = 0u;
    const uint32_t of[2] = {used & 0x0Fu, used & 0xF0u};
    Fit f = fit(m, &v, used);
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
        f = fit(m, &v, used);
        const int lasts = status->unresolved >= m->par.persistence;
        used = which < 2u || (lasts && f.rank >= 2 && f.misfit <= m->par.differ) ? used : 0u;
    }
    status->unresolved = status->suspects == 3u ? status->unresolved + 1u : 0u;
    if (status->unresolved == m->par.persistence) {
        forget(m);
        say(m, t.t, SUN_PYRAMIDS_UNRESOLVED, EVENT_MEDIUM, 0.0, 0.0);
    }
    Quality quality = QUALITY_GOOD;
    for (uint32_t k = 0u; k < 2u; k++) {
        const Head head = k == 0u ? m->in.a.head : m->in.b.head;
        quality = (used >> k * SUN_PYRAMID & 0x0Fu) != 0u ? quality_min(quality, quality_through(head)) : quality;
    }
    status->head = head_next(status->head, t.t, used != 0u ? quality : QUALITY_DEGRADED);
    if (used != 0u) {
        SunCosines *cosines = &m->out.cosines;
        *cosines = (SunCosines){.head = head_next(cosines->head, t.t, quality), .n = SUN_SENSORS_MAX};
        cosines->lit = v.lit & used;
        for (uint32_t i = 0u; i < SUN_SENSORS_MAX; i++) {
            cosines->cosine[i] = v.cosine[i];
            cosines->weight[i] = weight(m, i);
            cosines->axes_B[i] = vec_unit(m->par.axes_B[i]);
        }
    } else {
        m->out.cosines.head = head_held(m->out.cosines.head);
    }
    if (used != 0u && f.rank >= 2 && f.misfit <= m->par.differ && vec_finite(f.s_B)) {
        quality = quality_min(quality, sound ? QUALITY_GOOD : QUALITY_DEGRADED);
        m->out.heading = (SunHeading){head_next(m->out.heading.head, t.t, quality), f.s_B};
    } else {
        m->out.heading.head = head_held(m->out.heading.head);
    }
}
