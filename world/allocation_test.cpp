// SPDX-License-Identifier: Apache-2.0
// The world's loop takes nothing from the heap.
#include "sim/testing/allocations.h"
#include "world/dynamics/drag_model.h"
#include "world/dynamics/gravity_gradient_model.h"
#include "world/dynamics/solar_pressure_model.h"
#include "world/environment/atmosphere_model.h"
#include "world/environment/celestial_body_model.h"
#include "world/environment/harmonics.h"
#include "world/environment/planet_radiation_model.h"
#include "world/environment/testing/two_circles.h"
#include "world/sensors/navigation_model.h"
#include "world/testing/flyer.h"

#include <gtest/gtest.h>

#include <memory>

namespace allocation_test {

using namespace fledge;
using namespace fledge::world;
using namespace fledge::world::testing;

/// The air, the Sun and the parts of the craft that feel them.
struct Surroundings {
    Atmosphere air_interface{};
    AtmosphereModel air{air_interface};
    Sunlight light_interface{};
    SunlightModel light{light_interface};
    PlanetRadiation shine_interface{};
    PlanetRadiationModel shine{shine_interface};
    Drag drag_interface{};
    DragModel drag{drag_interface};
    SolarPressure solar_interface{};
    SolarPressureModel solar{solar_interface};
    GravityGradient gradient_interface{};
    GravityGradientModel gradient{gradient_interface};

    Surroundings(Flyer &f, GravityBody body, bool in_sky)
    {
        body.name = "BODY";
        GravityBody sun = body;
        body.J = {};
        sun.name = "SUN";
        sun.field = nullptr;
        sun.J = {};
        sun.mu = TwoCircles::mu_sun;
        sun.radius = 7e8;
        sun.naif = TwoCircles::sun;
        if (in_sky) {
            air.set_sky(f.craft.sky());
            light.set_sky(f.craft.sky());
            shine.set_sky(f.craft.sky());
        } else {
            sun.r_PN_N = {1.5e11, 0, 0};
        }
        air.set_body(body);
        air_interface.par.law = ATMOSPHERE_STANDARD_1976;
        light.set_body(sun);
        light.add_body(body);
        light_interface.par.oblate = light_interface.par.light_time = 1;
        shine.set_body(body);
        shine.set_source(light);
        shine_interface.par.law = in_sky ? PLANET_RADIATION_KNOCKE_1988 : PLANET_RADIATION_CONSTANT;
        shine_interface.par.albedo = 0.3;
        drag_interface.par.Cd = drag_interface.par.area = 1.0;
        solar_interface.par.Cr = solar_interface.par.area = 1.0;
        drag.set_source(air);
        solar.set_source(light);
        solar.further().back().consumer->set_source(shine);
        const sim::Setup setup{"world.part", 1, f.method.get()};
        for (sim::Model *model :
             {static_cast<sim::Model *>(&air), static_cast<sim::Model *>(&light), static_cast<sim::Model *>(&shine),
              static_cast<sim::Model *>(&drag), static_cast<sim::Model *>(&solar)}) {
            model->prepare(setup);
        }
        for (Effector *part :
             {static_cast<Effector *>(&drag), static_cast<Effector *>(&solar), static_cast<Effector *>(&gradient)}) {
            f.craft.attach(*part);
        }
    }
    void update(const Flyer &f)
    {
        air_interface.in.truth = light_interface.in.truth = shine_interface.in.truth = f.state();
        air.update({f.t, 100 * ms});
        light.update({f.t, 100 * ms});
        shine.update({f.t, 100 * ms});
    }
};

TEST(World, UpdatesDoNotAllocate)
{
    for (const auto &[adaptive, in_sky] : {std::pair{false, false}, {true, false}, {false, true}, {true, true}}) {
        Flyer f;
        if (adaptive) {
            f.method = sim::make_adaptive(1e-9, 1e-9);
        }
        f.set_inertia(Vector3d(50.0, 60.0, 80.0).asDiagonal());
        f.craft_interface.par.mass = 100.0;
        f.craft_interface.par.r_BN_N = vec3(7e6, 0, 0);
        f.craft_interface.par.v_BN_N = vec3(0, 2500, 1000);
        f.add_pyramid(0.16);
        f.wheel_interface.par.friction[0] = 0.01;
        f.wheel_interface.par.viscosity[1] = 0.01;
        f.wheel_interface.par.Omega_max[2] = 1.0;
        GravityBody body{.mu = 4.2828314e13, .radius = 3.4e6};
        body.J[0] = 2e-3;
        CelestialBody sun_interface{};
        CelestialBodyModel sun(sun_interface);
        if (in_sky) {
            HarmonicField field = HarmonicField::zero(body.mu, body.radius, 8);
            field.C[HarmonicField::index(2, 2)] = 1e-4;
            body = {};
            body.naif = TwoCircles::jupiter;
            body.field = std::make_shared<const Harmonics>(field);
            GravityBody far{.name = "SUN", .mu = TwoCircles::mu_sun, .naif = sun_interface.par.id = TwoCircles::sun};
            f.craft.add_gravity(far);
            const auto sky = TwoCircles::sky(TwoCircles::jupiter, 2.0 - 50.0 / TwoCircles::day);
            f.craft.set_sky(sky); // the records change on the way
            sun.set_sky(sky);
            sun.prepare({"world.sun", 1, f.method.get()});
            sun.reset(0);
        }
        f.craft.add_gravity(body);
        Surroundings around(f, body, in_sky);
        f.prepare();
        for (std::size_t i = 0; i < 4; i++) {
            f.command(i, 0.1);
        }
        f.push().force_B = vec3(1, 2, 3);
        Navigation nav_interface{};
        nav_interface.par.attitude_noise = vec3(0.01, 0.01, 0.01);
        NavigationModel nav(nav_interface);
        nav.prepare({"world.nav", 1, f.method.get()});
        nav.reset(0);

        const sim::testing::Allocations allocations;
        for (int i = 0; i < 1000; i++) {
            f.step(100 * ms);
            if (in_sky) {
                sun.update({f.t, 100 * ms});
            }
            nav_interface.in.truth = f.state();
            nav.update({f.t, 100 * ms});
            around.update(f);
        }
        EXPECT_EQ(allocations.count(), 0);
    }
    const sim::testing::Allocations allocations;
    const auto counted = std::make_unique<int>(1); // the counter does count
    EXPECT_EQ(allocations.count(), *counted);
}

} // namespace allocation_test
