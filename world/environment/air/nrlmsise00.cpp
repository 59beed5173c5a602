// SPDX-License-Identifier: Apache-2.0
#include "world/environment/air/nrlmsise00.h"

#include "flight/math/elementary.h"
#include "world/environment/air/nrlmsise00_expansions.h"

#include <algorithm>
#include <cmath>

namespace fledge::world {

namespace nrlmsise {

namespace {

// Lengths are in km, temperatures in K, masses in atomic units, densities in 1/cm^3.
constexpr double gas = 8.314;      // [J/(mol K)]
constexpr double hottest = 5000.0; // [K] of the splines, which have no end in great storms
constexpr double boundary = 120.0, joint = 123.435, mixed_mass = 28.95, half_mixed = 62.5, highest_mixed = 450.0;

// ---- the column of air -------------------------------------------------------------------------------

struct Gravity {
    double surface, radius; ///< [m/s^2], [km] at which its gradient is that of the Earth

    explicit Gravity(double latitude)
    {
        const double c = fm_cos(2.0 * per_degree * latitude), g = 980.616 * (1.0 - 0.0026373 * c); // [cm/s^2]
        surface = 0.01 * g;
        radius = 2e-5 * g / (3.085462e-6 + 2.27e-9 * c);
    }
    double at(double z) const { return surface / ((1.0 + z / radius) * (1.0 + z / radius)); }
    /// Geopotential height over z0, in which gravity is that at z0.
    double height(double z, double z0) const { return (z - z0) * (radius + z0) / (radius + z); }
};

/// The air at an altitude, as it follows from that at another.
struct Column {
    double temperature = 0.0;
    double cooling = 0.0; ///< logarithm of the other temperature by this
    double weight = 0.0;  ///< [1] integral of g / (R T) between the altitudes: how many scale heights of mass 1

    /// Logarithm of the ratio of a species' densities; alpha: of thermal diffusion.
    double log_ratio(double mass, double alpha) const { return (1.0 + alpha) * cooling - mass * weight; }
};

/// 1/T as a cubic spline of geopotential height between altitudes, downwards, with given gradients [K/km] at its ends.
template <int count> class Spline {
public:
    Spline() = default;
    Spline(const double (&z)[count], const double (&T)[count], double gradient_top, double gradient_bottom,
           const Gravity &g)
        : top_(z[0]), T_top_(T[0]), span_(g.height(z[count - 1], z[0])), scale_(g.at(z[0]) * span_ / gas), gravity_(&g)
    {
        for (int i = 0; i < count; i++) {
            x_[i] = g.height(z[i], top_) / span_;
            y_[i] = 1.0 / T[i];
        }
        const double bend = (g.radius + z[count - 1]) / (g.radius + top_);
        solve(-gradient_top * y_[0] * y_[0] * span_,
              -gradient_bottom * y_[count - 1] * y_[count - 1] * span_ * bend * bend);
    }

    /// At z, where `top` is what there is at the upper end.
    Column below(const Column &top, double z) const
    {
        const double x = gravity_->height(z, top_) / span_;
        double integral = 0.0;
        int i = 0;
        for (; i < count - 2 && x > x_[i + 1]; i++) {
            integral += piece(i, 1.0);
        }
        const double h = x_[i + 1] - x_[i], b = (x - x_[i]) / h, a = 1.0 - b;
        const double y = a * y_[i] + b * y_[i + 1] +
                         ((a * a * a - a) * curvature_[i] + (b * b * b - b) * curvature_[i + 1]) * h * h / 6.0;
        const double inverse = std::max(y, 1.0 / hottest);
        return {1.0 / inverse, top.cooling + fm_log(T_top_ * inverse), top.weight + scale_ * (integral + piece(i, b))};
    }

private:
    /// Integral over the first part b of an interval.
    double piece(int i, double b) const
    {
        const double h = x_[i + 1] - x_[i], b2 = b * b, a2 = (1.0 - b) * (1.0 - b);
        const double rest = (1.0 - a2) * (1.0 - a2); // (1 - a^4) / 4 - (1 - a^2) / 2 is -rest / 4
        return h * (0.5 * (1.0 - a2) * y_[i] + 0.5 * b2 * y_[i + 1] -
                    (rest * curvature_[i] + b2 * (2.0 - b2) * curvature_[i + 1]) * h * h / 24.0);
    }

    /// Second derivatives for slopes at the ends: elimination and substitution in a tridiagonal system.
    void solve(double first, double last)
    {
        double right[count], factor[count], slope = first;
        for (int i = 0; i < count; i++) {
            const double before = i > 0 ? x_[i] - x_[i - 1] : 0.0, after = i < count - 1 ? x_[i + 1] - x_[i] : 0.0;
            const double next = i < count - 1 ? (y_[i + 1] - y_[i]) / after : last;
            const double pivot = 2.0 * (before + after) - (i > 0 ? before * factor[i - 1] : 0.0);
            factor[i] = after / pivot;
            right[i] = (6.0 * (next - slope) - (i > 0 ? before * right[i - 1] : 0.0)) / pivot;
            slope = next;
        }
        curvature_[count - 1] = right[count - 1];
        for (int i = count - 2; i >= 0; i--) {
            curvature_[i] = right[i] - factor[i] * curvature_[i + 1];
        }
    }

    double top_ = 0.0, T_top_ = 0.0, span_ = 0.0, scale_ = 0.0;
    const Gravity *gravity_ = nullptr;
    double x_[count] = {}, y_[count] = {}, curvature_[count] = {};
};

/// Temperatures at 110, 100, 90 and 72.5 km, and the gradient at the last.
struct Mesopause {
    double T[4], gradient;
};

/// The column above 72.5 km, relative to 120 km.
class Thermosphere {
public:
    /// Without a mesopause it serves only above 123 km.
    Thermosphere(double T_infinity, double T_boundary, double slope, const Gravity &gravity, const Mesopause *mesopause)
        : gravity_(gravity), T_infinity_(T_infinity), T_boundary_(T_boundary), slope_(slope)
    {
        if (mesopause != nullptr) {
            constexpr double altitudes[] = {joint, 110.0, 100.0, 90.0, 72.5};
            top_ = at(joint);
            const double shrink = (gravity.radius + boundary) / (gravity.radius + joint);
            const double T[] = {top_.temperature, mesopause->T[0], mesopause->T[1], mesopause->T[2], mesopause->T[3]};
            spline_ =
                Spline<5>(altitudes, T, (T_infinity - T[0]) * slope * shrink * shrink, mesopause->gradient, gravity);
        }
    }

    Column at(double z) const
    {
        if (z < joint) {
            return spline_.below(top_, z);
        }
        const double rise = slope_ * gravity_.height(z, boundary);
        const double T = T_infinity_ - (T_infinity_ - T_boundary_) * fm_exp(-rise);
        const double cooling = fm_log(T_boundary_ / T);
        return {T, cooling, gravity_.at(boundary) / (slope_ * gas * T_infinity_) * (rise - cooling)};
    }

private:
    const Gravity &gravity_;
    double T_infinity_, T_boundary_, slope_;
    Column top_;
    Spline<5> spline_;
};

double lower_temperature(Lower which, const Terms &t, double ap)
{
    return set_of(which).mean / (1.0 - variation(which, t, ap));
}

/// A gradient at an altitude of temperature T.
double lower_gradient(Lower which, Lower temperature, double T, const Terms &t, double ap)
{
    const double ratio = T / set_of(temperature).mean;
    return set_of(which).mean * (1.0 + variation(which, t, ap)) * ratio * ratio;
}

Mesopause mesopause_of(const Terms &t, bool varies)
{
    if (!varies) {
        return {{set_of(T_110).mean, set_of(T_100).mean, set_of(T_90).mean, set_of(T_72).mean},
                set_of(GRADIENT_72).mean};
    }
    const double ap = magnetic(set_of(LOWER_BOUNDARY), t);
    Mesopause result = {{lower_temperature(T_110, t, ap), lower_temperature(T_100, t, ap),
                         lower_temperature(T_90, t, ap), lower_temperature(T_72, t, ap)},
                        0.0};
    result.gradient = lower_gradient(GRADIENT_72, T_72, result.T[3], t, ap);
    return result;
}

/// The column at an altitude below 72.5 km, where it is `top`.
Column middle_column(const Terms &t, const Gravity &g, const Column &top, double gradient, double z)
{
    // The expansion that is evaluated last in the thermosphere gives the activity: that of N if it has a history.
    const double ap = magnetic(set_of(t.activity.history ? N : ANOMALOUS_O), t);
    const double stratopause[] = {72.5, 55.0, 45.0, 32.5};
    const double T[] = {top.temperature, lower_temperature(T_55, t, ap), lower_temperature(T_45, t, ap),
                        lower_temperature(T_32, t, ap)};
    const double gradient_32 = lower_gradient(GRADIENT_32, T_32, T[3], t, ap);
    const Spline<4> upper(stratopause, T, gradient, gradient_32, g);
    if (z >= 32.5) {
        return upper.below(top, z);
    }
    const double tropopause[] = {32.5, 20.0, 15.0, 10.0, 0.0};
    const double T_below[] = {T[3], lower_temperature(T_20, t, ap), lower_temperature(T_15, t, ap),
                              lower_temperature(T_10, t, ap), lower_temperature(T_0, t, ap)};
    const double gradient_0 = lower_gradient(GRADIENT_0, T_0, T_below[4], t, ap);
    return Spline<5>(tropopause, T_below, gradient_32, gradient_0, g).below(upper.below(top, 32.5), z);
}

// ---- species -----------------------------------------------------------------------------------------

/// A factor whose logarithm is `strength` far below an altitude and 0 far above it, over one or two lengths.
struct Transition {
    double altitude = 0.0, length = 1.0, second_length = 0.0; ///< 0: the same

    double log_at(double z, double strength) const
    {
        const double first = fm_exp((z - altitude) / length);
        const double second = second_length == 0.0 ? first : fm_exp((z - altitude) / second_length);
        return strength / (1.0 + 0.5 * (first + second));
    }
};

struct Species {
    Upper set;
    double mass, alpha; ///< alpha: of thermal diffusion
    double turbopause;
    double highest;     ///< up to which altitude it is mixed and corrected
    double mixing;      ///< its ratio to N2 at the ground, to which it is corrected; 0: by another factor
    Transition mixture; ///< of this correction
    double loss;        ///< by chemistry, far below; 0: none
    Transition chemistry;
};

// Published constants of the boundary, times their factors.
constexpr Species nitrogen = {N2, 28.0, 0.0, 105.0, 160.0, 0.0, {}, 0.0, {}};
constexpr Species others[] = {
    // In the order of AirSpecies, without N2.
    {HE, 4.0, -0.38, 100.0, 200.0, 6.71072e-6, {110.0, 7.0}, 0.0, {}},
    {O, 16.0, 0.0, 105.0, 300.0, 0.0, {110.0 * 1.1502, 34.4689, 12.884}, -8.0 * 4.47749, {90.0 * 0.795046, 8.03224}},
    {O2, 32.0, 0.0, 105.0, 250.0, 0.26827, {110.0 * 1.08738, 12.2947}, 0.0, {}},
    {AR, 40.0, 0.17, 105.0, 240.0, 1.19615e-2, {110.0 * 1.10016, 7.34129}, 0.0, {}},
    {H, 1.0, -0.38, 95.0, 320.0, 1.68986e-6, {110.0 * 1.15241, 22.2784}, -8.0 * 172.783, {90.0 * 0.744294, 2.07208}},
    {N, 14.0, 0.0, 105.0, 450.0, 3.07165, {110.0 * 1.0993, 39.0631}, -8.0 * 4.6383, {90.0 * 0.986161, 32.7072}}};
constexpr Transition oxygen_loss = {110.0 * 1.1502, -34.4689, -12.884}; ///< of O2, at all altitudes

/// Logarithms of densities in diffusive equilibrium and mixed, as one: turbulence ends over 28 km.
double joined(double diffusive, double mixed, double mass)
{
    const double a = 28.0 / (mixed_mass - mass), y = a * (mixed - diffusive);
    if (y < -10.0 || y > 10.0) {
        return y < 0.0 ? diffusive : mixed;
    }
    return diffusive + fm_log(1.0 + fm_exp(y)) / a;
}

/// The species above 72.5 km: logarithms of densities.
class Thermal {
public:
    Thermal(const Terms &t, const Thermosphere &air, double z)
        : t_(t), air_(air), z_(z), here_(air.at(z)), mixing_(here_.log_ratio(mixed_mass, 0.0))
    {
        const double base = base_of(nitrogen);
        N2_ = base + here_.log_ratio(nitrogen.mass, nitrogen.alpha);
        if (z <= highest_mixed) {
            common_turbopause_ = air.at(nitrogen.turbopause);
            const double season = t.day.after(set_of(EXOSPHERE).phase[14]);
            N2_base_ = mixed_base(nitrogen, base,
                                  air.at(0.949154 * nitrogen.turbopause * (1.0 + 0.118339 * t.P[0][1] * season)));
        }
        if (z <= nitrogen.highest) {
            N2_ = joined(N2_, mixed_N2(), nitrogen.mass);
        }
    }

    const Column &here() const { return here_; }
    double N2() const { return N2_; }
    double mixed_N2() const { return N2_base_ + mixing_; } ///< as if the air was mixed

    double of(const Species &s) const
    {
        const double base = base_of(s), flux = 1.0 + 3.10302e-2 * t_.flux;
        double result = base + here_.log_ratio(s.mass, s.alpha);
        if (z_ <= s.highest) {
            const double mixed =
                mixed_base(s, base, s.turbopause == nitrogen.turbopause ? common_turbopause_ : air_.at(s.turbopause));
            result = joined(result, mixed + mixing_, s.mass);
            result += s.mixture.log_at(z_, s.mixing > 0.0 ? N2_base_ + fm_log(s.mixing) - mixed : -7.60535e-2 * flux);
            result += s.loss != 0.0 ? s.chemistry.log_at(z_, s.loss) : 0.0;
        }
        return s.set == O2 ? result + oxygen_loss.log_at(z_, -0.74623 * flux) : result;
    }

private:
    /// At 120 km.
    double base_of(const Species &s) const { return set_of(s.set).log_mean + variation(s.set, t_); }
    /// What the mixed density exceeds mixing_ by.
    static double mixed_base(const Species &s, double base, const Column &turbopause)
    {
        return base + turbopause.log_ratio(s.mass - mixed_mass, s.alpha - 1.0);
    }

    const Terms &t_;
    const Thermosphere &air_;
    double z_;
    Column here_, common_turbopause_;
    double mixing_, N2_base_ = 0.0, N2_ = 0.0;
};

/// Oxygen of 4000 K, up to the altitude where its source ends.
double log_anomalous_oxygen(const Terms &t, const Gravity &g, const Mesopause *mesopause, double slope, double z)
{
    constexpr double temperature = 4000.0, source = 550.0, length = 76.0, mass = 16.0;
    const Thermosphere air(temperature, temperature, slope, g, z < joint ? mesopause : nullptr);
    const double scale_height = gas * temperature / (g.at(source) * mass);
    return set_of(ANOMALOUS_O).log_mean + variation(ANOMALOUS_O, t) + air.at(z).log_ratio(mass, 0.0) -
           length / scale_height * (fm_exp((source - z) / length) - 1.0);
}

/// Below 72.5 km the air is mixed but for what is left, near it, of the composition there.
void mix(const Terms &t, const Gravity &g, double gradient, double z, const Thermal &top, AirComposition &air)
{
    const Column here = middle_column(t, g, top.here(), gradient, z);
    const double left = z > half_mixed ? 1.0 - (72.5 - z) / (72.5 - half_mixed) : 0.0;
    AirSpecies &n = air.species;
    const double above = n.N2;
    const double mixed =
        fm_exp(top.mixed_N2() + here.log_ratio(mixed_mass, 0.0) - top.here().log_ratio(mixed_mass, 0.0));
    n.N2 = mixed * (1.0 + (fm_exp(top.N2() - top.mixed_N2()) - 1.0) * left);
    const auto ground = [&](double &species, double ratio) {
        species = n.N2 * (ratio + (species / above - ratio) * left);
    };
    ground(n.He, others[0].mixing);
    ground(n.O2, others[2].mixing);
    ground(n.Ar, others[3].mixing);
    n.O = n.H = n.N = n.anomalous_O = 0.0;
    air.temperature = here.temperature;
}

/// Sums of what the species have, and SI units.
void finish(AirComposition &air)
{
    constexpr double unit = 1.66e-27; // [kg]
    double number = 0.0, mass = 0.0;
    AirSpecies &n = air.species;
    const auto add = [&](double &species, double weight) {
        species *= 1e6;
        number += species;
        mass += weight * species;
    };
    add(n.He, 4.0);
    add(n.O, 16.0);
    add(n.N2, 28.0);
    add(n.O2, 32.0);
    add(n.Ar, 40.0);
    add(n.H, 1.0);
    add(n.N, 14.0);
    add(n.anomalous_O, 16.0);
    air.density = unit * mass;
    air.molar_mass = 1e-3 * mass / number;
}

AirComposition air_at(const AirPlace &place, const SolarActivity &activity)
{
    const Terms t(place, activity);
    const Gravity g(t.latitude);
    const double z = place.altitude < 0.0 ? 0.0 : 1e-3 * place.altitude, upper = std::max(z, 72.5);
    const auto value = [&](Upper which, double lowest) {
        const double mean = set_of(which).mean;
        return upper > lowest ? mean * (1.0 + variation(which, t)) : mean;
    };
    AirComposition air;
    air.exosphere = value(EXOSPHERE, joint);
    const double T_boundary = value(LOWER_BOUNDARY, 0.0);
    const double slope = value(SLOPE, 72.5) / (air.exosphere - T_boundary);
    const bool mixes = upper <= highest_mixed;
    const Mesopause mesopause = mixes ? mesopause_of(t, upper < 300.0) : Mesopause{};
    const Thermosphere profile(air.exosphere, T_boundary, slope, g, mixes ? &mesopause : nullptr);
    const Thermal thermal(t, profile, upper);
    air.temperature = thermal.here().temperature;
    air.species = {fm_exp(thermal.of(others[0])), fm_exp(thermal.of(others[1])),
                   fm_exp(thermal.N2()),          fm_exp(thermal.of(others[2])),
                   fm_exp(thermal.of(others[3])), fm_exp(thermal.of(others[4])),
                   fm_exp(thermal.of(others[5])), fm_exp(log_anomalous_oxygen(t, g, &mesopause, slope, upper))};
    if (z < 72.5) {
        mix(t, g, mesopause.gradient, z, thermal, air);
    }
    finish(air);
    return air;
}

} // namespace

} // namespace nrlmsise

AirComposition nrlmsise00(const AirPlace &place, const SolarActivity &activity)
{
    return nrlmsise::air_at(place, activity);
}

} // namespace fledge::world
