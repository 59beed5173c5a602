// SPDX-License-Identifier: Apache-2.0
// The models under the kernel, with the reader's tables of their interfaces.
#include "world/models.h"

#include "sim/simulation.h"
#include "world/dynamics/reaction_wheels_model.h"
#include "world/dynamics/spacecraft_model.h"
#include "world/environment/celestial_body_model.h"
#include "world/environment/harmonics.h"
#include "world/environment/testing/two_circles.h"
#include "world/sensors/navigation.h"

#include <gtest/gtest.h>

#include <cstring>
#include <string>
#include <thread>

namespace models_test {

using namespace fledge;
using namespace fledge::world;
using fledge::world::testing::TwoCircles;
using sim::Ns;

constexpr Ns ms = 1'000'000, second = 1000 * ms;

const sim::ModelType &type_of(const std::string &name)
{
    for (const sim::ModelType &type : models()) {
        if (type.interface->name == name) {
            return type;
        }
    }
    throw sim::SetupError("there is no model " + name);
}

template <typename Interface> Interface &interface_of(const std::shared_ptr<sim::Instance> &instance)
{
    return *reinterpret_cast<Interface *>(instance->memory());
}

/// A spacecraft with a wheel and a noisy navigation, in a world of its own.
struct World {
    sim::Simulation sim;
    std::shared_ptr<sim::Instance> craft, wheels, nav, sun;

    explicit World(std::uint64_t seed, bool adaptive, bool in_sky = false) : sim(seed)
    {
        sim::Process &world = sim.add_process("world");
        if (adaptive) {
            world.set_integrator(sim::make_adaptive(1e-9, 1e-9));
        }
        // The spacecraft stands before its part, so it is prepared first.
        craft = add(world, "craft", "Spacecraft");
        wheels = add(world, "wheels", "ReactionWheels");
        nav = add(world, "nav", "Navigation");

        auto &body = interface_of<Spacecraft>(craft).par;
        body.I_B = mat_rows(vec3(50, 0, 0), vec3(0, 60, 0), vec3(0, 0, 80));
        body.r_BN_N = vec3(7e6, 0, 0);
        body.v_BN_N = vec3(0, 2400, 300);
        body.omega_BN_B = vec3(0.1, -0.2, 0.05);
        auto &wheel = interface_of<ReactionWheels>(wheels).par;
        wheel.n = 1;
        wheel.axes_B[0] = vec3(1, 1, 0);
        wheel.J[0] = 0.1;
        wheel.Omega[0] = 40.0;
        wheel.friction[0] = 0.01;
        interface_of<Navigation>(nav).par.attitude_noise = vec3(1e-3, 1e-3, 1e-3);

        auto &model = dynamic_cast<SpacecraftModel &>(*craft->model());
        model.attach(dynamic_cast<Effector &>(*wheels->model()));
        GravityBody mars;
        mars.name = "mars";
        mars.mu = 4.2828314e13;
        if (in_sky) {
            HarmonicField field = HarmonicField::zero(mars.mu, 3.4e6, 6);
            field.C[HarmonicField::index(2, 2)] = 1e-4;
            mars.field = std::make_shared<const Harmonics>(field);
            mars.naif = TwoCircles::jupiter;
        }
        model.add_gravity(mars);

        std::vector<std::shared_ptr<sim::Instance>> run{craft, nav};
        if (in_sky) {
            run.push_back(put_in_sky(world));
        }
        world.add_task({"dynamics", 100 * ms, 0, 0, run});
        sim.connect(port(craft, "state"), port(nav, "truth"));
    }

    /// The craft flies about the larger circle; the sun attracts it, and is a model of its own.
    std::shared_ptr<sim::Instance> put_in_sky(sim::Process &world)
    {
        const auto sky = TwoCircles::sky(TwoCircles::jupiter, 2.0 - 6.0 / TwoCircles::day);
        auto &model = dynamic_cast<SpacecraftModel &>(*craft->model());
        model.add_gravity({.name = "sun", .mu = TwoCircles::mu_sun, .naif = TwoCircles::sun});
        model.set_sky(sky);
        sun = add(world, "sun", "CelestialBody");
        interface_of<CelestialBody>(sun).par.id = TwoCircles::sun;
        dynamic_cast<CelestialBodyModel &>(*sun->model()).set_sky(sky);
        return sun;
    }

    static sim::Port port(const std::shared_ptr<sim::Instance> &instance, const char *field)
    {
        return {instance, sim::find_field(instance->type(), field)};
    }

    static std::shared_ptr<sim::Instance> add(sim::Process &world, const char *name, const char *type)
    {
        auto instance = std::make_shared<sim::Instance>(type_of(type));
        for (std::size_t i = 0; i < instance->type().n; i++) {
            instance->given[i] = instance->type().fields[i].group == FLEDGE_PAR;
        }
        world.add(name, instance);
        return instance;
    }

    Navigation &navigation() { return interface_of<Navigation>(nav); }
};

TEST(Models, FlyUnderTheKernel)
{
    World w(1, false);
    w.sim.run_until(10 * second);
    const CraftState &state = interface_of<Spacecraft>(w.craft).out.state;
    EXPECT_EQ(state.head.t, 10 * second);
    EXPECT_EQ(w.navigation().out.attitude.head.t, 10 * second);
    EXPECT_EQ(w.navigation().out.attitude.head.quality, QUALITY_GOOD);
    EXPECT_LT(interface_of<ReactionWheels>(w.wheels).out.speeds.Omega[0], 40.0); // friction
    EXPECT_NEAR(state.r_BN_N.v[1], 24000.0, 20.0);
}

TEST(Models, SnapshotsAndClonesGoOnBitForBit)
{
    for (const auto &[adaptive, in_sky] : {std::pair{false, false}, {true, false}, {false, true}, {true, true}}) {
        World w(1, adaptive, in_sky);
        w.sim.run_until(5 * second);
        const auto there = w.sim.snapshot();
        const auto clone = w.sim.clone();
        w.sim.run_until(10 * second);
        const auto straight = w.sim.snapshot();
        clone->run_until(10 * second);
        EXPECT_EQ(clone->snapshot(), straight);
        w.sim.restore(there);
        w.sim.run_until(10 * second);
        EXPECT_EQ(w.sim.snapshot(), straight);
    }
}

TEST(Models, ClonesOnThreadsShareTheSkyAndNothingElse)
{
    World w(1, true, true);
    w.sim.run_until(second);
    std::vector<std::unique_ptr<sim::Simulation>> clones;
    std::vector<std::thread> threads;
    for (int i = 0; i < 3; i++) {
        clones.push_back(w.sim.clone());
    }
    for (const auto &clone : clones) {
        threads.emplace_back([&] { clone->run_until(20 * second); });
    }
    for (std::thread &thread : threads) {
        thread.join();
    }
    w.sim.run_until(20 * second);
    const auto sky_of = [](const sim::Simulation &sim) {
        const auto craft = sim.processes()[0]->find("craft");
        return dynamic_cast<SpacecraftModel &>(*craft->model()).sky();
    };
    for (const auto &clone : clones) {
        EXPECT_EQ(clone->snapshot(), w.sim.snapshot());
        EXPECT_EQ(sky_of(*clone), sky_of(w.sim));
    }
}

TEST(Models, ARunBeyondTheSkyIsRefusedBeforeItBegins)
{
    World w(1, false, true);
    std::string error;
    try {
        w.sim.run_until(19 * 86400 * second);
    } catch (const sim::SetupError &e) {
        error = e.what();
    }
    EXPECT_EQ(error.rfind("world.craft.gravity: SUN (10) is given from ", 0), 0u) << error;
    EXPECT_NE(error.find("\nworld.sun: SUN (10) is given from "), std::string::npos) << error;
    EXPECT_EQ(w.sim.now(), -1);
}

TEST(Models, APartOfNoSpacecraftIsRefused)
{
    std::size_t parts = 0;
    for (const sim::ModelType &type : models()) {
        sim::Simulation sim;
        sim::Process &world = sim.add_process("world");
        const auto part = World::add(world, "p", type.interface->name);
        if (!dynamic_cast<Effector *>(part->model())) {
            continue;
        }
        world.add_task({"all", second, 0, 0, {part}});
        std::string error;
        try {
            sim.prepare();
        } catch (const sim::SetupError &e) {
            error = e.what();
        }
        const std::string expected = type.interface->name + std::string(" world.p is a part of no spacecraft: ");
        EXPECT_NE(error.find(expected), std::string::npos) << error;
        parts++;
    }
    EXPECT_GT(parts, 10u);
}

TEST(Models, ResetRepeatsTheRunAndTheSeedChangesIt)
{
    World w(1, false), other(2, false);
    w.sim.run_until(second);
    other.sim.run_until(second);
    const Vec3 first = w.navigation().out.attitude.sigma_BN;
    EXPECT_NE(std::memcmp(&first, &other.navigation().out.attitude.sigma_BN, sizeof first), 0);
    w.sim.reset();
    w.sim.run_until(second);
    EXPECT_EQ(std::memcmp(&first, &w.navigation().out.attitude.sigma_BN, sizeof first), 0);
}

TEST(Models, ANewInertiaTakesEffectAtOnceAndTheStateStays)
{
    World w(1, false);
    w.sim.run_until(second);
    auto &craft = interface_of<Spacecraft>(w.craft);
    const Vec3 omega = craft.out.state.omega_BN_B;
    craft.par.I_B = mat_rows(vec3(100, 0, 0), vec3(0, 120, 0), vec3(0, 0, 160)); // twice
    w.sim.step();
    const Vec3 after = craft.out.state.omega_BN_B;
    EXPECT_LT(vec_norm(vec_sub(after, omega)), 0.01);

    // Against a simulation that began with it, from the same state.
    World fresh(1, false);
    auto &other = interface_of<Spacecraft>(fresh.craft);
    other.par.I_B = craft.par.I_B;
    fresh.sim.reset();
    w.sim.step();
    const auto bytes = w.sim.snapshot();
    fresh.sim.restore(bytes);
    w.sim.run_until(10 * second);
    fresh.sim.run_until(10 * second);
    EXPECT_EQ(w.sim.snapshot(), fresh.sim.snapshot());
}

} // namespace models_test
