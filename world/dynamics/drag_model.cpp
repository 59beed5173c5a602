// SPDX-License-Identifier: Apache-2.0
#include "world/dynamics/drag_model.h"

#include "sim/text.h"
#include "world/constants.h"
#include "world/eigen.h"
#include "world/error_function.h"

#include <numbers>

namespace fledge::world {

namespace {

constexpr double root_pi = 1.0 / std::numbers::inv_sqrtpi;

/// Molecules that never meet.
struct FreeFlow {
    double density; ///< [kg/m^3]
    double c;       ///< [m/s] their most probable speed
    double w;       ///< [m/s] recoil per mass that leaves

    /// [Pa] on a facet with this unit normal that moves with v [m/s].
    Vec3 pressure(const Vec3 &v, const Vec3 &normal) const
    {
        const double s = vec_dot(v, normal) / c, by = complementary_error(fm_abs(s)), all = s > 0.0 ? 2.0 - by : by;
        const double flux = 0.5 * density * c * (fm_exp(-s * s) / root_pi + s * all);
        return vec_neg(vec_add(vec_scale(flux, v), vec_scale(0.25 * density * c * c * all + flux * w, normal)));
    }

    /// [Pa] on the cross section of a sphere: the sum of the pressures on its surface.
    Vec3 on_sphere(const Vec3 &v) const
    {
        const double s = vec_norm(v) / c, s2 = s * s;
        double coming = 16.0 / (3.0 * root_pi) * (1.0 + 0.2 * s2); // the drag coefficient times s, for small s
        if (s > 0.01) {
            coming = (2.0 * s2 + 1.0) / (root_pi * s2) * fm_exp(-s2) +
                     (4.0 * s2 * s2 + 4.0 * s2 - 1.0) / (2.0 * s2 * s) * (1.0 - complementary_error(s));
        }
        return vec_scale(-0.5 * density * (c * coming + 4.0 / 3.0 * w), v);
    }
};

} // namespace

void DragModel::check() const
{
    const auto &given = interface_.par;
    const double Cd = given.Cd, T_wall = given.T_wall, accommodation = given.accommodation;
    const bool free = T_wall > 0.0 && accommodation > 0.0, none = T_wall == 0.0 && accommodation == 0.0;
    if (Cd > 0.0 ? !none : !free) {
        throw sim::SetupError(name_ + ".Cd is " + sim::format_number(Cd) + ", T_wall " + sim::format_number(T_wall) +
                              " K and accommodation " + sim::format_number(accommodation) +
                              ": give either Cd, or both T_wall and accommodation");
    }
    if (given.n == 0 && given.area == 0.0) {
        throw sim::SetupError(name_ + ".area is 0 m^2, and there are no facets: nothing feels the air");
    }
}

void DragModel::start(const Vec3 &omega, double *x)
{
    Surface::start(omega, x);
    if (interface_.par.T_wall > 0.0 && !source_->has_temperature()) {
        throw sim::SetupError(name_ + ".T_wall needs the temperature of the air, which " + source_->name() +
                              " does not have: take another law, such as \"STANDARD_1976\", or give Cd in its place");
    }
}

void DragModel::push_freely(const AirSource::State &air, const Vec3 &v_B, const Motion &motion, Loads &loads) const
{
    const auto &par = interface_.par;
    FreeFlow flow{air.density, 1.0, 0.0};
    if (air.density > 0.0) {
        if (!(air.temperature > 0.0 && air.molar_mass > 0.0)) {
            throw sim::RunError(
                name_ + ".T_wall needs the temperature and the molar mass of the air: " + source_->name() + " gives " +
                sim::format_number(air.temperature) + " K and " + sim::format_number(air.molar_mass) + " kg/mol");
        }
        const double R = gas_constant / air.molar_mass, brought = 0.25 * vec_norm2(v_B) + R * air.temperature;
        const double leaves = brought + par.accommodation * (R * par.T_wall - brought);
        flow.c = fm_sqrt(2.0 * R * air.temperature);
        flow.w = fm_sqrt(0.5 * std::numbers::pi * leaves);
    }
    const auto on_facet = [&](std::size_t i, const Vec3 &normal_B, double) {
        return vec_scale(par.areas[i], flow.pressure(v_B, normal_B));
    };
    push(vec_scale(par.area, flow.on_sphere(v_B)), vec_unit(v_B), motion, loads, on_facet, true);
}

void DragModel::derive(const double *, const Motion &motion, double *, Loads &loads) const
{
    const auto &par = interface_.par;
    const AirSource::State air = source_->at(motion.start, motion.tau, view(motion.r_BN_N));
    const Vec3 v_B = mat_vec(motion.C_BN, vec_sub(motion.v_BN_N, vec(air.velocity_N)));
    if (par.T_wall > 0.0) {
        return push_freely(air, v_B, motion, loads);
    }
    const Vec3 pressure_B = vec_scale(-0.5 * air.density * par.Cd * vec_norm(v_B), v_B);
    push(vec_scale(par.area, pressure_B), vec_unit(v_B), motion, loads,
         [&](std::size_t i, const Vec3 &, double cosine) { return vec_scale(par.areas[i] * cosine, pressure_B); });
}

} // namespace fledge::world
