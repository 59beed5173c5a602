// SPDX-License-Identifier: Apache-2.0
// A place on a planet against the definition of geodetic latitude, and its view against spherical trigonometry.
#include "flight/testing/derivative.h"
#include "flight/testing/poison.h"

extern "C" {
#include "flight/guidance/ground_target.h"
}

#include <gtest/gtest.h>

namespace flight::testing {
namespace ground_target_test {

constexpr double degree = pi / 180;
constexpr std::int64_t second = 1'000'000'000;

GroundTarget any(Random &random)
{
    GroundTarget m{};
    m.par.longitude = random.real(-pi, pi);
    m.par.latitude = random.real(-1.5, 1.5);
    m.par.altitude = random.real(-100, 5000);
    m.par.radius = 6378136.6;
    m.par.flattening = 1 / 298.25642;
    m.par.dcm_PN = mat(random.attitude());
    m.par.rate = 7.2921150e-5;
    m.par.mask = 10 * degree;
    return m;
}

GroundTarget at(GroundTarget m, double t)
{
    ground_target_update(&m, {std::llround(t * 1e9), 0});
    return m;
}

TEST(GroundTarget, lies_on_its_ellipsoid_and_looks_along_its_normal)
{
    Random random{1};
    for (int i = 0; i < 300; i++) {
        GroundTarget m = any(random);
        m.par.altitude = 0;
        const double b = m.par.radius * (1 - m.par.flattening);
        const Vector3d r = eigen(m.par.dcm_PN) * eigen(at(m, 0).out.target.r_PN_N);
        EXPECT_NEAR(r.head<2>().squaredNorm() / std::pow(m.par.radius, 2) + r.z() * r.z() / (b * b), 1, 1e-14);
        // The gradient of the ellipsoid's equation, which is what geodetic latitude is the angle of.
        const Vector3d normal = Vector3d(r.x(), r.y(), r.z() * std::pow(m.par.radius / b, 2)).normalized();
        EXPECT_NEAR(std::asin(normal.z()), m.par.latitude, 1e-13);
        EXPECT_NEAR(std::remainder(std::atan2(r.y(), r.x()) - m.par.longitude, 2 * pi), 0, 1e-14);
        m.par.altitude = 1234;
        const Vector3d up = eigen(m.par.dcm_PN) * eigen(at(m, 0).out.target.r_PN_N);
        EXPECT_LT((up - r - 1234 * normal).norm(), 1e-8);
    }
}

TEST(GroundTarget, velocity_and_acceleration_are_derivatives)
{
    Random random{2};
    for (int i = 0; i < 100; i++) {
        GroundTarget m = any(random);
        const double now = random.real(0, 1e5);
        const auto r = [&](double t) -> Vector3d { return eigen(at(m, now + t).out.target.r_PN_N); };
        const auto v = [&](double t) -> Vector3d { return eigen(at(m, now + t).out.target.v_PN_N); };
        EXPECT_LT((derivative<Vector3d>(r, 64) - v(0)).norm(), 1e-6);
        EXPECT_LT((derivative<Vector3d>(v, 64) - eigen(at(m, now).out.target.a_PN_N)).norm(), 1e-9);
        EXPECT_LT((r(2 * pi / m.par.rate) - r(0)).norm(), 1e-4) << "a day later it is back";
    }
}

TEST(GroundTarget, elevation_and_azimuth_of_a_craft_put_there)
{
    Random random{3};
    int seen = 0;
    for (int i = 0; i < 500; i++) {
        GroundTarget m = any(random);
        m = at(m, 100);
        const Matrix3d P = turn(2, m.par.rate * 100) * eigen(m.par.dcm_PN);
        const double elevation = random.real(-0.3, 1.5), azimuth = random.real(0, 2 * pi), range = 1e6;
        const double lo = m.par.longitude, la = m.par.latitude;
        const Vector3d up(std::cos(la) * std::cos(lo), std::cos(la) * std::sin(lo), std::sin(la));
        const Vector3d east = Vector3d::UnitZ().cross(up).normalized(), north = up.cross(east);
        const Vector3d way =
            std::cos(elevation) * (std::sin(azimuth) * east + std::cos(azimuth) * north) + std::sin(elevation) * up;
        m.in.orbit = {good(),
                      vec(eigen(m.out.target.r_PN_N) + range * P.transpose() * way),
                      vec(eigen(m.out.target.v_PN_N) + 7 * P.transpose() * way),
                      {}};
        m = at(m, 100);
        const GroundContact &contact = m.out.contact;
        EXPECT_NEAR(contact.range, range, 1e-6);
        EXPECT_NEAR(contact.range_rate, 7, 1e-9);
        EXPECT_NEAR(contact.elevation, elevation, 1e-13);
        EXPECT_NEAR(std::remainder(contact.azimuth - azimuth, 2 * pi), 0, 1e-11);
        EXPECT_EQ(contact.visible, elevation >= 10 * degree);
        seen += static_cast<int>(contact.visible);
    }
    EXPECT_GT(seen, 100);
}

TEST(GroundTarget, a_planet_that_moves_takes_it_along_and_an_orbit_is_needed_for_the_view_alone)
{
    Random random{4};
    GroundTarget m = any(random), rests = at(m, 50);
    EXPECT_EQ(rests.out.target.head.quality, QUALITY_GOOD);
    EXPECT_TRUE(all_zero(rests.out.contact));
    m.in.planet = {good(), vec3(1e9, 2e9, 3e9), vec3(1e4, 2e4, 3e4), vec3(1, 2, 3)};
    m = at(m, 50);
    EXPECT_LT((eigen(m.out.target.r_PN_N) - eigen(rests.out.target.r_PN_N) - Vector3d(1e9, 2e9, 3e9)).norm(), 1e-6);
    EXPECT_LT((eigen(m.out.target.v_PN_N) - eigen(rests.out.target.v_PN_N) - Vector3d(1e4, 2e4, 3e4)).norm(), 1e-10);
    m.in.orbit = {good(), vec_scale(2, m.out.target.r_PN_N), {}, {}};
    m = at(m, 50);
    m.out.contact.visible = 1;
    m.in.orbit.head.quality = QUALITY_NONE;
    m = at(m, 60);
    EXPECT_EQ(m.out.contact.visible, 0u) << "no link is begun on old data";
    EXPECT_EQ(m.out.contact.head.quality, QUALITY_DEGRADED);
    m.in.orbit = {with(QUALITY_STALE), vec_add(m.out.target.r_PN_N, vec_scale(1e3, rests.out.target.r_PN_N)), {}, {}};
    m.in.planet.head.quality = QUALITY_GOOD;
    for (int k = 0; k < 20; k++) {
        ground_target_update(&m, {k * 1'000'000'000LL, 1'000'000'000});
        EXPECT_EQ(m.out.contact.visible, k <= 10) << "and none is kept on older data";
    }
    const auto before = m.out;
    m.par.dcm_PN = mat(Matrix3d::Ones());
    m = at(m, 60);
    EXPECT_TRUE(same_content(m.out.target, before.target));
    EXPECT_EQ(m.out.target.head.quality, QUALITY_DEGRADED);
    m.par.dcm_PN = mat_identity();
    m.in.planet.head.quality = QUALITY_STALE;
    m = at(m, 70);
    EXPECT_EQ(m.out.target.head.quality, QUALITY_DEGRADED);
}

TEST(GroundTarget, a_wired_attitude_is_turned_on_from_its_time_and_replaces_that_of_the_parameters)
{
    Random random{9};
    for (int k = 0; k < 100; k++) {
        GroundTarget m = any(random);
        ground_target_update(&m, {1000 * second, second});
        GroundTarget wired = m;
        const double t = random.real(0, 1000);
        wired.par.dcm_PN = {};
        wired.par.rate = 0;
        const Matrix3d PN = turn(2, m.par.rate * t) * eigen(m.par.dcm_PN);
        wired.in.attitude = {good(std::llround(t * 1e9)), mat(PN), vec(m.par.rate * Vector3d(PN.row(2)))};
        ground_target_update(&wired, {1000 * second, second});
        EXPECT_LT((eigen(wired.out.target.r_PN_N) - eigen(m.out.target.r_PN_N)).norm(), 1e-6);
        EXPECT_LT((eigen(wired.out.target.v_PN_N) - eigen(m.out.target.v_PN_N)).norm(), 1e-9);
        wired.in.attitude.head.quality = QUALITY_STALE;
        ground_target_update(&wired, {1001 * second, second});
        EXPECT_EQ(wired.out.target.head.quality, QUALITY_DEGRADED);
    }
}

} // namespace ground_target_test
} // namespace flight::testing
