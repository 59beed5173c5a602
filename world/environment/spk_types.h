// SPDX-License-Identifier: Apache-2.0
// How the segments of SPK kernels give states that are not Chebyshev polynomials of equal intervals.
//
//   5         states; from the two around an instant along conics, which the cosine weights
//   8, 9, 18  Lagrange's polynomials through states, positions and velocities each for themselves
//   12, 13    Hermite's polynomials through positions, with the velocities as rates
//   18        of subtype 0 Hermite's through positions and through velocities, each with its own rates
//   1, 21     modified divided differences of the accelerations, of a multistep integrator
//
// Sources: NAIF, "SPK Required Reading"; Krogh, "Changing stepsize in the integration of differential
// equations using modified divided differences", 1974; Bate, Mueller, White, "Fundamentals of
// Astrodynamics", ch. 4 (universal variables).
#pragma once

#include "world/environment/ephemeris.h"

namespace fledge::world {

/// An instant as whole seconds, exact in a double over any span, and the rest.
struct Instant {
    double whole, rest;

    Instant(Epoch epoch, double tau)
    {
        const std::int64_t seconds = epoch.ns / 1'000'000'000;
        whole = static_cast<double>(seconds);
        rest = static_cast<double>(epoch.ns - seconds * 1'000'000'000) / 1e9 + tau;
    }

    double total() const { return whole + rest; }
    double since(double t) const { return (whole - t) + rest; }
};

/// [km, km/s, km/s^2] In the segment's axes, by a segment of any method but Chebyshev's.
BodyState state_between(const EphemerisSegment &s, const Instant &t);

/// [km, km/s, km/s^2] The state on a conic, dt [s] after the state r, v; mu: [km^3/s^2] > 0.
BodyState along_conic(const Eigen::Vector3d &r, const Eigen::Vector3d &v, double mu, double dt);

} // namespace fledge::world
