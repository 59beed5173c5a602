// SPDX-License-Identifier: Apache-2.0
#include "world/environment/solid_tides.h"

#include "sim/error.h"
#include "world/environment/harmonics.h"
#include "world/environment/testing/files.h"

#include <cmath>
#include <complex>
#include <numbers>

namespace fledge::world {
namespace solid_tides_test {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using ::testing::HasSubstr;

constexpr double mu = 3.986004418e14, R = 6378136.6;
constexpr double mu_moon = 4.9028e12, mu_sun = 1.32712440e20; // [m^3/s^2]
constexpr double degree_rad = std::numbers::pi / 180.0;
constexpr std::int64_t hour = 3'600'000'000'000;

/// sqrt((2 - d_m0) (2 n + 1) (n - m)! / (n + m)!)
double norm(int n, int m)
{
    return std::sqrt((m == 0 ? 1.0 : 2.0) * (2 * n + 1) * std::tgamma(n - m + 1) / std::tgamma(n + m + 1));
}

SolidTides::Coefficients raised_by(double mass, const Vector3d &r_P)
{
    SolidTides::Coefficients tides;
    SolidTides(mu, R, "tide_free").add_body(mass, r_P, tides);
    return tides;
}

void clear(SolidTides::Coefficients &tides, int n)
{
    for (int m = 0; m <= n; m++) {
        tides.C[n][m] = tides.S[n][m] = 0.0;
    }
}

TEST(SolidTides, HaveTheGravityOfAFieldWithTheirCoefficients)
{
    const SolidTides tides(mu, R, "tide_free");
    SolidTides::Coefficients coefficients;
    HarmonicField field = HarmonicField::zero(mu, R, 4), point = field;
    for (int n = 2; n <= 4; n++) {
        for (int m = 0; m <= n; m++) {
            const double C = 0.01 * std::cos(3.0 * n + m), S = m > 0 ? 0.01 * std::sin(n + 5.0 * m) : 0.0;
            field.C[HarmonicField::index(n, m)] = C;
            field.S[HarmonicField::index(n, m)] = S;
            coefficients.C[n][m] = C * norm(n, m);
            coefficients.S[n][m] = S * norm(n, m);
        }
    }
    for (const Vector3d &r : {Vector3d(5e6, -4e6, 3e6), Vector3d(1e5, 2e5, -7e6), Vector3d(0, 0, 7e6)}) {
        const Vector3d expected = Harmonics(field).gravity(r) - Harmonics(point).gravity(r);
        EXPECT_LT((tides.gravity(coefficients, r) - expected).norm(), 1e-13 * mu / r.squaredNorm());
    }
}

/// The tide of degree 2 by one Love number. Source: Montenbruck and Gill, equation 3.59.
Vector3d direct(double k, double mass, const Vector3d &body, const Vector3d &r_P)
{
    const Vector3d e = r_P.normalized(), s = body.normalized();
    const double cosine = e.dot(s), r = r_P.norm(), d = body.norm();
    return k / 2.0 * mass / (d * d * d) * std::pow(R, 5) / std::pow(r, 4) *
           ((3.0 - 15.0 * cosine * cosine) * e + 6.0 * cosine * s);
}

TEST(SolidTides, OfDegree2AreThoseOfTheDirectFormula)
{
    const SolidTides tides(mu, R, "tide_free");
    const Vector3d r(5e6, -4e6, 3e6), above(0.0, 0.0, -3.8e8);
    SolidTides::Coefficients zonal = raised_by(mu_moon, above);
    clear(zonal, 3);
    clear(zonal, 4);
    const Vector3d exact = direct(0.30190, mu_moon, above, r);
    EXPECT_LT((tides.gravity(zonal, r) - exact).norm(), 1e-13 * exact.norm());
    // Elsewhere the Love numbers of the orders differ by 1.2 %, and lag by 0.5 %.
    for (const Vector3d &moon : {Vector3d(3e8, 2e8, 1e8), Vector3d(-1e8, 3e8, -2e8), Vector3d(3e8, -1e7, 1.9e8)}) {
        SolidTides::Coefficients all = raised_by(mu_moon, moon);
        clear(all, 3);
        clear(all, 4);
        const Vector3d near = direct(0.300, mu_moon, moon, r);
        EXPECT_LT((tides.gravity(all, r) - near).norm(), 0.015 * near.norm());
        EXPECT_GT(near.norm(), 1e-7);
    }
}

/// k_n times the potential of degree 3 that the body raises, continued outwards.
double potential3(double k, double mass, const Vector3d &body, const Vector3d &r_P)
{
    const double c = body.normalized().dot(r_P.normalized());
    return k * mass / body.norm() * std::pow(R / body.norm(), 3) * std::pow(R / r_P.norm(), 4) *
           (5.0 * c * c * c - 3.0 * c) / 2.0;
}

TEST(SolidTides, OfDegree3AreTheGradientOfTheirPotential)
{
    const SolidTides tides(mu, R, "tide_free");
    const Vector3d r(5e6, -4e6, 3e6);
    for (const Vector3d &moon : {Vector3d(0, 0, 3.8e8), Vector3d(3e8, 2e8, 1e8), Vector3d(-1e8, 3e8, -2e8)}) {
        SolidTides::Coefficients only = raised_by(mu_moon, moon);
        clear(only, 2);
        clear(only, 4);
        Vector3d slope;
        for (int i = 0; i < 3; i++) {
            const Vector3d step = 10.0 * Vector3d::Unit(i);
            slope[i] = (potential3(0.093, mu_moon, moon, r + step) - potential3(0.093, mu_moon, moon, r - step)) / 20.0;
        }
        const double allowed = moon[0] == 0.0 ? 1e-6 : 0.011; // k33 = 0.094
        EXPECT_LT((tides.gravity(only, r) - slope).norm(), allowed * slope.norm());
    }
}

TEST(SolidTides, OfDegree4FollowThoseOfDegree2)
{
    // Normalised: dC_4m / dC_2m = k+ / k of the order.
    const SolidTides::Coefficients tides = raised_by(mu_sun, {1.2e11, 0.4e11, 0.5e11});
    const double plus[] = {-0.00089, -0.00080, -0.00057};
    const std::complex<double> k[] = {0.30190, {0.29830, -0.00144}, {0.30102, -0.00130}};
    for (int m = 0; m <= 2; m++) {
        const std::complex<double> two(tides.C[2][m] / norm(2, m), -tides.S[2][m] / norm(2, m));
        const std::complex<double> four(tides.C[4][m] / norm(4, m), -tides.S[4][m] / norm(4, m));
        EXPECT_LT(std::abs(four - two * plus[m] / k[m]), 1e-14 * std::abs(two));
    }
}

TEST(SolidTides, AreCarriedAheadOfTheBodyByTheTurningEarth)
{
    const SolidTides::Coefficients tides = raised_by(mu_moon, {3.8e8, 0, 0});
    EXPECT_NEAR(std::atan2(tides.S[2][2], tides.C[2][2]) / 2.0, 0.00130 / 0.30102 / 2.0, 1e-6); // [rad] of longitude
}

/// The part of C_2m, S_2m and C_20 at a rate [deg/h], over 40 years with Hann's window; normalised, C - i S.
std::complex<double> line(int m, double rate)
{
    const SolidTides tides(mu, R, "tide_free");
    SolidTides::Window window;
    constexpr std::int64_t count = 70'000, step = 5;
    std::complex<double> sum = 0.0;
    for (std::int64_t i = 0; i < count; i++) {
        const double t = static_cast<double>((i - count / 2) * step); // [h] past J2000
        SolidTides::Coefficients found;
        // The prime meridian turns by 15.04107 deg/h of sidereal time, of which precession is 4612 arcsec a century.
        const double precession = 4612.156534 / 3600.0 * t / (36525.0 * 24.0);
        const double alpha = std::remainder(280.46062 + 15.0410686 * t - precession, 360.0) * degree_rad;
        tides.add_frequencies({(i - count / 2) * step * hour}, 0.0, alpha, window, found);
        const double hann = 1.0 - std::cos(2.0 * std::numbers::pi * (static_cast<double>(i) + 0.5) / count);
        sum += hann * std::complex(found.C[2][m], -found.S[2][m]) / norm(2, m) *
               std::exp(std::complex(0.0, -std::remainder(rate * t, 360.0) * degree_rad));
    }
    return sum / static_cast<double>(count);
}

TEST(SolidTides, HaveTheLinesOfTheConventions)
{
    // Rates and amplitudes of tables 6.5. K1 has a neighbour of 68e-12 at the window's edge, psi1 one of 0.3e-12
    // closer than 40 years separate; a line of species 0 has half of its amplitude at +rate.
    const struct {
        const char *name;
        int m;
        double rate, in, out, allowed;
    } lines[] = {{"K1", 1, 15.0410686, 470.9, -30.2, 1.5}, {"P1", 1, 14.9589314, -43.4, 2.9, 0.1},
                 {"O1", 1, 13.9430356, -6.8, 0.6, 0.03},   {"psi1", 1, 15.0821353, -20.6, -0.3, 0.4},
                 {"M2", 2, 28.9841042, -1.2, 0.0, 0.01},   {"Mf", 0, 1.0980331, 0.3, 3.15, 0.03}};
    for (const auto &expected : lines) {
        EXPECT_NEAR(std::abs(line(expected.m, expected.rate)) * 1e12, std::hypot(expected.in, expected.out),
                    expected.allowed)
            << expected.name;
    }
}

TEST(SolidTides, HaveThePhaseOfTheConventionsForK1)
{
    // Section 6.2.1: dC21 = 470.9e-12 sin(theta + 180 deg) - 30.2e-12 cos(theta + 180 deg),
    //                dS21 = 470.9e-12 cos(theta + 180 deg) + 30.2e-12 sin(theta + 180 deg).
    const double theta = (280.46062 + 180.0) * degree_rad; // at t = 0
    const std::complex<double> expected(470.9 * std::sin(theta) - 30.2 * std::cos(theta),
                                        -470.9 * std::cos(theta) - 30.2 * std::sin(theta));
    EXPECT_LT(std::abs(line(1, 15.0410686) * 1e12 - expected), 2.0);
}

TEST(SolidTides, HaveThePermanentPartThatTheMeanOrbitsRaise)
{
    // The mean of P2(sin declination) / r^3 over orbits of an eccentricity and of an inclination to the ecliptic.
    const auto mean = [](double mass, double a, double e, double inclination) {
        const double tilt = std::sin(23.44 * degree_rad), lean = std::sin(inclination * degree_rad);
        return mass / mu * std::pow(R / a, 3) * std::pow(1.0 - e * e, -1.5) * (0.75 * tilt * tilt - 0.5) *
               (1.0 - 1.5 * lean * lean);
    };
    const double expected =
        0.30190 * (mean(mu_moon, 3.844e8, 0.0549, 5.145) + mean(mu_sun, 1.495979e11, 0.0167, 0.0)); // not normalised
    const Vector3d moon(3e8, 2e8, 1e8), sun(1.2e11, 0.8e11, 0.3e11);
    SolidTides::Window window;
    const auto C20 = [&](const char *system) {
        return SolidTides(mu, R, system).at({}, 0.0, Matrix3d::Identity(), moon, sun, window).C[2][0];
    };
    EXPECT_NEAR(C20("tide_free") - C20("zero_tide"), expected, 0.01 * std::abs(expected));
}

TEST(SolidTides, OfThePoleAreTheAnswerToTheCentrifugalPotential)
{
    // About the axis (m1, m2, 1) the potential has -spin^2 z (m1 x + m2 y), which k2 = 0.3077 + 0.0036 i answers,
    // (R / r)^5 outside.
    constexpr double k2 = 0.3077, lag = 0.0036 / 0.3077, spin = 7.292115e-5, arcsec = degree_rad / 3600.0,
                     decade = 10 * 365.25 * 86400.0;
    const Vector3d r(-3.1e6, 4.7e6, 4.2e6);
    const Eigen::Vector2d secular(0.0550 + 0.01677, 0.3205 + 0.03460); // ["] in 2010
    for (const Eigen::Vector2d &off : {Eigen::Vector2d(0.3, 0.0), Eigen::Vector2d(0.0, 0.3)}) {
        const double m1 = off[0] * arcsec, m2 = -off[1] * arcsec; // y of the pole counts to the west
        const auto U = [&](const Vector3d &at) {
            return -k2 * spin * spin * at[2] * ((m1 + lag * m2) * at[0] + (m2 - lag * m1) * at[1]) *
                   std::pow(R / at.norm(), 5);
        };
        Vector3d expected;
        for (int i = 0; i < 3; i++) {
            const Vector3d h = 100.0 * Vector3d::Unit(i);
            expected[i] = (U(r + h) - U(r - h)) / 200.0;
        }
        SolidTides::Coefficients tides;
        SolidTides::add_pole({std::llround(decade * 1e9)}, (secular + off) * arcsec, tides);
        const Vector3d found = SolidTides(mu, R, "tide_free").gravity(tides, r);
        EXPECT_LT((found - expected).norm(), 1e-3 * expected.norm()); // the digits of 1.333e-9 and 0.0115
    }
    SolidTides::Coefficients none;
    SolidTides::add_pole({std::llround(decade * 1e9)}, secular * arcsec, none);
    EXPECT_LT(std::fabs(none.C[2][1]) + std::fabs(none.S[2][1]), 1e-20);
}

TEST(SolidTides, RefuseOtherTideSystems)
{
    EXPECT_THAT([] { SolidTides(mu, R, "mean_tide"); },
                ::testing::ThrowsMessage<sim::SetupError>(HasSubstr("zero_tide, found mean_tide")));
}

} // namespace solid_tides_test
} // namespace fledge::world
