// SPDX-License-Identifier: Apache-2.0
// The gravity of a spherical-harmonic field of any degree, fast, and without loss at the poles.
//
//   U = mu / r sum_n (R / r)^n sum_m P_nm(sin lat) (C_nm cos m lon + S_nm sin m lon)
//
// The gradient is taken in Cartesian components (Pines 1973), so that nothing is divided by cos
// lat. How the sums are arranged stands in harmonics.cpp.
#pragma once

#include "world/environment/harmonic_field.h"
#include "world/environment/solid_tides.h"

#include <Eigen/Core>

#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace fledge::world {

/// How a field is read from a file.
struct HarmonicsSetup {
    std::string path;                ///< SHADR or ICGEM
    std::optional<int> degree;       ///< the highest; none: that of the file
    std::string tides;               ///< the tide system of the file, or "file" for what it states; "": without tides
    std::optional<std::string> date; ///< at which coefficients hold that change
    double mu = 0.0;                 ///< [m^3/s^2] of the body, or 0, see read_gravity_field
};

class Harmonics {
public:
    /// Of the whole field, or up to a degree. Throws SetupError if the field has less.
    explicit Harmonics(const HarmonicField &field);
    Harmonics(const HarmonicField &field, int degree);

    /// Without the point mass mu / r, for fields that have none.
    void leave_out_the_point() { point_ = 0.0; }

    /// Take the coefficients a + factor b of two fields of this degree.
    void combine(const Harmonics &a, double factor, const Harmonics &b);

    int degree() const { return degree_; }
    double mu() const { return mu_; }
    double radius() const { return radius_; }

    /// The acceleration [m/s^2] at r_P [m] relative to the body's centre, both in axes fixed in
    /// the body (P). `potential`: if not null, receives U [m^2/s^2]. Outside the body; NaN at the
    /// centre.
    Eigen::Vector3d gravity(const Eigen::Vector3d &r_P, double *potential = nullptr) const;

    /// The same in inertial axes: dcm_PN from Orientation.
    Eigen::Vector3d gravity_N(const Eigen::Matrix3d &dcm_PN, const Eigen::Vector3d &r_N) const
    {
        return dcm_PN.transpose() * gravity(dcm_PN * r_N);
    }

    /// Those of the Earth that an Attraction adds; none unless set.
    std::optional<SolidTides> tides;

    std::optional<HarmonicsSetup> setup; ///< none if no file has it

private:
    /// What one degree of four neighbouring orders m needs.
    struct alignas(32) Terms {
        double beta[4];      ///< of the recursion
        double C[4], S[4];   ///< the order's own coefficients
        double dC[4], dS[4]; ///< those of the order before, for the derivative by s
    };

    struct Sums;
    template <typename Lanes> void add_up(double x, double y, double z, double q, Sums &sums) const;

    double mu_, radius_;
    double point_ = 1.0; ///< the share of the point mass
    int degree_;
    std::vector<Terms> terms_;
};

/// Throws SetupError with file and line where the file is damaged or foreign.
std::shared_ptr<Harmonics> read_harmonics(const HarmonicsSetup &setup);

} // namespace fledge::world
