// SPDX-License-Identifier: Apache-2.0
// With q = R / r and the identity (n + 1) P_n + s P'_n = P'_{n+1}, the gradient of U is
//
//   a = mu / r^2 ((-1 + sum_n J_n q^n P'_{n+1}(s)) r / |r|  -  (sum_n J_n q^n P'_n(s)) pole),
//
// and the derivatives follow from P'_1 = 1, P'_2 = 3 s and
//
//   n P'_{n+1} = (2 n + 1) s P'_n - (n + 1) P'_{n-1}.
#include "world/environment/gravity.h"

#include "sim/error.h"
#include "sim/text.h"
#include "world/environment/harmonics.h"

#include <algorithm>
#include <cmath>

namespace fledge::world {

bool GravityBody::has_zonals() const
{
    return std::any_of(J.begin(), J.end(), [](double j) { return j != 0.0; });
}

Eigen::Vector3d gravity(const GravityBody &body, const Eigen::Vector3d &r_N, const Eigen::Vector3d &pole_N)
{
    const double r2 = r_N.squaredNorm();
    const double r = std::sqrt(r2);
    const double s = r_N.dot(pole_N) / r;
    const double q = body.radius / r;
    double radial = -1.0, polar = 0.0;
    double before = 1.0, slope = 3.0 * s; // P'_{n-1} and P'_n
    double power = q * q;
    for (std::size_t k = 0; k < body.J.size(); k++) {
        const double n = static_cast<double>(k + 2);
        const double after = ((2.0 * n + 1.0) * s * slope - (n + 1.0) * before) / n;
        radial += body.J[k] * power * after;
        polar += body.J[k] * power * slope;
        before = slope;
        slope = after;
        power *= q;
    }
    return (body.mu / r2) * ((radial / r) * r_N - polar * pole_N);
}

double gravity_potential(const GravityBody &body, const Eigen::Vector3d &r_N)
{
    const double r = r_N.norm();
    const double s = r_N.dot(body.pole_N) / r, s2 = s * s;
    const double legendre[5] = {
        (3.0 * s2 - 1.0) / 2.0,
        (5.0 * s2 - 3.0) * s / 2.0,
        ((35.0 * s2 - 30.0) * s2 + 3.0) / 8.0,
        ((63.0 * s2 - 70.0) * s2 + 15.0) * s / 8.0,
        (((231.0 * s2 - 315.0) * s2 + 105.0) * s2 - 5.0) / 16.0,
    };
    double sum = 1.0;
    for (std::size_t k = 0; k < body.J.size(); k++) {
        sum -= body.J[k] * std::pow(body.radius / r, static_cast<int>(k) + 2) * legendre[k];
    }
    return body.mu / r * sum;
}

GravityBody checked(GravityBody body)
{
    if (body.checked) {
        return body;
    }
    const auto refuse = [&](const std::string &rule, double found) {
        throw sim::SetupError("gravity body " + (body.name.empty() ? "(no name)" : body.name) + ": " + rule +
                              "; found " + sim::format_number(found));
    };
    if (body.field) {
        if (body.has_zonals()) {
            refuse("zonal harmonics and a field exclude one another; J2", body.J[0]);
        }
        body.mu = body.field->mu();
        body.radius = body.field->radius();
    }
    if (!(body.mu > 0.0 && std::isfinite(body.mu))) {
        refuse("mu must be > 0", body.mu);
    }
    if (!(body.radius >= 0.0 && std::isfinite(body.radius))) {
        refuse("radius must be >= 0", body.radius);
    }
    body.surface = body.surface.value_or(body.radius);
    if (!(*body.surface >= 0.0 && std::isfinite(*body.surface))) {
        refuse("surface must be >= 0", *body.surface);
    }
    for (std::size_t k = 0; k < body.J.size(); k++) {
        if (!std::isfinite(body.J[k])) {
            refuse("J" + std::to_string(k + 2) + " must be finite", body.J[k]);
        }
    }
    if (body.has_zonals() && body.radius == 0.0) {
        refuse("zonal harmonics need a radius", body.radius);
    }
    const double length = body.pole_N.norm();
    if (!(length > 0.0 && std::isfinite(length))) {
        refuse("the pole must have a direction, so a length > 0", length);
    }
    for (int i = 0; i < 3; i++) {
        if (!std::isfinite(body.r_PN_N[i]) || !std::isfinite(body.v_PN_N[i])) {
            refuse("position and velocity must be finite",
                   std::isfinite(body.r_PN_N[i]) ? body.v_PN_N[i] : body.r_PN_N[i]);
        }
    }
    body.pole_N /= length;
    body.checked = true;
    return body;
}

} // namespace fledge::world
