// SPDX-License-Identifier: Apache-2.0
#include "world/dynamics/gravity_gradient_model.h"

#include "world/testing/flyer.h"

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
        GravityBody body;
        body.name = name;
        body.mu = its_mu;
        body.r_PN_N = r;
        f.craft.add_gravity(body);
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

TEST(GravityGradient, NeedsABodyAndAMass)
{
    Craft far;
    EXPECT_EQ(error_of([&] { far.prepare(); }),
              "world.gradient: no body attracts the spacecraft; give it its `gravity`");
}

} // namespace gravity_gradient_model_test
