// SPDX-License-Identifier: Apache-2.0
#include "world/dynamics/spacecraft_model.h"

#include "sim/error.h"
#include "world/dynamics/orbit.h"
#include "world/testing/flyer.h"

#include <gtest/gtest.h>

#include <cstring>
#include <numbers>
#include <vector>

namespace spacecraft_model_test {

using namespace fledge;
using namespace fledge::world;
using namespace fledge::world::testing;

constexpr double pi = std::numbers::pi;
constexpr double mu_mars = 4.2828314e13;

GravityBody mars()
{
    GravityBody body{.name = "mars", .mu = mu_mars};
    return body;
}

/// An inertia with three different moments, turned out of the body axes.
Matrix3d skew_inertia()
{
    const Matrix3d R = rotation({0.3, -0.5, 0.2});
    return R * Vector3d(500.0, 700.0, 900.0).asDiagonal() * R.transpose();
}

void set_orbit(Flyer &f, double mu, const OrbitElements &elements)
{
    const OrbitState state = orbit_state(mu, elements);
    f.craft_interface.par.r_BN_N = vec(state.r);
    f.craft_interface.par.v_BN_N = vec(state.v);
}

// ---- What is conserved --------------------------------------------------------------------------

TEST(Spacecraft, TorqueFreeMotionKeepsMomentumAndEnergy)
{
    Flyer f;
    f.set_inertia(skew_inertia());
    f.craft_interface.par.sigma_BN = vec3(0.1, 0.2, -0.3);
    f.craft_interface.par.omega_BN_B = vec3(0.01, -0.02, 0.03);
    f.add_pyramid(0.16);
    for (int i = 0; i < 4; i++) {
        f.wheel_interface.par.Omega[i] = 20.0 * i - 25.0;
    }
    set_orbit(f, mu_mars, {.p = 6.3e6, .e = 0.4, .i = 0.5});
    f.craft.add_gravity(mars());
    f.prepare();

    const Vector3d momentum = f.momentum_N();
    const double energy = f.rotational_energy();
    const auto orbital = [&] { return 0.5 * f.v().squaredNorm() - mu_mars / f.r().norm(); };
    const double orbital_energy = orbital();
    const Vector3d orbital_momentum = f.r().cross(f.v());
    const double a = 6.3e6 / (1.0 - 0.16);
    const double period = 2.0 * pi * std::sqrt(a * a * a / mu_mars);
    f.fly(static_cast<Ns>(period * 10.0) * 100 * ms, 100 * ms, [&] {
        ASSERT_LT((f.momentum_N() - momentum).norm(), 1e-10 * momentum.norm());
        ASSERT_LT(std::abs(f.rotational_energy() - energy), 1e-10 * energy);
        ASSERT_LT(std::abs(orbital() - orbital_energy), 1e-10 * std::abs(orbital_energy));
        ASSERT_LT((f.r().cross(f.v()) - orbital_momentum).norm(), 1e-10 * orbital_momentum.norm());
    });
    // It did move: the body rate is not what it was.
    EXPECT_GT((f.omega() - view(f.craft_interface.par.omega_BN_B)).norm(), 1e-3);
}

TEST(Spacecraft, ASymmetricTopPrecessesAsTheClosedFormSays)
{
    // With H = A omega + ((C - A) omega3 + h) b3 the rate is H / A less a spin about b3, both of
    // them constant: [NB](t) = exp(H t / A) [NB](0) exp(-((C - A) omega3 + h) / A t b3).
    const double A = 700.0, C = 900.0, J = 0.16, Omega = 300.0;
    Flyer f;
    f.set_inertia(Vector3d(A, A, C).asDiagonal());
    f.craft_interface.par.sigma_BN = vec3(0.3, -0.2, 0.5);
    f.craft_interface.par.omega_BN_B = vec3(0.02, -0.01, 0.05);
    f.add_wheel({0, 0, 2}, J, Omega);
    f.prepare();
    const Matrix3d NB0 = f.dcm_BN().transpose();
    const Vector3d momentum = f.momentum_N();
    const double h = f.wheel_momentum(0);
    const double spin = ((C - A) * 0.05 + h) / A;
    f.fly(600 * second, 100 * ms, [&] {
        const double t = 1e-9 * static_cast<double>(f.t);
        const Matrix3d NB = rotation(momentum * (t / A)) * NB0 * rotation({0, 0, -spin * t});
        ASSERT_LT((f.dcm_BN() - NB.transpose()).norm(), 1e-8) << t;
        const Vector3d rate = NB.transpose() * momentum / A - Vector3d(0, 0, spin);
        ASSERT_LT((f.omega() - rate).norm(), 1e-9) << t;
    });
}

TEST(Spacecraft, AttitudeStaysInTheShortSetAndFollowsTheAngle)
{
    Flyer f;
    f.set_inertia(Matrix3d::Identity());
    f.craft_interface.par.omega_BN_B = vec3(0.3, -0.4, 1.2); // 1.3 rad/s about a fixed axis
    f.prepare();
    const Vector3d axis = Vector3d(0.3, -0.4, 1.2) / 1.3;
    f.fly(60 * second, 100 * ms, [&] {
        ASSERT_LE(vec_norm(f.state().sigma_BN), 1.0);
        const double angle = 1.3e-9 * static_cast<double>(f.t);
        ASSERT_LT((f.dcm_BN() - rotation(-angle * axis)).norm(), 1e-5) << f.t;
    });
}

TEST(Spacecraft, ALongInitialAttitudeBecomesItsShadow)
{
    Flyer f;
    f.set_inertia(Matrix3d::Identity());
    f.craft_interface.par.sigma_BN = vec3(0.0, 2.0, 0.0);
    f.prepare();
    EXPECT_EQ(f.state().sigma_BN.v[1], -0.5);
}

// ---- Integrators --------------------------------------------------------------------------------

/// A small, lively system in which everything acts: wheels with friction, forces, gravity.
void make_lively(Flyer &f)
{
    f.set_inertia(skew_inertia() / 100.0);
    f.craft_interface.par.mass = 10.0;
    f.craft_interface.par.r_BN_N = vec3(10.0, 0.0, 2.0);
    f.craft_interface.par.v_BN_N = vec3(0.0, 9.0, 1.0);
    f.craft_interface.par.omega_BN_B = vec3(0.3, -0.5, 0.4);
    f.add_wheel({1, 0, 0}, 0.1, 30.0);
    f.add_wheel({0, 1, 1}, 0.1, -20.0);
    for (int i = 0; i < 2; i++) {
        f.wheel_interface.par.viscosity[i] = 0.02;
        f.wheel_interface.par.friction[i] = 0.01;
    }
    GravityBody body = mars();
    body.mu = 1000.0;
    body.radius = 2.0;
    body.J = {0.1, 0.02, 0.0, 0.0, 0.01};
    body.pole_N = {1.0, 1.0, 3.0};
    body.r_PN_N = {0.5, 0.0, 0.0};
    body.v_PN_N = {0.0, 0.1, 0.0};
    f.craft.add_gravity(body);
    f.prepare();
    f.command(0, 0.3);
    f.command(1, -0.2);
    f.push().force_B = vec3(1.0, 2.0, 3.0);
    f.push().force_N = vec3(0.0, 1.0, 0.0);
    f.push().torque_B = vec3(0.1, 0.0, -0.2);
}

std::vector<double> outcome(const Flyer &f)
{
    std::vector<double> x;
    const Matrix3d dcm = f.dcm_BN();
    x.insert(x.end(), dcm.data(), dcm.data() + 9);
    for (int i = 0; i < 3; i++) {
        x.insert(x.end(), {f.r()[i], f.v()[i], f.omega()[i]});
    }
    x.insert(x.end(), {f.Omega(0), f.Omega(1)});
    return x;
}

double distance(const std::vector<double> &a, const std::vector<double> &b)
{
    double worst = 0.0;
    for (std::size_t i = 0; i < a.size(); i++) {
        worst = std::max(worst, std::abs(a[i] - b[i]));
    }
    return worst;
}

std::vector<double> fly_lively(std::unique_ptr<sim::Integrator> method, Ns dt)
{
    Flyer f;
    f.method = std::move(method);
    make_lively(f);
    f.fly(8 * second, dt);
    return outcome(f);
}

TEST(Spacecraft, RungeKuttaIsOfOrder4)
{
    const auto exact = fly_lively(sim::make_rk4(), ms);
    std::vector<double> errors;
    for (const Ns dt : {80 * ms, 40 * ms, 20 * ms}) {
        errors.push_back(distance(fly_lively(sim::make_rk4(), dt), exact));
    }
    EXPECT_NEAR(std::log2(errors[0] / errors[1]), 4.0, 0.3);
    EXPECT_NEAR(std::log2(errors[1] / errors[2]), 4.0, 0.3);
}

TEST(Spacecraft, TheAdaptiveMethodNeedsNoShortUpdates)
{
    // In one update of 8 s the body turns through several singularities of the MRP.
    const auto exact = fly_lively(sim::make_rk4(), ms);
    EXPECT_LT(distance(fly_lively(sim::make_adaptive(1e-11, 1e-11), 8 * second), exact), 1e-8);
    EXPECT_LT(distance(fly_lively(sim::make_adaptive(1e-11, 1e-11), 100 * ms), exact), 1e-8);
}

// ---- Translation --------------------------------------------------------------------------------

/// The true anomaly at time t after periapsis, by Kepler's equation or Barker's.
double true_anomaly(double mu, double p, double e, double t)
{
    if (e == 1.0) {
        const double w = 3.0 * std::sqrt(mu / (p * p * p)) * t;
        const double y = std::cbrt(w + std::sqrt(w * w + 1.0));
        return 2.0 * std::atan(y - 1.0 / y);
    }
    const long double q = p / (1.0L + e), mean_a = std::abs(q / (1.0L - e));
    const long double M = std::sqrt(mu / (mean_a * mean_a * mean_a)) * t;
    const auto kepler = [&](long double E) { return e < 1.0 ? E - e * std::sin(E) : e * std::sinh(E) - E; };
    long double lo = 0.0L, hi = e < 1.0 ? M + 1.0L : std::log(2.0L * M + 4.0L) + 1.0L;
    for (int i = 0; i < 200; i++) {
        const long double mid = 0.5L * (lo + hi);
        (kepler(mid) < M ? lo : hi) = mid;
    }
    const long double ratio = std::sqrt(std::abs((1.0L + e) / (1.0L - e)));
    return static_cast<double>(2.0L * std::atan(ratio * (e < 1.0 ? std::tan(0.5L * lo) : std::tanh(0.5L * lo))));
}

TEST(Spacecraft, FliesKeplerOrbitsOfEveryShape)
{
    for (const double e : {0.0, 0.4, 0.95, 0.9999, 1.0, 1.0001, 1.5, 4.0}) {
        Flyer f;
        f.method = sim::make_adaptive(1e-13, 1e-9);
        f.set_inertia(Matrix3d::Identity());
        OrbitElements elements{.p = 6.3e6, .e = e, .i = 0.7, .Omega = 1.1, .omega = 2.0};
        set_orbit(f, mu_mars, elements);
        f.craft.add_gravity(mars());
        f.prepare();
        for (int i = 0; i < 5; i++) {
            f.fly(1200 * second, 60 * second);
            elements.f = true_anomaly(mu_mars, elements.p, e, 1e-9 * static_cast<double>(f.t));
            const OrbitState exact = orbit_state(mu_mars, elements);
            EXPECT_LT((f.r() - exact.r).norm(), 1e-10 * exact.r.norm()) << "e = " << e;
            EXPECT_LT((f.v() - exact.v).norm(), 1e-10 * exact.v.norm()) << "e = " << e;
        }
    }
}

TEST(Spacecraft, RungeKuttaFliesTheMissionsOrbit)
{
    Flyer f;
    f.set_inertia(Matrix3d::Identity());
    OrbitElements elements{.p = semi_latus_rectum(7471.618e3, 0.4), .e = 0.4};
    set_orbit(f, mu_mars, elements);
    f.craft.add_gravity(mars());
    f.prepare();
    f.fly(6000 * second, 100 * ms);
    elements.f = true_anomaly(mu_mars, elements.p, 0.4, 6000.0);
    EXPECT_LT((f.r() - orbit_state(mu_mars, elements).r).norm(), 1e-4);
}

TEST(Spacecraft, GravityBodiesMoveAndAddUp)
{
    // A body seen from a frame that moves uniformly; two bodies of half the mass in one place.
    const auto fly = [](const Vector3d &at, const Vector3d &velocity, int parts) {
        Flyer f;
        f.set_inertia(Matrix3d::Identity());
        f.craft_interface.par.r_BN_N = vec(Vector3d(7e6, 0, 1e6) + at);
        f.craft_interface.par.v_BN_N = vec(Vector3d(100.0, 2300.0, 500.0) + velocity);
        for (int i = 0; i < parts; i++) {
            GravityBody body = mars();
            body.name = "part" + std::to_string(i);
            body.mu = mu_mars / parts;
            body.r_PN_N = at;
            body.v_PN_N = velocity;
            f.craft.add_gravity(body);
        }
        f.prepare();
        f.fly(1000 * second, second);
        return Vector3d(f.r() - at - 1000.0 * velocity);
    };
    const Vector3d zero = Vector3d::Zero();
    const Vector3d still = fly(zero, zero, 1);
    EXPECT_LT((fly({3e5, -2e5, 1e5}, {1e3, 2e3, -5e2}, 1) - still).norm(), 1e-6);
    EXPECT_LT((fly(zero, zero, 2) - still).norm(), 1e-6);
}

TEST(Spacecraft, TheNodeOfAnOblatePlanetsSatelliteDriftsAsTheoryHasIt)
{
    // dOmega/dt = -3/2 n J2 (R / p)^2 cos i to first order: it is off by a part of order J2.
    const double i = 0.9, e = 0.1, p = 8e6, R = 6378137.0, mu = 3.986004418e14;
    const double a = p / (1.0 - e * e), n = std::sqrt(mu / (a * a * a));
    for (const double J2 : {1e-3, 5e-4}) {
        Flyer f;
        f.method = sim::make_adaptive(1e-12, 1e-9);
        f.set_inertia(Matrix3d::Identity());
        set_orbit(f, mu, {.p = p, .e = e, .i = i});
        GravityBody earth = mars();
        earth.mu = mu;
        earth.radius = R;
        earth.J[0] = J2;
        f.craft.add_gravity(earth);
        f.prepare();
        const int orbits = 20;
        const double T = 2.0 * pi / n * orbits;
        f.fly(static_cast<Ns>(T / 60.0) * 60 * second, 60 * second);
        const OrbitElements now = orbit_elements(mu, {f.r(), f.v()});
        const double drift = now.Omega - 2.0 * pi; // westward
        const double theory = -1.5 * n * J2 * (R / p) * (R / p) * std::cos(i) * 1e-9 * static_cast<double>(f.t);
        EXPECT_NEAR(drift / theory, 1.0, 3.0 * J2);
    }
}

TEST(Spacecraft, ForcesActInTheirFrames)
{
    // Turning about the third axis at w, a force fixed in B describes a circle in N.
    const double w = 0.05, F = 3.0, mass = 2.0;
    Flyer f;
    f.set_inertia(Matrix3d::Identity());
    f.craft_interface.par.mass = mass;
    f.craft_interface.par.omega_BN_B = vec3(0, 0, w);
    f.prepare();
    f.push().force_B = vec3(F, 0, 0);
    f.push().force_N = vec3(0, 0, 1.0);
    f.fly(100 * second, 100 * ms);
    const double t = 100.0;
    const Vector3d v(F / mass * std::sin(w * t) / w, F / mass * (1.0 - std::cos(w * t)) / w, t / mass);
    EXPECT_LT((f.v() - v).norm(), 1e-8);
    EXPECT_NEAR(f.r()[2], 0.5 * t * t / mass, 1e-9);

    // A message that was never written is no force, whatever it holds.
    f.craft_interface.in.external.head.quality = QUALITY_NONE;
    const Vector3d before = f.v();
    f.fly(10 * second, 100 * ms);
    EXPECT_EQ(f.v(), before);
}

TEST(Spacecraft, TorqueTurnsTheBody)
{
    Flyer f;
    f.set_inertia(Vector3d(10.0, 20.0, 25.0).asDiagonal());
    f.prepare();
    f.push().torque_B = vec3(0, 0.4, 0);
    f.fly(30 * second, 100 * ms);
    EXPECT_NEAR(f.omega()[1], 0.6, 1e-13);
    EXPECT_NEAR(f.state().domega_BN_B.v[1], 0.02, 1e-16);
    EXPECT_LT((f.dcm_BN() - rotation({0, -9.0, 0})).norm(), 1e-8);
}

// ---- What it publishes --------------------------------------------------------------------------

TEST(Spacecraft, PublishesDerivativesOfWhatItPublishes)
{
    Flyer f;
    make_lively(f);
    f.fly(second, ms);
    const CraftState a = f.state();
    f.step(ms);
    const CraftState b = f.state();
    f.step(ms);
    const CraftState c = f.state();
    for (int i = 0; i < 3; i++) {
        EXPECT_NEAR((c.v_BN_N.v[i] - a.v_BN_N.v[i]) / 0.002, b.a_BN_N.v[i], 1e-4);
        EXPECT_NEAR((c.omega_BN_B.v[i] - a.omega_BN_B.v[i]) / 0.002, b.domega_BN_B.v[i], 1e-5);
    }
    EXPECT_EQ(c.head.t, f.t);
    EXPECT_EQ(c.head.quality, QUALITY_GOOD);
    EXPECT_EQ(c.head.sequence, a.head.sequence + 2);
}

TEST(Spacecraft, ResetPublishesTheInitialState)
{
    Flyer f;
    make_lively(f);
    f.fly(second, 100 * ms);
    f.craft.reset(5 * second);
    EXPECT_EQ(f.state().head.t, 5 * second);
    EXPECT_EQ(f.state().head.sequence, 1u);
    EXPECT_EQ(f.r(), Vector3d(10.0, 0.0, 2.0));
    EXPECT_NEAR(f.Omega(0), 30.0, 1e-12);
    EXPECT_EQ(f.wheel_interface.out.speeds.head.sequence, 1u);
}

TEST(Spacecraft, ParametersChangedBeforeAResetCount)
{
    Flyer f;
    f.set_inertia(Matrix3d::Identity());
    f.prepare();
    f.set_inertia(2.0 * Matrix3d::Identity());
    f.reset();
    f.push().torque_B = vec3(1, 0, 0);
    f.fly(second, 100 * ms);
    EXPECT_NEAR(f.omega()[0], 0.5, 1e-14);
}

// ---- Snapshots and clones -----------------------------------------------------------------------

std::vector<std::byte> bytes_of(std::span<const std::byte> span)
{
    return {span.begin(), span.end()};
}

void restore(std::span<std::byte> to, const std::vector<std::byte> &from)
{
    ASSERT_EQ(to.size(), from.size());
    std::memcpy(to.data(), from.data(), from.size());
}

TEST(Spacecraft, GoesOnFromItsMemoryBitForBit)
{
    for (const bool adaptive : {false, true}) {
        const auto method = [&] { return adaptive ? sim::make_adaptive(1e-9, 1e-9) : sim::make_rk4(); };
        Flyer f;
        f.method = method();
        make_lively(f);
        f.fly(second, 100 * ms);

        // Another one with another past, whose last inputs are the first one's next.
        Flyer g;
        g.method = method();
        make_lively(g);
        g.command(0, -0.1);
        g.push().force_B = vec3(0, 0, 9);
        g.fly(2 * second, 50 * ms);

        restore(g.craft.memory(), bytes_of(f.craft.memory()));
        restore(g.wheels.memory(), bytes_of(f.wheels.memory()));
        g.craft_interface = f.craft_interface;
        g.wheel_interface = f.wheel_interface;
        g.t = f.t;
        for (Flyer *each : {&f, &g}) {
            each->command(0, -0.1);
            each->push().force_B = vec3(0, 0, 9);
            each->fly(second, 100 * ms);
        }
        EXPECT_EQ(std::memcmp(&f.craft_interface.out, &g.craft_interface.out, sizeof f.craft_interface.out), 0);
        EXPECT_EQ(std::memcmp(&f.wheel_interface.out, &g.wheel_interface.out, sizeof f.wheel_interface.out), 0);
        EXPECT_EQ(bytes_of(f.craft.memory()), bytes_of(g.craft.memory()));
    }
}

TEST(Spacecraft, AStepInRegistersHasTheBitsOfTheGeneralWay)
{
    const int wide = sim::wide;
    for (unsigned choice = 0; choice < 48; choice++) {
        const unsigned wheels = choice % 3 + (choice % 3 ? 2 : 0); // 0, 3 or 4
        Flyer flyers[2];
        Idle idle;
        for (Flyer &f : flyers) {
            sim::wide = (choice & 16) == 0 ? wide : 0;
            f.set_inertia(skew_inertia() / 100.0);
            f.craft_interface.par.mass = 10.0;
            f.craft_interface.par.r_BN_N = vec3(10.0, 0.0, 2.0);
            f.craft_interface.par.v_BN_N = vec3(0.0, 9.0, 1.0);
            f.craft_interface.par.omega_BN_B = vec3(0.3, -0.5, 1.4); // through the shadow set
            f.craft_interface.par.center_B = choice & 4 ? vec3(0.1, 0.0, -0.2) : Vec3{};
            for (unsigned i = 0; i < wheels; i++) {
                f.add_wheel({1.0, 0.3 * i, -0.2}, 0.1, 30.0 - 20.0 * i);
                f.wheel_interface.par.friction[i] = 0.01;
            }
            for (unsigned i = 0; i < (choice & 8 ? 2 : 1); i++) {
                GravityBody body = mars();
                body.name += std::to_string(i);
                body.mu = 1e3;
                f.craft.add_gravity(body);
            }
            if (&f == &flyers[1]) {
                f.craft.attach(idle);
            }
            f.prepare();
            for (int i = 0; i < 100; i++) {
                if (i % 10 == 5) {
                    f.push().torque_B = vec3(0.1 * i, -0.2, 0.3);
                    f.command(0, 0.01 * (i - 50));
                }
                f.step(i % 7 == 6 ? 30 * ms : 100 * ms);
            }
        }
        sim::wide = wide;
        const auto &[plain, general] = flyers;
        EXPECT_EQ(bytes_of(flyers[0].craft.memory()), bytes_of(flyers[1].craft.memory())) << choice;
        EXPECT_EQ(std::memcmp(&plain.craft_interface.out, &general.craft_interface.out, sizeof(CraftState)), 0);
        EXPECT_EQ(bytes_of(flyers[0].wheels.memory()), bytes_of(flyers[1].wheels.memory()));
    }
}

TEST(Spacecraft, TakesOverPartsAndGravityOfAnother)
{
    Flyer f;
    make_lively(f);
    Flyer g;
    g.craft_interface = f.craft_interface;
    g.wheel_interface = f.wheel_interface;
    g.craft.copy_setup(
        f.craft, [&](const sim::Model *model) -> sim::Model * { return model == &f.wheels ? &g.wheels : nullptr; });
    ASSERT_EQ(g.craft.parts(), std::vector<sim::Model *>{&g.wheels});
    ASSERT_EQ(g.craft.gravity().size(), 1u);
    g.wheels.prepare({"world.wheels", 1, g.method.get()});
    g.craft.prepare({"world.craft", 1, g.method.get()});
    g.reset();
    f.reset();
    f.fly(second, 100 * ms);
    g.fly(second, 100 * ms);
    EXPECT_EQ(outcome(f), outcome(g));
}

// ---- Errors -------------------------------------------------------------------------------------

TEST(Spacecraft, AStateThatIsNotFiniteEndsTheRun)
{
    Flyer f;
    f.set_inertia(Matrix3d::Identity());
    f.craft_interface.par.r_BN_N = vec3(1, 2, 3);
    f.prepare();
    f.fly(second, 100 * ms);
    f.push().torque_B = vec3(0, NAN, 0);
    EXPECT_EQ(error_of([&] { f.step(100 * ms); }),
              "world.craft: the state at 1.1 s is not finite; last good state at 1 s: "
              "r_BN_N = [1, 2, 3] m, v_BN_N = [0, 0, 0] m/s, sigma_BN = [0, 0, 0], "
              "omega_BN_B = [0, 0, 0] rad/s");
    EXPECT_THROW(f.step(100 * ms), sim::RunError);
}

GravityBody solid_mars()
{
    GravityBody body = mars();
    body.radius = 3.397e6;
    return body;
}

TEST(Spacecraft, AFallIntoABodyEndsTheRun)
{
    for (const bool adaptive : {false, true}) {
        Flyer f;
        if (adaptive) {
            f.method = sim::make_adaptive(1e-10, 1e-6);
        }
        f.set_inertia(Matrix3d::Identity());
        f.craft_interface.par.r_BN_N = vec3(3.4e6, 0, 0);
        f.craft_interface.par.v_BN_N = vec3(-1000, 0, 0);
        f.craft.add_gravity(solid_mars());
        f.prepare();
        f.fly(2 * second, second);
        const std::string text = error_of([&] { f.step(second); });
        EXPECT_EQ(text.find("world.craft: inside mars at 3 s, at an altitude of -16."), 0u) << text;
        EXPECT_NE(text.find(" m over its radius of 3397000 m"), std::string::npos) << text;
        EXPECT_NE(text.find("; last good state at 2 s: r_BN_N = [3397992."), std::string::npos) << text;
        f.reset(); // leaves nothing behind
        f.fly(2 * second, second);
        EXPECT_THROW(f.step(second), sim::RunError);
    }
}

TEST(Spacecraft, APassageThroughABodyWithinAStepEndsTheRun)
{
    // Conics with periapsis a little below or above the surface, in updates that begin at any time of it.
    struct Method {
        std::unique_ptr<sim::Integrator> integrator;
        Ns dt;
    };
    for (const double e : {0.0001, 0.3, 0.9, 1.0, 3.0}) {
        for (int phase = 0; phase < 4; phase++) {
            for (const double altitude : {-30.0, 30.0}) {
                Method methods[] = {{sim::make_rk4(), 100 * ms},
                                    {sim::make_rk4(), 10 * second},
                                    {sim::make_adaptive(1e-12, 1e-6), second},
                                    {sim::make_adaptive(1e-12, 1e-6), 2000 * second}};
                for (Method &method : methods) {
                    Flyer f;
                    f.method = std::move(method.integrator);
                    f.set_inertia(Matrix3d::Identity());
                    const OrbitElements elements{
                        .p = (3.397e6 + altitude) * (1.0 + e), .e = e, .i = 0.7, .f = -0.5 - 2.5e-3 * phase};
                    set_orbit(f, mu_mars, elements);
                    f.craft.add_gravity(solid_mars());
                    f.prepare();
                    const std::string text = error_of([&] { f.fly(2000 * second, method.dt); });
                    if (altitude > 0.0) {
                        EXPECT_EQ(text, "") << e << " " << phase;
                        continue;
                    }
                    const std::size_t at = text.find("at an altitude of -");
                    ASSERT_NE(at, std::string::npos) << text << " " << e << " " << phase << " " << method.dt;
                    EXPECT_LE(std::stod(text.substr(at + 19)), 30.5) << text;
                }
            }
        }
    }
}

TEST(Spacecraft, ABodyWithoutASurfaceIsFlownThrough)
{
    const auto fly = [](double radius, std::optional<double> surface) {
        Flyer f;
        f.set_inertia(Matrix3d::Identity());
        set_orbit(f, mu_mars, {.p = 3e6, .e = 0.5, .f = -2.0});
        GravityBody body = mars();
        body.radius = radius;
        body.surface = surface;
        return error_of([&] {
            f.craft.add_gravity(body);
            f.prepare();
            f.fly(3000 * second, second);
        });
    };
    EXPECT_NE(fly(3.397e6, std::nullopt), "");
    EXPECT_NE(fly(3.397e6, 2.1e6), "") << "periapsis is at 2e6 m";
    EXPECT_EQ(fly(3.397e6, 1.9e6), "");
    EXPECT_EQ(fly(3.397e6, 0.0), "");
    EXPECT_EQ(fly(0.0, std::nullopt), "");
    EXPECT_NE(fly(0.0, -1.0).find("gravity body mars: surface must be >= 0; found -1"), std::string::npos);
}

TEST(Spacecraft, AnIntegratorsFailureNamesTheSpacecraft)
{
    Flyer f;
    f.method = sim::make_adaptive(1e-10, 1e-10);
    f.set_inertia(Matrix3d::Identity());
    f.craft_interface.par.r_BN_N = vec3(1000, 0, 0); // falls into a point mass
    GravityBody body = mars();
    body.mu = 1e9;
    f.craft.add_gravity(body);
    f.prepare();
    const std::string text = error_of([&] { f.step(10 * second); });
    EXPECT_EQ(text.find("world.craft: adaptive integrator, relative tolerance 1e-10"), 0u) << text;
    EXPECT_NE(text.find("; last good state at 0 s: r_BN_N = [1000, 0, 0] m"), std::string::npos) << text;
}

TEST(Spacecraft, AForceOnNoMassIsRefused)
{
    Flyer f;
    f.set_inertia(Matrix3d::Identity());
    f.prepare();
    f.push().torque_B = vec3(1, 0, 0);
    f.step(100 * ms); // a torque needs no mass
    f.push().force_B = vec3(0, 0.5, 0);
    EXPECT_EQ(error_of([&] { f.step(100 * ms); }),
              "world.craft.external: a force arrived at 0.1 s, force_N = [0, 0, 0] N and "
              "force_B = [0, 0.5, 0] N, but world.craft.mass is 0: give the spacecraft its mass");
}

TEST(Spacecraft, SetUpIsChecked)
{
    Flyer f;
    f.set_inertia(Matrix3d::Identity());
    f.add_wheel({1, 0, 0}, 0.1);
    f.craft.attach(f.wheels);
    EXPECT_EQ(error_of([&] { f.craft.attach(f.wheels); }), "spacecraft: the same part is attached twice");
    f.craft.prepare({"world.craft", 1, f.method.get()});
    Spacecraft other_interface{};
    SpacecraftModel other(other_interface);
    other.attach(f.wheels);
    EXPECT_EQ(error_of([&] {
                  other.prepare({"world.other", 1, f.method.get()});
              }),
              "world.other: one of its parts belongs to another spacecraft");

    f.craft.add_gravity(mars());
    EXPECT_EQ(error_of([&] { f.craft.add_gravity(mars()); }), "spacecraft: the gravity of mars is listed twice");
    EXPECT_EQ(error_of([&] {
                  f.craft.prepare({"world.craft", 1, f.method.get()});
              }),
              "world.craft.r_BN_N: must lie outside mars, of radius 0 m; found a distance of 0 m "
              "from its centre: give the spacecraft an orbit");
}

} // namespace spacecraft_model_test
