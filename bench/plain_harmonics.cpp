// SPDX-License-Identifier: Apache-2.0
#include "bench/plain_harmonics.h"

#include <cmath>

namespace fledge::bench {

using Eigen::Vector3d;
using world::HarmonicField;

PlainHarmonics::PlainHarmonics(const HarmonicField &field, int degree)
    : mu_(field.mu), radius_(field.radius), degree_(degree), power_(static_cast<std::size_t>(degree) + 1)
{
    double sectoral = 1.0;
    for (int m = 0; m <= degree; m++) {
        if (m > 0) {
            sectoral *= std::sqrt(m == 1 ? 3.0 : (2.0 * m + 1.0) / (2.0 * m));
        }
        sectoral_.push_back(sectoral);
        C_mm_.push_back(field.C[HarmonicField::index(m, m)]);
        S_mm_.push_back(field.S[HarmonicField::index(m, m)]);
        for (int n = m + 1; n <= degree; n++) {
            const double n_m = n - m, nm = n + m, n2 = 2.0 * n;
            Terms t;
            t.a = std::sqrt((n2 - 1.0) * (n2 + 1.0) / (n_m * nm));
            t.b = n == m + 1 ? 0.0 : std::sqrt((n2 + 1.0) * (nm - 1.0) * (n_m - 1.0) / (n_m * nm * (n2 - 3.0)));
            t.f = std::sqrt((double(n) * n - double(m) * m) * (n2 + 1.0) / (n2 - 1.0));
            t.C = field.C[HarmonicField::index(n, m)];
            t.S = field.S[HarmonicField::index(n, m)];
            terms_.push_back(t);
        }
    }
}

Vector3d PlainHarmonics::gravity(const Vector3d &r_P) const
{
    const double r = r_P.norm(), across = std::sqrt(r_P[0] * r_P[0] + r_P[1] * r_P[1]);
    const double s = r_P[2] / r, c = across / r; // sine and cosine of the latitude
    const double cos_lon = r_P[0] / across, sin_lon = r_P[1] / across;
    const double q = radius_ / r;
    power_[0] = 1.0;
    for (std::size_t n = 1; n < power_.size(); n++) {
        power_[n] = power_[n - 1] * q;
    }

    double by_radius = 0.0, by_latitude = 0.0, by_longitude = 0.0;
    double cos_m = 1.0, sin_m = 0.0, cos_power = 1.0;
    const Terms *t = terms_.data();
    for (int m = 0; m <= degree_; m++) {
        const auto i = static_cast<std::size_t>(m);
        double before = 0.0, p = sectoral_[i] * cos_power;
        // With x = (R / r)^n P_nm: sums of x C, (n + 1) x C, and of x' C, x' = cos(lat) dx / d lat.
        double x = power_[i] * p;
        double dx = -m * s * x;
        double C = x * C_mm_[i], S = x * S_mm_[i];
        double rC = (m + 1) * C, rS = (m + 1) * S;
        double dC = dx * C_mm_[i], dS = dx * S_mm_[i];
        double degree = m;
        for (std::size_t n = i + 1; n < power_.size(); n++, t++) {
            degree += 1.0;
            const double next = t->a * s * p - t->b * before;
            x = power_[n] * next;
            dx = power_[n] * (t->f * p - degree * s * next);
            const double xC = x * t->C, xS = x * t->S;
            C += xC;
            S += xS;
            rC += (degree + 1.0) * xC;
            rS += (degree + 1.0) * xS;
            dC += dx * t->C;
            dS += dx * t->S;
            before = p;
            p = next;
        }
        by_radius += rC * cos_m + rS * sin_m;
        by_latitude += dC * cos_m + dS * sin_m;
        by_longitude += m * (S * cos_m - C * sin_m);
        const double cos_next = cos_m * cos_lon - sin_m * sin_lon;
        sin_m = sin_m * cos_lon + cos_m * sin_lon;
        cos_m = cos_next;
        cos_power *= c;
    }

    const double scale = mu_ / (r * r);
    const double up = -scale * by_radius;
    const double north = scale * by_latitude / c;
    const double east = scale * by_longitude / c;
    return {(up * c - north * s) * cos_lon - east * sin_lon, (up * c - north * s) * sin_lon + east * cos_lon,
            up * s + north * c};
}

} // namespace fledge::bench
