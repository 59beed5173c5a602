// SPDX-License-Identifier: Apache-2.0
#include "world/dynamics/solar_pressure_model.h"

#include "world/testing/bodies.h"

#include <gtest/gtest.h>

#include <numbers>

namespace solar_pressure_model_test {

using namespace fledge;
using namespace fledge::world;
using namespace fledge::world::testing;

constexpr double mu = 3.986004415e14, pi = std::numbers::pi, AU = 149597870700.0;
constexpr double pressure = 1361.0 / 299792458.0;

struct Craft {
    Assembly f;
    Sunlight light_interface{};
    SunlightModel light{light_interface};
    SolarPressure solar_interface{};
    SolarPressureModel solar{solar_interface};

    explicit Craft(const Vector3d &sun = {AU, 0, 0})
    {
        GravityBody body{.name = "EARTH", .mu = mu, .radius = 6378137.0};
        f.craft.add_gravity(body);
        body.name = "SUN";
        body.radius = 6.957e8;
        body.r_PN_N = sun;
        light.set_body(body);
        f.set_inertia(Vector3d(500.0, 700.0, 900.0).asDiagonal());
        f.craft_interface.par.mass = 100.0;
        f.craft_interface.par.r_BN_N = vec3(0, 7e6, 0);
        f.craft_interface.par.v_BN_N = vec3(-std::sqrt(mu / 7e6), 0, 0);
        solar.set_source(light);
        f.craft.attach(solar);
    }
    void prepare()
    {
        light.prepare({"world.light", 1, f.method.get()});
        solar.prepare({"world.solar", 1, f.method.get()});
        f.prepare();
    }
    Vector3d force() const { return view(solar_interface.out.load.force_B); }
    Vector3d torque() const { return view(solar_interface.out.load.torque_B); }
};

/// The force on a facet of 2 m^2 with its normal at an angle from the Sun, in units of the pressure times its area.
Vector3d on_facet(double angle, double specular, double diffuse)
{
    Craft c;
    auto &par = c.solar_interface.par;
    par.n = 1;
    par.areas[0] = 2.0;
    par.normals_B[0] = vec3(5.0 * std::cos(angle), 5.0 * std::sin(angle), 0);
    par.centres_B[0] = vec3(0, 0, 1);
    par.specular[0] = specular;
    par.diffuse[0] = diffuse;
    c.prepare();
    EXPECT_LT((c.torque() - Vector3d(0, 0, 1).cross(c.force())).norm(), 1e-20);
    return c.force() / (2.0 * pressure);
}

TEST(SolarPressure, OfAFacetDependsOnWhatItDoesWithTheLight)
{
    constexpr double near = 1e-4; // the Sun is 7e6 m beside the x axis
    const Vector3d s(1, 0, 0);
    for (const double angle : {0.0, 0.4, 1.0, 1.5}) {
        const Vector3d n(std::cos(angle), std::sin(angle), 0);
        const double cosine = std::cos(angle);
        // Absorbed light pushes along itself, a mirror is pushed along its normal, with twice the normal momentum.
        EXPECT_LT((on_facet(angle, 0, 0) + cosine * s).norm(), near);
        EXPECT_LT((on_facet(angle, 1, 0) + 2 * cosine * cosine * n).norm(), near);
        // What Lambert's law scatters leaves with 2/3 of its momentum along the normal.
        EXPECT_LT((on_facet(angle, 0, 1) + cosine * (s + 2.0 / 3.0 * n)).norm(), near);
        const Vector3d mixed = 0.5 * on_facet(angle, 1, 0) + 0.3 * on_facet(angle, 0, 1) + 0.2 * on_facet(angle, 0, 0);
        EXPECT_LT((on_facet(angle, 0.5, 0.3) - mixed).norm(), 1e-12);
    }
    for (const double angle : {1.6, 2.0, pi}) {
        EXPECT_EQ(on_facet(angle, 0.5, 0.3).norm(), 0.0);
    }
}

TEST(SolarPressure, TogetherWithGravityKeepsTheEnergyOfBoth)
{
    // A push that falls with the square of the distance has the potential K / d. Without eclipse.
    Craft c({-3e9, 2e9, 4e9}); // near, so that the push changes along the orbit
    c.solar_interface.par.Cr = 1.3;
    c.solar_interface.par.area = 20.0;
    c.f.method = sim::make_adaptive(1e-13, 1e-9);
    c.prepare();
    const double K = pressure * AU * AU * 1.3 * 20.0 / 100.0;
    const auto push = [&] { return K / (c.f.r() - Vector3d(-3e9, 2e9, 4e9)).norm(); };
    const auto energy = [&] { return 0.5 * c.f.v().squaredNorm() - mu / c.f.r().norm() + push(); };
    const double before = energy(), push_before = push(), kinetic = 0.5 * c.f.v().squaredNorm();
    double most = 0.0;
    c.f.fly(20'000 * second, 50 * second, [&] {
        most = std::max(most, std::abs(push() - push_before));
        ASSERT_LT(std::abs(energy() - before), 1e-11 * kinetic);
    });
    EXPECT_GT(most, 1e-6 * kinetic); // 1e5 times what is allowed
}

TEST(SolarPressure, DrawsACircularOrbitOutAcrossTheSun)
{
    // The averaged equations: de/dt = 3/2 sqrt(a / mu) F at a right angle to the Sun, and the size of the orbit stays.
    Craft c;
    c.solar_interface.par.Cr = 1.0;
    c.solar_interface.par.area = 1000.0;
    c.prepare();
    const double a = 7e6, F = pressure * 1000.0 / 100.0, period = 2 * pi * std::sqrt(a * a * a / mu);
    c.f.fly(static_cast<Ns>(20 * period) / 10 * 10 * second, 10 * second);
    const double t = 1e-9 * static_cast<double>(c.f.t);
    const Vector3d h = c.f.r().cross(c.f.v()), e = c.f.v().cross(h) / mu - c.f.r().normalized();
    // The averages of de = (2 (F . v) r - (F . r) v - (r . v) F) / mu over a circle about z, for a push along -x.
    const Vector3d wanted = 1.5 * std::sqrt(a / mu) * F * t * Vector3d(0, 1, 0);
    EXPECT_GT(wanted.norm(), 1e-3);
    EXPECT_LT((e - wanted).norm(), 0.01 * wanted.norm());
    const double axis = 1.0 / (2.0 / c.f.r().norm() - c.f.v().squaredNorm() / mu);
    EXPECT_LT(std::abs(axis - a), 30.0) << "4 F a^3 / mu = 62 m is what it varies within a revolution";
}

TEST(SolarPressure, StopsInTheShadow)
{
    Craft c;
    c.solar_interface.par.Cr = 1.0;
    c.solar_interface.par.area = 1.0;
    GravityBody earth{.name = "EARTH", .mu = mu, .radius = 6378137.0};
    c.light.add_body(earth);
    c.prepare();
    // The orbit lies in the plane of the Sun: it is in the shadow for 2 asin(R / a) of its turn, but for the penumbra.
    double dark = 0.0, all = 0.0;
    const double period = 2 * pi * std::sqrt(7e6 * 7e6 * 7e6 / mu);
    c.f.fly(static_cast<Ns>(period) * second, second, [&] {
        const double lit = c.force().norm() / pressure;
        EXPECT_LT(lit, 1.001);
        dark += 1.0 - std::min(lit, 1.0);
        all += 1.0;
    });
    EXPECT_NEAR(dark / all, std::asin(6378137.0 / 7e6) / pi, 2e-4);
}

TEST(SolarPressure, FacetsOnAPanelTurnWithIt)
{
    // As facets of the body that have its place and direction; the force turns the panel about its hinge.
    const Vector3d hinge(0.1, 0.5, 0.2), axis = Vector3d(0.3, 1.0, 0.2).normalized(), normal(1.0, 0.2, 0.3);
    const Vector3d centre(0.3, 1.4, -0.1);
    const Matrix3d turn = rotation(0.4 * axis);
    Craft mounted, fixed;
    for (Craft *c : {&mounted, &fixed}) {
        auto &par = c->solar_interface.par;
        const bool is_fixed = c == &fixed;
        par.n = 1;
        par.areas[0] = 2.0;
        par.specular[0] = 0.3;
        par.diffuse[0] = 0.2;
        par.panel[0] = is_fixed ? 0 : 1;
        par.normals_B[0] = vec(is_fixed ? Vector3d(turn * normal) : normal);
        par.centres_B[0] = vec(is_fixed ? Vector3d(hinge + turn * (centre - hinge)) : centre);
        // A hub that the panel does not move, turned so that the axis matters.
        c->f.craft_interface.par.mass = 1e12;
        c->f.set_inertia(1e12 * Matrix3d::Identity());
        c->f.craft_interface.par.sigma_BN = vec3(0.1, -0.05, 0.07);
        c->f.add_panel(1.0, 0.1 * Matrix3d::Identity(), hinge, axis, {0, 0, 0});
        c->f.panel_interface.par.theta[0] = 0.4;
        c->solar.further()[0].consumer->set_source(c->f.panels);
        c->light.prepare({"world.light", 1, c->f.method.get()});
        c->solar.prepare({"world.solar", 1, c->f.method.get()});
        c->f.prepare_all();
    }
    EXPECT_GT(mounted.force().norm(), pressure);
    EXPECT_LT((mounted.force() - fixed.force()).norm(), 1e-14 * mounted.force().norm());
    EXPECT_LT((mounted.torque() - fixed.torque()).norm(), 1e-14 * mounted.torque().norm());
    mounted.f.fly(10 * second, second);
    fixed.f.fly(10 * second, second);
    const auto moved = [](const Craft &c) { return c.f.panel_interface.out.angles.theta[0] - 0.4; };
    const double torque = axis.dot((turn * (centre - hinge)).cross(fixed.force()));
    EXPECT_NEAR(moved(mounted) - moved(fixed), 0.5 * torque / 0.1 * 100.0, 1e-3 * std::abs(moved(mounted)));
}

/// Over the night side of a planet that is equally warm all over.
struct Night : Craft {
    PlanetRadiation radiation_interface{};
    PlanetRadiationModel radiation{radiation_interface};
    static constexpr double R = 6378137.0, E = 1361.0, warm = 0.7 * E / 4.0 / 299792458.0; ///< [Pa] over its ground

    Night()
    {
        GravityBody earth{.name = "EARTH", .mu = mu, .radius = R};
        light.add_body(earth);
        radiation.set_body(earth);
        radiation.set_source(light);
        radiation_interface.par.emissivity = 0.7;
        radiation_interface.par.rings = 5;
        f.craft_interface.par.r_BN_N = vec3(-8e6, 0, 0);
        solar.further().back().consumer->set_source(radiation);
    }
    Vector3d fly()
    {
        radiation.prepare({"world.shine", 1, f.method.get()});
        prepare();
        return force();
    }
    /// On a facet of 2 m^2 that looks down at an angle.
    Vector3d on_facet(double angle, double diffuse_infrared)
    {
        auto &par = solar_interface.par;
        par.n = 1;
        par.areas[0] = 2.0;
        par.normals_B[0] = vec3(std::cos(angle), std::sin(angle), 0);
        par.centres_B[0] = vec3(0, 0, 1);
        par.specular[0] = 0.5; // of visible light
        par.diffuse_infrared[0] = diffuse_infrared;
        return fly();
    }
};

TEST(SolarPressure, OfAPlanetsWarmth)
{
    const double sine2 = (Night::R / 8e6) * (Night::R / 8e6), cosine = std::sqrt(1 - sine2);
    Night sphere;
    sphere.solar_interface.par.Cr = 1.2;
    sphere.solar_interface.par.area = 3.0;
    EXPECT_LT((sphere.fly() + 1.2 * 3.0 * Night::warm * sine2 * Vector3d(1, 0, 0)).norm(), 1e-10 * Night::warm);
    // A plate that looks down absorbs the momentum of the integral of the cosine squared over the disc of the planet,
    const double normal = 2.0 / 3.0 * (1 - cosine * cosine * cosine) * Night::warm * 2.0;
    EXPECT_NEAR(Night().on_facet(0.0, 0.0)[0], -normal, 2e-3 * normal);
    // and what it scatters pushes it by 2/3 of the light that it received.
    const double scattered = 2.0 / 3.0 * sine2 * Night::warm * 2.0;
    EXPECT_NEAR(Night().on_facet(0.0, 1.0)[0], -normal - scattered, 2e-3 * normal);
    // At its side it sees half the planet; the other side is dark.
    EXPECT_LT(Night().on_facet(pi / 2, 0.0)[0], -0.1 * normal);
    EXPECT_LT(Night().on_facet(pi / 2, 0.0)[1], -0.1 * normal);
    EXPECT_EQ(Night().on_facet(pi, 0.0).norm(), 0.0);
    Night turned;
    turned.on_facet(0.3, 0.2);
    EXPECT_LT((turned.torque() - Vector3d(0, 0, 1).cross(turned.force())).norm(), 1e-20);
}

TEST(SolarPressure, OfAPlanetIsAddedToThatOfTheSun)
{
    const auto fly = [](double albedo, double emissivity) {
        Night day;
        day.solar_interface.par.Cr = day.solar_interface.par.area = 1.0;
        day.radiation_interface.par.albedo = albedo;
        day.radiation_interface.par.emissivity = emissivity;
        day.f.craft_interface.par.r_BN_N = vec3(8e6, 0, 0);
        return day.fly()[0];
    };
    const double sun = fly(0, 1e-9), warm = fly(0, 0.7), bright = fly(0.3, 0.7);
    EXPECT_NEAR(sun, -pressure, 1e-3 * pressure);
    EXPECT_NEAR(warm - sun, 0.7 / 4.0 * 0.6356 * pressure, 1e-3 * pressure);
    EXPECT_GT(bright - warm, 0.5 * 0.3 * 0.6356 * pressure);
    EXPECT_LT(bright - warm, 0.3 * 0.6356 * pressure);
}

TEST(SolarPressure, FollowsANewAlbedoAtOnce)
{
    Night day;
    day.solar_interface.par.Cr = day.solar_interface.par.area = 1.0;
    day.f.craft_interface.par.r_BN_N = vec3(8e6, 0, 0);
    const double before = day.fly()[0];
    day.radiation_interface.par.albedo = 0.5;
    day.radiation.refresh();
    day.f.step(ms);
    EXPECT_GT(day.force()[0], before + 0.1 * pressure);
}

TEST(SolarPressure, NamesWhatIsWrong)
{
    Craft none;
    EXPECT_EQ(error_of([&] { none.prepare(); }),
              "world.solar.area is 0 m^2 and Cr 0, and there are no facets: nothing feels the light");
    none.solar_interface.par.n = 2;
    none.solar_interface.par.specular[1] = 0.7;
    none.solar_interface.par.diffuse[1] = 0.5;
    EXPECT_EQ(error_of([&] { none.prepare(); }), "world.solar.diffuse[1]: the shares that a facet reflects, "
                                                 "specular and diffuse, must not exceed 1; found 1.2");
    EXPECT_FALSE(none.solar.set_source(none.f.craft));
    EXPECT_EQ(error_of([&] { none.solar.start({}, nullptr); }),
              "world.solar.light is missing: a model of the same world, as in `w.light = world.Sunlight(...)`");
    Night elsewhere;
    elsewhere.solar_interface.par.Cr = elsewhere.solar_interface.par.area = 1.0;
    EXPECT_EQ(error_of([&] { elsewhere.prepare(); }),
              "world.solar.radiation is a model outside of the same world, as in `w.radiation = "
              "world.PlanetRadiation(...)`");
}

} // namespace solar_pressure_model_test
