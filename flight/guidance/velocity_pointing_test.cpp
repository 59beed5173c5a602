// SPDX-License-Identifier: Apache-2.0
// Velocity pointing on conics of every kind, against numerical derivatives of Keplerian motion and
// against the thesis' equations in elements.
#include "flight/testing/orbit_frame.h"

extern "C" {
#include "flight/guidance/velocity_pointing.h"
}

#include <gtest/gtest.h>

namespace flight::testing {
namespace velocity_pointing_test {

constexpr double mu = mu_mars;

VelocityPointing pointing(const Motion &motion)
{
    VelocityPointing m{};
    m.in.orbit = {good(), vec(motion.r), vec(motion.v), {}};
    m.par.mu = mu;
    return m;
}

AttReference reference_of(const Motion &motion, const Planet *planet = nullptr, double t = 0)
{
    return testing::reference_of(pointing, velocity_pointing_update, motion, planet, t);
}

/// Errors are relative to the rate, and to what it changes by in the time scale of the motion,
/// beyond those of rounding, which turns the orbit's normal as r and v become parallel.
void check(const Motion &now, double tolerance, const Planet *planet = nullptr)
{
    double r = now.r.norm(), v = now.v.norm();
    double scale = v / r + mu / (r * r * v); // how fast position and velocity change
    auto at = [&](double t) { return reference_of(kepler(now, mu, t), planet, t); };
    double omega = vec_norm(at(0).omega_RN_N);
    KinematicErrors errors = kinematic_errors(at, scale);
    double limit = tolerance * omega + 1e-13 * scale * r * v / now.r.cross(now.v).norm();
    EXPECT_LT(errors.rate * scale, limit) << "r = " << r << ", v = " << v;
    EXPECT_LT(errors.acceleration * scale, limit) << "r = " << r << ", v = " << v;
}

TEST(VelocityPointing, frame_is_outward_along_normal)
{
    Random random{1};
    for (int i = 0; i < 1000; i++) {
        Motion motion = about_mars(random, random.real(0, 2));
        AttReference reference = reference_of(motion);
        Matrix3d c = dcm(reference.sigma_RN);
        Vector3d h = motion.r.cross(motion.v);
        EXPECT_LT((c.row(1).transpose() - motion.v.normalized()).norm(), 3e-15);
        EXPECT_LT((c.row(2).transpose() - h.normalized()).norm(), 3e-15);
        EXPECT_GT(c.row(0).dot(motion.r), 0);
        EXPECT_LE(vec_norm(reference.sigma_RN), 1 + 1e-15);
    }
}

TEST(VelocityPointing, rate_and_acceleration_are_derivatives_on_every_conic)
{
    Random random{2};
    for (int i = 0; i < 300; i++) {
        check(about_mars(random, random.real(0, 0.95)), 1e-8);
        check(about_mars(random, random.real(1.05, 4)), 1e-8);
        check(about_mars(random, 1 + random.real(-1e-6, 1e-6)), 1e-8);
    }
    for (double e : {0.0, 1 - 1e-15, 1.0, 1 + 1e-15}) {
        check(about_mars(random, e), 1e-8);
    }
}

TEST(VelocityPointing, through_periapsis_and_out_along_the_asymptotes)
{
    Random random{3};
    for (double e : {0.99, 1.0, 1.01, 1.5, 4.0, 30.0}) {
        for (double reach : {1.0, 1e1, 1e2, 1e3, 1e4}) {
            for (int i = 0; i < 20; i++) {
                check(about_mars(random, e, reach), 1e-6);
            }
        }
    }
}

TEST(VelocityPointing, follows_a_planet_that_moves)
{
    Random random{4};
    for (int i = 0; i < 300; i++) {
        Planet planet{random.vector(1e8), random.vector(3e4)};
        check(about_mars(random, random.real(0, 2)), 1e-7, &planet);
    }
}

/// By elements, which need a true anomaly, and so an eccentricity.
TEST(VelocityPointing, is_what_the_elements_say)
{
    Random random{5};
    for (int i = 0; i < 1000; i++) {
        Motion now = about_mars(random, random.real(0.05, 3), 1e4);
        Vector3d h = now.r.cross(now.v);
        Vector3d evec = now.v.cross(h) / mu - now.r.normalized();
        double e = evec.norm(), r2 = now.r.squaredNorm();
        double f = std::atan2(h.normalized().dot(evec.cross(now.r)), evec.dot(now.r));
        double df = h.norm() / r2, ddf = -2 * now.r.dot(now.v) / r2 * df;
        double d = 1 + e * e + 2 * e * std::cos(f), k = e * (e + std::cos(f)) / d;
        double dbeta = k * df;
        double ddbeta = k * ddf + e * (e * e - 1) * std::sin(f) / (d * d) * df * df;
        double beta = std::atan2(e * std::sin(f), 1 + e * std::cos(f));

        Matrix3d HN;
        HN << now.r.normalized().transpose(), h.cross(now.r).normalized().transpose(), h.normalized().transpose();
        AttReference reference = reference_of(now);
        EXPECT_LT(difference(dcm(reference.sigma_RN), turn(2, -beta) * HN), 1e-11);
        Vector3d i_h = h.normalized();
        EXPECT_LT((eigen(reference.omega_RN_N) - (df - dbeta) * i_h).norm(), 1e-12 * df);
        EXPECT_LT((eigen(reference.domega_RN_N) - (ddf - ddbeta) * i_h).norm(), 1e-11 * (std::abs(ddf) + df * df));
    }
}

TEST(VelocityPointing, on_a_circle_it_is_the_hill_frame)
{
    double r = 7e6, v = std::sqrt(mu / r);
    AttReference reference = reference_of({{r, 0, 0}, {0, v, 0}});
    EXPECT_EQ(eigen(reference.sigma_RN), Vector3d::Zero());
    EXPECT_NEAR(reference.omega_RN_N.v[2], v / r, 1e-15 * v / r);
    EXPECT_EQ(eigen(reference.domega_RN_N), Vector3d::Zero());
}

TEST(VelocityPointing, quality_is_the_worst_of_what_it_used)
{
    expect_quality_of_inputs(pointing, velocity_pointing_update);
}

TEST(VelocityPointing, holds_the_last_reference_where_the_frame_is_undefined)
{
    expect_held_where_undefined(pointing, velocity_pointing_update);
}

TEST(VelocityPointing, needs_a_planet_that_attracts)
{
    for (double none : {0.0, -mu}) {
        VelocityPointing m = pointing({{7e6, 0, 0}, {0, 3e3, 1e3}});
        m.par.mu = none;
        velocity_pointing_update(&m, {0, 0});
        EXPECT_TRUE(all_zero(m.out));
    }
}

TEST(VelocityPointing, holds_the_last_reference_against_numbers_that_are_not_finite)
{
    expect_held_against_not_finite<VelocityPointing>(pointing, velocity_pointing_update,
                                                     [](VelocityPointing &m) { return doubles(m.par.mu); });
}

TEST(VelocityPointing, without_an_orbit_nothing_is_written)
{
    expect_nothing_of_nothing(pointing, velocity_pointing_update);
}

} // namespace velocity_pointing_test
} // namespace flight::testing
