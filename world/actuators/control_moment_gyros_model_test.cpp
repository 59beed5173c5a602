// SPDX-License-Identifier: Apache-2.0
// Control moment gyros: momentum and energy from what they publish, and closed forms on a body that hardly turns.
#include "world/actuators/control_moment_gyros_model.h"

#include "sim/error.h"
#include "world/testing/flyer.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <vector>

namespace control_moment_gyros_model_test {

using namespace fledge;
using namespace fledge::world;
using namespace fledge::world::testing;

double seconds(Ns t)
{
    return 1e-9 * static_cast<double>(t);
}

struct Craft : Flyer {
    ControlMomentGyros i{};
    ControlMomentGyrosModel model{i};

    Craft()
    {
        craft_interface.par.mass = 100.0;
        set_inertia(Vector3d(50.0, 60.0, 80.0).asDiagonal());
    }
    std::size_t add(const Vector3d &gimbal, const Vector3d &spin, double Omega)
    {
        const std::size_t k = i.par.n++;
        i.par.gimbal_axes_B[k] = vec(gimbal);
        i.par.spin_axes_B[k] = vec(spin);
        i.par.J[k] = 0.2;
        i.par.J_g[k] = 0.3;
        i.par.J_s[k] = 0.15;
        i.par.J_t[k] = 0.4;
        i.par.Omega[k] = Omega;
        return k;
    }
    /// Three gyros askew, on a tumbling body.
    void add_set()
    {
        add({1, 0, 0}, {0, 1, 0}, 30.0);
        add({0, 1, 1}, {1, 0, 0}, -20.0);
        add({1, -1, 2}, {1, 1, 0}, 40.0);
        i.par.angle[1] = 0.7;
        i.par.rate[2] = 0.3;
        craft_interface.par.omega_BN_B = vec3(0.2, -0.3, 0.1);
        method = sim::make_adaptive(1e-13, 1e-13);
    }
    void prepare()
    {
        model.prepare({"world.gyros", 1, method.get()});
        craft.attach(model);
        Flyer::prepare();
    }
    double speed(std::size_t k = 0) const { return i.out.speeds.Omega[k]; }
    double rate(std::size_t k = 0) const { return i.out.gimbals.rate[k]; }
    double angle(std::size_t k = 0) const { return i.out.gimbals.angle[k]; }

    /// The axes of the wheel, across and of the gimbal.
    Matrix3d axes(std::size_t k) const
    {
        const Vector3d g = view(i.par.gimbal_axes_B[k]).normalized();
        const Vector3d s = view(i.par.spin_axes_B[k]).normalized();
        Matrix3d A;
        A << s, g.cross(s), g;
        return rotation(angle(k) * g) * A;
    }
    /// Angular momentum in N, and kinetic energy: those of wheel and gimbal from their own rates.
    Vector3d total(double *energy = nullptr) const
    {
        Vector3d H = inertia() * omega();
        double E = 0.5 * omega().dot(H);
        for (std::size_t k = 0; k < i.par.n; k++) {
            const Vector3d w = axes(k).transpose() * (omega() + rate(k) * axes(k).col(2));
            const double spin = w[0] + speed(k), J = i.par.J[k];
            const Vector3d h(i.par.J_s[k] * w[0] + J * spin, i.par.J_t[k] * w[1], i.par.J_g[k] * w[2]);
            H += axes(k) * h;
            E += 0.5 * (i.par.J_s[k] * w[0] * w[0] + J * spin * spin + h[1] * w[1] + h[2] * w[2]);
        }
        if (energy) {
            *energy = E;
        }
        return dcm_BN().transpose() * H;
    }
    double energy() const
    {
        double E;
        total(&E);
        return E;
    }
};

TEST(ControlMomentGyros, KeepMomentumAndEnergyWithoutMotors)
{
    Craft c;
    c.add_set();
    c.prepare();
    const Vector3d H = c.total();
    const double E = c.energy();
    double turned = 0.0;
    c.fly(600 * second, second, [&] {
        ASSERT_LT((c.total() - H).norm(), 1e-10 * H.norm());
        ASSERT_LT(std::abs(c.energy() - E), 1e-10 * E);
        turned = std::max(turned, std::abs(c.angle(0)));
    });
    EXPECT_GT(turned, 0.5) << "the gyration of a free gimbal turns it";
}

TEST(ControlMomentGyros, MotorsKeepMomentumAndAccountForTheEnergy)
{
    for (const bool servo : {false, true}) {
        Craft c;
        c.add_set();
        c.prepare();
        const double u[] = {0.1, -0.2, 0.05}, v[] = {0.03, 0.02, -0.04};
        for (int k = 0; k < 3; k++) {
            c.i.in.command.u[k] = u[k];
            c.i.in.torques.u[k] = v[k];
            c.i.in.rates.rate[k] = 10.0 * v[k];
            c.i.par.lag[k] = 2.0;
        }
        c.i.in.command.head.quality = c.i.in.torques.head.quality = QUALITY_GOOD;
        c.i.in.rates.head.quality = servo ? QUALITY_GOOD : QUALITY_NONE;
        c.fly(10 * ms, 10 * ms);
        const Vector3d H = c.total();
        const double E = c.energy();
        double work = 0.0;
        const auto power = [&] {
            double sum = 0.0;
            for (std::size_t k = 0; k < 3; k++) {
                sum += u[k] * c.speed(k) + c.i.out.gimbals_applied.u[k] * c.rate(k);
            }
            return sum;
        };
        for (int k = 0; k < 500; k++) { // Simpson's rule
            const double a = power();
            c.step(10 * ms);
            const double b = power();
            c.step(10 * ms);
            work += 0.01 / 3.0 * (a + 4.0 * b + power());
            ASSERT_LT((c.total() - H).norm(), 1e-11 * H.norm());
        }
        EXPECT_GT(std::abs(work), 1.0);
        EXPECT_NEAR(c.energy() - E, work, 1e-7 * std::abs(work)) << servo;
    }
}

/// One gyro on a body that hardly turns.
void make_heavy(Craft &c, double Omega)
{
    c.set_inertia(1e9 * Matrix3d::Identity());
    c.add({0, 0, 2}, {3, 0, 0}, Omega);
}

TEST(ControlMomentGyros, TheTorqueOnTheBodyIsThatOfTheClosedForm)
{
    // -(h dgamma t + u s): with gamma = rate t, s = (cos gamma, sin gamma, 0)
    Craft c;
    make_heavy(c, 500.0);
    c.i.par.lag[0] = 1.0;
    c.i.par.rate[0] = 0.4;
    c.i.in.rates.head.quality = c.i.in.command.head.quality = QUALITY_GOOD;
    c.i.in.rates.rate[0] = 0.4;
    c.i.in.command.u[0] = 2.0;
    c.prepare();
    c.fly(10 * second, 100 * ms, [&] {
        const double t = seconds(c.t), gamma = 0.4 * t, h = 0.2 * 500.0 + 2.0 * t;
        ASSERT_NEAR(c.angle(), gamma, 1e-7);
        ASSERT_NEAR(c.speed(), h / 0.2, 1e-4);
        const Vector3d s(std::cos(gamma), std::sin(gamma), 0.0), along(-s[1], s[0], 0.0);
        const Vector3d torque = 1e9 * view(c.state().domega_BN_B);
        ASSERT_LT((torque + h * 0.4 * along + 2.0 * s).norm(), 1e-4) << t;
    });
}

TEST(ControlMomentGyros, ARateIsReachedExponentially)
{
    Craft c;
    make_heavy(c, 500.0);
    c.i.par.lag[0] = 0.5;
    c.i.par.rate_max[0] = 0.3;
    c.i.in.rates.head.quality = QUALITY_GOOD;
    c.i.in.rates.rate[0] = 7.0; // beyond the limit
    c.prepare();
    c.fly(10 * second, 10 * ms, [&] { ASSERT_NEAR(c.rate(), 0.3 * (1.0 - std::exp(-2.0 * seconds(c.t))), 1e-7); });
    c.i.par.lag[0] = 0.0; // that of an update
    c.i.in.rates.rate[0] = -0.1;
    c.fly(2 * second, 100 * ms);
    EXPECT_NEAR(c.rate(), -0.1, 1e-7);
}

TEST(ControlMomentGyros, ATorqueTurnsAGimbal)
{
    Craft c;
    make_heavy(c, 0.0);
    c.i.in.torques.head.quality = QUALITY_GOOD;
    c.i.in.torques.u[0] = 0.06;
    c.prepare();
    c.fly(10 * second, 100 * ms, [&] {
        ASSERT_NEAR(c.rate(), 0.2 * seconds(c.t), 1e-8);
        ASSERT_NEAR(c.angle(), 0.1 * seconds(c.t) * seconds(c.t), 1e-8);
    });
}

TEST(ControlMomentGyros, MotorsHaveTheirLimits)
{
    Craft c;
    make_heavy(c, 10.0);
    c.i.par.u_max[0] = 0.5;
    c.i.par.Omega_max[0] = 12.0;
    c.i.par.torque_max[0] = 0.03;
    c.i.par.rate_max[0] = 0.25;
    c.i.in.torques.head.quality = c.i.in.command.head.quality = QUALITY_GOOD;
    c.i.in.torques.u[0] = -1.0;
    c.i.in.command.u[0] = 1.0;
    c.prepare();
    c.step(100 * ms);
    EXPECT_EQ(c.i.out.applied.u[0], 0.5);
    EXPECT_EQ(c.i.out.gimbals_applied.u[0], -0.03);
    EXPECT_EQ(c.i.mem.saturated, 1u);
    c.fly(5 * second, 70 * ms, [&] {
        ASSERT_LE(c.speed(), 12.0 + 1e-6); // the gimbal's turning may carry it on
        ASSERT_GE(c.rate(), -0.25 - 1e-12);
    });
    EXPECT_NEAR(c.speed(), 12.0, 1e-6);
    EXPECT_NEAR(c.rate(), -0.25, 1e-6);
    EXPECT_NEAR(c.i.out.applied.u[0], 0.0, 1e-6);
    c.i.in.command.u[0] = -0.4; // the other way it has its torque
    c.step(100 * ms);
    EXPECT_EQ(c.i.out.applied.u[0], -0.4);

    c.i.par.lag[0] = 0.1;
    c.i.in.rates.head.quality = QUALITY_GOOD;
    c.i.in.rates.rate[0] = 0.25;
    const double before = c.rate();
    c.fly(second, 10 * ms);
    EXPECT_NEAR(c.rate() - before, 0.03 / 0.3, 1e-6) << "a servo has the motor's torque";
}

TEST(ControlMomentGyros, MotorsHoldTheirLimitsAgainstTheBodysMotion)
{
    Craft c; // a body that is spun up about the wheel's axis
    c.set_inertia(20.0 * Matrix3d::Identity());
    c.add({0, 0, 1}, {1, 0, 0}, 12.0);
    c.i.par.Omega_max[0] = 12.0;
    c.i.in.command.head.quality = QUALITY_GOOD;
    c.i.in.command.u[0] = 1.0;
    c.push().torque_B = vec3(2, 0, 0);
    c.prepare();
    c.fly(3 * second, 100 * ms);
    EXPECT_NEAR(c.speed(), 12.0, 1e-3);
    EXPECT_NEAR(c.i.out.applied.u[0], 0.2 * 2.0 / 20.15, 1e-3);

    Craft d; // a body that turns across the gimbal's and the wheel's axes
    make_heavy(d, 500.0);
    d.craft_interface.par.omega_BN_B = vec3(0, -1e-3, 0);
    d.i.par.rate[0] = d.i.par.rate_max[0] = 0.25;
    d.i.in.torques.head.quality = QUALITY_GOOD;
    d.i.in.torques.u[0] = 1.0;
    d.prepare();
    d.fly(3 * second, 10 * ms, [&] { ASSERT_NEAR(d.rate(), 0.25, 1e-4); });
    EXPECT_NEAR(d.i.out.gimbals_applied.u[0], 0.1 * std::cos(0.75), 1e-3);

    Craft e; // the turning gimbal alone spins the wheel up, seen from N
    make_heavy(e, 500.0);
    e.craft_interface.par.omega_BN_B = vec3(0, 0.1, 0);
    e.i.par.Omega_max[0] = 500.0;
    e.i.par.lag[0] = 0.1;
    e.i.par.rate[0] = 0.25;
    e.i.in.rates.head.quality = e.i.in.command.head.quality = QUALITY_GOOD;
    e.i.in.rates.rate[0] = 0.25;
    e.i.in.command.u[0] = 1.0;
    e.prepare();
    e.fly(second, 10 * ms, [&] { ASSERT_NEAR(e.speed(), 500.0, 5e-5); });
}

TEST(ControlMomentGyros, LimitsHoldExactlyWhereTheBodyIsLight)
{
    // Wheel or gimbal as heavy as what bears it: a rate is u t (1 / J + 1 / I) up to its limit.
    for (const Ns dt : {10 * ms, 300 * ms, second}) {
        for (const bool gimbal : {false, true}) {
            Craft c;
            c.set_inertia(0.3 * Matrix3d::Identity());
            c.add({0, 0, 1}, {1, 0, 0}, 0.0);
            double &u = gimbal ? c.i.in.torques.u[0] : c.i.in.command.u[0];
            const double &applied = gimbal ? c.i.out.gimbals_applied.u[0] : c.i.out.applied.u[0];
            const double gain =
                gimbal ? 1.0 / c.i.par.J_g[0] + 1.0 / 0.3 : 1.0 / c.i.par.J[0] + 1.0 / (0.3 + c.i.par.J_s[0]);
            (gimbal ? c.i.par.rate_max : c.i.par.Omega_max)[0] = 2.0;
            c.i.in.torques.head.quality = c.i.in.command.head.quality = QUALITY_GOOD;
            u = -0.07;
            c.prepare();
            c.fly(20 * second, dt, [&] {
                ASSERT_NEAR(gimbal ? c.rate() : c.speed(), -std::min(0.07 * gain * seconds(c.t), 2.0), 1e-9) << dt;
                ASSERT_LT(c.total().norm(), 1e-13);
            });
            EXPECT_NEAR(applied, 0.0, 1e-12);
            u = 0.07; // it leaves the limit at once
            c.step(100 * ms);
            EXPECT_EQ(applied, 0.07);
        }
    }
}

/// Three to eight gyros for 20 s: what they and the craft show, and the states.
std::vector<double> flown(int count, bool general)
{
    Craft c;
    Idle idle;
    c.add_set();
    for (int k = 3; k < count; k++) {
        c.add({1, 0, 3}, {0, 1, 0.1 * k}, 25.0);
    }
    c.craft_interface.par.center_B = vec3(0.1, -0.2, 0.3);
    c.method = sim::make_rk4();
    if (general) {
        c.craft.attach(idle);
    }
    c.prepare();
    std::vector<double> all;
    for (int i = 0; i < 200; i++) {
        if (i % 40 == 10) {
            c.i.in.rates.head.quality = i < 100 ? QUALITY_GOOD : QUALITY_NONE;
            c.i.in.torques.head.quality = c.i.in.command.head.quality = QUALITY_GOOD;
            c.i.in.rates.rate[i % 3] = c.i.in.torques.u[2] = 0.001 * i;
            c.i.in.command.u[1] = 0.01 * (i - 100);
            c.i.par.lag[0] = 0.5;
            c.i.par.torque_max[1] = 0.5;
            c.push().torque_B = vec3(0.01 * i, -0.2, 0.3);
            c.push().force_B = i == 90 ? vec3(1, 2, 3) : Vec3{}; // steps of the general way
        }
        c.step(i % 7 == 6 ? 30 * ms : 100 * ms);
        const auto *out = reinterpret_cast<const double *>(&c.craft_interface.out.state.r_BN_N);
        all.insert(all.end(), out, out + (sizeof(CraftState) - sizeof(Head)) / sizeof(double));
        for (std::size_t k = 0; k < c.i.par.n; k++) {
            all.insert(all.end(), {c.speed(k), c.rate(k), c.angle(k), c.i.out.gimbals_applied.u[k]});
        }
    }
    const auto states = c.states();
    all.insert(all.end(), states.begin(), states.end());
    return all;
}

TEST(ControlMomentGyros, AStepInRegistersHasTheBitsOfTheGeneralWay)
{
    for (const int count : {3, 4, 5, 8}) {
        const auto general = flown(count, true);
        for (const auto &in_registers : in_all_registers([&] { return flown(count, false); })) {
            ASSERT_EQ(in_registers.size(), general.size());
            EXPECT_EQ(std::memcmp(in_registers.data(), general.data(), general.size() * sizeof(double)), 0) << count;
        }
    }
}

TEST(ControlMomentGyros, TakeFaults)
{
    Craft c;
    make_heavy(c, 10.0);
    c.i.par.torque_max[0] = 0.06;
    c.i.par.n_faults = 3;
    c.i.par.faults[0] = {FAULT_HIGH, 1u << 8, 0.5, second, 0}; // the gimbal's motor at its limit, not at 0.5 N m
    c.i.par.faults[1] = {FAULT_BIAS, 1u << 24, 0.25, 0, 0};
    c.i.par.faults[2] = {FAULT_DEAD, 1u << 16, 0.0, 2 * second, 0};
    c.prepare();
    c.fly(second, 100 * ms);
    EXPECT_EQ(c.rate(), 0.0);
    EXPECT_EQ(c.angle(), 0.25);
    EXPECT_NEAR(c.speed(), 10.0, 1e-9);
    c.fly(second, 100 * ms);
    EXPECT_NEAR(c.rate(), 0.2, 1e-6);
    EXPECT_NEAR(c.angle(), 0.35, 1e-6);
    c.fly(100 * ms, 100 * ms);
    EXPECT_EQ(c.i.out.speeds.head.quality, QUALITY_DEGRADED) << "nothing measures the speeds";
    EXPECT_EQ(c.i.out.gimbals.head.quality, QUALITY_GOOD);
}

TEST(ControlMomentGyros, SetUpIsChecked)
{
    const auto prepare = [](const std::function<void(Craft &)> &change) {
        Craft c;
        c.add({0, 0, 1}, {1, 0, 0}, 30.0);
        change(c);
        return error_of([&] { c.prepare(); });
    };
    EXPECT_EQ(prepare([](Craft &) {}), "");
    EXPECT_EQ(prepare([](Craft &c) { c.i.par.spin_axes_B[0] = vec3(0, 0, -2); }),
              "world.gyros.spin_axes_B[0]: the wheel's axis must be across the gimbal's; found it along it");
    EXPECT_EQ(prepare([](Craft &c) { c.i.par.Omega_max[0] = 20.0; }),
              "world.gyros.Omega[0]: the initial value must be within Omega_max, 20 rad/s; found 30");
}

} // namespace control_moment_gyros_model_test
