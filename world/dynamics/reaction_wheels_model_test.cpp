// SPDX-License-Identifier: Apache-2.0
#include "world/dynamics/reaction_wheels_model.h"

#include "sim/error.h"
#include "world/testing/flyer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace reaction_wheels_model_test {

using namespace fledge;
using namespace fledge::world;
using namespace fledge::world::testing;

double seconds(Ns t)
{
    return 1e-9 * static_cast<double>(t);
}

constexpr double I = 20.0, J = 0.5; // a light body, so that the wheel turns it visibly

/// One wheel on the third axis of a body.
void one_wheel(Flyer &f, double Omega = 0.0)
{
    f.set_inertia(Vector3d(10.0, 15.0, I).asDiagonal());
    f.add_wheel({0, 0, 3}, J, Omega);
}

TEST(ReactionWheels, ExchangeMomentumAsTheClosedFormSays)
{
    // I domega = -u and J (dOmega + domega) = u
    Flyer f;
    one_wheel(f);
    f.prepare();
    f.command(0, 0.2);
    f.fly(100 * second, 100 * ms, [&] {
        const double t = seconds(f.t);
        ASSERT_NEAR(f.omega()[2], -0.2 * t / I, 1e-12);
        ASSERT_NEAR(f.Omega(0), 0.2 * t * (1.0 / J + 1.0 / I), 1e-11);
        ASSERT_NEAR(f.state().domega_BN_B.v[2], -0.2 / I, 1e-15);
    });
}

TEST(ReactionWheels, AnyMotorTorquesKeepTheTotalMomentum)
{
    Flyer f;
    f.method = sim::make_adaptive(1e-12, 1e-13); // RK4's own error would hide a small leak
    f.set_inertia(Vector3d(50.0, 60.0, 80.0).asDiagonal());
    f.craft_interface.par.omega_BN_B = vec3(0.02, -0.03, 0.01);
    f.add_pyramid(0.16);
    for (int i = 0; i < 4; i++) {
        f.wheel_interface.par.Omega[i] = 10.0 * i;
        f.wheel_interface.par.friction[i] = 0.01;
        f.wheel_interface.par.viscosity[i] = 1e-3 * i;
        f.wheel_interface.par.u_max[i] = 0.25;
        f.wheel_interface.par.Omega_max[i] = 60.0;
    }
    f.prepare();
    const Vector3d momentum = f.momentum_N();
    double t = 0.0;
    f.fly(600 * second, 100 * ms, [&] {
        t += 0.1;
        for (std::size_t i = 0; i < 4; i++) {
            f.command(i, 0.3 * std::sin(0.05 * t * static_cast<double>(i + 1)));
        }
        ASSERT_LT((f.momentum_N() - momentum).norm(), 1e-10 * momentum.norm()) << t;
    });
    EXPECT_GT((f.omega() - view(f.craft_interface.par.omega_BN_B)).norm(), 0.01);
}

TEST(ReactionWheels, MotorsAndFrictionAccountForTheEnergy)
{
    // The kinetic energy changes by the work of motor and viscosity, (u - c Omega) Omega per time.
    Flyer f;
    f.set_inertia(Vector3d(50.0, 60.0, 80.0).asDiagonal());
    f.craft_interface.par.omega_BN_B = vec3(0.2, -0.3, 0.1);
    f.add_pyramid(0.16);
    for (int i = 0; i < 4; i++) {
        f.wheel_interface.par.Omega[i] = 10.0 * i - 12.0;
        f.wheel_interface.par.viscosity[i] = 2e-3;
    }
    f.prepare();
    const double u[4] = {0.2, -0.1, 0.05, 0.15};
    const auto power = [&] {
        double sum = 0.0;
        for (std::size_t i = 0; i < 4; i++) {
            f.command(i, u[i]);
            sum += (u[i] - 2e-3 * f.Omega(i)) * f.Omega(i);
        }
        return sum;
    };
    const double before = f.rotational_energy();
    double work = 0.0; // by Simpson's rule over pairs of steps
    for (int i = 0; i < 1000; i++) {
        const double a = power();
        f.step(10 * ms);
        const double b = power();
        f.step(10 * ms);
        work += 0.01 / 3.0 * (a + 4.0 * b + power());
    }
    const double gained = f.rotational_energy() - before;
    EXPECT_GT(std::abs(gained), 1.0);
    EXPECT_NEAR(gained, work, 1e-9 * std::abs(gained));
}

TEST(ReactionWheels, MotorTorqueIsLimitedAndOffWithoutACommand)
{
    Flyer f;
    one_wheel(f);
    f.wheel_interface.par.u_max[0] = 0.2;
    f.prepare();
    f.wheel_interface.in.command.u[0] = 1.0; // never written, by its head
    f.step(second);
    EXPECT_EQ(f.applied(0), 0.0);
    EXPECT_EQ(f.omega()[2], 0.0);
    EXPECT_EQ(f.wheel_interface.mem.saturated, 0u);
    f.command(0, 1.0);
    f.step(second);
    EXPECT_EQ(f.applied(0), 0.2);
    EXPECT_EQ(f.wheel_interface.mem.saturated, 1u);
    f.command(0, -1.0);
    f.step(second);
    EXPECT_EQ(f.applied(0), -0.2);
    EXPECT_NEAR(f.omega()[2], 0.0, 1e-15);
    f.step(second);
    EXPECT_EQ(f.wheel_interface.mem.saturated, 3u) << "also while the command stays";
    f.command(0, 0.1);
    f.step(second);
    EXPECT_EQ(f.applied(0), 0.1);
    EXPECT_EQ(f.wheel_interface.mem.saturated, 3u);
}

TEST(ReactionWheels, AMotorStopsAtTheSpeedLimitWithoutChatter)
{
    for (const double sign : {1.0, -1.0}) {
        for (const double friction : {0.0, 0.03}) {
            Flyer f;
            one_wheel(f);
            f.wheel_interface.par.Omega_max[0] = 10.0;
            f.wheel_interface.par.friction[0] = friction;
            f.wheel_interface.par.viscosity[0] = 0.1 * friction;
            f.prepare();
            f.command(0, sign * 0.2);
            int reduced = 0;
            f.fly(100 * second, 70 * ms, [&] {
                ASSERT_LE(sign * f.Omega(0), 10.0 * (1.0 + 1e-13));
                ASSERT_GE(sign * f.applied(0), 0.0);
                reduced += sign * f.applied(0) < 0.2;
                if (reduced == 0) {
                    ASSERT_EQ(sign * f.applied(0), 0.2);
                } else if (reduced > 10) { // settled on what the friction takes
                    ASSERT_NEAR(sign * f.applied(0), 2.0 * friction, 1e-6);
                }
            });
            EXPECT_GT(reduced, 10);
            EXPECT_NEAR(sign * f.Omega(0), 10.0, 1e-5);
            f.command(0, -sign * 0.2); // the other way it has its full torque
            f.step(100 * ms);
            EXPECT_EQ(f.applied(0), -sign * 0.2);
        }
    }
}

TEST(ReactionWheels, AWheelReachesItsLimitExactlyWhateverTheStepAndTheInertia)
{
    // Omega = u t (1/J + 1/I) up to the limit, whatever the wheel's share of the inertia; the momentum stays.
    for (const double ratio : {0.001, 0.2, 0.5, 3.0}) {
        for (const Ns dt : {10 * ms, 700 * ms, second, 10 * second}) {
            Flyer f;
            const double wheel = ratio * I, rate = 0.2 * (1.0 / wheel + 1.0 / I);
            f.set_inertia(Vector3d(10.0, 15.0, I).asDiagonal());
            f.add_wheel({0, 0, 1}, wheel, 500.0 - 30.5 * rate);
            f.wheel_interface.par.Omega_max[0] = 500.0;
            f.prepare();
            const double momentum = f.momentum_N()[2];
            f.command(0, 0.2);
            f.fly(50 * second, dt, [&] {
                const double left = std::max(30.5 - seconds(f.t), 0.0);
                ASSERT_NEAR(f.Omega(0), 500.0 - rate * left, seconds(f.t) > 30.505 ? 1e-11 : 1e-9)
                    << ratio << " " << dt;
                ASSERT_NEAR(f.momentum_N()[2], momentum, 1e-12 * wheel * 500.0);
            });
            EXPECT_NEAR(f.applied(0), 0.0, 1e-12);
            EXPECT_GT(f.wheel_interface.mem.saturated, 0u);
            f.command(0, -0.1); // it leaves the limit at once
            const double left = seconds(f.t);
            f.fly(10 * second, dt);
            EXPECT_EQ(f.applied(0), -0.1);
            EXPECT_NEAR(f.Omega(0), 500.0 - 0.5 * rate * (seconds(f.t) - left), 1e-9);
        }
    }
}

TEST(ReactionWheels, NoWheelOfATumblingBodyPassesItsLimitAndTheMomentumStays)
{
    // Large wheels, so that each motor moves all speeds, in a body that turns over within a step; balanced or not.
    for (const double unbalance : {0.0, 1e-3}) {
        for (const Ns dt : {50 * ms, 200 * ms, second}) {
            Flyer f;
            f.method = sim::make_adaptive(1e-13, 1e-14);
            f.craft_interface.par.mass = 100.0;
            f.set_inertia(Vector3d(5.0, 6.0, 8.0).asDiagonal());
            f.craft_interface.par.omega_BN_B = vec3(0.4, -0.3, 0.2);
            f.add_pyramid(2.0);
            for (int i = 0; i < 4; i++) {
                f.wheel_interface.par.Omega_max[i] = 2.0 + 0.3 * i;
                f.wheel_interface.par.friction[i] = 0.01 * i;
                f.wheel_interface.par.viscosity[i] = 1e-3;
                f.wheel_interface.par.u_max[i] = 1.5;
                f.wheel_interface.par.unbalance[i] = unbalance;
            }
            f.prepare();
            const Vector3d momentum = f.momentum_N();
            int at_limit[4] = {};
            f.fly(100 * second, dt, [&] {
                for (std::size_t i = 0; i < 4; i++) {
                    const double limit = f.wheel_interface.par.Omega_max[i], u = f.wheel_interface.in.command.u[i];
                    const double driven = std::copysign(f.Omega(i), u * f.Omega(i)), applied = f.applied(i);
                    ASSERT_GE(applied * u, 0.0) << "it brakes";
                    ASSERT_LE(std::abs(applied), std::abs(u) * (1.0 + 1e-12));
                    if (std::abs(applied) > 1e-9) {
                        ASSERT_LE(driven, limit * (1.0 + 1e-11)) << i << " " << dt;
                    }
                    if (std::abs(applied) > 1e-9 && std::abs(applied) < std::abs(u) * (1.0 - 1e-9)) {
                        ASSERT_NEAR(driven, limit, 1e-11 * limit) << i << " " << dt;
                        at_limit[i]++;
                    }
                    f.command(i, 1.4 * std::sin(0.2 * seconds(f.t) + static_cast<double>(i)));
                }
                if (unbalance == 0.0) {
                    ASSERT_LT((f.momentum_N() - momentum).norm(), 1e-9 * momentum.norm()) << seconds(f.t);
                }
            });
            for (const int count : at_limit) {
                EXPECT_GT(count, 0);
            }
        }
    }
}

TEST(ReactionWheels, AWheelBeyondItsLimitIsNotBraked)
{
    // The body's turning may carry a wheel beyond its limit; the motor then just stops driving.
    Flyer f;
    one_wheel(f, 10.0);
    f.wheel_interface.par.Omega_max[0] = 10.0;
    f.prepare();
    f.push().torque_B = vec3(0, 0, -20.0);
    f.command(0, 0.2);
    f.fly(second, 100 * ms);
    EXPECT_NEAR(f.Omega(0), 11.0, 0.05);
    EXPECT_EQ(f.applied(0), 0.0);
}

TEST(ReactionWheels, ATorqueThatUnderflowsAtTheLimitLeavesTheStateFinite)
{
    Flyer f;
    one_wheel(f, 10.0);
    f.wheel_interface.par.Omega_max[0] = 10.0;
    f.prepare();
    f.command(0, 0.2);
    f.fly(second, 100 * ms);
    f.command(0, 1e-300);
    f.push().torque_B = vec3(0, 0, -1.0); // so that it is beyond its limit
    f.fly(second, 100 * ms);
    f.push().torque_B = vec3(0, 0, 0);
    f.command(0, 5e-324);
    f.fly(second, 100 * ms);
    EXPECT_GT(f.Omega(0), 10.0);
    EXPECT_LT(f.Omega(0), 11.0);
}

TEST(ReactionWheels, ViscousFrictionRunsAWheelDownExponentially)
{
    // J (dOmega + domega) = -c Omega and I domega = c Omega: dOmega = -c (1/J + 1/I) Omega
    const double c = 0.05;
    Flyer f;
    one_wheel(f, 40.0);
    f.wheel_interface.par.viscosity[0] = c;
    f.prepare();
    f.fly(60 * second, 100 * ms, [&] {
        const double Omega = 40.0 * std::exp(-c * (1.0 / J + 1.0 / I) * seconds(f.t));
        ASSERT_NEAR(f.Omega(0), Omega, 1e-8);
        ASSERT_NEAR(I * f.omega()[2] + J * (f.omega()[2] + f.Omega(0)), J * 40.0, 1e-12);
    });
}

TEST(ReactionWheels, CoulombFrictionStopsAWheelLinearlyAndThenHoldsIt)
{
    const double F = 0.1, rate = F * (1.0 / J + 1.0 / I), stop = 5.0 / rate;
    for (const double sign : {1.0, -1.0}) {
        Flyer f;
        one_wheel(f, sign * 5.0);
        f.wheel_interface.par.friction[0] = F;
        f.prepare();
        f.fly(60 * second, 70 * ms, [&] {
            const double t = seconds(f.t);
            if (t < stop) {
                ASSERT_NEAR(sign * f.Omega(0), 5.0 - rate * t, 1e-10);
            } else if (t > stop + 0.3) {
                ASSERT_NEAR(f.Omega(0), 0.0, 1e-4);
            }
        });
        EXPECT_NEAR(f.Omega(0), 0.0, 1e-12);
        EXPECT_NEAR(f.omega()[2], sign * J * 5.0 / (I + J), 1e-12); // all turns as one
    }
}

TEST(ReactionWheels, ARestingWheelIsHeldUntilTheMotorOvercomesFriction)
{
    const double F = 0.1;
    Flyer f;
    one_wheel(f);
    f.wheel_interface.par.friction[0] = F;
    f.prepare();
    f.command(0, 0.09);
    f.fly(10 * second, 100 * ms, [&] {
        ASSERT_NEAR(f.Omega(0), 0.0, 1e-12);
        ASSERT_NEAR(f.omega()[2], 0.0, 1e-12);
    });
    f.command(0, 0.15);
    f.fly(10 * second, 100 * ms);
    EXPECT_NEAR(f.Omega(0), (0.15 - F) * (1.0 / J + 1.0 / I) * 10.0, 1e-9);
}

TEST(ReactionWheels, AHeldWheelTurnsWithTheBody)
{
    const double L = 1.0;
    Flyer f;
    one_wheel(f);
    f.wheel_interface.par.friction[0] = 0.1; // J L / (I + J) = 0.024 is needed
    f.prepare();
    f.push().torque_B = vec3(0, 0, L);
    f.fly(20 * second, 100 * ms);
    EXPECT_NEAR(f.Omega(0), 0.0, 1e-9);
    EXPECT_NEAR(f.omega()[2], L / (I + J) * 20.0, 2e-4); // but for the first update's slip
    const double before = f.omega()[2];
    f.fly(10 * second, 100 * ms);
    EXPECT_NEAR(f.omega()[2] - before, L / (I + J) * 10.0, 1e-12);
}

TEST(ReactionWheels, FrictionFallsFromItsValueAtRestAsStribeckHasIt)
{
    const double F = 0.02, stiction = 0.1, stribeck = 2.0;
    const auto spinning = [&](double Omega, double u) {
        Flyer f;
        one_wheel(f, Omega);
        f.wheel_interface.par.friction[0] = F;
        f.wheel_interface.par.stiction[0] = stiction;
        f.wheel_interface.par.stribeck[0] = stribeck;
        f.prepare();
        f.command(0, u);
        f.step(ms);
        return (f.Omega(0) - Omega) / 1e-3 / (1.0 / J + 1.0 / I); // the torque on the wheel
    };
    for (const double Omega : {-8.0, -3.0, -0.5, 0.5, 1.0, 2.0, 4.0}) {
        const double friction = F + (stiction - F) * std::exp(-(Omega / stribeck) * (Omega / stribeck));
        EXPECT_NEAR(spinning(Omega, 0.3), 0.3 - std::copysign(friction, Omega), 1e-9) << Omega;
    }
    EXPECT_NEAR(spinning(0.0, 0.09), 0.0, 1e-12) << "it sticks";
    EXPECT_NEAR(spinning(0.0, -0.15), -0.05, 1e-9) << "it breaks away";
}

TEST(ReactionWheels, StoppingConvergesWithTheUpdatesLength)
{
    // A wheel driven to and fro through rest: the shorter the updates, the nearer to the limit.
    const auto fly = [](Ns dt) {
        std::vector<double> speeds;
        for (int k = 0; k < 10; k++) {
            Flyer f;
            one_wheel(f, 1.0 + 0.1 * k);
            f.wheel_interface.par.friction[0] = 0.1;
            f.wheel_interface.par.viscosity[0] = 0.02;
            f.prepare();
            for (int half = 0; half < 4; half++) {
                f.command(0, half % 2 ? 0.3 : -0.3);
                f.fly(6400 * ms, dt);
            }
            speeds.push_back(f.Omega(0));
        }
        return speeds;
    };
    const auto exact = fly(ms / 5);
    const auto worst = [&](Ns dt) {
        const auto speeds = fly(dt);
        double error = 0.0;
        for (std::size_t k = 0; k < speeds.size(); k++) {
            error = std::max(error, std::abs(speeds[k] - exact[k]));
        }
        return error;
    };
    const double coarse = worst(64 * ms), fine = worst(4 * ms); // of order 1
    EXPECT_LT(coarse, 0.02);
    EXPECT_LT(fine, coarse / 8.0);
}

TEST(ReactionWheels, FrictionDoesNotChatterInLongUpdates)
{
    for (const double viscosity : {0.0, 0.02, 2.0}) {
        Flyer f;
        one_wheel(f, 3.0);
        f.wheel_interface.par.friction[0] = 0.4;
        f.wheel_interface.par.viscosity[0] = viscosity;
        f.method = sim::make_adaptive(1e-10, 1e-12);
        f.prepare();
        f.fly(100 * second, 10 * second);
        EXPECT_NEAR(f.Omega(0), 0.0, 1e-3) << viscosity;
    }
}

TEST(ReactionWheels, FullSetsAndOddNumbersOfWheelsAct)
{
    for (std::size_t n = 1; n <= WHEELS_MAX; n++) {
        Flyer f;
        f.set_inertia(Vector3d(50.0, 60.0, 80.0).asDiagonal());
        for (std::size_t i = 0; i < n; i++) {
            const double angle = static_cast<double>(i);
            f.add_wheel({std::cos(angle), std::sin(angle), 0.5}, 0.1 + 0.01 * angle, 5.0 * angle);
        }
        f.prepare();
        Vector3d torque = Vector3d::Zero();
        for (std::size_t i = 0; i < n; i++) {
            f.command(i, 0.1 * static_cast<double>(i + 1));
            torque -= 0.1 * static_cast<double>(i + 1) * f.axis(i);
            EXPECT_NEAR(f.Omega(i), 5.0 * static_cast<double>(i), 1e-12);
        }
        f.step(ms); // the body starts at rest, so no gyroscopic torque acts yet
        const Vector3d rate = f.inertia().inverse() * torque * 1e-3;
        EXPECT_LT((f.omega() - rate).norm(), 1e-3 * rate.norm()) << n;
    }
}

TEST(ReactionWheels, FaultsOfMotorsAndSpeedsActFromTheirTimeOn)
{
    const auto fly = [](FaultKind kind, std::uint32_t channels, double size) {
        auto f = std::make_unique<Flyer>();
        one_wheel(*f, 40.0);
        f->wheel_interface.par.u_max[0] = 0.2;
        f->wheel_interface.par.Omega_max[0] = 600.0;
        f->wheel_interface.par.n_faults = 1;
        f->wheel_interface.par.faults[0] = {kind, channels, size, 10 * second, 20 * second};
        f->prepare();
        f->command(0, 0.1);
        f->fly(40 * second, 100 * ms);
        return f;
    };
    // The momentum that the wheel gained shows the torque between 10 s and 30 s, and the momentum is kept.
    const double gain = (1.0 / J + 1.0 / I);
    const std::vector<std::tuple<FaultKind, double, double>> motors = {
        {FAULT_NONE, 0, 0.1}, {FAULT_HIGH, 0, 0.2},     {FAULT_LOW, 0, -0.2},
        {FAULT_DEAD, 0, 0.0}, {FAULT_BIAS, 0.05, 0.15},
    };
    for (const auto &[kind, size, torque] : motors) {
        const auto f = fly(kind, 1, size);
        EXPECT_NEAR(f->Omega(0), 40.0 + gain * (0.1 * 20.0 + torque * 20.0), 1e-9) << kind;
        EXPECT_NEAR(f->momentum_N()[2], J * 40.0, 1e-9);
        EXPECT_EQ(f->applied(0), 0.1);
        EXPECT_EQ(f->wheel_interface.mem.saturated, 0u);
    }
    // A measured speed is wrong, and the wheel turns as it did.
    const auto sound = fly(FAULT_NONE, 0, 0.0), dead = fly(FAULT_DEAD, 1u << 8, 0.0);
    EXPECT_EQ(dead->Omega(0), sound->Omega(0));
    dead->wheel_interface.par.faults[0].lasts = 0;
    sound->step(100 * ms);
    dead->step(100 * ms);
    EXPECT_EQ(dead->Omega(0), 0.0);
    EXPECT_EQ(dead->omega()[2], sound->omega()[2]);
    EXPECT_EQ(dead->wheel_interface.out.speeds.head.quality, QUALITY_DEGRADED);
}

TEST(ReactionWheels, SetUpIsChecked)
{
    ReactionWheels wheel_interface{};
    ReactionWheelsModel wheels(wheel_interface);
    const auto method = sim::make_rk4();
    const auto prepare = [&] { wheels.prepare({"world.wheels", 1, method.get()}); };
    EXPECT_EQ(error_of(prepare), "world.wheels: there must be 1 to 8 wheels; found 0");
    wheel_interface.par.n = 2;
    wheel_interface.par.Omega_max[1] = 600.0;
    wheel_interface.par.Omega[1] = -700.0;
    EXPECT_EQ(error_of(prepare), "world.wheels.Omega[1]: the initial speed must be within "
                                 "Omega_max, 600 rad/s; found -700");
    EXPECT_THROW(prepare(), sim::SetupError);
    wheel_interface.par.Omega_max[1] = 0.0; // unlimited
    EXPECT_NO_THROW(prepare());
}

} // namespace reaction_wheels_model_test
