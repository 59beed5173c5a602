/* SPDX-License-Identifier: Apache-2.0 */
/* Vectors and matrices of three, by value, so that expressions read as the equations do.
 * A Mat3 is stored by rows: m[i][j] is row i, column j. */
#ifndef FLIGHT_MATH_VEC_H
#define FLIGHT_MATH_VEC_H

#include <stdint.h>

#include "flight/math/elementary.h"

typedef struct Vec3 {
    double v[3];
} Vec3;

typedef struct Mat3 {
    double m[3][3];
} Mat3;

static inline Vec3 vec3(double x, double y, double z)
{
    return (Vec3){{x, y, z}};
}

static inline Vec3 vec_add(Vec3 a, Vec3 b)
{
    return vec3(a.v[0] + b.v[0], a.v[1] + b.v[1], a.v[2] + b.v[2]);
}

static inline Vec3 vec_sub(Vec3 a, Vec3 b)
{
    return vec3(a.v[0] - b.v[0], a.v[1] - b.v[1], a.v[2] - b.v[2]);
}

static inline Vec3 vec_scale(double s, Vec3 a)
{
    return vec3(s * a.v[0], s * a.v[1], s * a.v[2]);
}

static inline Vec3 vec_neg(Vec3 a)
{
    return vec3(-a.v[0], -a.v[1], -a.v[2]);
}

static inline double vec_dot(Vec3 a, Vec3 b)
{
    return a.v[0] * b.v[0] + a.v[1] * b.v[1] + a.v[2] * b.v[2];
}

static inline Vec3 vec_cross(Vec3 a, Vec3 b)
{
    return vec3(a.v[1] * b.v[2] - a.v[2] * b.v[1], a.v[2] * b.v[0] - a.v[0] * b.v[2],
                a.v[0] * b.v[1] - a.v[1] * b.v[0]);
}

static inline double vec_norm2(Vec3 a)
{
    return vec_dot(a, a);
}

static inline double vec_norm(Vec3 a)
{
    return fm_sqrt(vec_dot(a, a));
}

/** a / |a|, or zero if |a| is 0. */
static inline Vec3 vec_unit(Vec3 a)
{
    const double n2 = vec_norm2(a); /* a positive one is so large that 1 / |a| is finite */
    return n2 > 0.0 ? vec_scale(1.0 / fm_sqrt(n2), a) : vec3(0.0, 0.0, 0.0);
}

/** [rad] The angle between two vectors, in [0, pi], without loss of digits where it is near either end. */
static inline double vec_angle(Vec3 a, Vec3 b)
{
    return fm_atan2(vec_norm(vec_cross(a, b)), vec_dot(a, b));
}

/** The unit axis that is farthest from the direction of a. */
static inline Vec3 vec_far_axis(Vec3 a)
{
    double x = fm_abs(a.v[0]), y = fm_abs(a.v[1]), z = fm_abs(a.v[2]);
    if (x <= y && x <= z) {
        return vec3(1.0, 0.0, 0.0);
    }
    return y <= z ? vec3(0.0, 1.0, 0.0) : vec3(0.0, 0.0, 1.0);
}

/** x, or the nearer end of [-limit, limit]. */
static inline double fm_clamp(double x, double limit)
{
    return x > limit ? limit : x < -limit ? -limit : x;
}

/** Each component within [-limit, limit]. */
static inline Vec3 vec_clamp(Vec3 a, double limit)
{
    return vec3(fm_clamp(a.v[0], limit), fm_clamp(a.v[1], limit), fm_clamp(a.v[2], limit));
}

/** 1 if no component is a NaN or an infinity. */
static inline int vec_finite(Vec3 a)
{
    return isfinite(a.v[0]) && isfinite(a.v[1]) && isfinite(a.v[2]);
}

/** 1 if none of n numbers is a NaN or an infinity. */
static inline int numbers_finite(const double *x, uint32_t n)
{
    for (uint32_t i = 0; i < n; i++) {
        if (!isfinite(x[i])) {
            return 0;
        }
    }
    return 1;
}

static inline Mat3 mat_identity(void)
{
    return (Mat3){{{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}}};
}

/** 1 if no element is a NaN or an infinity. */
static inline int mat_finite(Mat3 a)
{
    int finite = 1;
    for (int i = 0; i < 3; i++) {
        finite = finite && isfinite(a.m[i][0]) && isfinite(a.m[i][1]) && isfinite(a.m[i][2]);
    }
    return finite;
}

/** The matrix whose rows are a, b, c. */
static inline Mat3 mat_rows(Vec3 a, Vec3 b, Vec3 c)
{
    return (Mat3){{{a.v[0], a.v[1], a.v[2]}, {b.v[0], b.v[1], b.v[2]}, {c.v[0], c.v[1], c.v[2]}}};
}

static inline Mat3 mat_transpose(Mat3 a)
{
    return (Mat3){
        {{a.m[0][0], a.m[1][0], a.m[2][0]}, {a.m[0][1], a.m[1][1], a.m[2][1]}, {a.m[0][2], a.m[1][2], a.m[2][2]}}};
}

/** A x */
static inline Vec3 mat_vec(Mat3 a, Vec3 x)
{
    return vec3(a.m[0][0] * x.v[0] + a.m[0][1] * x.v[1] + a.m[0][2] * x.v[2],
                a.m[1][0] * x.v[0] + a.m[1][1] * x.v[1] + a.m[1][2] * x.v[2],
                a.m[2][0] * x.v[0] + a.m[2][1] * x.v[1] + a.m[2][2] * x.v[2]);
}

/** A^T x */
static inline Vec3 mat_transpose_vec(Mat3 a, Vec3 x)
{
    return mat_vec(mat_transpose(a), x);
}

/** A B */
static inline Mat3 mat_mul(Mat3 a, Mat3 b)
{
    Mat3 c;
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            c.m[i][j] = a.m[i][0] * b.m[0][j] + a.m[i][1] * b.m[1][j] + a.m[i][2] * b.m[2][j];
        }
    }
    return c;
}

#endif
