// SPDX-License-Identifier: Apache-2.0
#include "world/environment/air/nrlmsise00_expansions.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace fledge::world::nrlmsise {

namespace {

// The model's roundings of pi. [rad] per hour, second and day.
constexpr double per_hour = 0.2618, per_second = 7.2722e-5, per_day = 1.72142e-2;

/// A coefficient that is a phase, and the angle that its unit is.
struct Phase {
    int number;
    double unit;
};
constexpr Phase upper_phases[] = {{14, per_day},    {18, 2.0 * per_day}, {32, per_day},     {39, 2.0 * per_day},
                                  {59, per_second}, {64, per_degree},    {72, per_second},  {76, per_second},
                                  {80, per_second}, {98, per_degree},    {119, per_degree}, {125, per_hour},
                                  {132, per_hour},  {137, per_degree}};
constexpr Phase lower_phases[] = {{14, per_day}, {18, 2.0 * per_day}, {32, per_day},       {39, 2.0 * per_day},
                                  {82, per_day}, {85, per_day},       {87, 2.0 * per_day}, {89, 2.0 * per_day}};

template <std::size_t size> Set filled(const double *p, double scale, const Phase (&phases)[size])
{
    Set set;
    set.p = p;
    set.mean = scale * p[1];
    set.log_mean = fm_log(std::abs(set.mean));
    set.regional = std::any_of(p + 53, p + 94, [](double value) { return value != 0.0; });
    for (const Phase &item : phases) {
        set.phase[item.number] = Angle::of(item.unit * p[item.number]);
    }
    return set;
}

struct Sets {
    Set upper[UPPER_COUNT], lower[LOWER_COUNT];

    Sets()
    {
        for (int i = 0; i < UPPER_COUNT; i++) {
            upper[i] = filled(upper_coefficients[i], upper_scale[i], upper_phases);
        }
        for (int i = 0; i < LOWER_COUNT; i++) {
            lower[i] = filled(lower_coefficients[i], lower_scale[i], lower_phases);
        }
    }

    static const Sets &get()
    {
        static const Sets instance;
        return instance;
    }
};

/// Of an ap, by two coefficients: slope in strong activity and the rate at which the slope goes there.
double response(double ap, double rate, double slope)
{
    const double a = ap - 4.0;
    return a + (slope - 1.0) * (a + (fm_exp(-rate * a) - 1.0) / rate);
}

/// Sums over degrees 1, 3, 5 and 2, 4, 6; coefficient 0 is 0.
double odd(const double *p, const double *P, int i, int j, int k)
{
    return p[i] * P[1] + p[j] * P[3] + p[k] * P[5];
}

double even(const double *p, const double *P, int i, int j, int k)
{
    return p[i] * P[2] + p[j] * P[4] + p[k] * P[6];
}

/// Once, twice and three times a day.
double tides(const double *p, const Terms &t, double annual)
{
    const double *P1 = t.P[1], *P2 = t.P[2], *P3 = t.P[3];
    return (odd(p, P1, 4, 5, 28) + p[12] * P1[2] * annual) * t.local[1].c +
           (odd(p, P1, 7, 8, 29) + p[13] * P1[2] * annual) * t.local[1].s +
           (even(p, P2, 6, 42, 0) + odd(p, P2, 0, 24, 36) * annual) * t.local[2].c +
           (even(p, P2, 9, 43, 0) + odd(p, P2, 0, 34, 37) * annual) * t.local[2].s +
           (p[40] * P3[3] + even(p, P3, 0, 94, 47) * annual) * t.local[3].s +
           (p[41] * P3[3] + even(p, P3, 0, 95, 49) * annual) * t.local[3].c;
}

/// What longitude, the time of day and their part in the magnetic activity add.
double regional(const Set &set, const Terms &t, double annual, double ap)
{
    const double *p = set.p, *P0 = t.P[0], *P1 = t.P[1];
    double sum =
        (1.0 + p[81] * t.flux) *
        ((even(p, P1, 65, 66, 67) + odd(p, P1, 104, 105, 106) + odd(p, P1, 110, 111, 112) * annual) * t.longitude.c +
         (even(p, P1, 91, 92, 93) + odd(p, P1, 107, 108, 109) + odd(p, P1, 113, 114, 115) * annual) * t.longitude.s);
    sum += (1.0 + p[96] * P0[1]) * (1.0 + p[82] * t.flux) * (1.0 + p[120] * P0[1] * annual) * odd(p, P0, 69, 70, 71) *
           t.second.after(set.phase[72]);
    const double *P2 = t.P[2];
    sum += (1.0 + p[138] * t.flux) * (p[77] * P2[3] + p[78] * P2[5] + p[79] * P2[7]) *
           t.second_longitude.after(set.phase[80]);
    if (t.activity.history) {
        return sum + ap * ((1.0 + p[133] * P0[1]) * even(p, P1, 53, 99, 68) * t.longitude.after(set.phase[98]) +
                           odd(p, P1, 134, 135, 136) * annual * t.longitude.after(set.phase[137]) +
                           odd(p, P0, 56, 57, 58) * t.second.after(set.phase[59]));
    }
    return sum + ap * ((1.0 + p[121] * P0[1]) * even(p, P1, 61, 62, 63) * t.longitude.after(set.phase[64]) +
                       odd(p, P1, 116, 117, 118) * annual * t.longitude.after(set.phase[119]) +
                       odd(p, P0, 84, 85, 86) * t.second.after(set.phase[76]));
}

} // namespace

const Set &set_of(Upper which)
{
    return Sets::get().upper[which];
}

const Set &set_of(Lower which)
{
    return Sets::get().lower[which];
}

Responses::Responses(const double *p, const SolarActivity &now)
    : rate(now.history ? p[25] : p[44]), slope(now.history ? p[26] : p[45])
{
    for (std::size_t i = now.history ? 1 : 0; i < (now.history ? 7 : 1); i++) {
        of_ap[i] = response(now.ap[i], rate, slope);
    }
}
Terms::Terms(const AirPlace &place, const SolarActivity &now)
    : activity(now), common(upper_coefficients[EXOSPHERE], now)
{
    constexpr double degrees = 180.0 / M_PI;
    latitude = place.latitude * degrees;
    flux = now.F107_average - 150.0;
    rise = now.F107 - now.F107_average;
    day = Angle::of(per_day * place.day_of_year);
    half_year = day + day;
    local[1] = Angle::of(per_hour * (12.0 + place.hour_angle * 12.0 / M_PI));
    local[2] = local[1] + local[1];
    local[3] = local[2] + local[1];
    longitude = Angle::of(per_degree * (place.longitude * degrees));
    second = Angle::of(per_second * place.seconds_of_day);
    second_longitude = second + longitude + longitude;

    const Angle sine = Angle::of(per_degree * latitude);
    double diagonal = 1.0;
    for (int m = 0; m < 4; m++) {
        P[m][m] = diagonal;
        P[m][m + 1] = (2 * m + 1) * sine.s * diagonal;
        for (int n = m + 2; n < 8; n++) {
            P[m][n] = ((2 * n - 1) * sine.s * P[m][n - 1] - (n + m - 1) * P[m][n - 2]) / (n - m);
        }
        diagonal *= (2 * m + 1) * sine.c;
    }
}
double magnetic(const Set &set, const Terms &t)
{
    const double *p = set.p;
    const bool common = t.activity.history ? p[25] == t.common.rate : p[44] == t.common.rate;
    const auto of_ap = common ? t.common.of_ap : Responses(p, t.activity).of_ap;
    if (!t.activity.history) {
        return of_ap[0];
    }
    if (p[52] == 0.0) {
        return 0.0;
    }
    // What happened 3 h earlier weighs less by a factor x.
    const double x =
        std::min(fm_exp(-10800.0 * std::abs(p[52]) / (1.0 + p[139] * (45.0 - std::abs(t.latitude)))), 0.99999);
    const double x2 = x * x, x4 = x2 * x2, x8 = x4 * x4, eight = (1.0 + x) * (1.0 + x2) * (1.0 + x4);
    const double sum =
        of_ap[1] + x * of_ap[2] + x2 * of_ap[3] + x2 * x * of_ap[4] + x4 * eight * (of_ap[5] + x8 * of_ap[6]);
    return sum / (1.0 + (1.0 - x8 * x8 * x2 * x) / (1.0 - x) * std::sqrt(x));
}

double variation(Upper which, const Terms &t)
{
    const Set &set = set_of(which);
    const double *p = set.p, *P0 = t.P[0], *P1 = t.P[1];
    const double annual = t.day.after(set.phase[14]);
    const double day_to_day = p[20] * t.rise + p[21] * t.rise * t.rise;
    const double seasons = 1.0 + p[48] * t.flux + day_to_day, tidal = 1.0 + p[50] * t.flux + day_to_day;
    double sum = p[31] + day_to_day + p[20] * p[60] * t.rise * t.flux + p[22] * t.flux + p[30] * t.flux * t.flux;
    sum += even(p, P0, 2, 3, 23) + p[27] * P0[1] + p[15] * P0[2] * t.flux;
    sum += p[19] * t.day.after(set.phase[32]) + (p[16] + p[17] * P0[2]) * t.half_year.after(set.phase[18]) +
           seasons * odd(p, P0, 10, 11, 0) * annual + p[38] * P0[1] * t.half_year.after(set.phase[39]);
    sum += tidal * tides(p, t, annual);
    const double ap = magnetic(set, t);
    if (t.activity.history) {
        sum += ap * (p[51] + even(p, P0, 97, 55, 0) + odd(p, P0, 126, 127, 128) * annual +
                     odd(p, P1, 129, 130, 131) * t.local[1].after(set.phase[132]));
    } else {
        sum += ap * (p[33] + even(p, P0, 46, 35, 0) + odd(p, P0, 101, 102, 103) * annual +
                     odd(p, P1, 122, 123, 124) * t.local[1].after(set.phase[125]));
    }
    return set.regional ? sum + regional(set, t, annual, ap) : sum;
}

double variation(Lower which, const Terms &t, double ap)
{
    const Set &set = set_of(which);
    const double *p = set.p, *P0 = t.P[0], *P1 = t.P[1];
    const double annual = t.day.after(set.phase[14]);
    double sum = p[22] * t.flux + even(p, P0, 2, 3, 23) + odd(p, P0, 27, 15, 60);
    sum += (p[19] + even(p, P0, 48, 30, 0)) * t.day.after(set.phase[32]) +
           (p[16] + even(p, P0, 17, 31, 0)) * t.half_year.after(set.phase[18]) + odd(p, P0, 10, 11, 21) * annual +
           p[38] * P0[1] * t.half_year.after(set.phase[39]);
    sum += tides(p, t, annual);
    sum += ap * (t.activity.history ? p[51] + p[97] * P0[2] : p[33] + p[46] * P0[2]);
    return sum + ((even(p, P1, 65, 66, 67) + odd(p, P1, 75, 76, 77)) * t.longitude.c +
                  (even(p, P1, 91, 92, 93) + odd(p, P1, 78, 79, 80)) * t.longitude.s) *
                     (1.0 + P0[1] * (p[81] * t.day.after(set.phase[82]) + p[86] * t.half_year.after(set.phase[87])) +
                      p[84] * t.day.after(set.phase[85]) + p[88] * t.half_year.after(set.phase[89]));
}

} // namespace fledge::world::nrlmsise
