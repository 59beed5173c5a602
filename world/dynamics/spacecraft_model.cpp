// SPDX-License-Identifier: Apache-2.0
#include "world/dynamics/spacecraft_model.h"

#include "flight/math/attitude.h"
#include "sim/error.h"
#include "sim/text.h"
#include "world/eigen.h"

#include <Eigen/LU>

#include <algorithm>
#include <cmath>

namespace fledge::world {

using sim::Ns;

namespace {

// Where the states of the craft itself stand: each vector in a block of its own, so that what one
// loop stores by blocks the next loads by the same blocks, which the processor forwards at once.
enum : std::size_t { at_r = 0, at_v = 4, at_sigma = 8, at_omega = 12, own_states = 16 };
static_assert(own_states % sim::state_block == 0);

// Where the external inputs stand, and a 1 if they act.
enum : std::size_t { at_force_N = 0, at_force_B = 4, at_torque_B = 8, at_acts = 12, held_size = 16 };

// The loop computes with Vec3 by value, which the compiler keeps in registers: the same equations
// with Eigen's Vector3d take a quarter longer.
Vec3 get(const double *x, std::size_t i)
{
    return vec3(x[i], x[i + 1], x[i + 2]);
}

void put(double *x, std::size_t i, Vec3 a)
{
    x[i] = a.v[0];
    x[i + 1] = a.v[1];
    x[i + 2] = a.v[2];
    x[i + 3] = 0.0;
}

/// As put(), in two stores of pairs. The integrator loads pairs right afterwards: a load that needs two
/// stores waits until both have reached the cache.
void put_pairs(double *x, std::size_t i, Vec3 a)
{
    using Pair [[gnu::vector_size(16), gnu::aligned(8), gnu::may_alias]] = double;
    auto *pairs = reinterpret_cast<Pair *>(x + i);
    pairs[0] = Pair{a.v[0], a.v[1]};
    pairs[1] = Pair{a.v[2], 0.0};
}

bool is_zero(Vec3 a)
{
    return a.v[0] == 0.0 && a.v[1] == 0.0 && a.v[2] == 0.0;
}

bool differ(Vec3 a, Vec3 b)
{
    return a.v[0] != b.v[0] || a.v[1] != b.v[1] || a.v[2] != b.v[2];
}

/// n is a multiple of state_block. A sum is finite only if all its terms are.
bool all_finite(const double *x, std::size_t n)
{
    double sum[sim::state_block] = {};
    for (std::size_t i = 0; i < n; i += sim::state_block) {
        for (std::size_t j = 0; j < sim::state_block; j++) {
            sum[j] += x[i + j];
        }
    }
    return std::isfinite((sum[0] + sum[1]) + (sum[2] + sum[3]));
}

std::string text(const Vec3 &a)
{
    std::string line = "[";
    for (const double &x : a.v) {
        line += (&x == a.v ? "" : ", ") + sim::format_number(x);
    }
    return line += "]";
}

} // namespace

void SpacecraftModel::attach(Effector &part)
{
    for (const Part &other : parts_) {
        if (other.effector == &part) {
            throw sim::SetupError("spacecraft: the same part is attached twice");
        }
    }
    parts_.push_back({&part, 0});
}

void SpacecraftModel::prepare(const sim::Setup &setup)
{
    name_ = setup.name;
    n_ = own_states;
    for (Part &part : parts_) {
        if (!part.effector->claim(*this)) {
            throw sim::SetupError(name_ + ": one of its parts belongs to another spacecraft");
        }
        part.at = n_;
        n_ += part.effector->states();
    }
    integrator_ = setup.integrator->fresh();
    integrator_->resize(n_);
    const std::size_t carried = sim::padded(integrator_->carried());
    memory_.assign(n_ + carried + n_ + held_size, 0.0);
    x_ = memory_.data();
    dx_ = x_ + n_ + carried;
    held_ = dx_ + n_;

    attraction_.prepare(name_, view(interface_.par.r_BN_N));
    central_mu_ = attraction_.central_mu();
    if (central_mu_ > 0.0) {
        central_surface_ = *attraction_.bodies()[0].surface;
        central_arc_ = Attraction::arc(attraction_.bodies()[0]);
    }
}
void SpacecraftModel::reset(Ns t)
{
    const auto &par = interface_.par;
    take_inertia();
    std::fill(memory_.begin(), memory_.end(), 0.0);
    put(x_, at_r, par.r_BN_N);
    put(x_, at_v, par.v_BN_N);
    put(x_, at_sigma, mrp_short(par.sigma_BN));
    put(x_, at_omega, par.omega_BN_B);
    for (const Part &part : parts_) {
        part.effector->start(par.omega_BN_B, x_ + part.at);
    }
    interface_.out = {};
    latch({t, 0});
    publish(t);
}

void SpacecraftModel::refresh()
{
    take_inertia();
    derive(interface_.out.state.head.t, 0.0, x_, dx_);
}

void SpacecraftModel::take_inertia()
{
    I_B_ = interface_.par.I_B;
    const Eigen::Matrix3d inverse = view(I_B_).inverse();
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            I_B_inverse_.m[i][j] = inverse(i, j);
        }
    }
}

void SpacecraftModel::update(Tick tick)
{
    if (latch(tick)) {
        derive(tick.t - tick.dt, 0.0, x_, dx_);
    }
    if (tick.dt > 0) {
        advance(tick);
    }
    publish(tick.t);
}

/// Take what the inputs give for tick.dt; nothing if that is 0. Returns whether this changes the
/// derivatives from what was last published.
bool SpacecraftModel::latch(Tick tick)
{
    bool changed = latch_external(tick);
    const BodyRate rate{get(x_, at_omega), get(dx_, at_omega)};
    for (const Part &part : parts_) {
        changed |= part.effector->latch(x_ + part.at, rate, tick_seconds(tick.dt));
    }
    return changed;
}

bool SpacecraftModel::latch_external(Tick tick)
{
    const ForceTorque &external = interface_.in.external;
    const bool acts = tick.dt > 0 && head_written(external.head);
    pushed_ = false;
    if (!acts && held_[at_acts] == 0.0) {
        return false;
    }
    Vec3 force_N{}, force_B{}, torque_B{};
    if (acts) {
        force_N = external.force_N;
        force_B = external.force_B;
        torque_B = external.torque_B;
    }
    pushed_ = !(is_zero(force_N) && is_zero(force_B));
    if (pushed_ && interface_.par.mass == 0.0) {
        throw sim::RunError(name_ + ".external: a force arrived at " + sim::format_time(tick.t - tick.dt) +
                            ", force_N = " + text(force_N) + " N and force_B = " + text(force_B) + " N, but " + name_ +
                            ".mass is 0: give the spacecraft its mass");
    }
    const bool changed = differ(force_N, get(held_, at_force_N)) || differ(force_B, get(held_, at_force_B)) ||
                         differ(torque_B, get(held_, at_torque_B));
    put(held_, at_force_N, force_N);
    put(held_, at_force_B, force_B);
    put(held_, at_torque_B, torque_B);
    held_[at_acts] = acts ? 1.0 : 0.0;
    return changed;
}

void SpacecraftModel::advance(Tick tick)
{
    bool finite = false;
    from_ = tick.t - tick.dt;
    from_r_ = get(x_, at_r);
    from_v_ = get(x_, at_v);
    begun_ = false;
    try {
        integrator_->advance(*this, tick.t - tick.dt, tick.dt, x_, dx_);
        stepped_ = false;
        finite = all_finite(x_, n_);
        if (finite && !(central_mu_ > 0.0 && clear_of_center(tick_seconds(tick.dt)))) {
            end_step(tick.t, 0.0, x_);
        }
    } catch (const sim::RunError &error) {
        stepped_ = false;
        throw sim::RunError(name_ + ": " + error.what() + "; " + last_good_state());
    }
    if (!finite) {
        throw sim::RunError(name_ + ": the state at " + sim::format_time(tick.t) + " is not finite; " +
                            last_good_state());
    }
}

/// Whether, within a step of h [s] that ended now, the craft cannot have been inside the only body: it was outside
/// before, and bounds of the way and of its arc are shorter than its altitude. Almost all steps are clear, so that they
/// pay for no more than this.
bool SpacecraftModel::clear_of_center(double h) const
{
    const Vec3 r = get(x_, at_r), way = vec_sub(r, from_r_);
    const double length = fm_abs(way.v[0]) + fm_abs(way.v[1]) + fm_abs(way.v[2]);
    const double reach = central_surface_ + 1.5 * length + central_arc_ * (h * h);
    return !begun_ && vec_norm2(r) > reach * reach;
}

void SpacecraftModel::end_step(Ns start, double tau, const double *x)
{
    if (!begun_) {
        begun_ = true;
        attraction_.begin_step(from_, view(from_r_), view(from_v_));
    }
    attraction_.end_step(start, tau, view(get(x, at_r)), view(get(x, at_v)));
}

std::string SpacecraftModel::last_good_state() const
{
    const CraftState &state = interface_.out.state;
    return "last good state at " + sim::format_time(state.head.t) + ": r_BN_N = " + text(state.r_BN_N) +
           " m, v_BN_N = " + text(state.v_BN_N) + " m/s, sigma_BN = " + text(state.sigma_BN) +
           ", omega_BN_B = " + text(state.omega_BN_B) + " rad/s";
}

void SpacecraftModel::derive(Ns start, double tau, const double *x, double *dx)
{
    const Vec3 sigma = get(x, at_sigma), omega = get(x, at_omega);

    const Vec3 r = get(x, at_r);
    if (stepped_) {
        stepped_ = false;
        end_step(start, tau, x);
    }
    Vec3 acceleration =
        central_mu_ > 0.0 ? point_mass_gravity(central_mu_, r) : vec(attraction_.at(start, tau, view(r)));
    if (pushed_) {
        const Vec3 force =
            vec_add(get(held_, at_force_N), mat_transpose_vec(mrp_to_dcm(sigma), get(held_, at_force_B)));
        acceleration = vec_add(acceleration, vec_scale(1.0 / interface_.par.mass, force));
    }
    put(dx, at_r, get(x, at_v));
    put(dx, at_v, acceleration);

    const Vec3 bend = vec_add(vec_scale(1.0 - vec_norm2(sigma), omega), vec_scale(2.0 * vec_dot(sigma, omega), sigma));
    put(dx, at_sigma, vec_scale(0.25, vec_add(bend, vec_scale(2.0, vec_cross(sigma, omega)))));

    Loads loads{mat_vec(I_B_, omega), get(held_, at_torque_B)};
    for (const Part &part : parts_) {
        part.effector->derive(x + part.at, omega, dx + part.at, loads);
    }
    put_pairs(dx, at_omega, mat_vec(I_B_inverse_, vec_sub(loads.torque, vec_cross(omega, loads.momentum))));
}

void SpacecraftModel::normalize(double *x)
{
    if (const Vec3 sigma = get(x, at_sigma); vec_norm2(sigma) > 1.0) {
        put(x, at_sigma, mrp_shadow(sigma));
    }
    stepped_ = true;
}

void SpacecraftModel::publish(Ns t)
{
    derive(t, 0.0, x_, dx_);
    CraftState &state = interface_.out.state;
    state.head = head_next(state.head, t, QUALITY_GOOD);
    state.r_BN_N = get(x_, at_r);
    state.v_BN_N = get(x_, at_v);
    state.sigma_BN = get(x_, at_sigma);
    state.omega_BN_B = get(x_, at_omega);
    state.domega_BN_B = get(dx_, at_omega);
    state.a_BN_N = get(dx_, at_v);
    for (const Part &part : parts_) {
        part.effector->publish(t, x_ + part.at, state.omega_BN_B);
    }
}

std::vector<sim::Model *> SpacecraftModel::parts() const
{
    std::vector<sim::Model *> models;
    for (const Part &part : parts_) {
        models.push_back(part.effector);
    }
    return models;
}

void SpacecraftModel::copy_setup(const sim::Model &original,
                                 const std::function<sim::Model *(const sim::Model *)> &counterpart)
{
    const auto &other = dynamic_cast<const SpacecraftModel &>(original);
    attraction_ = other.attraction_;
    parts_.clear();
    for (const Part &part : other.parts_) {
        attach(dynamic_cast<Effector &>(*counterpart(part.effector)));
    }
}

} // namespace fledge::world
