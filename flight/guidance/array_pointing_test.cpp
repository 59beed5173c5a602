// SPDX-License-Identifier: Apache-2.0
extern "C" {
#include "flight/guidance/array_pointing.h"
}

#include <Eigen/Dense>

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace array_pointing_test {

using Eigen::AngleAxisd;
using Eigen::Vector3d;

constexpr std::int64_t s = 1'000'000'000;

/// An ideal drive: it is at its target at the next update, or does not move.
struct Loop {
    ArrayPointing m{};
    std::int64_t t = 0;
    bool moves = true;

    Loop()
    {
        m.par.n = 1;
        m.par.axes_B[0] = vec3(0, 2, 0);
        m.par.normals_B[0] = vec3(0, 0, 3);
        m.par.step = 1e-3;
        m.par.count = 1e-3;
        array_pointing_reset(&m);
        m.in.drive.head.quality = m.in.sun.head.quality = QUALITY_GOOD;
    }
    void sun(const Vector3d &to)
    {
        const Vector3d unit = to.normalized();
        m.in.sun.s_B = vec3(unit.x(), unit.y(), unit.z());
    }
    int update()
    {
        array_pointing_update(&m, {t, t == 0 ? 0 : s});
        t += s;
        if (moves) {
            m.in.drive.position[0] = m.out.command.target[0];
        }
        return m.out.command.target[0];
    }
};

TEST(ArrayPointing, no_other_angle_brings_the_normal_nearer_to_the_sun)
{
    std::mt19937 random(3);
    std::normal_distribution<double> normal;
    const auto any = [&] { return Vector3d(normal(random), normal(random), normal(random)); };
    for (int k = 0; k < 300; k++) {
        Loop loop;
        const Vector3d axis = any().normalized(), n = any().normalized(), sun = any().normalized();
        loop.m.par.axes_B[0] = vec3(axis.x(), axis.y(), axis.z());
        loop.m.par.normals_B[0] = vec3(n.x(), n.y(), n.z());
        loop.sun(sun);
        const double angle = 1e-3 * loop.update();
        const auto off = [&](double theta) {
            return std::acos(std::clamp((AngleAxisd(theta, axis) * n).dot(sun), -1.0, 1.0));
        };
        const double best = off(angle);
        for (double theta = -3.0; theta < 3.3; theta += 0.05) {
            ASSERT_LE(best, off(theta) + 1e-3) << k;
        }
        loop.update();
        EXPECT_NEAR(loop.m.out.state.off[0], best, 1e-6);
    }
}

TEST(ArrayPointing, it_follows_the_sun_over_many_turns_and_by_the_shorter_way)
{
    Loop loop;
    int last = 0;
    for (int k = 1; k <= 200; k++) {
        const double angle = 0.4 * k;
        loop.sun({std::sin(angle), 0.3, std::cos(angle)});
        const int target = loop.update();
        ASSERT_NEAR(1e-3 * target, angle, 0.51e-3);
        ASSERT_LT(std::abs(target - last), 402);
        last = target;
    }
    loop.sun({std::sin(80.0 + 3.0), 0, std::cos(80.0 + 3.0)});
    EXPECT_NEAR(loop.update(), 83'000, 1);
    loop.sun({std::sin(83.0 - 3.0), 0, std::cos(83.0 - 3.0)});
    EXPECT_NEAR(loop.update(), 80'000, 1);
}

TEST(ArrayPointing, stops_are_kept_and_the_other_turn_is_taken_where_it_is_within_them)
{
    Loop loop;
    loop.m.par.range = 4000; // more than half a turn
    for (const double angle : {1.0, 3.0, 3.9}) {
        loop.sun({std::sin(angle), 0, std::cos(angle)});
        EXPECT_NEAR(loop.update(), 1000 * angle, 1);
    }
    loop.sun({std::sin(4.5), 0, std::cos(4.5)});
    EXPECT_NEAR(loop.update(), 1000 * (4.5 - 2 * M_PI), 1);
    loop.m.par.range = 1000;
    loop.sun({std::sin(2.0), 0, std::cos(2.0)});
    loop.m.in.drive.position[0] = 0;
    EXPECT_EQ(loop.update(), 1000) << "the nearer end";
}

TEST(ArrayPointing, in_the_dead_band_without_a_sun_and_along_the_axis_it_rests)
{
    Loop loop;
    loop.m.par.dead_band = 0.05;
    loop.sun({std::sin(1.0), 0, std::cos(1.0)});
    const int first = loop.update();
    loop.sun({std::sin(1.04), 0, std::cos(1.04)});
    EXPECT_EQ(loop.update(), first);
    loop.sun({std::sin(1.06), 0, std::cos(1.06)});
    const int second = loop.update();
    EXPECT_NEAR(second, 1060, 1);
    loop.m.in.sun.head.quality = QUALITY_STALE;
    loop.sun({0, 0, 1});
    EXPECT_EQ(loop.update(), second);
    EXPECT_EQ(loop.m.out.command.head.quality, QUALITY_DEGRADED);
    loop.m.in.sun.head.quality = QUALITY_GOOD;
    loop.sun({0.001, 1, -0.001});
    EXPECT_EQ(loop.update(), second);
}

TEST(ArrayPointing, a_drive_that_does_not_come_nearer_is_stuck)
{
    Loop loop;
    loop.m.par.persistence = 5 * s;
    loop.sun({0, 0, 1});
    loop.update();
    loop.moves = false;
    loop.sun({1, 0, 1});
    for (int k = 0; k < 8; k++) {
        loop.update();
        EXPECT_EQ(loop.m.out.state.stuck, k >= 5 ? 1u : 0u) << k;
    }
    // A slow one is not.
    for (int k = 0; k < 20; k++) {
        loop.m.in.drive.position[0] += 10;
        loop.update();
        EXPECT_EQ(loop.m.out.state.stuck, 0u);
    }
}

TEST(ArrayPointing, a_turn_beyond_the_range_is_made_the_other_way_if_that_is_within)
{
    for (const double side : {1.0, -1.0}) {
        for (const int range : {4000, 2000}) {
            Loop loop;
            loop.m.par.range = static_cast<std::uint32_t>(range);
            loop.m.in.drive.position[0] = static_cast<std::int32_t>(side * std::min(3900, range));
            const double angle = side * (range == 4000 ? -2.2 : -2.9); // nearer by a full turn, which is out of range
            loop.sun({std::sin(angle), 0, std::cos(angle)});
            EXPECT_EQ(loop.update(), range == 4000 ? side * -2200 : side * 2000);
        }
    }
}

} // namespace array_pointing_test
