// SPDX-License-Identifier: Apache-2.0
// How much of the Sun's disc a body hides: two circles on the sky, of the angular radii of the two spheres.
//
// The edges of umbra, penumbra and of the cone in which an eclipse is annular are exact: they are where the circles
// touch. Between them the circles are taken as flat, which is wrong by less than 3e-4 of the Sun's disc, also in low
// orbits.
//
// An oblate body becomes a sphere when space is stretched along its pole, and lines of sight stay straight. The Sun
// then is an ellipse, for which stands a circle that reaches as far towards the body. That is as exact as between
// spheres where the body looks larger than the Sun; where both look alike, it is wrong by up to the flattening, of the
// Sun's disc.
//
// Of bodies that meet before the Sun, the area is that of their circles together, as exact as that of each.
// Source: Montenbruck and Gill, section 3.4.2; for several bodies Green's theorem.
#pragma once

#include <Eigen/Core>

#include <span>

namespace fledge::world {

/// How a body looks before the Sun, whose own disc is the unit circle about (0, 0).
struct Disc {
    Eigen::Vector2d centre; ///< [-] in axes across the line to the Sun
    double radius;          ///< [-]

    bool meets(const Disc &other) const { return (centre - other.centre).norm() < radius + other.radius; }
};

/// The hidden share of the Sun's disc, 0 to 1. r_SB, r_PB: the observer relative to the centres of the Sun and of the
/// body [m]. 1 inside the body; 0 if the body is behind the Sun. Between 0 and 1, `disc` is what is seen of the body.
double hidden_share(const Eigen::Vector3d &r_SB, double sun_radius, const Eigen::Vector3d &r_PB, double body_radius,
                    Disc *disc = nullptr);

/// The same of an ellipsoid of revolution about its pole, a unit vector; its radii at the equator and the poles [m].
double hidden_share(const Eigen::Vector3d &r_SB, double sun_radius, const Eigen::Vector3d &r_PB, double equatorial,
                    double polar, const Eigen::Vector3d &pole, Disc *disc = nullptr);

/// What bodies hide of the first disc, the Sun's, together: a share, 0 to 1. No two of them are the same.
double hidden_together(std::span<const Disc> discs);

} // namespace fledge::world
