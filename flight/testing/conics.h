// SPDX-License-Identifier: Apache-2.0
// Keplerian motion of a spacecraft about a planet, on conics of every kind in any orientation.
#pragma once

#include "flight/testing/eigen.h"
#include "flight/testing/kepler.h"

#include <algorithm>

namespace flight::testing {

inline constexpr double mu_mars = 4.2828314e13; // m^3/s^2

inline Vector3d gravity(const Vector3d &r, double mu)
{
    return -mu / std::pow(r.norm(), 3) * r;
}

/// A state on a conic of eccentricity e and periapsis radius q, before or after the periapsis, at a
/// distance of up to `reach` periapsis radii or up to the apoapsis.
inline Motion on_conic(Random &random, double mu, double q, double e, double reach)
{
    double p = q * (1 + e), farthest = e < 1 ? std::min(reach, (1 + e) / (1 - e)) : reach;
    double cosine = (p / (q * std::pow(farthest, random.real(0, 1))) - 1) / e;
    double f = e > 1e-3 ? std::acos(std::clamp(cosine, -1.0, 1.0)) : random.real(0, pi);
    f *= random.below(2) ? 1 : -1;
    double r = p / (1 + e * std::cos(f)), k = std::sqrt(mu / p);
    Matrix3d c = random.attitude();
    return {c * Vector3d(r * std::cos(f), r * std::sin(f), 0),
            c * Vector3d(-k * std::sin(f), k * (e + std::cos(f)), 0)};
}

inline Motion about_mars(Random &random, double e, double reach = 30)
{
    return on_conic(random, mu_mars, random.real(3.5e6, 5e7), e, reach);
}

} // namespace flight::testing
