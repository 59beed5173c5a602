// SPDX-License-Identifier: Apache-2.0
// With V_nm + i W_nm = (R / r)^(n+1) P_nm(sin lat) e^(i m lon), not normalised, a body of mu_j at the distance r_j
// changes the coefficients by
//
//   C_nm - i S_nm = k_nm mu_j / mu (2 - d_m0) (n - m)! / (n + m)! (V_nm - i W_nm)(body),
//
// and the gravity of C and S at r follows from V and W there (Cunningham; Montenbruck and Gill, section 3.2.4).
// In step 2 a tide of the species m has the argument m (theta + pi) - sum_i N_i F_i, theta: the mean sidereal time,
// F: the arguments of Delaunay. All but m alpha, the turning, changes in days: a value at each hour is enough.
#include "world/environment/solid_tides.h"

#include "flight/math/elementary.h"
#include "sim/error.h"
#include "world/environment/bodies.h"

#include <erfa.h>

#include <cmath>
#include <numbers>

namespace fledge::world {

using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

struct LoveNumber {
    double re, im, plus; // plus: of the effect on degree 4
};

// Table 6.3 of the anelastic Earth.
constexpr LoveNumber love_numbers[4][4] = {
    {},
    {},
    {{0.30190, 0.0, -0.00089}, {0.29830, -0.00144, -0.00080}, {0.30102, -0.00130, -0.00057}},
    {{0.093, 0, 0}, {0.093, 0, 0}, {0.093, 0, 0}, {0.094, 0, 0}},
};

/// A tide of the species m, the multiples of l, l', F, D, Omega, and its amplitudes [1e-12] in phase and out of it.
struct TideLine {
    int m, delaunay[5];
    double in, out;
};

// Tables 6.5b, 6.5a and 6.5c.
constexpr TideLine tide_lines[] = {
    // clang-format off
    {0, {0, 0, 0, 0, 1}, 16.6, -6.7},
    {0, {0, 0, 0, 0, 2}, -0.1, 0.1},
    {0, {0, -1, 0, 0, 0}, -1.2, 0.8},
    {0, {0, 0, -2, 2, -2}, -5.5, 4.3},
    {0, {0, 0, -2, 2, -1}, 0.1, -0.1},
    {0, {0, -1, -2, 2, -2}, -0.3, 0.2},
    {0, {1, 0, 0, -2, 0}, -0.3, 0.7},
    {0, {-1, 0, 0, 0, -1}, 0.1, -0.2},
    {0, {-1, 0, 0, 0, 0}, -1.2, 3.7},
    {0, {-1, 0, 0, 0, 1}, 0.1, -0.2},
    {0, {1, 0, -2, 0, -2}, 0.1, -0.2},
    {0, {0, 0, 0, -2, 0}, 0.0, 0.6},
    {0, {-2, 0, 0, 0, 0}, 0.0, 0.3},
    {0, {0, 0, -2, 0, -2}, 0.6, 6.3},
    {0, {0, 0, -2, 0, -1}, 0.2, 2.6},
    {0, {0, 0, -2, 0, 0}, 0.0, 0.2},
    {0, {1, 0, -2, -2, -2}, 0.1, 0.2},
    {0, {-1, 0, -2, 0, -2}, 0.4, 1.1},
    {0, {-1, 0, -2, 0, -1}, 0.2, 0.5},
    {0, {0, 0, -2, -2, -2}, 0.1, 0.2},
    {0, {-2, 0, -2, 0, -2}, 0.1, 0.1},
    {1, {2, 0, 2, 0, 2}, -0.1, 0.0},
    {1, {0, 0, 2, 2, 2}, -0.1, 0.0},
    {1, {1, 0, 2, 0, 1}, -0.1, 0.0},
    {1, {1, 0, 2, 0, 2}, -0.7, 0.1},
    {1, {-1, 0, 2, 2, 2}, -0.1, 0.0},
    {1, {0, 0, 2, 0, 1}, -1.3, 0.1},
    {1, {0, 0, 2, 0, 2}, -6.8, 0.6},
    {1, {0, 0, 0, 2, 0}, 0.1, 0.0},
    {1, {1, 0, 2, -2, 2}, 0.1, 0.0},
    {1, {-1, 0, 2, 0, 1}, 0.1, 0.0},
    {1, {-1, 0, 2, 0, 2}, 0.4, 0.0},
    {1, {1, 0, 0, 0, 0}, 1.3, -0.1},
    {1, {1, 0, 0, 0, 1}, 0.3, 0.0},
    {1, {-1, 0, 0, 2, 0}, 0.3, 0.0},
    {1, {-1, 0, 0, 2, 1}, 0.1, 0.0},
    {1, {0, 1, 2, -2, 2}, -1.9, 0.1},
    {1, {0, 0, 2, -2, 1}, 0.5, 0.0},
    {1, {0, 0, 2, -2, 2}, -43.4, 2.9},
    {1, {0, -1, 2, -2, 2}, 0.6, 0.0},
    {1, {0, 1, 0, 0, 0}, 1.6, -0.1},
    {1, {-2, 0, 2, 0, 1}, 0.1, 0.0},
    {1, {0, 0, 0, 0, -2}, 0.1, 0.0},
    {1, {0, 0, 0, 0, -1}, -8.8, 0.5},
    {1, {0, 0, 0, 0, 0}, 470.9, -30.2},
    {1, {0, 0, 0, 0, 1}, 68.1, -4.6},
    {1, {0, 0, 0, 0, 2}, -1.6, 0.1},
    {1, {-1, 0, 0, 1, 0}, 0.1, 0.0},
    {1, {0, -1, 0, 0, -1}, -0.1, 0.0},
    {1, {0, -1, 0, 0, 0}, -20.6, -0.3},
    {1, {0, 1, -2, 2, -2}, 0.3, 0.0},
    {1, {0, -1, 0, 0, 1}, -0.3, 0.0},
    {1, {-2, 0, 0, 2, 0}, -0.2, 0.0},
    {1, {-2, 0, 0, 2, 1}, -0.1, 0.0},
    {1, {0, 0, -2, 2, -2}, -5.0, 0.3},
    {1, {0, 0, -2, 2, -1}, 0.2, 0.0},
    {1, {0, -1, -2, 2, -2}, -0.2, 0.0},
    {1, {1, 0, 0, -2, 0}, -0.5, 0.0},
    {1, {1, 0, 0, -2, 1}, -0.1, 0.0},
    {1, {-1, 0, 0, 0, -1}, 0.1, 0.0},
    {1, {-1, 0, 0, 0, 0}, -2.1, 0.1},
    {1, {-1, 0, 0, 0, 1}, -0.4, 0.0},
    {1, {0, 0, 0, -2, 0}, -0.2, 0.0},
    {1, {-2, 0, 0, 0, 0}, -0.1, 0.0},
    {1, {0, 0, -2, 0, -2}, -0.6, 0.0},
    {1, {0, 0, -2, 0, -1}, -0.4, 0.0},
    {1, {0, 0, -2, 0, 0}, -0.1, 0.0},
    {1, {-1, 0, -2, 0, -2}, -0.1, 0.0},
    {1, {-1, 0, -2, 0, -1}, -0.1, 0.0},
    {2, {1, 0, 2, 0, 2}, -0.3, 0.0},
    {2, {0, 0, 2, 0, 2}, -1.2, 0.0},
    // clang-format on
};

constexpr std::int64_t ns_of_hour = 3'600'000'000'000;
constexpr double century_seconds = 36525.0 * 86400.0;

struct SolidHarmonics {
    double V[6][6] = {}, W[6][6] = {};

    /// Up to a degree from 1 to 5.
    SolidHarmonics(double radius, const Vector3d &r_P, int top)
    {
        const double r2 = r_P.squaredNorm(), q2 = radius * radius / r2;
        const Vector3d s = (radius / r2) * r_P;
        V[0][0] = radius / std::sqrt(r2);
        for (int m = 0; m <= top; m++) {
            if (m > 0) {
                V[m][m] = (2 * m - 1) * (s[0] * V[m - 1][m - 1] - s[1] * W[m - 1][m - 1]);
                W[m][m] = (2 * m - 1) * (s[0] * W[m - 1][m - 1] + s[1] * V[m - 1][m - 1]);
            }
            for (int n = m + 1; n <= top; n++) {
                const double up = (2 * n - 1) * s[2] / (n - m), back = (n + m - 1) * q2 / (n - m);
                V[n][m] = up * V[n - 1][m] - (n >= m + 2 ? back * V[n - 2][m] : 0.0);
                W[n][m] = up * W[n - 1][m] - (n >= m + 2 ? back * W[n - 2][m] : 0.0);
            }
        }
    }
};

/// (2 - d_m0) (n - m)! / (n + m)!
double order_weight(int n, int m)
{
    double value = m == 0 ? 1.0 : 2.0;
    for (int k = n - m + 1; k <= n + m; k++) {
        value /= k;
    }
    return value;
}

/// The sum of each species at an hour past J2000, without m alpha.
void sum_frequencies(std::int64_t hour, std::complex<double> (&sums)[3])
{
    const double T = static_cast<double>(hour) * 3600.0 / century_seconds;
    const double F[5] = {eraFal03(T), eraFalp03(T), eraFaf03(T), eraFad03(T), eraFaom03(T)};
    // From the ICRF's right ascension to the mean equinox, IAU 2006.
    const double to_theta = 4612.156534 * T / 3600.0 * std::numbers::pi / 180.0 + std::numbers::pi;
    for (std::complex<double> &sum : sums) {
        sum = 0.0;
    }
    for (const TideLine &tide : tide_lines) {
        double phase = tide.m * to_theta;
        for (int i = 0; i < 5; i++) {
            phase -= tide.delaunay[i] * F[i];
        }
        double s = 0.0, c = 0.0;
        fm_sincos(phase, &s, &c);
        sums[tide.m] += std::complex(1e-12 * (tide.in * c - tide.out * s), 1e-12 * (tide.in * s + tide.out * c));
    }
}

} // namespace

SolidTides::SolidTides(double mu, double radius, const std::string &tide_system)
    : mu_(mu), radius_(radius), mu_moon_(body_mu(301)), mu_sun_(body_mu(10)),
      // A0 H0 k20 of section 6.2.2, not normalised.
      permanent_(tide_system == "zero_tide" ? 4.4228e-8 * -0.31460 * love_numbers[2][0].re * std::sqrt(5.0) : 0.0)
{
    if (tide_system != "tide_free" && tide_system != "zero_tide") {
        throw sim::SetupError("solid tides need a field of the tide system tide_free or zero_tide, found " +
                              tide_system +
                              (tide_system == "unknown" ? "; give the field's: tides=\"zero_tide\", say" : ""));
    }
}

void SolidTides::add_body(double mu, const Vector3d &r_P, Coefficients &tides) const
{
    const SolidHarmonics body(radius_, r_P, 3);
    for (int n = 2; n <= 3; n++) {
        for (int m = 0; m <= n; m++) {
            const LoveNumber &k = love_numbers[n][m];
            const double g = mu / mu_ * order_weight(n, m), V = g * body.V[n][m], W = g * body.W[n][m];
            tides.C[n][m] += k.re * V + k.im * W;
            tides.S[n][m] += k.re * W - k.im * V;
            if (n == 2) { // normalised, degree 4 has k.plus / k of degree 2
                const double ratio = k.plus * std::sqrt(order_weight(4, m) * 9.0 / (order_weight(2, m) * 5.0));
                tides.C[4][m] += ratio * V;
                tides.S[4][m] += ratio * W;
            }
        }
    }
}

void SolidTides::add_frequencies(Epoch epoch, double tau, double alpha, Window &window, Coefficients &tides) const
{
    const std::int64_t ns = epoch.ns + std::llround(tau * 1e9);
    const std::int64_t hour = ns / ns_of_hour - (ns % ns_of_hour < 0 ? 1 : 0);
    if (window.hour != hour) {
        sum_frequencies(hour, window.before);
        sum_frequencies(hour + 1, window.after);
        window.hour = hour;
    }
    const double u = static_cast<double>(ns - hour * ns_of_hour) / static_cast<double>(ns_of_hour);
    double s = 0.0, c = 0.0;
    fm_sincos(alpha, &s, &c);
    const double turn[3][2] = {{1.0, 0.0}, {c, s}, {c * c - s * s, 2.0 * s * c}};
    double re[3], im[3];
    for (int m = 0; m <= 2; m++) {
        const std::complex<double> slow = (1.0 - u) * window.before[m] + u * window.after[m];
        const double norm = std::sqrt(5.0 * order_weight(2, m));
        re[m] = norm * (slow.real() * turn[m][0] - slow.imag() * turn[m][1]);
        im[m] = norm * (slow.real() * turn[m][1] + slow.imag() * turn[m][0]);
    }
    tides.C[2][0] += re[0];
    tides.C[2][1] += im[1];
    tides.S[2][1] += re[1];
    tides.C[2][2] += re[2];
    tides.S[2][2] -= im[2];
}

void SolidTides::add_pole(Epoch epoch, const Eigen::Vector2d &pole, Coefficients &tides)
{
    constexpr double arcseconds = 648000.0 / std::numbers::pi; // in a radian
    const double years = epoch.seconds() / (century_seconds / 100.0);
    const double m1 = pole[0] * arcseconds - (0.0550 + 0.001677 * years);
    const double m2 = -(pole[1] * arcseconds - (0.3205 + 0.003460 * years));
    const double scale = -1.333e-9 * std::sqrt(5.0 * order_weight(2, 1));
    tides.C[2][1] += scale * (m1 + 0.0115 * m2);
    tides.S[2][1] += scale * (m2 - 0.0115 * m1);
}

SolidTides::Coefficients SolidTides::at(Epoch epoch, double tau, const Matrix3d &dcm_PN, const Vector3d &moon_N,
                                        const Vector3d &sun_N, Window &window) const
{
    Coefficients tides;
    tides.C[2][0] = -permanent_;
    add_body(mu_moon_, dcm_PN * moon_N, tides);
    add_body(mu_sun_, dcm_PN * sun_N, tides);
    add_frequencies(epoch, tau, fm_atan2(dcm_PN(0, 1), dcm_PN(0, 0)), window, tides);
    return tides;
}

Vector3d SolidTides::gravity(const Coefficients &tides, const Vector3d &r_P) const
{
    const SolidHarmonics at(radius_, r_P, 5);
    Vector3d sum = Vector3d::Zero();
    for (int n = 2; n <= 4; n++) {
        for (int m = 0; m <= n; m++) {
            const double C = tides.C[n][m], S = tides.S[n][m];
            const double *V = at.V[n + 1], *W = at.W[n + 1];
            if (m == 0) {
                sum -= C * Vector3d(V[1], W[1], 0.0);
            } else {
                const double f = double(n - m + 2) * double(n - m + 1);
                sum[0] += 0.5 * (-C * V[m + 1] - S * W[m + 1] + f * (C * V[m - 1] + S * W[m - 1]));
                sum[1] += 0.5 * (-C * W[m + 1] + S * V[m + 1] + f * (S * V[m - 1] - C * W[m - 1]));
            }
            sum[2] -= (n - m + 1) * (C * V[m] + S * W[m]);
        }
    }
    return (mu_ / (radius_ * radius_)) * sum;
}

} // namespace fledge::world
