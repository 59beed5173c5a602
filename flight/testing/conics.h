// SPDX-License-Identifier: Apache-2.0
// Keplerian motion of a spacecraft about a planet, on conics of every kind in any orientation.
#pragma once

#include "flight/testing/eigen.h"
#include "flight/testing/kepler.h"

namespace flight::testing {

inline constexpr double mu_mars = 4.2828314e13; // m^3/s^2

inline Vector3d gravity(const Vector3d &r, double mu) { return -mu / std::pow(r.norm(), 3) * r; }

/// A state at a periapsis of radius q, on a conic of eccentricity e.
inline Motion periapsis(Random &random, double e, double q, double mu)
{
    Matrix3d c = random.attitude();
    return {c.row(0).transpose() * q, c.row(1).transpose() * std::sqrt(mu * (1 + e) / q)};
}

/// A state on a conic about Mars, up to `passages` time scales of the periapsis passage from there.
inline Motion on_conic(Random &random, double e, double passages = 5)
{
    double q = random.real(3.5e6, 5e7);
    double passage = std::sqrt(q * q * q / mu_mars);
    return kepler(periapsis(random, e, q, mu_mars), mu_mars, random.real(-passages, passages) * passage);
}

} // namespace flight::testing
