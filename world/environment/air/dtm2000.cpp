// SPDX-License-Identifier: Apache-2.0
#include "world/environment/air/dtm2000.h"

#include "flight/math/elementary.h"
#include "world/environment/air/dtm2000_coefficients.h"

#include <algorithm>
#include <cmath>

namespace fledge::world::dtm {

namespace {

using Terms = double[numbers];

// The published numbers of the terms, by what multiplies them.
constexpr int by_flux[] = {4, 5, 6, 69, 82, 83, 84, 85, 86, 87};
constexpr int steady[] = {2, 3, 7, 8, 60, 61, 64, 65, 66, 68, 72, 73, 74, 75, 76, 77, 78, 79};
constexpr int periodic[] = {21, 22, 23, 26, 27, 28, 31, 33, 35, 36, 37, 38, 43, 44, 45, 46, 47,
                            48, 49, 50, 51, 52, 53, 54, 55, 56, 57, 58, 88, 89, 90, 91, 92, 93};
constexpr int yearly_even[] = {9, 10};
constexpr int half_yearly_even[] = {12, 13};
constexpr int yearly[] = {15, 16, 17, 24, 25, 29, 30, 32, 34, 40, 41, 42};
constexpr int half_yearly[] = {19, 39, 59};
constexpr int odd[] = {74, 77, 78, 88, 89, 90, 91}; ///< at 120 km the seasons exchange the hemispheres for these

template <std::size_t count> double sum(const int (&which)[count], const double *a, const Terms &terms)
{
    double total = 0.0;
    for (const int i : which) {
        total += a[i] * terms[i];
    }
    return total;
}

void zonal(double c, double *P) // P[0] to P[6]
{
    P[0] = 1.0;
    P[1] = c;
    for (int n = 2; n <= 6; n++) {
        P[n] = ((2 * n - 1) * c * P[n - 1] - (n - 1) * P[n - 2]) / n;
    }
}

/// What depends on the activity: the flux, and Kp in zones of the geomagnetic latitude, whose pole is at 79 deg N,
/// 71 deg W.
void activity_terms(const SolarActivity &activity, const AirPlace &place, double s, double c, const double *P, Terms &t)
{
    const double more = activity.F107 - activity.F107_average, mean = activity.F107_average - 150.0;
    t[4] = more;
    t[5] = more * more;
    t[6] = mean;
    t[69] = mean * mean;
    for (int n = 0; n < 3; n++) {
        t[82 + n] = more * P[1 + n];
        t[85 + n] = mean * P[2 + n];
    }
    double M[7];
    zonal(c * 0.19081 * fm_cos(place.longitude + 1.2392) + s * 0.98163, M);
    const double now = activity.kp_before, day = activity.kp_average;
    t[7] = now;
    t[8] = M[2] * now;
    t[68] = M[4] * now;
    t[60] = now * now;
    t[61] = M[2] * now * now;
    t[75] = t[60] * t[60];
    t[64] = day;
    t[65] = M[2] * day;
    t[72] = M[4] * day;
    t[66] = day * day;
    t[73] = M[2] * day * day;
    t[76] = t[66] * t[66];
}

/// What latitude, local time and longitude give; the seasons' cosines multiply theirs later.
void place_terms(const AirPlace &place, double s, double c, const double *P, double kp, Terms &t)
{
    t[2] = P[2];
    t[3] = P[4];
    t[74] = P[1];
    t[77] = P[3];
    t[78] = P[5];
    t[79] = P[6];
    t[9] = t[12] = 1.0;
    t[10] = t[13] = P[2];
    const double s2 = s * s, c2 = c * c;
    const double first[] = {c, 3.0 * s * c, c * (7.5 * s2 - 1.5), s * c * (17.5 * s2 - 7.5),
                            c * (39.375 * s2 * s2 - 26.25 * s2 + 1.875)}; // P11 to P51
    const double P22 = 3.0 * c2, P32 = 15.0 * s * c2, P42 = c2 * (52.5 * s2 - 7.5);
    const double P52 = 3.0 * s * P42 - 2.0 * P32, P62 = 2.75 * s * P52 - 1.75 * P42, P33 = 15.0 * c * c2;
    double sh, ch, sl, cl;
    fm_sincos(place.hour_angle + M_PI, &sh, &ch); // of local time, 0 at midnight
    fm_sincos(place.longitude, &sl, &cl);
    const double c2h = ch * ch - sh * sh, s2h = 2.0 * ch * sh;
    for (int i = 0; i < 3; i++) {
        const double odd_zone = P[2 * i + 1], odd_first = first[2 * i];
        t[15 + i] = odd_zone;
        t[40 + i] = odd_zone * kp;
        t[21 + i] = odd_first * ch;
        t[26 + i] = odd_first * sh;
        t[43 + i] = odd_first * ch * kp;
        t[46 + i] = odd_first * sh * kp;
    }
    t[19] = P[1];
    t[39] = P[3];
    t[59] = P[5];
    t[24] = t[21];
    t[25] = first[1] * ch;
    t[29] = t[26];
    t[30] = first[1] * sh;
    t[31] = P22 * c2h;
    t[32] = t[88] = P32 * c2h;
    t[33] = P22 * s2h;
    t[34] = t[89] = P32 * s2h;
    t[35] = P33 * (c2h * ch - s2h * sh);
    t[36] = P33 * (s2h * ch + c2h * sh);
    t[37] = P42 * c2h;
    t[38] = P42 * s2h;
    t[90] = P52 * c2h;
    t[91] = P52 * s2h;
    t[92] = P62 * c2h;
    t[93] = P62 * s2h;
    for (int i = 0; i < 5; i++) {
        t[49 + i] = first[i] * cl;
        t[54 + i] = first[i] * sl;
    }
}

/// The seasons' four angles of an expansion: 2 pi of a year, or of half a year, times the day past a phase.
struct Seasons {
    Seasons()
    {
        constexpr int phases[4] = {11, 14, 18, 20};
        for (int i = 0; i < EXPANSIONS; i++) {
            for (int k = 0; k < 4; k++) {
                fm_sincos((k % 2 + 1) * year * coefficients[i][phases[k]], &s[i][k], &c[i][k]);
            }
        }
    }

    static constexpr double year = 0.017214206; ///< [rad/day]
    double s[EXPANSIONS][4], c[EXPANSIONS][4];
};
const Seasons seasons;

struct Turn {
    double s, c, s2, c2; ///< of the day in the year, and of twice that
};

/// The sum of an expansion; in some, the flux amplifies what is periodic.
double expand(Expansion which, const Turn &day, const Terms &terms)
{
    const double *a = coefficients[which], *s = seasons.s[which], *c = seasons.c[which];
    const auto once = [&](int k) { return day.c * c[k] + day.s * s[k]; };
    const auto twice = [&](int k) { return day.c2 * c[k] + day.s2 * s[k]; };
    const double flux = sum(by_flux, a, terms);
    const double waves = sum(periodic, a, terms) + sum(yearly_even, a, terms) * once(0) +
                         sum(half_yearly_even, a, terms) * twice(1) + sum(yearly, a, terms) * once(2) +
                         sum(half_yearly, a, terms) * twice(3);
    const bool amplified = which == EXOSPHERE || which == O || which == N2;
    return sum(steady, a, terms) + flux + waves * (amplified ? 1.0 + flux : 1.0);
}

struct Gas {
    double AirSpecies::*n;
    double M, mass, diffusion; ///< [kg/kmol], [kg], factor of thermal diffusion
};
constexpr Gas gases[] = {{&AirSpecies::H, 1.0, 1.6606e-27, -0.40},
                         {&AirSpecies::He, 4.0, 6.6423e-27, -0.38},
                         {&AirSpecies::O, 16.0, 26.569e-27, 0.0},
                         {&AirSpecies::N2, 28.0, 46.4958e-27, 0.0},
                         {&AirSpecies::O2, 32.0, 53.1381e-27, 0.0}};

AirComposition air_at(const AirPlace &place, const SolarActivity &activity)
{
    Terms terms;
    double s, c, P[7];
    fm_sincos(place.latitude, &s, &c);
    zonal(s, P);
    activity_terms(activity, place, s, c, P, terms);
    place_terms(place, s, c, P, activity.kp_before, terms);
    const int date = place.day_of_year;
    Turn day;
    fm_sincos(Seasons::year * date, &day.s, &day.c);
    fm_sincos(2.0 * Seasons::year * date, &day.s2, &day.c2);
    const auto base = [&](Expansion which) { return coefficients[which][1]; };
    const auto density = [&](Expansion which) { return base(which) * fm_exp(expand(which, day, terms)); };
    AirComposition air;
    air.exosphere = base(EXOSPHERE) * (1.0 + expand(EXOSPHERE, day, terms));
    const double at_120[] = {density(H), density(HE), density(O), density(N2), O2};

    // -1 in the northern winter, 1 in its summer, linear through 40 days around the equinoxes
    const double season = std::clamp(std::min((date - 59) / 20.0 - 1.0, 1.0 - (date - 244) / 20.0), -1.0, 1.0);
    for (const int i : odd) {
        terms[i] *= season;
    }
    const double T120 = base(AT_120) + expand(AT_120, day, terms);
    const double slope = base(SLOPE) + expand(SLOPE, day, terms);

    constexpr double radius = 6356.77, low = 120.0;                                                // [km]
    constexpr double g = 9.80665 * radius / (radius + low) * radius / (radius + low), R = 8.314e3; // [J/(kmol K)]
    const double z = std::max(low, 1e-3 * place.altitude);
    const double sigma = slope / (air.exosphere - T120); // [1/km]
    const double fall = sigma * (z - low) * (radius + low) / (radius + z);
    air.temperature = air.exosphere - (air.exosphere - T120) * fm_exp(-fall);
    const double warmer = fm_log(T120 / air.temperature);
    double count = 0.0;
    for (int i = 0; i < 5; i++) {
        const Gas &gas = gases[i];
        const double gamma = 1e3 * gas.M * g / (sigma * R * air.exosphere);
        const double n = 1e6 * at_120[i] * fm_exp(warmer * (1.0 + gas.diffusion + gamma) - gamma * fall);
        air.species.*gas.n = n;
        air.density += gas.mass * n;
        count += n;
    }
    air.molar_mass = air.density / count * 6.02214076e23;
    return air;
}

} // namespace
} // namespace fledge::world::dtm

namespace fledge::world {

AirComposition dtm2000(const AirPlace &place, const SolarActivity &activity)
{
    return dtm::air_at(place, activity);
}

} // namespace fledge::world
