// SPDX-License-Identifier: Apache-2.0
extern "C" {
#include "flight/sensing/star_tracker_attitude.h"
}

#include "flight/math/attitude.h"

#include <Eigen/Dense>

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace star_tracker_attitude_test {

constexpr std::int64_t ms = 1'000'000, s = 1000 * ms;
using Eigen::AngleAxisd;
using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;

struct Unit {
    StarTrackerAttitude m{};
    std::int64_t t = 0;

    Unit()
    {
        m.par.bits = 31;
        m.par.residual = 1e-6;
        m.par.tick = ms;
        star_tracker_attitude_reset(&m);
        m.in.registers.head.quality = QUALITY_GOOD;
    }
    /// The tracker measures a turn of its case, `age` ago.
    void measure(const Quaterniond &turn, std::int64_t age = 0)
    {
        const double full = std::ldexp(1.0, static_cast<int>(m.par.bits) - 1) - 1.0;
        const double parts[] = {turn.w(), turn.x(), turn.y(), turn.z()};
        for (int i = 0; i < 4; i++) {
            m.in.registers.q[i] = static_cast<std::int32_t>(std::lround(full * parts[i]));
        }
        m.in.registers.counter++;
        m.in.registers.tracks = 1;
        m.in.registers.time = time_tag(t + s - age, ms);
        update();
    }
    void update()
    {
        t += s;
        star_tracker_attitude_update(&m, {t, s});
    }
    const StarAttitude &out() const { return m.out.attitude; }
};

TEST(StarTrackerAttitude, any_quaternion_gives_its_attitude_with_the_time_of_its_measurement)
{
    std::mt19937 random(1);
    std::normal_distribution<double> normal;
    Unit unit;
    for (int k = 0; k < 300; k++) {
        Quaterniond turn(normal(random), normal(random), normal(random), normal(random));
        turn.normalize();
        unit.measure(turn, 120 * ms);
        const double angle = 2.0 * std::acos(std::abs(turn.w()));
        const Vector3d wanted = std::tan(angle / 4.0) * (turn.w() < 0 ? -1.0 : 1.0) * turn.vec().normalized();
        for (std::size_t i = 0; i < 3; i++) {
            ASSERT_NEAR(unit.out().sigma_BN.v[i], wanted(static_cast<Eigen::Index>(i)), 3e-9) << k;
        }
        EXPECT_EQ(unit.out().head.t, unit.t - 120 * ms);
        EXPECT_EQ(unit.out().head.sequence, static_cast<std::uint32_t>(k + 1));
        EXPECT_EQ(unit.out().head.quality, QUALITY_GOOD);
    }
    EXPECT_EQ(unit.m.out.state.refused, 0u);
}

TEST(StarTrackerAttitude, the_case_is_turned_back_and_its_boresight_has_the_larger_error)
{
    Unit unit;
    unit.m.par.sigma_SB = vec3(std::tan(M_PI / 8), 0, 0); // by a right angle about b1: s3 = -b2, or b2
    unit.m.par.about = 10.0;
    unit.m.in.registers.residual = 4;
    unit.measure(Quaterniond(AngleAxisd(M_PI / 2, Vector3d::UnitX())));
    EXPECT_NEAR(vec_norm(unit.out().sigma_BN), 0.0, 1e-9);
    EXPECT_NEAR(unit.out().P_B.m[0][0], 16e-12, 1e-24);
    EXPECT_NEAR(unit.out().P_B.m[1][1], 1600e-12, 1e-22);
    EXPECT_NEAR(unit.out().P_B.m[2][2], 16e-12, 1e-22);
    EXPECT_NEAR(unit.out().P_B.m[0][1], 0.0, 1e-22);
}

TEST(StarTrackerAttitude, each_measurement_is_given_once_and_a_blind_tracker_holds_it)
{
    Unit unit;
    unit.update();
    EXPECT_EQ(unit.out().head.quality, QUALITY_NONE) << "it has measured nothing";
    unit.measure(Quaterniond::Identity());
    unit.update();
    EXPECT_EQ(unit.out().head.sequence, 1u);
    EXPECT_EQ(unit.out().head.quality, QUALITY_GOOD);
    EXPECT_EQ(unit.m.out.state.tracks, 1u);
    unit.m.in.registers.tracks = 0;
    unit.update();
    EXPECT_EQ(unit.out().head.quality, QUALITY_DEGRADED);
    EXPECT_EQ(unit.m.out.state.tracks, 0u);
    unit.measure(Quaterniond::Identity());
    EXPECT_EQ(unit.out().head.sequence, 2u);
    EXPECT_EQ(unit.out().head.quality, QUALITY_GOOD);
    unit.m.par.age_max = 2 * s; // its registers stand still, and say that it tracks
    for (int k = 1; k <= 4; k++) {
        unit.update();
        EXPECT_EQ(unit.m.out.state.tracks, k <= 2) << k;
        EXPECT_EQ(unit.out().head.quality, k <= 2 ? QUALITY_GOOD : QUALITY_DEGRADED) << k;
    }
}

TEST(StarTrackerAttitude, a_wrong_quaternion_an_old_one_and_a_large_residual_are_refused)
{
    Unit unit;
    unit.m.par.age_max = 2 * s;
    unit.m.par.residual_max = 10;
    unit.measure(Quaterniond::Identity(), 2 * s);
    EXPECT_EQ(unit.m.out.state.refused, 0u);
    unit.measure(Quaterniond::Identity(), 2 * s + ms);
    EXPECT_EQ(unit.m.out.state.refused, 1u);
    unit.measure(Quaterniond::Identity(), -2 * ms); // of the future
    EXPECT_EQ(unit.m.out.state.refused, 2u);
    unit.m.in.registers.residual = 11;
    unit.measure(Quaterniond::Identity());
    EXPECT_EQ(unit.m.out.state.refused, 3u);
    unit.m.in.registers.residual = 10;
    unit.measure(Quaterniond(1.0, 1e-4, 0.0, 0.0)); // 5e-9 too long
    EXPECT_EQ(unit.m.out.state.refused, 4u);
    unit.measure(Quaterniond(0.0, 0.0, 0.0, 0.0));
    EXPECT_EQ(unit.m.out.state.refused, 5u);
    EXPECT_EQ(unit.out().head.sequence, 1u);
    EXPECT_EQ(unit.out().head.quality, QUALITY_DEGRADED);
}

TEST(StarTrackerAttitude, tags_wrap_around)
{
    Unit unit;
    unit.t = (INT64_C(1) << 32) * ms - s; // 2^32 ticks at the update
    unit.measure(Quaterniond::Identity(), 300 * ms);
    EXPECT_EQ(unit.out().head.t, unit.t - 300 * ms);
    unit.measure(Quaterniond::Identity(), 300 * ms);
    EXPECT_EQ(unit.out().head.t, unit.t - 300 * ms);
}

TEST(StarTrackerAttitude, an_age_counts_where_there_is_a_limit)
{
    Unit unit;
    for (const std::int64_t most : {std::int64_t{0}, 2 * s}) {
        unit.m.par.age_max = most;
        unit.measure(Quaterniond::Identity(), 3 * s);
        EXPECT_EQ(unit.m.out.state.refused, most > 0 ? 1u : 0u);
    }
}

} // namespace star_tracker_attitude_test
