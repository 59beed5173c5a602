// SPDX-License-Identifier: Apache-2.0
#include "world/actuators/control_moment_gyros_model.h"

#include "sim/error.h"
#include "sim/text.h"

#include <algorithm>
#include <cmath>

namespace fledge::world {

namespace {

double limited(double x, double most)
{
    return most > 0.0 ? std::clamp(x, -most, most) : x;
}

/// The torque of a motor that shall not drive its rate beyond a limit: 0 is none. `rest` is the torque that keeps the
/// rate, `per_rate` the one that changes it by 1 rad/s within the update. It never brakes by itself.
double no_faster(double u, double rate, double limit, double rest, double per_rate)
{
    if (!(limit > 0.0) || u == 0.0) {
        return u;
    }
    const double sign = u > 0.0 ? 1.0 : -1.0;
    return sign * std::clamp(sign * u, 0.0, std::max(sign * rest + per_rate * (limit - sign * rate), 0.0));
}

void add(auto &to, double k, const Vec3 &a)
{
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            to.m[i][j] += k * a.v[i] * a.v[j];
        }
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
        zero_[i] = {vec_unit(vec_cross(t, g)), vec_unit(t), g};
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
    check_faults(name_, {interface_.par.faults, interface_.par.n_faults}, channels, false);
}

void ControlMomentGyrosModel::add_hidden_inertia(Mat3 &inertia) const
{
    for (std::size_t i = 0; i < n_; i++) {
        add(inertia, interface_.par.J[i], axes(i, interface_.par.angle[i]).s);
        add(inertia, interface_.par.J_g[i], zero_[i].g);
    }
}

ControlMomentGyrosModel::Axes ControlMomentGyrosModel::axes(std::size_t i, double angle) const
{
    double sine, cosine;
    fm_sincos(angle, &sine, &cosine);
    const auto &[s, t, g] = zero_[i];
    return {vec_add(vec_scale(cosine, s), vec_scale(sine, t)), vec_sub(vec_scale(cosine, t), vec_scale(sine, s)), g};
}

ControlMomentGyrosModel::Gyro ControlMomentGyrosModel::gyro(std::size_t i, const double *x, const Axes &axes,
                                                            const Vec3 &omega) const
{
    const auto &par = interface_.par;
    Gyro now{x[i],
             x[padded_ + i],
             x[2 * padded_ + i],
             vec_dot(axes.s, omega),
             vec_dot(axes.t, omega),
             vec_dot(axes.g, omega),
             0.0,
             0.0};
    now.rate = now.p / par.J_g[i] - now.omega_g;
    now.gyration = (now.h + (par.J_s[i] - par.J_t[i]) * now.omega_s) * now.omega_t;
    return now;
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
    state_.faults.reset(seeded_);
    for (std::size_t i = 0; i < n_; i++) {
        const Axes at = axes(i, par.angle[i]);
        x[i] = par.J[i] * (vec_dot(at.s, omega) + par.Omega[i]);
        x[padded_ + i] = par.J_g[i] * (vec_dot(at.g, omega) + par.rate[i]);
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

bool ControlMomentGyrosModel::latch(const double *x, const BodyRate &rate, double dt)
{
    const auto &[command, rates, torques, injected] = interface_.in;
    const auto &par = interface_.par;
    const auto acts = [&](Head head) { return dt > 0.0 && head_written(head); };
    bool changed = false;
    for (std::size_t i = 0; i < n_; i++) {
        Motors &motors = state_.motors[i];
        const Motors before = motors;
        const double asked = acts(command.head) ? command.u[i] : 0.0;
        const double torque = acts(torques.head) ? torques.u[i] : 0.0;
        motors.servo = acts(rates.head);
        motors.lag = par.lag[i] > 0.0 ? par.lag[i] : dt;
        motors.wheel = limited(asked, par.u_max[i]);
        motors.gimbal =
            motors.servo != 0.0 ? limited(rates.rate[i], par.rate_max[i]) : limited(torque, par.torque_max[i]);
        if (dt > 0.0 && state_.faults.any()) {
            fail(of_wheels + i, motors.wheel, par.u_max[i]);
            fail(of_gimbals + i, motors.gimbal, motors.servo != 0.0 ? par.rate_max[i] : par.torque_max[i]);
        }
        if (motors.wheel != 0.0 || motors.gimbal != 0.0) {
            const Axes at = axes(i, x[2 * padded_ + i]);
            const Gyro now = gyro(i, x, at, rate.omega);
            const double spin_up = vec_dot(at.s, rate.domega) + now.rate * now.omega_t;
            motors.wheel = no_faster(motors.wheel, now.h / par.J[i] - now.omega_s, par.Omega_max[i], par.J[i] * spin_up,
                                     par.J[i] / dt);
            if (motors.servo == 0.0) {
                motors.gimbal = no_faster(motors.gimbal, now.rate, par.rate_max[i],
                                          par.J_g[i] * vec_dot(at.g, rate.domega) - now.gyration, par.J_g[i] / dt);
            }
        }
        motors.limited = std::abs(motors.wheel - asked) > 1e-9 * std::abs(asked) ||
                         (motors.servo == 0.0 && std::abs(motors.gimbal - torque) > 1e-9 * std::abs(torque));
        changed |= before.wheel != motors.wheel || before.gimbal != motors.gimbal || before.servo != motors.servo ||
                   before.lag != motors.lag;
    }
    return changed;
}

/// [N m] of the gimbal's motor. For a rate, it also carries the gyration.
double ControlMomentGyrosModel::gimbal_torque(std::size_t i, const Gyro &gyro) const
{
    const auto &par = interface_.par;
    if (state_.motors[i].servo == 0.0) {
        return state_.motors[i].gimbal;
    }
    const double wanted = par.J_g[i] * (state_.motors[i].gimbal - gyro.rate) / state_.motors[i].lag - gyro.gyration;
    return limited(wanted, par.torque_max[i]);
}

void ControlMomentGyrosModel::couple(const double *x, const Motion &, Loads &, Whole &whole)
{
    const auto &par = interface_.par;
    for (std::size_t i = 0; i < n_; i++) {
        now_[i] = axes(i, x[2 * padded_ + i]);
        add(whole.inertia, par.J_s[i], now_[i].s);
        add(whole.inertia, par.J_t[i], now_[i].t);
    }
}

void ControlMomentGyrosModel::derive(const double *x, const Motion &motion, double *dx, Loads &loads) const
{
    const auto &par = interface_.par;
    std::fill(dx, dx + 3 * padded_, 0.0);
    for (std::size_t i = 0; i < n_; i++) {
        const auto &[s, t, g] = now_[i];
        const Gyro now = gyro(i, x, now_[i], motion.omega);
        const double u = state_.motors[i].wheel, dp = gimbal_torque(i, now) + now.gyration;
        const double turning = now.rate * (par.J_s[i] - par.J_t[i]);
        dx[i] = u;
        dx[padded_ + i] = dp;
        dx[2 * padded_ + i] = now.rate;
        loads.momentum = vec_add(loads.momentum, vec_add(vec_scale(now.h, s), vec_scale(now.p, g)));
        loads.torque = vec_sub(
            loads.torque, vec_add(vec_scale(u + turning * now.omega_t, s),
                                  vec_add(vec_scale(now.h * now.rate + turning * now.omega_s, t), vec_scale(dp, g))));
    }
}

void ControlMomentGyrosModel::publish(sim::Ns t, const double *x, const Vec3 &omega)
{
    auto &[speeds, gimbals, applied, gimbals_applied] = interface_.out;
    const auto &par = interface_.par;
    const bool faulty = state_.faults.begin(t, par.n_faults, par.faults, interface_.in.injected);
    bool saturated = false;
    bool speeds_speak = !faulty, angles_speak = !faulty;
    for (std::size_t i = 0; i < n_; i++) {
        const Gyro now = gyro(i, x, axes(i, x[2 * padded_ + i]), omega);
        speeds.Omega[i] = now.h / par.J[i] - now.omega_s;
        gimbals.angle[i] = now.angle;
        gimbals.rate[i] = now.rate;
        if (faulty) {
            const double most = par.Omega_max[i] > 0.0 ? par.Omega_max[i] : unlimited;
            speeds_speak |= state_.faults.apply(of_speeds + i, {&speeds.Omega[i], 1}, -most, most);
            angles_speak |= state_.faults.apply(of_angles + i, {&gimbals.angle[i], 1});
        }
        applied.u[i] = state_.motors[i].wheel;
        gimbals_applied.u[i] = gimbal_torque(i, now);
        saturated |= state_.motors[i].limited != 0.0;
    }
    interface_.mem.saturated += saturated;
    speeds.head = speeds_speak ? head_next(speeds.head, t, QUALITY_GOOD) : head_held(speeds.head);
    gimbals.head = angles_speak ? head_next(gimbals.head, t, QUALITY_GOOD) : head_held(gimbals.head);
    for (Head *head : {&applied.head, &gimbals_applied.head}) {
        *head = head_next(*head, t, QUALITY_GOOD);
    }
}

} // namespace fledge::world
