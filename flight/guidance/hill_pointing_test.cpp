// SPDX-License-Identifier: Apache-2.0
// Hill pointing on conics of every kind, against numerical derivatives of Keplerian motion.
#include "flight/testing/orbit_frame.h"

extern "C" {
#include "flight/guidance/hill_pointing.h"
}

#include <gtest/gtest.h>

namespace flight::testing {
namespace hill_pointing_test {

constexpr double mu = mu_mars;

HillPointing hill(const Motion &motion)
{
    HillPointing m{};
    m.in.orbit = {good(), vec(motion.r), vec(motion.v), {}};
    return m;
}

AttReference reference_of(const Motion &motion, const Planet *planet = nullptr, double t = 0)
{
    return testing::reference_of(hill, hill_pointing_update, motion, planet, t);
}

void check_conic(Random &random, double e, double tolerance, const Planet *planet = nullptr)
{
    Motion now = about_mars(random, e, 5);
    double rate = now.r.cross(now.v).norm() / now.r.squaredNorm();
    auto at = [&](double t) { return reference_of(kepler(now, mu, t), planet, t); };
    KinematicErrors errors = kinematic_errors(at, rate);
    EXPECT_LT(errors.rate, tolerance) << "e = " << e;
    EXPECT_LT(errors.acceleration, tolerance) << "e = " << e;
}

TEST(Kepler, moves_under_gravity_on_every_conic) // the oracle itself
{
    Random random{1};
    for (double e : {0.0, 0.4, 0.95, 1 - 1e-9, 1.0, 1 + 1e-9, 1.5, 4.0}) {
        for (int i = 0; i < 20; i++) {
            Motion now = about_mars(random, e);
            double h = 0.02 * std::sqrt(std::pow(now.r.norm(), 3) / mu);
            auto r_at = [&](double t) -> Vector3d { return kepler(now, mu, t).r; };
            auto v_at = [&](double t) -> Vector3d { return kepler(now, mu, t).v; };
            Vector3d g = -mu / std::pow(now.r.norm(), 3) * now.r;
            EXPECT_LT((derivative<Vector3d>(r_at, h) - now.v).norm(), 1e-11 * now.v.norm()) << e;
            EXPECT_LT((derivative<Vector3d>(v_at, h) - g).norm(), 1e-10 * g.norm()) << e;
        }
    }
}

TEST(HillPointing, frame_is_radial_transverse_normal)
{
    Random random{2};
    for (int i = 0; i < 1000; i++) {
        Motion motion = about_mars(random, random.real(0, 2));
        AttReference reference = reference_of(motion);
        Matrix3d c = dcm(reference.sigma_RN);
        Vector3d h = motion.r.cross(motion.v);
        EXPECT_LT((c.row(0).transpose() - motion.r.normalized()).norm(), 3e-15);
        EXPECT_LT((c.row(2).transpose() - h.normalized()).norm(), 3e-15);
        EXPECT_LE(vec_norm(reference.sigma_RN), 1 + 1e-15);
    }
}

TEST(HillPointing, rate_and_acceleration_are_derivatives_on_every_conic)
{
    Random random{3};
    for (int i = 0; i < 300; i++) {
        check_conic(random, random.real(0, 0.95), 1e-8);
        check_conic(random, random.real(1.05, 4), 1e-8);
        check_conic(random, 1 + random.real(-1e-6, 1e-6), 1e-8);
    }
    for (double e : {0.0, 1 - 1e-15, 1.0, 1 + 1e-15}) {
        check_conic(random, e, 1e-8);
    }
}

TEST(HillPointing, follows_a_planet_that_moves)
{
    Random random{4};
    for (int i = 0; i < 300; i++) {
        Planet planet{random.vector(1e8), random.vector(3e4), random.vector(1)};
        check_conic(random, random.real(0, 2), 1e-8, &planet);
    }
}

TEST(HillPointing, mission_orbit_at_periapsis)
{
    double a = 7471.618e3, e = 0.4, q = a * (1 - e), v = std::sqrt(mu * (1 + e) / q);
    AttReference reference = reference_of({{q, 0, 0}, {0, v, 0}});
    EXPECT_EQ(eigen(reference.sigma_RN), Vector3d::Zero());
    EXPECT_DOUBLE_EQ(reference.omega_RN_N.v[2], v / q);
    EXPECT_EQ(eigen(reference.domega_RN_N), Vector3d::Zero());
}

TEST(HillPointing, quality_is_the_worst_of_what_it_used)
{
    expect_quality_of_inputs(hill, hill_pointing_update);
}

TEST(HillPointing, holds_the_last_reference_where_the_frame_is_undefined)
{
    expect_held_where_undefined(hill, hill_pointing_update);
}

TEST(HillPointing, holds_the_last_reference_against_numbers_that_are_not_finite)
{
    expect_held_against_not_finite(hill, hill_pointing_update);
}

TEST(HillPointing, without_an_orbit_nothing_is_written)
{
    expect_nothing_of_nothing(hill, hill_pointing_update);
}

} // namespace hill_pointing_test
} // namespace flight::testing
