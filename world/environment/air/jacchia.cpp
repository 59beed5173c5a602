// SPDX-License-Identifier: Apache-2.0
#include "world/environment/air/jacchia.h"

#include "flight/math/elementary.h"

#include <algorithm>
#include <cmath>

namespace fledge::world {

namespace {

constexpr double gas_constant_1970 = 8314.32;              // [J/(kmol K)]
constexpr double avogadro_1970 = 6.02257e26;               // [1/kmol]
constexpr double lowest_temperature = 183.0;               // [K] at 90 km
constexpr double mixed_top = 105.0, inflection_km = 125.0; // [km]

struct Gas {
    double AirSpecies::*n;
    double M; ///< [kg/kmol]
};
constexpr Gas gases[] = {{&AirSpecies::N2, 28.0134}, {&AirSpecies::O2, 31.9988}, {&AirSpecies::O, 15.9994},
                         {&AirSpecies::Ar, 39.948},  {&AirSpecies::He, 4.0026},  {&AirSpecies::H, 1.00797}};
constexpr double hydrogen_mass = gases[5].M;

/// [kg/kmol] of the mixed air, equation 1.
double mass_when_mixed(double z)
{
    constexpr double c[] = {28.15204, -0.085586, 1.284e-4, -1.0056e-5, -1.021e-5, 1.5044e-6, 9.9826e-8};
    return power_series(c, z - 100.0);
}

} // namespace

JacchiaAir::JacchiaAir(double exosphere)
    : exosphere_(exosphere),
      // Equations 9 and 11.
      inflection_(444.3807 + 0.02385 * exosphere - 392.8292 * fm_exp(-0.0021357 * exosphere)),
      slope_(1.9 / 35.0 * (inflection_ - lowest_temperature))
{
}

double JacchiaAir::temperature(double z) const
{
    const double dz = z - inflection_km;
    if (dz <= 0.0) { // equation 10
        constexpr double third = -1.7 / (1.9 * 35.0 * 35.0), fourth = -0.8 / (1.9 * 35.0 * 35.0 * 35.0);
        return inflection_ + slope_ * dz * (1.0 + dz * dz * (third + fourth * dz));
    }
    const double A = 2.0 / M_PI * (exosphere_ - inflection_); // equation 13
    return inflection_ + A * fm_atan(slope_ / A * dz * (1.0 + 4.5e-6 * dz * dz * std::sqrt(dz)));
}

// By Gauss's rule of six points in each of the layers.
double JacchiaAir::integral(double a, double b, bool mixed) const
{
    constexpr double tops[] = {mixed_top, inflection_km, 160.0, 200.0, 300.0, 500.0, 1500.0, 1e9};
    constexpr double node[] = {0.2386191860831969, 0.6612093864662645, 0.9324695142031521};
    constexpr double weight[] = {0.4679139345726910, 0.3607615730481386, 0.1713244923791704};
    constexpr double radius = 6356.766; // [km]
    double sum = 0.0;
    for (const double top : tops) {
        if (top <= a) {
            continue;
        }
        const double half = 0.5 * (std::min(b, top) - a), middle = a + half;
        for (int i = 0; i < 6; i++) {
            const double z = middle + (i % 2 == 0 ? -half : half) * node[i / 2];
            const double r = 1.0 + z / radius;
            sum += half * weight[i / 2] * (mixed ? mass_when_mixed(z) : 1.0) / (r * r * temperature(z));
        }
        if (b <= top) {
            break;
        }
        a = top;
    }
    return 1e3 * 9.80665 / gas_constant_1970 * sum;
}

double JacchiaAir::fall(double a, double b) const
{
    return integral(a, b, false);
}

AirSpecies JacchiaAir::species(double z, double base, double argon) const
{
    // Equations 3 to 5: oxygen is partly dissociated, as the molar mass says.
    const double top = std::min(z, mixed_top), T_top = temperature(top), M = mass_when_mixed(top);
    const double density = base * M / T_top * fm_exp(-integral(90.0, top, true));
    const double all = avogadro_1970 * density / M, ground = avogadro_1970 * density / 28.96;
    AirSpecies n;
    n.N2 = 0.78110 * ground;
    n.O2 = 1.20955 * ground - all;
    n.O = 2.0 * (all - ground);
    n.Ar = argon * ground;
    n.He = 1.289e-5 * ground;
    if (z > mixed_top) { // equation 6
        const double ratio = T_top / temperature(z), depth = fall(mixed_top, z);
        for (const Gas &gas : gases) {
            n.*gas.n *= ratio * fm_exp(-gas.M * depth);
        }
        n.He *= fm_exp(-0.38 * fm_log(ratio));
    }
    return n;
}

double JacchiaAir::hydrogen(double z, double at_500) const
{
    const double log_T = fm_log(at_500) / M_LN10; // equation 7
    const double depth = z < 500.0 ? -fall(z, 500.0) : fall(500.0, z);
    return power_of_ten(79.13 + log_T * (-39.40 + 5.5 * log_T)) * temperature(500.0) / temperature(z) *
           fm_exp(-hydrogen_mass * depth);
}

double jacchia_day(double latitude, double declination, double hour_angle)
{
    const auto power = [](double x) { return x * x * std::sqrt(x); };
    const double night = power(fm_sin(0.5 * std::abs(latitude + declination)));
    const double noon = power(fm_cos(0.5 * std::abs(latitude - declination)));
    const double lag = hour_angle - 0.64577182 + 0.10471976 * fm_sin(hour_angle + 0.75049158);
    const double c = std::abs(fm_cos(0.5 * lag));
    return 1.0 + 0.31 * (night + (noon - night) * c * c * c);
}

AirComposition composition(AirSpecies species, double factor, double temperature, double exosphere)
{
    double mass = 0.0, count = 0.0;
    for (const Gas &gas : gases) {
        species.*gas.n *= factor;
        mass += species.*gas.n * gas.M;
        count += species.*gas.n;
    }
    return {mass / avogadro_1970, temperature, exosphere, 1e-3 * mass / count, species};
}

double power_of_ten(double x)
{
    return fm_exp(M_LN10 * x);
}

} // namespace fledge::world
