// SPDX-License-Identifier: Apache-2.0
// Four numbers in a register: those of four parts at a time, or a vector of three and a 0. The operations are those of
// single numbers, in the same order on every machine. Whatever takes or returns a Quad is inlined, because the way to
// pass one depends on the processor (sim/wide.h).
#pragma once

#include "sim/wide.h"
#include "world/dynamics/effector.h"

#include <numbers>

namespace fledge::world {

/// Four numbers: those of four parts, or a vector with a fourth component of 0.
using Quad [[gnu::vector_size(32)]] = double;

#define LANES_INLINE [[gnu::always_inline]] inline
#define LANES_LAMBDA __attribute__((always_inline))

LANES_INLINE Quad quad(double a)
{
    return Quad{a, a, a, a};
}

/// The numbers at `at` and behind it.
LANES_INLINE Quad quad_at(const double *at)
{
    using Loose [[gnu::vector_size(32), gnu::aligned(8), gnu::may_alias]] = double;
    return *reinterpret_cast<const Loose *>(at);
}

LANES_INLINE void put_quad(double *at, Quad a)
{
    using Loose [[gnu::vector_size(32), gnu::aligned(8), gnu::may_alias]] = double;
    *reinterpret_cast<Loose *>(at) = a;
}

// A load that needs two stores waits until both have reached the cache. So a vector of three is always stored and
// loaded as two numbers and one.
using LoosePair [[gnu::vector_size(16), gnu::aligned(8), gnu::may_alias]] = double;

LANES_INLINE Quad quad(const Vec3 &a)
{
    const LoosePair xy = *reinterpret_cast<const LoosePair *>(a.v);
    return Quad{xy[0], xy[1], a.v[2], 0.0};
}

/// Without its fourth component.
LANES_INLINE void put(Vec3 &to, Quad a)
{
    *reinterpret_cast<LoosePair *>(to.v) = __builtin_shufflevector(a, a, 0, 1);
    to.v[2] = a[2];
}

LANES_INLINE Vec3 vec(Quad a)
{
    return vec3(a[0], a[1], a[2]);
}

// Of vectors with a fourth component of 0, with the roundings of flight/math/vec.h:

LANES_INLINE double dot(Quad a, Quad b)
{
    const Quad p = a * b;
    return p[0] + p[1] + p[2];
}

LANES_INLINE Quad yzx(Quad a)
{
    return __builtin_shufflevector(a, a, 1, 2, 0, 3);
}
LANES_INLINE Quad zxy(Quad a)
{
    return __builtin_shufflevector(a, a, 2, 0, 1, 3);
}

LANES_INLINE Quad cross(Quad a, Quad b)
{
    return yzx(a * yzx(b) - yzx(a) * b);
}

/// a x[0] + b x[1] + c x[2]
LANES_INLINE Quad combine(Quad a, Quad b, Quad c, Quad x)
{
    return a * x[0] + b * x[1] + c * x[2];
}
LANES_INLINE Quad combine(Quad a, Quad b, Quad c, const double *x)
{
    return a * x[0] + b * x[1] + c * x[2];
}

/// The attitude of the MRP sigma_BN, for few vectors: without its matrix.
struct Attitude {
    Quad sigma{};
    double across = 0.0, along = 0.0;

    Attitude() = default;
    LANES_INLINE explicit Attitude(Quad sigma_BN) : sigma(sigma_BN)
    {
        const double s2 = dot(sigma, sigma), per = 1.0 / ((1.0 + s2) * (1.0 + s2));
        across = 4.0 * (1.0 - s2) * per;
        along = 8.0 * per;
    }

    LANES_INLINE Quad to_B(Quad a) const { return turned(a, -across); }
    LANES_INLINE Quad to_N(Quad a) const { return turned(a, across); }

private:
    LANES_INLINE Quad turned(Quad a, double by) const
    {
        const Quad b = cross(sigma, a);
        return a + (by * b + along * cross(sigma, b));
    }
};

/// The product of the transposed matrix with the vector x.
template <class Vector> LANES_INLINE Quad transposed_times(const Rows &a, Vector x)
{
    return combine(quad_at(a.m[0]), quad_at(a.m[1]), quad_at(a.m[2]), x);
}

inline Rows transposed(const Mat3 &a)
{
    Rows rows{};
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            rows.m[i][j] = a.m[j][i];
        }
    }
    return rows;
}

LANES_INLINE void add_at(double *at, Quad a)
{
    put_quad(at, quad_at(at) + a);
}

/// A symmetric matrix: xx, yy, zz, and yz, zx, xy.
struct SymmetricQuads {
    Quad along, across;

    LANES_INLINE Quad times(Quad a) const { return along * a + (zxy(across) * yzx(a) + yzx(across) * zxy(a)); }
    LANES_INLINE void add_to(Symmetric &to) const
    {
        add_at(to.along, along);
        add_at(to.across, across);
    }
    LANES_INLINE void put(Symmetric &to) const
    {
        put_quad(to.along, along);
        put_quad(to.across, across);
    }
};
LANES_INLINE SymmetricQuads symmetric(const Symmetric &a)
{
    return {quad_at(a.along), quad_at(a.across)};
}
LANES_INLINE SymmetricQuads operator+(const SymmetricQuads &a, const SymmetricQuads &b)
{
    return {a.along + b.along, a.across + b.across};
}
LANES_INLINE SymmetricQuads operator-(const SymmetricQuads &a, const SymmetricQuads &b)
{
    return {a.along - b.along, a.across - b.across};
}
LANES_INLINE SymmetricQuads operator*(double s, const SymmetricQuads &a)
{
    return {s * a.along, s * a.across};
}
/// a b, where that is symmetric.
LANES_INLINE SymmetricQuads product(Quad a, Quad b)
{
    return {a * b, yzx(a) * zxy(b)};
}

// Of four parts at a time:

/// The sums of four.
LANES_INLINE Quad sums(Quad a, Quad b, Quad c, Quad d)
{
    const Quad ab = __builtin_shufflevector(a, b, 0, 4, 2, 6) + __builtin_shufflevector(a, b, 1, 5, 3, 7);
    const Quad cd = __builtin_shufflevector(c, d, 0, 4, 2, 6) + __builtin_shufflevector(c, d, 1, 5, 3, 7);
    return __builtin_shufflevector(ab, cd, 0, 1, 4, 5) + __builtin_shufflevector(ab, cd, 2, 3, 6, 7);
}

/// Four vectors.
struct Quad3 {
    Quad x, y, z;
};

LANES_INLINE Quad3 operator+(const Quad3 &a, const Quad3 &b)
{
    return {a.x + b.x, a.y + b.y, a.z + b.z};
}
LANES_INLINE Quad3 operator-(const Quad3 &a, const Quad3 &b)
{
    return {a.x - b.x, a.y - b.y, a.z - b.z};
}
LANES_INLINE Quad3 operator*(const Quad &s, const Quad3 &a)
{
    return {s * a.x, s * a.y, s * a.z};
}
LANES_INLINE Quad dot(const Quad3 &a, const Quad3 &b)
{
    return a.x * b.x + a.y * b.y + a.z * b.z;
}
LANES_INLINE Quad3 cross(const Quad3 &a, const Quad3 &b)
{
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
LANES_INLINE Quad3 quads(const Vec3 &a)
{
    return {quad(a.v[0]), quad(a.v[1]), quad(a.v[2])};
}
/// The vectors i to i + 3 of those whose components are apart.
template <std::size_t n> LANES_INLINE Quad3 quads(const double (&a)[3][n], std::size_t i)
{
    return {quad_at(a[0] + i), quad_at(a[1] + i), quad_at(a[2] + i)};
}
LANES_INLINE Quad sums(const Quad3 &a)
{
    return sums(a.x, a.y, a.z, Quad{});
}

/// Four symmetric matrices.
struct QuadSymmetric {
    Quad xx, xy, xz, yy, yz, zz;

    LANES_INLINE Quad3 times(const Quad3 &a) const
    {
        return {xx * a.x + xy * a.y + xz * a.z, xy * a.x + yy * a.y + yz * a.z, xz * a.x + yz * a.y + zz * a.z};
    }

    LANES_INLINE SymmetricQuads sum() const { return {sums(xx, yy, zz, Quad{}), sums(yz, xz, xy, Quad{})}; }
};
LANES_INLINE QuadSymmetric operator+(const QuadSymmetric &a, const QuadSymmetric &b)
{
    return {a.xx + b.xx, a.xy + b.xy, a.xz + b.xz, a.yy + b.yy, a.yz + b.yz, a.zz + b.zz};
}
LANES_INLINE QuadSymmetric operator-(const QuadSymmetric &a, const QuadSymmetric &b)
{
    return {a.xx - b.xx, a.xy - b.xy, a.xz - b.xz, a.yy - b.yy, a.yz - b.yz, a.zz - b.zz};
}
LANES_INLINE QuadSymmetric operator*(const Quad &s, const QuadSymmetric &a)
{
    return {s * a.xx, s * a.xy, s * a.xz, s * a.yy, s * a.yz, s * a.zz};
}
/// a b, where that is symmetric.
LANES_INLINE QuadSymmetric product(const Quad3 &a, const Quad3 &b)
{
    return {a.x * b.x, a.x * b.y, a.x * b.z, a.y * b.y, a.y * b.z, a.z * b.z};
}
/// The matrices i to i + 3 of those whose elements xx, xy, xz, yy, yz, zz are apart.
template <std::size_t n> LANES_INLINE QuadSymmetric symmetric(const double (&a)[6][n], std::size_t i)
{
    return {quad_at(a[0] + i), quad_at(a[1] + i), quad_at(a[2] + i),
            quad_at(a[3] + i), quad_at(a[4] + i), quad_at(a[5] + i)};
}

/// The nearest whole numbers of numbers below 2^51, half ones to even; without an instruction of its own.
LANES_INLINE Quad nearest(Quad a)
{
    const Quad shift = quad(6755399441055744.0); // 1.5 * 2^52
    return (a + shift) - shift;
}

/// The sines and the cosines. The angles are below 1e6, and those of a state that normalize() keeps small.
LANES_INLINE void sincos(const Quad &angle, Quad &sine, Quad &cosine)
{
    // angle = n pi / 2 + r with |r| <= pi / 4; then Taylor's series.
    const Quad n = nearest(angle * (2.0 / std::numbers::pi));
    const Quad r = (angle - n * 1.5707963258028030) - n * 9.920935796805404e-10;
    const Quad s = r * r, q = s * s, w = q * q;
    const Quad c = ((1.0 - 1.0 / 2 * s) + q * (1.0 / 24 - 1.0 / 720 * s)) +
                   w * ((1.0 / 40320 - 1.0 / 3628800 * s) + q * (1.0 / 479001600 - 1.0 / 87178291200 * s) +
                        w * (1.0 / 20922789888000));
    const Quad d =
        ((-1.0 / 6 + 1.0 / 120 * s) + q * (-1.0 / 5040 + 1.0 / 362880 * s)) +
        w * ((-1.0 / 39916800 + 1.0 / 6227020800 * s) + q * (-1.0 / 1307674368000 + 1.0 / 355687428096000 * s));
    const Quad odd_sine = r + r * s * d;
    // n modulo 4 as -1.5, -0.5, 0.5, 1.5 about the quarter's sign changes
    const Quad half = 0.5 * n, even = nearest(half), turned = n - 2.0 * even; // -1, 0 or 1
    const Quad quarter = even - 2.0 * nearest(0.5 * even);                    // odd where half turns are
    const Quad sign = 1.0 - 2.0 * quarter * quarter, straight = 1.0 - turned * turned;
    sine = sign * (straight * odd_sine + turned * c);
    cosine = sign * (straight * c - turned * odd_sine);
}

} // namespace fledge::world
