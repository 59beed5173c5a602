// SPDX-License-Identifier: Apache-2.0
// How much of the Sun's disc a body hides: two circles on the sky, of the angular radii of the two spheres.
//
// The edges of umbra, penumbra and of the cone in which an eclipse is annular are exact: they are where the circles
// touch. Between them the circles are taken as flat, which is wrong by less than 3e-4 of the Sun's disc, also in low
// orbits.
// Source: Montenbruck and Gill, section 3.4.2.
#pragma once

#include <Eigen/Core>

namespace fledge::world {

/// The hidden share of the Sun's disc, 0 to 1. r_SB, r_PB: the observer relative to the centres of the Sun and of the
/// body [m]. 1 inside the body; 0 if the body is behind the Sun.
double hidden_share(const Eigen::Vector3d &r_SB, double sun_radius, const Eigen::Vector3d &r_PB, double body_radius);

} // namespace fledge::world
