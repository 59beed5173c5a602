// SPDX-License-Identifier: Apache-2.0
#include "world/actuators/thrusters_model.h"

#include "flight/exec/task.h"
#include "sim/error.h"
#include "sim/text.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace fledge::world {

using sim::Ns;

namespace {

constexpr double g0 = 9.80665; // [m/s^2] by definition
using std::numbers::pi;
constexpr Ns no_time = INT64_MAX;

/// r x (a x r)
Vec3 swing(const Vec3 &r, const Vec3 &a)
{
    return vec_sub(vec_scale(vec_norm2(r), a), vec_scale(vec_dot(r, a), r));
}

} // namespace

/// x^(2/3), the same bits everywhere.
double ThrustersModel::power_two_thirds(double x)
{
    return x > 0.0 ? fm_exp(2.0 / 3.0 * fm_log(x)) : 0.0;
}

void ThrustersModel::prepare(const sim::Setup &setup)
{
    const auto &par = interface_.par;
    name_ = setup.name;
    seeded_ = sim::Random(setup.seed, setup.name);
    refresh();
    for (std::size_t i = 0; i < par.n; i++) {
        const std::string where = name_ + ".isp[" + std::to_string(i) + "]";
        if (par.isp[i] > 0.0 && par.n_tanks == 0) {
            throw sim::SetupError(where + " is " + sim::format_number(par.isp[i]) +
                                  " s, so propellant flows, but n_tanks is 0: give the tanks, or an isp of 0 where no "
                                  "mass shall flow");
        }
        if (par.isp[i] == 0.0 && par.n_tanks > 0) {
            throw sim::SetupError(where + " must be > 0 s where tanks feed the thrusters, found 0 s");
        }
    }
    shrinks_ = std::any_of(par.shape, par.shape + par.n_tanks, [](auto shape) { return shape == TANK_SHRINKS; });
    for (std::size_t j = 0; j < par.n_tanks; j++) {
        const std::string tank = "[" + std::to_string(j) + "]";
        if (par.shape[j] == TANK_SETTLES && !(par.fill[j] > 0.0 && vec_norm(par.down_B[j]) > 0.0)) {
            throw sim::SetupError(name_ + ".shape" + tank + " is TANK_SETTLES, but " +
                                  (par.fill[j] > 0.0
                                       ? "down_B" + tank + " has no length: where does the propellant settle"
                                       : "fill" + tank + " is 0: how full is the tank") +
                                  "?");
        }
    }
}

void ThrustersModel::refresh()
{
    const auto &par = interface_.par;
    check_faults(name_, {par.faults, par.n_faults}, THRUSTERS_MAX, true);
    state_.is_new = 1;
    total_ = 0.0;
    for (std::size_t j = 0; j < par.n_tanks; j++) {
        total_ += par.propellant[j];
    }
    per_total_ = 1.0 / total_;
    round_ = {};
    for (std::size_t j = 0; j < par.n_tanks; j++) {
        if (par.shape[j] == TANK_SETTLES) {
            continue;
        }
        const double m = par.propellant[j], share = m / total_, R2 = par.radius[j] * par.radius[j];
        const Vec3 &r = par.r_KB_B[j], moment = vec_scale(m, r), source = vec_scale(share, r);
        round_.mass[0] += m;
        for (int i = 0; i < 3; i++) {
            round_.mass[i + 1] += moment.v[i];
            round_.source[i] += source.v[i];
        }
        round_.inertia.add_spread(m, r);
        round_.leaving.add_spread(share, r);
        const bool shrinks = par.shape[j] == TANK_SHRINKS;
        round_.ball[shrinks] += 0.4 * m * R2;
        round_.ball_leaving[shrinks] += (shrinks ? 2.0 / 3.0 : 0.4) * share * R2;
    }
}

bool ThrustersModel::mounted() const
{
    const auto &par = interface_.par;
    return std::any_of(par.panel, par.panel + par.n, [](std::uint32_t panel) { return panel > 0; });
}

void ThrustersModel::start(const Vec3 &, double *)
{
    for (std::size_t i = 0; i < interface_.par.n; i++) {
        HingedPanelsModel::check_mount(panels_, name_, i, interface_.par.panel[i]);
    }
    state_ = {};
    state_.is_new = 1;
    state_.dry = no_time;
    state_.faults.reset(seeded_);
    interface_.out = {};
    interface_.mem = {};
}

bool ThrustersModel::latch(const double *, const BodyRate &, double dt)
{
    const auto &[times, valves, injected, power] = interface_.in;
    const bool timed = head_written(times.head), switched = dt > 0.0 && head_written(valves.head);
    const std::uint32_t has_power = supplied(&power, interface_.par.load) ? 1 : 0;
    bool same = has_power == state_.has_power;
    state_.has_power = has_power;
    for (std::size_t i = 0; i < interface_.par.n; i++) {
        Valve &valve = state_.valves[i];
        const Ns on = timed ? times.on[i] : 0, off = timed ? times.off[i] : 0;
        const std::uint32_t is_switched = switched && valves.open[i] != 0;
        valve.is_new = on != valve.on;
        same &= on == valve.on && off == valve.off && is_switched == valve.is_switched;
        valve.is_switched = is_switched;
        valve.on = on;
        valve.off = off;
    }
    state_.is_new |= !same;
    return false;
}

/// [kg/s] that flows for each newton.
double ThrustersModel::per_thrust(std::size_t i) const
{
    return total_ > 0.0 ? 1.0 / (interface_.par.isp[i] * g0) : 0.0;
}

double ThrustersModel::level(const Valve &valve, Ns t) const
{
    return t >= valve.arrives ? valve.goal : valve.level + valve.slope * since(t);
}

bool ThrustersModel::stretch(Ns t, Ns &end)
{
    const auto &par = interface_.par;
    const bool faulty = state_.faults.begin(t, par.n_faults, par.faults, interface_.in.injected);
    bool changed = false;
    if (faulty || state_.is_new || t >= state_.next || t == state_.dry) {
        changed = begin(t, faulty);
    } else if (shrinks_ && state_.begun - left(since(t)) > 5e-5 * state_.begun) {
        move(t); // so that its series stays short
    }
    end = std::min(end, state_.next);
    state_.dry = no_time;
    const double rest = total_ - state_.used;
    if (state_.acts && total_ > 0.0 && burnt(since(end)) >= rest) {
        const double flow = state_.flow.at;
        const double tau = 2.0 * rest / (flow + std::sqrt(flow * flow + 2.0 * state_.flow.rate * rest));
        end = state_.dry = std::clamp<Ns>(exec_later(state_.begin, static_cast<Ns>(std::ceil(tau * 1e9))), t + 1, end);
    }
    return changed;
}

/// A stretch begins: find what each valve does, and when one changes next. Returns whether a thrust jumps or bends.
bool ThrustersModel::begin(Ns t, bool faulty)
{
    const auto &par = interface_.par;
    move(t);
    state_.next = no_time;
    for (std::size_t k = 0; faulty && k < par.n_faults; k++) {
        for (const Ns edge : {par.faults[k].begin, exec_later(par.faults[k].begin, par.faults[k].lasts)}) {
            state_.next = edge > t ? std::min(state_.next, edge) : state_.next;
        }
    }
    bool changed = false;
    for (std::size_t i = 0; i < par.n; i++) {
        changed |= command(i, t, state_.next);
    }
    if (changed) {
        take_loads();
    }
    state_.is_new = faulty; // one that ends may have come with a message
    return changed;
}

/// Let the stretch begin at t instead.
void ThrustersModel::move(Ns t)
{
    const double tau = since(t);
    state_.used += burnt(tau);
    for (std::size_t i = 0; i < interface_.par.n; i++) {
        Valve &valve = state_.valves[i];
        valve.impulse += interface_.par.F[i] * tau * (valve.level + 0.5 * tau * valve.slope);
        valve.level = level(valve, t);
    }
    for (LinearVector *linear : {&state_.force, &state_.torque, &state_.moment}) {
        linear->at = linear->after(tau);
    }
    for (int i = 0; i < 3; i++) {
        state_.spread.along[i] += tau * state_.spread_rate.along[i];
        state_.spread.across[i] += tau * state_.spread_rate.across[i];
    }
    state_.flow.at = state_.flow.after(tau);
    if (t == state_.dry) {
        state_.used = total_;
        state_.empty = 1;
    }
    state_.begin = t;
    if (shrinks_) {
        state_.begun = left(0.0);
        state_.per_begun = 1.0 / state_.begun; // infinite where nothing is left
        state_.begun_two_thirds = power_two_thirds(state_.begun);
    }
}

/// What a valve does from t on, and until when at most; whether its thrust jumps or bends.
bool ThrustersModel::command(std::size_t i, Ns t, Ns &end)
{
    Valve &valve = state_.valves[i];
    const auto &par = interface_.par;
    const double level = valve.level, slope = valve.slope;
    const auto no_later = [&](Ns edge) { end = edge > t ? std::min(end, edge) : end; };
    if (valve.is_new) {
        valve.late = std::max<Ns>(tick_since(t, valve.on), 0);
        valve.is_new = 0;
    }
    const Ns on = exec_later(valve.on, valve.late), off = exec_later(valve.off, valve.late);
    const bool wanted = valve.is_switched || (on <= t && t < off);
    if (on < off) {
        no_later(on);
        no_later(off);
    }
    if (wanted && !valve.open) {
        valve.open = 1;
        valve.opened = t;
        interface_.mem.burns[i]++;
    } else if (!wanted && valve.open) {
        const Ns shuts = exec_later(valve.opened, par.min_on);
        valve.open = t < shuts;
        no_later(shuts);
    }
    double goal = valve.open ? par.F[i] : 0.0;
    state_.faults.apply(i, {&goal, 1}, 0.0, par.F[i]);
    valve.goal = state_.empty || !state_.has_power ? 0.0 : std::clamp(goal / par.F[i], 0.0, 1.0);
    const Ns ramp = valve.goal > valve.level ? par.rise[i] : par.fall[i];
    const Ns takes = std::llround(std::abs(valve.goal - valve.level) * static_cast<double>(ramp));
    if (takes == 0 || state_.empty) {
        valve.level = valve.goal;
        valve.slope = 0.0;
        valve.arrives = t;
    } else {
        valve.slope = (valve.goal - valve.level) / tick_seconds(takes);
        valve.arrives = exec_later(t, takes);
        no_later(valve.arrives);
    }
    return valve.level != level || valve.slope != slope;
}

void ThrustersModel::take_loads()
{
    const auto &par = interface_.par;
    state_.force = state_.torque = state_.moment = {};
    state_.spread = state_.spread_rate = {};
    state_.flow = {};
    state_.acts = 0;
    for (std::size_t i = 0; i < par.n; i++) {
        if (!is_on(i)) {
            continue;
        }
        const Valve &valve = state_.valves[i];
        const double flow = par.F[i] * per_thrust(i);
        state_.flow.at += valve.level * flow;
        state_.flow.rate += valve.slope * flow;
        state_.acts = 1;
        if (par.panel[i] > 0) {
            continue;
        }
        const Vec3 force = vec_scale(par.F[i], vec_unit(par.axes_B[i]));
        state_.force.add(valve.level, valve.slope, force);
        state_.torque.add(valve.level, valve.slope, vec_cross(par.r_TB_B[i], force));
        state_.moment.add(valve.level, valve.slope, vec_scale(flow, par.r_TB_B[i]));
        state_.spread.add_spread(valve.level * flow, par.r_TB_B[i]);
        state_.spread_rate.add_spread(valve.slope * flow, par.r_TB_B[i]);
    }
}

void ThrustersModel::couple(const double *, const Motion &motion, Loads &, Whole &whole)
{
    const auto &par = interface_.par;
    const double tau = since(motion.start) + motion.tau;
    if (panels_) {
        riding_ = {};
        for (std::size_t i = 0; i < par.n; i++) {
            if (par.panel[i] > 0 && is_on(i)) {
                ride(i, tau, motion.omega, whole);
            }
        }
    }
    if (par.n_tanks > 0) {
        sim::in_registers<&ThrustersModel::fill>(*this, tau, whole);
    }
}

/// Add the tanks.
LANES_INLINE void ThrustersModel::fill(double tau, Whole &whole)
{
    hold(tau, content_);
    add_at(&whole.mass, content_.mass);
    content_.inertia.add_to(whole.inertia);
}

/// What a thruster on a panel does, with its propellant.
void ThrustersModel::ride(std::size_t i, double tau, const Vec3 &omega, Whole &whole)
{
    const auto &par = interface_.par;
    const Valve &valve = state_.valves[i];
    const std::size_t panel = par.panel[i] - 1;
    const HingedPanelsModel::Hinge hinge = panels_->hinge(panel);
    const double thrust = par.F[i] * (valve.level + tau * valve.slope), flow = thrust * per_thrust(i);
    const Vec3 arm = hinge.turned(vec_sub(par.r_TB_B[i], hinge.at)), r = vec_add(hinge.at, arm);
    const Vec3 force = vec_scale(thrust, hinge.turned(vec_unit(par.axes_B[i])));
    const Vec3 by_angle = vec_cross(hinge.axis, arm), drag = vec_scale(flow * hinge.rate, by_angle);
    const Vec3 rate = vec_add(omega, vec_scale(hinge.rate, hinge.axis));
    panels_->drive(panel, vec_dot(by_angle, vec_sub(force, vec_scale(flow, vec_cross(rate, arm)))), whole);
    riding_.force = vec_add(riding_.force, vec_sub(force, vec_scale(2.0, drag)));
    riding_.torque = vec_add(riding_.torque, vec_sub(vec_cross(r, force), vec_cross(vec_add(r, hinge.at), drag)));
    riding_.torque = vec_sub(riding_.torque, vec_scale(flow, swing(r, omega)));
    riding_.moment = vec_add(riding_.moment, vec_scale(flow, r));
    riding_.crossing = vec_add(riding_.crossing, vec_scale(flow, hinge.at));
    riding_.angular = vec_add(riding_.angular, vec_scale(flow, vec_cross(hinge.at, r)));
}

/// A tank with a liquid on one side, of which this part of the propellant is left.
ThrustersModel::Fuel ThrustersModel::settled(std::size_t j, double part) const
{
    const auto &par = interface_.par;
    const double m = part * par.propellant[j], R = par.radius[j];
    const Vec3 &r = par.r_KB_B[j];
    // A segment of a sphere of radius 1, from its surface at z to its pole at 1 on the side of `down`; its volume is
    // pi / 3 (1 - z)^2 (2 + z) = 4 pi / 3 v, a cubic equation with the solution z = -2 cos(phi).
    const double v = part * par.fill[j];
    const double phi = (2.0 * pi - fm_acos(1.0 - 2.0 * v)) / 3.0;
    const double z = std::clamp(-2.0 * fm_cos(phi), -1.0, 1.0), d = 1.0 - z;
    const double center = 0.75 * (1.0 + z) * (1.0 + z) / (2.0 + z);
    // Integrals over the segment of (1 - z^2)^2 and of z^2 (1 - z^2), per (1 - z)^2 (2 + z) / 3.
    const double axial = 0.1 * d * (8.0 + 9.0 * z + 3.0 * z * z) / (2.0 + z);
    const double depth = 0.2 * (2.0 + 4.0 * z + 6.0 * z * z + 3.0 * z * z * z) / (2.0 + z);
    const double R2 = R * R, disc = R2 * (1.0 - z * z);
    const Vec3 down = vec_unit(par.down_B[j]);
    const auto along = [&](double x) { return vec_add(r, vec_scale(R * x, down)); };
    return {m,          R2 * axial, R2 * (0.5 * axial + depth - center * center), along(center), along(z), down,
            0.5 * disc, 0.25 * disc};
}

void ThrustersModel::derive(const double *, const Motion &motion, double *, Loads &loads) const
{
    if (state_.acts) {
        sim::in_registers<&ThrustersModel::push>(*this, motion, loads);
    }
}

LANES_INLINE void ThrustersModel::push(const Motion &motion, Loads &loads) const
{
    Thrust now;
    thrust<true>(since(motion.start) + motion.tau, quad(motion.omega), content_, now);
    loads.mass_rate -= now.flow;
    put(loads.moment_rate, quad(loads.moment_rate) - now.taken);
    put(loads.force_B, quad(loads.force_B) + now.force);
    put(loads.torque, quad(loads.torque) + now.torque - cross(quad(motion.r_CB_B), now.force));
}

void ThrustersModel::publish(Ns t, const double *, const Vec3 &)
{
    const auto &par = interface_.par;
    auto &[output, tanks] = interface_.out;
    const double tau = since(t);
    const bool empty = state_.empty || t == state_.dry;
    const Quality quality = empty ? QUALITY_DEGRADED : QUALITY_GOOD;
    for (std::size_t i = 0; i < par.n; i++) {
        const Valve &valve = state_.valves[i];
        output.thrust[i] = empty ? 0.0 : par.F[i] * level(valve, t);
        output.impulse[i] = valve.impulse + par.F[i] * tau * (valve.level + 0.5 * tau * valve.slope);
    }
    output.flow = empty ? 0.0 : state_.flow.after(tau);
    output.used = empty ? total_ : state_.used + burnt(tau);
    output.head = head_next(output.head, t, quality);
    for (std::size_t j = 0; j < par.n_tanks; j++) {
        tanks.mass[j] = empty ? 0.0 : left(tau) * par.propellant[j];
    }
    tanks.head = head_next(tanks.head, t, quality);
}

void ThrustersModel::copy_setup(const sim::Model &original,
                                const std::function<sim::Model *(const sim::Model *)> &counterpart)
{
    const auto *carrier = dynamic_cast<const ThrustersModel &>(original).panels_;
    panels_ = carrier ? dynamic_cast<HingedPanelsModel *>(counterpart(carrier)) : nullptr;
}

} // namespace fledge::world
