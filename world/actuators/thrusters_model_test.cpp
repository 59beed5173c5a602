// SPDX-License-Identifier: Apache-2.0
// Thrusters and tanks: closed forms of pulses, of the rocket equation and of jet damping; the balance of momentum.
#include "world/actuators/thrusters_model.h"

#include "sim/error.h"
#include "world/avionics/propulsion_card_model.h"
#include "world/testing/bodies.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <random>
#include <vector>

namespace thrusters_model_test {

using namespace fledge;
using namespace fledge::world;
using namespace fledge::world::testing;

constexpr double g0 = 9.80665;
const Vector3d origin = Vector3d::Zero();

double seconds(Ns t)
{
    return 1e-9 * static_cast<double>(t);
}

struct Craft : Assembly {
    Thrusters i{};
    ThrustersModel model{i};

    Craft()
    {
        craft_interface.par.mass = 100.0;
        set_inertia(Vector3d(50.0, 60.0, 80.0).asDiagonal());
    }
    std::size_t add_thruster(const Vector3d &r, const Vector3d &axis, double F, double isp = 0.0)
    {
        const std::size_t k = i.par.n++;
        i.par.r_TB_B[k] = vec(r);
        i.par.axes_B[k] = vec(axis);
        i.par.F[k] = F;
        i.par.isp[k] = isp;
        return k;
    }
    std::size_t add_tank(const Vector3d &r, double mass, double radius = 0.0, TankShape shape = TANK_FILLED)
    {
        const std::size_t k = i.par.n_tanks++;
        i.par.r_KB_B[k] = vec(r);
        i.par.propellant[k] = mass;
        i.par.radius[k] = radius;
        i.par.shape[k] = shape;
        return k;
    }
    Matrix3d dcm_of_start() const
    {
        const Mat3 dcm = mrp_to_dcm(craft_interface.par.sigma_BN);
        return view(dcm);
    }
    void prepare()
    {
        model.prepare({"world.thrusters", 1, method.get()});
        craft.attach(model);
        prepare_all();
    }
    void burn(std::size_t k, Ns on, Ns off)
    {
        i.in.times.head.quality = QUALITY_GOOD;
        i.in.times.on[k] = on;
        i.in.times.off[k] = off;
    }
    void open(std::size_t k, bool on)
    {
        i.in.valves.head.quality = QUALITY_GOOD;
        i.in.valves.open[k] = on;
    }
    void mount(std::size_t k, std::size_t panel)
    {
        i.par.panel[k] = static_cast<std::uint32_t>(panel + 1);
        model.set_source(panels);
    }
    /// Where a thruster is and how it moves in B, its axis, and the hinge of its panel; all of B.
    struct Nozzle {
        Vector3d r, velocity, axis, hinge;
    };
    Nozzle nozzle(std::size_t k) const
    {
        const Vector3d r = view(i.par.r_TB_B[k]), axis = view(i.par.axes_B[k]).normalized();
        if (i.par.panel[k] == 0) {
            return {r, origin, axis, origin};
        }
        const std::size_t panel = i.par.panel[k] - 1;
        const auto &angles = panel_interface.out.angles;
        const Vector3d g = view(panel_interface.par.axes_B[panel]).normalized();
        const Vector3d hinge = view(panel_interface.par.hinge_B[panel]);
        const Matrix3d R = rotation(angles.theta[panel] * g);
        const Vector3d arm = R * (r - hinge);
        return {hinge + arm, angles.dtheta[panel] * g.cross(arm), R * axis, hinge};
    }
    double impulse(std::size_t k = 0) const { return i.out.output.impulse[k]; }
    double thrust(std::size_t k = 0) const { return i.out.output.thrust[k]; }
};

/// The impulse of a pulse of duration d [s].
double closed_form(double F, double d, double rise, double fall)
{
    const double top = d < rise ? d / rise : 1.0;
    return F * (top * (d - 0.5 * std::min(d, rise)) + 0.5 * top * top * fall);
}

TEST(Thrusters, APulseHasTheImpulseOfItsClosedForm)
{
    std::mt19937 random(1);
    const auto any = [&](Ns most) { return static_cast<Ns>(random()) % most + 1; };
    for (int k = 0; k < 200; k++) {
        Craft c;
        if (k % 3 == 0) {
            c.method = sim::make_adaptive(1e-12, 1e-9);
        }
        c.add_thruster(origin, {0, 3, 4}, 1.0 + 0.1 * k);
        c.i.par.rise[0] = k % 5 == 0 ? 0 : any(50 * ms);
        c.i.par.fall[0] = k % 7 == 0 ? 0 : any(50 * ms);
        c.prepare();
        const Ns d = any(300 * ms), on = any(second);
        c.burn(0, on, on + d);
        c.fly(2 * second, k % 2 ? 100 * ms : 2 * second);
        const double J = closed_form(c.i.par.F[0], seconds(d), seconds(c.i.par.rise[0]), seconds(c.i.par.fall[0]));
        ASSERT_NEAR(c.impulse(), J, 1e-8 * c.i.par.F[0] * seconds(d)) << k; // ramps end at whole ns
        ASSERT_LT((c.v() - c.impulse() / 100.0 * Vector3d(0, 0.6, 0.8)).norm(), 1e-15 + 1e-12 * J) << k;
        ASSERT_EQ(c.thrust(), 0.0);
        ASSERT_EQ(c.i.mem.burns[0], 1u);
    }
}

TEST(Thrusters, ThrustRisesAndFallsLinearly)
{
    Craft c;
    c.add_thruster(origin, {1, 0, 0}, 10.0);
    c.i.par.rise[0] = 400 * ms;
    c.i.par.fall[0] = 200 * ms;
    c.prepare();
    c.burn(0, 150 * ms, 1050 * ms);
    double v = 0.0;
    c.fly(2 * second, 100 * ms, [&] {
        const double t = seconds(c.t);
        const double up = std::clamp((t - 0.15) / 0.4, 0.0, 1.0), down = std::clamp((t - 1.05) / 0.2, 0.0, 1.0);
        ASSERT_NEAR(c.thrust(), 10.0 * std::min(up, 1.0 - down), 1e-9) << t;
        ASSERT_NEAR(c.state().a_BN_N.v[0], c.thrust() / 100.0, 1e-11);
        ASSERT_GE(c.v()[0], v);
        v = c.v()[0];
    });
}

TEST(Thrusters, AValveStaysOpenForItsShortestTime)
{
    for (const bool switched : {false, true}) {
        Craft c;
        c.add_thruster(origin, {1, 0, 0}, 10.0);
        c.i.par.min_on = 250 * ms;
        c.prepare();
        const auto open = [&](Ns on, Ns off) {
            for (c.t = on - 100 * ms; c.t < off;) {
                switched ? c.open(0, c.t >= on) : c.burn(0, on, off);
                c.step(100 * ms);
            }
            c.open(0, false);
            c.fly(second, 100 * ms);
            return c.impulse();
        };
        EXPECT_NEAR(open(second, 1100 * ms), 2.5, 1e-12);
        EXPECT_NEAR(open(3 * second, 3400 * ms), 6.5, 1e-12);
        EXPECT_EQ(c.i.mem.burns[0], 2u);
    }
}

TEST(Thrusters, ABurnThatComesLateKeepsItsDuration)
{
    Craft c;
    c.add_thruster(origin, {1, 0, 0}, 10.0);
    c.add_thruster(origin, {1, 0, 0}, 10.0);
    c.burn(0, -200 * ms, -100 * ms); // over before the start
    c.burn(1, -200 * ms, 150 * ms);
    c.prepare();
    c.fly(500 * ms, 100 * ms);
    EXPECT_EQ(c.impulse(0), 0.0);
    EXPECT_NEAR(c.impulse(1), 1.5, 1e-12) << "the rest of it";
    c.burn(0, 430 * ms, 460 * ms);
    c.fly(100 * ms, 100 * ms);
    EXPECT_NEAR(c.impulse(), 0.3, 1e-12);
    c.burn(0, 430 * ms, 640 * ms); // it opens again, as late as it did
    c.fly(500 * ms, 100 * ms);
    EXPECT_NEAR(c.impulse(), 0.3 + 10.0 * (0.640 + 0.07 - 0.6), 1e-12);
}

TEST(Thrusters, ThroughAPropulsionCardTheyFlyTheSameBits)
{
    // Pulses that begin at their commands, some of which go on, and that the card hands over before the step.
    std::mt19937 random(2);
    Craft with, without;
    PropulsionCard card{};
    PropulsionCardModel model(card);
    card.par.n = 1;
    card.in.command.armed = 1;
    card.in.command.head.quality = QUALITY_GOOD;
    model.prepare({"world.card", 1, nullptr});
    model.reset(0);
    for (Craft *c : {&with, &without}) {
        c->add_thruster({0, 0.5, 0}, {1, 0, 0}, 10.0, 220.0);
        c->add_tank({0, 0, -0.2}, 20.0);
        c->i.par.rise[0] = c->i.par.fall[0] = 5 * ms;
        c->prepare();
    }
    Ns on = 0, off = 0;
    for (int k = 0; k < 400; k++) {
        if (k % 3 == 0) {
            const Ns w = static_cast<Ns>(random() % 301) * ms;
            on = off == with.t ? on : with.t;
            off = with.t + w;
            without.burn(0, on, off);
            card.in.command.number++;
            card.in.command.start[0] = on;
            card.in.command.duration[0] = off - on;
        }
        model.update({with.t + 100 * ms, 100 * ms});
        with.i.in.times = card.out.thrusters;
        card.in.thrust = with.i.out.output;
        with.step(100 * ms);
        without.step(100 * ms);
        ASSERT_EQ(std::memcmp(&with.craft_interface.out.state, &without.craft_interface.out.state, sizeof(CraftState)),
                  0)
            << k;
    }
    EXPECT_EQ(card.out.state.refused, 0u);
    EXPECT_GT(with.impulse(), 100.0);
}

TEST(Thrusters, AForceBesideTheCentreTurnsTheBody)
{
    Craft c;
    c.craft_interface.par.center_B = vec3(0.1, -0.2, 0.3);
    c.add_thruster({0.1, 0.8, 0.3}, {-2, 0, 0}, 5.0);
    c.prepare();
    c.open(0, true);
    c.fly(100 * ms, 100 * ms);
    EXPECT_NEAR(c.omega()[2], 5.0 * 1.0 / 80.0 * 0.1, 1e-15);
    EXPECT_EQ(c.omega()[0], 0.0);
    EXPECT_NEAR(c.state().domega_BN_B.v[2], 5.0 / 80.0, 1e-15);
}

// ---- Tanks --------------------------------------------------------------------------------------

TEST(Thrusters, TheRocketEquationHolds)
{
    for (const bool adaptive : {false, true}) {
        Craft c;
        if (adaptive) {
            c.method = sim::make_adaptive(1e-12, 1e-12);
        }
        c.add_thruster({0, 0, -1}, {0, 0, 1}, 20.0, 220.0);
        c.add_thruster({0, 0, -1}, {0, 0, 1}, 30.0, 300.0);
        c.add_tank({0, 0, 0.4}, 30.0, 0.3, TANK_SHRINKS);
        c.add_tank({0, 0, -0.2}, 10.0, 0.2);
        c.prepare();
        c.open(0, true);
        c.open(1, true);
        const double flow = 20.0 / (220.0 * g0) + 30.0 / (300.0 * g0), velocity = 50.0 / flow;
        c.fly(2100 * second, second, [&] {
            const double used = std::min(flow * seconds(c.t), 40.0);
            ASSERT_NEAR(c.i.out.output.used, used, 1e-9);
            ASSERT_NEAR(c.i.out.tanks.mass[0], 30.0 * (1.0 - used / 40.0), 1e-9);
            ASSERT_NEAR(c.v()[2], velocity * std::log(140.0 / (140.0 - used)), 1e-7) << seconds(c.t);
            ASSERT_EQ(c.i.out.tanks.head.quality == QUALITY_DEGRADED, used == 40.0);
            ASSERT_EQ(c.i.out.output.head.quality == QUALITY_DEGRADED, used == 40.0);
        });
        EXPECT_EQ(c.i.out.output.used, 40.0);
        EXPECT_EQ(c.thrust(), 0.0) << "the tanks are empty";
        EXPECT_EQ(c.i.out.tanks.mass[1], 0.0);
        EXPECT_NEAR(c.impulse(0) + c.impulse(1), 50.0 * 40.0 / flow, 1e-6);
    }
}

/// A spinning craft with everything off its axes.
void make_skew(Craft &c, const Vector3d &shift = Vector3d::Zero())
{
    const auto at = [&](double x, double y, double z) { return Vector3d(Vector3d(x, y, z) + shift); };
    c.method = sim::make_adaptive(1e-13, 1e-13);
    c.craft_interface.par.center_B = vec(at(0.05, -0.02, 0.1));
    c.craft_interface.par.omega_BN_B = vec3(0.2, -0.3, 0.25);
    c.craft_interface.par.sigma_BN = vec3(0.1, 0.3, -0.2);
    c.craft_interface.par.r_BN_N = vec(-c.dcm_of_start().transpose() * shift);
    const Vector3d v = Vector3d(0.2, -0.3, 0.25).cross(-shift);
    c.craft_interface.par.v_BN_N = vec(Vector3d(1, 2, 3) + c.dcm_of_start().transpose() * v);
    c.add_thruster(at(1.0, 0.3, -0.5), {0, -1, 2}, 40.0, 60.0); // a poor nozzle, so that much mass flows
    c.add_thruster(at(-0.7, 0.4, -0.6), {0.5, 1, 2}, 30.0, 40.0);
    c.add_tank(at(0.5, -0.3, 0.4), 30.0, 0.3, TANK_SHRINKS);
    c.add_tank(at(-0.4, 0.6, -0.2), 20.0, 0.25);
}

/// Panels, sloshing fuel and wheels.
void add_moving_masses(Craft &c)
{
    const Matrix3d I = Vector3d(0.5, 0.1, 0.45).asDiagonal();
    const std::size_t panel = c.add_panel(6.0, I, {0.5, 0.2, 0.1}, {0, 1, 0.2}, {0.8, 0, 0});
    c.panel_interface.par.stiffness[panel] = 20.0;
    c.panel_interface.par.damping[panel] = 1.0;
    const std::size_t particle = c.add_particle(8.0, {-0.3, 0.4, 0.2}, {1, 1, 0}, 30.0);
    c.slosh_interface.par.damping[particle] = 2.0;
    c.add_pendulum(5.0, 0.4, {0.1, 0.3, -0.5}, {0, 0, -1});
    c.add_pyramid(0.1);
    c.wheel_interface.par.Omega[1] = 50.0;
}

/// A liquid that settles in a sphere of radius R, in thin slices: its surface, centre and inertia about that.
struct Settled {
    double surface, center, axial = 0.0, across = 0.0;

    Settled(double v, double m, double R)
    {
        const auto volume = [](double z) { return 0.25 * (1.0 - z) * (1.0 - z) * (2.0 + z); };
        double low = -1.0, high = 1.0;
        for (int k = 0; k < 60; k++) {
            (volume(0.5 * (low + high)) > v ? low : high) = 0.5 * (low + high);
        }
        double mass = 0.0, moment = 0.0;
        const int slices = 4000;
        for (int k = 0; k < slices; k++) {
            const double z = low + (k + 0.5) * (1.0 - low) / slices, r2 = 1.0 - z * z;
            mass += r2;
            moment += r2 * z;
            axial += 0.5 * r2 * r2;
            across += 0.25 * r2 * r2 + r2 * z * z;
        }
        surface = R * low;
        center = R * moment / mass;
        axial *= m * R * R / mass;
        across = across * m * R * R / mass - m * center * center;
    }
};

TEST(Thrusters, MomentumIsThatOfWhatHasLeft)
{
    const Vector3d down = Vector3d(0.3, -0.4, -0.8).normalized();
    for (const int variant : {0, 1, 2, 3}) {
        const bool moving = variant == 1 || variant == 3, settled = variant == 2;
        Craft c;
        make_skew(c);
        if (moving) {
            add_moving_masses(c);
        }
        if (variant == 3) {
            c.mount(1, 0);
            c.panel_interface.par.dtheta[0] = 0.8;
        }
        if (settled) {
            c.i.par.shape[1] = TANK_SETTLES;
            c.i.par.fill[1] = 0.7;
            c.i.par.down_B[1] = vec(3.0 * down);
            c.i.par.radius[1] = 0.5;
        }
        c.prepare();
        c.open(0, true);
        c.open(1, true);
        const auto &par = c.i.par;
        struct Rates {
            Vector3d momentum, angular, lost, lost_angular;
        };
        const auto now = [&] {
            const Matrix3d NB = c.dcm_BN().transpose();
            const Vector3d omega = c.omega(), r_N = view(c.state().r_BN_N), v_N = view(c.state().v_BN_N);
            const double part = c.i.out.tanks.mass[0] / par.propellant[0];
            Sums all = c.sums();
            Vector3d source = Vector3d::Zero();
            for (std::size_t j = 0; j < 2; j++) {
                Vector3d r = view(par.r_KB_B[j]);
                const double m = c.i.out.tanks.mass[j], R = par.radius[j];
                if (settled && j == 1) {
                    const Settled fuel(0.7 * part, m, R);
                    source += par.propellant[j] / 50.0 * (r + fuel.surface * down);
                    r += fuel.center * down;
                    const Matrix3d I =
                        fuel.across * Matrix3d::Identity() + (fuel.axial - fuel.across) * down * down.transpose();
                    all.add(m, r_N + NB * r, v_N + NB * omega.cross(r), NB * omega, NB * I * NB.transpose());
                    continue;
                }
                const double J = 0.4 * m * R * R * (j ? 1.0 : std::cbrt(part * part));
                all.add(m, r_N + NB * r, v_N + NB * omega.cross(r), NB * omega, J * Matrix3d::Identity());
                source += par.propellant[j] / 50.0 * r;
            }
            Rates rates{all.linear, all.angular, origin, origin};
            for (std::size_t k = 0; k < 2; k++) {
                const auto [r, velocity, axis, hinge] = c.nozzle(k);
                const double mu = par.F[k] / (par.isp[k] * g0);
                // What flows straight from the tanks to the nozzle, or to a hinge and on, has a momentum that turns
                // with the body and changes with the hinge's angle.
                const Vector3d via = par.panel[k] ? hinge : r;
                const Vector3d flow = mu * (r - source), turned = NB * (omega.cross(flow) + mu * velocity);
                const Vector3d angular = mu * (source.cross(via) + via.cross(r));
                rates.lost += turned;
                rates.lost_angular +=
                    NB * (omega.cross(angular) + mu * via.cross(velocity)) + v_N.cross(NB * flow) + r_N.cross(turned);
                const Vector3d v_out = v_N + NB * (omega.cross(r) + velocity - par.isp[k] * g0 * axis);
                rates.lost += mu * v_out;
                rates.lost_angular += mu * (r_N + NB * r).cross(v_out);
            }
            return rates;
        };
        c.fly(100 * ms, 100 * ms); // valves open
        const Rates first = now();
        Vector3d lost = Vector3d::Zero(), lost_angular = lost;
        for (int k = 0; k < 500; k++) { // Simpson's rule
            const Rates a = now();
            c.step(10 * ms);
            const Rates b = now();
            c.step(10 * ms);
            const Rates d = now();
            lost += 0.01 / 3.0 * (a.lost + 4.0 * b.lost + d.lost);
            lost_angular += 0.01 / 3.0 * (a.lost_angular + 4.0 * b.lost_angular + d.lost_angular);
        }
        const Rates last = now();
        EXPECT_GT(lost.norm(), 100.0);
        EXPECT_GT(c.i.out.output.used, 1.0);
        EXPECT_LT((last.momentum + lost - first.momentum).norm(), 1e-7 * lost.norm()) << variant;
        EXPECT_LT((last.angular + lost_angular - first.angular).norm(), 1e-7 * lost_angular.norm()) << variant;
    }
}

// ---- On a panel ---------------------------------------------------------------------------------

TEST(Thrusters, OnAPanelOneGivesTheWorkAndTheMomentumOfItsForce)
{
    Craft c;
    c.method = sim::make_adaptive(1e-13, 1e-13);
    c.craft_interface.par.center_B = vec3(0.05, -0.02, 0.1);
    c.craft_interface.par.omega_BN_B = vec3(0.1, -0.2, 0.15);
    add_moving_masses(c);
    c.panel_interface.par.damping[0] = c.slosh_interface.par.damping[0] = 0.0;
    c.panel_interface.par.stiffness[0] = 2.0;
    c.add_panel(4.0, Vector3d(0.2, 0.3, 0.4).asDiagonal(), {-0.5, 0, 0.2}, {1, 0.3, 0}, {0, 0.6, 0.1});
    c.add_thruster({1.5, 0.3, 0.4}, {0.3, -1, 2}, 3.0);
    c.add_thruster({-0.7, 1.0, 0.6}, {0.5, 1, -2}, 2.0);
    c.add_thruster({-0.7, 0.4, -0.6}, {0, 1, 0.2}, 1.5);
    c.mount(0, 0);
    c.mount(1, 1);
    c.prepare();
    for (const std::size_t k : {0, 1, 2}) {
        c.open(k, true);
    }
    double work = 0.0;
    Vector3d linear = Vector3d::Zero(), angular = linear;
    const auto add = [&](double weight) {
        const Matrix3d NB = c.dcm_BN().transpose();
        for (std::size_t k = 0; k < 3; k++) {
            const Craft::Nozzle at = c.nozzle(k);
            const Vector3d force = NB * at.axis * c.i.par.F[k];
            const Vector3d v = view(c.state().v_BN_N) + NB * (c.omega().cross(at.r) + at.velocity);
            work += weight * force.dot(v);
            linear += weight * force;
            angular += weight * (view(c.state().r_BN_N) + NB * at.r).cross(force);
        }
    };
    const Sums first = c.sums();
    for (int k = 0; k < 500; k++) { // Simpson's rule
        add(0.01 / 3.0);
        c.step(10 * ms);
        add(0.04 / 3.0);
        c.step(10 * ms);
        add(0.01 / 3.0);
    }
    const Sums last = c.sums();
    EXPECT_GT(work, 10.0);
    EXPECT_GT(std::abs(c.panel_interface.out.angles.theta[0]), 0.1);
    EXPECT_GT(std::abs(c.panel_interface.out.angles.theta[1]), 1.0);
    EXPECT_NEAR(last.energy() - first.energy(), work, 1e-7 * work);
    EXPECT_LT((last.linear - first.linear - linear).norm(), 1e-7 * linear.norm());
    EXPECT_LT((last.angular - first.angular - angular).norm(), 1e-7 * angular.norm());
}

TEST(Thrusters, OnAPanelOfAHeavyHubOneTurnsItAsTheClosedFormSays)
{
    // J d2theta = F l - mu l^2 dtheta: without propellant a parabola, with it an exponential.
    const double l = 1.6, F = 0.4, J = 2.0 * 0.8 * 0.8 + 0.5, isp = 2.0;
    for (const bool flows : {false, true}) {
        Craft c;
        c.craft_interface.par.mass = 1e9;
        c.set_inertia(1e9 * Matrix3d::Identity());
        c.add_panel(2.0, Vector3d(0.5, 0.3, 0.4).asDiagonal(), {0.3, -0.2, 0.1}, {1, 0, 0}, {0, 0, 0.8});
        c.add_thruster({0.9, -0.2, 0.1 + l}, {0, -1, 0}, F, flows ? isp : 0.0);
        c.mount(0, 0);
        if (flows) {
            c.add_tank({0.1, 0.7, 0.3}, 5.0);
        }
        c.prepare();
        c.open(0, true);
        const double rate = F / (isp * g0) * l * l / J;
        c.fly(10 * second, 10 * ms, [&] {
            const double t = seconds(c.t), up = F * l / J;
            const double theta = flows ? up / rate * (t - (1.0 - std::exp(-rate * t)) / rate) : 0.5 * up * t * t;
            ASSERT_NEAR(c.panel_interface.out.angles.theta[0], theta, 1e-7) << t;
        });
        EXPECT_GT(c.panel_interface.out.angles.theta[0], flows ? 12.0 : 15.0);
    }
}

TEST(Thrusters, AGimbalTurnsTheThrust)
{
    Craft c;
    c.add_panel(1e-6, 1e-6 * Matrix3d::Identity(), {0, 0, -1}, {1, 0, 0}, {0, 0, 0});
    c.panel_interface.par.theta[0] = 0.3;
    c.add_thruster({0, 0, -1}, {0, 0, 1}, 20.0);
    c.mount(0, 0);
    c.prepare();
    c.open(0, true);
    c.step(ms);
    EXPECT_NEAR(c.state().domega_BN_B.v[0], -20.0 * std::sin(0.3) / 50.0, 1e-6);
    EXPECT_NEAR(c.state().a_BN_N.v[1], -20.0 * std::sin(0.3) / 100.0, 1e-6);
}

TEST(Thrusters, TheMotionDoesNotDependOnTheBodysOrigin)
{
    const auto fly = [](const Vector3d &shift) {
        auto c = std::make_unique<Craft>();
        make_skew(*c, shift);
        c->i.par.rise[0] = 30 * ms;
        c->i.par.fall[1] = 40 * ms;
        c->prepare();
        c->burn(0, 330 * ms, 3 * second);
        c->burn(1, 0, 7777 * ms);
        c->fly(10 * second, second);
        return c;
    };
    const auto a = fly({0, 0, 0}), b = fly({0.5, -2.0, 1.0});
    EXPECT_LT((view(a->state().r_CN_N) - view(b->state().r_CN_N)).norm(), 1e-10);
    EXPECT_LT((view(a->state().v_CN_N) - view(b->state().v_CN_N)).norm(), 1e-11);
    EXPECT_LT((a->omega() - b->omega()).norm(), 1e-12);
    EXPECT_GT((view(a->state().r_BN_N) - view(b->state().r_BN_N)).norm(), 1.0);
}

TEST(Thrusters, AJetDampsATumbleAsTheClosedFormSays)
{
    // domega / omega = -mu (l^2 - k^2) / (I + k^2 m) dt with k^2 = 2/5 R^2: a power of the inertia.
    const double l = 1.2, R = 0.5, k2 = 0.4 * R * R, I = 60.0, flow = 50.0 / (100.0 * g0);
    Craft c;
    c.set_inertia(Vector3d(I, I, 40.0).asDiagonal());
    c.craft_interface.par.omega_BN_B = vec3(0.02, 0, 0);
    c.add_thruster({0, 0, -l}, {0, 0, 1}, 50.0, 100.0);
    c.add_tank({0, 0, 0}, 30.0, R);
    c.prepare();
    c.open(0, true);
    c.fly(500 * second, 100 * ms, [&] {
        const double m = 30.0 - flow * seconds(c.t);
        const double omega = 0.02 * std::pow((I + k2 * m) / (I + k2 * 30.0), (l * l - k2) / k2);
        ASSERT_NEAR(c.omega()[0], omega, 1e-11);
    });
    EXPECT_LT(c.omega()[0], 0.015);
}

TEST(Thrusters, GoOnFromTheirMemoryBitForBit)
{
    Craft a, b;
    for (Craft *each : {&a, &b}) {
        make_skew(*each);
        each->i.par.rise[0] = 300 * ms;
        each->prepare();
        each->burn(0, 430 * ms, 1730 * ms);
    }
    a.fly(500 * ms, 100 * ms); // in the ramp
    b.burn(1, 0, second);
    b.fly(2 * second, 50 * ms);
    const auto copy = [](std::span<std::byte> to, std::span<const std::byte> from) {
        ASSERT_EQ(to.size(), from.size());
        std::memcpy(to.data(), from.data(), from.size());
    };
    copy(b.craft.memory(), a.craft.memory());
    copy(b.model.memory(), a.model.memory());
    b.i = a.i;
    b.craft_interface = a.craft_interface;
    b.t = a.t;
    a.fly(2 * second, 100 * ms);
    b.fly(2 * second, 100 * ms);
    EXPECT_EQ(std::memcmp(&a.craft_interface.out, &b.craft_interface.out, sizeof a.craft_interface.out), 0);
    EXPECT_EQ(std::memcmp(&a.i.out, &b.i.out, sizeof a.i.out), 0);
    EXPECT_GT(a.impulse(), 10.0);
}

TEST(Thrusters, FlyTheSameBitsInNarrowRegisters)
{
    for (const TankShape shape : {TANK_FILLED, TANK_SHRINKS, TANK_SETTLES}) {
        const auto ends = in_all_registers([&] {
            Craft c;
            c.craft_interface.par.omega_BN_B = vec3(0.1, -0.2, 0.3);
            c.add_thruster({0.3, 0, -1}, {0, 0.1, 1}, 20.0, 220.0);
            c.add_thruster({0, 0.2, -1}, {0.1, 0, 1}, 30.0, 300.0);
            c.add_tank({0.1, 0, 0.4}, 30.0, 0.3, shape);
            c.add_tank({0, 0.1, -0.2}, 10.0, 0.2);
            c.i.par.fill[0] = 0.8;
            c.i.par.down_B[0] = vec3(0, 0.1, -1);
            c.i.par.rise[0] = c.i.par.fall[1] = 300 * ms;
            c.prepare();
            c.burn(0, second, 8 * second);
            c.burn(1, 2 * second, 9 * second);
            c.fly(10 * second, 100 * ms);
            return c.states();
        });
        for (const auto &end : ends) {
            EXPECT_EQ(end, ends[0]) << shape;
        }
    }
}

TEST(Thrusters, TakeFaults)
{
    Craft c;
    for (int k = 0; k < 4; k++) {
        c.add_thruster(origin, {1, 0, 0}, 10.0);
    }
    c.i.par.rise[0] = 40 * ms;
    c.i.par.n_faults = 4;
    c.i.par.faults[0] = {FAULT_HIGH, 1, 0.0, 1230 * ms, 600 * ms}; // stuck open
    c.i.par.faults[1] = {FAULT_DEAD, 2, 0.0, 450 * ms, 0};
    c.i.par.faults[2] = {FAULT_BIAS, 4, 0.5, 0, 0};   // leaks, and has its limit
    c.i.par.faults[3] = {FAULT_DRIFT, 8, -1.0, 0, 0}; // gets weaker
    c.prepare();
    c.open(1, true);
    c.fly(second, 100 * ms);
    c.open(2, true);
    c.open(3, true);
    c.fly(second, 100 * ms);
    EXPECT_NEAR(c.impulse(0), 10.0 * (0.6 - 0.02), 1e-9);
    EXPECT_NEAR(c.impulse(1), 10.0 * 0.45, 1e-9);
    EXPECT_NEAR(c.impulse(2), 0.5 + 10.0, 1e-9);
    EXPECT_NEAR(c.thrust(3), 10.0 - 2.0, 0.11);
    EXPECT_EQ(c.i.mem.burns[0], 0u) << "nothing has commanded it";

    c.i.in.injected.head.quality = QUALITY_GOOD;
    c.i.in.injected.n = 1;
    c.i.in.injected.list[0] = {FAULT_LOW, 0, 0.0, 0, 0};
    const double before = c.v()[0];
    c.fly(second, 100 * ms);
    EXPECT_NEAR(c.v()[0], before, 1e-15);
    c.i.par.faults[0].channels = 1u << 8;
    EXPECT_NE(error_of([&] { c.model.refresh(); }).find("world.thrusters.faults[0].channels"), std::string::npos);
}

TEST(Thrusters, ALatchValveWithoutPowerShutsThemAllAlsoOneThatIsStuckOpen)
{
    Craft c;
    for (int k = 0; k < 2; k++) {
        c.add_thruster(origin, {1, 0, 0}, 10.0);
    }
    c.i.par.fall[0] = 40 * ms;
    c.i.par.n_faults = 1;
    c.i.par.faults[0] = {FAULT_HIGH, 1, 0.0, 0, 0};
    c.i.par.load = 5;
    c.prepare();
    c.open(1, true);
    c.i.in.power.head.quality = QUALITY_GOOD;
    c.i.in.power.on = 1u << 5;
    c.fly(second, 100 * ms);
    c.i.in.power.on = ~(1u << 5);
    c.fly(second, 100 * ms);
    EXPECT_NEAR(c.impulse(0), 10.0 * (1 + 0.02), 1e-9);
    EXPECT_NEAR(c.impulse(1), 10.0, 1e-9);
    c.i.in.power.on = 1u << 5;
    c.fly(second, 100 * ms);
    EXPECT_NEAR(c.impulse(1), 20.0, 1e-9);
}

TEST(Thrusters, SetUpIsChecked)
{
    const auto prepare = [](const std::function<void(Craft &)> &change) {
        Craft c;
        c.add_thruster(origin, {1, 0, 0}, 1.0, 200.0);
        c.add_tank(origin, 1.0);
        change(c);
        return error_of([&] { c.prepare(); });
    };
    EXPECT_EQ(prepare([](Craft &) {}), "");
    EXPECT_EQ(prepare([](Craft &c) { c.i.par.n_tanks = 0; }),
              "world.thrusters.isp[0] is 200 s, so propellant flows, but n_tanks is 0: give the tanks, or an isp of 0 "
              "where no mass shall flow");
    EXPECT_EQ(prepare([](Craft &c) { c.i.par.isp[0] = 0.0; }),
              "world.thrusters.isp[0] must be > 0 s where tanks feed the thrusters, found 0 s");
    EXPECT_EQ(prepare([](Craft &c) { c.i.par.shape[0] = TANK_SETTLES; }),
              "world.thrusters.shape[0] is TANK_SETTLES, but fill[0] is 0: how full is the tank?");
    EXPECT_EQ(
        prepare([](Craft &c) {
            c.i.par.shape[0] = TANK_SETTLES;
            c.i.par.fill[0] = 1.0;
        }),
        "world.thrusters.shape[0] is TANK_SETTLES, but down_B[0] has no length: where does the propellant settle?");
    EXPECT_EQ(prepare([](Craft &c) { c.i.par.panel[0] = 1; }),
              "world.thrusters.panel[0] is 1, but world.thrusters.panels is missing: the HingedPanels that carry it");
    EXPECT_EQ(prepare([](Craft &c) {
                  c.add_panel(1.0, Matrix3d::Identity(), origin, {1, 0, 0}, origin);
                  c.mount(0, 1);
              }),
              "world.thrusters.panel[0] is 2, but its HingedPanels have n = 1");
    EXPECT_EQ(prepare([](Craft &c) { c.mount(0, 0); }),
              "world.craft.parts: one of them is mounted on a part that is not among them");
    EXPECT_NE(prepare([](Craft &c) { c.craft_interface.par.mass = 0.0; }).find("give the spacecraft its mass"),
              std::string::npos);
}

} // namespace thrusters_model_test
