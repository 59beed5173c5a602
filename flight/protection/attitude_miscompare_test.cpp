// SPDX-License-Identifier: Apache-2.0
#include "flight/testing/poison.h"

extern "C" {
#include "flight/math/attitude.h"
#include "flight/protection/attitude_miscompare.h"
}

#include <gtest/gtest.h>

namespace flight::testing {
namespace attitude_miscompare_test {

/// b is off a by an angle and a rate.
AttitudeMiscompare off(Random &random, double angle, double rate)
{
    AttitudeMiscompare m{};
    m.par.angle_max = 0.01;
    m.par.rate_max = 1e-3;
    m.par.persistence = 1;
    m.in.a = {good(5), random.mrp(), vec(random.vector())};
    m.in.b = {good(5), mrp_compose(mrp_turn(vec(angle * random.direction())), m.in.a.sigma_BN),
              vec_add(m.in.a.omega_BN_B, vec(rate * random.direction()))};
    attitude_miscompare_update(&m, {9, 1});
    return m;
}

TEST(AttitudeMiscompare, compares_angle_and_rate)
{
    Random random{1};
    for (int i = 0; i < 500; i++) {
        const double angle = random.real(0, 0.02), rate = random.real(0, 2e-3);
        const AttitudeMiscompare m = off(random, angle, rate);
        EXPECT_NEAR(m.out.state.value, std::max(angle / 0.01, rate / 1e-3), 1e-9);
        EXPECT_EQ(m.out.state.tripped, angle > 0.01 || rate > 1e-3);
        EXPECT_TRUE(same_content(m.out.attitude, m.in.a));
        EXPECT_EQ(m.out.attitude.head.t, 5);
    }
    EXPECT_GT(off(random, 3.1, 0).out.state.value, 309.9);
}

TEST(AttitudeMiscompare, passes_the_preferred_one_or_what_is_left)
{
    Random random{2};
    AttitudeMiscompare m = off(random, 0.001, 0);
    m.par.prefer_b = 1;
    attitude_miscompare_update(&m, {9, 1});
    EXPECT_TRUE(same_content(m.out.attitude, m.in.b));
    EXPECT_EQ(m.out.attitude.head.quality, QUALITY_GOOD);
    m.in.b.sigma_BN.v[0] = NAN;
    attitude_miscompare_update(&m, {9, 1});
    EXPECT_TRUE(same_content(m.out.attitude, m.in.a));
    EXPECT_EQ(m.out.attitude.head.quality, QUALITY_DEGRADED);
    EXPECT_EQ(m.out.state.unknown, 1u);
    m.in.b.sigma_BN = vec3(0.5, 0, 0); // goes on, and a, held, does not
    for (int k = 10; k < 13; k++) {
        m.in.a.head.quality = QUALITY_DEGRADED;
        attitude_miscompare_update(&m, {k, 1});
    }
    EXPECT_EQ(m.out.state.trips, 0u);
    EXPECT_EQ(m.out.state.unknown, 4u);
    m.in.b.sigma_BN.v[0] = NAN;
    m.in.a.head = {};
    const NavAttitude last = m.out.attitude;
    attitude_miscompare_update(&m, {9, 1});
    EXPECT_TRUE(same_content(m.out.attitude, last));
    EXPECT_EQ(m.out.attitude.head.sequence, last.head.sequence) << "held";
}

} // namespace attitude_miscompare_test
} // namespace flight::testing
