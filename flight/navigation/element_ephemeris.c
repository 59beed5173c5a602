/* SPDX-License-Identifier: Apache-2.0 */
/* On the ellipse, with p to periapsis and q ahead in the orbit's plane,
 *     x = a (cos E - e) p + a sqrt(1 - e^2) sin E q,   E - e sin E = M,   dE = dM / (1 - e cos E),
 * and on the hyperbola, with a < 0,
 *     x = a (cosh H - e) p - a sqrt(e^2 - 1) sinh H q,   e sinh H - H = M,   dH = dM / (e cosh H - 1).
 * With u^2 = |E^2 / (1 - e)| or |H^2 / (1 - e)|, z = (1 - e) u^2 and Stumpff's functions c1, c2, c3 of z, which are
 * 1 - z / 6, 1/2 - z / 24, 1/6 - z / 120 and so on, both conics are
 *     u + e u^3 c3 = M / |1 - e|^(3/2),   x = |a (1 - e)| ((1 - u^2 c2) p + sqrt(1 + e) u c1 q),
 * in which nothing cancels as e goes to 1: Barker's equation of the parabola.
 * The plane turns by W = dOmega n3 + domega h, with the pole n3 and the orbit's normal h; so
 *     v = x' + W x x,   a = x'' + 2 W x x' + W x (W x x) + dW x x,   dW = dOmega n3 x domega h. */
#include "flight/navigation/element_ephemeris.h"

#include <string.h>

static const double NEAR_PARABOLA = 0.01;  /* of |1 - e|: beyond, the anomalies lose at most three digits */
static const double NEAR_PERIAPSIS = 0.15; /* [rad] of M: beyond, they lose none; up to it |z| < 1 */

/* Sine and cosine of an anomaly, hyperbolic or not; cosine - e, and |1 - e cosine|. */
typedef struct {
    double s, c, over, near;
} Place;

void element_ephemeris_reset(ElementEphemeris *m)
{
    memset(&m->out, 0, sizeof m->out);
}

/* E of E - e sin E = M, M in [-pi, pi], by Newton's method of order 4 from Danby's start, which converges for every
 * e < 1. */
static double eccentric_anomaly(double M, double e)
{
    double s, c, E = M + (M < 0.0 ? -0.85 : 0.85) * e;
    /* undecided: the steps of the loop are bounded, and it converges before */
    for (int k = 0; k < 12; k++) {
        fm_sincos(E, &s, &c);
        const double f = E - e * s - M, df = 1.0 - e * c;
        const double d1 = -f / df;
        const double d2 = -f / (df + 0.5 * d1 * e * s);
        const double d3 = -f / (df + 0.5 * d2 * e * s + d2 * d2 * e * c / 6.0);
        E += d3;
        if (fm_abs(d3) < 1e-9) {
            break; /* the next one would be below a rounding */
        }
    }
    return E;
}

/* s = sinh H and c = cosh H of e s - H = M, by Newton's method for s. As H <= s, it begins above the solution and falls
 * until roundings end that. */
static void hyperbolic_anomaly(double M, double e, double *s, double *c)
{
    const double size = fm_abs(M);
    double x = size / (e - 1.0), y = fm_sqrt(1.0 + x * x);
    /* undecided: the steps of the loop are bounded, and it converges before */
    for (int k = 0; k < 60; k++) {
        const double next = (size + fm_log(x + y) - x / y) / (e - 1.0 / y);
        if (!(next < x)) {
            break;
        }
        x = next;
        y = fm_sqrt(1.0 + x * x);
    }
    *s = M < 0.0 ? -x : x;
    *c = y;
}

/* Near the periapsis of a conic that is nearly a parabola: u by Newton's method. Its equation rises and is convex, so
 * that u begins above the solution and falls until roundings end that. */
static Place near_parabola(double M, double e)
{
    const double w = 1.0 - e, size = fm_sqrt(fm_abs(w)), B = fm_abs(M) / (size * size * size);
    const double cubic = fm_exp(fm_log(6.4 * B) / 3.0); /* e c3 > 1 / 6.4 */
    double u = B < cubic ? B : cubic, c1 = 1.0, c2 = 0.5;
    /* undecided: the steps of the loop are bounded, and it converges before */
    for (int k = 0; k < 30; k++) {
        const double z = w * u * u;
        double c3 = 0.0;
        c2 = 0.0;
        for (int j = 8; j >= 0; j--) {
            c2 = (1.0 - z * c2) / ((2 * j + 1) * (2 * j + 2));
            c3 = (1.0 - z * c3) / ((2 * j + 2) * (2 * j + 3));
        }
        c1 = 1.0 - z * c3;
        const double next = u - (u + e * u * u * u * c3 - B) / (1.0 + e * u * u * c2);
        if (!(next < u)) {
            break;
        }
        u = next;
    }
    const double fallen = u * u * c2;
    return (Place){(M < 0.0 ? -size : size) * u * c1, 1.0 - w * fallen, w * (1.0 - fallen),
                   fm_abs(w) * (1.0 + e * fallen)};
}

/* M in [-pi, pi] of an ellipse. */
static Place place(double M, double e)
{
    double s, c;
    if (fm_abs(1.0 - e) < NEAR_PARABOLA && fm_abs(M) < NEAR_PERIAPSIS) {
        return near_parabola(M, e);
    }
    if (e < 1.0) {
        fm_sincos(eccentric_anomaly(M, e), &s, &c);
    } else {
        hyperbolic_anomaly(M, e, &s, &c);
    }
    return (Place){s, c, c - e, fm_abs(1.0 - e * c)};
}

void element_ephemeris_update(ElementEphemeris *m, Tick t)
{
    const int64_t now = head_written(m->in.time.head) ? m->in.time.time : t.t;
    const double dt = tick_seconds(tick_since(now, m->par.epoch));
    const double a = fm_abs(m->par.a), e = m->par.e;
    const int ellipse = e < 1.0, conic = ellipse ? m->par.a > 0.0 : m->par.a < 0.0 && e > 1.0;
    const double n = fm_sqrt(m->par.mu / a) / a;
    const double root = fm_sqrt(fm_abs(1.0 - e) * (1.0 + e));
    const double ratio = m->par.radius / (a * root * root);
    const double k = ellipse ? 0.75 * m->par.J2 * ratio * ratio * n : 0.0;

    double si, ci, sO, cO, so, co;
    fm_sincos(m->par.i, &si, &ci);
    const double dOmega = -2.0 * k * ci;
    const double domega = k * (5.0 * ci * ci - 1.0);
    const double dM = n + k * root * (3.0 * ci * ci - 1.0);
    fm_sincos(m->par.node + dOmega * dt, &sO, &cO);
    fm_sincos(m->par.periapsis + domega * dt, &so, &co);
    double M = m->par.M + dM * dt;
    if (ellipse) {
        double s, c;
        fm_sincos(M, &s, &c);
        M = fm_atan2(s, c);
    }
    const Place at = place(M, e);

    const Vec3 pole = vec3(0.0, 0.0, 1.0);
    const Vec3 node = vec3(cO, sO, 0.0), ahead = vec3(-sO * ci, cO * ci, si);
    const Vec3 normal = vec_cross(node, ahead);
    const Vec3 p = vec_add(vec_scale(co, node), vec_scale(so, ahead));
    const Vec3 q = vec_sub(vec_scale(co, ahead), vec_scale(so, node));
    const Vec3 x = vec_add(vec_scale(m->par.a * at.over, p), vec_scale(a * root * at.s, q));
    const Vec3 dx = vec_add(vec_scale(-a * dM / at.near * at.s, p), vec_scale(a * dM / at.near * root * at.c, q));
    const Vec3 ddx = vec_scale(-dM * dM / (at.near * at.near * at.near), x);

    const Vec3 W = vec_add(vec_scale(dOmega, pole), vec_scale(domega, normal));
    const Vec3 dW = vec_scale(dOmega * domega, vec_cross(pole, normal));
    const Vec3 carried = vec_cross(W, x);
    const Vec3 v = vec_add(dx, carried);
    const Vec3 acceleration =
        vec_add(vec_add(ddx, vec_scale(2.0, vec_cross(W, dx))), vec_add(vec_cross(W, carried), vec_cross(dW, x)));
    NavOrbit *orbit = &m->out.orbit;
    BodyState *body = &m->out.body;
    /* undecided: a guard; no inputs are known at which this alone is not finite */
    if (conic && vec_finite(x) && vec_finite(v) && vec_finite(acceleration)) {
        const Quality quality = quality_optional(m->in.time.head);
        *orbit = (NavOrbit){head_next(orbit->head, t.t, quality), x, v, acceleration};
        *body = (BodyState){head_next(body->head, t.t, quality), x, v, acceleration};
    } else {
        orbit->head = head_held(orbit->head);
        body->head = head_held(body->head);
    }
}
