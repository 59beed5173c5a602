// SPDX-License-Identifier: Apache-2.0
// True orbits about the Earth for tests: zonal harmonics by their Cartesian forms (Schaub and Junkins, section 11.3),
// the sectorial of degree 2 and drag besides, and extrapolated midpoint steps of order 6 (Gragg, Bulirsch, Stoer).
#pragma once

#include "flight/testing/eigen.h"

#include "flight/msg/ephemeris.h"

namespace flight::testing::orbits {

inline constexpr double mu_earth = 3.986004418e14, radius_earth = 6378137, turns_earth = 7.2921159e-5;
inline constexpr double J2_earth = 1.08262668e-3, J3_earth = -2.5327e-6, J4_earth = -1.6196e-6;
inline constexpr std::int64_t second = 1'000'000'000;

using State = Eigen::Matrix<double, 6, 1>;

/// A point of an orbit of semi-major axis a, eccentricity e and inclination i, anywhere else as it comes.
inline State on_orbit(Random &random, double a, double e, double i)
{
    const double p = a * (1 - e * e), f = random.real(-pi, pi), r = p / (1 + e * std::cos(f)),
                 k = std::sqrt(mu_earth / p);
    const Matrix3d c = (turn(2, random.real(-pi, pi)) * turn(0, i) * turn(2, random.real(-pi, pi))).transpose();
    State x;
    x << c * Vector3d(r * std::cos(f), r * std::sin(f), 0), c * Vector3d(-k * std::sin(f), k * (e + std::cos(f)), 0);
    return x;
}

struct Earth {
    Matrix3d c = Matrix3d::Identity(); ///< [PN] at time 0
    double J2 = J2_earth, J3 = J3_earth, J4 = J4_earth;
    double C22 = 0, S22 = 0;
    double along = 0; ///< [m/s^2] acceleration along the velocity
    double drag = 0;  ///< [1/m] acceleration = -drag |v| v, with v relative to the air

    Matrix3d dcm(double t) const { return turn(2, turns_earth * t) * c; }

    PlanetAttitude attitude(std::int64_t t) const
    {
        const Matrix3d C = dcm(1e-9 * static_cast<double>(t));
        return {good(t), mat(C), vec(C.row(2).transpose() * turns_earth)};
    }

    Vector3d acceleration(double t, const Vector3d &r_N, const Vector3d &v_N) const
    {
        const Matrix3d C = C22 != 0 || S22 != 0 ? dcm(t) : c; // zonals do not turn
        const Vector3d r = C * r_N, to = r.normalized();
        const double n = r.norm(), q = radius_earth / n, s = to.z(), s2 = s * s;
        Vector3d a = -to;
        const double a2 = -1.5 * J2 * q * q, a3 = 0.5 * J3 * q * q * q, a4 = 0.625 * J4 * q * q * q * q;
        a += a2 * Vector3d((1 - 5 * s2) * to.x(), (1 - 5 * s2) * to.y(), (3 - 5 * s2) * s);
        const double x3 = 5 * (7 * s2 - 3) * s, x4 = 3 - 42 * s2 + 63 * s2 * s2;
        a += a3 * Vector3d(x3 * to.x(), x3 * to.y(), 3 * (1 - 10 * s2 + 35.0 / 3 * s2 * s2));
        a += a4 * Vector3d(x4 * to.x(), x4 * to.y(), (15 - 70 * s2 + 63 * s2 * s2) * s);
        const double W = C22 * (to.x() * to.x() - to.y() * to.y()) + 2 * S22 * to.x() * to.y();
        const Vector3d dW(2 * C22 * to.x() + 2 * S22 * to.y(), 2 * S22 * to.x() - 2 * C22 * to.y(), 0);
        a += 3 * q * q * (dW - 5 * W * to);
        const Vector3d flow = v_N - turns_earth * c.row(2).transpose().cross(r_N);
        return C.transpose() * (mu_earth / (n * n) * a) - drag * flow.norm() * flow + along * v_N.normalized();
    }

    State derivative(double t, const State &x) const
    {
        State dx;
        dx << x.tail<3>(), acceleration(t, x.head<3>(), x.tail<3>());
        return dx;
    }

    /// By steps of up to H.
    State go(double t, State x, double end, double H = 10) const
    {
        const auto n = std::max(1L, std::lround(std::ceil(std::abs(end - t) / H)));
        for (long i = 0; i < n; i++) {
            x = step(t + (end - t) * static_cast<double>(i) / static_cast<double>(n), x,
                     (end - t) / static_cast<double>(n));
        }
        return x;
    }

    State step(double t, const State &x, double H) const
    {
        State T[3][3];
        for (int k = 0; k < 3; k++) {
            const int n = 2 * (k + 1);
            const double h = H / n;
            State before = x, now = x + h * derivative(t, x);
            for (int i = 1; i < n; i++) {
                const State next = before + 2 * h * derivative(t + i * h, now);
                before = now;
                now = next;
            }
            T[k][0] = 0.5 * (now + before + h * derivative(t + H, now));
            for (int j = 1; j <= k; j++) {
                const double ratio = std::pow((k + 1.0) / (k + 1.0 - j), 2);
                T[k][j] = T[k][j - 1] + (T[k][j - 1] - T[k - 1][j - 1]) / (ratio - 1);
            }
        }
        return T[2][2];
    }
};

} // namespace flight::testing::orbits
