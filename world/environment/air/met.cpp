// SPDX-License-Identifier: Apache-2.0
#include "world/environment/air/met.h"

#include "flight/math/elementary.h"
#include "world/environment/air/jacchia.h"

#include <algorithm>
#include <cmath>

namespace fledge::world {

namespace {

struct Sun {
    double declination, hour_angle; ///< [rad]
};

/// By the law's own formulas of the date, within 0.04 deg of the true Sun from 1960 to 2040.
Sun sun_of(const AirPlace &place)
{
    constexpr double per_degree = M_PI / 180.0;
    const double days = place.mjd - 35838.0, midnight = std::floor(place.mjd);
    const double centuries = (midnight - 15019.5) / 36525.0;
    const double longitude = 0.0172028 * days + 0.0335 * fm_sin(0.017202 * (days - 3.0)) - 1.407;
    const double tilt = (23.4523 - 0.013 * centuries) * per_degree;
    const double greenwich = 99.6909833 + centuries * (36000.76892 + 0.00038708 * centuries) +
                             0.250684477 * 1440.0 * (place.mjd - midnight); // [deg]
    double s, c;
    fm_sincos(longitude, &s, &c);
    return {fm_asin(s * fm_sin(tilt)), greenwich * per_degree + place.longitude - fm_atan2(s * fm_cos(tilt), c)};
}

/// [K] Of the exosphere: equations 14 to 17, 20 and 23. year: the part of it that has passed.
double thermosphere_limit(const AirPlace &place, const SolarActivity &activity, const Sun &sun, double year)
{
    const double mean = activity.F107_average, ap = activity.ap_before;
    const double night = 383.0 + 3.32 * mean + 1.80 * (activity.F107 - mean);
    const double storm = ap + 100.0 * (1.0 - fm_exp(-0.08 * ap));
    // 342.3, 226.5 and 247.6 deg
    const double swing = 0.5 * (1.0 + fm_sin(2.0 * M_PI * year + 5.974262));
    const double late = year + 0.1145 * (fm_exp(2.16 * fm_log(swing)) - 0.5);
    const double semiannual =
        2.41 + mean * (0.349 + 0.206 * fm_sin(2.0 * M_PI * late + 3.9531708)) * fm_sin(4.0 * M_PI * late + 4.3214352);
    return night * jacchia_day(place.latitude, sun.declination, sun.hour_angle) + storm + semiannual;
}

/// Common logarithm of what season and latitude add to the density up to 170 km: Jacchia 1971, equation 24.
double low_season(double z, double latitude, double year)
{
    const double up = z - 90.0, sine = fm_sin(latitude);
    return 0.014 * up * fm_exp(-0.0013 * up * up) * fm_sin(2.0 * M_PI * year + 1.72) * sine * std::abs(sine);
}

/// Factor of helium by season and latitude: Jacchia 1971, equation 25.
double helium_season(double latitude, double declination)
{
    const double sine = fm_sin(M_PI / 4.0 - (declination < 0.0 ? -0.5 : 0.5) * latitude);
    return power_of_ten(0.65 * std::abs(declination) / 0.4091 * (sine * sine * sine - 0.35355));
}

} // namespace

AirComposition met(const AirPlace &place, const SolarActivity &activity)
{
    const double z = std::max(90.0, 1e-3 * place.altitude), year = place.day_of_year / 365.2422;
    const Sun sun = sun_of(place);
    const double exosphere = thermosphere_limit(place, activity, sun, year);
    const JacchiaAir air(exosphere);
    AirSpecies species = air.species(z, 2.1926e-5, 0.0093432);
    species.H = z > 500.0 ? air.hydrogen(z, air.temperature(500.0)) : 0.0;
    AirComposition all = composition(species, 1.0, air.temperature(z), exosphere);
    if (z <= 170.0) {
        all.density *= power_of_ten(low_season(z, place.latitude, year));
    } else if (z > 440.0) {
        // The law fades density and helium in from 440 to 500 km, each by its logarithm.
        const double factor = helium_season(place.latitude, sun.declination);
        const double full = (all.density + 6.646e-27 * (factor - 1.0) * species.He) / all.density;
        const double s = z < 500.0 ? fm_sin(M_PI / 120.0 * (z - 440.0)) : 1.0;
        all.species.He *= fm_exp(s * s * fm_log(factor));
        all.density *= fm_exp(s * s * fm_log(full));
    }
    return all;
}

} // namespace fledge::world
