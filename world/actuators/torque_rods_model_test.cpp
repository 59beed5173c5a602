// SPDX-License-Identifier: Apache-2.0
#include "world/actuators/torque_rods_model.h"

#include "sim/error.h"
#include "world/testing/flyer.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace torque_rods_model_test {

using namespace fledge;
using namespace fledge::world;
using namespace fledge::world::testing;

const Vector3d dipole(-3.6e14, 1.2e15, -7.6e15);

struct Craft : Flyer {
    Magnetism field_interface{};
    MagnetismModel field{field_interface};
    TorqueRods i{};
    TorqueRodsModel rods{i};

    Craft()
    {
        GravityBody body{.name = "EARTH", .mu = 3.986004415e14, .radius = 6378137.0};
        field.set_body(body);
        field_interface.par.dipole_P = vec(dipole);
        craft.add_gravity(body);
        craft_interface.par.mass = 100.0;
        set_inertia(Vector3d(5.0, 6.0, 8.0).asDiagonal());
        craft_interface.par.r_BN_N = vec3(7e6, 0, 1e6);
        craft_interface.par.v_BN_N = vec3(0, 5000, 5500);
        rods.set_source(field);
    }
    void add(const Vector3d &axis, double most)
    {
        i.par.m_max[i.par.n] = most;
        i.par.axes_B[i.par.n++] = vec(axis);
    }
    void prepare()
    {
        rods.prepare({"world.rods", 1, method.get()});
        field.prepare({"world.field", 1, method.get()});
        craft.attach(rods);
        Flyer::prepare();
    }
    void command(std::size_t k, double m)
    {
        i.in.command.head.quality = QUALITY_GOOD;
        i.in.command.dipole[k] = m;
    }
    double applied(std::size_t k) const { return i.out.applied.dipole[k]; }
    /// The field of the dipole, in B.
    Vector3d field_B() const
    {
        const double distance = r().norm();
        const Vector3d u = r() / distance;
        return dcm_BN() * (3.0 * dipole.dot(u) * u - dipole) / (distance * distance * distance);
    }
};

TEST(TorqueRods, GiveTheCrossProductOfDipoleAndField)
{
    std::mt19937 random(3);
    std::normal_distribution<double> normal;
    const auto any = [&] { return Vector3d(normal(random), normal(random), normal(random)); };
    for (int k = 0; k < 100; k++) {
        Craft c;
        Vector3d m = Vector3d::Zero();
        c.craft_interface.par.sigma_BN = vec(0.3 * any());
        c.craft_interface.par.r_BN_N = vec(7e6 * any().normalized());
        for (std::size_t j = 0; j < 1u + k % 8; j++) {
            const Vector3d axis = any();
            c.add(axis, 100.0);
            c.command(j, 10.0 * any()[0]);
            m += c.i.in.command.dipole[j] * axis.normalized();
        }
        c.prepare();
        c.step(100 * ms);
        const Vector3d torque = m.cross(c.field_B());
        ASSERT_LT((view(c.i.out.torque.torque_B) - torque).norm(), 1e-12 * m.norm() * c.field_B().norm());
        const Vector3d rate = c.inertia().inverse() * (torque - c.omega().cross(c.inertia() * c.omega()));
        ASSERT_LT((view(c.state().domega_BN_B) - rate).norm(), 1e-12 * rate.norm());
        ASSERT_EQ(c.i.mem.saturated, 0u);
    }
}

TEST(TorqueRods, ACompassNeedleSwingsAsThePendulumThatItIs)
{
    // In a constant field I d2(phi) = -m B sin(phi): without damping, the energy is kept, and the period of a small
    // swing is 2 pi sqrt(I / (m B)).
    Craft c;
    c.method = sim::make_adaptive(1e-12, 1e-12);
    c.add({1, 0, 0}, 0.0);
    c.craft_interface.par.v_BN_N = {};
    c.craft_interface.par.r_BN_N = vec3(7e6, 0, 0); // it falls, but by less than a meter
    c.field_interface.par.dipole_P = vec3(1e22, 0, 0);
    const double B = 2e22 / 3.43e20, m = 200.0, phi = 0.002;
    c.craft_interface.par.sigma_BN = vec3(0, 0, std::tan(0.25 * phi));
    c.prepare();
    c.command(0, m);
    const double rate = std::sqrt(m * B / 8.0);
    c.fly(400 * ms, 10 * ms, [&] {
        const double t = 1e-9 * static_cast<double>(c.t);
        ASSERT_NEAR(c.omega()[2], -phi * rate * std::sin(rate * t), 1e-5 * phi * rate);
    });
    EXPECT_GT(rate * 0.4, 6.3) << "more than a period";
}

TEST(TorqueRods, DipolesAreLimitedAndOffWithoutACommand)
{
    Craft c;
    c.add({1, 0, 0}, 20.0);
    c.add({0, 0, 1}, 0.0);
    c.prepare();
    c.i.in.command.dipole[0] = 5.0; // never written, by its head
    c.step(100 * ms);
    EXPECT_EQ(view(c.i.out.torque.torque_B).norm(), 0.0);
    c.command(0, -50.0);
    c.command(1, 1e4);
    c.step(100 * ms);
    EXPECT_EQ(c.applied(0), -20.0);
    EXPECT_EQ(c.applied(1), 1e4);
    EXPECT_EQ(c.i.mem.saturated, 1u);
    c.command(0, 7.0);
    c.step(100 * ms);
    EXPECT_EQ(c.applied(0), 7.0);
    EXPECT_EQ(c.i.mem.saturated, 1u);
}

TEST(TorqueRods, FlyTheSameBitsInNarrowRegisters)
{
    const auto ends = in_all_registers([] {
        Craft c;
        c.add({1, 0.2, 0}, 100.0);
        c.add({0, 1, -0.3}, 100.0);
        c.craft_interface.par.sigma_BN = vec3(0.1, 0.2, -0.3);
        c.craft_interface.par.omega_BN_B = vec3(0.1, -0.2, 0.3);
        c.i.in.command.head.quality = QUALITY_GOOD;
        c.i.in.command.dipole[0] = 50.0;
        c.i.in.command.dipole[1] = -70.0;
        c.prepare();
        c.fly(10 * second, 100 * ms);
        return c.states();
    });
    for (const auto &end : ends) {
        EXPECT_EQ(end, ends[0]);
    }
}

TEST(TorqueRods, TakeFaults)
{
    Craft c;
    c.add({1, 0, 0}, 20.0);
    c.add({0, 1, 0}, 20.0);
    c.i.par.n_faults = 1;
    c.i.par.faults[0] = {FAULT_HIGH, 2, 0.0, second, second};
    c.prepare();
    c.command(0, 3.0);
    c.command(1, -4.0);
    c.fly(second, 100 * ms, [&] { ASSERT_EQ(c.applied(1), -4.0); });
    c.fly(second, 100 * ms, [&] { ASSERT_EQ(c.applied(1), 20.0); });
    c.step(100 * ms);
    EXPECT_EQ(c.applied(1), -4.0);
    EXPECT_EQ(c.applied(0), 3.0);
    c.i.in.injected.head.quality = QUALITY_GOOD;
    c.i.in.injected.n = 1;
    c.i.in.injected.list[0] = {FAULT_BIAS, 2, -100.0, 0, 0};
    c.step(100 * ms);
    EXPECT_EQ(c.applied(1), -20.0) << "a rod with a fault has its limit";
    c.i.in.injected.list[0] = {FAULT_DEAD, 0, 0.0, 0, 0};
    c.step(100 * ms);
    EXPECT_EQ(view(c.i.out.torque.torque_B).norm(), 0.0);
}

TEST(TorqueRods, SetUpIsChecked)
{
    Craft c;
    c.add({1, 0, 0}, 0.0);
    c.i.par.n_faults = 1;
    c.i.par.faults[0].kind = FAULT_LOW;
    EXPECT_NE(error_of([&] { c.prepare(); }).find("world.rods.faults[0].size"), std::string::npos);
    Craft d;
    d.add({1, 0, 0}, 0.0);
    TorqueRodsModel lost(d.i);
    lost.prepare({"world.rods", 1, d.method.get()});
    EXPECT_NE(error_of([&] { lost.start({}, nullptr); }).find("world.rods.field is missing"), std::string::npos);
}

} // namespace torque_rods_model_test
