/* SPDX-License-Identifier: Apache-2.0 */
/* Attitudes: direction cosine matrices, Modified Rodrigues Parameters, quaternions, 3-2-1 angles.
 *
 * Conventions, for the attitude of a frame B relative to a frame A:
 * - dcm_BA maps components: x_B = [BA] x_A; its rows are the axes of B in A. [CA] = [CB][BA].
 * - sigma_BA = e tan(Phi / 4) and q_BA = (cos(Phi / 2), e sin(Phi / 2)), scalar first, for the turn
 *   by Phi about e that carries A into B. Both signs of q are the same attitude.
 * - angles (psi, theta, phi) turn A about its third axis, then the new second, then the new first:
 *   [BA] = [M1(phi)][M2(theta)][M3(psi)].
 * - omega_BA_B has components in B.
 *
 * An attitude has two sets of MRP, sigma and its shadow -sigma / sigma.sigma. What is returned here
 * has |sigma| <= 1, but for rounding: the set changes only where sigma.sigma > 1, so a turn by
 * exactly 180 degrees keeps the set it came with. All inputs may be of either set.
 *
 * Source: H. Schaub, J. L. Junkins, Analytical Mechanics of Space Systems, chapter 3.
 *
 * Example:
 *
 *     const Vec3 sigma_RN = mrp_turn(vec3(0.0, 0.0, 0.3)); // R is N, turned by 0.3 rad about its third axis
 *     const Vec3 sigma_BN = mrp_turn(vec3(0.0, 0.0, 0.5));
 *     const double angle = mrp_angle(mrp_relative(sigma_BN, sigma_RN));                // 0.2 rad
 *     const Vec3 sun_B = mat_vec(mrp_to_dcm(sigma_BN), vec3(1.0, 0.0, 0.0));
 */
#ifndef FLIGHT_MATH_ATTITUDE_H
#define FLIGHT_MATH_ATTITUDE_H

#include "flight/math/vec.h"

/** A unit quaternion, scalar first. */
typedef struct Quat {
    double q[4];
} Quat;

/** -sigma / sigma.sigma, for sigma other than 0. */
static inline Vec3 mrp_shadow(Vec3 sigma)
{
    return vec_scale(-1.0 / vec_norm2(sigma), sigma);
}

/** The set with |sigma| <= 1. */
static inline Vec3 mrp_short(Vec3 sigma)
{
    return vec_norm2(sigma) > 1.0 ? mrp_shadow(sigma) : sigma;
}

/** The set of sigma's attitude that is nearer to `to`: what sigma must be for a motion from sigma
 *  to `to` to be continuous. |shadow - to| < |sigma - to| is, multiplied out, what is tested here. */
static inline Vec3 mrp_nearer(Vec3 sigma, Vec3 to)
{
    return vec_norm2(sigma) - 2.0 * vec_dot(sigma, to) > 1.0 ? mrp_shadow(sigma) : sigma;
}

/** The MRP of the attitude q / norm, for q a quaternion of any length: its scalar part and
 *  its vector part. Dividing by norm + |scalar| picks the short set and is never singular. */
static inline Vec3 mrp_project(double scalar, Vec3 vector, double norm)
{
    return vec_scale(scalar < 0.0 ? 1.0 / (scalar - norm) : 1.0 / (scalar + norm), vector);
}

/** The MRP of a turn by a vector, whose length is the angle. Small angles take tan x / x by its series. */
static inline Vec3 mrp_turn(Vec3 phi)
{
    double s, c, angle = vec_norm(phi), x2 = angle * angle / 16.0;
    if (angle < 0.1) {
        double series = 1.0 / 3.0 + x2 * (2.0 / 15.0 + x2 * (17.0 / 315.0 + x2 * (62.0 / 2835.0)));
        return vec_scale(0.25 * (1.0 + x2 * series), phi);
    }
    fm_sincos(0.5 * angle, &s, &c);
    return mrp_project(c, vec_scale(s / angle, phi), 1.0);
}

static inline Quat mrp_to_quat(Vec3 sigma)
{
    double s2 = vec_norm2(sigma);
    double k = 1.0 / (1.0 + s2);
    Vec3 v = vec_scale(2.0 * k, sigma);
    return (Quat){{(1.0 - s2) * k, v.v[0], v.v[1], v.v[2]}};
}

/** [rad] The angle of a turn, in [0, pi] for the short set. */
static inline double mrp_angle(Vec3 sigma)
{
    return 4.0 * fm_atan(vec_norm(sigma));
}

static inline Vec3 quat_to_mrp(Quat q)
{
    return mrp_project(q.q[0], vec3(q.q[1], q.q[2], q.q[3]), 1.0);
}

static inline Mat3 quat_to_dcm(Quat q)
{
    double x = 2.0 * q.q[1], y = 2.0 * q.q[2], z = 2.0 * q.q[3];
    double wx = x * q.q[0], wy = y * q.q[0], wz = z * q.q[0];
    double xx = x * q.q[1], xy = x * q.q[2], xz = x * q.q[3];
    double yy = y * q.q[2], yz = y * q.q[3], zz = z * q.q[3];
    return (Mat3){{{1.0 - (yy + zz), xy + wz, xz - wy},
                   {xy - wz, 1.0 - (xx + zz), yz + wx},
                   {xz + wy, yz - wx, 1.0 - (xx + yy)}}};
}

/** The quaternion of a DCM, times 4 times its own largest component, so at least of length 2.
 *  4 q q^T is linear in the DCM (Shepperd); its row with the largest diagonal loses no accuracy,
 *  whatever the angle, and needs no square root. */
static inline Quat dcm_to_long_quat(Mat3 c)
{
    double xx = c.m[0][0], yy = c.m[1][1], zz = c.m[2][2];
    double trace = xx + yy + zz;
    double wx = c.m[1][2] - c.m[2][1], wy = c.m[2][0] - c.m[0][2], wz = c.m[0][1] - c.m[1][0];
    double xy = c.m[0][1] + c.m[1][0], xz = c.m[2][0] + c.m[0][2], yz = c.m[1][2] + c.m[2][1];
    if (trace >= xx && trace >= yy && trace >= zz) {
        return (Quat){{1.0 + trace, wx, wy, wz}};
    }
    if (xx >= yy && xx >= zz) {
        return (Quat){{wx, 1.0 + xx - yy - zz, xy, xz}};
    }
    if (yy >= zz) {
        return (Quat){{wy, xy, 1.0 + yy - zz - xx, yz}};
    }
    return (Quat){{wz, xz, yz, 1.0 + zz - xx - yy}};
}

static inline double quat_norm(Quat q)
{
    return fm_sqrt(q.q[0] * q.q[0] + q.q[1] * q.q[1] + q.q[2] * q.q[2] + q.q[3] * q.q[3]);
}

/** The quaternion with scalar part >= 0. */
static inline Quat dcm_to_quat(Mat3 c)
{
    Quat q = dcm_to_long_quat(c);
    double k = (q.q[0] < 0.0 ? -1.0 : 1.0) / quat_norm(q);
    return (Quat){{k * q.q[0], k * q.q[1], k * q.q[2], k * q.q[3]}};
}

static inline Mat3 mrp_to_dcm(Vec3 sigma)
{
    return quat_to_dcm(mrp_to_quat(sigma));
}

static inline Vec3 dcm_to_mrp(Mat3 c)
{
    Quat q = dcm_to_long_quat(c);
    return mrp_project(q.q[0], vec3(q.q[1], q.q[2], q.q[3]), quat_norm(q));
}

/** sigma_CA, of [CA] = [CB][BA]: the product of the quaternions (1 - s.s, 2 s), of length 1 + s.s,
 *  so there is no attitude for which the denominator vanishes. */
static inline Vec3 mrp_compose(Vec3 sigma_CB, Vec3 sigma_BA)
{
    double c2 = vec_norm2(sigma_CB), b2 = vec_norm2(sigma_BA);
    double cw = 1.0 - c2, bw = 1.0 - b2;
    Vec3 v = vec_sub(vec_add(vec_scale(bw, sigma_CB), vec_scale(cw, sigma_BA)),
                     vec_scale(2.0, vec_cross(sigma_CB, sigma_BA)));
    return mrp_project(cw * bw - 4.0 * vec_dot(sigma_CB, sigma_BA), vec_scale(2.0, v), (1.0 + c2) * (1.0 + b2));
}

/** sigma_BR, of [BR] = [BN][RN]^T. */
static inline Vec3 mrp_relative(Vec3 sigma_BN, Vec3 sigma_RN)
{
    return mrp_compose(sigma_BN, vec_neg(sigma_RN));
}

/** B(sigma) = (1 - sigma.sigma) I + 2 [sigma x] + 2 sigma sigma^T, of dsigma = B omega / 4. */
static inline Mat3 mrp_rate_matrix(Vec3 sigma)
{
    double x = sigma.v[0], y = sigma.v[1], z = sigma.v[2];
    double d = 1.0 - vec_norm2(sigma);
    return (Mat3){{{d + 2.0 * x * x, 2.0 * (x * y - z), 2.0 * (x * z + y)},
                   {2.0 * (x * y + z), d + 2.0 * y * y, 2.0 * (y * z - x)},
                   {2.0 * (x * z - y), 2.0 * (y * z + x), d + 2.0 * z * z}}};
}

/** dsigma_BA, of sigma_BA and omega_BA_B. */
static inline Vec3 mrp_rate(Vec3 sigma, Vec3 omega)
{
    return vec_scale(0.25, mat_vec(mrp_rate_matrix(sigma), omega));
}

/** omega_BA_B, of sigma_BA and dsigma_BA: B^-1 is B^T / (1 + sigma.sigma)^2. */
static inline Vec3 mrp_omega(Vec3 sigma, Vec3 dsigma)
{
    double d = 1.0 + vec_norm2(sigma);
    return vec_scale(4.0 / (d * d), mat_transpose_vec(mrp_rate_matrix(sigma), dsigma));
}

/** The DCM of 3-2-1 angles (psi, theta, phi), of their sines and cosines. */
static inline Mat3 euler_sincos_to_dcm(Vec3 s, Vec3 c)
{
    double s3 = s.v[0], s2 = s.v[1], s1 = s.v[2];
    double c3 = c.v[0], c2 = c.v[1], c1 = c.v[2];
    return (Mat3){{{c2 * c3, c2 * s3, -s2},
                   {s1 * s2 * c3 - c1 * s3, s1 * s2 * s3 + c1 * c3, s1 * c2},
                   {c1 * s2 * c3 + s1 * s3, c1 * s2 * s3 - s1 * c3, c1 * c2}}};
}

/** The sine and the cosine of each component. */
static inline void vec_sincos(Vec3 angles, Vec3 *s, Vec3 *c)
{
    for (int i = 0; i < 3; i++) {
        fm_sincos(angles.v[i], &s->v[i], &c->v[i]);
    }
}

/** The DCM of 3-2-1 angles (psi, theta, phi) in radians. */
static inline Mat3 euler_to_dcm(Vec3 angles)
{
    Vec3 s, c;
    vec_sincos(angles, &s, &c);
    return euler_sincos_to_dcm(s, c);
}

/** The 3-2-1 angles of a DCM: psi and phi in [-pi, pi], theta in [-pi/2, pi/2].
 *  With psi known, [BA][M3(psi)]^T = [M1(phi)][M2(theta)] yields the others, so the three belong
 *  together however near theta is to pi/2. There psi is 0, as only one turn remains. */
static inline Vec3 dcm_to_euler(Mat3 c)
{
    double c2 = fm_sqrt(c.m[0][0] * c.m[0][0] + c.m[0][1] * c.m[0][1]);
    double s3 = c2 > 0.0 ? c.m[0][1] / c2 : 0.0;
    double c3 = c2 > 0.0 ? c.m[0][0] / c2 : 1.0;
    return vec3(fm_atan2(s3, c3), fm_atan2(-c.m[0][2], c2),
                fm_atan2(c.m[2][0] * s3 - c.m[2][1] * c3, c.m[1][1] * c3 - c.m[1][0] * s3));
}

#endif
