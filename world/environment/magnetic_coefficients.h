// SPDX-License-Identifier: Apache-2.0
// The coefficients of a magnetic field in spherical harmonics, as the World Magnetic Model has them in its .COF file.
//
//   V = a sum_n (a / r)^(n+1) sum_m (g_nm cos m lon + h_nm sin m lon) P_nm(sin lat),   B = -grad V
//
// with P in Schmidt's quasi-normalisation, geocentric latitude and a = 6371.2 km; g and h change at constant rates
// from the epoch on, for five years. With C = g / sqrt(2 n + 1), V has the form of a gravity potential with mu = a^2
// and fully normalised coefficients, less its point mass: Harmonics evaluates it.
//
// The file: a line of epoch, name and date; a line n m g h dg dh for each degree and order, in nT and nT a year; lines
// of nines.
// Source: the technical report of the World Magnetic Model (NOAA NCEI, BGS).
#pragma once

#include "world/environment/harmonics.h"

#include <string>

namespace fledge::world {

class MagneticCoefficients {
public:
    /// Of a .COF file, to a degree; 0: all. Throws SetupError with file and line where it is damaged.
    static MagneticCoefficients read(const std::string &path, int degree);

    const std::string &name() const { return name_; }
    int degree() const { return main_.degree(); }

    /// [years], decimal: the epoch, and the end of its validity.
    double epoch() const { return epoch_; }
    double end() const { return epoch_ + 5.0; }

    /// Bounds outside the sphere of radius a, until end(): of a component's fourth derivatives along an axis [T/m^4],
    /// and of its rate [T a year].
    double most_fourth_derivative() const { return most_fourth_derivative_; }
    double most_rate() const { return most_rate_; }

    /// [T] at r_P [m], axes fixed in the Earth, in a decimal year. A new year takes as long as half a field, which is
    /// then that of this year for further places. Not for two threads at a time.
    Eigen::Vector3d field(const Eigen::Vector3d &r_P, double year) const;

private:
    MagneticCoefficients(std::string name, double epoch, const HarmonicField &main, const HarmonicField &rate);

    std::string name_;
    double epoch_, most_fourth_derivative_ = 0.0, most_rate_ = 0.0;
    Harmonics main_, rate_; ///< [nT], [nT a year]
    mutable Harmonics now_; ///< [nT] in the year that was asked for last, without a point mass
    mutable double year_ = epoch_;
};

} // namespace fledge::world
