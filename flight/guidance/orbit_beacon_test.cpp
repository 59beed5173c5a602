// SPDX-License-Identifier: Apache-2.0
// The beacon against Keplerian motion, of which it knows position, velocity and acceleration.
#include "flight/testing/kepler.h"
#include "flight/testing/poison.h"

extern "C" {
#include "flight/guidance/orbit_beacon.h"
}

#include <gtest/gtest.h>

namespace flight::testing {
namespace orbit_beacon_test {

constexpr double mu = 4.2828314e13; // Mars, m^3/s^2
const Motion start{{6e6, 0, 0}, {0, 2600, 900}};

OrbitBeacon beacon(const Motion &motion, double lead)
{
    OrbitBeacon m{};
    m.in.orbit = {good(), vec(motion.r), vec(motion.v), vec(-mu / std::pow(motion.r.norm(), 3) * motion.r)};
    m.par.lead = lead;
    return m;
}

TEST(OrbitBeacon, says_where_it_is)
{
    OrbitBeacon m = beacon(start, 0);
    m.in.orbit.head.quality = QUALITY_STALE;
    orbit_beacon_update(&m, {500, 0});
    EXPECT_EQ(eigen(m.out.body.r_PN_N), start.r);
    EXPECT_EQ(eigen(m.out.body.v_PN_N), start.v);
    EXPECT_EQ(eigen(m.out.body.a_PN_N), eigen(m.in.orbit.a_BN_N));
    EXPECT_EQ(m.out.body.head.t, 500);
    EXPECT_EQ(m.out.body.head.quality, QUALITY_DEGRADED);
    EXPECT_EQ(m.out.body.head.sequence, 1u);
}

TEST(OrbitBeacon, leads_with_an_error_of_third_order)
{
    // With half the lead the error of the position is an eighth, that of the velocity a quarter.
    const auto errors = [](double lead) {
        OrbitBeacon m = beacon(start, lead);
        orbit_beacon_update(&m, {0, 0});
        const Motion then = kepler(start, mu, lead);
        return std::pair{(eigen(m.out.body.r_PN_N) - then.r).norm(), (eigen(m.out.body.v_PN_N) - then.v).norm()};
    };
    const auto [r2, v2] = errors(16);
    const auto [r1, v1] = errors(8);
    EXPECT_NEAR(r2 / r1, 8, 0.2);
    EXPECT_NEAR(v2 / v1, 4, 0.1);
    EXPECT_LT(errors(0.5).first, 1e-4); // [m], of 1300 m
}

TEST(OrbitBeacon, holds_its_last_word_where_nothing_finite_comes)
{
    OrbitBeacon m = beacon(start, 1);
    orbit_beacon_update(&m, {0, 0});
    expect_held(
        m, doubles(m.in.orbit.r_BN_N, m.in.orbit.v_BN_N, m.in.orbit.a_BN_N),
        [](OrbitBeacon &x) {
            orbit_beacon_update(&x, {500, 500});
        },
        [](OrbitBeacon &x) { return std::vector{&x.out.body.head}; });
    OrbitBeacon silent{};
    orbit_beacon_update(&silent, {0, 0});
    EXPECT_TRUE(all_zero(silent.out));
}

} // namespace orbit_beacon_test
} // namespace flight::testing
