// SPDX-License-Identifier: Apache-2.0
// With q = R / r, (x, y, z) = r / |r| and P_nm = (x^2 + y^2)^(m/2) A_nm(z), the polynomials A are
// scaled so that
//
//   A_mm = 1,  A_nm = 2 z A_{n-1,m} - beta_nm A_{n-2,m},
//   beta_nm = 4 ((n-1)^2 - m^2) / ((2 n - 1) (2 n - 3)):
//
// the factor of the first term is the same for all n and m; the scale goes into the coefficients.
// In p_nm = q^(n-m) A_nm every column of one order m is
//
//   p_nm = (2 z q) p_{n-1,m} - beta_nm q^2 p_{n-2,m}.
//
// From each column are needed, for C and for S: sum p C, sum (n - m) p C, and for the derivative
// by z, where A'_nm ~ A_{n,m+1}, sum p_{n,m+1} kappa C_nm, with kappa C put beside the
// coefficients of the column m + 1 in advance. The second sum comes from the partial sums s_k of
// the first, without a multiplication: sum_k k t_k = K s_K - sum_{k<K} s_k. That is 7 products and
// 7 sums for each n and m. Four columns run at a time, in two SIMD pairs, whose dependencies are
// independent of one another.
//
// With (q (x + i y))^m = rho_m + i sigma_m, the columns make the gradient (Pines 1973; the sums
// written for C stand for sum C rho + S sigma):
//
//   a = mu / r^2 (-(1 + sum_m (sum (n + m + 1) p C) + z sum_m (sum p' C)) r / |r| + (u, v, w))
//   u = sum_m m sum p (C rho_{m-1} + S sigma_{m-1}) q,  v = ... (S rho_{m-1} - C sigma_{m-1}) q,
//   w = sum_m (sum p' C)
#include "world/environment/harmonics.h"

#include "sim/error.h"

#include <algorithm>
#include <cmath>

namespace fledge::world {

using Eigen::Vector3d;

namespace {

// Where (x^2 + y^2)^(m/2) vanishes, A grows. To keep both within the range of doubles, coefficients
// are multiplied by small and powers of q (x + i y) by large (after Holmes and Featherstone 2002).
// To degree 2400 then p stays within 1e-233 to 1e270 and its sums within 1e-250 to 1e253 times C.
constexpr double large = 0x1p+830, small = 0x1p-830;
constexpr int highest_degree = 2400;

constexpr int order_block = 4; // orders at a time

/// The sums of two columns.
template <typename Pair> struct Columns {
    Pair before = {}, p = {1.0, 1.0}; // p_{n-1}, p_n
    Pair C = {}, S = {};              // sum p C, sum p S
    Pair CC = {}, SS = {};            // sums of the partial sums of these
    Pair dC = {}, dS = {};            // sum p dC, sum p dS

    template <typename Terms> __attribute__((always_inline)) void add(const Terms &t)
    {
        CC += C;
        SS += S;
        C += p * t.C;
        S += p * t.S;
        dC += p * t.dC;
        dS += p * t.dS;
    }

    template <typename Terms> __attribute__((always_inline)) void step(const Terms &t, Pair two_z, Pair q2)
    {
        const Pair next = two_z * p - (t.beta * q2) * before;
        before = p;
        p = next;
        add(t);
    }
};

} // namespace

Harmonics::Harmonics(const HarmonicField &field) : Harmonics(field, field.degree) {}

Harmonics::Harmonics(const HarmonicField &field, int degree) : mu_(field.mu), radius_(field.radius), degree_(degree)
{
    if (degree < 0 || degree > std::min(field.degree, highest_degree)) {
        throw sim::SetupError("gravity field " + field.name + ": degree " + std::to_string(degree) +
                              " was asked for; it has " + std::to_string(field.degree) + ", and 0 to " +
                              std::to_string(highest_degree) + " are possible");
    }
    // What turns a normalised coefficient into one of A, for each degree of the column at hand.
    const auto at = [](int n) { return static_cast<std::size_t>(n); };
    const auto C = [&](int n, int m) { return field.C[HarmonicField::index(n, m)]; };
    const auto S = [&](int n, int m) { return field.S[HarmonicField::index(n, m)]; };
    std::vector<double> scale(at(degree) + 1);
    double sectoral = small;
    for (int first = 0; first <= degree; first += order_block) {
        const std::size_t begin = terms_.size();
        terms_.resize(begin + 2 * at(degree - first + 1), Terms{});
        for (int m = first; m < std::min(first + order_block, degree + 1); m++) {
            if (m > 0) {
                sectoral *= std::sqrt(m == 1 ? 3.0 : (2.0 * m + 1.0) / (2.0 * m));
            }
            scale[at(m)] = sectoral;
            for (int n = m; n <= degree; n++) {
                Terms &t = terms_[begin + 2 * at(n - m) + at((m - first) / 2)];
                const int lane = (m - first) % 2;
                if (n > m) {
                    scale[at(n)] = scale[at(n - 1)] * 0.5 *
                                   std::sqrt((2.0 * n - 1.0) * (2.0 * n + 1.0) / (double(n - m) * double(n + m)));
                    t.beta[lane] = 4.0 * (double(n - 1 - m) * double(n - 1 + m)) / ((2.0 * n - 1.0) * (2.0 * n - 3.0));
                }
                if (n > 0) { // C00 is the point mass
                    t.C[lane] = scale[at(n)] * C(n, m);
                    t.S[lane] = scale[at(n)] * S(n, m);
                }
                if (m > 0) {
                    const double kappa = std::sqrt(double(n - m + 1) * double(n + m) * (m == 1 ? 0.5 : 1.0));
                    t.dC[lane] = scale[at(n)] * kappa * C(n, m - 1);
                    t.dS[lane] = scale[at(n)] * kappa * S(n, m - 1);
                }
            }
        }
    }
}

Vector3d Harmonics::gravity(const Vector3d &r_P, double *potential) const
{
    const double r2 = r_P.squaredNorm(), r = std::sqrt(r2), q = radius_ / r;
    const double x = r_P[0] / r, y = r_P[1] / r, z = r_P[2] / r;
    const double w_re = q * x, w_im = q * y; // w = q (x + i y)
    const double w2_re = w_re * w_re - w_im * w_im;
    const double w2_im = 2.0 * w_re * w_im;
    const Pair w2_rho = {w2_re, w2_re}, w2_sigma = {w2_im, w2_im};
    const Pair two_z = {2.0 * z * q, 2.0 * z * q}, q2 = {q * q, q * q};

    Pair rho = {large, large * w_re}, sigma = {0.0, large * w_im}; // of the orders m and m + 1
    Pair rho_last = {0.0, 0.0}, sigma_last = {0.0, 0.0};           // of the two before
    Pair value = {}, radial = {}, u = {}, v = {}, w = {};
    Pair order = {0.0, 1.0};
    const Terms *t = terms_.data();
    for (int first = 0; first <= degree_; first += order_block) {
        const int last = degree_ - first; // the highest n - m
        Columns<Pair> low, high;
        low.add(t[0]);
        high.add(t[1]);
        t += 2;
        for (int k = 1; k <= last; k++, t += 2) {
            low.step(t[0], two_z, q2);
            high.step(t[1], two_z, q2);
        }
        const Pair k_last = {double(last), double(last)};
        for (const Columns<Pair> *columns : {&low, &high}) {
            const Pair rho_before = __builtin_shufflevector(rho_last, rho, 1, 2);
            const Pair sigma_before = __builtin_shufflevector(sigma_last, sigma, 1, 2);
            const Columns<Pair> &c = *columns;
            const Pair weight = k_last + order + order + 1.0;
            value += c.C * rho + c.S * sigma;
            radial += (weight * c.C - c.CC) * rho + (weight * c.S - c.SS) * sigma;
            u += order * (c.C * rho_before + c.S * sigma_before);
            v += order * (c.S * rho_before - c.C * sigma_before);
            w += c.dC * rho_before + c.dS * sigma_before;
            order += 2.0;
            rho_last = rho;
            sigma_last = sigma;
            rho = rho_last * w2_rho - sigma_last * w2_sigma;
            sigma = rho_last * w2_sigma + sigma_last * w2_rho;
        }
    }
    const double along = q * (w[0] + w[1]);
    const double outward = 1.0 + ((radial[0] + radial[1]) + z * along);
    const double scale = mu_ / r2;
    if (potential) {
        *potential = mu_ / r * (1.0 + (value[0] + value[1]));
    }
    return {scale * (q * (u[0] + u[1]) - outward * x), scale * (q * (v[0] + v[1]) - outward * y),
            scale * (along - outward * z)};
}

std::shared_ptr<Harmonics> read_harmonics(const HarmonicsSetup &setup)
{
    const auto epoch = setup.date ? std::optional(TimeSystem().epoch(*setup.date)) : std::nullopt;
    const HarmonicField field = read_gravity_field(setup.path, epoch, setup.mu);
    auto made = std::make_shared<Harmonics>(field, setup.degree.value_or(field.degree));
    if (!setup.tides.empty()) {
        made->tides.emplace(field.mu, field.radius, setup.tides == "file" ? field.tide_system : setup.tides);
    }
    made->setup = setup;
    return made;
}

} // namespace fledge::world
