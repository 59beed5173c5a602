// SPDX-License-Identifier: Apache-2.0
// Gravity of point masses with zonal harmonics J2 to J6, about each body's pole.
//
//   U = mu / r (1 - sum_n J_n (R / r)^n P_n(s)),   s = r . pole / |r|
#pragma once

#include "flight/math/vec.h"

#include <Eigen/Core>

#include <array>
#include <string>

namespace fledge::world {

/// A body that attracts. It moves uniformly: r_PN_N + v_PN_N t. N is inertial.
struct GravityBody {
    std::string name;
    double mu = 0.0;                 ///< [m^3/s^2]
    double radius = 0.0;             ///< [m] equatorial, of the zonal harmonics; 0: not given
    std::array<double, 5> J{};       ///< [-] J2, J3, J4, J5, J6; 0: none
    Eigen::Vector3d pole_N{0, 0, 1}; ///< unit vector of the axis of symmetry
    Eigen::Vector3d r_PN_N{0, 0, 0}; ///< [m] at time 0
    Eigen::Vector3d v_PN_N{0, 0, 0}; ///< [m/s]

    bool has_zonals() const;
};

/// The acceleration [m/s^2] at a position r_N [m] relative to a point mass: -mu r / |r|^3, written
/// so that the processor divides while it takes the root.
inline Vec3 point_mass_gravity(double mu, Vec3 r_N)
{
    const double r2 = vec_norm2(r_N);
    return vec_scale(-mu / (r2 * r2) * fm_sqrt(r2), r_N);
}

/// The acceleration [m/s^2] at a position r_N [m] relative to the body.
Eigen::Vector3d gravity(const GravityBody &body, const Eigen::Vector3d &r_N);

/// The potential U [m^2/s^2], positive as in mu / r: gravity is its gradient.
double gravity_potential(const GravityBody &body, const Eigen::Vector3d &r_N);

/// Check a body and make its pole a unit vector. Throws SetupError on mu <= 0, a negative radius,
/// harmonics without a radius, a pole of length 0, or numbers that are not finite.
GravityBody checked(GravityBody body);

} // namespace fledge::world
