// SPDX-License-Identifier: Apache-2.0
#include "world/dynamics/reaction_wheels_model.h"

#include "sim/error.h"
#include "sim/text.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>

namespace fledge::world {

namespace {

using std::numbers::pi;

} // namespace

std::size_t ReactionWheelsModel::states() const
{
    return sim::padded(interface_.par.n) * (imbalanced() ? 2 : 1);
}

std::vector<StateName> ReactionWheelsModel::names() const
{
    std::vector<StateName> all;
    add_names(all, 0, "h", "N m s", n_);
    add_names(all, padded_, "theta", "rad", imbalanced_ ? n_ : 0);
    return all;
}

bool ReactionWheelsModel::imbalanced() const
{
    const auto &par = interface_.par;
    bool any = false;
    for (std::size_t i = 0; i < std::min<std::size_t>(par.n, WHEELS_MAX); i++) {
        any |= par.unbalance[i] != 0.0 || par.couple[i] != 0.0;
    }
    return any;
}

void ReactionWheelsModel::prepare(const sim::Setup &setup)
{
    const auto &par = interface_.par;
    if (par.n == 0 || par.n > WHEELS_MAX) {
        throw sim::SetupError(setup.name + ": there must be 1 to " + std::to_string(WHEELS_MAX) + " wheels; found " +
                              std::to_string(par.n));
    }
    name_ = setup.name;
    seeded_ = sim::Random(setup.seed, setup.name);
    check();
    n_ = par.n;
    padded_ = rotors_.n = sim::padded(n_);
    imbalanced_ = imbalanced();
    coupled_ = couples();
    for (std::size_t i = 0; i < n_; i++) {
        if (par.Omega_max[i] > 0.0 && std::abs(par.Omega[i]) > par.Omega_max[i]) {
            throw sim::SetupError(
                setup.name + ".Omega[" + std::to_string(i) + "]: the initial speed must be within Omega_max, " +
                sim::format_number(par.Omega_max[i]) + " rad/s; found " + sim::format_number(par.Omega[i]));
        }
        if (par.stiction[i] > par.friction[i] && par.stribeck[i] == 0.0) {
            throw sim::SetupError(setup.name + ".stribeck[" + std::to_string(i) +
                                  "] must be > 0 where stiction exceeds friction; found 0");
        }
    }
}

void ReactionWheelsModel::check() const
{
    const auto &par = interface_.par;
    bool limited = true;
    for (std::uint32_t i = 0; i < par.n; i++) {
        limited &= par.u_max[i] > 0.0 && par.Omega_max[i] > 0.0;
    }
    check_faults(name_, {par.faults, par.n_faults}, 2 * WHEELS_MAX, limited);
}

void ReactionWheelsModel::start(const Vec3 &omega, double *x)
{
    const auto &par = interface_.par;
    wheels_ = {};
    wheels_.faults.reset(seeded_);
    for (std::size_t i = 0; i < n_; i++) {
        const Vec3 axis = vec_scale(1.0 / vec_norm(par.axes_B[i]), par.axes_B[i]);
        std::copy(axis.v, axis.v + 3, wheels_.axis[i]);
        for (int j = 0; j < 3; j++) {
            wheels_.g[j][i] = axis.v[j];
        }
        wheels_.J[i] = par.J[i];
        wheels_.J_inverse[i] = 1.0 / par.J[i];
        x[i] = par.J[i] * (vec_dot(axis, omega) + par.Omega[i]);
        if (imbalanced_) {
            // Any direction will do for theta = 0.
            const Vec3 out = vec_unit(vec_cross(axis, fm_abs(axis.v[0]) < 0.6 ? vec3(1, 0, 0) : vec3(0, 1, 0)));
            const Vec3 directions[2] = {out, vec_cross(axis, out)};
            for (int k = 0; k < 2; k++) {
                const Vec3 u = vec_scale(par.unbalance[i], directions[k]);
                const Vec3 r = par.r_WB_B[i], d = vec_add(vec_scale(par.couple[i], directions[k]), vec_cross(r, u));
                const Vec3 w = vec_scale(par.couple[i], vec_cross(axis, directions[k]));
                for (int j = 0, at = 0; j < 3; j++) {
                    wheels_.u[k][j][i] = u.v[j];
                    wheels_.d[k][j][i] = d.v[j];
                    for (int l = j; l < 3; l++, at++) {
                        wheels_.inertia[k][at][i] = axis.v[j] * w.v[l] + w.v[j] * axis.v[l] - r.v[j] * u.v[l] -
                                                    u.v[j] * r.v[l] + (j == l ? 2.0 * vec_dot(r, u) : 0.0);
                    }
                }
            }
            x[padded_ + i] = par.theta[i];
        }
    }
    refresh();
    interface_.out = {};
    interface_.mem = {};
}

void ReactionWheelsModel::refresh()
{
    check();
    const auto &par = interface_.par;
    wheels_.again = 1.0; // so that the next latch() computes all torques
    wheels_.rubs = wheels_.limits = 0.0;
    for (std::size_t i = 0; i < n_; i++) {
        if (par.Omega_max[i] > 0.0) {
            wheels_.rubs = wheels_.limits = 1.0;
        }
        if (par.friction[i] > 0.0 || par.stiction[i] > 0.0) {
            wheels_.rubs = 1.0;
        }
    }
}

/// Whether the commands are those of the last update.
bool ReactionWheelsModel::as_before(bool commanded) const
{
    static constexpr double off[WHEELS_MAX] = {};
    const double *u = commanded ? interface_.in.command.u : off;
    std::uint64_t differs = 0;
    for (std::size_t i = 0; i < padded_; i++) {
        differs |= std::bit_cast<std::uint64_t>(u[i]) ^ std::bit_cast<std::uint64_t>(wheels_.requested[i]);
    }
    return differs == 0;
}

/// The friction that acts for dt [s] against the motor's torque u.
double ReactionWheelsModel::rub(std::size_t i, const double *x, const BodyRate &rate, double dt, double u) const
{
    const auto &par = interface_.par;
    double F = dt > 0.0 ? par.friction[i] : 0.0;
    const double stiction = dt > 0.0 ? par.stiction[i] : 0.0;
    if (!(F > 0.0 || stiction > 0.0)) {
        return 0.0;
    }
    const double Omega = speed(i, x, rate.omega);
    if (stiction > F) {
        const double ratio = Omega / par.stribeck[i];
        F += (stiction - F) * fm_exp(-ratio * ratio);
    }
    // The torque with which the wheel turns with the body and ends at rest relative to it.
    const double rest = wheels_.J[i] * (along(i, rate.domega) - Omega / dt);
    return std::clamp(rest - u, -F, F);
}

bool ReactionWheelsModel::latch(const double *x, const BodyRate &rate, double dt)
{
    const auto &par = interface_.par;
    const bool acts = dt > 0.0;
    const bool commanded = acts && head_written(interface_.in.command.head);
    const bool faulty = acts && wheels_.faults.any();
    drives_ = wheels_.limits != 0.0 ? n_ : 0;
    if (wheels_.again == 0.0 && !faulty && as_before(commanded)) {
        return false;
    }
    bool changed = false, limited = false;
    wheels_.again = faulty ? 1.0 : wheels_.rubs;
    for (std::size_t i = 0; i < n_; i++) {
        double u = commanded ? interface_.in.command.u[i] : 0.0;
        if (faulty) {
            const double most = par.u_max[i] > 0.0 ? par.u_max[i] : unlimited;
            wheels_.faults.apply(i, {&u, 1}, -most, most);
        }
        const double requested = u;
        if (par.u_max[i] > 0.0) {
            u = std::clamp(u, -par.u_max[i], par.u_max[i]);
        }
        const double friction = wheels_.rubs != 0.0 ? rub(i, x, rate, dt, u) : 0.0;
        // What flight has scaled to the limit may exceed it by rounding.
        limited |= std::abs(u - requested) > 1e-9 * std::abs(requested);
        changed |= u + friction != wheels_.torque[i] || par.viscosity[i] != wheels_.viscosity[i];
        wheels_.requested[i] = requested;
        wheels_.motor[i] = u;
        wheels_.share[i] = 1.0;
        wheels_.friction[i] = friction;
        wheels_.torque[i] = u + friction;
        wheels_.viscosity[i] = par.viscosity[i];
        interface_.out.applied.u[i] = u;
    }
    wheels_.limited = limited;
    if (changed) {
        react();
    }
    return changed;
}

void ReactionWheelsModel::react()
{
    Vec3 reaction{};
    double viscous = 0.0;
    for (std::size_t i = 0; i < n_; i++) {
        reaction = vec_sub(reaction, vec_scale(wheels_.torque[i], vec(quad_at(wheels_.axis[i]))));
        viscous = std::max(viscous, wheels_.viscosity[i]);
    }
    wheels_.reaction = reaction;
    wheels_.viscous = viscous;
}

void ReactionWheelsModel::give(std::size_t i, double share)
{
    wheels_.share[i] = share;
    interface_.out.applied.u[i] = share * wheels_.motor[i];
    wheels_.torque[i] = interface_.out.applied.u[i] + wheels_.friction[i];
    react();
}

void ReactionWheelsModel::derive(const double *x, const Motion &motion, double *dx, Loads &loads) const
{
    if (!coupled_) {
        sim::in_registers<&ReactionWheelsModel::derive_in_lanes>(*this, x, motion, dx, loads);
    }
}

LANES_INLINE void ReactionWheelsModel::derive_in_lanes(const double *x, const Motion &motion, double *dx,
                                                       Loads &loads) const
{
    const Wheels &w = wheels_;
    Quad momentum = quad(loads.momentum);
    for (std::size_t b = 0; b < padded_; b += state_block) {
        const auto of = [&](std::size_t i) { return quad_at(w.axis[b + i]) * x[b + i]; };
        momentum += (of(0) + of(1)) + (of(2) + of(3));
        put_quad(dx + b, quad_at(w.torque + b));
    }
    put(loads.momentum, momentum);
    put(loads.torque, quad(loads.torque) + quad(w.reaction));
    if (w.viscous > 0.0) {
        drag(x, motion, dx, loads);
    }
    if (imbalanced_) {
        shake(x, motion, dx, loads);
    }
}

void ReactionWheelsModel::drag(const double *x, const Motion &motion, double *dx, Loads &loads) const
{
    for (std::size_t i = 0; i < n_; i++) {
        const double torque = wheels_.viscosity[i] * speed(i, x, motion.omega);
        dx[i] -= torque;
        loads.torque = vec_add(loads.torque, vec_scale(torque, vec(quad_at(wheels_.axis[i]))));
    }
}

/// The simple jitter.
LANES_INLINE void ReactionWheelsModel::shake(const double *x, const Motion &motion, double *dx, Loads &loads) const
{
    const Quad3 omega = quads(motion.omega);
    Quad3 force{}, torque{};
    for (std::size_t i = 0; i < n_; i += state_block) {
        const Lanes lanes{wheels_, i};
        const Lanes::Turned now = lanes.turned(quad_at(x + padded_ + i));
        const Quad Omega = lanes.Omega(quad_at(x + i), omega);
        put_quad(dx + padded_ + i, Omega);
        force = force + Omega * Omega * now.u;
        torque = torque + Omega * Omega * now.d;
    }
    // d is about B's origin; the loads' torque is about C.
    const Quad all = sums(force);
    put(loads.force_B, quad(loads.force_B) + all);
    put(loads.torque, quad(loads.torque) + sums(torque) - cross(quad(motion.r_CB_B), all));
}

void ReactionWheelsModel::add_hidden_inertia(Mat3 &inertia) const
{
    for (std::size_t i = 0; i < n_; i++) {
        const double *g = wheels_.axis[i];
        for (int j = 0; j < 3; j++) {
            for (int k = 0; k < 3; k++) {
                inertia.m[j][k] += wheels_.J[i] * g[j] * g[k];
            }
        }
    }
}

void ReactionWheelsModel::couple(const double *x, const Motion &motion, Loads &loads, Whole &whole)
{
    sim::in_registers<&ReactionWheelsModel::couple_in_lanes>(*this, x, motion, loads, whole);
}

LANES_INLINE void ReactionWheelsModel::couple_in_lanes(const double *x, const Motion &motion, Loads &loads,
                                                       Whole &whole)
{
    Placed placed(whole);
    Moved moved(whole, loads);
    for (std::size_t i = 0; i < n_; i += state_block) {
        const Lanes lanes{wheels_, i};
        const Swing state{quad_at(x + padded_ + i), quad_at(x + i)};
        Lanes::Place at;
        lanes.place(state.at, placed, at);
        const Lanes::Acting now = lanes.act(at, state, quad(motion.omega), moved);
        places_[i / state_block].sigma = at.sigma; // accelerate() needs no more of them
        places_[i / state_block].delta = at.delta;
        acting_[i / state_block] = now;
    }
    placed.put(whole);
    moved.put(whole, loads);
}

void ReactionWheelsModel::accelerate(const double *, const Vec3 &a, const Vec3 &domega, double *dx) const
{
    sim::in_registers<&ReactionWheelsModel::accelerate_in_lanes>(*this, a, domega, dx);
}

LANES_INLINE void ReactionWheelsModel::accelerate_in_lanes(const Vec3 &a, const Vec3 &domega, double *dx) const
{
    for (std::size_t i = 0; i < n_; i += state_block) {
        const Swing k =
            Lanes{wheels_, i}.accelerate(places_[i / state_block], acting_[i / state_block], quad(a), quad(domega));
        put_quad(dx + i, k.rate);
        put_quad(dx + padded_ + i, k.at);
    }
}

void ReactionWheelsModel::normalize(double *x) const
{
    for (std::size_t i = padded_; i < 2 * padded_; i += state_block) {
        put_quad(x + i, Lanes::normalized(quad_at(x + i)));
    }
}

/// The faults of the measured speeds. Returns whether any is measured.
bool ReactionWheelsModel::measure_faultily(WheelSpeeds &speeds)
{
    bool speaks = false;
    for (std::size_t i = 0; i < n_; i++) {
        const double most = interface_.par.Omega_max[i] > 0.0 ? interface_.par.Omega_max[i] : unlimited;
        speaks |= wheels_.faults.apply(WHEELS_MAX + i, {&speeds.Omega[i], 1}, -most, most);
    }
    return speaks;
}

void ReactionWheelsModel::publish(sim::Ns t, const double *x, const Vec3 &omega)
{
    auto &out = interface_.out;
    sim::in_registers<&ReactionWheelsModel::show>(*this, x, omega);
    interface_.mem.saturated += (wheels_.limited != 0.0 || shares_less(wheels_.share));
    const bool speaks = !begin_faults(t) || measure_faultily(out.speeds);
    out.speeds.head = speaks ? head_next(out.speeds.head, t, QUALITY_GOOD) : head_held(out.speeds.head);
    out.applied.head = head_next(out.applied.head, t, QUALITY_GOOD);
}

LANES_INLINE void ReactionWheelsModel::show(const double *x, const Vec3 &omega)
{
    const Quad3 rate = quads(omega);
    for (std::size_t i = 0; i < padded_; i += state_block) {
        put_quad(interface_.out.speeds.Omega + i, Lanes{wheels_, i}.Omega(quad_at(x + i), rate));
    }
}

} // namespace fledge::world
