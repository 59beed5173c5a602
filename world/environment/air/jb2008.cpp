// SPDX-License-Identifier: Apache-2.0
#include "world/environment/air/jb2008.h"

#include "flight/math/elementary.h"
#include "world/environment/air/jacchia.h"

#include <algorithm>
#include <cmath>

namespace fledge::world {

namespace {

/// The cubic polynomial over u, 0 to 1, with these values and slopes at its ends.
double cubic(double u, double value_0, double slope_0, double value_1, double slope_1)
{
    const double rise = value_1 - value_0;
    return value_0 + u * (slope_0 + u * (3.0 * rise - 2.0 * slope_0 - slope_1 + u * (slope_0 + slope_1 - 2.0 * rise)));
}

/// [K] of the exosphere that local time and latitude add: tables of the law for 200 km and for 300 to 600 km, and
/// cubic polynomials between them and to nothing. day: local solar time as a part of the day.
double local_correction(double F10, double day, double latitude, double z)
{
    if (z < 120.0 || z > 800.0) {
        return 0.0;
    }
    const double F = (F10 - 100.0) / 100.0, c = fm_cos(latitude);
    constexpr double sun[] = {-5.12114909, -69.3003609, 203.716701, 703.316291, -1943.49234, 1106.51308};
    const double by_sun = F * power_series(sun, day);

    // From 300 to 600 km: a value at z = 0 that extends the line, and its slope per 100 km.
    constexpr double high[] = {36.1416936, -174.378996, 1885.94601, -7093.71517, 9224.54523, -3845.08073};
    constexpr double rate[] = {-6.45841789, 40.9703319, -482.00656, 1818.70931, -2373.89204, 996.703815};
    const double high_value = -4.57512297 + by_sun + c * power_series(high, day);
    const double high_slope = c * power_series(rate, day);
    if (z > 600.0) {
        return cubic((z - 600.0) / 200.0, high_value + 6.0 * high_slope, 2.0 * high_slope, 0.0, 0.0);
    }
    if (z > 300.0) {
        return high_value + z / 100.0 * high_slope;
    }

    // At 200 km: the value, and its slope per 50 km.
    constexpr double shared[] = {12.7093998, -21.2825156, 2.75555432};
    constexpr double low[] = {0.0, 148.881951, -751.640284, 637.876542};
    constexpr double low_rate[] = {19.9956489, -220.835117, 1432.56989, -3184.81844, 3289.81513, -1353.32119};
    const double by_both = F * c * power_series(shared, day);
    const double low_value = 11.0234982 + c * power_series(low, day) + by_both;
    const double low_slope = -15.5986211 + by_sun + c * power_series(low_rate, day) - by_both;
    if (z <= 200.0) {
        return cubic((z - 120.0) / 80.0, 0.0, 0.0, low_value, low_slope);
    }
    if (z <= 240.0) {
        return low_value + (z - 200.0) / 50.0 * low_slope;
    }
    return cubic((z - 240.0) / 60.0, low_value + 0.8 * low_slope, low_slope, high_value + 3.0 * high_slope, high_slope);
}

/// Common logarithm of what the season adds to the density: by latitude below 200 km (Jacchia's equation 24), and
/// twice a year up to 2000 km.
double seasonal(const AirPlace &place, const SolarActivity &sun, double z)
{
    const double sine = fm_sin(place.geocentric_latitude);
    const double phase = 2.0 * M_PI / 365.2422 * (place.mjd - 36204.0) + 1.72;
    const double by_latitude = 0.02 * (z - 90.0) * fm_exp(-0.045 * (z - 90.0)) * sine * std::abs(sine) * fm_sin(phase);
    if (z >= 2000.0) {
        return by_latitude;
    }
    const double height = 1e-3 * z, F = sun.F107_average - 0.70 * sun.S10_average - 0.04 * sun.M10_average;
    const double amplitude = 0.2689 + F * (-0.01176 + height * (0.02782 - 0.02782 * height) + 3.470e-4 * height * F);
    double s, c;
    fm_sincos(2.0 * M_PI / 365.0 * (place.day_of_year - 1 + place.seconds_of_day / 86400.0), &s, &c);
    const double s2 = 2.0 * s * c, c2 = c * c - s * s;
    const double G = sun.F107_average - 0.75 * sun.S10_average - 0.37 * sun.M10_average;
    const double course = -0.3633 + 0.08506 * s + 0.2401 * c - 0.1897 * s2 - 0.2554 * c2 +
                          G * (-0.01790 + 5.650e-4 * s - 6.407e-4 * c - 3.418e-3 * s2 - 1.252e-3 * c2);
    return by_latitude + std::max(amplitude, 1e-6) * course;
}

/// A factor of the density far out, 1 up to 1000 km.
double far_out(double z, double F10_average)
{
    const double rate = 1.15e-3 - 2.11e-6 * F10_average; // [1/km]
    const auto factor = [&](double at) { return 0.22 - 2.0e-3 * F10_average + rate * at; };
    if (z >= 1500.0) {
        return factor(z);
    }
    return z > 1000.0 ? cubic((z - 1000.0) / 500.0, 1.0, 0.0, factor(1500.0), 500.0 * rate) : 1.0;
}

/// [K] Of the exosphere, by the Sun's and the storms' activity and the place under the Sun: equations 14 to 17.
double exosphere_temperature(const AirPlace &place, const SolarActivity &sun)
{
    const double share = std::min(1.0, std::sqrt(std::sqrt(sun.F107_average / 240.0)));
    const double mean = sun.F107_average * share + sun.S10_average * (1.0 - share);
    const double night = 392.4 + 3.227 * mean + 0.298 * (sun.F10_jb - sun.F107_average) +
                         2.259 * (sun.S10 - sun.S10_average) + 0.312 * (sun.M10 - sun.M10_average) +
                         0.178 * (sun.Y10 - sun.Y10_average);
    return night * jacchia_day(place.geocentric_latitude, place.sun_declination, place.hour_angle) +
           sun.storm_temperature;
}

} // namespace

AirComposition jb2008(const AirPlace &place, const SolarActivity &activity)
{
    const double z = std::max(90.0, 1e-3 * place.altitude);
    const double turns = place.hour_angle / (2.0 * M_PI) + 0.5;
    const double exosphere = exosphere_temperature(place, activity);
    const double local = local_correction(activity.F10_jb, turns - std::floor(turns), place.geocentric_latitude, z);
    const JacchiaAir air(exosphere + local);
    AirSpecies species = air.species(z, 3.46e-6 * 183.0 / 28.878082, 0.00934);
    species.H = z > 105.0 ? air.hydrogen(z, exosphere + local) : 0.0;
    const double factor = power_of_ten(seasonal(place, activity, z)) * far_out(z, activity.F107_average);
    return composition(species, factor, air.temperature(z), exosphere);
}

} // namespace fledge::world
