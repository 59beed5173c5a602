// SPDX-License-Identifier: Apache-2.0
#include "world/environment/standard_atmosphere.h"

#include "flight/math/elementary.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace fledge::world {

namespace {

// All constants are the standard's. Lengths in km above 86 km.
constexpr double R = 8314.32;                     // [N m/(kmol K)]
constexpr double g0_1976 = 9.80665;               // [m/s^2]
constexpr double M0 = 28.9644;                    // [kg/kmol] of the air at sea level
constexpr double r0 = 6356.766;                   // [km] effective radius of the Earth
constexpr double boltzmann_1976 = 1.380622e-23;   // [N m/K]
constexpr double avogadro = 6.022169e26;          // [1/kmol]
constexpr double lowest = -5.0, highest = 1000.0; // [km]
constexpr double joint = 86.0;                    // [km] where the two parts meet

double power(double x, double y)
{
    return fm_exp(y * fm_log(x));
}

// ---- to 86 km -------------------------------------------------------------------------------------

struct Layer {
    double base;        ///< [km] geopotential
    double gradient;    ///< [K/km] of the molecular-scale temperature
    double temperature; ///< [K] molecular-scale, at the base
    double pressure;    ///< [Pa] at the base
};

/// In a layer: molecular-scale temperature and pressure at a geopotential height [km].
void in_layer(const Layer &layer, double height, double &temperature, double &pressure)
{
    const double dh = height - layer.base, lapse = 1e3 * g0_1976 * M0 / R; // [K/km]
    temperature = layer.temperature + layer.gradient * dh;
    pressure =
        layer.pressure * (layer.gradient == 0.0 ? fm_exp(-lapse * dh / layer.temperature)
                                                : power(layer.temperature / temperature, lapse / layer.gradient));
}

constexpr int layers = 7;

struct Lower {
    Layer layer[layers];

    Lower()
    {
        constexpr double base[] = {0.0, 11.0, 20.0, 32.0, 47.0, 51.0, 71.0};
        constexpr double gradient[] = {-6.5, 0.0, 1.0, 2.8, 0.0, -2.8, -2.0};
        layer[0] = {base[0], gradient[0], 288.15, 101325.0};
        for (int i = 1; i < layers; i++) {
            layer[i] = {base[i], gradient[i], 0.0, 0.0};
            in_layer(layer[i - 1], base[i], layer[i].temperature, layer[i].pressure);
        }
    }
};

/// M / M0 from 80 to 86 km, every 0.5 km: table 8 of the standard.
constexpr double mass_ratio[] = {1.0,      0.999996, 0.999989, 0.999971, 0.999941, 0.999909, 0.999870,
                                 0.999829, 0.999786, 0.999741, 0.999694, 0.999641, 0.999579};

Air lower(double Z)
{
    static const Lower all;
    const double H = r0 * Z / (r0 + Z);
    int i = layers - 1;
    while (i > 0 && H < all.layer[i].base) {
        i--;
    }
    double temperature, pressure;
    in_layer(all.layer[i], H, temperature, pressure);
    double ratio = 1.0;
    if (Z > 80.0) {
        const double at = 2.0 * (Z - 80.0);
        const int k = std::min(static_cast<int>(at), 11);
        ratio = mass_ratio[k] + (at - k) * (mass_ratio[k + 1] - mass_ratio[k]);
    }
    return {temperature * ratio, pressure, pressure * M0 / (R * temperature)};
}

// ---- from 86 km -----------------------------------------------------------------------------------

/// [K], and its slope [K/km].
double temperature(double Z, double &slope)
{
    if (Z <= 91.0) {
        slope = 0.0;
        return 186.8673;
    }
    if (Z <= 110.0) {
        const double A = -76.3232, a = -19.9429, u = (Z - 91.0) / a, root = std::sqrt(1.0 - u * u);
        slope = -A / a * u / root;
        return 263.1905 + A * root;
    }
    if (Z <= 120.0) {
        slope = 12.0;
        return 240.0 + 12.0 * (Z - 110.0);
    }
    const double rest = 640.0 * fm_exp(-0.01875 * (Z - 120.0) * (r0 + 120.0) / (r0 + Z));
    slope = 0.01875 * ((r0 + 120.0) / (r0 + Z)) * ((r0 + 120.0) / (r0 + Z)) * rest;
    return 1000.0 - rest;
}

double gravity_at(double Z)
{
    return g0_1976 * (r0 / (r0 + Z)) * (r0 / (r0 + Z));
}

/// [m^2/s] the coefficient of turbulent diffusion.
double turbulence(double Z)
{
    if (Z < 95.0) {
        return 120.0;
    }
    return Z < 115.0 ? 120.0 * fm_exp(1.0 - 400.0 / (400.0 - (Z - 95.0) * (Z - 95.0))) : 0.0;
}

/// Of O, O2, Ar, He: mass, density at 86 km, thermal diffusion, molecular diffusion, fluxes.
struct Species {
    double M, n, alpha, a, b, Q, U, W, q, u, w;
};
constexpr Species species[] = {
    {15.9994, 8.600e16, 0.0, 6.986e20, 0.750, -5.809644e-4, 56.90311, 2.706240e-5, -3.416248e-3, 97.0, 5.008765e-4},
    {31.9988, 3.030898e19, 0.0, 4.863e20, 0.750, 1.366212e-4, 86.0, 8.333333e-5, 0.0, 0.0, 0.0},
    {39.948, 1.351400e18, 0.0, 4.487e20, 0.870, 9.434079e-5, 86.0, 8.333333e-5, 0.0, 0.0, 0.0},
    {4.0026, 7.581730e14, -0.40, 1.700e21, 0.691, -2.457369e-4, 86.0, 6.666667e-4, 0.0, 0.0, 0.0}};
constexpr double M_N2 = 28.0134, n_N2 = 1.129794e20, M_H = 1.00797;

/// [1/km] of the logarithm of n T of one of the species, but for its sign. N: of all that it diffuses through.
double fall(const Species &s, double Z, double T, double slope, double N)
{
    const double D = s.a / N * power(T / 273.15, s.b), K = turbulence(Z);
    const double M = Z <= 100.0 ? M0 : M_N2;
    const double g_RT = 1e3 * gravity_at(Z) / (R * T); // [kmol/(kg km)]
    const double f = g_RT * D / (D + K) * (s.M + M * K / D) + D / (D + K) * s.alpha / T * slope;
    const double up = Z - s.U, down = s.u - Z;
    double flux = s.Q * up * up * fm_exp(-s.W * up * up * up);
    if (Z <= s.u) {
        flux += s.q * down * down * fm_exp(-s.w * down * down * down);
    }
    return f + flux;
}

} // namespace

StandardAtmosphere::StandardAtmosphere()
{
    constexpr int per_km = 20;
    constexpr double h = 1.0 / per_km, T7 = 186.8673;
    // By the rule of trapezoids: sums of what falls, for N2 and the four species; tau and the flux of hydrogen.
    double sum[5] = {}, last[5] = {}, n[5] = {};
    std::vector<double> below; // [1/m^3] of N2, O, O2, Ar and He together, and their mass, every km
    std::vector<double> mass;
    const int count = static_cast<int>(highest - joint) * per_km;
    for (int k = 0; k <= count; k++) {
        const double Z = joint + k * h;
        double slope;
        const double T = temperature(Z, slope);
        // The mean mass is M0 to 100 km, and a step ends there.
        const double heavy = Z > 100.0 + 0.5 * h ? M_N2 : M0;
        const auto advance = [&](int i, double rate, double n7) {
            if (k > 0) {
                sum[i] += 0.5 * h * (last[i] + rate);
            }
            last[i] = rate;
            n[i] = n7 * T7 / T * fm_exp(-sum[i]);
        };
        advance(0, 1e3 * gravity_at(Z) * heavy / (R * T), n_N2);
        for (int i = 0; i < 4; i++) {
            const double N = i < 2 ? n[0] : n[0] + n[1] + n[2];
            advance(i + 1, fall(species[i], Z, T, slope, N), species[i].n);
        }
        if (k % per_km == 0) {
            below.push_back(n[0] + n[1] + n[2] + n[3] + n[4]);
            double m = n[0] * M_N2;
            for (int i = 0; i < 4; i++) {
                m += n[i + 1] * species[i].M;
            }
            mass.push_back(m);
        }
    }

    // Hydrogen, from its density at 500 km: upwards and downwards from there, to 150 km.
    constexpr double n11 = 8.0e10, flux = 7.2e11, alpha = -0.25, Z11 = 500.0, floor = 150.0;
    std::vector<double> hydrogen(below.size(), 0.0);
    double unused;
    const double T11 = temperature(Z11, unused);
    for (const int direction : {-1, 1}) {
        double tau = 0.0, integral = 0.0, last_tau = 0.0, last_flow = 0.0;
        const double end = direction < 0 ? floor : highest;
        for (int k = 0; k <= static_cast<int>(std::abs(end - Z11)) * per_km; k++) {
            const double Z = Z11 + direction * k * h;
            const double T = temperature(Z, unused);
            const double rate = 1e3 * gravity_at(Z) * M_H / (R * T);
            if (k > 0) {
                tau += direction * 0.5 * h * (last_tau + rate);
            }
            last_tau = rate;
            // Hydrogen diffuses through all others.
            const double at = Z - joint;
            const auto i = std::min(static_cast<std::size_t>(at), below.size() - 2);
            const double part = at - static_cast<double>(i);
            const double N = fm_exp((1.0 - part) * fm_log(below[i]) + part * fm_log(below[i + 1]));
            const double D = 3.305e21 / N * power(T / 273.15, 0.5);
            const double flow = 1e3 * flux / D * power(T / T11, 1.0 + alpha) * fm_exp(tau);
            if (k > 0) {
                integral += direction * 0.5 * h * (last_flow + flow);
            }
            last_flow = flow;
            if (k % per_km == 0) {
                hydrogen[static_cast<std::size_t>(std::lround(at))] =
                    (n11 - integral) * power(T11 / T, 1.0 + alpha) * fm_exp(-tau);
            }
        }
    }

    for (std::size_t i = 0; i < below.size(); i++) {
        const double Z = joint + static_cast<double>(i);
        const double density = (mass[i] + hydrogen[i] * M_H) / avogadro;
        const double pressure = (below[i] + hydrogen[i]) * boltzmann_1976 * temperature(Z, unused);
        knots_.push_back({fm_log(density), fm_log(pressure), 0.0, 0.0});
    }
    for (std::size_t i = 0; i < knots_.size(); i++) {
        const std::size_t from = i > 0 ? i - 1 : i, to = std::min(i + 1, knots_.size() - 1);
        const double width = static_cast<double>(to - from);
        knots_[i].density_slope = (knots_[to].density - knots_[from].density) / width;
        knots_[i].pressure_slope = (knots_[to].pressure - knots_[from].pressure) / width;
    }
}

const StandardAtmosphere &StandardAtmosphere::get()
{
    static const StandardAtmosphere instance;
    return instance;
}

Air StandardAtmosphere::at(double altitude) const
{
    const double Z = 1e-3 * altitude >= lowest ? 1e-3 * altitude : lowest; // also for NaN, which has no knot
    if (Z < joint) {
        return lower(Z);
    }
    double slope;
    if (Z >= highest) {
        const Knot &top = knots_.back();
        return {temperature(highest, slope), fm_exp(top.pressure + top.pressure_slope * (Z - highest)),
                fm_exp(top.density + top.density_slope * (Z - highest))};
    }
    // Cubic polynomials of the logarithms between the knots.
    const auto i = static_cast<std::size_t>(Z - joint);
    const double s = Z - joint - static_cast<double>(i), r = 1.0 - s;
    const Knot &a = knots_[i], &b = knots_[i + 1];
    const auto between = [&](double y0, double d0, double y1, double d1) {
        return r * r * ((1.0 + 2.0 * s) * y0 + s * d0) + s * s * ((1.0 + 2.0 * r) * y1 - r * d1);
    };
    return {temperature(Z, slope), fm_exp(between(a.pressure, a.pressure_slope, b.pressure, b.pressure_slope)),
            fm_exp(between(a.density, a.density_slope, b.density, b.density_slope))};
}

} // namespace fledge::world
