// SPDX-License-Identifier: Apache-2.0
// What the laws of the Earth's upper air have in common: where and when they are evaluated, by which activity of the
// Sun and of the magnetic field, and what they give. Each law is a pure function of a place and an activity.
#pragma once

#include <array>

namespace fledge::world {

/// A place and an instant, as the laws need them.
struct AirPlace {
    double altitude = 0.0;            ///< [m] over the ellipsoid
    double latitude = 0.0;            ///< [rad] geodetic
    double geocentric_latitude = 0.0; ///< [rad]
    double longitude = 0.0;           ///< [rad] to the east
    double mjd = 0.0;                 ///< [days] modified Julian date, UTC
    int year = 2000;                  ///< of UTC
    int day_of_year = 1;              ///< 1 to 366
    double seconds_of_day = 0.0;      ///< [s] of UTC
    double sun_declination = 0.0;     ///< [rad] of the true Sun, equator of date
    double hour_angle = 0.0;          ///< [rad] of the true Sun at the place: 0 at noon, > 0 in the afternoon
};

/// Indices of the Sun's and the magnetic field's activity. Fluxes are observed ones, as they reach the Earth, in solar
/// flux units, 1e-22 W/m^2/Hz.
struct SolarActivity {
    double F107 = 150.0;         ///< at 10.7 cm, of the day before
    double F107_average = 150.0; ///< mean of 81 days, the day in their middle
    /// NRLMSISE-00: [0] the day's mean ap; [1] ap now, [2], [3], [4] 3, 6 and 9 h before, [5] mean of 12 to 33 h and
    /// [6] of 36 to 57 h before
    std::array<double, 7> ap{4.0, 4.0, 4.0, 4.0, 4.0, 4.0, 4.0};
    bool history = false;                    ///< whether ap[1] to ap[6] count in place of the day's mean
    double ap_before = 4.0;                  ///< MET: ap 6.7 h before
    double kp_before = 1.0;                  ///< DTM2000: Kp of 3 h before
    double kp_average = 1.0;                 ///< DTM2000: mean Kp of the last 24 h
    double S10 = 150.0, S10_average = 150.0; ///< JB2008: extreme ultraviolet, 1 day before
    double M10 = 150.0, M10_average = 150.0; ///< JB2008: Mg II, 2 days before
    double Y10 = 150.0, Y10_average = 150.0; ///< JB2008: X-rays and Lyman alpha, 5 days before
    double F10_jb = 150.0;                   ///< JB2008: F10.7, 1 day before
    double storm_temperature = 0.0;          ///< [K] JB2008: what a storm adds to the exosphere's, DTC
};

/// Number densities [1/m^3]; 0 where a law has no such species.
struct AirSpecies {
    double He = 0.0, O = 0.0, N2 = 0.0, O2 = 0.0, Ar = 0.0, H = 0.0, N = 0.0, anomalous_O = 0.0;
};

/// The air at a place.
struct AirComposition {
    double density = 0.0;     ///< [kg/m^3] what drag feels
    double temperature = 0.0; ///< [K] there
    double exosphere = 0.0;   ///< [K] far above
    double molar_mass = 0.0;  ///< [kg/mol] mean
    AirSpecies species;
};

} // namespace fledge::world
