// SPDX-License-Identifier: Apache-2.0
// Spherical-harmonic gravity fields from files.
//
//   SHADR  PDS: a header line (radius, mu, sigma of mu, degree, order, normalised?, reference
//          longitude, latitude), then a row per coefficient: n, m, C, S, sigma of C, sigma of S.
//          Separated by commas or blanks.
//   ICGEM  .gfc: lines of a keyword and its value up to end_of_head, then rows: gfc n m C S ... Rows gfct, trnd
//          (dot), acos and asin change in time:
//
//            C(t) = gfct + trnd (t - t0) + sum over periods p [acos cos(2 pi (t - t0) / p) + asin sin(...)]
//
//          icgem1.0 has t0 in the row gfct, icgem2.0 in each row, with the t1 up to which it holds.
//
// Source: PDS, SHADR software interface specification; ICGEM, "Format of the gravity field files".
#pragma once

#include "world/environment/timescale.h"

#include <cstddef>
#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace fledge::world {

/// Coefficients are fully normalised (4 pi), without the Condon-Shortley phase.
struct HarmonicField {
    std::string name;          ///< of the model, or of the file
    double mu = 0.0;           ///< [m^3/s^2]
    double radius = 0.0;       ///< [m] of reference
    int degree = 0, order = 0; ///< the highest
    std::string tide_system;   ///< tide_free, zero_tide, mean_tide or unknown: as stated, used as is
    std::vector<double> C, S;  ///< at index(n, m)

    static std::size_t index(int n, int m)
    {
        return static_cast<std::size_t>(n) * static_cast<std::size_t>(n + 1) / 2 + static_cast<std::size_t>(m);
    }

    /// A field of zeros but C00 = 1. Throws SetupError on mu or radius <= 0, degree < 0.
    static HarmonicField zero(double mu, double radius, int degree);

    /// The zonal harmonic J_n = -sqrt(2 n + 1) C_n0.
    double J(int n) const;
};

/// ICGEM if the name ends in .gfc or the file has a line end_of_head, else SHADR. What changes in time is as it is at
/// the epoch; throws SetupError where it changes and no epoch is given. Dates in the file count as TDB.
/// SHADR has km by its standard, files in m are about, and none says which: it is what comes nearer to `mu`, that of
/// the body [m^3/s^2], or, if that is 0, km where the radius is below 100,000.
/// Throws SetupError with file and line where the file is damaged, foreign, or ends too early.
/// Coefficients of the degrees 0 and 1 may be left out: then C00 = 1 and the rest 0; also those above `degree`, which
/// a file of J2 alone promises and has not.
HarmonicField read_gravity_field(const std::string &path, std::optional<Epoch> epoch = std::nullopt, double mu = 0.0,
                                 int degree = std::numeric_limits<int>::max());

} // namespace fledge::world
