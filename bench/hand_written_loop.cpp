// SPDX-License-Identifier: Apache-2.0
// The nadir spin as one would write it by hand for this one mission: four wheels, one gravity body,
// one file, Eigen, everything known at compile time. It is what the simulator's speed is held
// against, and a second implementation of its equations (thesis Eqs. (2.13) to (2.22), (A.1) to (A.11)).
#include "bench/bench.h"

#include <Eigen/Dense>
#include <cmath>
#include <numbers>

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::Vector4d;
using Matrix34 = Eigen::Matrix<double, 3, 4>;

namespace {

using std::numbers::pi;
constexpr double mu = 4.2828314e13, a = 7471618.0, e = 0.4, f0 = 1.5 * pi;
constexpr double J = 0.1591549, u_max = 0.2, K = 2.531, P = 45.0, spin = 0.3 * pi / 180.0;

struct State {
    Vector3d r, v, sigma, omega;
    Vector4d Omega;
};

State operator+(const State &x, const State &y)
{
    return {x.r + y.r, x.v + y.v, x.sigma + y.sigma, x.omega + y.omega, x.Omega + y.Omega};
}

State operator*(double s, const State &x)
{
    return {s * x.r, s * x.v, s * x.sigma, s * x.omega, s * x.Omega};
}

Matrix3d tilde(const Vector3d &x)
{
    return (Matrix3d() << 0.0, -x[2], x[1], x[2], 0.0, -x[0], -x[1], x[0], 0.0).finished();
}

Matrix3d dcm(const Vector3d &sigma)
{
    const double s2 = sigma.squaredNorm(), d = 1.0 + s2;
    const Matrix3d t = tilde(sigma);
    return Matrix3d::Identity() + (8.0 * t * t - 4.0 * (1.0 - s2) * t) / (d * d);
}

/// By way of the quaternion whose largest component is taken from the diagonal (Shepperd).
Vector3d mrp(const Matrix3d &c)
{
    const Eigen::Quaterniond q(Matrix3d(c.transpose()));
    const double sign = q.w() < 0.0 ? -1.0 : 1.0;
    return sign * q.vec() / (1.0 + sign * q.w());
}

struct Craft {
    Craft()
    {
        const double h = std::sqrt(0.5);
        G << -0.5, 0.5, 0.5, -0.5, 0.5, 0.5, -0.5, -0.5, -h, -h, -h, -h;
        G.colwise().normalize();
        I = Vector3d(700.0, 700.0, 800.0).asDiagonal();
        I_inverse = I.inverse();
        mapping = -G.transpose() * (G * G.transpose()).inverse();
    }

    State derivative(const State &x, const Vector4d &u) const
    {
        const double r2 = x.r.squaredNorm();
        const double s2 = x.sigma.squaredNorm();
        const Vector3d h = J * (G * (G.transpose() * x.omega + x.Omega));
        State d;
        d.r = x.v;
        d.v = -mu / (r2 * std::sqrt(r2)) * x.r;
        d.sigma = 0.25 * ((1.0 - s2) * x.omega + 2.0 * x.sigma.cross(x.omega) + 2.0 * x.sigma.dot(x.omega) * x.sigma);
        d.omega = I_inverse * (-x.omega.cross(I * x.omega + h) - G * u);
        d.Omega = u / J - G.transpose() * d.omega;
        return d;
    }

    /// The flight software: attitude, rates and wheel speeds in, motor torques out.
    Vector4d command(const State &x, double t) const
    {
        // The Hill frame and its motion.
        const Vector3d h = x.r.cross(x.v);
        const double r = x.r.norm();
        Matrix3d HN;
        HN.row(0) = x.r / r;
        HN.row(2) = h.normalized();
        HN.row(1) = HN.row(2).cross(HN.row(0));
        const Vector3d omega_H = h / (r * r);
        const Vector3d domega_H = -2.0 * x.v.dot(x.r) / (r * r) * omega_H;
        // The spin about its first axis.
        const double phi = spin * t, c = std::cos(phi), s = std::sin(phi);
        Matrix3d RH;
        RH << 1.0, 0.0, 0.0, 0.0, c, s, 0.0, -s, c;
        const Matrix3d RiN = RH * HN;
        const Vector3d turn = RiN.transpose() * Vector3d(spin, 0.0, 0.0);
        const Vector3d omega_R = omega_H + turn;
        const Vector3d domega_R = domega_H + omega_H.cross(turn);
        // The control frame is the body turned by half a turn about its third axis.
        Matrix3d RN = RiN;
        RN.row(0) *= -1.0;
        RN.row(1) *= -1.0;
        const Matrix3d BN = dcm(x.sigma);
        const Vector3d sigma_BR = mrp(BN * RN.transpose());
        const Vector3d omega_RN = BN * omega_R, domega_RN = BN * domega_R;
        const Vector3d omega_BR = x.omega - omega_RN;
        // Feedback.
        const Vector3d H = I * x.omega + J * (G * (G.transpose() * x.omega + x.Omega));
        const Vector3d torque =
            -(K * sigma_BR + P * omega_BR - omega_RN.cross(H) + I * (x.omega.cross(omega_RN) - domega_RN));
        const Vector4d u = mapping * torque;
        const double largest = u.cwiseAbs().maxCoeff();
        return largest > u_max ? Vector4d(u * (u_max / largest)) : u;
    }

    Matrix34 G;
    Matrix3d I, I_inverse;
    Eigen::Matrix<double, 4, 3> mapping;
};

State initial()
{
    const double p = a * (1.0 - e * e), r = p / (1.0 + e * std::cos(f0)), w = std::sqrt(mu / p);
    return {{r * std::cos(f0), r * std::sin(f0), 0.0},
            {-w * std::sin(f0), w * (e + std::cos(f0)), 0.0},
            {0.1, 0.2, -0.3},
            {0.001, -0.01, 0.03},
            Vector4d::Zero()};
}

} // namespace

void hand_written_loop(long steps, double *end)
{
    constexpr double dt = 0.1;
    const Craft craft;
    State x = initial();
    Vector4d u = craft.command(x, 0.0);
    for (long i = 1; i <= steps; i++) {
        const State k1 = craft.derivative(x, u);
        const State k2 = craft.derivative(x + 0.5 * dt * k1, u);
        const State k3 = craft.derivative(x + 0.5 * dt * k2, u);
        const State k4 = craft.derivative(x + dt * k3, u);
        x = x + dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
        if (const double s2 = x.sigma.squaredNorm(); s2 > 1.0) {
            x.sigma /= -s2;
        }
        if (i % 5 == 0) {
            u = craft.command(x, 0.1 * static_cast<double>(i));
        }
    }
    Eigen::Map<Eigen::Matrix<double, 16, 1>> out(end);
    out << x.r, x.v, x.sigma, x.omega, x.Omega;
}
