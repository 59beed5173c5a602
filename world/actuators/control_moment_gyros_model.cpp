// SPDX-License-Identifier: Apache-2.0
#include "world/actuators/control_moment_gyros_model.h"

#include "sim/error.h"
#include "sim/text.h"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace fledge::world {

namespace {

double limited(double x, double most)
{
    return most > 0.0 ? std::clamp(x, -most, most) : x;
}

void add(Mat3 &to, double k, const Vec3 &a)
{
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            to.m[i][j] += k * a.v[i] * a.v[j];
        }
    }
}

Vec3 column(const double (&a)[3][WHEELS_MAX], std::size_t i)
{
    return vec3(a[0][i], a[1][i], a[2][i]);
}

void put_column(double (&to)[3][WHEELS_MAX], std::size_t i, const Vec3 &a)
{
    for (std::size_t j = 0; j < 3; j++) {
        to[j][i] = a.v[j];
    }
}

} // namespace

void ControlMomentGyrosModel::prepare(const sim::Setup &setup)
{
    const auto &par = interface_.par;
    const auto element = [&](const char *field, std::size_t i) {
        return name_ + "." + field + "[" + std::to_string(i) + "]";
    };
    name_ = setup.name;
    seeded_ = sim::Random(setup.seed, setup.name);
    refresh();
    n_ = par.n;
    padded_ = sim::padded(n_);
    for (std::size_t i = 0; i < n_; i++) {
        const Vec3 g = vec_unit(par.gimbal_axes_B[i]), s = vec_unit(par.spin_axes_B[i]), t = vec_cross(g, s);
        if (!(vec_norm(t) > 1e-3)) {
            throw sim::SetupError(element("spin_axes_B", i) +
                                  ": the wheel's axis must be across the gimbal's; found it along it");
        }
        const auto within = [&](const char *field, double x, const char *limit, double most) {
            if (most > 0.0 && std::abs(x) > most) {
                throw sim::SetupError(element(field, i) + ": the initial value must be within " + limit + ", " +
                                      sim::format_number(most) + " rad/s; found " + sim::format_number(x));
            }
        };
        within("Omega", par.Omega[i], "Omega_max", par.Omega_max[i]);
        within("rate", par.rate[i], "rate_max", par.rate_max[i]);
    }
}

void ControlMomentGyrosModel::refresh()
{
    const auto &par = interface_.par;
    check_faults(name_, {par.faults, par.n_faults}, channels, false);
    state_.again = 1.0;
    Constants &all = state_.gyros = {};
    for (std::size_t i = 0; i < par.n; i++) {
        const Vec3 g = vec_unit(par.gimbal_axes_B[i]), t = vec_unit(vec_cross(g, vec_unit(par.spin_axes_B[i])));
        put_column(all.g, i, g);
        put_column(all.t, i, t);
        put_column(all.s, i, vec_cross(t, g));
        all.J[i] = par.J[i];
        all.J_inverse[i] = 1.0 / par.J[i];
        all.J_g[i] = par.J_g[i];
        all.J_g_inverse[i] = 1.0 / par.J_g[i];
        all.J_s[i] = par.J_s[i];
        all.J_t[i] = par.J_t[i];
        all.all_ways.add_spread(par.J_t[i], g);
    }
}

void ControlMomentGyrosModel::add_hidden_inertia(Mat3 &inertia) const
{
    for (std::size_t i = 0; i < n_; i++) {
        add(inertia, interface_.par.J[i], axis(i, interface_.par.angle[i]));
        add(inertia, interface_.par.J_g[i], column(state_.gyros.g, i));
    }
}

/// Of the wheel.
Vec3 ControlMomentGyrosModel::axis(std::size_t i, double angle) const
{
    double sine, cosine;
    fm_sincos(angle, &sine, &cosine);
    return vec_add(vec_scale(cosine, column(state_.gyros.s, i)), vec_scale(sine, column(state_.gyros.t, i)));
}

std::vector<StateName> ControlMomentGyrosModel::names() const
{
    std::vector<StateName> all;
    const std::size_t n = interface_.par.n;
    add_names(all, 0, "h", "N m s", n);
    add_names(all, padded_, "p", "N m s", n);
    add_names(all, 2 * padded_, "angle", "rad", n);
    return all;
}

void ControlMomentGyrosModel::start(const Vec3 &omega, double *x)
{
    const auto &par = interface_.par;
    state_ = {};
    refresh();
    state_.faults.reset(seeded_);
    for (std::size_t i = 0; i < n_; i++) {
        x[i] = par.J[i] * (vec_dot(axis(i, par.angle[i]), omega) + par.Omega[i]);
        x[padded_ + i] = par.J_g[i] * (vec_dot(column(state_.gyros.g, i), omega) + par.rate[i]);
        x[2 * padded_ + i] = par.angle[i];
    }
    interface_.out = {};
    interface_.mem = {};
}

/// What the faults make of a command with a limit, 0: none.
void ControlMomentGyrosModel::fail(std::size_t channel, double &x, double most)
{
    const double limit = most > 0.0 ? most : unlimited;
    state_.faults.apply(channel, {&x, 1}, -limit, limit);
    x = limited(x, most);
}

bool ControlMomentGyrosModel::latch(const double *, const BodyRate &, double dt)
{
    const auto &[command, rates, torques, injected] = interface_.in;
    const auto &par = interface_.par;
    const auto acts = [&](Head head) { return dt > 0.0 && head_written(head); };
    const bool faulty = dt > 0.0 && state_.faults.any(), servo = acts(rates.head);
    Commanded &commanded = state_.commanded;
    bool same = !faulty && state_.again == 0.0 && commanded.dt == dt && (commanded.servo != 0.0) == servo;
    const auto latch_command = [&](double *held, bool active, const double *from) {
        for (std::size_t b = 0; b < padded_; b += sim::state_block) {
            const Quad now = active ? quad_at(from + b) : Quad{};
            const auto differ = now != quad_at(held + b);
            same &= !(differ[0] | differ[1] | differ[2] | differ[3]);
            put_quad(held + b, now);
        }
    };
    latch_command(commanded.wheel, acts(command.head), command.u);
    latch_command(commanded.rate, servo, rates.rate);
    latch_command(commanded.torque, acts(torques.head), torques.u);
    if (same) {
        return false;
    }
    commanded.dt = dt;
    commanded.servo = servo ? 1.0 : 0.0;
    state_.again = faulty ? 1.0 : 0.0;
    const Motors before = state_.motors;
    Motors &motors = state_.motors = {};
    drives_ = 0;
    for (std::size_t i = 0; i < n_; i++) {
        const double torque = commanded.torque[i];
        double wheel = limited(commanded.wheel[i], par.u_max[i]);
        double gimbal = servo ? limited(commanded.rate[i], par.rate_max[i]) : limited(torque, par.torque_max[i]);
        if (faulty) {
            fail(of_wheels + i, wheel, par.u_max[i]);
            fail(of_gimbals + i, gimbal, servo ? par.rate_max[i] : par.torque_max[i]);
        }
        const bool fast = par.Omega_max[i] > 0.0 && wheel != 0.0;
        if (fast || (!servo && par.rate_max[i] > 0.0 && gimbal != 0.0)) {
            state_.again = 1.0;
            drives_ = 2 * n_;
        }
        if (std::abs(wheel - commanded.wheel[i]) > 1e-9 * std::abs(commanded.wheel[i]) ||
            (!servo && std::abs(gimbal - torque) > 1e-9 * std::abs(torque))) {
            motors.limited = 1.0;
        }
        motors.wheel[i] = motors.whole[i] = wheel;
        motors.whole[n_ + i] = servo ? 0.0 : gimbal;
        motors.share[i] = motors.share[n_ + i] = 1.0;
        (servo ? motors.wanted : motors.gimbal)[i] = gimbal;
        if (servo) {
            motors.servo[i] = 1.0;
            motors.per_lag[i] = par.J_g[i] / (par.lag[i] > 0.0 ? par.lag[i] : dt);
        }
        motors.most[i] = servo && par.torque_max[i] > 0.0 ? par.torque_max[i] : HUGE_VAL;
    }
    return std::memcmp(&motors, &before, sizeof motors) != 0;
}

Drive ControlMomentGyrosModel::drive_at(std::size_t i, const double *x, const Vec3 &omega) const
{
    const auto &par = interface_.par;
    const Motors &motors = state_.motors;
    const std::size_t k = i % n_;
    const double torque = motors.whole[i], limit = i < n_ ? par.Omega_max[k] : par.rate_max[k];
    if (torque == 0.0 || limit == 0.0) {
        return {};
    }
    const double speed = i < n_
                             ? x[k] * state_.gyros.J_inverse[k] - vec_dot(axis(k, x[2 * padded_ + k]), omega)
                             : x[padded_ + k] * state_.gyros.J_g_inverse[k] - vec_dot(column(state_.gyros.g, k), omega);
    return {torque, motors.share[i], speed, limit};
}

double ControlMomentGyrosModel::drive_rate(std::size_t i, const double *x, const double *dx, const BodyRate &rate) const
{
    const Constants &gyros = state_.gyros;
    const std::size_t k = i % n_;
    if (i >= n_) {
        return dx[padded_ + k] * gyros.J_g_inverse[k] - vec_dot(column(gyros.g, k), rate.domega);
    }
    const Vec3 s = axis(k, x[2 * padded_ + k]), t = vec_cross(column(gyros.g, k), s);
    return dx[k] * gyros.J_inverse[k] - vec_dot(s, rate.domega) - dx[2 * padded_ + k] * vec_dot(t, rate.omega);
}

void ControlMomentGyrosModel::give(std::size_t i, double share)
{
    Motors &motors = state_.motors;
    motors.share[i] = share;
    const bool is_wheel = i < n_;
    double *const torques = is_wheel ? motors.wheel : motors.gimbal;
    torques[is_wheel ? i : i - n_] = share * motors.whole[i];
}

void ControlMomentGyrosModel::couple(const double *x, const Motion &motion, Loads &loads, Whole &whole)
{
    sim::in_registers<&ControlMomentGyrosModel::couple_in_lanes>(*this, x, motion, loads, whole);
}

LANES_INLINE void ControlMomentGyrosModel::couple_in_lanes(const double *x, const Motion &motion, Loads &loads,
                                                           Whole &whole)
{
    Placed placed(whole);
    Moved moved(whole, loads);
    for (std::size_t i = 0; i < n_; i += sim::state_block) {
        const Lanes gyros = lanes(i);
        const Lanes::State state = gyros.load(x);
        Lanes::Place at;
        gyros.place(state.angle, placed, at);
        acting_[i / sim::state_block] = gyros.act(at, state, quad(motion.omega), moved);
        gyros.show(acting_[i / sim::state_block]);
    }
    placed.inertia.put(whole.inertia); // they add nothing else
    put(loads.momentum, moved.momentum);
    put(loads.torque, moved.acting);
}

void ControlMomentGyrosModel::accelerate(const double *, const Vec3 &, const Vec3 &, double *dx) const
{
    sim::in_registers<&ControlMomentGyrosModel::accelerate_in_lanes>(*this, dx);
}

LANES_INLINE void ControlMomentGyrosModel::accelerate_in_lanes(double *dx) const
{
    for (std::size_t i = 0; i < n_; i += sim::state_block) {
        const Lanes gyros = lanes(i);
        gyros.store(dx, gyros.accelerate(Lanes::Place{}, acting_[i / sim::state_block], Quad{}, Quad{}));
    }
}

void ControlMomentGyrosModel::publish(sim::Ns t, const double *x, const Vec3 &)
{
    auto &[speeds, gimbals, applied, gimbals_applied] = interface_.out;
    const auto &par = interface_.par;
    const bool faulty = state_.faults.begin(t, par.n_faults, par.faults, interface_.in.injected);
    bool speeds_speak = !faulty, angles_speak = !faulty;
    for (std::size_t i = 0; i < n_; i++) {
        speeds.Omega[i] = x[i] * state_.gyros.J_inverse[i] - seen_.omega_s[i];
        gimbals.angle[i] = x[2 * padded_ + i];
        gimbals.rate[i] = seen_.rate[i];
        if (faulty) {
            const double most = par.Omega_max[i] > 0.0 ? par.Omega_max[i] : unlimited;
            speeds_speak |= state_.faults.apply(of_speeds + i, {&speeds.Omega[i], 1}, -most, most);
            angles_speak |= state_.faults.apply(of_angles + i, {&gimbals.angle[i], 1});
        }
        applied.u[i] = state_.motors.wheel[i];
        gimbals_applied.u[i] = seen_.torque[i];
    }
    interface_.mem.saturated += (state_.motors.limited != 0.0 || shares_less(state_.motors.share));
    speeds.head = speeds_speak ? head_next(speeds.head, t, QUALITY_GOOD) : head_held(speeds.head);
    gimbals.head = angles_speak ? head_next(gimbals.head, t, QUALITY_GOOD) : head_held(gimbals.head);
    for (Head *head : {&applied.head, &gimbals_applied.head}) {
        *head = head_next(*head, t, QUALITY_GOOD);
    }
}

} // namespace fledge::world
