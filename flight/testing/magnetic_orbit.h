// SPDX-License-Identifier: Apache-2.0
// A rigid body with wheels on a circular orbit, in a tilted dipole field that turns with the Earth: what modules for
// torque rods fly in, by Eigen and the classical method of Runge and Kutta.
#pragma once

#include "flight/testing/eigen.h"

extern "C" {
#include "flight/msg/magnetics.h"
}

namespace flight::testing {

struct MagneticOrbit {
    double n = 1.1068e-3, inclination = 97.4 * pi / 180, u = 0; // 500 km
    double tilt = 9.4 * pi / 180, longitude = 0, B0 = 2.37e-5;  // of the dipole, on its equator up there

    /// [HN]: radially outward, along the motion, along the orbit's momentum.
    Matrix3d hill(double t) const { return turn(2, u + n * t) * turn(0, inclination); }

    Vector3d field_N(double t) const
    {
        const double l = longitude + 7.2921159e-5 * t;
        const Vector3d axis(std::sin(tilt) * std::cos(l), std::sin(tilt) * std::sin(l), std::cos(tilt));
        const Vector3d r = hill(t).row(0);
        return B0 * (axis - 3 * axis.dot(r) * r);
    }

    static MagneticOrbit any(Random &random)
    {
        MagneticOrbit orbit;
        orbit.u = random.real(0, 2 * pi);
        orbit.longitude = random.real(0, 2 * pi);
        return orbit;
    }
};

/// What acts on a craft during a step.
struct Actions {
    Vector3d dipole_B = Vector3d::Zero(), wheels_B = Vector3d::Zero(), disturbance_B = Vector3d::Zero();
    double gravity_gradient = 0; ///< 3 n^2, or 0
};

struct Craft {
    Matrix3d I = Vector3d(0.05, 0.12, 0.125).asDiagonal();
    Eigen::Vector4d q{1, 0, 0, 0};
    Vector3d omega = Vector3d::Zero(), h = Vector3d::Zero(); ///< h: of the wheels

    void measure(const Matrix3d &dcm_BN)
    {
        const Eigen::Quaterniond from(dcm_BN.transpose());
        q << from.w(), from.x(), from.y(), from.z();
    }
    static Matrix3d dcm_BN(const Eigen::Vector4d &q)
    {
        return Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized().toRotationMatrix().transpose();
    }
    Matrix3d dcm_BN() const { return dcm_BN(q); }
    double energy() const { return omega.dot(I * omega) / 2; }

    using State = Eigen::Matrix<double, 10, 1>;

    /// A step of dt, in the field and at the place of its middle.
    void step(const MagneticOrbit &orbit, double t, double dt, const Actions &act)
    {
        const Matrix3d inverse = I.inverse();
        const Vector3d B_N = orbit.field_N(t + dt / 2), r_N = orbit.hill(t + dt / 2).row(0);
        auto rate = [&](const State &x) {
            const Eigen::Vector4d p = x.head<4>();
            const Vector3d w = x.segment<3>(4), wheels = x.tail<3>();
            const Matrix3d C = dcm_BN(p);
            const Vector3d r = C * r_N;
            Vector3d L = act.dipole_B.cross(C * B_N) + act.wheels_B + act.disturbance_B;
            L += act.gravity_gradient * r.cross(I * r) - w.cross(I * w + wheels);
            const Vector3d v = p.tail<3>();
            State dx;
            dx[0] = -v.dot(w) / 2;
            dx.segment<3>(1) = (p[0] * w + v.cross(w)) / 2;
            dx.segment<3>(4) = inverse * L;
            dx.tail<3>() = -act.wheels_B;
            return dx;
        };
        State x;
        x << q, omega, h;
        const State a = rate(x), b = rate(x + dt / 2 * a), c = rate(x + dt / 2 * b), d = rate(x + dt * c);
        x += dt / 6 * (a + 2 * b + 2 * c + d);
        q = x.head<4>().normalized();
        omega = x.segment<3>(4);
        h = x.tail<3>();
    }
};

/// Rods along the axes of B.
inline RodSet three_rods(double m_max)
{
    RodSet rods{};
    rods.head = good();
    rods.n = 3;
    for (int i = 0; i < 3; i++) {
        rods.axes_B[i] = vec(Vector3d::Unit(i));
        rods.m_max[i] = m_max;
    }
    return rods;
}

/// One to eight rods, no two of the first three near each other.
inline RodSet any_rods(Random &random, int n, double m_max)
{
    RodSet rods{};
    rods.head = good();
    rods.n = static_cast<std::uint32_t>(n);
    for (int i = 0; i < n; i++) {
        rods.axes_B[i] = vec(i < 3 ? (Vector3d::Unit(i) + random.vector(0.3)).normalized() : random.direction());
        rods.m_max[i] = m_max;
    }
    return rods;
}

inline Vector3d dipole_of(const RodSet &rods, const RodCommand &command)
{
    Vector3d sum = Vector3d::Zero();
    for (std::uint32_t i = 0; i < rods.n; i++) {
        sum += command.dipole[i] * eigen(rods.axes_B[i]);
    }
    return sum;
}

} // namespace flight::testing
