// SPDX-License-Identifier: Apache-2.0
// Gravity of point masses with zonal harmonics J2 to J6, about each body's pole.
//
//   U = mu / r (1 - sum_n J_n (R / r)^n P_n(s)),   s = r . pole / |r|
//
// How these and whole fields act together on a spacecraft stands in attraction.h.
//
// Example:
//
//     #include "world/environment/attraction.h"
//     using namespace world;
//     Attraction attraction;
//     attraction.add({.name = "earth", .mu = 3.986004418e14, .radius = 6378137.0, .J = {1.08263e-3}});
#pragma once

#include "flight/math/vec.h"

#include <Eigen/Core>

#include <array>
#include <cmath>
#include <memory>
#include <optional>
#include <string>

namespace fledge::world {

class Harmonics;

/// A body that attracts. Where there is no sky it moves uniformly, r_PN_N + v_PN_N t, and N is
/// inertial.
struct GravityBody {
    std::string name{};
    double mu = 0.0;                 ///< [m^3/s^2]
    double radius = 0.0;             ///< [m] equatorial, of the zonal harmonics; 0: not given
    std::array<double, 5> J{};       ///< [-] J2, J3, J4, J5, J6; 0: none
    Eigen::Vector3d pole_N{0, 0, 1}; ///< unit vector of the axis of symmetry; a sky replaces it by the pole of date
    Eigen::Vector3d r_PN_N{0, 0, 0}; ///< [m] at time 0
    Eigen::Vector3d v_PN_N{0, 0, 0}; ///< [m/s]
    std::optional<int> naif{};       ///< the number by which a sky finds it
    /// Its gravity, which replaces mu, radius and J.
    std::shared_ptr<const Harmonics> field{};
    /// [m] Radius of the sphere about its centre that no spacecraft may enter; not given: `radius`; 0: none.
    std::optional<double> surface{};
    /// Whether pole_N holds also where a sky knows the pole of date.
    bool pole_stays = false;
    bool checked = false; ///< by the function below: it is taken as it is

    bool has_zonals() const;
};

/// The acceleration [m/s^2] at a position r_N [m] relative to a point mass: -mu r / |r|^3, written
/// so that the processor divides while it takes the root.
inline Vec3 point_mass_gravity(double mu, Vec3 r_N)
{
    const double r2 = vec_norm2(r_N);
    return vec_scale(-mu / (r2 * r2) * fm_sqrt(r2), r_N);
}

inline Eigen::Vector3d point_mass_gravity(double mu, const Eigen::Vector3d &r_N)
{
    return (-mu / (r_N.squaredNorm() * r_N.norm())) * r_N;
}

/// What a distant point mass at r_PN_N adds to the acceleration at r_N relative to N's origin,
/// which it attracts too: mu ((r_PN - r) / |r_PN - r|^3 - r_PN / |r_PN|^3), but without the loss of
/// digits in the difference. Source: Battin, section 8.4.
inline Eigen::Vector3d third_body_gravity(double mu, const Eigen::Vector3d &r_N, const Eigen::Vector3d &r_PN_N)
{
    const Eigen::Vector3d d = r_N - r_PN_N;
    const double q = r_N.dot(d - r_PN_N) / r_PN_N.squaredNorm(); // |d|^2 / |r_PN|^2 - 1
    const double f = q * (3.0 + q * (3.0 + q)) / (1.0 + (1.0 + q) * std::sqrt(1.0 + q));
    return (-mu / (d.squaredNorm() * d.norm())) * (r_N + f * r_PN_N);
}

/// The acceleration [m/s^2] at a position r_N [m] relative to the body, by mu and J about a pole, a unit vector.
Eigen::Vector3d gravity(const GravityBody &body, const Eigen::Vector3d &r_N, const Eigen::Vector3d &pole_N);
inline Eigen::Vector3d gravity(const GravityBody &body, const Eigen::Vector3d &r_N)
{
    return gravity(body, r_N, body.pole_N);
}

/// The potential U [m^2/s^2], positive as in mu / r: gravity is its gradient.
double gravity_potential(const GravityBody &body, const Eigen::Vector3d &r_N);

/// Check a body, make its pole a unit vector, take mu and radius from its field if there is one, and the surface
/// from the radius if it is not given.
/// Throws SetupError on mu <= 0, a negative radius or surface, harmonics J without a radius or besides a field,
/// a pole of length 0, or numbers that are not finite.
GravityBody checked(GravityBody body);

} // namespace fledge::world
