/* SPDX-License-Identifier: Apache-2.0 */
/* Motion about a planet with zonal harmonics. With the pole p, rr = r / |r|, u = rr . p and q = radius / |r|,
 *     V = mu / |r| (1 - sum of J_n q^n P_n(u)),
 *     a = -mu / |r|^2 (rr + sum of J_n q^n (P'_n(u) p - P'_(n+1)(u) rr)),   n = 2, 3, 4.
 * Sources: Vallado, section 8.6; the relation P'_(n+1) = (n + 1) P_n + u P'_n makes it this short. */
#ifndef FLIGHT_NAVIGATION_ORBIT_MOTION_H
#define FLIGHT_NAVIGATION_ORBIT_MOTION_H

#include "flight/math/vec.h"
#include "flight/msg/ephemeris.h"

#define ORBIT_STEPS_MAX 1000 /* of one update, whatever the parameters are */

/** What attracts, from the origin of N. */
typedef struct OrbitField {
    double mu;         /* [m^3/s^2] */
    double radius;     /* [m] to which the zonals belong */
    double J2, J3, J4; /* [-] */
    Vec3 pole;         /* [-] p3 of the planet, a unit vector, N components */
} OrbitField;

/** Where a body is, and how it moves. */
typedef struct OrbitPoint {
    Vec3 r; ///< [m]   position relative to the origin of N
    Vec3 v; ///< [m/s] velocity relative to N
} OrbitPoint;

/** The pole of a planet: the third axis of N if it was never written. If it is no axis, that of N, which degrades. */
static inline Vec3 orbit_pole(const PlanetAttitude *planet, Quality *quality)
{
    const double *p = planet->dcm_PN.m[2];
    const double size = vec_norm(vec3(p[0], p[1], p[2]));
    *quality = quality_optional(planet->head);
    if (!head_written(planet->head)) {
        return vec3(0.0, 0.0, 1.0);
    }
    if (!(fm_abs(size - 1.0) < 1e-3)) {
        *quality = QUALITY_DEGRADED;
        return vec3(0.0, 0.0, 1.0);
    }
    return vec_scale(1.0 / size, vec3(p[0], p[1], p[2]));
}

/** [m/s^2] The acceleration at r. */
static inline Vec3 orbit_gravity(const OrbitField *f, Vec3 r)
{
    const double size = vec_norm(r), q = f->radius / size, g = f->mu / size / size;
    const Vec3 rr = vec_scale(1.0 / size, r);
    const double u = vec_dot(rr, f->pole), u2 = u * u;
    const double d3 = 1.5 * (5.0 * u2 - 1.0), d4 = 2.5 * u * (7.0 * u2 - 3.0);
    const double d5 = 1.875 * (u2 * (21.0 * u2 - 14.0) + 1.0);
    const double j2 = f->J2 * q * q, j3 = f->J3 * q * q * q, j4 = f->J4 * q * q * q * q;
    const double along_r = 1.0 - j2 * d3 - j3 * d4 - j4 * d5, along_p = j2 * 3.0 * u + j3 * d3 + j4 * d4;
    return vec_scale(-g, vec_add(vec_scale(along_r, rr), vec_scale(along_p, f->pole)));
}

/** [1/s^2] The derivative of the acceleration by r, with mu and J2 alone:
 *      -mu / |r|^3 (I - 3 rr rr^T + J2 q^2 (3 p p^T - 15 u (p rr^T + rr p^T) + P''_4 rr rr^T - P'_3 I)) */
static inline Mat3 orbit_gradient(const OrbitField *f, Vec3 r)
{
    const double size = vec_norm(r), q = f->radius / size, g = f->mu / (size * size * size), j2 = f->J2 * q * q;
    const Vec3 rr = vec_scale(1.0 / size, r), p = f->pole;
    const double u = vec_dot(rr, p);
    const double unit = 1.0 - j2 * 1.5 * (5.0 * u * u - 1.0), of_rr = j2 * 7.5 * (7.0 * u * u - 1.0) - 3.0;
    Mat3 G;
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            const double mixed = 3.0 * p.v[i] * p.v[j] - 15.0 * u * (p.v[i] * rr.v[j] + rr.v[i] * p.v[j]);
            G.m[i][j] = -g * ((i == j ? unit : 0.0) + of_rr * rr.v[i] * rr.v[j] + j2 * mixed);
        }
    }
    return G;
}

/** [m/s^2] The acceleration by the field, and by `along` [m/s^2] in the direction of the velocity. */
static inline Vec3 orbit_acceleration(const OrbitField *f, OrbitPoint x, double along)
{
    return vec_add(orbit_gravity(f, x.r), vec_scale(along, vec_unit(x.v)));
}

/** The point h [s] later, by one step of Runge and Kutta's method of order 4. At an altitude of 500 km, steps of 10 s
 *  are wrong by 0.5 m after a day, steps of 30 s by 70 m. */
static inline OrbitPoint orbit_step(const OrbitField *f, OrbitPoint x, double along, double h)
{
    const double half = 0.5 * h;
    const Vec3 a1 = orbit_acceleration(f, x, along);
    const OrbitPoint x2 = {vec_add(x.r, vec_scale(half, x.v)), vec_add(x.v, vec_scale(half, a1))};
    const Vec3 a2 = orbit_acceleration(f, x2, along);
    const OrbitPoint x3 = {vec_add(x.r, vec_scale(half, x2.v)), vec_add(x.v, vec_scale(half, a2))};
    const Vec3 a3 = orbit_acceleration(f, x3, along);
    const OrbitPoint x4 = {vec_add(x.r, vec_scale(h, x3.v)), vec_add(x.v, vec_scale(h, a3))};
    const Vec3 a4 = orbit_acceleration(f, x4, along);
    const Vec3 v = vec_add(vec_add(x.v, x4.v), vec_scale(2.0, vec_add(x2.v, x3.v)));
    const Vec3 a = vec_add(vec_add(a1, a4), vec_scale(2.0, vec_add(a2, a3)));
    return (OrbitPoint){vec_add(x.r, vec_scale(h / 6.0, v)), vec_add(x.v, vec_scale(h / 6.0, a))};
}

/** [ns] A step, from seconds; 0 unless it is from 1 ms to an hour. */
static inline int64_t orbit_step_ns(double step)
{
    return step >= 1e-3 && step <= 3600.0 ? (int64_t)(step * 1e9) : 0;
}

/** Step from the time *at to t in steps of up to `step` [ns], and at most `steps` of them; *at is the time reached. */
static inline OrbitPoint orbit_go(const OrbitField *f, OrbitPoint x, int64_t *at, int64_t t, int64_t step,
                                  uint32_t steps)
{
    /* undecided: a guard of the array; the bounds of the parameter are within */
    for (uint32_t k = 0u; k < ORBIT_STEPS_MAX && k < steps && *at < t && step > 0; k++) {
        const uint64_t left = (uint64_t)t - (uint64_t)*at;
        const int64_t h = left < (uint64_t)step ? (int64_t)left : step;
        x = orbit_step(f, x, 0.0, tick_seconds(h));
        *at += h;
    }
    return x;
}

/** Whether a point is one from which motion can go on: its numbers are finite, and so is its acceleration. */
static inline int orbit_sound(const OrbitField *f, OrbitPoint x)
{
    return vec_finite(x.r) && vec_finite(x.v) && vec_finite(orbit_gravity(f, x.r)) &&
           isfinite(vec_norm2(x.r) + vec_norm2(x.v));
}

#endif
