// SPDX-License-Identifier: Apache-2.0
// The motion of orbit_motion.h against the gradient of its potential, against another integrator with another formula
// of the field, and against energy and momentum; and the propagator's fixes.
#include "flight/navigation/testing/orbits.h"
#include "flight/testing/derivative.h"
#include "flight/testing/poison.h"

extern "C" {
#include "flight/navigation/orbit_propagator.h"
}

#include <gtest/gtest.h>

namespace flight::testing {
namespace orbit_propagator_test {

using namespace orbits;

OrbitField field_of(const Earth &earth)
{
    return {mu_earth, radius_earth, earth.J2, earth.J3, earth.J4, vec(earth.c.row(2).transpose())};
}

double potential(const OrbitField &f, const Vector3d &r)
{
    const double q = f.radius / r.norm(), u = r.normalized().dot(eigen(f.pole));
    return f.mu / r.norm() *
           (1 - f.J2 * q * q * std::legendre(2, u) - f.J3 * q * q * q * std::legendre(3, u) -
            f.J4 * q * q * q * q * std::legendre(4, u));
}

OrbitPropagator made(const Earth &earth)
{
    OrbitPropagator m{};
    m.par = {mu_earth, radius_earth, earth.J2, earth.J3, earth.J4, 10, 86400, 20, 0};
    m.in.planet = earth.attitude(0);
    return m;
}

NavOrbit fix_of(const State &x, std::int64_t t, std::uint32_t sequence = 1)
{
    return {{t, QUALITY_GOOD, sequence}, vec(x.head<3>()), vec(x.tail<3>()), {}};
}

State state_of(const NavOrbit &orbit)
{
    State x;
    x << eigen(orbit.r_BN_N), eigen(orbit.v_BN_N);
    return x;
}

TEST(OrbitMotion, acceleration_is_the_gradient_of_the_potential_and_gradient_its_derivative)
{
    Random random{1};
    for (int i = 0; i < 300; i++) {
        const Vector3d r = random.direction() * random.real(6.5e6, 4e7);
        // Zonals a hundred times as large as they are, so that all of them count.
        OrbitField f{mu_earth,
                     radius_earth,
                     random.real(-0.1, 0.1),
                     random.real(-0.1, 0.1),
                     random.real(-0.1, 0.1),
                     vec(random.direction())};
        const Vector3d a = eigen(orbit_gravity(&f, vec(r)));
        for (int k = 0; k < 3; k++) {
            const Vector3d e = Vector3d::Unit(k);
            EXPECT_NEAR(derivative<double>([&](double h) { return potential(f, r + h * e); }, 2e5), a[k],
                        1e-9 * a.norm());
        }
        f.J3 = f.J4 = 0;
        const Matrix3d G = eigen(orbit_gradient(&f, vec(r)));
        for (int k = 0; k < 3; k++) {
            const auto at = [&](double h) -> Vector3d {
                return eigen(orbit_gravity(&f, vec(r + h * Vector3d::Unit(k))));
            };
            EXPECT_LT((derivative<Vector3d>(at, 2e5) - G.col(k)).norm(), 1e-9 * G.norm());
        }
    }
}

TEST(OrbitPropagator, a_day_beside_another_integrator_with_another_formula)
{
    Random random{2};
    double worst = 0;
    for (int i = 0; i < 6; i++) {
        Earth earth;
        earth.c = random.attitude();
        OrbitPropagator m = made(earth);
        const State x0 = on_orbit(random, 6.878e6 + 1e5 * i, 0.005 * i, random.real(0, pi));
        m.in.fix = fix_of(x0, 0);
        for (std::int64_t t = 0; t <= 86400; t += 60) {
            orbit_propagator_update(&m, {t * second, 60 * second});
            ASSERT_EQ(m.out.orbit.head.quality, QUALITY_GOOD);
        }
        const State truth = earth.go(0, x0, 86400, 30);
        worst = std::max(worst, (state_of(m.out.orbit) - truth).head<3>().norm());
        const Vector3d a = earth.acceleration(86400, eigen(m.out.orbit.r_BN_N), eigen(m.out.orbit.v_BN_N));
        EXPECT_LT((eigen(m.out.orbit.a_BN_N) - a).norm(), 1e-12 * a.norm());
        const OrbitField f = field_of(earth);
        const auto energy = [&](const State &x) { return x.tail<3>().squaredNorm() / 2 - potential(f, x.head<3>()); };
        const auto about_pole = [&](const State &x) {
            return Vector3d(x.head<3>()).cross(Vector3d(x.tail<3>())).dot(eigen(f.pole));
        };
        const State x = state_of(m.out.orbit);
        EXPECT_NEAR(energy(x) / energy(x0), 1, 1e-8);
        EXPECT_NEAR(about_pole(x), about_pole(x0), 1e-8 * 5e10);
    }
    RecordProperty("worst_m", std::to_string(worst));
    std::printf("worst after a day: %.3f m\n", worst);
    EXPECT_LT(worst, 1.0);
}

TEST(OrbitPropagator, its_error_is_of_order_4_in_the_step)
{
    const Earth earth;
    Random random{3};
    const State x0 = on_orbit(random, 7e6, 0.01, 1.7), truth = earth.go(0, x0, 11520, 10);
    double before = 0;
    for (const double step : {80.0, 40.0, 20.0}) {
        OrbitPropagator m = made(earth);
        m.par.step = step;
        m.par.steps = 1000;
        m.in.fix = fix_of(x0, 0);
        orbit_propagator_update(&m, {11520 * second, 0});
        const double error = (state_of(m.out.orbit) - truth).head<3>().norm();
        if (before > 0) {
            EXPECT_GT(before / error, 12) << step;
            EXPECT_LT(before / error, 40) << step; // the error of the period is of order 5
        }
        before = error;
    }
}

TEST(OrbitPropagator, fixes_begin_it_anew_at_their_time_and_gaps_are_caught_up)
{
    const Earth earth;
    Random random{4};
    OrbitPropagator m = made(earth);
    orbit_propagator_update(&m, {0, 0});
    EXPECT_TRUE(all_zero(m.out));
    const State x0 = on_orbit(random, 6.9e6, 0.001, 1.7), x1 = on_orbit(random, 6.95e6, 0.001, 1);
    m.in.fix = fix_of(x0, 5 * second);
    orbit_propagator_update(&m, {0, 0});
    EXPECT_TRUE(all_zero(m.out)) << "one of a time to come waits";
    orbit_propagator_update(&m, {8 * second, 0});
    EXPECT_LT((state_of(m.out.orbit) - earth.go(5, x0, 8)).norm(), 1e-4);
    m.in.fix = fix_of(x1, 7 * second, 2);
    orbit_propagator_update(&m, {9 * second, second});
    EXPECT_LT((state_of(m.out.orbit) - earth.go(7, x1, 9)).norm(), 1e-4);

    orbit_propagator_update(&m, {1009 * second, 1000 * second});
    EXPECT_EQ(m.out.orbit.head.t, 209 * second) << "20 steps of 10 s";
    EXPECT_EQ(m.out.orbit.head.quality, QUALITY_DEGRADED);
    EXPECT_LT((state_of(m.out.orbit) - earth.go(7, x1, 209)).norm(), 1e-2);
    for (int k = 1; k <= 5; k++) {
        orbit_propagator_update(&m, {(1009 + k) * second, second});
        EXPECT_EQ(m.out.orbit.head.quality, k < 5 ? QUALITY_DEGRADED : QUALITY_GOOD) << k;
    }
    EXPECT_LT((state_of(m.out.orbit) - earth.go(7, x1, 1014)).norm(), 1e-1);

    m.par.age_max = 1000;
    orbit_propagator_update(&m, {1015 * second, second});
    EXPECT_EQ(m.out.orbit.head.quality, QUALITY_DEGRADED);
    m.in.fix = fix_of(x0, 1015 * second, 3);
    orbit_propagator_update(&m, {1016 * second, second});
    EXPECT_EQ(m.out.orbit.head.quality, QUALITY_GOOD);
    m.in.fix.head = {1016 * second, QUALITY_DEGRADED, 4};
    orbit_propagator_update(&m, {1017 * second, second});
    EXPECT_EQ(m.out.orbit.head.quality, QUALITY_DEGRADED);
    m.in.fix = fix_of(x0, 1017 * second, 5);
    m.in.planet = {};
    orbit_propagator_update(&m, {1018 * second, second});
    EXPECT_EQ(m.out.orbit.head.quality, QUALITY_GOOD) << "the pole is optional";
    m.in.planet.head = good();
    orbit_propagator_update(&m, {1019 * second, second});
    EXPECT_EQ(m.out.orbit.head.quality, QUALITY_DEGRADED) << "but it must be an axis";
    m.in.planet = earth.attitude(0);
    m.in.fix = fix_of(x0, 10 * second, 6);
    orbit_propagator_update(&m, {20 * second, second});
    EXPECT_LT((state_of(m.out.orbit) - earth.go(10, x0, 20)).norm(), 1e-3) << "the clock was set back";
    const NavOrbit before = m.out.orbit;
    m.in.fix.head = {21 * second, QUALITY_GOOD, 7};
    m.in.fix.r_BN_N = vec3(0, 0, 0);
    orbit_propagator_update(&m, {30 * second, 10 * second});
    EXPECT_LT((state_of(m.out.orbit) - earth.go(20, state_of(before), 30)).norm(), 1e-3) << "no orbit is not used";
    m.par.step = std::nan("");
    const NavOrbit last = m.out.orbit;
    orbit_propagator_update(&m, {40 * second, 10 * second});
    EXPECT_TRUE(same_content(m.out.orbit, last));
    EXPECT_EQ(m.out.orbit.head.quality, QUALITY_DEGRADED);
}

TEST(OrbitPropagator, bad_numbers_never_leave_it)
{
    Random random{5};
    const Earth earth;
    for (int round = 0; round < 3000; round++) {
        OrbitPropagator m = made(earth);
        m.in.fix = fix_of(on_orbit(random, 7e6, 0.01, 1), 0);
        orbit_propagator_update(&m, {0, 0});
        throw_numbers(doubles(m.in.fix.r_BN_N, m.in.fix.v_BN_N), random, round);
        if (round % 2) {
            throw_numbers(doubles(m.par.mu, m.par.radius, m.par.J2, m.par.J3, m.par.J4, m.in.planet.dcm_PN), random,
                          round);
        }
        m.in.fix.head = {random.below(3) ? 0 : INT64_MIN, any_quality(random), 2};
        const std::int64_t t = random.below(4) ? 100 * second : INT64_MAX;
        orbit_propagator_update(&m, {t, second});
        expect_finite(doubles(m.out.orbit.r_BN_N, m.out.orbit.v_BN_N, m.out.orbit.a_BN_N), round);
    }
}

} // namespace orbit_propagator_test
} // namespace flight::testing
