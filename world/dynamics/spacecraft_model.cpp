// SPDX-License-Identifier: Apache-2.0
#include "world/dynamics/spacecraft_model.h"

#include "flight/math/attitude.h"
#include "sim/error.h"
#include "sim/text.h"
#include "world/consumer.h"
#include "world/dynamics/coupled_step.h"
#include "world/dynamics/reaction_wheels_model.h"
#include "world/eigen.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <utility>

namespace fledge::world {

using sim::Ns, sim::state_block;

namespace {

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

bool positive(const SymmetricQuads &a)
{
    Symmetric all;
    a.put(all);
    const Mat3 matrix = all.matrix();
    return Eigen::LLT<Eigen::Matrix3d>(view(matrix)).info() == Eigen::Success;
}

/// The inertia of all about C, with what I_B leaves out.
Mat3 inertia_about(const Whole &whole, const Vec3 &c, const Mat3 &hidden)
{
    Symmetric inertia = whole.inertia;
    inertia.add_spread(-whole.mass, c);
    inertia.add(hidden);
    return inertia.matrix();
}

} // namespace

void SpacecraftModel::attach(Effector &part)
{
    for (const Part &other : parts_) {
        if (other.effector == &part) {
            throw sim::SetupError("spacecraft: the same part is attached twice");
        }
    }
    parts_.push_back({&part, 0, false});
}

void SpacecraftModel::prepare(const sim::Setup &setup)
{
    name_ = setup.name;
    n_ = own_states;
    parts_push_ = coupled_ = free_ = false;
    needs_ = 0;
    whole_ = {};
    switching_.clear();
    std::size_t drives = 0;
    std::stable_partition(parts_.begin(), parts_.end(), [](const Part &part) { return !part.effector->carrier(); });
    for (Part &part : parts_) {
        if (!part.effector->claim(*this)) {
            throw sim::SetupError(name_ + ": one of its parts belongs to another spacecraft");
        }
        part.at = n_;
        n_ += part.effector->states();
        drives += part.effector->most_drives();
        part.couples = part.effector->couples();
        parts_push_ |= part.effector->pushes();
        free_ |= part.effector->is_free();
        needs_ |= part.effector->needs();
        coupled_ |= part.couples;
        if (part.effector->switches()) {
            switching_.push_back(part.effector);
        }
        const Effector *carrier = part.effector->carrier();
        const auto is_carrier = [&](const Part &other) { return other.effector == carrier; };
        if (carrier && std::ranges::none_of(parts_, is_carrier)) {
            throw sim::SetupError(name_ + ".parts: one of them is mounted on a part that is not among them");
        }
    }
    governed_.reserve(drives);
    gains_.resize(drives * drives);
    responses_.resize(drives * n_);
    shares_.resize(drives);
    without_.resize(n_);
    if ((parts_push_ || coupled_) && interface_.par.mass == 0.0) {
        throw sim::SetupError(name_ + ".mass is 0, but one of its parts " +
                              (coupled_ ? "moves masses" : "adds forces") + ": give the spacecraft its mass");
    }
    for (const Part &part : parts_) {
        auto *consumer = dynamic_cast<Consumer *>(part.effector);
        auto ports = consumer ? consumer->further() : std::vector<Consumer::Further>{};
        ports.push_back({"", consumer});
        for (const Consumer::Further &port : ports) {
            const auto *source = port.consumer ? dynamic_cast<const SkyUser *>(port.consumer->source()) : nullptr;
            if (sky() && source && source->sky() && !source->sky()->has_frame_of(*sky())) {
                throw sim::SetupError(name_ + ".sky: the " + port.consumer->source_kind() +
                                      " that one of its parts asks is in a sky of another center or epoch");
            }
        }
    }
    integrator_ = setup.integrator->fresh();
    integrator_->resize(n_);
    choose_steps();
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
    center_ = par.center_B;
    offset_ = coupled_ || !is_zero(center_);
    std::fill(memory_.begin(), memory_.end(), 0.0);
    put(x_, at_r, par.r_BN_N);
    put(x_, at_v, par.v_BN_N);
    put(x_, at_sigma, mrp_short(par.sigma_BN));
    put(x_, at_omega, par.omega_BN_B);
    for (const Part &part : parts_) {
        part.effector->start(par.omega_BN_B, x_ + part.at);
    }
    take_inertia();
    interface_.out = {};
    begin();
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
    I_transposed_ = transposed(I_B_);
    I_inverse_ = transposed(mat(view(I_B_).inverse()));
    I_hidden_ = {};
    I_C_ = I_B_;
    for (const Part &part : parts_) {
        part.effector->add_hidden_inertia(I_hidden_);
        part.effector->add_hidden_inertia(I_C_);
    }
    hub_ = {};
    hub_.add(interface_.par.mass, center_, I_B_);
}

/// From the motion of B's origin, which the parameters have, to that of C. Refuses parts that leave the body no mass or
/// inertia.
void SpacecraftModel::begin()
{
    if (!offset_) {
        return;
    }
    Motion motion{};
    Loads loads{};
    motion.sigma_BN = get(x_, at_sigma);
    motion.omega = get(x_, at_omega);
    if (coupled_) {
        couple(x_, motion, loads);
        Factors left;
        left.take(Placed(whole_));
        if (!positive(left.linear) || !positive(left.angular)) {
            throw sim::SetupError(name_ + ".mass and I_B leave the body no inertia once its parts move: they must be "
                                          "those of the hub with its wheels, and of a size that suits the parts");
        }
    }
    const Offset c = offset(Attitude(quad_at(x_ + at_sigma)), quad_at(x_ + at_omega));
    add_at(x_ + at_r, c.r);
    add_at(x_ + at_v, c.v);
}

void SpacecraftModel::update(Tick tick)
{
    const bool changed = latch(tick);
    if (changed) {
        derive(tick.t - tick.dt, 0.0, x_, dx_);
    }
    if (tick.dt > 0) {
        if (drives_ > 0) {
            govern(tick.t - tick.dt, tick_seconds(tick.dt), true);
        }
        advance(tick);
        if (drives_ > 0) {
            govern(tick.t, tick_seconds(tick.dt), false);
        }
    }
    if (tick.dt > 0 && step_) {
        put_out(tick.t);
    } else {
        publish(tick.t);
    }
}

/// The derivatives are linear in force and torque, so the change of the state is their part times 1 s.
void SpacecraftModel::strike(const Impulse &impulse)
{
    const Ns t = interface_.out.state.head.t;
    const Attitude attitude(quad_at(x_ + at_sigma));
    const auto both = [&](const Vec3 &in_N, const Vec3 &in_B) { return attitude.to_B(quad(in_N)) + quad(in_B); };
    const Quad dv = both(impulse.dv_N, impulse.dv_B), angular = both(impulse.angular_N, impulse.angular_B);
    Quad momentum = both(impulse.momentum_N, impulse.momentum_B);
    derive(t, 0.0, x_, dx_); // whole_ is that of now
    const double mass = coupled_ ? whole_.mass : interface_.par.mass;
    if (mass == 0.0 && (impulse.at || dot(momentum, momentum) > 0.0)) {
        throw sim::SetupError(name_ + ".mass is 0, so that a momentum has no effect: give the spacecraft its mass, or "
                                      "the impulse as dv_N or dv_B");
    }
    momentum += mass * dv;
    const Quad c = coupled_ ? 1.0 / mass * quad(whole_.moment) : quad(center_);
    const Quad arm = impulse.at ? quad(*impulse.at) - c : Quad{};
    double held[held_size] = {};
    std::swap_ranges(held, held + held_size, held_);
    const bool pushed = std::exchange(pushed_, pushed_ || mass > 0.0);
    const bool simple = std::exchange(simple_, !(coupled_ || pushed_));
    derive(t, 0.0, x_, without_.data());
    put_quad(held_ + at_force_B, momentum);
    put_quad(held_ + at_torque_B, angular + cross(arm, momentum));
    derive(t, 0.0, x_, dx_);
    for (std::size_t i = 0; i < n_; i++) {
        x_[i] += dx_[i] - without_[i];
    }
    if (mass == 0.0) {
        add_at(x_ + at_v, attitude.to_N(dv));
    }
    std::swap_ranges(held, held + held_size, held_);
    pushed_ = pushed;
    simple_ = simple;
    publish(t);
}

/// How it steps in registers. While nothing pushes it: alone or with four balanced wheels, or with coupled parts that
/// have such a step.
void SpacecraftModel::choose_steps()
{
    turned_ = nullptr;
    unpushed_step_ = pushed_step_ = nullptr;
    if (!integrator_->is_rk4()) {
        return;
    }
    if (coupled_) {
        unpushed_step_ = coupled_step();
        pushed_step_ = tanked_step();
        return;
    }
    pushed_step_ = pushed_step();
    if (parts_.empty()) {
        unpushed_step_ = in_steps<&SpacecraftModel::step_rigid<None>>;
    } else if (parts_.size() == 1 && !parts_push_) {
        turned_ = parts_.front().effector;
        unpushed_step_ = in_steps<&SpacecraftModel::step_rigid<Quad>>;
    } else if (pushed_step_ && first_ && !shaking_) {
        turned_ = first_->effector;
    }
}

/// One step, and the derivatives at its end.
template <class Wheels> LANES_INLINE void SpacecraftModel::step_rigid(Ns dt)
{
    using Craft = RigidCraft<Wheels>;
    using State = typename Craft::State;
    const auto load = [](const double *from) LANES_LAMBDA {
        State x;
        x.r = quad_at(from + at_r);
        x.v = quad_at(from + at_v);
        x.sigma = quad_at(from + at_sigma);
        x.omega = quad_at(from + at_omega);
        if constexpr (Craft::has_wheels) {
            x.h = quad_at(from + own_states);
        }
        return x;
    };
    const auto store = [](double *to, const State &x) LANES_LAMBDA {
        put_quad(to + at_r, x.r);
        put_quad(to + at_v, x.v);
        put_quad(to + at_sigma, x.sigma);
        put_quad(to + at_omega, x.omega);
        if constexpr (Craft::has_wheels) {
            put_quad(to + own_states, x.h);
        }
    };
    Craft craft;
    for (int i = 0; i < 3; i++) {
        craft.inertia[i] = quad_at(I_transposed_.m[i]);
        craft.inverse[i] = quad_at(I_inverse_.m[i]);
    }
    craft.torque = quad_at(held_ + at_torque_B);
    if constexpr (Craft::has_wheels) {
        craft.torque += quad(*rotors_->reaction);
        craft.motor = quad_at(rotors_->torque);
        for (std::size_t i = 0; i < state_block; i++) {
            craft.axis[i] = quad_at(rotors_->axis[i]);
        }
    }
    const auto gravity = [this](double tau, Quad r) LANES_LAMBDA { return gravity_at(from_, tau, r); };
    const State from = load(x_);
    State x = craft.step(from, load(dx_), tick_seconds(dt), gravity);
    if (dot(x.sigma, x.sigma) > 1.0) {
        x.sigma = quad(mrp_shadow(vec(x.sigma)));
    }
    store(x_, x);
    store(dx_, craft.rates(x, gravity_at(from_ + dt, 0.0, x.r)));
    Quad sum = (x.r + x.v) + (x.sigma + x.omega);
    if constexpr (Craft::has_wheels) {
        sum += x.h;
    }
    end_in_registers(from.r, from.v, x.r, sum, tick_seconds(dt));
}

/// Take what the inputs give for tick.dt; nothing if that is 0. Returns whether this changes the
/// derivatives from what was last published.
bool SpacecraftModel::latch(Tick tick)
{
    bool changed = latch_external(tick);
    const BodyRate rate{get(x_, at_omega), get(dx_, at_omega)};
    drives_ = 0;
    for (const Part &part : parts_) {
        changed |= part.effector->latch(x_ + part.at, rate, tick_seconds(tick.dt));
        drives_ += part.effector->drives();
    }
    rotors_ = turned_ ? turned_->rotors() : nullptr;
    if (rotors_ && rotors_->n != state_block) {
        rotors_ = nullptr;
    }
    step_ = pushed_ ? pushed_step_ : unpushed_step_;
    if ((turned_ && !rotors_) || (shaking_ && shaking_->viscous())) {
        step_ = nullptr;
    }
    return changed;
}

bool SpacecraftModel::latch_external(Tick tick)
{
    const ForceTorque &external = interface_.in.external;
    const bool acts = tick.dt > 0 && head_written(external.head);
    pushed_ = parts_push_;
    simple_ = !(coupled_ || pushed_);
    if (!acts && held_[at_acts] == 0.0) {
        return false;
    }
    Vec3 force_N{}, force_B{}, torque_B{};
    if (acts) {
        force_N = external.force_N;
        force_B = external.force_B;
        torque_B = external.torque_B;
    }
    const bool force = !(is_zero(force_N) && is_zero(force_B));
    pushed_ |= force;
    simple_ &= !force;
    if (force && interface_.par.mass == 0.0) {
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
    begun_ = false;
    try {
        Ns end = tick.t;
        begin_stretch(from_, end);
        if (end < tick.t) {
            step_ = nullptr;
        }
        if (step_) {
            step_(*this, tick.dt);
            if (clear_) {
                return;
            }
        } else {
            from_r_ = get(x_, at_r);
            from_v_ = get(x_, at_v);
            integrator_->advance(*this, from_, end - from_, x_, dx_);
            advance_by_stretches(end, tick.t);
            stepped_ = false;
        }
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

/// Calls each(governed) for each drive with a limit, its speed as it will be after `ahead` [s] at the present rates.
template <class Each> void SpacecraftModel::each_drive(double ahead, const Each &each) const
{
    const BodyRate rate{get(x_, at_omega), get(dx_, at_omega)};
    for (const Part &part : parts_) {
        for (std::size_t i = 0; i < part.effector->drives(); i++) {
            const Drive drive = part.effector->drive_at(i, x_ + part.at, rate.omega);
            if (drive.limit > 0.0 && drive.torque != 0.0) {
                const double sign = drive.torque > 0.0 ? 1.0 : -1.0;
                const double gain =
                    ahead > 0.0 ? ahead * part.effector->drive_rate(i, x_ + part.at, dx_ + part.at, rate) : 0.0;
                each(Governed{part.effector, part.at, i, sign, drive.share, sign * (drive.speed + gain), drive.limit});
            }
        }
    }
}

/// Keep the motors within the limits of their speeds: each gives the share of its torque with which its speed is at the
/// limit when the update ends. `ahead`: the update begins, and the share follows from the rates of now. When it ends,
/// the impulse follows that is left to the limit, or too much, so that the speed is the limit whatever the step.
void SpacecraftModel::govern(Ns t, double dt, bool ahead)
{
    bool acts = false;
    each_drive(ahead ? dt : 0.0, [&](const Governed &drive) {
        const double over = drive.speed - drive.limit, rounding = 1e-14 * drive.limit;
        acts |= (over > rounding && drive.share > 0.0) || (over < -rounding && drive.share < 1.0);
    });
    if (acts) {
        share_out(t, dt, ahead);
    }
}

/// The shares, between 0 and 1, by which each speed is at its limit, or below it with all of the torque, or beyond it
/// without any: by Gauss and Seidel's method, as what one motor does to the body moves the others.
void SpacecraftModel::share_out(Ns t, double dt, bool ahead)
{
    derive(t, 0.0, x_, dx_);
    std::vector<Governed> &all = governed_;
    all.clear();
    each_drive(ahead ? dt : 0.0, [&](const Governed &drive) { all.push_back(drive); });
    const auto n = all.size();
    const auto rate_of = [&](const Governed &k, const double *dx) {
        return k.sign * k.effector->drive_rate(k.i, x_ + k.at, dx + k.at, {get(x_, at_omega), get(dx, at_omega)});
    };
    for (std::size_t j = 0; j < n; j++) {
        shares_[j] = all[j].share;
        all[j].effector->give(all[j].i, shares_[j] - 1.0);
        derive(t, 0.0, x_, without_.data());
        all[j].effector->give(all[j].i, shares_[j]);
        for (std::size_t k = 0; k < n_; k++) {
            responses_[j * n_ + k] = dx_[k] - without_[k];
        }
        for (std::size_t k = 0; k < n; k++) {
            gains_[k * n + j] = dt * (rate_of(all[k], dx_) - rate_of(all[k], without_.data()));
        }
    }
    double moved = 1.0;
    for (int round = 0; round < 1000 && moved > 1e-16; round++) {
        moved = 0.0;
        for (std::size_t j = 0; j < n; j++) {
            Governed &drive = all[j];
            const double own = gains_[j * n + j];
            if (!(own > 0.0)) { // a torque so small that it changes no speed
                continue;
            }
            const double share = std::clamp(drive.share + (drive.limit - drive.speed) / own, 0.0, 1.0);
            const double change = share - drive.share;
            drive.share = share;
            for (std::size_t k = 0; k < n; k++) {
                all[k].speed += gains_[k * n + j] * change;
            }
            moved = std::max(moved, std::abs(change));
        }
    }
    for (std::size_t j = 0; j < n; j++) {
        all[j].effector->give(all[j].i, all[j].share);
        for (std::size_t k = 0; k < n_ && !ahead; k++) {
            x_[k] += (all[j].share - shares_[j]) * dt * responses_[j * n_ + k];
        }
    }
    derive(t, 0.0, x_, dx_);
}

/// A step begins at t, which ends at the instant at which a part's loads jump or bend, if that is before `end`.
void SpacecraftModel::begin_stretch(Ns t, Ns &end)
{
    bool changed = t > from_; // else dx_ is up to date
    for (Effector *part : switching_) {
        changed |= part->stretch(t, end);
    }
    if (changed) {
        derive(t, 0.0, x_, dx_);
    }
}

void SpacecraftModel::advance_by_stretches(Ns t, Ns until)
{
    while (t < until) {
        Ns end = until;
        begin_stretch(t, end);
        integrator_->advance(*this, t, end - t, x_, dx_);
        t = end;
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
    if (stepped_) {
        stepped_ = false;
        end_step(start, tau, x);
    }
    if (simple_) {
        sim::in_registers<&SpacecraftModel::derive_simple>(*this, start, tau, x, dx);
    } else {
        sim::in_registers<&SpacecraftModel::derive_pushed>(*this, start, tau, x, dx);
    }
}

LANES_INLINE void SpacecraftModel::derive_simple(Ns start, double tau, const double *x, double *dx)
{
    const Quad sigma = quad_at(x + at_sigma), omega = quad_at(x + at_omega);
    put_quad(dx + at_r, quad_at(x + at_v));
    put_quad(dx + at_v, gravity_at(start, tau, quad_at(x + at_r)));
    put_quad(dx + at_sigma, mrp_rate(sigma, omega));
    Quad momentum = transposed_times(I_transposed_, x + at_omega), torque = quad_at(held_ + at_torque_B);
    if (!parts_.empty()) {
        Motion motion; // these parts use no more of both than this
        Loads loads;
        motion.start = start;
        motion.tau = tau;
        put(motion.omega, omega);
        put(loads.momentum, momentum);
        put(loads.torque, torque);
        for (const Part &part : parts_) {
            part.effector->derive(x + part.at, motion, dx + part.at, loads);
        }
        momentum = quad(loads.momentum);
        torque = quad(loads.torque);
    }
    put_quad(dx + at_omega, transposed_times(I_inverse_, torque - cross(omega, momentum)));
}

LANES_INLINE void SpacecraftModel::derive_pushed(Ns start, double tau, const double *x, double *dx)
{
    const Quad v = quad_at(x + at_v), sigma = quad_at(x + at_sigma), omega = quad_at(x + at_omega);
    const Quad gravity = gravity_at(start, tau, quad_at(x + at_r));
    put_quad(dx + at_r, v);
    put_quad(dx + at_v, gravity);
    put_quad(dx + at_sigma, mrp_rate(sigma, omega));
    put(gravity_, gravity);
    Motion motion; // its matrices stay as they are if no part uses them
    motion.start = start;
    motion.tau = tau;
    put(motion.r_BN_N, quad_at(x + at_r));
    put(motion.v_BN_N, v);
    put(motion.sigma_BN, sigma);
    put(motion.omega, omega);
    motion.mass = interface_.par.mass;
    put(motion.r_CB_B, quad(center_));
    // One by one, as in couple().
    Loads loads;
    put(loads.momentum, Quad{});
    put(loads.moment_rate, Quad{});
    loads.mass_rate = 0.0;
    loads.whole = &whole_;
    put(loads.torque, quad_at(held_ + at_torque_B));
    put(loads.force_N, quad_at(held_ + at_force_N));
    put(loads.force_B, quad_at(held_ + at_force_B));
    if ((needs_ & Effector::needs_attitude) != 0) {
        motion.C_BN = mrp_to_dcm(motion.sigma_BN);
    }
    if (coupled_) {
        return solve(x, motion, loads, dx);
    }
    if ((needs_ & Effector::needs_inertia) != 0) {
        motion.I_C_B = I_C_;
    }
    if (offset_ && (needs_ & Effector::needs_place) != 0) {
        place_origin(Attitude(sigma), motion);
    }
    put(loads.momentum, transposed_times(I_transposed_, x + at_omega));
    for (const Part &part : parts_) {
        part.effector->derive(x + part.at, motion, dx + part.at, loads);
    }
    const Quad force = quad(loads.force_N) + Attitude(sigma).to_N(quad(loads.force_B));
    put_quad(dx + at_v, gravity + 1.0 / interface_.par.mass * force);
    put_quad(dx + at_omega, transposed_times(I_inverse_, quad(loads.torque) - cross(omega, quad(loads.momentum))));
}

Vec3 SpacecraftModel::gravity_torque(const Motion &motion, const Loads &loads) const
{
    const Vec3 r_CN_N = vec_add(motion.r_BN_N, mat_transpose_vec(motion.C_BN, motion.r_CB_B));
    const auto C_BN = view(motion.C_BN);
    if (free_) {
        const auto gradient_N = attraction_.gradient(motion.start, motion.tau, view(r_CN_N));
        const Mat3 gradient_B = mat(C_BN * gradient_N * C_BN.transpose());
        for (const Part &part : parts_) {
            if (part.couples) {
                part.effector->tide(gradient_B, motion.r_CB_B, *loads.whole);
            }
        }
    }
    return vec(attraction_.torque(motion.start, motion.tau, view(r_CN_N), C_BN, view(motion.I_C_B)));
}

/// What the coupled parts are and do.
LANES_INLINE void SpacecraftModel::couple(const double *x, Motion &motion, Loads &loads)
{
    // One by one: to copy it as a whole, the compiler takes an instruction that is slow to start.
    put_quad(&whole_.mass, quad_at(&hub_.mass));
    symmetric(hub_.inertia).put(whole_.inertia);
    if (free_) {
        for (Symmetric *block : {&whole_.linear, &whole_.angular}) {
            SymmetricQuads{}.put(*block);
        }
        for (auto &row : whole_.cross.m) {
            put_quad(row, Quad{});
        }
    }
    put(whole_.drift, Quad{});
    put(whole_.force, Quad{});
    put(whole_.torque, Quad{});
    for (const Part &part : parts_) {
        if (part.couples) {
            part.effector->couple(x + part.at, motion, loads, whole_);
        }
    }
}

/// The derivatives with coupled parts. `motion` has the motion of C in place of the origin's.
LANES_INLINE void SpacecraftModel::solve(const double *x, Motion &motion, Loads &loads, double *dx)
{
    couple(x, motion, loads);
    const double per_mass = 1.0 / whole_.mass;
    const Quad omega = quad_at(x + at_omega), c = per_mass * quad(whole_.moment);
    motion.mass = whole_.mass;
    put(motion.r_CB_B, c);
    Attitude attitude;
    if (pushed_) {
        attitude = Attitude(quad_at(x + at_sigma));
    }
    if ((needs_ & Effector::needs_inertia) != 0) {
        motion.I_C_B = inertia_about(whole_, motion.r_CB_B, I_hidden_);
    }
    if ((needs_ & Effector::needs_place) != 0) {
        place_origin(attitude, motion);
    }
    for (const Part &part : parts_) {
        part.effector->derive(x + part.at, motion, dx + part.at, loads);
    }
    Quad force{};
    if (pushed_) {
        force = quad(loads.force_B) + attitude.to_B(quad(loads.force_N));
        put(loads.torque, quad(loads.torque) + cross(c, force));
    }
    const Quad momentum = symmetric(whole_.inertia).times(omega) + quad(loads.momentum);
    const Quad drift = quad(whole_.drift);
    put(whole_.force, quad(whole_.force) + force - cross(omega, cross(omega, quad(whole_.moment)) + 2.0 * drift));
    put(whole_.torque, quad(whole_.torque) + quad(loads.torque) - cross(omega, momentum));
    Quad a, angular;
    if (free_) {
        Factors left;
        left.take(Placed(whole_));
        left.solve(quad(whole_.force), quad(whole_.torque), a, angular);
    } else {
        RigidFactors left;
        left.take(Placed(whole_));
        left.solve(quad(whole_.force), quad(whole_.torque), a, angular);
    }
    put(a_, a);
    put_quad(dx + at_omega, angular);
    const Vec3 domega = vec(angular);
    for (const Part &part : parts_) {
        if (part.couples) {
            part.effector->accelerate(x + part.at, a_, domega, dx + part.at);
        }
    }
    if (pushed_) {
        // As masses change, C moves in B without momentum.
        const Quad shift = per_mass * (quad(loads.moment_rate) - loads.mass_rate * c);
        const Quad lost = loads.mass_rate * per_mass * drift;
        const Quad gained = per_mass * (force - lost) + cross(omega, shift);
        add_at(dx + at_r, attitude.to_N(shift));
        add_at(dx + at_v, attitude.to_N(gained));
    }
}

LANES_INLINE SpacecraftModel::Offset SpacecraftModel::offset(const Attitude &attitude, Quad omega) const
{
    const double per_mass = coupled_ ? 1.0 / whole_.mass : 0.0;
    const Quad c = coupled_ ? per_mass * quad(whole_.moment) : quad(center_);
    Quad v = cross(omega, c);
    if (coupled_) {
        v += per_mass * quad(whole_.drift);
    }
    return {attitude.to_N(c), attitude.to_N(v)};
}

/// From the motion of C to that of B's origin.
LANES_INLINE void SpacecraftModel::place_origin(const Attitude &attitude, Motion &motion) const
{
    const Offset c = offset(attitude, quad(motion.omega));
    put(motion.r_BN_N, quad(motion.r_BN_N) - c.r);
    put(motion.v_BN_N, quad(motion.v_BN_N) - c.v);
}

void SpacecraftModel::normalize(double *x)
{
    if (const Vec3 sigma = get(x, at_sigma); vec_norm2(sigma) > 1.0) {
        put(x, at_sigma, mrp_shadow(sigma));
    }
    stepped_ = true;
    if (coupled_) {
        normalize_parts(x);
    }
}

void SpacecraftModel::normalize_parts(double *x) const
{
    for (const Part &part : parts_) {
        if (part.couples) {
            part.effector->normalize(x + part.at);
        }
    }
}

void SpacecraftModel::publish(Ns t)
{
    derive(t, 0.0, x_, dx_);
    put_out(t);
}

void SpacecraftModel::put_out(Ns t)
{
    CraftState &state = interface_.out.state;
    state.head = head_next(state.head, t, QUALITY_GOOD);
    const Quad r = quad_at(x_ + at_r), v = quad_at(x_ + at_v), a = quad_at(dx_ + at_v);
    put(state.r_BN_N, r);
    put(state.r_CN_N, r);
    put(state.v_BN_N, v);
    put(state.v_CN_N, v);
    put(state.sigma_BN, quad_at(x_ + at_sigma));
    put(state.omega_BN_B, quad_at(x_ + at_omega));
    put(state.domega_BN_B, quad_at(dx_ + at_omega));
    put(state.a_BN_N, a);
    // Where gravity alone accelerates, it is known already.
    put(state.g_CN_N, simple_ ? a : quad(gravity_));
    if (offset_) {
        sim::in_registers<&SpacecraftModel::publish_origin>(*this);
    }
    for (const Part &part : parts_) {
        part.effector->publish(t, x_ + part.at, state.omega_BN_B);
    }
}

/// The origin's motion, where it is not that of C.
LANES_INLINE void SpacecraftModel::publish_origin()
{
    CraftState &state = interface_.out.state;
    const Attitude attitude(quad_at(x_ + at_sigma));
    const Quad omega = quad_at(x_ + at_omega);
    if (coupled_) {
        put(state.a_BN_N, quad(gravity_) + attitude.to_N(quad(a_)));
        state.v_CN_N = get(dx_, at_r);
    } else {
        const Quad c = quad(center_), a = cross(quad_at(dx_ + at_omega), c) + cross(omega, cross(omega, c));
        put(state.a_BN_N, quad_at(dx_ + at_v) - attitude.to_N(a));
    }
    const Offset c = offset(attitude, omega);
    put(state.r_BN_N, quad_at(x_ + at_r) - c.r);
    put(state.v_BN_N, quad_at(x_ + at_v) - c.v);
}

std::vector<sim::Model *> SpacecraftModel::parts() const
{
    std::vector<sim::Model *> models;
    for (const Part &part : parts_) {
        models.push_back(part.effector);
    }
    return models;
}

std::vector<sim::DifferentialState> SpacecraftModel::differential_states()
{
    std::vector<StateName> names;
    add_names(names, at_r, "r_CN_N", "m", 3);
    add_names(names, at_v, "v_CN_N", "m/s", 3);
    add_names(names, at_sigma, "sigma_BN", "-", 3);
    add_names(names, at_omega, "omega_BN_B", "rad/s", 3);
    std::vector<sim::DifferentialState> states;
    const auto add = [&](const sim::Model *of, std::size_t at, const std::vector<StateName> &some) {
        for (const StateName &name : some) {
            states.push_back({of, name.name, name.unit, x_ + at + name.at, dx_ + at + name.at});
        }
    };
    add(this, 0, names);
    for (const Part &part : parts_) {
        add(part.effector, part.at, part.effector->names());
    }
    return states;
}

void SpacecraftModel::follow(Ns dt)
{
    const Ns t = interface_.out.state.head.t;
    if (dt > 0) {
        latch({t + dt, dt});
        if (drives_ > 0) {
            derive(t, 0.0, x_, dx_);
            govern(t, tick_seconds(dt), true);
        }
    }
    publish(t);
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
