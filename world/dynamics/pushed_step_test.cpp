// SPDX-License-Identifier: Apache-2.0
// Steps in registers of a craft that parts push, against the general way.
#include "world/actuators/thrusters_model.h"
#include "world/actuators/torque_rods_model.h"
#include "world/testing/flyer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

namespace pushed_step_test {

using namespace fledge;
using namespace fledge::world;
using namespace fledge::world::testing;

enum Kinds : unsigned { balanced = 1, jitter = 2, thrusters = 4, engine = 8, rods = 16, every_kind = 32, tanks = 32 };

/// A craft with these parts in a random order.
struct Pushed : Flyer {
    Magnetism field_interface{};
    MagnetismModel field{field_interface};
    Thrusters thruster_interfaces[2]{};
    ThrustersModel thruster_models[2] = {ThrustersModel(thruster_interfaces[0]),
                                         ThrustersModel(thruster_interfaces[1])};
    TorqueRods rod_interface{};
    TorqueRodsModel rod_model{rod_interface};
    Idle idle;
    std::mt19937 draw;

    double in(double lo, double hi) { return lo + (hi - lo) * static_cast<double>(draw()) / 4294967296.0; }
    Vector3d any(double size) { return {in(-size, size), in(-size, size), in(-size, size)}; }

    Pushed(unsigned kinds, unsigned seed, bool general) : draw(seed)
    {
        GravityBody body{.name = "EARTH", .mu = 3.986004415e14, .radius = 6378137.0};
        craft.add_gravity(body);
        field.set_body(body);
        field_interface.par.dipole_P = vec(any(1e16));
        field_interface.par.spin = in(0.0, 0.01);
        field.prepare({"world.field", 1, method.get()});
        auto &par = craft_interface.par;
        par.mass = 20.0;
        set_inertia(Vector3d(3.0, 4.0, 5.0).asDiagonal());
        par.center_B = seed % 2 ? vec(any(0.2)) : Vec3{};
        par.r_BN_N = vec3(7e6, 0, 1e6);
        par.v_BN_N = vec3(0, 5000, 5500);
        par.sigma_BN = vec(any(0.5));
        par.omega_BN_B = vec(any(0.3));
        std::vector<Effector *> parts;
        if (kinds & (balanced | jitter)) {
            for (std::uint32_t i = 0; i < 1 + seed % 4; i++) {
                const auto k = add_wheel(any(1.0), in(0.01, 0.02), in(-30.0, 30.0));
                if (kinds & jitter) {
                    wheel_interface.par.jitter = 1;
                    wheel_interface.par.unbalance[k] = in(0.0, 1e-3);
                    wheel_interface.par.couple[k] = in(0.0, 1e-4);
                    wheel_interface.par.r_WB_B[k] = vec(any(0.5));
                }
            }
            parts.push_back(&wheels);
        }
        for (std::size_t j = 0; j < 2; j++) {
            if (kinds & (j ? engine : thrusters)) {
                auto &thruster = thruster_interfaces[j].par;
                thruster.n = 2;
                for (std::size_t i = 0; i < thruster.n; i++) {
                    thruster.F[i] = in(0.1, 1.0);
                    thruster.r_TB_B[i] = vec(any(1.0));
                    thruster.axes_B[i] = vec(any(1.0));
                    thruster.rise[i] = i * 250 * ms;
                    thruster.fall[i] = i * 50 * ms;
                    thruster.isp[i] = kinds & tanks ? 100.0 : 0.0;
                }
                if (kinds & tanks) {
                    add_tanks(thruster);
                }
                parts.push_back(&thruster_models[j]);
            }
        }
        if (kinds & rods) {
            for (std::size_t i = 0; i < 3; i++) {
                rod_interface.par.axes_B[rod_interface.par.n++] = vec(any(1.0));
            }
            rod_model.set_source(field);
            parts.push_back(&rod_model);
        }
        std::ranges::shuffle(parts, draw);
        if (general) {
            parts.push_back(&idle);
        }
        for (Effector *part : parts) {
            part->prepare({"world.part", 1, method.get()});
            craft.attach(*part);
        }
        craft.prepare({"world.craft", 1, method.get()});
        reset();
    }

    /// One of each shape; in some runs they become empty.
    void add_tanks(auto &to)
    {
        to.n_tanks = 3;
        for (std::size_t i = 0; i < to.n_tanks; i++) {
            to.propellant[i] = in(1e-4, 4e-3);
            to.r_KB_B[i] = vec(any(0.3));
            to.radius[i] = 0.2;
            to.shape[i] = static_cast<TankShape>(i);
            to.fill[i] = 0.6;
            to.down_B[i] = vec(any(1.0));
        }
    }

    /// Change some inputs.
    void command_any(int i)
    {
        push().torque_B = vec(any(0.1));
        push().force_N = i % 3 ? vec(any(1.0)) : Vec3{};
        push().force_B = i % 2 ? vec(any(1.0)) : Vec3{};
        command(0, in(-0.1, 0.1));
        wheel_interface.par.viscosity[0] = i % 4 == 3 ? 1e-4 : 0.0;
        wheels.refresh();
        for (Thrusters &some : thruster_interfaces) {
            some.in.valves.head.quality = some.in.times.head.quality = QUALITY_GOOD;
            some.in.valves.open[0] = i % 2 == 0;
            some.in.times.on[1] = t + static_cast<Ns>(in(0, 4e8));
            some.in.times.off[1] = some.in.times.on[1] + static_cast<Ns>(in(0, 8e8));
        }
        rod_interface.in.command.head.quality = QUALITY_GOOD;
        rod_interface.in.command.dipole[i % 3] = in(-100.0, 100.0);
    }
};

std::vector<double> flown(unsigned kinds, unsigned seed, bool general)
{
    Pushed a(kinds, seed, general);
    std::vector<double> all;
    const auto add = [&](const Vec3 &x) { all.insert(all.end(), x.v, x.v + 3); };
    for (int i = 0; i < 160; i++) {
        if (i % 20 == 15) {
            a.command_any(i / 20);
        }
        a.step(i % 7 == 6 ? 30 * ms : 100 * ms);
        const auto *out = reinterpret_cast<const double *>(&a.craft_interface.out.state.r_BN_N);
        all.insert(all.end(), out, out + (sizeof(CraftState) - sizeof(Head)) / sizeof(double));
        add(a.rod_interface.out.torque.torque_B);
        add(vec3(a.Omega(0), a.thruster_interfaces[0].out.output.impulse[1],
                 a.thruster_interfaces[0].out.tanks.mass[2]));
    }
    const auto states = a.states();
    all.insert(all.end(), states.begin(), states.end());
    return all;
}

void expect_the_bits_of_the_general_way(unsigned kinds)
{
    for (unsigned seed = 0; seed < 8; seed++) {
        const std::vector<double> general = flown(kinds, seed, true);
        for (const auto &in_registers : in_all_registers([&] { return flown(kinds, seed, false); })) {
            ASSERT_EQ(in_registers.size(), general.size());
            EXPECT_EQ(std::memcmp(in_registers.data(), general.data(), general.size() * sizeof(double)), 0)
                << kinds << ", " << seed;
        }
    }
}

TEST(PushedParts, AStepInRegistersHasTheBitsOfTheGeneralWay)
{
    for (unsigned kinds = 0; kinds < every_kind; kinds++) {
        if (!((kinds & balanced) && (kinds & jitter))) {
            expect_the_bits_of_the_general_way(kinds);
        }
    }
}

TEST(PushedParts, AStepInRegistersWithTanksHasTheBitsOfTheGeneralWay)
{
    expect_the_bits_of_the_general_way(thrusters | tanks);
    expect_the_bits_of_the_general_way(thrusters | tanks | balanced);
}

} // namespace pushed_step_test
