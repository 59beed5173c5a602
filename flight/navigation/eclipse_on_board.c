/* SPDX-License-Identifier: Apache-2.0 */
/* On the ellipse, x further in eccentric anomaly than now, with n = sqrt(mu / a^3), s = r . v / sqrt(mu a):
 *     n t = x - (1 - r / a) sin x + s (1 - cos x)
 *     r(x) = (1 - a / r (1 - cos x)) r + (s (1 - cos x) + r / a sin x) / n v. */
#include "flight/navigation/eclipse_on_board.h"

#include <string.h>

#define ECLIPSE_SUN 695700e3 /* [m] */

enum { ECLIPSE_PLACES = 128, ECLIPSE_HALVINGS = 24 };

/* A motion without forces, in the space in which the body is a sphere. */
typedef struct Line {
    Vec3 r;
    Vec3 v;
} Line;

/* The spacecraft's ellipse, in the same space. */
typedef struct Ellipse {
    Line now;
    double a, n, ratio, s; /* ratio: r / a */
} Ellipse;

void eclipse_on_board_reset(EclipseOnBoard *m)
{
    memset(&m->out, 0, sizeof m->out);
}

static Vec3 line_at(Line line, double t)
{
    return vec_add(line.r, vec_scale(t, line.v));
}

/* [s] until the anomaly has grown by that of s and c, and where the spacecraft is then. */
static double ellipse_at(const Ellipse *e, double x, double s, double c, Vec3 *r)
{
    const double f = 1.0 - (1.0 - c) / e->ratio, g = (e->s * (1.0 - c) + e->ratio * s) / e->n;
    *r = vec_add(vec_scale(f, e->now.r), vec_scale(g, e->now.v));
    return (x - (1.0 - e->ratio) * s + e->s * (1.0 - c)) / e->n;
}

/* The phase at r, with the Sun at sun, both relative to a sphere of radius R. */
static ShadowPhase phase_at(Vec3 r, Vec3 sun, double R)
{
    const double D = vec_norm(sun), along = -vec_dot(r, sun) / D;
    const double across = vec_norm(vec_cross(r, sun)) / D;
    const double u = (ECLIPSE_SUN - R) / D, p = (ECLIPSE_SUN + R) / D;
    if (along > R * u && across * fm_sqrt(1.0 - u * u) + along * u <= R) {
        return SHADOW_UMBRA;
    }
    return along > -R * p && across * fm_sqrt(1.0 - p * p) - along * p < R ? SHADOW_PENUMBRA : SHADOW_SUNLIT;
}

/* The part of the Sun's disc that is seen from the penumbra: less a segment of each of two circles. */
static double lit_part(Vec3 r, Vec3 sun, double R)
{
    const Vec3 to_sun = vec_sub(sun, r);
    const double apart = vec_angle(to_sun, vec_neg(r));
    const double a = fm_asin(ECLIPSE_SUN / vec_norm(to_sun)), b = fm_asin(R / vec_norm(r));
    const double x = (apart * apart + a * a - b * b) / (2.0 * apart), y2 = a * a - x * x;
    if (apart <= a - b) {
        return 1.0 - b * b / (a * a);
    }
    /* undecided: a guard of the root, against roundings */
    const double y = fm_sqrt(y2 > 0.0 ? y2 : 0.0);
    const double area = a * a * fm_atan2(y, x) + b * b * fm_atan2(y, apart - x) - apart * y;
    return 1.0 - area / (3.141592653589793 * a * a);
}

/* [s] Until the phase on the ellipse is another one than now; 0: on it, it is not. */
static double next_change(const Ellipse *e, Line sun, Line body, double R, ShadowPhase now)
{
    const double step = 6.283185307179586 / (double)ECLIPSE_PLACES;
    double x = 0.0, t = 0.0, s, c;
    Vec3 r;
    int found = 0;
    for (int k = 1; k <= ECLIPSE_PLACES && !found; k++) {
        x = step * k;
        fm_sincos(x, &s, &c);
        t = ellipse_at(e, x, s, c, &r);
        found = phase_at(vec_sub(r, line_at(body, t)), vec_sub(line_at(sun, t), line_at(body, t)), R) != now;
    }
    double before = x - step;
    for (int k = 0; k < ECLIPSE_HALVINGS && found; k++) {
        const double middle = 0.5 * (before + x);
        fm_sincos(middle, &s, &c);
        t = ellipse_at(e, middle, s, c, &r);
        if (phase_at(vec_sub(r, line_at(body, t)), vec_sub(line_at(sun, t), line_at(body, t)), R) != now) {
            x = middle;
        } else {
            before = middle;
        }
    }
    return found ? t : 0.0;
}

static Line stretched(double by, Vec3 r, Vec3 v)
{
    return (Line){vec3(r.v[0], r.v[1], by * r.v[2]), vec3(v.v[0], v.v[1], by * v.v[2])};
}

void eclipse_on_board_update(EclipseOnBoard *m, Tick t)
{
    const double mu = m->par.mu, R = m->par.radius, pole = 1.0 / (1.0 - m->par.flattening);
    const Vec3 r_N = m->in.orbit.r_BN_N, v_N = m->in.orbit.v_BN_N, origin = vec3(0.0, 0.0, 0.0);
    const BodyState *other = &m->in.body;
    const int given = head_written(other->head);
    const Line craft = stretched(pole, r_N, v_N), sun = stretched(pole, m->in.sun.r_PN_N, m->in.sun.v_PN_N);
    const Line body = stretched(pole, given ? other->r_PN_N : origin, given ? other->v_PN_N : origin);
    const Vec3 r = vec_sub(craft.r, body.r), to_sun = vec_sub(sun.r, body.r);
    const ShadowPhase phase = phase_at(r, to_sun, R);
    const double seen = phase == SHADOW_PENUMBRA ? lit_part(r, to_sun, R) : phase == SHADOW_UMBRA ? 0.0 : 1.0;
    /* undecided: a guard, against roundings */
    const double lit = seen < 0.0 ? 0.0 : seen > 1.0 ? 1.0 : seen;

    const double distance = vec_norm(r_N), a = 1.0 / (2.0 / distance - vec_norm2(v_N) / mu);
    const Ellipse ellipse = {craft, a, fm_sqrt(mu / a) / a, distance / a, vec_dot(r_N, v_N) / fm_sqrt(mu * a)};
    const int moving = vec_finite(craft.v) && vec_finite(sun.v) && vec_finite(body.v) && mu > 0.0 && a > 0.0;
    double change = moving ? next_change(&ellipse, sun, body, R, phase) : 0.0;
    /* undecided: a guard; no inputs are known at which this alone is not finite */
    if (!(change > 0.0 && isfinite(change))) {
        change = 0.0;
    }

    const int outside =
        vec_norm(r) > R && vec_norm(to_sun) > ECLIPSE_SUN + R && vec_norm(vec_sub(r, to_sun)) > ECLIPSE_SUN;
    Quality quality = quality_min(quality_through(m->in.orbit.head), quality_through(m->in.sun.head));
    quality = quality_min(quality, quality_optional(other->head));
    ShadowState *shadow = &m->out.shadow;
    /* undecided: a guard; no inputs are known at which this alone is not finite */
    if (quality != QUALITY_NONE && outside && vec_finite(r) && vec_finite(to_sun) && isfinite(lit)) {
        *shadow = (ShadowState){head_next(shadow->head, t.t, quality), lit, change, phase, 0u};
    } else {
        shadow->head = head_held(shadow->head);
    }
}
