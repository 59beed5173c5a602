// SPDX-License-Identifier: Apache-2.0
// Source: Vallado, Fundamentals of Astrodynamics and Applications, chapter 2; the anomalies from
// arctangents of both components, which lose no accuracy at any angle.
#include "world/dynamics/orbit.h"

#include "flight/math/elementary.h"
#include "sim/error.h"
#include "sim/text.h"

#include <Eigen/Geometry>

#include <cmath>
#include <numbers>

namespace fledge::world {

namespace {

using sim::format_number;

using std::numbers::pi;
constexpr double degenerate = 1e-12; // what counts as circular, equatorial or straight
constexpr double parabolic = 2e-15;  // by how much roundings may move e from 1

void check(bool holds, const char *rule, double found)
{
    if (!holds) {
        throw sim::SetupError("orbit: " + std::string(rule) + "; found " + format_number(found));
    }
}

void check_mu(double mu)
{
    check(mu > 0.0 && std::isfinite(mu), "mu must be > 0", mu);
}

/// An angle in [-2 pi, 2 pi] as one in [0, 2 pi).
double positive(double angle)
{
    if (angle < 0.0) {
        angle += 2.0 * pi;
    }
    return angle < 2.0 * pi ? angle : angle - 2.0 * pi;
}

} // namespace

double OrbitElements::semi_major_axis() const
{
    return p / ((1.0 - e) * (1.0 + e));
}

double semi_latus_rectum(double a, double e)
{
    check(std::isfinite(a) && a != 0.0, "the semi-major axis must be finite and not 0", a);
    check(e >= 0.0 && std::isfinite(e), "the eccentricity must be >= 0", e);
    check(e != 1.0, "a parabola has no semi-major axis: give its semi-latus rectum", e);
    check((a > 0.0) == (e < 1.0),
          e < 1.0 ? "an ellipse (e < 1) needs a semi-major axis > 0"
                  : "a hyperbola (e > 1) needs a semi-major axis < 0",
          a);
    return a * ((1.0 - e) * (1.0 + e));
}

OrbitState orbit_state(double mu, const OrbitElements &elements)
{
    const auto &[p, e, i, Omega, omega, f] = elements;
    check_mu(mu);
    check(p > 0.0 && std::isfinite(p), "the semi-latus rectum must be > 0", p);
    check(e >= 0.0 && std::isfinite(e), "the eccentricity must be >= 0", e);
    check(std::isfinite(i), "the inclination must be finite", i);
    check(std::isfinite(Omega), "the node must be finite", Omega);
    check(std::isfinite(omega), "the argument of periapsis must be finite", omega);
    check(std::isfinite(f), "the true anomaly must be finite", f);

    double sin_i, cos_i, sin_node, cos_node, sin_peri, cos_peri, sin_f, cos_f;
    fm_sincos(i, &sin_i, &cos_i);
    fm_sincos(Omega, &sin_node, &cos_node);
    fm_sincos(omega, &sin_peri, &cos_peri);
    fm_sincos(f, &sin_f, &cos_f);
    double over_r = 1.0 + e * cos_f, ahead_v = e + cos_f; // p / r, and the speed ahead of periapsis by sqrt(mu / p)
    if (fm_abs(1.0 - e) < 0.01 && cos_f < 0.0) {
        // Far out near a parabola both sums would cancel.
        const double half = fm_cos(0.5 * f), left = 2.0 * half * half; // 1 + cos f
        over_r = (1.0 - e) + e * left;
        ahead_v = left - (1.0 - e);
    }
    if (!(over_r > 0.0 && 1.0 + e * cos_f > 0.0)) {
        throw sim::SetupError("orbit: with an eccentricity of " + format_number(e) +
                              " the true anomaly must be between the asymptotes, +-" +
                              format_number(fm_acos(-1.0 / e)) + " rad; found " + format_number(f));
    }
    // The node's direction, and the one 90 deg ahead in the orbit's plane; then periapsis and the
    // direction of flight there.
    const Eigen::Vector3d node(cos_node, sin_node, 0.0);
    const Eigen::Vector3d ahead(-sin_node * cos_i, cos_node * cos_i, sin_i);
    const Eigen::Vector3d peri = cos_peri * node + sin_peri * ahead;
    const Eigen::Vector3d flight = cos_peri * ahead - sin_peri * node;

    const double r = p / over_r;
    const double speed = std::sqrt(mu / p);
    return {r * (cos_f * peri + sin_f * flight), speed * (ahead_v * flight - sin_f * peri)};
}

OrbitElements orbit_elements(double mu, const OrbitState &state)
{
    check_mu(mu);
    const double r = state.r.norm(), v = state.v.norm();
    check(r > 0.0 && std::isfinite(r), "the position must be finite and not 0", r);
    check(std::isfinite(v), "the velocity must be finite", v);
    const Eigen::Vector3d momentum = state.r.cross(state.v);
    const double h = momentum.norm();
    if (!(h > degenerate * r * v)) {
        throw sim::SetupError("orbit: position and velocity lie along one line; a rectilinear "
                              "orbit has no classical elements");
    }
    const Eigen::Vector3d normal = momentum / h;

    OrbitElements elements;
    elements.p = h * (h / mu);
    elements.e = (state.v.cross(momentum) / mu - state.r / r).norm();
    if (std::abs(elements.e - 1.0) < parabolic) {
        elements.e = 1.0;
    }

    Eigen::Vector3d node(-normal[1], normal[0], 0.0);
    const double sin_i = node.norm();
    if (sin_i < degenerate) {
        node = Eigen::Vector3d::UnitX();
        elements.i = normal[2] > 0.0 ? 0.0 : pi;
    } else {
        node /= sin_i;
        elements.i = fm_atan2(sin_i, normal[2]);
        elements.Omega = positive(fm_atan2(node[1], node[0]));
    }
    // From the node to the spacecraft, in the orbit's plane.
    const double latitude = fm_atan2(state.r.dot(normal.cross(node)), state.r.dot(node));
    if (elements.e < degenerate) {
        elements.e = 0.0;
        elements.f = positive(latitude);
        return elements;
    }
    // e cos f = p / r - 1 and e sin f = sqrt(p / mu) r.v / r
    const double f = fm_atan2(std::sqrt(elements.p / mu) * state.r.dot(state.v), elements.p - r);
    elements.omega = positive(latitude - f);
    elements.f = elements.e < 1.0 ? positive(f) : f;
    return elements;
}

} // namespace fledge::world
