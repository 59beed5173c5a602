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
// 7 sums for each n and m. Four columns are a block; they run in one wide register or in two narrow ones. Two registers
// of columns go side by side, since a column waits for itself: two blocks, of which the second is four degrees
// shorter, or the two halves of one. Each column has the same operations in all widths.
//
// With (q (x + i y))^m = rho_m + i sigma_m, the columns make the gradient (Pines 1973; the sums
// written for C stand for sum C rho + S sigma):
//
//   a = mu / r^2 (-(1 + sum_m (sum (n + m + 1) p C) + z sum_m (sum p' C)) r / |r| + (u, v, w))
//   u = sum_m m sum p (C rho_{m-1} + S sigma_{m-1}) q,  v = ... (S rho_{m-1} - C sigma_{m-1}) q,
//   w = sum_m (sum p' C)
#include "world/environment/harmonics.h"

#include "sim/error.h"
#include "world/dynamics/lanes.h"

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

using Pair [[gnu::vector_size(16)]] = double; // two orders side by side

/// The sums of the columns in the lanes of a register.
template <typename Lanes> struct Columns {
    Lanes p = Lanes{} + 1.0;
    Lanes C = {}, S = {};   // sum p C, sum p S
    Lanes CC = {}, SS = {}; // sums of the partial sums of these
    Lanes dC = {}, dS = {}; // sum p dC, sum p dS
    Lanes before = {};      // the p before

    LANES_INLINE static const Lanes &at(const double *numbers)
    {
        using Aliased [[gnu::may_alias]] = Lanes;
        return *reinterpret_cast<const Aliased *>(numbers);
    }

    template <typename Terms> LANES_INLINE void add(const Terms &t, int lane)
    {
        CC += C;
        SS += S;
        C += p * at(t.C + lane);
        S += p * at(t.S + lane);
        dC += p * at(t.dC + lane);
        dS += p * at(t.dS + lane);
    }

    template <typename Terms> LANES_INLINE void step(const Terms &t, int lane, Lanes two_z, Lanes q2)
    {
        const Lanes next = two_z * p - (at(t.beta + lane) * q2) * before;
        before = p;
        p = next;
        add(t, lane);
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
        terms_.resize(begin + at(degree - first + 1), Terms{});
        for (int m = first; m < std::min(first + order_block, degree + 1); m++) {
            if (m > 0) {
                sectoral *= std::sqrt(m == 1 ? 3.0 : (2.0 * m + 1.0) / (2.0 * m));
            }
            scale[at(m)] = sectoral;
            for (int n = m; n <= degree; n++) {
                Terms &t = terms_[begin + at(n - m)];
                const int lane = m - first;
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

void Harmonics::combine(const Harmonics &a, double factor, const Harmonics &b)
{
    for (std::size_t i = 0; i < terms_.size(); i++) {
        for (const auto part : {&Terms::C, &Terms::S, &Terms::dC, &Terms::dS}) {
            for (int lane = 0; lane < order_block; lane++) {
                (terms_[i].*part)[lane] = (a.terms_[i].*part)[lane] + factor * (b.terms_[i].*part)[lane];
            }
        }
    }
}

/// Each in two parts, of the even and the odd orders.
struct Harmonics::Sums {
    Pair value, radial, u, v, w;
};

template <typename Lanes> LANES_INLINE void Harmonics::add_up(double x, double y, double z, double q, Sums &sums) const
{
    constexpr bool wide = sizeof(Lanes) == 4 * sizeof(double);
    const double w_re = q * x, w_im = q * y; // w = q (x + i y)
    const double w2_re = w_re * w_re - w_im * w_im;
    const double w2_im = 2.0 * w_re * w_im;
    const Pair w2_rho = {w2_re, w2_re}, w2_sigma = {w2_im, w2_im};
    const Lanes two_z = Lanes{} + 2.0 * z * q, q2 = Lanes{} + q * q;

    Pair rho = {large, large * w_re}, sigma = {0.0, large * w_im}; // of the orders m and m + 1
    Pair rho_last = {0.0, 0.0}, sigma_last = {0.0, 0.0};           // of the two before
    Pair value = {}, radial = {}, u = {}, v = {}, w = {};
    Lanes order = {0.0, 1.0};
    if constexpr (wide) {
        order = Lanes{0.0, 1.0, 2.0, 3.0};
    }
    const auto add = [](Pair & sum, Lanes a) __attribute__((always_inline))
    {
        if constexpr (wide) {
            sum += __builtin_shufflevector(a, a, 0, 1);
            sum += __builtin_shufflevector(a, a, 2, 3);
        } else {
            sum += a;
        }
    };
    const auto next_orders = [&]() __attribute__((always_inline))
    {
        rho_last = rho;
        sigma_last = sigma;
        rho = rho_last * w2_rho - sigma_last * w2_sigma;
        sigma = rho_last * w2_sigma + sigma_last * w2_rho;
    };
    const auto take = [&](const Columns<Lanes> &c, int last) __attribute__((always_inline))
    {
        // Those of the columns' orders, and of the orders before.
        Lanes re, im, re_before, im_before;
        if constexpr (wide) {
            re_before = Quad{rho_last[1], rho[0], rho[1], 0.0};
            im_before = Quad{sigma_last[1], sigma[0], sigma[1], 0.0};
            next_orders();
            re_before[3] = rho[0];
            im_before[3] = sigma[0];
            re = __builtin_shufflevector(rho_last, rho, 0, 1, 2, 3);
            im = __builtin_shufflevector(sigma_last, sigma, 0, 1, 2, 3);
        } else {
            re_before = __builtin_shufflevector(rho_last, rho, 1, 2);
            im_before = __builtin_shufflevector(sigma_last, sigma, 1, 2);
            re = rho;
            im = sigma;
        }
        const Lanes weight = (Lanes{} + double(last)) + order + order + 1.0;
        add(value, c.C * re + c.S * im);
        add(radial, (weight * c.C - c.CC) * re + (weight * c.S - c.SS) * im);
        add(u, order * (c.C * re_before + c.S * im_before));
        add(v, order * (c.S * re_before - c.C * im_before));
        add(w, c.dC * re_before + c.dS * im_before);
        order += wide ? 4.0 : 2.0;
        next_orders();
    };

    const Terms *t = terms_.data();
    for (int last = degree_; last >= 0;) { // the highest n - m of the block
        Columns<Lanes> first, second;
        const int shorter = wide ? last - order_block : last, lane = wide ? 0 : 2;
        const Terms *const other = wide ? t + last + 1 : t;
        first.add(t[0], 0);
        if (shorter >= 0) {
            second.add(other[0], lane);
        }
        int k = 1;
        for (; k <= shorter; k++) {
            first.step(t[k], 0, two_z, q2);
            second.step(other[k], lane, two_z, q2);
        }
        for (; k <= last; k++) {
            first.step(t[k], 0, two_z, q2);
        }
        take(first, last);
        if (shorter >= 0) {
            take(second, shorter);
        }
        t = wide ? other + shorter + 1 : t + last + 1;
        last = shorter - order_block;
    }
    sums = {value, radial, u, v, w};
}

Vector3d Harmonics::gravity(const Vector3d &r_P, double *potential) const
{
    const double r2 = r_P.squaredNorm(), r = std::sqrt(r2), q = radius_ / r;
    const double x = r_P[0] / r, y = r_P[1] / r, z = r_P[2] / r;
    Sums sums;
    if (sim::wide > 0) {
        sim::in_registers<&Harmonics::add_up<Quad>>(*this, x, y, z, q, sums);
    } else {
        add_up<Pair>(x, y, z, q, sums);
    }
    const auto &[value, radial, u, v, w] = sums;
    const double along = q * (w[0] + w[1]);
    const double outward = point_ + ((radial[0] + radial[1]) + z * along);
    const double scale = mu_ / r2;
    if (potential) {
        *potential = mu_ / r * (point_ + (value[0] + value[1]));
    }
    return {scale * (q * (u[0] + u[1]) - outward * x), scale * (q * (v[0] + v[1]) - outward * y),
            scale * (along - outward * z)};
}

std::shared_ptr<Harmonics> read_harmonics(const HarmonicsSetup &setup)
{
    const auto epoch = setup.date ? std::optional(TimeSystem().epoch(*setup.date)) : std::nullopt;
    const int all = std::numeric_limits<int>::max();
    const HarmonicField field = read_gravity_field(setup.path, epoch, setup.mu, setup.degree.value_or(all));
    auto made = std::make_shared<Harmonics>(field, setup.degree.value_or(field.degree));
    if (!setup.tides.empty()) {
        made->tides.emplace(field.mu, field.radius, setup.tides == "file" ? field.tide_system : setup.tides);
    }
    made->setup = setup;
    return made;
}

} // namespace fledge::world
