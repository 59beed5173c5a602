// SPDX-License-Identifier: Apache-2.0
// NRLMSISE-00's expansions of temperatures and densities at their boundaries: in Legendre functions of latitude, local
// time, season, longitude, time of day, the flux of the Sun and the magnetic activity.
#pragma once

#include "flight/math/elementary.h"
#include "world/environment/air/air.h"
#include "world/environment/air/nrlmsise00_coefficients.h"

#include <array>

namespace fledge::world::nrlmsise {

/// The model's rounding of pi / 180.
inline constexpr double per_degree = 1.74533e-2;

struct Angle {
    double c = 1.0, s = 0.0;

    static Angle of(double angle)
    {
        Angle result;
        fm_sincos(angle, &result.s, &result.c);
        return result;
    }
    Angle operator+(const Angle &other) const { return {c * other.c - s * other.s, s * other.c + c * other.s}; }
    /// The cosine of this angle less a phase.
    double after(const Angle &phase) const { return c * phase.c + s * phase.s; }
};

/// The coefficients of an expansion, with what follows from them.
struct Set {
    const double *p = nullptr;
    double mean = 0.0, log_mean = 0.0; ///< of what varies
    bool regional = false;             ///< whether it depends on longitude and time of day
    Angle phase[138];                  ///< of the coefficients that are phases
};

const Set &set_of(Upper which);
const Set &set_of(Lower which);

/// What each ap that counts causes, whatever its age; most sets of coefficients have the same rate and slope.
struct Responses {
    double rate, slope;
    std::array<double, 7> of_ap{};

    Responses(const double *p, const SolarActivity &now);
};

/// What the expansions have in common at a place and instant.
struct Terms {
    double P[4][8] = {}; ///< Legendre functions by order and degree, not normalised, of the sine of latitude
    double latitude;     ///< [deg]
    double flux, rise;   ///< mean flux less 150, flux of the day less the mean
    Angle day, half_year, local[4], longitude, second, second_longitude;
    const SolarActivity &activity;
    Responses common;

    Terms(const AirPlace &place, const SolarActivity &now);
};

/// The magnetic activity as a set of coefficients weighs it.
double magnetic(const Set &set, const Terms &t);

/// Relative variation of a quantity of the thermosphere, of its logarithm for densities.
double variation(Upper which, const Terms &t);

/// The same of a quantity below 120 km; ap: as a set of the thermosphere weighs it.
double variation(Lower which, const Terms &t, double ap);

} // namespace fledge::world::nrlmsise
