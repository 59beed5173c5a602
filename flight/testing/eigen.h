// SPDX-License-Identifier: Apache-2.0
// Flight types to Eigen and back, attitudes by a route that shares nothing with flight/math, and
// seeded random states. Include it before the interfaces of modules, which stand in extern "C".
#pragma once

#include "flight/math/attitude.h"
#include "flight/msg/head.h"

#include <Eigen/Dense>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <numbers>
#include <random>

namespace flight::testing {

using Eigen::Matrix3d;
using Eigen::Vector3d;

inline constexpr double pi = std::numbers::pi;

inline Vector3d eigen(Vec3 a)
{
    return {a.v[0], a.v[1], a.v[2]};
}

inline Matrix3d eigen(const Mat3 &a)
{
    return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(&a.m[0][0]);
}

inline Vec3 vec(const Vector3d &a)
{
    return vec3(a.x(), a.y(), a.z());
}

inline Mat3 mat(const Matrix3d &a)
{
    Mat3 c;
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            c.m[i][j] = a(i, j);
        }
    }
    return c;
}

inline Matrix3d skew(const Vector3d &a)
{
    Matrix3d s;
    s << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
    return s;
}

/// The DCM of a turn by `angle` about `axis` (Rodrigues): mapping components, it turns them back.
inline Matrix3d turn(const Vector3d &axis, double angle)
{
    Vector3d e = axis.normalized();
    return std::cos(angle) * Matrix3d::Identity() + (1 - std::cos(angle)) * e * e.transpose() -
           std::sin(angle) * skew(e);
}

/// [M1], [M2], [M3]: a turn about one of the frame's own axes, 0 to 2.
inline Matrix3d turn(int axis, double angle)
{
    return turn(Vector3d::Unit(axis), angle);
}

/// The DCM of an MRP by its definition, sigma = e tan(Phi / 4).
inline Matrix3d dcm(Vec3 sigma)
{
    Vector3d s = eigen(sigma);
    return s.isZero(0) ? Matrix3d::Identity() : turn(s, 4 * std::atan(s.norm()));
}

/// The largest difference of two attitudes' matrices.
inline double difference(const Matrix3d &a, const Matrix3d &b)
{
    return (a - b).cwiseAbs().maxCoeff();
}

/// How often a test with n random runs has them: under sanitizers, where Eigen is a hundred times slower, a tenth.
constexpr int runs(int n)
{
#ifdef __SANITIZE_ADDRESS__
    return (n + 9) / 10;
#else
    return n;
#endif
}

class Random {
public:
    explicit Random(std::uint64_t seed) : engine_(seed) {}

    /// Uniform in [lo, hi).
    double real(double lo, double hi) { return lo + (hi - lo) * static_cast<double>(engine_() >> 11) * 0x1p-53; }

    /// Uniform in [0, n).
    int below(int n) { return static_cast<int>(real(0, n)); }

    /// Uniform in the cube [-size, size]^3.
    Vector3d vector(double size = 1)
    {
        double x = real(-size, size), y = real(-size, size), z = real(-size, size);
        return {x, y, z};
    }

    double normal() { return std::sqrt(-2 * std::log(1 - real(0, 1))) * std::cos(2 * pi * real(0, 1)); }

    /// Of independent components with a standard deviation.
    Vector3d normals(double std = 1)
    {
        const double x = normal(), y = normal(), z = normal();
        return std * Vector3d(x, y, z);
    }

    Vector3d direction()
    {
        Vector3d a = vector();
        while (a.norm() > 1 || a.norm() < 0.1) {
            a = vector();
        }
        return a.normalized();
    }

    Matrix3d attitude() { return turn(direction(), real(-pi, pi)); }

    /// The MRP of a random turn by up to 180 degrees.
    Vec3 mrp() { return vec(direction() * std::tan(real(0, pi) / 4)); }

    /// Symmetric, with eigenvalues in [1, 10] in a random orientation, times `scale`.
    Matrix3d spd(double scale)
    {
        Matrix3d q = attitude();
        Vector3d d{real(1, 10), real(1, 10), real(1, 10)};
        return scale * q * d.asDiagonal() * q.transpose();
    }

private:
    std::mt19937_64 engine_;
};

/// The update function of a module.
template <class Module> using UpdateOf = void (*)(Module *, Tick);

/// The head of a message that was just written.
inline Head good(std::int64_t t = 0)
{
    return {t, QUALITY_GOOD, 1};
}

inline Head with(Quality quality)
{
    return {0, quality, 1};
}

/// 1 where two messages hold the same bytes behind their heads.
template <class Message> bool same_content(const Message &a, const Message &b)
{
    constexpr std::size_t head = sizeof(Head);
    return std::memcmp(reinterpret_cast<const char *>(&a) + head, reinterpret_cast<const char *>(&b) + head,
                       sizeof a - head) == 0;
}

template <class T> bool all_zero(const T &a)
{
    T zero;
    std::memset(&zero, 0, sizeof zero);
    return std::memcmp(&a, &zero, sizeof a) == 0;
}

} // namespace flight::testing
