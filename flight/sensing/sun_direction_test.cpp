// SPDX-License-Identifier: Apache-2.0
// The six faults of a pyramid of the thesis' section 5.4.3, in each converter, from all sides of the Sun.
#include "flight/testing/base.h"
#include "flight/testing/eigen.h"

extern "C" {
#include "flight/sensing/sun_direction.h"
}

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <random>

namespace flight::testing {
namespace {

struct Sensors {
    SunDirection m{};
    std::mt19937 bits{7};

    Sensors()
    {
        m.par.n = 8;
        m.par.persistence = 5;
        m.par.scale[0] = 2e-6;
        m.par.scale[1] = 2.5e-6;
        m.par.offset[1] = -1e-5;
        m.par.dark = 0.02;
        m.par.differ = 0.02;
        for (unsigned i = 0; i < 8; i++) {
            m.par.axes_B[i] = vec3(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1);
            m.par.current[i] = 5e-3;
        }
        m.in.a.head = m.in.b.head = {0, QUALITY_GOOD, 1};
        sun_direction_reset(&m);
    }

    /// What sound converters read of a Sun in the direction s.
    void see(const Vector3d &s)
    {
        for (std::size_t i = 0; i < 8; i++) {
            const double current = 5e-3 * std::max(0.0, eigen(m.par.axes_B[i]).normalized().dot(s));
            m.in.a.counts[i] = static_cast<std::uint16_t>(std::lround(current / 2e-6));
            m.in.b.counts[i] = static_cast<std::uint16_t>(std::lround((current + 1e-5) / 2.5e-6));
        }
    }
    Vector3d any()
    {
        std::normal_distribution<double> normal;
        return Vector3d(normal(bits), normal(bits), normal(bits)).normalized();
    }
    Vector3d update()
    {
        sun_direction_update(&m, {1, 1});
        return eigen(m.out.heading.s_B);
    }
};

TEST(SunDirection, sound_converters_give_the_direction_and_agree)
{
    Sensors s;
    int plane = 0;
    for (int k = 0; k < 2000; k++) {
        const Vector3d sun = s.any();
        s.see(sun);
        // A count is 4e-4 or 5e-4 of a cosine. Of sensors in a plane, those beside it see less than `dark`.
        const double error = (s.update() - sun).norm();
        ASSERT_LT(error, s.m.out.heading.head.quality == QUALITY_GOOD ? 2e-3 : 0.02 * 2);
        plane += s.m.out.heading.head.quality == QUALITY_DEGRADED;
        ASSERT_EQ(s.m.out.status.miscompare, 0u);
    }
    EXPECT_EQ(s.m.out.status.faulty, 0u);
    EXPECT_TRUE(plane > 0 && plane < 100) << plane;
}

enum class Fault { high, low, babble };

void break_channels(Sensors &s, bool second, bool all, Fault fault)
{
    auto &counts = second ? s.m.in.b.counts : s.m.in.a.counts;
    std::uniform_int_distribution<int> any(0, 4095);
    for (std::size_t i = 0; i < 8; i++) {
        if (all || i == 5) {
            counts[i] = static_cast<std::uint16_t>(fault == Fault::high ? 4095 : fault == Fault::low ? 0 : any(s.bits));
        }
    }
}

TEST(SunDirection, the_faulty_converter_is_named_and_the_other_one_used)
{
    for (const bool second : {false, true}) {
        for (const bool all : {true, false}) {
            for (const Fault fault : {Fault::high, Fault::low, Fault::babble}) {
                for (int round = 0; round < 50; round++) {
                    Sensors s;
                    s.bits.seed(static_cast<unsigned>(round));
                    const Vector3d sun = s.any();
                    s.see(sun);
                    const bool lit = eigen(s.m.par.axes_B[5]).dot(sun) > 0.15;
                    if (!all && fault == Fault::low && !lit) {
                        continue; // nothing can show it
                    }
                    for (int k = 0; k < 200; k++) {
                        s.see(sun);
                        break_channels(s, second, all, fault);
                        ASSERT_LT((s.update() - sun).norm(), 0.05) << second << all << static_cast<int>(fault) << k;
                    }
                    EXPECT_EQ(s.m.out.status.faulty, second ? 2u : 1u) << all << static_cast<int>(fault);
                    EXPECT_EQ(s.m.out.event.count, 1u + static_cast<unsigned>(std::popcount(s.m.out.status.sensors)));
                    EXPECT_EQ(s.m.out.status.sensors & ~(all ? 0xFFu : 1u << 5), 0u);
                }
            }
        }
    }
}

TEST(SunDirection, it_is_the_weighted_solution_of_the_lit_cosines_that_it_puts_out)
{
    Sensors s;
    std::uniform_real_distribution<double> any(0.2, 5);
    for (int k = 0; k < 300; k++) {
        s.see(s.any());
        for (std::size_t i = 0; i < 8; i++) {
            s.m.par.weight[i] = i == 3 ? 0 : any(s.bits);
            s.m.in.a.counts[i] = static_cast<std::uint16_t>(s.m.in.a.counts[i] + (i * 7u) % 5u); // they do not agree
            s.m.in.b.counts[i] = 0;
        }
        s.m.in.b.head = {};
        const Vector3d found = s.update();
        const SunCosines &seen = s.m.out.cosines;
        Matrix3d A = Matrix3d::Zero();
        Vector3d b = Vector3d::Zero();
        for (std::size_t i = 0; i < seen.n; i++) {
            const Vector3d n = eigen(seen.axes_B[i]);
            EXPECT_EQ(seen.weight[i], i == 3 ? 1 : s.m.par.weight[i]);
            EXPECT_EQ(seen.lit >> i & 1, seen.cosine[i] >= 0.02);
            if (seen.lit >> i & 1) {
                A += seen.weight[i] * n * n.transpose();
                b += seen.weight[i] * seen.cosine[i] * n;
            }
        }
        if (s.m.out.heading.head.quality == QUALITY_GOOD) {
            EXPECT_LT((found - A.ldlt().solve(b).normalized()).norm(), 1e-9);
        }
    }
}

TEST(SunDirection, a_passing_difference_condemns_nothing)
{
    Sensors s;
    s.see(Vector3d(0.6, 0, 0.8));
    s.m.in.a.counts[5] = 4095;
    for (int k = 0; k < 4; k++) {
        s.update();
        EXPECT_EQ(s.m.out.status.miscompare, 1u << 5);
    }
    s.see(Vector3d(0.6, 0, 0.8));
    for (int k = 0; k < 100; k++) {
        s.update();
    }
    EXPECT_EQ(s.m.out.status.faulty | s.m.out.status.sensors, 0u);
}

TEST(SunDirection, in_the_dark_the_direction_is_held)
{
    Sensors s;
    s.see(Vector3d(0, 0, 1));
    s.update();
    const auto before = s.m.out.heading;
    s.see(Vector3d(0, 0, 0));
    s.update();
    EXPECT_EQ(s.m.out.heading.head.quality, QUALITY_DEGRADED);
    EXPECT_EQ(s.m.out.heading.head.sequence, before.head.sequence);
    EXPECT_EQ(s.m.out.status.miscompare, 0u) << "both are dark";
}

TEST(SunDirection, in_the_dark_too_the_converter_with_a_stuck_channel_is_named)
{
    for (const bool second : {false, true}) {
        Sensors s;
        for (int k = 0; k < 10; k++) {
            s.see(Vector3d::Zero());
            (second ? s.m.in.b : s.m.in.a).counts[3] = 4095;
            s.update();
        }
        EXPECT_EQ(s.m.out.status.faulty, second ? 2u : 1u);
        EXPECT_EQ(s.m.out.cosines.lit, 0u);

        Sensors dead; // in sunlight, one that sees nothing is the faulty one
        const Vector3d sun = dead.any();
        for (int k = 0; k < 10; k++) {
            dead.see(sun);
            SunSensorCounts &none = second ? dead.m.in.b : dead.m.in.a;
            for (auto &count : none.counts) {
                count = second ? 4 : 0;
            }
            dead.update();
        }
        EXPECT_EQ(dead.m.out.status.faulty, second ? 2u : 1u);
    }
}

TEST(SunDirection, one_converter_is_enough)
{
    Sensors s;
    s.m.in.a.head = {};
    s.see(Vector3d(0, 0.6, 0.8));
    EXPECT_LT((s.update() - Vector3d(0, 0.6, 0.8)).norm(), 2e-3);
    EXPECT_EQ(s.m.out.status.miscompare, 0u);
    s.m.in.b.head = {};
    s.update();
    EXPECT_EQ(s.m.out.heading.head.quality, QUALITY_DEGRADED);
}

} // namespace
} // namespace flight::testing
