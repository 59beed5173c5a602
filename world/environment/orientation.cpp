// SPDX-License-Identifier: Apache-2.0
#include "world/environment/orientation.h"

#include "flight/math/elementary.h"
#include "sim/error.h"
#include "sim/text.h"
#include "world/constants.h"
#include "world/environment/bodies.h"
#include "world/environment/text_input.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>

namespace fledge::world {

using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

using std::numbers::pi;
constexpr double degree = pi / 180.0;
constexpr double century = 36'525.0;          // [d]
constexpr double century_s = century * day_s; // [s]

// All in degrees, per century, per day for pm.

struct Polynomials {
    int body;
    double ra[3], dec[3], pm[3];
};

constexpr Polynomials built_in_bodies[] = {
    {10, {286.13, 0, 0}, {63.87, 0, 0}, {84.10, 14.18440, 0}},
    {199, {281.01, -0.033, 0}, {61.45, -0.005, 0}, {329.548, 6.1385025, 0}},
    {299, {272.76, 0, 0}, {67.16, 0, 0}, {160.20, -1.4813688, 0}},
    {399, {0, -0.641, 0}, {90, -0.557, 0}, {190.147, 360.9856235, 0}},
    {301, {269.9949, 0.0031, 0}, {66.5392, 0.0130, 0}, {38.3213, 13.17635815, -1.4e-12}},
    {499, {317.68143, -0.1061, 0}, {52.88650, -0.0609, 0}, {176.630, 350.89198226, 0}},
    {599, {268.05, -0.009, 0}, {64.49, 0.003, 0}, {284.95, 870.5366420, 0}},
    {699, {40.589, -0.036, 0}, {83.537, -0.004, 0}, {38.90, 810.7939024, 0}},
    {799, {257.311, 0, 0}, {-15.175, 0, 0}, {203.81, -501.1600928, 0}},
    {899, {299.36, 0, 0}, {43.46, 0, 0}, {253.18, 536.3128492, 0}},
};

struct Periodic {
    double E0, E1;
    double ra, dec, pm;
};

// E1 to E13 of the Moon.
constexpr Periodic moon_terms[] = {
    {125.045, -1935.5364525, -3.8787, 1.5419, 3.5610},
    {250.089, -3871.0729050, -0.1204, 0.0239, 0.1208},
    {260.008, 475263.3328725, 0.0700, -0.0278, -0.0642},
    {176.625, 487269.6299850, -0.0172, 0.0068, 0.0158},
    {357.529, 35999.0509575, 0.0, 0.0, 0.0252},
    {311.589, 964468.4993100, 0.0072, -0.0029, -0.0066},
    {134.963, 477198.8693250, 0.0, 0.0009, -0.0047},
    {276.617, 12006.3007650, 0.0, 0.0, -0.0046},
    {34.226, 63863.5132425, 0.0, 0.0, 0.0028},
    {15.134, -5806.6093575, -0.0052, 0.0008, 0.0052},
    {119.743, 131.8406400, 0.0, 0.0, 0.0040},
    {239.961, 6003.1503825, 0.0, 0.0, 0.0019},
    {25.053, 473327.7964200, 0.0043, -0.0009, -0.0044},
};

constexpr Periodic neptune_terms[] = {{357.85, 52.316, 0.70, -0.51, -0.48}};

std::span<const Periodic> built_in_terms(int body)
{
    if (body == 301) {
        return moon_terms;
    }
    if (body == 899) {
        return neptune_terms;
    }
    return {};
}

std::string key(int body, const char *what)
{
    return "BODY" + std::to_string(body) + "_" + what;
}

/// One to three coefficients of a polynomial.
void polynomial(const TextKernel &pck, const std::string &name, double *radians)
{
    const auto numbers = pck.numbers(name, 1, 3);
    for (std::size_t i = 0; i < numbers.size(); i++) {
        radians[i] = numbers[i] * degree;
    }
}

std::vector<double> amplitudes(const TextKernel &pck, const std::string &name)
{
    return pck.has(name) ? pck.numbers(name, 1, 1000) : std::vector<double>();
}

double evaluate(const double *c, double t)
{
    return c[0] + t * (c[1] + t * c[2]);
}

double slope(const double *c, double t)
{
    return c[1] + 2.0 * c[2] * t;
}

/// An angle and its rate.
struct Angle {
    double value, rate;
};

/// By the right ascension and declination of the pole and the prime meridian.
BodyAttitude turned(const Angle &ra, const Angle &dec, const Angle &W)
{
    double sr, cr, sd, cd, sw, cw;
    fm_sincos(ra.value, &sr, &cr);
    fm_sincos(dec.value, &sd, &cd);
    fm_sincos(W.value, &sw, &cw);
    const Vector3d node(-sr, cr, 0.0); // where the equator ascends, and 90 degrees further along it
    const Vector3d further(-sd * cr, -sd * sr, cd);
    BodyAttitude attitude;
    attitude.dcm_PN.row(0) = cw * node + sw * further;
    attitude.dcm_PN.row(1) = cw * further - sw * node;
    attitude.dcm_PN.row(2) = Vector3d(cd * cr, cd * sr, sd);
    attitude.omega_PN_P =
        Vector3d(ra.rate * cd * sw - dec.rate * cw, ra.rate * cd * cw + dec.rate * sw, W.rate + ra.rate * sd);
    return attitude;
}

} // namespace

Orientation Orientation::built_in(int body)
{
    for (const Polynomials &known : built_in_bodies) {
        if (known.body != body) {
            continue;
        }
        Orientation orientation;
        orientation.body_ = body;
        for (int i = 0; i < 3; i++) {
            orientation.ra_[i] = known.ra[i] * degree;
            orientation.dec_[i] = known.dec[i] * degree;
            orientation.pm_[i] = known.pm[i] * degree;
        }
        for (const Periodic &term : built_in_terms(body)) {
            orientation.terms_.push_back(
                {{term.E0 * degree, term.E1 * degree, 0.0}, term.ra * degree, term.dec * degree, term.pm * degree});
        }
        return orientation;
    }
    std::vector<std::string> names;
    for (const Polynomials &known : built_in_bodies) {
        names.push_back(body_name(known.body));
    }
    throw sim::SetupError("no orientation is built in for " + body_name(body) + "; it is for " +
                          sim::format_list(names) + ". Others come from a text kernel (.tpc)");
}

Orientation Orientation::from(const TextKernel &pck, int body)
{
    Orientation orientation;
    orientation.body_ = body;
    polynomial(pck, key(body, "POLE_RA"), orientation.ra_);
    polynomial(pck, key(body, "POLE_DEC"), orientation.dec_);
    polynomial(pck, key(body, "PM"), orientation.pm_);
    const auto insist = [&](const char *what, double expected) {
        const std::string name = key(body, what);
        if (pck.has(name) && pck.number(name) != expected) {
            refuse_line(pck.file(), pck.values(name).front().line,
                        name + " is " + sim::format_number(pck.number(name)) + "; only " +
                            sim::format_number(expected) + " is read: constants relative to J2000");
        }
    };
    insist("CONSTANTS_REF_FRAME", 1.0);
    insist("CONSTANTS_JED_EPOCH", 2451545.0);

    const auto ra = amplitudes(pck, key(body, "NUT_PREC_RA"));
    const auto dec = amplitudes(pck, key(body, "NUT_PREC_DEC"));
    const auto pm = amplitudes(pck, key(body, "NUT_PREC_PM"));
    const std::size_t count = std::max({ra.size(), dec.size(), pm.size()});
    if (count == 0) {
        return orientation;
    }
    // The angles belong to the planet's whole system.
    const int system = body > 99 && body < 1000 ? body / 100 : body;
    const std::string degree_name = key(system, "MAX_PHASE_DEGREE");
    const double phase_degree = pck.has(degree_name) ? pck.number(degree_name) : 1.0;
    if (phase_degree != 1.0 && phase_degree != 2.0) {
        refuse_line(pck.file(), pck.values(degree_name).front().line,
                    degree_name + " is " + sim::format_number(phase_degree) + "; 1 and 2 are read");
    }
    const std::size_t stride = phase_degree == 2.0 ? 3 : 2;
    const std::string angles_name = key(system, "NUT_PREC_ANGLES");
    const auto angles = pck.numbers(angles_name, 1, 3000);
    if (angles.size() < stride * count) {
        refuse_line(pck.file(), pck.values(angles_name).front().line,
                    angles_name + " has " + std::to_string(angles.size()) + " values; the terms of " + body_name(body) +
                        " need " + std::to_string(stride * count));
    }
    for (std::size_t i = 0; i < count; i++) {
        Term term = {};
        for (std::size_t k = 0; k < stride; k++) {
            term.E[k] = angles[stride * i + k] * degree;
        }
        term.ra = i < ra.size() ? ra[i] * degree : 0.0;
        term.dec = i < dec.size() ? dec[i] * degree : 0.0;
        term.pm = i < pm.size() ? pm[i] * degree : 0.0;
        if (term.ra != 0.0 || term.dec != 0.0 || term.pm != 0.0) {
            orientation.terms_.push_back(term);
        }
    }
    return orientation;
}

Orientation Orientation::of(std::shared_ptr<const EarthRotation> earth)
{
    Orientation orientation;
    orientation.body_ = 399;
    orientation.earth_ = std::move(earth);
    return orientation;
}

Orientation Orientation::of(std::shared_ptr<const Librations> moon)
{
    Orientation orientation;
    orientation.body_ = 301;
    orientation.moon_ = std::move(moon);
    return orientation;
}

void Orientation::require(Epoch from, Epoch to) const
{
    if (earth_) {
        earth_->require(from, to);
    } else if (moon_) {
        moon_->require(from, to);
    }
}

Matrix3d Orientation::dcm_PN(Epoch epoch, double tau) const
{
    return earth_ ? earth_->dcm_PN(epoch, tau, window_) : at(epoch, tau).dcm_PN;
}

BodyAttitude Orientation::at(Epoch epoch, double tau) const
{
    if (earth_) {
        return earth_->at(epoch, tau, window_);
    }
    if (moon_) {
        double angles[3], rates[3];
        moon_->angles(epoch, tau, angles, rates);
        return turned({angles[0] - pi / 2.0, rates[0]}, {pi / 2.0 - angles[1], -rates[1]}, {angles[2], rates[2]});
    }
    // Whole days and the rest: the prime meridian turns fast, and keeps its resolution so.
    constexpr std::int64_t day_ns = 86'400'000'000'000;
    const std::int64_t days = epoch.ns / day_ns;
    const auto whole = static_cast<double>(days);
    const double rest = (static_cast<double>(epoch.ns - days * day_ns) / 1e9 + tau) / day_s;
    const double T = (whole + rest) / century;

    double ra = evaluate(ra_, T), ra_rate = slope(ra_, T) / century_s;
    double dec = evaluate(dec_, T), dec_rate = slope(dec_, T) / century_s;
    double W = evaluate(pm_, whole);
    W -= 2.0 * pi * std::floor(W / (2.0 * pi));
    W += rest * (slope(pm_, whole) + pm_[2] * rest);
    double W_rate = slope(pm_, whole + rest) / day_s;
    for (const Term &term : terms_) {
        double s, c;
        fm_sincos(evaluate(term.E, T), &s, &c);
        const double rate = slope(term.E, T) / century_s;
        ra += term.ra * s;
        ra_rate += term.ra * c * rate;
        dec += term.dec * c;
        dec_rate -= term.dec * s * rate;
        W += term.pm * s;
        W_rate += term.pm * c * rate;
    }
    return turned({ra, ra_rate}, {dec, dec_rate}, {W, W_rate});
}

double equatorial_radius(const TextKernel &pck, int body)
{
    const auto radii = pck.numbers(key(body, "RADII"), 3, 3);
    return 1e3 * (0.5 * (radii[0] + radii[1]));
}

double polar_radius(const TextKernel &pck, int body)
{
    return 1e3 * pck.numbers(key(body, "RADII"), 3, 3)[2];
}

} // namespace fledge::world
