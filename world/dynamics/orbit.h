// SPDX-License-Identifier: Apache-2.0
// Classical orbital elements of every conic, to the state and back.
#pragma once

#include <Eigen/Core>

namespace fledge::world {

/// Classical elements. The node is measured from the first axis of N about its third; an equatorial
/// orbit has its node on the first axis, a circular one its periapsis at the node.
struct OrbitElements {
    double p = 0.0;     ///< [m]   semi-latus rectum: what every conic has
    double e = 0.0;     ///< [-]   eccentricity
    double i = 0.0;     ///< [rad] inclination
    double Omega = 0.0; ///< [rad] right ascension of the ascending node; 0 if equatorial
    double omega = 0.0; ///< [rad] argument of periapsis; 0 if circular
    double f = 0.0;     ///< [rad] true anomaly; from the node if circular

    /// [m] p / (1 - e^2): negative for a hyperbola, infinite for a parabola.
    double semi_major_axis() const;
};

struct OrbitState {
    Eigen::Vector3d r; ///< [m]   relative to the attracting body
    Eigen::Vector3d v; ///< [m/s]
};

/// p [m] of an orbit of semi-major axis a [m] and eccentricity e. Throws SetupError unless a > 0
/// and 0 <= e < 1, or a < 0 and e > 1; a parabola has no semi-major axis.
double semi_latus_rectum(double a, double e);

/// Throws SetupError on elements that describe no orbit: mu <= 0, p <= 0, e < 0, f at or beyond an
/// asymptote, numbers that are not finite.
OrbitState orbit_state(double mu, const OrbitElements &elements);

/// Angles are in [0, 2 pi), i in [0, pi], but f in (-pi, pi) on open orbits. Within 1e-12, orbits
/// count as circular (e = 0) and equatorial (i = 0 or pi), within 2e-15 as parabolic (e = 1).
/// Throws SetupError on mu <= 0, on a state that is not finite, and on a rectilinear one (r and v
/// along one line), which these elements cannot describe.
OrbitElements orbit_elements(double mu, const OrbitState &state);

} // namespace fledge::world
