// SPDX-License-Identifier: Apache-2.0
#include "world/environment/shadow.h"

#include "flight/math/elementary.h"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace fledge::world {

using Eigen::Vector3d;

double hidden_share(const Vector3d &r_SB, double sun_radius, const Vector3d &r_PB, double body_radius)
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
                    const Vector3d &pole)
{
    const auto stretched = [&](const Vector3d &r) -> Vector3d {
        return r + (equatorial / polar - 1.0) * pole.dot(r) * pole;
    };
    const Vector3d sun = stretched(r_SB), body = stretched(r_PB);
    const Vector3d across = body - body.dot(sun) / sun.squaredNorm() * sun; // from the Sun's centre to the body's
    const double length = across.norm(), reach = length > 0.0 ? stretched(across).norm() / length : 1.0;
    return hidden_share(sun, reach * sun_radius, body, equatorial);
}

} // namespace fledge::world
