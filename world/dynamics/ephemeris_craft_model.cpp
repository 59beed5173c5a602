// SPDX-License-Identifier: Apache-2.0
#include "world/dynamics/ephemeris_craft_model.h"

#include "flight/math/attitude.h"
#include "sim/error.h"
#include "sim/text.h"
#include "world/eigen.h"
#include "world/environment/sky.h"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>

namespace fledge::world {

using Eigen::Vector3d;
using Eigen::Vector4d;
using sim::Ns;

namespace {

constexpr int knots_most = 32; // of the values that a polynomial goes through

/// A value and its first two derivatives by time.
template <class V> struct Jet {
    V value, rate, acceleration;
};

/// Newton's polynomial through n values y at times x [s], at 0. Equal times in a row stand for a value and its rate.
template <class V> Jet<V> newton(int n, const double *x, V *y, const V *rates)
{
    std::array<V, knots_most> coefficient;
    coefficient.fill(V::Zero());
    coefficient[0] = y[0];
    for (int order = 1; order < n; order++) {
        for (int i = 0; i + order < n; i++) {
            const double step = x[i + order] - x[i];
            y[i] = step == 0.0 ? rates[i] : V((y[i + 1] - y[i]) / step);
        }
        coefficient[order] = y[0];
    }
    Jet<V> jet{coefficient[n - 1], V::Zero(), V::Zero()};
    for (int order = n - 2; order >= 0; order--) {
        const double at = -x[order];
        jet.acceleration = jet.acceleration * at + 2.0 * jet.rate;
        jet.rate = jet.rate * at + jet.value;
        jet.value = jet.value * at + coefficient[order];
    }
    return jet;
}

/// By a polynomial of a degree through the knots about t.
template <class V>
Jet<V> interpolate(const std::vector<Ns> &times, const std::vector<V> &values, const std::vector<V> &rates, int degree,
                   Ns t)
{
    const int each = rates.empty() ? 1 : 2, knots = static_cast<int>(times.size());
    const int used = std::min({(degree + each) / each, knots, knots_most / each});
    const int after = static_cast<int>(std::upper_bound(times.begin(), times.end(), t) - times.begin());
    const int first = std::clamp(after - (used + 1) / 2, 0, knots - used);
    double x[knots_most];
    std::array<V, knots_most> y, slopes;
    y.fill(V::Zero());
    slopes.fill(V::Zero());
    for (int i = 0; i < used * each; i++) {
        const auto knot = static_cast<std::size_t>(first) + static_cast<std::size_t>(i / each);
        x[i] = static_cast<double>(times[knot] - t) * 1e-9;
        y[i] = values[knot];
        if (!rates.empty()) {
            slopes[i] = rates[knot];
        }
    }
    return newton(used * each, x, y.data(), slopes.data());
}

/// The attitude that turns about a fixed axis from one knot to the next.
Jet<Vector4d> turn(const CraftEphemeris::Attitude &segment, Ns t)
{
    const auto last = static_cast<std::ptrdiff_t>(segment.t.size()) - 2;
    if (last < 0) {
        return {segment.beta[0], Vector4d::Zero(), Vector4d::Zero()};
    }
    const std::ptrdiff_t after = std::upper_bound(segment.t.begin(), segment.t.end(), t) - segment.t.begin();
    const auto i = static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(after - 1, 0, last));
    const Vector4d &a = segment.beta[i], &b = segment.beta[i + 1];
    const double span = static_cast<double>(segment.t[i + 1] - segment.t[i]) * 1e-9;
    const double u = static_cast<double>(t - segment.t[i]) * 1e-9 / span;
    const Vector4d across = b - a.dot(b) * a; // of the length of the sine of half the turn
    const double sine = across.norm(), half = fm_atan2(sine, a.dot(b));
    if (sine == 0.0) {
        return {a, Vector4d::Zero(), Vector4d::Zero()};
    }
    double s, c;
    fm_sincos(u * half, &s, &c);
    const Vector4d side = across / sine;
    const double rate = half / span;
    const Vector4d value = c * a + s * side;
    return {value, rate * (c * side - s * a), -rate * rate * value};
}

/// 2 conj(beta) * d, of which the vector is the rate in B, for the derivative d of a unit quaternion.
Vector3d twice_conjugate_product(const Vector4d &beta, const Vector4d &d)
{
    const Vector3d b = beta.tail<3>(), v = d.tail<3>();
    return 2.0 * (beta[0] * v - d[0] * b - b.cross(v));
}

Vector3d mrp_of(const Vector4d &beta)
{
    const double sign = beta[0] < 0.0 ? -1.0 : 1.0;
    return sign * beta.tail<3>() / (1.0 + std::abs(beta[0]));
}

template <class Segment> const Segment &segment_of(const std::vector<Segment> &segments, Ns t)
{
    for (const Segment &segment : segments) {
        if (t <= segment.end) {
            return segment;
        }
    }
    return segments.back();
}

} // namespace

void EphemerisCraftModel::prepare(const sim::Setup &setup)
{
    name_ = setup.name;
    if (!sky_) {
        throw sim::SetupError(name_ + ".sky is missing: it says what the dates and frames of the files are, as in "
                                      "sky=world.Sky(\"2026-03-20\", center=world.EARTH)");
    }
    if (!ephemeris_) {
        throw sim::SetupError(name_ + ".orbit is missing: the file that it follows, as in orbit=\"craft.oem\"");
    }
}

void EphemerisCraftModel::ensure_data_until(Ns until)
{
    const auto check = [&](const auto &segments, const std::string &file) {
        Ns covered = 0;
        for (const auto &segment : segments) {
            if (segment.begin > covered || covered >= until) {
                break;
            }
            covered = std::max(covered, segment.end);
        }
        if (!segments.empty() && (segments.front().begin > 0 || covered < until)) {
            const auto date = [&](Ns t) { return sky_->time_system().text(sky_->epoch_at(t)); };
            const bool late = segments.front().begin > 0;
            throw sim::SetupError(name_ + ": " + file + " says nothing " +
                                  (late ? "before " + date(segments.front().begin) : "after " + date(covered)) +
                                  ", but the run is from " + date(0) + " to " + date(until));
        }
    };
    check(ephemeris_->orbits, ephemeris_->orbit_file);
    check(ephemeris_->attitudes, ephemeris_->attitude_file);
}

void EphemerisCraftModel::reset(Ns t)
{
    interface_.out = {};
    publish(t);
}

void EphemerisCraftModel::publish(Ns t)
{
    CraftState &state = interface_.out.state;
    state.head = head_next(state.head, t, QUALITY_GOOD);
    if (!ephemeris_->orbits.empty()) {
        const auto &orbit = segment_of(ephemeris_->orbits, t);
        const Jet<Vector3d> jet = interpolate(orbit.t, orbit.r, orbit.v, orbit.degree, t);
        state.r_BN_N = state.r_CN_N = vec(jet.value);
        state.v_BN_N = state.v_CN_N = vec(jet.rate);
        state.a_BN_N = state.g_CN_N = vec(jet.acceleration);
    }
    if (!ephemeris_->attitudes.empty()) {
        const auto &attitude = segment_of(ephemeris_->attitudes, t);
        Jet<Vector4d> jet;
        if (attitude.beta_rate.empty()) {
            jet = turn(attitude, t);
        } else {
            jet = interpolate(attitude.t, attitude.beta, attitude.beta_rate, 3, t);
        }
        // Of unit length: beta = q / |q|, and what its derivatives have along beta is not a turn.
        const double length = jet.value.norm();
        const Vector4d beta = jet.value / length;
        const double growth = beta.dot(jet.rate) / length;
        const Vector4d rate = jet.rate / length - growth * beta;
        const Vector4d acceleration = jet.acceleration / length - 2.0 * growth * rate;
        state.sigma_BN = vec(mrp_of(beta));
        state.omega_BN_B = vec(twice_conjugate_product(beta, rate));
        state.domega_BN_B = vec(twice_conjugate_product(beta, acceleration));
    }
}

void EphemerisCraftModel::copy_setup(const sim::Model &original,
                                     const std::function<sim::Model *(const sim::Model *)> &)
{
    const auto &other = dynamic_cast<const EphemerisCraftModel &>(original);
    sky_ = other.sky_;
    ephemeris_ = other.ephemeris_;
}

} // namespace fledge::world
