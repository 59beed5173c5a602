/* SPDX-License-Identifier: Apache-2.0 */
/* The derivatives of the axes in N follow by differentiating products and directions.
 *
 * Where the bodies are collinear, r1 alone moves the reference: omega = r1 x dr1 and
 * domega = r1 x ddr1 have no part about r1. So r2 is transported parallel along the path of r1 on the unit sphere. From
 * a to b, along a great circle, this is
 *     r2 - (b . r2) / (1 + a . b) (a + b),
 * and along the path, r2 turns about b by as much more as the area between path and great circle. With the cubic
 * through both ends and their rates, over a time h and seen along a + b, this area is
 *     m . (h (b - a) x (da - db) / 10 + h^2 da x db / 60),   m along a + b,
 * on the left of the great circle, which turns r2 backwards. The error after a given time is of order h^4. */
#include "flight/guidance/two_body_pointing.h"

#include <string.h>

#include "flight/math/attitude.h"

/* sin^2 of the angle between r1 and the last r2 below which the last r2 does not define the next one. */
static const double PARALLEL = 1e-24;

/* A vector with its first and second derivative in N. */
typedef struct Moving {
    Vec3 x, dx, ddx;
} Moving;

static Moving from_craft(const NavOrbit *craft, const BodyState *body)
{
    return (Moving){vec_sub(body->r_PN_N, craft->r_BN_N), vec_sub(body->v_PN_N, craft->v_BN_N),
                    vec_sub(body->a_PN_N, craft->a_BN_N)};
}

static Moving moving_cross(Moving a, Moving b)
{
    Vec3 twice = vec_scale(2.0, vec_cross(a.dx, b.dx));
    return (Moving){vec_cross(a.x, b.x), vec_add(vec_cross(a.dx, b.x), vec_cross(a.x, b.dx)),
                    vec_add(vec_add(vec_cross(a.ddx, b.x), twice), vec_cross(a.x, b.ddx))};
}

/* u = x / n with n = |x|: from x = n u, dn = u . dx and ddn = u . ddx + du . dx. */
static Moving moving_unit(Moving a)
{
    double n = vec_norm(a.x);
    Vec3 u = vec_scale(1.0 / n, a.x);
    double dn = vec_dot(u, a.dx);
    Vec3 du = vec_scale(1.0 / n, vec_sub(a.dx, vec_scale(dn, u)));
    double ddn = vec_dot(u, a.ddx) + vec_dot(du, a.dx);
    Vec3 rest = vec_add(vec_scale(2.0 * dn, du), vec_scale(ddn, u));
    return (Moving){u, du, vec_scale(1.0 / n, vec_sub(a.ddx, rest))};
}

/* Gives r2. */
static Vec3 point_at_both(Moving r1, Moving normal, AttReference *reference)
{
    Moving r3 = moving_unit(normal);
    Moving r2 = moving_cross(r3, r1);
    Vec3 omega = vec_add(vec_cross(r1.x, r1.dx), vec_add(vec_cross(r2.x, r2.dx), vec_cross(r3.x, r3.dx)));
    Vec3 domega = vec_add(vec_cross(r1.x, r1.ddx), vec_add(vec_cross(r2.x, r2.ddx), vec_cross(r3.x, r3.ddx)));
    reference->sigma_RN = dcm_to_mrp(mat_rows(r1.x, r2.x, r3.x));
    reference->omega_RN_N = vec_scale(0.5, omega);
    reference->domega_RN_N = vec_scale(0.5, domega);
    return r2.x;
}

/* [rad] The angle by which r2 turns back because r1 did not move from a to b along the great circle. The chord and the
 * rates at its ends give the time, so that inputs may come at any rate. 0 where r1 jumped. */
static double turn_back(Vec3 a, Vec3 da, Vec3 b, Vec3 db)
{
    Vec3 chord = vec_sub(b, a);
    double c2 = vec_norm2(chord);
    double h = c2 / (0.5 * vec_dot(chord, vec_add(da, db)));
    Vec3 area =
        vec_add(vec_scale(h / 10.0, vec_cross(chord, vec_sub(da, db))), vec_scale(h * h / 60.0, vec_cross(da, db)));
    double angle = vec_dot(vec_unit(vec_add(a, b)), area);
    return h > 0.0 && c2 < 0.01 && fm_abs(angle) < c2 ? angle : 0.0; /* so is a NaN refused */
}

/* r2 of r1.x, transported from the last one. */
static Vec3 transported(const TwoBodyPointing *m, Moving r1)
{
    Vec3 a = m->mem.r1_N, b = r1.x, last = m->mem.r2_N;
    double opposite = 1.0 + vec_dot(a, b);
    if (!(opposite > 1e-6)) {
        return last; /* any great circle leads to b */
    }
    Vec3 r2 = vec_sub(last, vec_scale(vec_dot(b, last) / opposite, vec_add(a, b)));
    double s, c;
    fm_sincos(turn_back(a, m->mem.dr1_N, b, r1.dx), &s, &c);
    return vec_sub(vec_scale(c, r2), vec_scale(s, vec_cross(b, r2)));
}

/* r1 alone, with r2 carried along from the last. Gives r2. */
static Vec3 point_at_primary(Moving r1, Vec3 last, AttReference *reference)
{
    Vec3 n = vec_cross(r1.x, last);
    Vec3 r3 = vec_unit(vec_norm2(n) > PARALLEL ? n : vec_cross(r1.x, vec_far_axis(r1.x)));
    Vec3 r2 = vec_cross(r3, r1.x);
    reference->sigma_RN = dcm_to_mrp(mat_rows(r1.x, r2, r3));
    reference->omega_RN_N = vec_cross(r1.x, r1.dx);
    reference->domega_RN_N = vec_cross(r1.x, r1.ddx);
    return r2;
}

/* 0 if the result is not finite. */
static int point(const TwoBodyPointing *m, AttReference *reference, TwoBodyStatus *status, Moving *r1, Vec3 *r2_N)
{
    Moving R_1 = from_craft(&m->in.orbit, &m->in.primary);
    Moving R_2 = from_craft(&m->in.orbit, &m->in.secondary);
    Moving normal = moving_cross(R_1, R_2);
    int finite = 1;

    status->secondary = SECONDARY_ABSENT;
    status->separation = 0.0;
    status->spare = 0;
    if (head_written(m->in.secondary.head)) {
        double least = fm_sin(m->par.separation_min);
        double limit = least * least * vec_norm2(R_1.x) * vec_norm2(R_2.x);
        int apart = vec_norm2(normal.x) > limit;
        status->secondary = apart ? SECONDARY_TRACKED : SECONDARY_COLLINEAR;
        status->separation = fm_atan2(vec_norm(normal.x), vec_dot(R_1.x, R_2.x));
        /* undecided: a guard; no inputs are known at which this alone is not finite */
        finite = isfinite(limit) && isfinite(status->separation);
    }
    *r1 = moving_unit(R_1);
    *r2_N = status->secondary == SECONDARY_TRACKED ? point_at_both(*r1, normal, reference)
                                                   : point_at_primary(*r1, transported(m, *r1), reference);
    return finite && vec_finite(reference->sigma_RN) && vec_finite(reference->omega_RN_N) &&
           vec_finite(reference->domega_RN_N);
}

void two_body_pointing_reset(TwoBodyPointing *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

void two_body_pointing_update(TwoBodyPointing *m, Tick t)
{
    Quality quality = quality_min(quality_through(m->in.orbit.head), quality_through(m->in.primary.head));
    quality = quality_min(quality, quality_optional(m->in.secondary.head));

    Moving r1;
    Vec3 r2_N;
    AttReference reference;
    TwoBodyStatus status;
    if (quality != QUALITY_NONE && point(m, &reference, &status, &r1, &r2_N)) {
        if (status.secondary != SECONDARY_TRACKED) {
            quality = QUALITY_DEGRADED;
        }
        reference.head = head_next(m->out.reference.head, t.t, quality);
        status.head = head_next(m->out.status.head, t.t, quality);
        m->out.reference = reference;
        m->out.status = status;
        m->mem.r1_N = r1.x;
        m->mem.dr1_N = r1.dx;
        m->mem.r2_N = r2_N;
    } else {
        m->out.reference.head = head_held(m->out.reference.head);
        m->out.status.head = head_held(m->out.status.head);
    }
}
