/* SPDX-License-Identifier: Apache-2.0 */
/* Private to this folder: the direction that the cosines of sun sensors fit best. With unit axes n_i, cosines c_i and
 * weights w_i, J(s) = sum w_i (c_i - n_i . s)^2 over lit sensors, and over dark ones that s would light. Without
 * |s| = 1, J is convex: its minimum is the start. On the unit sphere, Gauss-Newton steps in the tangent plane go on
 * from there; the pseudo-inverse takes the shortest where few sensors are lit. */
#ifndef FLIGHT_SENSING_SUN_FIT_H
#define FLIGHT_SENSING_SUN_FIT_H

#include "flight/math/mat.h"
#include "flight/msg/avionics.h"
#include "flight/msg/navigation.h"

/* Steps until both minima stand. */
#define SUN_FIT_STEPS 6

/* What sensors say. */
typedef struct SunView {
    Vec3 axis[SUN_SENSORS_MAX]; /* unit vectors */
    double weight[SUN_SENSORS_MAX];
    double edge[SUN_SENSORS_MAX]; /* the cosine at the edge of the field of view */
    double cosine[SUN_SENSORS_MAX];
    uint32_t lit;
} SunView;

/* What some of the sensors say. All dark: the rank 0, and no misfit. */
typedef struct SunFit {
    Vec3 s_B;
    int rank;      /* of the lit sensors' axes */
    double misfit; /* of the nearest direction: the root of the sum of weighted squares */
    double dimmed; /* of a Sun that is evenly dimmed: this one, or that of the nearest vector below the length 1 */
} SunFit;

static inline double sun_rest(const SunView *v, uint32_t i, Vec3 s)
{
    const double cosine = vec_dot(v->axis[i], s);
    if ((v->lit >> i & 1u) != 0u) {
        return v->cosine[i] - cosine;
    }
    const double reads = v->cosine[i] > 0.0 ? v->cosine[i] : 0.0;
    return cosine > reads && cosine > v->edge[i] ? reads - cosine : 0.0;
}

static inline double sun_misfit(const SunView *v, uint32_t sensors, Vec3 s)
{
    double sum = 0.0;
    for (uint32_t i = 0u; i < SUN_SENSORS_MAX; i++) {
        const double r = (sensors >> i & 1u) != 0u ? sun_rest(v, i, s) : 0.0;
        sum += v->weight[i] * r * r;
    }
    return fm_sqrt(sum);
}

static inline Vec3 sun_step(const SunView *v, uint32_t sensors, Vec3 s, int on_sphere, int *rank)
{
    Mat3 S = {{{0.0}}};
    Vec3 sum = vec3(0.0, 0.0, 0.0);
    for (uint32_t i = 0u; i < SUN_SENSORS_MAX; i++) {
        if ((sensors >> i & 1u) == 0u) {
            continue;
        }
        const double r = sun_rest(v, i, s), w = v->weight[i];
        if ((v->lit >> i & 1u) == 0u && r == 0.0) {
            continue;
        }
        Vec3 n = v->axis[i];
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

static inline SunFit sun_fit(const SunView *v, uint32_t sensors)
{
    SunFit f = {.rank = 0};
    int rank;
    if ((v->lit & sensors) == 0u) {
        return f;
    }
    Vec3 d = sun_step(v, sensors, f.s_B, 0, &f.rank);
    for (int k = 1; k < SUN_FIT_STEPS; k++) {
        d = sun_step(v, sensors, d, 0, &rank);
    }
    f.s_B = vec_unit(d);
    f.misfit = sun_misfit(v, sensors, f.s_B);
    Vec3 s = f.s_B;
    for (int k = 0; k < SUN_FIT_STEPS; k++) { /* steps may go too far where a sensor faces the Sun */
        s = sun_step(v, sensors, s, 1, &rank);
        const double next = sun_misfit(v, sensors, s);
        f.s_B = next < f.misfit ? s : f.s_B;
        f.misfit = next < f.misfit ? next : f.misfit;
    }
    f.dimmed = vec_norm2(d) < 1.0 ? sun_misfit(v, sensors, d) : f.misfit;
    return f;
}

/* The cosines of a view, for SunLine; lit: the sensors that count. */
static inline SunCosines sun_cosines(const SunView *v, uint32_t n, uint32_t lit, Head head)
{
    SunCosines cosines = {.head = head, .n = n, .lit = lit};
    for (uint32_t i = 0u; i < n; i++) {
        cosines.cosine[i] = v->cosine[i];
        cosines.weight[i] = v->weight[i];
        cosines.axes_B[i] = v->axis[i];
    }
    return cosines;
}

#endif
