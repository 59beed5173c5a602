// SPDX-License-Identifier: Apache-2.0
// Spherical-harmonic gravity as textbooks have it, for comparison: fully normalised Legendre
// functions by the forward-column recursion (Holmes and Featherstone 2002, "standard") with
// factors computed in advance, partial derivatives by radius, latitude and longitude.
#pragma once

#include "world/environment/harmonic_field.h"

#include <Eigen/Core>

#include <vector>

namespace fledge::bench {

class PlainHarmonics {
public:
    PlainHarmonics(const world::HarmonicField &field, int degree);

    /// The acceleration [m/s^2] at r_P [m] in axes fixed in the body. Not at the poles.
    Eigen::Vector3d gravity(const Eigen::Vector3d &r_P) const;

private:
    struct Terms {
        double a, b, f; ///< of the recursion and of the derivative
        double C, S;
    };

    double mu_, radius_;
    int degree_;
    std::vector<Terms> terms_;     ///< order by order, degrees m + 1 to the highest
    std::vector<double> sectoral_; ///< P_mm / cos(lat)^m
    std::vector<double> C_mm_, S_mm_;
    mutable std::vector<double> power_; ///< (R / r)^n
};

} // namespace fledge::bench
