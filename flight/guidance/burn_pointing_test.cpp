// SPDX-License-Identifier: Apache-2.0
#include "flight/testing/kinematics.h"
#include "flight/testing/poison.h"

extern "C" {
#include "flight/guidance/burn_pointing.h"
#include "flight/math/attitude.h"
}

#include <gtest/gtest.h>

namespace flight::testing {
namespace burn_pointing_test {

BurnPointing any(Random &random, bool turns)
{
    BurnPointing m{};
    m.in.command = {good(), 5'000'000'000, vec(random.vector(100)), turns ? vec(random.vector(0.01)) : Vec3{}};
    return m;
}

AttReference at(BurnPointing m, double t)
{
    burn_pointing_update(&m, {std::llround(t * 1e9), 0});
    return m.out.reference;
}

TEST(BurnPointing, r1_is_along_the_thrust_and_turns_at_the_rate)
{
    Random random{1};
    for (int i = 0; i < 300; i++) {
        const BurnPointing m = any(random, i % 2);
        const Vector3d dv = eigen(m.in.command.dv_N).normalized(), rate = eigen(m.in.command.rate_N);
        const AttReference start = at(m, 5);
        EXPECT_LT((dcm(start.sigma_RN).row(0).transpose() - dv).norm(), 1e-14);
        for (const double t : {0.0, 5.5, 100.0}) {
            const Vector3d r1 = dcm(at(m, t).sigma_RN).row(0).transpose();
            const Vector3d wanted = rate.norm() > 0 ? turn(rate, -rate.norm() * (t - 5)) * dv : dv;
            EXPECT_LT((r1 - wanted).norm(), 1e-13);
        }
        if (i % 2) {
            const Vector3d r3 = dcm(start.sigma_RN).row(2).transpose();
            EXPECT_NEAR(r3.dot(rate), rate.cross(dv).norm(), 1e-15) << "as near as it can be";
            const auto errors = kinematic_errors([&](double t) { return at(m, 20 + t); }, rate.norm());
            EXPECT_LT(errors.rate, 1e-7);
            EXPECT_LT(errors.acceleration, 1e-7);
        }
    }
}

TEST(BurnPointing, a_rate_along_the_thrust_and_no_rate_have_a_frame_too)
{
    BurnPointing m{};
    m.in.command = {good(), 0, vec3(3, 0, 0), vec3(1e-3, 0, 0)};
    const AttReference reference = at(m, 0);
    EXPECT_EQ(reference.head.quality, QUALITY_GOOD);
    EXPECT_LT((dcm(reference.sigma_RN).row(0).transpose() - Vector3d::UnitX()).norm(), 1e-15);
}

TEST(BurnPointing, holds_its_reference_without_a_direction)
{
    Random random{2};
    BurnPointing m = any(random, true);
    burn_pointing_update(&m, {0, 0});
    expect_held(
        m, doubles(m.in.command.dv_N, m.in.command.rate_N),
        [](BurnPointing &x) {
            burn_pointing_update(&x, {9, 9});
        },
        [](BurnPointing &x) { return std::vector{&x.out.reference.head}; });
    const AttReference last = m.out.reference;
    m.in.command.dv_N = {};
    burn_pointing_update(&m, {9, 9});
    EXPECT_TRUE(same_content(m.out.reference, last));
    EXPECT_EQ(m.out.reference.head.quality, QUALITY_DEGRADED);
}

} // namespace burn_pointing_test
} // namespace flight::testing
