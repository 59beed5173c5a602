// SPDX-License-Identifier: Apache-2.0
// Keplerian motion over any time on any conic, by universal variables: with alpha = 2/r0 - v0^2/mu
// and the Stumpff functions c_k, the time is an increasing function of s,
//     t = r0 s c1 + (r0 . v0) s^2 c2 + mu s^3 c3,    c_k = c_k(mu alpha s^2),
// and the state follows from Lagrange's f and g. All in long double, so that what comes out is as
// exact as a double can hold. Source: J. M. A. Danby, Fundamentals of Celestial Mechanics, 6.9.
#pragma once

#include <Eigen/Dense>

#include <array>
#include <cmath>

namespace flight::testing {

struct Motion {
    Eigen::Vector3d r, v;
};

/// c_0 to c_3 of x: a Taylor series at x / 4^n, then n doublings.
inline std::array<long double, 4> stumpff(long double x)
{
    int doublings = 0;
    while (std::fabs(x) > 0.1L) {
        x /= 4;
        doublings++;
    }
    long double c2 = 0, c3 = 0, term = 0.5L;
    for (int k = 0; k < 12; k++) {
        c2 += term;
        c3 += term / static_cast<long double>(2 * k + 3);
        term *= -x / static_cast<long double>((2 * k + 3) * (2 * k + 4));
    }
    long double c1 = 1 - x * c3, c0 = 1 - x * c2;
    for (; doublings > 0; doublings--) {
        c3 = (c2 + c0 * c3) / 4;
        c2 = c1 * c1 / 2;
        c1 = c0 * c1;
        c0 = 2 * c0 * c0 - 1;
    }
    return {c0, c1, c2, c3};
}

/// The motion a time t after (or before) `at`.
inline Motion kepler(const Motion &at, double mu_, double t_)
{
    using V = Eigen::Matrix<long double, 3, 1>;
    V r0 = at.r.cast<long double>(), v0 = at.v.cast<long double>();
    long double mu = mu_, t = t_, r = r0.norm(), rv = r0.dot(v0);
    long double beta = 2 * mu / r - v0.squaredNorm();

    // Time rises with s at the rate |r|, so halving between two bounds always gets there; Newton's
    // step is taken where it stays between them.
    struct {
        long double time, rate, f, g, df, dg;
        V r;
    } now;
    auto evaluate = [&](long double s) {
        auto [c0, c1, c2, c3] = stumpff(beta * s * s);
        long double s2 = s * s;
        now.time = r * s * c1 + rv * s2 * c2 + mu * s2 * s * c3;
        now.rate = r * c0 + rv * s * c1 + mu * s2 * c2;
        now.f = 1 - mu / r * s2 * c2;
        now.g = now.time - mu * s2 * s * c3;
        now.df = -mu / (r * now.rate) * s * c1;
        now.dg = 1 - mu / now.rate * s2 * c2;
    };
    long double lo = t < 0 ? -1 : 0, hi = t < 0 ? 0 : 1, unit = std::fabs(t) / r;
    lo *= unit;
    hi *= unit;
    for (evaluate(t < 0 ? lo : hi); t < 0 ? now.time > t : now.time < t; evaluate(t < 0 ? lo : hi)) {
        (t < 0 ? hi : lo) = t < 0 ? lo : hi;
        (t < 0 ? lo : hi) *= 2;
    }
    long double s = (lo + hi) / 2;
    for (int i = 0; i < 200 && hi > lo; i++) {
        evaluate(s);
        (now.time < t ? lo : hi) = s;
        long double next = s - (now.time - t) / now.rate;
        if (!(next > lo && next < hi)) {
            next = (lo + hi) / 2;
        }
        if (next == s || std::fabs(next - s) < 1e-19L * std::fabs(s)) {
            break;
        }
        s = next;
    }
    evaluate(s);
    V r1 = now.f * r0 + now.g * v0, v1 = now.df * r0 + now.dg * v0;
    return {r1.cast<double>(), v1.cast<double>()};
}

} // namespace flight::testing
