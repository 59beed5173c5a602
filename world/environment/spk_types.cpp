// SPDX-License-Identifier: Apache-2.0
#include "world/environment/spk_types.h"

#include "flight/math/elementary.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace fledge::world {

using Eigen::Vector3d;

namespace {

constexpr double half_turn = 3.14159265358979323846;

Vector3d triple_at(const double *words)
{
    return {words[0], words[1], words[2]};
}

double epoch_of(const EphemerisSegment &s, std::size_t i)
{
    return s.epochs ? s.epochs[i] : s.start + static_cast<double>(i) * s.length;
}

/// The last record that is not after an instant, else the first.
std::size_t record_before(const EphemerisSegment &s, const Instant &t)
{
    if (s.epochs) {
        const auto *after = std::upper_bound(s.epochs, s.epochs + s.count, t.total());
        return after == s.epochs ? 0 : static_cast<std::size_t>(after - s.epochs) - 1;
    }
    return static_cast<std::size_t>(
        std::clamp(std::floor(t.since(s.start) / s.length), 0.0, static_cast<double>(s.count - 1)));
}

/// The records through which a polynomial goes: from the nearest outwards, which keeps its differences small.
struct Nodes {
    int count = 0;
    double x[EphemerisSegment::most_nodes]; ///< [s] past the instant
    const double *record[EphemerisSegment::most_nodes];

    Nodes(const EphemerisSegment &s, const Instant &t, int times)
    {
        const std::size_t low = record_before(s, t), half = s.window / 2;
        std::size_t begin, end;
        if (s.cut_at_ends) {
            begin = low + 1 > half ? low + 1 - half : 0;
            end = std::min(low + 1 + half, s.count);
        } else {
            const bool next =
                s.window % 2 == 1 && low + 1 < s.count && -t.since(epoch_of(s, low + 1)) <= t.since(epoch_of(s, low));
            const std::size_t left = s.window % 2 == 0 ? half - 1 : half;
            begin = low + (next ? 1 : 0);
            begin = std::min(begin > left ? begin - left : 0, s.count - s.window);
            end = begin + s.window;
        }
        std::size_t left = std::min(low + 1, end), right = left;
        while (left > begin || right < end) {
            const bool is_left = right == end || (left > begin && t.since(epoch_of(s, left - 1)) <=
                                                                      std::fabs(t.since(epoch_of(s, right))));
            const std::size_t i = is_left ? --left : right++;
            for (int k = 0; k < times; k++) {
                x[count] = -t.since(epoch_of(s, i));
                record[count++] = s.records + i * s.record_words;
            }
        }
    }
};

/// Newton's polynomial through the words `at` of the nodes, which has the words `rates` as its rates where
/// a node stands twice: at the instant its value and first two derivatives.
void newton(const Nodes &nodes, int at, int rates, Vector3d *out)
{
    Vector3d d[EphemerisSegment::most_nodes];
    const int n = nodes.count;
    for (int i = 0; i < n; i++) {
        d[i] = triple_at(nodes.record[i] + at);
    }
    for (int order = 1; order < n; order++) {
        for (int i = n - 1; i >= order; i--) {
            const bool twice = nodes.record[i] == nodes.record[i - order];
            d[i] = twice ? triple_at(nodes.record[i] + rates)
                         : Vector3d((d[i] - d[i - 1]) / (nodes.x[i] - nodes.x[i - order]));
        }
    }
    out[0] = out[1] = out[2] = Vector3d(0, 0, 0);
    for (int i = n - 1; i >= 0; i--) {
        out[2] = 2.0 * out[1] - nodes.x[i] * out[2];
        out[1] = out[0] - nodes.x[i] * out[1];
        out[0] = d[i] - nodes.x[i] * out[0];
    }
}

BodyState by_polynomials(const EphemerisSegment &s, const Instant &t)
{
    const Nodes nodes(s, t, s.method == EphemerisSegment::Method::lagrange ? 1 : 2);
    Vector3d r[3], v[3];
    newton(nodes, 0, 3, r);
    if (s.method == EphemerisSegment::Method::hermite) {
        return {r[0], r[1], r[2]};
    }
    const bool own_rates = s.method == EphemerisSegment::Method::hermite_of_both;
    newton(nodes, own_rates ? 6 : 3, 9, v);
    return {r[0], v[0], v[1]};
}

/// The acceleration is sum_j D_j c_j with c_1 = 1, c_{j+1}(x) = c_j(x) (x + g_{j-1}) / g_j, g_0 = 0, x the
/// time past the record's own. w[k] is (k - 1)! / x^k times the k-fold integral of c_j from 0 to x.
BodyState by_differences(const EphemerisSegment &s, const Instant &t)
{
    const auto *found = std::lower_bound(s.epochs, s.epochs + s.count, t.total());
    const auto i = std::min(static_cast<std::size_t>(found - s.epochs), s.count - 1);
    const double *record = s.records + i * s.record_words;
    const int n = s.coefficients;
    const double *g = record + 1, *reference = g + n, *table = reference + 6, *orders = table + 3 * n + 1;
    const double x = t.since(record[0]);
    const int highest = static_cast<int>(std::max({orders[0], orders[1], orders[2]}));
    double w[EphemerisSegment::most_nodes + 2];
    for (int k = 1; k <= highest + 1; k++) {
        w[k] = 1.0 / k;
    }
    Vector3d a(0, 0, 0), once(0, 0, 0), twice(0, 0, 0);
    double c = 1.0;
    for (int j = 0; j < highest; j++) {
        for (int axis = 0; axis < 3; axis++) {
            const double d = j < orders[axis] ? table[axis * n + j] : 0.0;
            a[axis] += d * c;
            once[axis] += d * w[1];
            twice[axis] += d * w[2];
        }
        const double share = (j > 0 ? x + g[j - 1] : x) / g[j], part = x / g[j];
        c *= share;
        for (int k = 1; k <= highest - j; k++) {
            w[k] = share * w[k] - part * w[k + 1];
        }
    }
    const Vector3d r0(reference[0], reference[2], reference[4]), v0(reference[1], reference[3], reference[5]);
    return {r0 + x * (v0 + x * twice), v0 + x * once, a};
}

BodyState by_conics(const EphemerisSegment &s, const Instant &t)
{
    const auto from = [&](std::size_t i) {
        const double *record = s.records + i * 6;
        return along_conic(triple_at(record), triple_at(record + 3), s.mu, t.since(s.epochs[i]));
    };
    const std::size_t i = record_before(s, t);
    BodyState left = from(i);
    if (i + 1 == s.count || t.total() < s.epochs[0]) {
        return left;
    }
    const BodyState right = from(i + 1);
    const double rate = half_turn / (s.epochs[i + 1] - s.epochs[i]);
    double sine, cosine;
    fm_sincos(rate * t.since(s.epochs[i]), &sine, &cosine);
    const double w = 0.5 + 0.5 * cosine, w1 = -0.5 * rate * sine, w2 = -0.5 * rate * rate * cosine;
    const Vector3d dr = left.r - right.r, dv = left.v - right.v, da = left.a - right.a;
    return {right.r + w * dr, right.v + w * dv + w1 * dr, right.a + w * da + 2.0 * w1 * dv + w2 * dr};
}

/// Stumpff's functions c2 = (1 - cos sqrt(z)) / z and c3 = (sqrt(z) - sin sqrt(z)) / sqrt(z)^3.
void stumpff(double z, double &c2, double &c3)
{
    if (std::fabs(z) < 1.0) {
        c2 = c3 = 0.0;
        for (int k = 10; k >= 0; k--) {
            c2 = (1.0 - z * c2) / ((2 * k + 1) * (2 * k + 2));
            c3 = (1.0 - z * c3) / ((2 * k + 2) * (2 * k + 3));
        }
        return;
    }
    const double root = std::sqrt(std::fabs(z));
    if (z > 0.0) {
        c2 = (1.0 - fm_cos(root)) / z;
        c3 = (root - fm_sin(root)) / (z * root);
    } else {
        const double e = fm_exp(root);
        c2 = (1.0 - 0.5 * (e + 1.0 / e)) / z;
        c3 = (root - 0.5 * (e - 1.0 / e)) / (z * root);
    }
}

} // namespace

BodyState along_conic(const Vector3d &r, const Vector3d &v, double mu, double dt)
{
    const double root = std::sqrt(mu), distance = r.norm(), sigma = r.dot(v) / root;
    const double alpha = 2.0 / distance - v.squaredNorm() / mu;
    const double aim = root * dt, sign = dt < 0.0 ? -1.0 : 1.0;
    double c2 = 0.5, c3 = 1.0 / 6.0;
    // Kepler's equation in the universal variable grows with it, so that a bracket keeps Newton's steps.
    const auto time = [&](double chi) {
        stumpff(alpha * chi * chi, c2, c3);
        const double t = chi * (distance * (1.0 - alpha * chi * chi * c3) + chi * (sigma * c2 + chi * c3));
        return std::isfinite(t) ? t : sign * std::numeric_limits<double>::infinity(); // far out on a hyperbola
    };
    double low = 0.0, high = sign * std::max(std::fabs(aim) / distance, 1e-300);
    while (sign * time(high) < sign * aim) {
        low = high;
        high *= 2.0;
    }
    double chi = std::isfinite(time(high)) ? high : low, before = 2.0 * high;
    for (int i = 0; i < 200 && std::fabs(chi - before) > 1e-16 * std::fabs(chi); i++) {
        const double error = time(chi) - aim;
        (sign * error < 0.0 ? low : high) = chi;
        const double z = alpha * chi * chi;
        const double now = chi * chi * c2 + sigma * chi * (1.0 - z * c3) + distance * (1.0 - z * c2);
        // Along an exponential, Newton's steps hardly shrink.
        const double step = std::fabs(error / now);
        const bool is_slow = step > 0.5 * std::fabs(chi - before) && step > 1e-6 * std::fabs(chi);
        before = chi;
        chi -= error / now;
        if (is_slow || !(sign * chi > sign * low && sign * chi < sign * high)) {
            chi = std::fabs(error) > 1e-15 * std::fabs(aim) ? 0.5 * (low + high) : before;
        }
    }
    time(chi);
    const double f = 1.0 - chi * chi * c2 / distance, g = dt - chi * chi * chi * c3 / root;
    BodyState state{f * r + g * v, v, r};
    const double now = state.r.norm();
    const double f1 = root / (now * distance) * chi * (alpha * chi * chi * c3 - 1.0), g1 = 1.0 - chi * chi * c2 / now;
    state.v = f1 * r + g1 * v;
    state.a = -mu / (now * now * now) * state.r;
    return state;
}

BodyState state_between(const EphemerisSegment &s, const Instant &t)
{
    return s.method == EphemerisSegment::Method::differences ? by_differences(s, t)
           : s.method == EphemerisSegment::Method::conics    ? by_conics(s, t)
                                                             : by_polynomials(s, t);
}

} // namespace fledge::world
