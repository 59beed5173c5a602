// SPDX-License-Identifier: Apache-2.0
// Coupled parts alone and in random combinations: what is conserved, what work does, closed forms.
#include "world/dynamics/external_force_model.h"
#include "world/testing/bodies.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>
#include <random>

namespace coupled_parts_test {

using namespace fledge;
using namespace fledge::world;
using namespace fledge::world::testing;

constexpr double pi = std::numbers::pi;

enum Kinds : unsigned {
    with_wheels = 1,
    with_panels = 2,
    with_slosh = 4,
    with_pendulum = 8,
    with_imbalance = 16,
    every_kind = 32
};

/// Random parts of these kinds, `count` of each, on a craft that tumbles.
void assemble(Assembly &a, unsigned kinds, unsigned seed, double damping = 0.0, int count = 3)
{
    std::mt19937 draw(seed);
    const auto in = [&](double lo, double hi) { return lo + (hi - lo) * static_cast<double>(draw()) / 4294967296.0; };
    const auto any = [&](double size) { return Vector3d(in(-size, size), in(-size, size), in(-size, size)); };
    const Matrix3d R = rotation(any(1.0));
    a.method = sim::make_adaptive(1e-12, 1e-12);
    a.set_inertia(R * Vector3d(30.0, 40.0, 50.0).asDiagonal() * R.transpose());
    a.craft_interface.par.center_B = vec(any(0.2));
    a.craft_interface.par.r_BN_N = vec(any(10.0));
    a.craft_interface.par.v_BN_N = vec(any(1.0));
    a.craft_interface.par.sigma_BN = vec(any(0.5));
    a.craft_interface.par.omega_BN_B = vec(any(0.2));
    for (int i = 0; i < count; i++) {
        if (kinds & with_wheels) {
            const auto k = a.add_wheel(any(1.0), in(0.05, 0.2), in(-5.0, 5.0));
            if (kinds & with_imbalance) {
                a.wheel_interface.par.unbalance[k] = in(0.0, 0.1);
                a.wheel_interface.par.couple[k] = in(0.0, 0.04);
                a.wheel_interface.par.r_WB_B[k] = vec(any(0.5));
                a.wheel_interface.par.theta[k] = in(-3.0, 3.0);
            }
        }
        if (kinds & with_panels) {
            const Matrix3d Q = rotation(any(2.0));
            const auto k =
                a.add_panel(in(3.0, 8.0), Q * Vector3d(in(1, 2), in(1, 2), in(1, 2)).asDiagonal() * Q.transpose(),
                            any(0.8), any(1.0), any(1.2));
            a.panel_interface.par.stiffness[k] = in(1.0, 20.0);
            a.panel_interface.par.damping[k] = damping;
            a.panel_interface.par.theta[k] = in(-0.5, 0.5);
            a.panel_interface.par.dtheta[k] = in(-0.3, 0.3);
        }
        if (kinds & with_slosh) {
            const auto k = a.add_particle(in(1.0, 5.0), any(0.5), any(1.0), in(2.0, 20.0));
            a.slosh_interface.par.damping[k] = damping;
            a.slosh_interface.par.rho[k] = in(-0.1, 0.1);
            a.slosh_interface.par.drho[k] = in(-0.1, 0.1);
        }
        if (kinds & with_pendulum) {
            const auto k = a.add_pendulum(in(1.0, 5.0), in(0.2, 0.5), any(0.5), any(1.0));
            a.pendulum_interface.par.damping[k] = damping;
            a.pendulum_interface.par.spin_B[k] = vec(any(0.3));
        }
    }
    a.prepare_all();
}

TEST(CoupledParts, EveryCombinationKeepsMomentumAndEnergyForTenMinutes)
{
    for (unsigned kinds = 1; kinds < every_kind; kinds++) {
        if (kinds & with_imbalance && !(kinds & with_wheels)) {
            continue;
        }
        Assembly a;
        assemble(a, kinds, kinds);
        const Sums first = a.sums();
        a.fly(600 * second, 10 * second, [&] {
            const Sums now = a.sums();
            const double t = 1e-9 * static_cast<double>(a.t);
            ASSERT_LT((now.linear - first.linear).norm(), 1e-11 * first.linear.norm()) << kinds;
            ASSERT_LT((now.center / now.mass - (first.center + first.linear * t) / now.mass).norm(), 1e-10) << kinds;
            ASSERT_LT((now.spin() - first.spin()).norm(), 1e-8 * first.spin().norm()) << kinds;
            ASSERT_NEAR(now.energy(), first.energy(), 1e-8 * first.energy()) << kinds;
            // and the published centre is that of the bodies
            ASSERT_LT((view(a.state().r_CN_N) - now.center / now.mass).norm(), 1e-10) << kinds;
            ASSERT_LT((view(a.state().v_CN_N) - now.linear / now.mass).norm(), 1e-12) << kinds;
        });
        EXPECT_GT((a.omega() - view(a.craft_interface.par.omega_BN_B)).norm(), 1e-3) << kinds;
    }
}

TEST(CoupledParts, AnImpulseIsAllOfTheChangeOfMomentumAndDoesItsWork)
{
    const Vec3 p_N = vec3(3.0, -2.0, 1.0), p_B = vec3(0.5, 4.0, -1.0), h_N = vec3(0.3, 0.1, 0.2),
               h_B = vec3(-0.2, 1.0, 0.4);
    const Vector3d at(0.4, -0.7, 1.1);
    for (unsigned kinds = 0; kinds < every_kind; kinds++) {
        Assembly a;
        assemble(a, kinds, kinds + 1);
        a.fly(second, second, [] {});
        const Matrix3d NB = a.dcm_BN().transpose();
        const Vector3d p = view(p_N) + NB * view(p_B), h = view(h_N) + NB * view(h_B), w = a.omega();
        const Vector3d r = a.r() + NB * at, v = a.v() + NB * w.cross(at);
        const Sums before = a.sums();
        a.craft.strike({{}, {}, p_N, p_B, h_N, h_B, vec(at)});
        const Sums after = a.sums();
        EXPECT_EQ(after.center, before.center) << kinds;
        EXPECT_LT((after.linear - before.linear - p).norm(), 1e-12 * after.linear.norm()) << kinds;
        EXPECT_LT((after.angular - before.angular - h - r.cross(p)).norm(), 1e-12 * after.angular.norm()) << kinds;
        // Its work is that on the hub, by the mean of the motion before and after: what parts pass on does none.
        const Vector3d mean_v = 0.5 * (v + a.v() + NB * a.omega().cross(at)), mean_w = 0.5 * NB * (w + a.omega());
        EXPECT_NEAR(after.energy() - before.energy(), p.dot(mean_v) + h.dot(mean_w), 1e-12 * after.energy()) << kinds;
        // The run goes on from there, and has the velocity of the whole.
        a.fly(10 * second, 10 * second, [] {});
        EXPECT_LT((a.sums().spin() - after.spin()).norm(), 1e-9 * after.spin().norm()) << kinds;
        const Sums now = a.sums();
        a.craft.strike({vec3(0.1, 0.2, -0.3), {}, {}, {}, {}, {}, std::nullopt});
        EXPECT_LT((a.sums().linear - now.linear - now.mass * Vector3d(0.1, 0.2, -0.3)).norm(), 1e-11) << kinds;
        EXPECT_LT((a.sums().spin() - now.spin()).norm(), 1e-12 * now.spin().norm()) << kinds;
    }
}

/// The power [W] that the dampers take.
double damped(const Assembly &a, double damping)
{
    double power = 0.0;
    for (std::size_t i = 0; i < a.panel_interface.par.n; i++) {
        power += damping * std::pow(a.panel_interface.out.angles.dtheta[i], 2);
    }
    for (std::size_t i = 0; i < a.slosh_interface.par.n; i++) {
        power += damping * vec_norm2(a.slosh_interface.out.fuel.v_B[i]);
    }
    for (std::size_t i = 0; i < a.pendulum_interface.par.n; i++) {
        power += damping * vec_norm2(a.pendulum_interface.out.fuel.v_B[i]);
    }
    return power;
}

TEST(CoupledParts, DampersForcesAndMotorsAccountForTheEnergyAndMomentum)
{
    const double c = 0.3, h = 0.02;
    Assembly a;
    assemble(a, with_wheels | with_imbalance | with_panels | with_slosh | with_pendulum, 7, c);
    a.panel_interface.in.command.head.quality = QUALITY_GOOD;
    a.panel_interface.in.command.u[0] = 0.5;
    for (std::size_t i = 0; i < 3; i++) {
        a.command(i, 0.02 * (static_cast<double>(i) - 0.5));
    }
    a.push().force_B = vec3(2.0, -1.0, 0.5);
    a.push().force_N = vec3(-1.0, 0.5, 3.0);
    a.push().torque_B = vec3(0.3, 0.2, -0.4);
    const auto force = [&] {
        return Vector3d(a.dcm_BN().transpose() * view(a.push().force_B) + view(a.push().force_N));
    };
    const auto torque = [&] { return Vector3d(a.dcm_BN().transpose() * view(a.push().torque_B)); };
    const auto power = [&] {
        // The force acts on the hub, on the point that is now where C is.
        const Vector3d omega = a.dcm_BN().transpose() * a.omega(), arm = view(a.state().r_CN_N) - a.r();
        double sum = force().dot(a.v() + omega.cross(arm)) + torque().dot(omega);
        for (std::size_t i = 0; i < 3; i++) {
            sum += a.wheel_interface.in.command.u[i] * a.Omega(i);
        }
        return sum + 0.5 * a.panel_interface.out.angles.dtheta[0] - damped(a, c);
    };
    const Sums first = a.sums();
    double work = 0.0; // the integrals by Simpson's rule over pairs of steps
    Vector3d linear = Vector3d::Zero(), angular = Vector3d::Zero();
    const auto add = [&](double weight) {
        work += weight * power();
        linear += weight * force();
        angular += weight * torque();
    };
    for (int i = 0; i < 500; i++) {
        for (const double weight : {h / 3.0, 4.0 * h / 3.0}) {
            add(weight);
            a.step(20 * ms);
        }
        add(h / 3.0);
    }
    const Sums last = a.sums();
    EXPECT_GT(std::abs(work), 5.0);
    EXPECT_NEAR(last.energy() - first.energy(), work, 1e-6 * std::abs(work));
    EXPECT_LT((last.linear - first.linear - linear).norm(), 1e-6 * linear.norm());
    EXPECT_LT((last.spin() - first.spin() - angular).norm(), 1e-6 * angular.norm());
}

TEST(CoupledParts, PublishTheDerivativesOfWhatTheyPublish)
{
    for (const unsigned kinds : {0U, every_kind - 1U}) { // without parts, the offset of the hub alone
        Assembly a;
        assemble(a, kinds, 3);
        a.push().force_B = vec3(2.0, -1.0, 0.5);
        a.fly(second, 100 * ms);
        const CraftState before = a.state();
        a.step(ms);
        const CraftState now = a.state();
        a.step(ms);
        const CraftState after = a.state();
        const auto expect_rate = [&](const Vec3 CraftState::*x, const Vec3 CraftState::*dx, double within) {
            const Vec3 rate = vec_scale(500.0, vec_sub(after.*x, before.*x));
            EXPECT_LT(vec_norm(vec_sub(rate, now.*dx)), within * vec_norm(now.*dx)) << kinds;
        };
        expect_rate(&CraftState::r_BN_N, &CraftState::v_BN_N, 1e-6);
        expect_rate(&CraftState::r_CN_N, &CraftState::v_CN_N, 1e-6);
        expect_rate(&CraftState::v_BN_N, &CraftState::a_BN_N, 1e-4);
        expect_rate(&CraftState::omega_BN_B, &CraftState::domega_BN_B, 1e-4);
        EXPECT_GT(vec_norm(vec_sub(now.r_BN_N, now.r_CN_N)), 0.01);
    }
}

TEST(CoupledParts, GoOnFromTheirMemoryBitForBit)
{
    Assembly a, b; // of one set-up and two pasts
    for (Assembly *assembly : {&a, &b}) {
        assemble(*assembly, every_kind - 1, 5, 0.1);
        assembly->panel_interface.in.command.head.quality = QUALITY_GOOD;
        assembly->panel_interface.in.command.theta[1] = assembly == &a ? 0.1 : 0.4;
        assembly->fly(assembly == &a ? second : 3 * second, 100 * ms);
    }
    sim::Model *from[] = {&a.craft, &a.wheels, &a.panels, &a.slosh, &a.pendulums};
    sim::Model *to[] = {&b.craft, &b.wheels, &b.panels, &b.slosh, &b.pendulums};
    for (std::size_t i = 0; i < std::size(from); i++) {
        std::ranges::copy(from[i]->memory(), to[i]->memory().begin());
    }
    b.panel_interface = a.panel_interface;
    b.t = a.t;
    for (Assembly *assembly : {&a, &b}) {
        assembly->fly(5 * second, 100 * ms);
    }
    for (int i = 0; i < 3; i++) {
        EXPECT_EQ(a.r()[i], b.r()[i]);
        EXPECT_EQ(a.omega()[i], b.omega()[i]);
        EXPECT_EQ(a.panel_interface.out.angles.theta[i], b.panel_interface.out.angles.theta[i]);
    }
}

TEST(Lanes, HaveSinesAndCosinesToRounding)
{
    for (double angle = -20.0; angle < 20.0; angle += 1e-3) {
        const double angles[4] = {angle, angle * 1e-6, 50.0 * angle, std::round(angle) * pi / 4.0};
        Quad sines, cosines;
        sincos(quad_at(angles), sines, cosines);
        for (int i = 0; i < 4; i++) {
            ASSERT_NEAR(sines[i], std::sin(angles[i]), 3e-16) << angles[i];
            ASSERT_NEAR(cosines[i], std::cos(angles[i]), 3e-16) << angles[i];
        }
    }
}

TEST(CoupledParts, AreTheSameBitForBitInNarrowRegisters)
{
    for (unsigned kinds = 0; kinds < every_kind; kinds++) {
        const auto ends = in_all_registers([&] {
            Assembly a;
            assemble(a, kinds, kinds);
            a.method = sim::make_rk4();
            a.craft.prepare({"world.craft", 1, a.method.get()});
            a.reset();
            a.fly(5 * second, second / 10);
            return a.states();
        });
        for (const auto &end : ends) {
            EXPECT_EQ(end, ends[0]) << kinds;
        }
    }
}

TEST(CoupledParts, AStepInRegistersHasTheBitsOfTheGeneralWay)
{
    const unsigned all_kinds[] = {with_panels, with_wheels | with_imbalance, with_wheels | with_panels,
                                  with_wheels | with_panels | with_imbalance};
    for (const unsigned kinds : all_kinds) {
        for (const int count : {1, 2, 3, 4, 5, 8}) {
            const auto ends = in_all_registers([&] {
                std::vector<std::vector<double>> both;
                for (const bool general : {false, true}) {
                    Assembly a;
                    Idle idle;
                    if (general) {
                        a.craft.attach(idle);
                    }
                    assemble(a, kinds, kinds + static_cast<unsigned>(count), 0.1, count);
                    a.method = sim::make_rk4();
                    a.craft.prepare({"world.craft", 1, a.method.get()});
                    a.reset();
                    for (int i = 0; i < 200; i++) {
                        if (i % 20 == 15) {
                            a.push().torque_B = vec3(0.01 * i, -0.2, 0.3);
                            a.push().force_N = i == 75 ? vec3(1, 2, 3) : Vec3{}; // a step of the general way
                            a.command(0, 0.01 * (i - 100));
                        }
                        a.step(i % 7 == 6 ? 30 * ms : 100 * ms);
                        const auto *out = reinterpret_cast<const double *>(&a.craft_interface.out.state.r_BN_N);
                        both.emplace_back(out, out + (sizeof(CraftState) - sizeof(Head)) / sizeof(double));
                    }
                    both.push_back(a.states());
                }
                return both;
            });
            for (const auto &end : ends) {
                const auto half = end.begin() + static_cast<std::ptrdiff_t>(end.size() / 2);
                EXPECT_TRUE(std::equal(end.begin(), half, half)) << kinds << ", " << count;
                EXPECT_EQ(end, ends[0]) << kinds << ", " << count;
            }
        }
    }
}

TEST(CoupledParts, ParametersOfAPartChangeAtOnce)
{
    Assembly a, b;
    for (Assembly *assembly : {&a, &b}) {
        assemble(*assembly, with_panels | with_slosh | with_pendulum, 9);
        assembly->fly(second, 100 * ms);
        assembly->panel_interface.par.stiffness[0] = assembly->slosh_interface.par.stiffness[1] = 40.0;
        assembly->pendulum_interface.par.damping[2] = 3.0;
        for (sim::Model *part : assembly->craft.parts()) {
            part->refresh();
        }
    }
    b.craft.refresh(); // computes all derivatives again, which a must find out itself
    a.fly(second, 100 * ms);
    b.fly(second, 100 * ms);
    EXPECT_EQ(a.omega(), b.omega());
    EXPECT_EQ(a.r(), b.r());
}

TEST(CoupledParts, APanelOnAFreeBodySwingsWithTheClosedFormsPeriod)
{
    // Hub and panel share their centre of mass along the axis: 1 / J_reduced = 1 / J_hub + 1 / J_panel, if the panel's
    // centre is on the hinge, which passes through the hub's centre.
    const double J = 2.0, hub = 10.0, k = 3.0, c = 0.2;
    Assembly a;
    a.set_inertia(Vector3d(20.0, 15.0, hub).asDiagonal());
    a.add_panel(4.0, Vector3d(1.5, 1.6, J).asDiagonal(), {0, 0, 0}, {0, 0, 2}, {0, 0, 0.5});
    a.panel_interface.par.stiffness[0] = k;
    a.panel_interface.par.damping[0] = c;
    a.panel_interface.par.theta[0] = 0.3;
    a.prepare_all();
    const double by_J = 1.0 / J + 1.0 / hub, decay = 0.5 * c * by_J, w = std::sqrt(k * by_J - decay * decay);
    a.fly(30 * second, 10 * ms, [&] {
        const double t = 1e-9 * static_cast<double>(a.t);
        const double theta = 0.3 * std::exp(-decay * t) * (std::cos(w * t) + decay / w * std::sin(w * t));
        ASSERT_NEAR(a.panel_interface.out.angles.theta[0], theta, 1e-7) << t;
        ASSERT_NEAR(hub * a.omega()[2] + J * (a.omega()[2] + a.panel_interface.out.angles.dtheta[0]), 0.0, 1e-9);
    });
}

TEST(CoupledParts, ACommandTurnsAPanelToItsRest)
{
    Assembly a;
    a.add_panel(4.0, Vector3d(1.5, 1.6, 2.0).asDiagonal(), {0, 0.5, 0}, {0, 1, 0}, {0, 1.0, 0.1});
    a.panel_interface.par.stiffness[0] = 5.0;
    a.panel_interface.par.damping[0] = 4.0;
    a.prepare_all();
    a.panel_interface.in.command.head.quality = QUALITY_GOOD;
    a.panel_interface.in.command.theta[0] = 0.8;
    a.fly(60 * second, 100 * ms);
    EXPECT_NEAR(a.panel_interface.out.angles.theta[0], 0.8, 1e-6);
    a.panel_interface.in.command.u[0] = 1.0;
    a.fly(60 * second, 100 * ms);
    EXPECT_NEAR(a.panel_interface.out.angles.theta[0], 0.8 + 1.0 / 5.0, 1e-6) << "the motor winds the spring";
}

TEST(CoupledParts, FuelSloshesWithTheClosedFormsFrequency)
{
    // On a free body of mass M, along a line through both centres: w^2 = k (1 / m + 1 / M).
    const double m = 10.0, M = 80.0, k = 6.0;
    Assembly a;
    a.add_particle(m, {0, 0, 0}, {2, 0, 0}, k);
    a.slosh_interface.par.rho[0] = 0.1;
    a.prepare_all();
    const double w = std::sqrt(k * (1.0 / m + 1.0 / M));
    a.fly(60 * second, 10 * ms, [&] {
        const double t = 1e-9 * static_cast<double>(a.t);
        ASSERT_NEAR(a.slosh_interface.out.fuel.r_B[0].v[0], 0.1 * std::cos(w * t), 1e-8) << t;
    });
}

TEST(CoupledParts, ThrustIsTheWeightOfAPendulum)
{
    // A hub whose inertia and mass are large stands for a tank that accelerates at F / (M + m): small swings have
    // w^2 = (a / l) (1 + m / M).
    const double m = 2.0, M = 80.0, l = 0.4, F = 41.0, swing = 1e-4;
    Assembly a;
    a.set_inertia(1e9 * Matrix3d::Identity());
    a.add_pendulum(m, l, {0, 0, 0}, {-1, swing, 0});
    a.prepare_all();
    a.push().force_B = vec3(F, 0, 0);
    const double w = std::sqrt(F / (M + m) / l * (1.0 + m / M));
    a.fly(60 * second, 10 * ms, [&] {
        const double t = 1e-9 * static_cast<double>(a.t);
        ASSERT_NEAR(a.pendulum_interface.out.fuel.r_B[0].v[1], l * swing * std::cos(w * t), 1e-4 * l * swing) << t;
    });
}

TEST(CoupledParts, AnImbalancedWheelSpinsUpAsABalancedOneAboutThirdAxes)
{
    // About its own axis, a wheel with dynamic imbalance in a body of infinite inertia has u / J, as a balanced one.
    for (const double couple : {0.0, 1e-3}) {
        Assembly a;
        a.set_inertia(1e9 * Matrix3d::Identity());
        a.add_wheel({0, 0, 1}, 0.1);
        a.wheel_interface.par.couple[0] = couple;
        a.prepare_all();
        a.command(0, 0.05);
        a.fly(20 * second, 10 * ms, [&] { ASSERT_NEAR(a.Omega(0), 0.5e-9 * static_cast<double>(a.t), 1e-6); });
    }
}

TEST(CoupledParts, SimpleJitterAgreesWithTheCoupledWheelWhereItsMassIsSmall)
{
    // Their difference is of second order in the imbalance over the body's mass: a tenth of it, a hundredth of that.
    const auto shaken = [](double size, std::uint32_t jitter) {
        Assembly a;
        a.add_wheel({1, 2, 3}, 0.1, 30.0);
        a.wheel_interface.par.unbalance[0] = 0.02 * size;
        a.wheel_interface.par.couple[0] = 0.01 * size;
        a.wheel_interface.par.r_WB_B[0] = vec3(0.3, -0.2, 0.1);
        a.wheel_interface.par.jitter = jitter;
        a.prepare_all();
        Vector3d sum = Vector3d::Zero(); // of the accelerations, in which the start does not matter
        a.fly(second, 5 * ms,
              [&] { sum += a.dcm_BN() * view(a.state().domega_BN_B) * std::cos(30e-9 * static_cast<double>(a.t)); });
        return Vector3d(sum / size);
    };
    const Vector3d limit = shaken(1e-4, 0);
    EXPECT_LT((shaken(1e-4, 1) - limit).norm(), 1e-4 * limit.norm());
    const double large = (shaken(1.0, 1) - shaken(1.0, 0)).norm(), small = (shaken(0.1, 1) - shaken(0.1, 0)).norm();
    EXPECT_GT(large, 1e-4 * limit.norm());
    EXPECT_NEAR(small / large, 0.1, 0.05);
}

TEST(CoupledParts, PartsThatLeaveTheBodyNoInertiaAreRefused)
{
    Assembly a;
    a.add_wheel({0, 0, 1}, 0.1);
    a.wheel_interface.par.couple[0] = 50.0; // more than any rotor in a body of 30 kg m^2 has
    EXPECT_NE(error_of([&] { a.prepare_all(); }).find("world.craft.mass and I_B leave the body no inertia once its"),
              std::string::npos);
    Assembly light;
    light.craft_interface.par.mass = 0.0;
    light.add_particle(1.0, {0, 0, 0}, {1, 0, 0}, 1.0);
    EXPECT_EQ(error_of([&] { light.prepare_all(); }), "world.craft.mass is 0, but one of its parts moves masses: "
                                                      "give the spacecraft its mass");
    Assembly thin;
    thin.add_panel(1e-6, 1e-12 * Matrix3d::Identity(), {0, 0, 0}, {0, 0, 1}, {0, 0, 0});
    EXPECT_EQ(error_of([&] { thin.prepare_all(); }),
              "world.panels.I_B[0]: with mass and center_B it must give an inertia about the hinge in [1e-9, 1e12] "
              "kg m^2; found 1e-12");
    Assembly sticky;
    sticky.add_wheel({0, 0, 1}, 0.1);
    sticky.wheel_interface.par.stiction[0] = 0.1;
    EXPECT_EQ(error_of([&] { sticky.prepare_all(); }),
              "world.wheels.stribeck[0] must be > 0 where stiction exceeds friction; found 0");
}

TEST(ExternalForces, AddUp)
{
    // Half of what acts through the craft's input, the rest through parts: as all through the input.
    ForceTorque all{};
    all.head.quality = QUALITY_GOOD;
    all.force_N = vec3(1.0, 2.0, 3.0);
    all.force_B = vec3(-2.0, 1.0, 0.5);
    all.torque_B = vec3(0.1, -0.2, 0.3);
    const auto scaled = [&](double s) {
        ForceTorque some = all;
        some.force_N = vec_scale(s, all.force_N);
        some.force_B = vec_scale(s, all.force_B);
        some.torque_B = vec_scale(s, all.torque_B);
        return some;
    };
    const auto fly = [&](bool split) {
        Assembly a;
        ExternalForce interfaces[2]{};
        ExternalForceModel parts[2] = {ExternalForceModel(interfaces[0]), ExternalForceModel(interfaces[1])};
        if (split) {
            a.craft.attach(parts[0]);
            a.craft.attach(parts[1]);
        }
        a.prepare_all();
        a.push() = scaled(split ? 0.5 : 1.0);
        interfaces[0].in.external = interfaces[1].in.external = scaled(0.25);
        a.fly(20 * second, 100 * ms);
        const Vector3d acted = a.v();
        interfaces[0].in.external.head.quality = interfaces[1].in.external.head.quality = QUALITY_NONE;
        a.push().head.quality = QUALITY_NONE;
        a.fly(second, 100 * ms);
        EXPECT_LT((a.v() - acted).norm(), 1e-15) << "nothing acts any more";
        return acted;
    };
    const Vector3d velocity = fly(false);
    EXPECT_GT(velocity.norm(), 0.5);
    EXPECT_LT((fly(true) - velocity).norm(), 1e-13);
}

} // namespace coupled_parts_test
