// SPDX-License-Identifier: Apache-2.0
// Jacchia's static air of 1970, on which JB2008 and MET are built: a profile of temperature for each temperature of the
// exosphere, mixed air from 90 to 105 km, and above that each species in its own diffusive equilibrium.
// Source: Jacchia 1970; the numbers of its equations stand in comments. Altitudes are in km.
#pragma once

#include "world/environment/air/air.h"

#include <cstddef>

namespace fledge::world {

class JacchiaAir {
public:
    /// exosphere: the temperature [K] that the profile approaches far above.
    explicit JacchiaAir(double exosphere);

    double temperature(double z) const; ///< [K] from 90 km on

    /// Integral of g / (R T) over the altitude from a to b [kmol/kg], 105 <= a <= b.
    double fall(double a, double b) const;

    /// Number densities [1/m^3] of all but hydrogen, from 90 km on. base: density times temperature over molar mass at
    /// 90 km [kg/m^3 K kmol/kg]; argon: its share by volume on the ground.
    AirSpecies species(double z, double base, double argon) const;

    /// Number density [1/m^3] of hydrogen above 105 km, from that at 500 km by a temperature [K].
    double hydrogen(double z, double at_500) const;

private:
    double exosphere_, inflection_, slope_; ///< [K], [K] at 125 km, [K/km] there

    double integral(double a, double b, bool mixed) const;
};

/// How much warmer than in the night's minimum the exosphere is: equations 15 to 17. All in [rad].
double jacchia_day(double latitude, double declination, double hour_angle);

/// These species times a factor, and what they are together.
AirComposition composition(AirSpecies species, double factor, double temperature, double exosphere);

double power_of_ten(double x);

/// c[0] + c[1] x + c[2] x^2 + ...
template <std::size_t size> double power_series(const double (&c)[size], double x)
{
    double sum = 0.0;
    for (std::size_t i = size; i-- > 0;) {
        sum = sum * x + c[i];
    }
    return sum;
}

} // namespace fledge::world
