// SPDX-License-Identifier: Apache-2.0
#include "world/dynamics/reaction_wheels_model.h"

#include "sim/error.h"
#include "sim/text.h"

#include <algorithm>
#include <cmath>

namespace fledge::world {

using sim::state_block;

std::size_t ReactionWheelsModel::states() const
{
    return sim::padded(interface_.par.n);
}

void ReactionWheelsModel::prepare(const sim::Setup &setup)
{
    const auto &par = interface_.par;
    if (par.n == 0 || par.n > WHEELS_MAX) {
        throw sim::SetupError(setup.name + ": there must be 1 to " + std::to_string(WHEELS_MAX) + " wheels; found " +
                              std::to_string(par.n));
    }
    n_ = par.n;
    padded_ = states();
    for (std::size_t i = 0; i < n_; i++) {
        if (par.Omega_max[i] > 0.0 && std::abs(par.Omega[i]) > par.Omega_max[i]) {
            throw sim::SetupError(
                setup.name + ".Omega[" + std::to_string(i) + "]: the initial speed must be within Omega_max, " +
                sim::format_number(par.Omega_max[i]) + " rad/s; found " + sim::format_number(par.Omega[i]));
        }
    }
}

void ReactionWheelsModel::start(const Vec3 &omega, double *x)
{
    const auto &par = interface_.par;
    wheels_ = {};
    for (std::size_t i = 0; i < n_; i++) {
        const Vec3 axis = vec_scale(1.0 / vec_norm(par.axes_B[i]), par.axes_B[i]);
        wheels_.gx[i] = axis.v[0];
        wheels_.gy[i] = axis.v[1];
        wheels_.gz[i] = axis.v[2];
        wheels_.J[i] = par.J[i];
        wheels_.J_inverse[i] = 1.0 / par.J[i];
        x[i] = par.J[i] * (vec_dot(axis, omega) + par.Omega[i]);
    }
    wheels_.by_speed = 1.0;
    interface_.out = {};
    interface_.mem = {};
}

void ReactionWheelsModel::refresh()
{
    wheels_.by_speed = 1.0; // so that the next latch() computes all torques
}

/// Whether the commands are those of the last update.
bool ReactionWheelsModel::as_before(bool commanded) const
{
    bool same = true;
    for (std::size_t i = 0; i < n_; i++) {
        same &= (commanded ? interface_.in.command.u[i] : 0.0) == wheels_.asked[i];
    }
    return same;
}

bool ReactionWheelsModel::latch(const double *x, const BodyRate &rate, double dt)
{
    const auto &par = interface_.par;
    const bool acts = dt > 0.0;
    const bool commanded = acts && head_written(interface_.in.command.head);
    if (!wheels_.by_speed && as_before(commanded)) {
        return false;
    }
    bool changed = false;
    wheels_.by_speed = 0.0;
    for (std::size_t i = 0; i < n_; i++) {
        double u = commanded ? interface_.in.command.u[i] : 0.0;
        wheels_.asked[i] = u;
        if (par.u_max[i] > 0.0) {
            u = std::clamp(u, -par.u_max[i], par.u_max[i]);
        }
        const double F = acts ? par.friction[i] : 0.0;
        const double c = par.viscosity[i];
        const double limit = par.Omega_max[i];
        double friction = 0.0;
        wheels_.by_speed += par.friction[i] + limit;
        if (F > 0.0 || (limit > 0.0 && u != 0.0)) {
            const double Omega = speed(i, x, rate.omega);
            // The torque with which the wheel turns with the body and ends at rest relative to it.
            const double rest = wheels_.J[i] * (along(i, rate.domega) - Omega / dt);
            if (limit > 0.0 && u != 0.0) {
                const double sign = u > 0.0 ? 1.0 : -1.0;
                const double brakes = Omega * sign > 0.0 ? F + c * limit : -F;
                const double most = sign * rest + wheels_.J[i] * limit / dt + brakes;
                u = sign * std::clamp(sign * u, 0.0, std::max(most, 0.0));
            }
            friction = std::clamp(rest - u, -F, F);
        }
        interface_.out.applied.u[i] = u;
        changed |= u + friction != wheels_.torque[i] || c != wheels_.viscosity[i];
        wheels_.torque[i] = u + friction;
        wheels_.viscosity[i] = c;
    }
    if (changed) {
        Vec3 reaction{};
        double viscous = 0.0;
        for (std::size_t i = 0; i < n_; i++) {
            const Vec3 axis = vec3(wheels_.gx[i], wheels_.gy[i], wheels_.gz[i]);
            reaction = vec_sub(reaction, vec_scale(wheels_.torque[i], axis));
            viscous = std::max(viscous, wheels_.viscosity[i]);
        }
        wheels_.reaction = reaction;
        wheels_.viscous = viscous;
    }
    return changed;
}

void ReactionWheelsModel::derive(const double *x, const Vec3 &omega, double *dx, Loads &loads) const
{
    const Wheels &w = wheels_;
    Vec3 momentum = loads.momentum, torque = vec_add(loads.torque, w.reaction);
    for (std::size_t b = 0; b < padded_; b += state_block) {
        double hx[state_block], hy[state_block], hz[state_block];
        for (std::size_t j = 0; j < state_block; j++) {
            hx[j] = w.gx[b + j] * x[b + j];
            hy[j] = w.gy[b + j] * x[b + j];
            hz[j] = w.gz[b + j] * x[b + j];
            dx[b + j] = w.torque[b + j];
        }
        momentum = vec_add(momentum, vec3((hx[0] + hx[1]) + (hx[2] + hx[3]), (hy[0] + hy[1]) + (hy[2] + hy[3]),
                                          (hz[0] + hz[1]) + (hz[2] + hz[3])));
    }
    if (w.viscous > 0.0) {
        for (std::size_t i = 0; i < n_; i++) {
            const double drag = w.viscosity[i] * speed(i, x, omega);
            dx[i] -= drag;
            torque = vec_add(torque, vec_scale(drag, vec3(w.gx[i], w.gy[i], w.gz[i])));
        }
    }
    loads = {momentum, torque};
}

void ReactionWheelsModel::publish(sim::Ns t, const double *x, const Vec3 &omega)
{
    auto &out = interface_.out;
    bool limited = false;
    for (std::size_t i = 0; i < n_; i++) {
        out.speeds.Omega[i] = speed(i, x, omega);
        // What flight has scaled to the limit may exceed it by rounding.
        limited |= std::abs(out.applied.u[i] - wheels_.asked[i]) > 1e-9 * std::abs(wheels_.asked[i]);
    }
    interface_.mem.saturated += limited;
    out.speeds.head = head_next(out.speeds.head, t, QUALITY_GOOD);
    out.applied.head = head_next(out.applied.head, t, QUALITY_GOOD);
}

} // namespace fledge::world
