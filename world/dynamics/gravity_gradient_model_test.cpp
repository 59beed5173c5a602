// SPDX-License-Identifier: Apache-2.0
#include "world/dynamics/gravity_gradient_model.h"

#include "world/testing/bodies.h"

#include <gtest/gtest.h>

#include <numbers>
#include <vector>

namespace gravity_gradient_model_test {

using namespace fledge;
using namespace fledge::world;
using namespace fledge::world::testing;

constexpr double mu = 3.986004415e14, pi = std::numbers::pi;

struct Craft {
    Flyer f;
    GravityGradient gradient_interface{};
    GravityGradientModel gradient{gradient_interface};

    Craft()
    {
        f.craft_interface.par.mass = 1000.0;
        f.set_inertia(Vector3d(500.0, 12250.0, 12250.0).asDiagonal());
        f.craft.attach(gradient);
    }
    void add(const char *name, double its_mu, const Vector3d &r)
    {
        f.craft.add_gravity({.name = name, .mu = its_mu, .r_PN_N = r});
    }
    void prepare()
    {
        gradient.prepare({"world.gradient", 1, f.method.get()});
        f.prepare();
    }
    Vector3d torque() const { return view(gradient_interface.out.load.torque_B); }
};

TEST(GravityGradient, IsTheMomentOfTheWeightsOfManyPoints)
{
    // Points at some 100 m from the centre of mass: their weights' moment is the torque but for (100 m / r)^2.
    const std::vector<Vector3d> half = {{90, 20, -10}, {-30, 70, 20}, {10, -40, 60}};
    Matrix3d I = Matrix3d::Zero();
    std::vector<Vector3d> points;
    for (const Vector3d &p : half) {
        for (const double sign : {1.0, -1.0}) {
            points.push_back(sign * p);
            I += 10.0 * (p.squaredNorm() * Matrix3d::Identity() - p * p.transpose());
        }
    }
    Craft c;
    c.f.set_inertia(I);
    c.add("EARTH", mu, {0, 0, 0});
    c.add("MOON", 0.3 * mu, {-1e7, 3e6, 0}); // a large one, near
    const Vector3d r(5e6, -3e6, 4e6);
    c.f.craft_interface.par.r_BN_N = vec(r);
    c.f.craft_interface.par.sigma_BN = vec3(0.2, 0.1, -0.4);
    c.prepare();
    Vector3d torque(0, 0, 0);
    const Matrix3d BN = c.f.dcm_BN();
    for (const Vector3d &p : points) {
        for (const GravityBody &body : c.f.craft.gravity()) {
            const Vector3d d = r - body.r_PN_N + BN.transpose() * p;
            torque += p.cross(BN * (-10.0 * body.mu / std::pow(d.norm(), 3) * d));
        }
    }
    EXPECT_GT(torque.norm(), 1e-3);
    EXPECT_LT((c.torque() - torque).norm(), 1e-8 * torque.norm());
    const Vector3d domega = view(c.f.state().domega_BN_B);
    EXPECT_LT((I * domega - c.torque()).norm(), 1e-12 * torque.norm());
}

/// In a circular orbit, at rest in the frame of radius (x), way (y) and normal (z) but for a small turn.
struct Librating : Craft {
    explicit Librating(const Vector3d &turn)
    {
        add("EARTH", mu, {0, 0, 0});
        const double a = 6.8e6, n = std::sqrt(mu / (a * a * a));
        f.craft_interface.par.r_BN_N = vec3(a, 0, 0);
        f.craft_interface.par.v_BN_N = vec3(0, a * n, 0);
        f.craft_interface.par.sigma_BN = vec(turn / 4.0);
        // Without spin about the long axis, which would tilt the mean attitude.
        const Vector3d omega = rotation(-turn) * Vector3d(0, 0, n);
        f.craft_interface.par.omega_BN_B = vec3(0, omega[1], omega[2]);
        f.method = sim::make_adaptive(1e-12, 1e-13);
    }
};

/// The frequency of a component of the body's long axis in the orbit's frame, over the mean motion, by its zeros.
double frequency(Craft &c, int component)
{
    c.prepare();
    const double n = c.f.craft_interface.par.v_BN_N.v[1] / c.f.craft_interface.par.r_BN_N.v[0];
    const auto value = [&] {
        const Vector3d x = c.f.r().normalized(), z = c.f.r().cross(c.f.v()).normalized();
        const Vector3d axis = c.f.dcm_BN().transpose().col(0);
        return component == 2 ? axis.dot(z) : axis.dot(z.cross(x));
    };
    double last = value(), first = 0.0, at = 0.0;
    int zeros = 0;
    c.f.fly(60'000 * second, 10 * second, [&] {
        const double now = value();
        if ((now > 0.0) != (last > 0.0)) {
            at = 1e-9 * static_cast<double>(c.f.t) - 10.0 * now / (now - last);
            first = zeros++ ? first : at;
        }
        last = now;
    });
    EXPECT_GT(zeros, 20);
    return pi * (zeros - 1) / (at - first) / n;
}

TEST(GravityGradient, LibratesWithTheFrequenciesOfTheTextbook)
{
    // Of a cylinder that hangs along the radius and does not spin about its axis, in plane n sqrt(3 (Iy - Ix) / Iz),
    // out of plane n sqrt(1 + 3 (Iz - Ix) / Iy): the equations of roll and yaw, of which yaw has no restoring torque.
    const double share = (12250.0 - 500.0) / 12250.0;
    Librating in_plane({0, 0, 1e-4}), out_of_plane({0, 1e-4, 0});
    EXPECT_NEAR(frequency(in_plane, 1), std::sqrt(3.0 * share), 1e-6);
    EXPECT_NEAR(frequency(out_of_plane, 2), std::sqrt(1.0 + 3.0 * share), 1e-6);
}

TEST(GravityGradient, KeepsTheEnergyInTheTurningFrame)
{
    // On a circular orbit with the rate n about z, 1/2 omega I omega - n z . I omega + 3/2 n^2 x . I x is constant.
    Librating c({0.3, 0.5, -0.4});
    c.f.set_inertia(Vector3d(5000.0, 9000.0, 12250.0).asDiagonal());
    c.prepare();
    const double n = c.f.v().norm() / c.f.r().norm();
    const auto energy = [&] {
        const Vector3d x = c.f.dcm_BN() * c.f.r().normalized();
        const Vector3d z = c.f.dcm_BN() * Vector3d::UnitZ(), h = c.f.inertia() * c.f.omega();
        return 0.5 * c.f.omega().dot(h) - n * z.dot(h) + 1.5 * n * n * x.dot(c.f.inertia() * x);
    };
    const double before = energy(), scale = n * n * 12250.0;
    const Vector3d start = c.f.dcm_BN() * c.f.r().normalized();
    double most = 0.0;
    c.f.fly(30'000 * second, 30 * second, [&] {
        ASSERT_LT(std::abs(energy() - before), 1e-9 * scale);
        most = std::max(most, (c.f.dcm_BN() * c.f.r().normalized() - start).norm());
    });
    EXPECT_GT(most, 0.3);
}

/// A craft with parts in a circular orbit of C, of radius a and rate n, at rest in the frame of radius (x), way (y) and
/// normal (z). Bodies of points follow the gradient alone, so that any size of the orbit will do.
struct Circling : Assembly {
    double n = 0.1, radius = 1000.0;
    GravityGradient gradient_interface{};
    GravityGradientModel gradient{gradient_interface};

    Circling()
    {
        method = sim::make_adaptive(1e-12, 1e-12);
        craft_interface.par.omega_BN_B = vec3(0, 0, n);
        gradient.prepare({"world.gradient", 1, method.get()});
        craft.attach(gradient);
    }
    void prepare()
    {
        craft.add_gravity({.name = "EARTH", .mu = n * n * radius * radius * radius});
        auto &par = craft_interface.par;
        par.r_BN_N = vec3(radius, 0, 0);
        par.v_BN_N = vec3(0, n * radius, 0);
        prepare_all();
        par.r_BN_N = vec_sub(vec_scale(2.0, par.r_BN_N), state().r_CN_N);
        par.v_BN_N = vec_sub(vec_scale(2.0, par.v_BN_N), state().v_CN_N);
        reset();
    }
    /// A hub that no part can move.
    void make_heavy()
    {
        craft_interface.par.mass = 1e12;
        set_inertia(1e12 * Matrix3d::Identity());
    }
};

TEST(GravityGradient, PartsMoveInTheOrbitsFrameAsClosedFormsSay)
{
    // Near the centre of mass, a mass feels 3 n^2 x along the radius, -n^2 z along the normal, nothing along the way,
    // and the frame's own turning. Hanging along the radius, a rod on a hinge along z swings with sqrt(3) n, on one
    // along y with 2 n; so do spherical pendulums.
    Circling c;
    c.make_heavy();
    const double small = 1e-4, l = 0.8, n = c.n;
    const Matrix3d rod = 0.3 * Vector3d(0, 1, 1).asDiagonal();
    for (const Vector3d &axis : {Vector3d(0, 0, 1), Vector3d(0, 1, 0)}) {
        c.panel_interface.par.theta[c.add_panel(2.0, rod, {0, 0, 0}, axis, {l, 0, 0})] = small;
    }
    for (const Vector3d &axis : {Vector3d(1, 0, 0), Vector3d(0, 1, 0), Vector3d(0, 0, 1)}) {
        c.slosh_interface.par.rho[c.add_particle(1.0, {0, 0, 0}, axis, 0.0)] = small;
    }
    c.add_pendulum(1.0, l, {0, 0, 0}, {1, small, 0});
    c.add_pendulum(1.0, l, {0, 0, 0}, {1, 0, small});
    c.prepare();
    double least = 1.0;
    c.fly(60 * second, second, [&] {
        const double t = 1e-9 * static_cast<double>(c.t), in = std::cos(std::sqrt(3.0) * n * t),
                     out = std::cos(2 * n * t);
        const auto &theta = c.panel_interface.out.angles.theta;
        const auto &fuel = c.slosh_interface.out.fuel.r_B, &bob = c.pendulum_interface.out.fuel.r_B;
        ASSERT_NEAR(theta[0] / small, in, 1e-6);
        ASSERT_NEAR(theta[1] / small, out, 1e-6);
        ASSERT_NEAR(fuel[0].v[0] / small / std::cosh(std::sqrt(3.0) * n * t), 1.0, 1e-6);
        ASSERT_NEAR(fuel[1].v[1] / small, 1.0, 1e-6);
        ASSERT_NEAR(fuel[2].v[2] / small, std::cos(n * t), 1e-6);
        ASSERT_NEAR(bob[0].v[1] / small / l, in, 1e-6);
        ASSERT_NEAR(bob[1].v[2] / small / l, out, 1e-6);
        least = std::min(least, in);
    });
    EXPECT_LT(least, -0.9);
}

TEST(GravityGradient, KeepsTheEnergyOfAllPartsInTheTurningFrame)
{
    // With H and I of all masses about C, in a circular orbit of the rate n about z, with x along the radius:
    // T + springs - n z . H + n^2 / 2 (3 x . I x - tr I) is constant.
    Circling c;
    c.radius = 100.0;
    c.craft_interface.par.center_B = vec3(0.1, -0.2, 0.05);
    c.craft_interface.par.sigma_BN = vec3(0.2, -0.1, 0.15);
    const Matrix3d Q = rotation({0.3, -0.5, 0.7}), I = Q * Vector3d(1.0, 1.4, 1.9).asDiagonal() * Q.transpose();
    for (const double side : {1.0, -1.0}) {
        const auto k = c.add_panel(6.0, I, {0.2, side, 0.1}, {0.3, 1, side}, {0.5, side, 0.4});
        c.panel_interface.par.stiffness[k] = 0.05;
        c.panel_interface.par.theta[k] = 0.4;
        c.slosh_interface.par.rho[c.add_particle(3.0, {0.3, 0.1 * side, -0.5}, {1, 0.5, side}, 0.2)] = 0.2 * side;
        c.pendulum_interface.par.spin_B[c.add_pendulum(2.0, 0.5, {0, 0.4 * side, 0}, {1, 0, side})] = vec3(0, 0.1, 0.1);
    }
    c.prepare();
    const auto energy = [&] {
        const Sums s = c.sums();
        const Vector3d r = s.center / s.mass, x = r.normalized();
        const Matrix3d I_C = s.inertia - s.mass * (r.squaredNorm() * Matrix3d::Identity() - r * r.transpose());
        const double own = s.energy() - 0.5 * s.linear.squaredNorm() / s.mass;
        return own - c.n * s.spin()[2] + 0.5 * c.n * c.n * (3.0 * x.dot(I_C * x) - I_C.trace());
    };
    const double before = energy(), theta = c.panel_interface.out.angles.theta[0];
    double most = 0.0;
    c.fly(200 * second, second, [&] {
        ASSERT_NEAR(energy(), before, 1e-8);
        most = std::max(most, std::abs(c.panel_interface.out.angles.theta[0] - theta));
    });
    EXPECT_GT(most, 0.3);
    EXPECT_GT(std::abs(before), 0.1);
}

TEST(GravityGradient, TwoMassesOnASpringMoveAsEachInItsOwnOrbit)
{
    // The hub is next to a point, and turns as the line does. The gradient is good to the length over the radius.
    Circling c;
    c.radius = 1e7;
    c.set_inertia(1e-6 * Matrix3d::Identity());
    const double l = 2.0, k = 0.5, m = 4.0, M = c.craft_interface.par.mass,
                 attraction = std::pow(c.n, 2) * std::pow(c.radius, 3);
    c.add_particle(m, {l, 0, 0}, {1, 0, 0}, k);
    c.craft_interface.par.sigma_BN = vec3(0.1, 0.2, 0.15);
    c.craft_interface.par.omega_BN_B = vec3(0, 0.05, 0.12);
    c.prepare();
    const auto apart = [&] { return Vector3d(c.dcm_BN().transpose() * view(c.slosh_interface.out.fuel.r_B[0])); };
    struct Pair {
        Vector3d r[2], v[2];
    };
    const Vector3d turn = c.omega().cross(Vector3d(l, 0, 0));
    Pair p{{c.r(), c.r() + apart()}, {c.v(), c.v() + c.dcm_BN().transpose() * turn}};
    const auto rate = [&](const Pair &at) {
        const Vector3d d = at.r[1] - at.r[0], pull = k * (d.norm() - l) * d.normalized();
        const auto gravity = [&](const Vector3d &r) { return Vector3d(-attraction / std::pow(r.norm(), 3) * r); };
        return Pair{{at.v[0], at.v[1]}, {gravity(at.r[0]) + pull / M, gravity(at.r[1]) - pull / m}};
    };
    const auto plus = [](Pair a, double h, const Pair &b) {
        for (int i = 0; i < 2; i++) {
            a.r[i] += h * b.r[i];
            a.v[i] += h * b.v[i];
        }
        return a;
    };
    double longest = 0.0;
    c.fly(100 * second, second, [&] {
        constexpr double h = 0.01;
        for (int i = 0; i < 100; i++) {
            const Pair k1 = rate(p), k2 = rate(plus(p, h / 2, k1)), k3 = rate(plus(p, h / 2, k2)),
                       k4 = rate(plus(p, h, k3));
            p = plus(plus(plus(plus(p, h / 6, k1), h / 3, k2), h / 3, k3), h / 6, k4);
        }
        ASSERT_LT((apart() - (p.r[1] - p.r[0])).norm(), 1e-4);
        longest = std::max(longest, std::abs(apart().norm() - l));
    });
    EXPECT_GT(longest, 0.05);
}

TEST(GravityGradient, NeedsABodyAndAMass)
{
    Craft far;
    EXPECT_EQ(error_of([&] { far.prepare(); }),
              "world.gradient: no body attracts the spacecraft; give it its `gravity`");
}

} // namespace gravity_gradient_model_test
