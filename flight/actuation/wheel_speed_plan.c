/* SPDX-License-Identifier: Apache-2.0 */
/* With S = sum J g g^T, the speeds g_i . S^+ h are those of the least energy, sum J Omega^2 / 2, that have the momentum
 * h = sum J Omega g. What is left of any speeds without them is a null motion.
 *
 * Each speed is linear in s, so the order of two plans changes only where a speed passes an edge of a band, or where
 * two speeds are of one size; and the least |s| is there, or 0. */
#include "flight/actuation/wheel_speed_plan.h"

#include <string.h>

#include "flight/actuation/allocation.h"

#define ROUNDING 1e-9 /* part of a speed by which it may miss an edge */
#define REACHED 1e-3  /* part of the largest element of d from which on the null motion reaches a wheel */

typedef struct Line {
    uint32_t n;
    uint32_t used;    /* available wheels, a bit for each */
    uint32_t reached; /* those that the null motion reaches */
    double base[WHEELS_MAX];
    double d[WHEELS_MAX];
} Line;

typedef struct Cost {
    double over;
    uint32_t in_band;
    uint32_t turned; /* wheels whose direction differs from that of the last plan, a bit for each */
    double depth;
    double effort;
} Cost;

static int has(uint32_t set, uint32_t i)
{
    return (int)(set >> i & 1u);
}

/* The wheels that turn backwards, a bit for each. */
static uint32_t backwards(const double *Omega)
{
    uint32_t set = 0u;
    for (uint32_t i = 0; i < WHEELS_MAX; i++) {
        set |= (uint32_t)(Omega[i] < 0.0) << i;
    }
    return set;
}

/* The speeds without their part of the least energy, of the same momentum. */
static void without_momentum(const WheelSet *wheels, uint32_t used, Mat3 inverse, const double *speeds, double *null)
{
    Vec3 h = vec3(0.0, 0.0, 0.0);
    for (uint32_t i = 0; i < wheels_count(wheels); i++) {
        if (has(used, i)) {
            h = vec_add(h, vec_scale(wheels->J[i] * speeds[i], wheels->axes_B[i]));
        }
    }
    const Vec3 y = mat_vec(inverse, h);
    for (uint32_t i = 0; i < wheels_count(wheels); i++) {
        null[i] = has(used, i) ? speeds[i] - vec_dot(wheels->axes_B[i], y) : 0.0;
    }
}

/* Omega_0 and d. Of two patterns of signs that are each other's negative, one is enough. */
static Line line_of(const WheelSpeedPlan *m)
{
    const WheelSet *wheels = &m->in.wheels;
    Line line = {wheels_count(wheels), 0u, 0u, {0.0}, {0.0}};
    Gram gram = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
    uint32_t count = 0u;
    for (uint32_t i = 0; i < line.n; i++) {
        if (may_use(m->in.availability.head, m->in.availability.available[i])) {
            line.used |= 1u << i;
            gram_add(&gram, vec_scale(fm_sqrt(wheels->J[i]), wheels->axes_B[i]));
            count++;
        }
    }
    int rank;
    const Mat3 inverse = gram_pinv(&gram, &rank);
    double null[WHEELS_MAX], best = 0.0;
    without_momentum(wheels, line.used, inverse, m->in.speeds.Omega, null);
    for (uint32_t i = 0; i < line.n; i++) {
        line.base[i] = m->in.speeds.Omega[i] - null[i];
        const Vec3 g = wheels->axes_B[i]; /* how far wheel i alone is a null motion */
        const double own = 1.0 - wheels->J[i] * vec_dot(g, mat_vec(inverse, g));
        line.reached |= has(line.used, i) && own > REACHED * REACHED ? 1u << i : 0u;
    }
    if (count <= (uint32_t)rank || line.reached == 0u) {
        line.reached = 0u;
        return line;
    }
    for (uint32_t pattern = 0; pattern < 1u << (line.n - 1u); pattern++) {
        double signs[WHEELS_MAX], least = INFINITY;
        for (uint32_t i = 0; i < line.n; i++) {
            signs[i] = has(pattern, i) ? -1.0 : 1.0;
        }
        without_momentum(wheels, line.used, inverse, signs, null);
        for (uint32_t i = 0; i < line.n; i++) {
            least = has(line.reached, i) && fm_abs(null[i]) < least ? fm_abs(null[i]) : least;
        }
        if (least > best) {
            best = least;
            memcpy(line.d, null, sizeof line.d);
        }
    }
    double most = 0.0, size = 0.0;
    Vec3 gained = vec3(0.0, 0.0, 0.0);
    for (uint32_t i = 0; i < line.n; i++) {
        most = fm_abs(line.d[i]) > most ? fm_abs(line.d[i]) : most;
        size += wheels->J[i] * fm_abs(line.d[i]);
        gained = vec_add(gained, vec_scale(wheels->J[i] * line.d[i], wheels->axes_B[i]));
    }
    const int is_null = vec_norm(gained) <= ROUNDING * size; /* not so of axes that only nearly lie in a plane */
    for (uint32_t i = 0; i < line.n; i++) {
        line.reached &= is_null && fm_abs(line.d[i]) > REACHED * most ? ~0u : ~(1u << i);
    }
    return line;
}

static Cost cost_of(const WheelSpeedPlan *m, const Line *line, double s)
{
    Cost cost = {0.0, 0u, 0u, 0.0, fm_abs(s)};
    const double wide = m->par.Omega_min + m->par.margin;
    for (uint32_t i = 0; i < line->n; i++) {
        const double Omega = line->base[i] + s * line->d[i], size = fm_abs(Omega);
        const double over = size / m->par.Omega_max - 1.0, depth = wide - size;
        if (has(line->used, i) && over > ROUNDING && over > cost.over) {
            cost.over = over;
        }
        if (has(line->reached, i)) {
            cost.in_band += size < m->par.Omega_min * (1.0 - ROUNDING);
            cost.turned |= (uint32_t)(Omega < 0.0) << i;
            cost.depth = depth > ROUNDING * wide && depth > cost.depth ? depth : cost.depth;
        }
    }
    cost.turned = (cost.turned ^ m->mem.backwards) & line->reached;
    return cost;
}

static int cheaper(Cost a, Cost b)
{
    if (a.over != b.over) {
        return a.over < b.over;
    }
    if (a.in_band != b.in_band) {
        return a.in_band < b.in_band;
    }
    if ((a.turned != 0u) != (b.turned != 0u)) {
        return a.turned == 0u;
    }
    return a.depth != b.depth ? a.depth < b.depth : a.effort < b.effort;
}

static void try_it(const WheelSpeedPlan *m, const Line *line, double s, double *best, Cost *least)
{
    const Cost cost = cost_of(m, line, s);
    if (isfinite(s) && cheaper(cost, *least)) {
        *best = s;
        *least = cost;
    }
}

/* The best s. */
static double search(const WheelSpeedPlan *m, const Line *line, Cost *least)
{
    const double edges[3] = {m->par.Omega_min, m->par.Omega_min + m->par.margin, m->par.Omega_max};
    double best = 0.0;
    *least = cost_of(m, line, best);
    for (uint32_t i = 0; i < line->n; i++) {
        for (uint32_t k = 0; k < 3u && has(line->reached, i); k++) {
            try_it(m, line, (edges[k] - line->base[i]) / line->d[i], &best, least);
            try_it(m, line, (-edges[k] - line->base[i]) / line->d[i], &best, least);
        }
        for (uint32_t j = 0; j < i && has(line->used, i); j++) {
            if (has(line->used, j)) {
                try_it(m, line, (line->base[j] - line->base[i]) / (line->d[i] - line->d[j]), &best, least);
                try_it(m, line, -(line->base[j] + line->base[i]) / (line->d[i] + line->d[j]), &best, least);
            }
        }
    }
    return best;
}

void wheel_speed_plan_reset(WheelSpeedPlan *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

/* How the wanted speeds stand to those of now. 0 if they have not the same momentum, or a number is not finite. */
static int compare(const WheelSpeedPlan *m, const Line *line, const double *wanted, WheelPlanState *state)
{
    int sound = isfinite(m->par.Omega_min + m->par.margin);
    double size = 0.0;
    Vec3 gained = vec3(0.0, 0.0, 0.0);
    state->margin = state->margin_wanted = 1.0;
    state->in_band = state->crossing = 0u;
    for (uint32_t i = 0; i < line->n; i++) {
        const double now = m->in.speeds.Omega[i], J = m->in.wheels.J[i];
        const double margin = 1.0 - fm_abs(now) / m->par.Omega_max;
        const double margin_wanted = 1.0 - fm_abs(wanted[i]) / m->par.Omega_max;
        if (has(line->used, i)) {
            sound = sound && J > 0.0 && isfinite(margin) && isfinite(margin_wanted);
            size += J * (fm_abs(now) + fm_abs(wanted[i]));
            gained = vec_add(gained, vec_scale(J * (wanted[i] - now), m->in.wheels.axes_B[i]));
            state->margin = margin < state->margin ? margin : state->margin;
            state->margin_wanted = margin_wanted < state->margin_wanted ? margin_wanted : state->margin_wanted;
            state->in_band += fm_abs(now) < m->par.Omega_min;
            state->crossing += (now < 0.0) != (wanted[i] < 0.0);
        }
    }
    return sound && isfinite(size) && vec_norm(gained) <= ROUNDING * size;
}

static WheelPlanPhase phase_of(const Line *line, const Cost *cost, uint32_t crossing)
{
    if (line->reached == 0u) {
        return WHEEL_PLAN_NONE;
    }
    if (cost->over > 0.0 || cost->in_band > 0u) {
        return WHEEL_PLAN_BOUND;
    }
    return crossing > 0u ? WHEEL_PLAN_CROSSES : WHEEL_PLAN_HOLDS;
}

void wheel_speed_plan_update(WheelSpeedPlan *m, Tick t)
{
    const double *Omega = m->in.speeds.Omega;
    Quality quality = quality_min(quality_through(m->in.wheels.head), quality_through(m->in.speeds.head));
    quality = quality_min(quality, quality_optional(m->in.availability.head));

    WheelSpeedPlan next = *m;
    if (next.mem.running == 0u) {
        next.mem.running = 1u;
        next.mem.backwards = backwards(Omega);
    }
    const Line line = line_of(m);
    Cost cost = {0.0, 0u, 0u, 0.0, 0.0};
    const double s = line.reached != 0u ? search(&next, &line, &cost) : 0.0;
    WheelPlanState *state = &next.out.state;
    double wanted[WHEELS_MAX] = {0.0}, seen[WHEELS_MAX] = {0.0};
    for (uint32_t i = 0; i < line.n; i++) {
        const int used = has(line.used, i);
        wanted[i] = !used ? 0.0 : line.reached != 0u ? line.base[i] + s * line.d[i] : Omega[i];
        seen[i] = used ? wanted[i] : Omega[i];
        state->crossings += (uint32_t)has(cost.turned, i);
    }
    next.mem.backwards = backwards(seen);
    if (compare(m, &line, wanted, state) && quality != QUALITY_NONE) {
        state->phase = phase_of(&line, &cost, state->crossing);
        state->head = head_next(state->head, t.t, quality);
        next.out.wanted.head = head_next(next.out.wanted.head, t.t, quality);
        memcpy(next.out.wanted.Omega, wanted, sizeof wanted);
        m->out = next.out;
        m->mem = next.mem;
    } else {
        m->out.state.head = head_held(m->out.state.head);
        m->out.wanted.head = head_held(m->out.wanted.head);
    }
}
