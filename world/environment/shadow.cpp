// SPDX-License-Identifier: Apache-2.0
#include "world/environment/shadow.h"

#include "flight/math/elementary.h"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace fledge::world {

using Eigen::Vector2d;
using Eigen::Vector3d;

namespace {

/// Components of r across the line to the Sun.
Vector2d across(const Vector3d &r, const Vector3d &r_SB)
{
    const Vector3d x = r_SB.unitOrthogonal(), y = r_SB.cross(x).normalized();
    return {r.dot(x), r.dot(y)};
}

/// The angle about disc k, at most pi, at which its edge next crosses another one.
double next_crossing(std::span<const Disc> discs, std::size_t k, double from)
{
    const double r = discs[k].radius;
    constexpr double turn = 2.0 * std::numbers::pi;
    double next = std::numbers::pi;
    for (const Disc &other : discs) {
        const Vector2d way = other.centre - discs[k].centre;
        const double apart = way.norm();
        const double cosine = (apart * apart + r * r - other.radius * other.radius) / (2.0 * apart * r);
        if (std::abs(cosine) < 1.0) { // not with itself
            for (const double side : {-1.0, 1.0}) {
                const double angle = fm_atan2(way[1], way[0]) + side * fm_acos(cosine);
                const double near_0 = angle - turn * std::round(angle / turn);
                next = near_0 > from ? std::min(next, near_0) : next;
            }
        }
    }
    return next;
}

} // namespace

double hidden_share(const Vector3d &r_SB, double sun_radius, const Vector3d &r_PB, double body_radius, Disc *disc)
{
    const double to_sun = r_SB.norm(), to_body = r_PB.norm();
    if (!(to_body > body_radius)) {
        return 1.0;
    }
    if (!(to_sun > sun_radius) || to_body >= to_sun) {
        return 0.0;
    }
    const double apart = fm_atan2(r_SB.cross(r_PB).norm(), r_SB.dot(r_PB));
    const double sun = fm_asin(sun_radius / to_sun), body = fm_asin(body_radius / to_body);
    if (apart >= sun + body) {
        return 0.0;
    }
    if (disc) {
        *disc = {apart / sun * across(r_PB, r_SB).normalized(), body / sun};
    }
    if (apart <= std::abs(sun - body)) {
        return sun <= body ? 1.0 : (body / sun) * (body / sun);
    }
    // Two segments, cut off by the line through the points where the circles meet.
    const double x = (apart * apart + sun * sun - body * body) / (2.0 * apart);
    const double y = std::sqrt(std::max(sun * sun - x * x, 0.0));
    const double area = sun * sun * fm_atan2(y, x) + body * body * fm_atan2(y, apart - x) - apart * y;
    return std::clamp(area / (std::numbers::pi * sun * sun), 0.0, 1.0);
}

double hidden_share(const Vector3d &r_SB, double sun_radius, const Vector3d &r_PB, double equatorial, double polar,
                    const Vector3d &pole, Disc *disc)
{
    const auto stretched = [&](const Vector3d &r) -> Vector3d {
        return r + (equatorial / polar - 1.0) * pole.dot(r) * pole;
    };
    const Vector3d sun = stretched(r_SB), body = stretched(r_PB);
    const Vector3d way = body - body.dot(sun) / sun.squaredNorm() * sun; // from the Sun's centre to the body's
    const double length = way.norm(), reach = length > 0.0 ? stretched(way).norm() / length : 1.0;
    const double hidden = hidden_share(sun, reach * sun_radius, body, equatorial, disc);
    if (disc && hidden > 0.0 && hidden < 1.0) { // the edge that is next to the Sun lies across this direction
        disc->centre = disc->centre.norm() * across(stretched(way), r_SB).normalized();
    }
    return hidden;
}

double hidden_together(std::span<const Disc> discs)
{
    double visible = 0.0; // twice the area; its edges are arcs of the Sun outside all bodies, and of bodies inside it
    for (std::size_t k = 0; k < discs.size(); k++) {
        const auto &[centre, r] = discs[k];
        for (double from = -std::numbers::pi, to = 0.0; from < std::numbers::pi; from = to) {
            to = next_crossing(discs, k, from);
            double s, c, s1, c1, s2, c2;
            fm_sincos(0.5 * (from + to), &s, &c);
            const Vector2d middle = centre + r * Vector2d(c, s);
            bool is_edge = true;
            for (std::size_t i = 0; i < discs.size(); i++) {
                const bool inside = (middle - discs[i].centre).norm() < discs[i].radius;
                is_edge = is_edge && (i == k || inside == (i == 0));
            }
            fm_sincos(from, &s1, &c1);
            fm_sincos(to, &s2, &c2);
            const double area = r * (r * (to - from) + centre[0] * (s2 - s1) - centre[1] * (c2 - c1));
            visible += !is_edge ? 0.0 : k == 0 ? area : -area;
        }
    }
    return std::clamp(1.0 - visible / (2.0 * std::numbers::pi), 0.0, 1.0);
}

} // namespace fledge::world
