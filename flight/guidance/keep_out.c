/* SPDX-License-Identifier: Apache-2.0 */
/* In the frame A where a turn about e begins, a direction s that rests in N moves, seen from the body, as
 *     s(x) = (e . s) e + cos x (s - (e . s) e) - sin x e x s.
 * Its product with a boresight, on x up to pi, has a maximum inside only if it rises at the start and falls at the
 * end. A turn by nearly pi may go either way round, so there the whole circle counts. */
#include "flight/guidance/keep_out.h"

#include <string.h>

#include "flight/guidance/attitude_jump.h"

enum { KEEP_OUT_GOES = 0, KEEP_OUT_STAYS = 1, KEEP_OUT_ESCAPES = 2 }; /* modes */

#define BODIES 2
#define RINGS 3   /* of way-points around a body */
#define AROUND 12 /* way-points on a ring, and turns about the direction of the body */
#define WAYS (RINGS * AROUND + 2 * (AROUND - 1))
#define SLACK 1e-9     /* of a cosine, for rounding */
#define HALF_TURN 0.02 /* cosine of half a turn below which it may go either way round: within 2.3 degrees of 180 */
#define LONG 0.5       /* [rad] by which a way by one way-point may be longer than the turn before two are tried */
#define PI 3.14159265358979323846

/* What a way keeps out of. */
typedef struct Cones {
    uint32_t boresights, bodies;
    Vec3 c_B[KEEP_OUT_BORESIGHTS];
    Vec3 s_N[BODIES];
    double limit[KEEP_OUT_BORESIGHTS][BODIES]; /* largest allowed cosines */
} Cones;

/* The pair that exceeds its limit most, and by how much. */
typedef struct Nearest {
    double excess;
    uint32_t boresight, body;
} Nearest;

void keep_out_reset(KeepOut *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

static double half_angle(const KeepOut *m, uint32_t body)
{
    return body == 0u ? m->par.first_angle : m->par.second_angle;
}

/* 0 if a direction is missing. */
static int see(const KeepOut *m, Cones *cones)
{
    const BodyState *body[BODIES] = {&m->in.first, &m->in.second};
    const Vec3 here = head_written(m->in.orbit.head) ? m->in.orbit.r_BN_N : vec3(0.0, 0.0, 0.0);
    int seen = 1;
    memset(cones, 0, sizeof *cones);
    cones->boresights = m->par.n < KEEP_OUT_BORESIGHTS ? m->par.n : KEEP_OUT_BORESIGHTS;
    cones->bodies = head_written(m->in.second.head) && m->par.second_angle > 0.0 ? 2u : 1u;
    for (uint32_t b = 0; b < cones->bodies; b++) {
        cones->s_N[b] = vec_unit(vec_sub(body[b]->r_PN_N, here));
        seen = seen && fm_abs(vec_norm2(cones->s_N[b]) - 1.0) < 1e-6;
    }
    for (uint32_t k = 0; k < cones->boresights; k++) {
        cones->c_B[k] = vec_unit(m->par.boresights_B[k]);
        seen = seen && fm_abs(vec_norm2(cones->c_B[k]) - 1.0) < 1e-6;
    }
    return seen;
}

/* Limits by the half angles and a margin. */
static void limit(const KeepOut *m, Cones *cones, double margin)
{
    for (uint32_t b = 0; b < cones->bodies; b++) {
        const double angle = half_angle(m, b) + margin;
        for (uint32_t k = 0; k < cones->boresights; k++) {
            cones->limit[k][b] = fm_cos(angle > PI ? PI : angle) + SLACK;
        }
    }
}

/* 1 if the limits hold in an attitude; else they become what holds there. */
static int relax(Cones *cones, Vec3 sigma)
{
    int held = 1;
    for (uint32_t k = 0; k < cones->boresights; k++) {
        for (uint32_t b = 0; b < cones->bodies; b++) {
            const double at = vec_dot(cones->c_B[k], mat_vec(mrp_to_dcm(sigma), cones->s_N[b])) + SLACK;
            held = held && at - SLACK <= cones->limit[k][b];
            cones->limit[k][b] = at > cones->limit[k][b] ? at : cones->limit[k][b];
        }
    }
    return held;
}

/* The turn from A to Z: how far it exceeds the limits. */
static Nearest turn(const Cones *cones, Vec3 sigma_AN, Vec3 sigma_ZN)
{
    const Quat q = mrp_to_quat(mrp_relative(sigma_ZN, sigma_AN));
    const Vec3 v = vec3(q.q[1], q.q[2], q.q[3]), e = vec_unit(v);
    const double half = vec_norm(v), c = 1.0 - 2.0 * half * half, s = 2.0 * half * q.q[0];
    const int either = q.q[0] < HALF_TURN; /* way round */
    const Mat3 AN = mrp_to_dcm(sigma_AN);
    Nearest nearest = {-INFINITY, 0u, 0u};
    for (uint32_t b = 0; b < cones->bodies; b++) {
        const Vec3 s_A = mat_vec(AN, cones->s_N[b]), across = vec_cross(s_A, e);
        for (uint32_t k = 0; k < cones->boresights; k++) {
            const double start = vec_dot(cones->c_B[k], s_A);
            const double along = vec_dot(e, s_A) * vec_dot(e, cones->c_B[k]);
            const double cosine_part = start - along, sine_part = vec_dot(cones->c_B[k], across);
            double most = along + cosine_part * c + sine_part * s;
            most = most > start ? most : start;
            if (either || (sine_part > 0.0 && sine_part * c - cosine_part * s < 0.0)) {
                most = along + fm_sqrt(cosine_part * cosine_part + sine_part * sine_part);
            }
            const double excess = most - cones->limit[k][b];
            if (!(excess <= nearest.excess)) { /* so that a NaN is not free */
                nearest = (Nearest){excess, k, b};
            }
        }
    }
    return nearest;
}

static int is_free(const Cones *cones, Vec3 sigma_AN, Vec3 sigma_ZN)
{
    return turn(cones, sigma_AN, sigma_ZN).excess <= 0.0;
}

static double length_of(Vec3 sigma_AN, Vec3 sigma_ZN)
{
    return mrp_angle(mrp_relative(sigma_ZN, sigma_AN));
}

/* Way-points to choose from; least [rad]: radius of the rings. */
static void choices(const Cones *cones, Nearest nearest, double least, Vec3 a, Vec3 z, Vec3 ways[WAYS])
{
    const Vec3 s_N = cones->s_N[nearest.body], c_B = cones->c_B[nearest.boresight];
    const Vec3 rel = mrp_relative(z, a);
    const Vec3 middle = mrp_compose(mrp_turn(vec_scale(0.5 * mrp_angle(rel), vec_unit(rel))), a);
    const Mat3 MN = mrp_to_dcm(middle);
    const Vec3 s_M = mat_vec(MN, s_N);
    /* In the plane across s: towards the boresight in the middle, and on. */
    const Vec3 away = vec_sub(c_B, vec_scale(vec_dot(c_B, s_M), s_M));
    const Vec3 x = vec_unit(vec_norm2(away) > 1e-12 ? away : vec_cross(s_M, vec_far_axis(s_M)));
    const Vec3 y = vec_cross(s_M, x);
    uint32_t n = 0u;
    for (uint32_t i = 0; i < AROUND; i++) {
        double sine, cosine_of;
        const double azimuth = 2.0 * PI * (double)i / AROUND;
        fm_sincos(azimuth, &sine, &cosine_of);
        const Vec3 out = vec_add(vec_scale(cosine_of, x), vec_scale(sine, y));
        for (uint32_t ring = 0; ring < RINGS; ring++) {
            const double part = ring == 0u ? 0.02 : ring == 1u ? 0.12 : 0.3;
            double sr, cr;
            fm_sincos(least + part * (PI - least), &sr, &cr);
            const Vec3 p = vec_add(vec_scale(cr, s_M), vec_scale(sr, out));
            /* The turn of the frame that carries c to p. */
            const double twice = 1.0 + vec_dot(c_B, p);
            ways[n++] = mrp_compose(mrp_project(twice, vec_cross(c_B, p), fm_sqrt(2.0 * twice)), middle);
        }
        if (i > 0u) {
            const Vec3 about = mrp_turn(vec_scale(azimuth - (azimuth > PI ? 2.0 * PI : 0.0), s_N));
            ways[n++] = mrp_compose(a, about);
            ways[n++] = mrp_compose(z, about);
        }
    }
}

/* Fills the way-points of the shortest way from A to Z that was found. 0: none was. */
static int search(KeepOut *m, const Cones *cones, Vec3 a, Vec3 z)
{
    Vec3 ways[WAYS];
    double first[WAYS] = {0.0}, last[WAYS] = {0.0}, best = INFINITY;
    m->mem.next = m->mem.points = 0u;
    const Nearest nearest = turn(cones, a, z);
    if (nearest.excess <= 0.0) {
        return 1;
    }
    choices(cones, nearest, half_angle(m, nearest.body) + m->par.margin, a, z, ways);
    for (uint32_t i = 0; i < WAYS; i++) {
        first[i] = is_free(cones, a, ways[i]) ? length_of(a, ways[i]) : INFINITY;
        last[i] = is_free(cones, ways[i], z) ? length_of(ways[i], z) : INFINITY;
        if (first[i] + last[i] < best) {
            best = first[i] + last[i];
            m->mem.sigma_WN[0] = ways[i];
            m->mem.points = 1u;
        }
    }
    const double fair = length_of(a, z) + LONG;
    for (uint32_t i = 0; i < WAYS && best > fair; i++) {
        for (uint32_t j = 0; j < WAYS; j++) {
            const double rest = first[i] + last[j];
            if (rest < best && rest + length_of(ways[i], ways[j]) < best && is_free(cones, ways[i], ways[j])) {
                best = rest + length_of(ways[i], ways[j]);
                m->mem.sigma_WN[0] = ways[i];
                m->mem.sigma_WN[1] = ways[j];
                m->mem.points = 2u;
            }
        }
    }
    return m->mem.points != 0u;
}

/* Out of a cone, to where the limits hold, on a turn that goes no deeper. 0: there is none. */
static int escape(KeepOut *m, const Cones *strict, Vec3 a)
{
    Vec3 ways[WAYS];
    double best = INFINITY;
    Cones relaxed = *strict;
    (void)relax(&relaxed, a);
    const Nearest nearest = turn(strict, a, a);
    choices(strict, nearest, half_angle(m, nearest.body) + m->par.margin, a, a, ways);
    for (uint32_t i = 0; i < WAYS; i++) {
        if (is_free(&relaxed, a, ways[i]) && is_free(strict, ways[i], ways[i]) && length_of(a, ways[i]) < best) {
            best = length_of(a, ways[i]);
            m->mem.sigma_WN[0] = ways[i];
        }
    }
    m->mem.next = 0u;
    m->mem.points = isfinite(best) ? 1u : 0u;
    return m->mem.points != 0u;
}

/* A new way. */
static void plan(KeepOut *m, Cones *cones, int inside)
{
    const Vec3 a = m->in.attitude.sigma_BN, z = m->in.target.sigma_RN;
    const int stayed = m->mem.mode == KEEP_OUT_STAYS;
    m->mem.mode = KEEP_OUT_GOES;
    m->mem.points = m->mem.next = 0u;
    m->out.status.plans++;
    limit(m, cones, m->par.margin);
    if (inside) {
        Cones relaxed = *cones;
        (void)relax(&relaxed, a);
        (void)relax(&relaxed, z);
        if (!is_free(&relaxed, a, z) && escape(m, cones, a)) {
            m->mem.mode = KEEP_OUT_ESCAPES;
        }
        return;
    }
    (void)relax(cones, a);
    (void)relax(cones, z);
    const Vec3 before = m->mem.sigma_WN[0];
    if (!search(m, cones, a, z)) {
        m->mem.mode = KEEP_OUT_STAYS;
        m->mem.sigma_WN[0] = stayed ? before : a;
        m->mem.points = 1u;
    }
}

/* Whether the way that is left is free; its length. */
static int way_left(const KeepOut *m, const Cones *cones, double *length)
{
    Vec3 here = m->in.attitude.sigma_BN;
    int all_free = 1;
    *length = 0.0;
    for (uint32_t i = m->mem.next; i <= m->mem.points; i++) {
        const Vec3 there = i < m->mem.points ? m->mem.sigma_WN[i] : m->in.target.sigma_RN;
        all_free = all_free && is_free(cones, here, there);
        *length += length_of(here, there);
        here = there;
    }
    return all_free;
}

/* [rad] The least angle of the way that is left from a cone; NaN if any is. */
static double clearance(const KeepOut *m, const Cones *cones)
{
    double least = INFINITY, sum = 0.0;
    for (uint32_t k = 0; k < cones->boresights; k++) {
        for (uint32_t b = 0; b < cones->bodies; b++) {
            const Cones cone = {1u, 1u, {cones->c_B[k]}, {cones->s_N[b]}, {{0.0}}};
            double most = -1.0;
            Vec3 here = m->in.attitude.sigma_BN;
            for (uint32_t i = m->mem.next; i <= m->mem.points; i++) {
                const Vec3 there = i < m->mem.points ? m->mem.sigma_WN[i] : m->in.target.sigma_RN;
                const double nearest = turn(&cone, here, there).excess;
                most = nearest > most ? nearest : most;
                sum += nearest;
                here = there;
            }
            const double angle = fm_acos(fm_clamp(most, 1.0)) - half_angle(m, b);
            least = angle < least ? angle : least;
            sum += angle;
        }
    }
    return isfinite(sum) ? least : (double)NAN;
}

/* Goes on with the way, or makes a new one. */
static KeepOutResult lead(KeepOut *m, Cones *cones, int jumped, double *length)
{
    const Vec3 a = m->in.attitude.sigma_BN;
    limit(m, cones, 0.0);
    Cones of_target = *cones;
    const int ends_inside = !relax(&of_target, m->in.target.sigma_RN), starts_inside = !relax(cones, a);
    if (ends_inside) {
        m->mem.mode = KEEP_OUT_GOES;
        m->mem.points = m->mem.next = 0u;
        (void)way_left(m, cones, length);
        return KEEP_OUT_TARGET_INSIDE;
    }
    if (m->mem.mode != KEEP_OUT_STAYS && m->mem.next < m->mem.points &&
        length_of(a, m->mem.sigma_WN[m->mem.next]) <= m->par.reached) {
        m->mem.next++;
        jumped = jumped || m->mem.mode == KEEP_OUT_ESCAPES;
        m->mem.mode = KEEP_OUT_GOES;
    }
    if (m->mem.mode != KEEP_OUT_ESCAPES && (jumped || m->mem.mode == KEEP_OUT_STAYS || !way_left(m, cones, length))) {
        plan(m, cones, starts_inside);
    }
    (void)way_left(m, cones, length);
    return starts_inside || m->mem.mode == KEEP_OUT_ESCAPES ? KEEP_OUT_START_INSIDE
           : m->mem.mode == KEEP_OUT_STAYS                  ? KEEP_OUT_NO_PATH
           : m->mem.next < m->mem.points                    ? KEEP_OUT_DETOUR
                                                            : KEEP_OUT_CLEAR;
}

/* 0 if a number is not finite. */
static int lead_or_stay(KeepOut *m, Cones *cones)
{
    const AttReference *target = &m->in.target;
    AttReference *way = &m->out.way;
    KeepOutStatus *status = &m->out.status;
    const int jumped = m->mem.running == 0u || attitude_jump(&m->mem.last, target) > m->par.jump;
    status->result = lead(m, cones, jumped, &status->length);
    status->direct = length_of(m->in.attitude.sigma_BN, target->sigma_RN);
    status->clearance = clearance(m, cones);
    status->points = m->mem.points - m->mem.next;
    m->mem.last = *target;
    m->mem.running = 1u;
    *way = *target;
    if (m->mem.next < m->mem.points) {
        way->sigma_RN = m->mem.sigma_WN[m->mem.next];
        way->omega_RN_N = way->domega_RN_N = vec3(0.0, 0.0, 0.0);
    }
    /* undecided: a guard; no inputs are known at which this alone is not finite */
    return isfinite(status->clearance) && isfinite(status->length) && isfinite(status->direct);
}

/* open way: a way-point that is not finite is not free, and so none that is gone to */
void keep_out_update(KeepOut *m, Tick t)
{
    KeepOut next = *m;
    const AttReference *target = &next.in.target;
    Quality quality = quality_min(quality_through(m->in.target.head), quality_through(m->in.attitude.head));
    quality = quality_min(quality, quality_through(m->in.first.head));
    quality = quality_min(quality, quality_optional(m->in.second.head));
    quality = quality_min(quality, quality_optional(m->in.orbit.head));

    Cones cones;
    if (quality != QUALITY_NONE && vec_finite(target->sigma_RN) && vec_finite(target->omega_RN_N) &&
        vec_finite(target->domega_RN_N) && see(m, &cones) && lead_or_stay(&next, &cones)) {
        const KeepOutResult result = next.out.status.result;
        const int kept = result == KEEP_OUT_CLEAR || result == KEEP_OUT_DETOUR;
        quality = quality_min(quality, kept ? QUALITY_GOOD : QUALITY_DEGRADED);
        next.out.way.head = head_next(m->out.way.head, t.t, quality);
        next.out.status.head = head_next(m->out.status.head, t.t, quality);
        m->out = next.out;
        m->mem = next.mem;
    } else {
        m->out.way.head = head_held(m->out.way.head);
        m->out.status.head = head_held(m->out.status.head);
    }
}
