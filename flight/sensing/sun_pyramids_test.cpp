// SPDX-License-Identifier: Apache-2.0
// The faults of the thesis' section 5.4.3, and others, from all sides of the Sun. What geometry shows of single
// sensors, bench/sun_faults.py asks by another method.
#include "flight/testing/base.h"
#include "flight/testing/eigen.h"

extern "C" {
#include "flight/sensing/sun_pyramids.h"
}

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <functional>
#include <random>

namespace flight::testing {
namespace sun_pyramids_test {

constexpr double full = 5e-3; // [A]
using Counts = std::array<std::uint16_t, 8>;
using Break = std::function<void(Counts &)>;

struct Sensors {
    SunPyramids m{};
    std::mt19937 bits{7};
    std::int64_t t = 0;
    double brightness = 1;

    explicit Sensors(unsigned seed = 7) : bits(seed)
    {
        m.par.persistence = 10;
        m.par.scale[0] = 2e-6;
        m.par.scale[1] = 2.5e-6;
        m.par.offset[1] = -1e-5;
        m.par.dark = 0.02;
        m.par.differ = 0.005;
        for (unsigned i = 0; i < 8; i++) {
            m.par.axes_B[i] = vec3(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i < 4 ? std::sqrt(2) : -std::sqrt(2));
            m.par.current[i] = full;
        }
        m.in.a.head = m.in.b.head = {0, QUALITY_GOOD, 1};
        sun_pyramids_reset(&m);
    }
    double cosine(std::size_t i, const Vector3d &s) const { return eigen(m.par.axes_B[i]).normalized().dot(s); }
    std::size_t lit(unsigned first, const Vector3d &s) const
    {
        std::size_t n = 0;
        for (unsigned i = first; i < first + 4; i++) {
            n += cosine(i, s) > 0.15;
        }
        return n;
    }
    std::uint16_t count(std::size_t i, double cosine) const
    {
        const std::size_t k = i / 4;
        const double exact = (full * cosine - m.par.offset[k]) / m.par.scale[k];
        return static_cast<std::uint16_t>(std::clamp(std::round(exact), 0.0, 4095.0));
    }
    /// An update with what sound converters read, with noise of half a count, and what `fault` makes of it.
    Vector3d see(const Vector3d &s, const Break &fault = {})
    {
        std::normal_distribution<double> noise(0, 2e-4);
        Counts counts;
        for (std::size_t i = 0; i < 8; i++) {
            counts[i] = count(i, brightness * std::max(0.0, cosine(i, s)) + noise(bits));
        }
        if (fault) {
            fault(counts);
        }
        std::copy_n(counts.begin(), 4, m.in.a.counts);
        std::copy_n(counts.begin() + 4, 4, m.in.b.counts);
        sun_pyramids_update(&m, {t += 500'000'000, 500'000'000});
        return eigen(m.out.heading.s_B);
    }
    /// So many of them.
    void see(int n, const Vector3d &s, const Break &fault = {})
    {
        while (n-- > 0) {
            see(s, fault);
        }
    }
    Vector3d any()
    {
        std::normal_distribution<double> normal;
        return Vector3d(normal(bits), normal(bits), normal(bits)).normalized();
    }
    double error(const Vector3d &s) const { return (eigen(m.out.heading.s_B) - s).norm(); }
    Quality quality() const { return m.out.heading.head.quality; }
    const SunPyramidsStatus &status() const { return m.out.status; }
};

enum class Fault { high, low, babble };

Break broken(Sensors &s, unsigned sensors, Fault fault)
{
    return [&s, sensors, fault](Counts &counts) {
        std::uniform_int_distribution<int> any(0, 4095);
        for (std::size_t i = 0; i < 8; i++) {
            if (sensors >> i & 1) {
                const int count = fault == Fault::high ? 4095 : fault == Fault::low ? 0 : any(s.bits);
                counts[i] = static_cast<std::uint16_t>(count);
            }
        }
    };
}

TEST(SunPyramids, sound_converters_give_the_direction_and_no_contradiction)
{
    Sensors s;
    for (int k = 0; k < 5000; k++) {
        const Vector3d sun = s.any();
        // Noise and half a count are 5e-4 of a cosine; sensors below `dark` say less.
        ASSERT_LT((s.see(sun) - sun).norm(), 0.02) << k;
        ASSERT_EQ(s.quality(), QUALITY_GOOD);
        ASSERT_EQ(s.status().suspects, 0u);
    }
    EXPECT_EQ(s.status().faulty + s.m.out.event.count, 0u);
}

TEST(SunPyramids, the_direction_has_the_least_squares_of_all_unit_vectors)
{
    Sensors s;
    s.m.par.differ = 1;
    std::uniform_real_distribution<double> any(0.2, 5);
    for (int k = 0; k < 300; k++) {
        for (std::size_t i = 0; i < 8; i++) {
            s.m.par.weight[i] = i == 3 ? 0 : any(s.bits);
        }
        const Vector3d sun = s.any(), found = s.see(sun, [](Counts &counts) {
            for (std::size_t i = 0; i < 8; i++) {
                counts[i] = static_cast<std::uint16_t>(counts[i] + (i * 7) % 5 * 4); // they do not agree
            }
        });
        const SunCosines &seen = s.m.out.cosines;
        const auto squares = [&](const Vector3d &d) {
            double sum = 0;
            for (std::size_t i = 0; i < 8; i++) {
                EXPECT_EQ(seen.weight[i], i == 3 ? 1 : s.m.par.weight[i]);
                const double cosine = eigen(seen.axes_B[i]).dot(d), reads = std::max(0.0, seen.cosine[i]);
                const bool counts = seen.lit >> i & 1 || cosine > reads;
                sum += counts ? seen.weight[i] * std::pow((seen.lit >> i & 1 ? seen.cosine[i] : reads) - cosine, 2) : 0;
            }
            return sum;
        };
        for (int n = 0; n < 50; n++) {
            ASSERT_LT(squares(found), squares((found + (n % 2 ? 1e-3 : 0.1) * s.any()).normalized()) + 1e-9) << k;
        }
    }
}

TEST(SunPyramids, the_faulty_converter_of_the_twelve_cases_is_named_and_the_others_used)
{
    for (const unsigned first : {0u, 4u}) {
        for (const bool all : {true, false}) {
            for (const Fault fault : {Fault::high, Fault::low, Fault::babble}) {
                for (unsigned round = 0; round < 60; round++) {
                    Sensors s(round);
                    const Vector3d sun = s.any();
                    const unsigned sensors = all ? 0xFu << first : 1u << (first + 2);
                    const std::size_t own = s.lit(first, sun), others = s.lit(4 - first, sun);
                    s.see(20, sun);
                    for (int k = 0; k < 200; k++) {
                        s.see(sun, broken(s, sensors, fault));
                        ASSERT_EQ(s.status().faulty & ~(1u << first / 4), 0u) << "the sound one is blamed";
                        ASSERT_LT(s.error(sun), 0.05) << first << all << static_cast<int>(fault) << k;
                    }
                    const auto expect_named = [&](unsigned unused) {
                        EXPECT_EQ(s.status().faulty, 1u << first / 4) << static_cast<int>(fault) << round;
                        EXPECT_EQ(s.status().unused, unused) << static_cast<int>(fault) << round;
                        EXPECT_EQ(s.m.out.event.id, SUN_PYRAMIDS_FAULTY);
                        EXPECT_EQ(s.m.out.event.count, 1u);
                        EXPECT_EQ(s.m.out.event.arguments[0], s.status().faulty);
                        EXPECT_EQ(s.m.out.event.arguments[1], s.status().unused);
                        EXPECT_EQ(s.quality(),
                                  std::popcount(s.m.out.cosines.lit) > 1 ? QUALITY_GOOD : QUALITY_DEGRADED);
                    };
                    if (fault != Fault::low) {
                        expect_named(sensors);
                    } else if (all && others > 1 && own > 1) {
                        expect_named(sensors); // else it looks like an eclipse, or as if the one lit sensor failed
                    } else if (!all && s.cosine(first + 2, sun) < 0) {
                        EXPECT_EQ(s.status().suspects + s.m.out.event.count, 0u) << "nothing can show it";
                    }
                }
            }
        }
    }
}

TEST(SunPyramids, any_reading_of_one_sensor_is_never_laid_to_the_other_converter)
{
    std::size_t found = 0;
    for (unsigned round = 0; round < 1500; round++) {
        Sensors s(round);
        const Vector3d sun = s.any();
        const std::size_t i = round % 8;
        const double reads = std::uniform_real_distribution<double>(0, 1.2)(s.bits);
        s.brightness = round % 5 == 0 ? 0 : 1;
        s.see(round % 3 ? 15 : 0, sun);
        s.see(15, sun, [&](Counts &counts) { counts[i] = s.count(i, reads); });
        ASSERT_EQ(s.status().faulty & ~(1u << i / 4), 0u) << round;
        ASSERT_EQ(s.status().unused & ~(0xFu << i / 4 * 4), 0u) << round;
        found += s.status().faulty != 0;
    }
    EXPECT_GT(found, 1200u);
}

TEST(SunPyramids, a_shadow_is_no_fault)
{
    for (unsigned round = 0; round < 200; round++) {
        Sensors s(round);
        const Vector3d sun = s.any();
        s.m.par.persistence = 20;
        for (int k = 0; k < 200; k++) {
            s.brightness = std::clamp((std::abs(k - 100) - 50) / 16.0, 0.0, 1.0); // half-shadows of 8 s
            s.see(sun);
            ASSERT_LT(s.error(sun), 0.03);
        }
        EXPECT_EQ(s.status().faulty + s.m.out.event.count, 0u) << round;
    }
}

TEST(SunPyramids, a_sensor_that_stays_lit_in_a_shadow_is_not_laid_to_the_other_converter)
{
    std::size_t found = 0;
    for (unsigned round = 0; round < 150; round++) {
        Sensors s(round);
        const Vector3d sun = s.any();
        const std::size_t i = round % 8;
        const std::uint16_t stuck = s.count(i, std::max(0.0, s.cosine(i, sun)));
        s.m.par.persistence = 20;
        for (int k = 0; k < 300; k++) {
            s.brightness = std::clamp((std::abs(k - 150) - 80) / 16.0, 0.0, 1.0); // half-shadows of 8 s
            s.see(sun, [&](Counts &counts) { counts[i] = stuck; });
            ASSERT_EQ(s.status().faulty & ~(1u << i / 4), 0u) << round << " " << k;
        }
        found += s.status().faulty != 0;
    }
    EXPECT_GT(found, 20u);
}

const Vector3d beside = Vector3d(1, 0.1, 0.05).normalized(); // lights two of each

TEST(SunPyramids, a_converter_that_stands_still_is_not_believed_against_a_dark_one)
{
    // It freezes as an eclipse begins. What A sees, and what B no longer sees, may as well be A reading low.
    Sensors s;
    s.see(20, beside);
    Counts frozen{};
    s.see(beside, [&](Counts &counts) { frozen = counts; });
    s.brightness = 0;
    s.see(100, beside, [&](Counts &counts) { std::copy(frozen.begin() + 4, frozen.end(), counts.begin() + 4); });
    EXPECT_EQ(s.status().faulty, 0u);
    EXPECT_EQ(s.status().suspects, 3u);
    EXPECT_GT(s.status().unresolved, 90u);
    EXPECT_EQ(s.m.out.event.id, SUN_PYRAMIDS_UNRESOLVED);
    EXPECT_EQ(s.quality(), QUALITY_DEGRADED);
}

TEST(SunPyramids, a_pyramid_that_failed_in_the_dark_is_not_blamed_and_the_lit_one_used)
{
    Sensors s;
    s.see(20, -Vector3d::UnitZ());
    s.see(20, -Vector3d::UnitZ(), broken(s, 0xF, Fault::low));
    EXPECT_EQ(s.status().suspects, 0u) << "nothing can show it";
    EXPECT_EQ(s.quality(), QUALITY_GOOD);
    for (double angle = -pi / 2; angle < 0; angle += 0.01) {
        const Vector3d sun(std::cos(angle), 0.1 * std::cos(angle), std::sin(angle));
        s.see(sun.normalized(), broken(s, 0xF, Fault::low));
        ASSERT_LT(s.error(sun.normalized()), 0.15) << angle << " it is held for ten updates";
        ASSERT_EQ(s.status().faulty, 0u);
    }
    EXPECT_EQ(s.status().suspects, 3u);
    EXPECT_EQ(s.quality(), QUALITY_DEGRADED);
}

TEST(SunPyramids, a_slow_drift_of_a_sensor_is_found_before_it_harms)
{
    for (const double rate : {2e-3, -2e-3}) {
        for (const std::size_t i : {1u, 3u, 5u, 7u}) {
            Sensors s;
            for (int k = 0; k < 400; k++) {
                s.see(beside, [&](Counts &counts) { counts[i] = s.count(i, s.cosine(i, beside) + rate * k / 2); });
                ASSERT_LT(s.error(beside), 0.02);
            }
            EXPECT_EQ(s.status().unused, 1u << i) << rate;
        }
    }
}

TEST(SunPyramids, a_passing_fault_is_forgotten_and_an_intermittent_one_found)
{
    Sensors s;
    const Break low = broken(s, 1u << 1, Fault::low);
    for (int round = 0; round < 20; round++) {
        s.see(9, beside, low);
        EXPECT_EQ(s.status().suspects, 1u);
        s.see(10, beside);
    }
    EXPECT_EQ(s.status().faulty + s.m.out.event.count, 0u);
    for (int round = 0; round < 10; round++) {
        s.see(1, beside, low);
        s.see(9, beside);
    }
    EXPECT_EQ(s.status().unused, 1u << 1);
}

TEST(SunPyramids, what_was_found_faulty_is_out_of_use_until_a_reset)
{
    Sensors s;
    s.see(20, beside, broken(s, 0xF0, Fault::high));
    s.see(500, beside);
    EXPECT_EQ(s.status().unused, 0xF0u);
    EXPECT_EQ(s.m.out.cosines.lit & 0xF0u, 0u);
    EXPECT_EQ(s.quality(), QUALITY_GOOD);
    sun_pyramids_reset(&s.m);
    s.see(20, beside);
    EXPECT_EQ(s.status().faulty, 0u);
    EXPECT_EQ(std::popcount(s.m.out.cosines.lit), 4);
}

TEST(SunPyramids, a_fault_that_grows_takes_the_whole_pyramid_and_one_of_the_other_both)
{
    Sensors s;
    s.see(20, beside, broken(s, 1u << 1, Fault::high));
    EXPECT_EQ(s.status().unused, 1u << 1);
    s.see(20, beside, broken(s, 0xF, Fault::babble));
    EXPECT_EQ(s.status().unused, 0xFu);
    EXPECT_EQ(s.status().faulty, 1u);
    EXPECT_LT(s.error(beside), 0.01);
    s.see(20, beside, broken(s, 0xFF, Fault::high));
    EXPECT_EQ(s.status().faulty, 3u);
    EXPECT_EQ(s.quality(), QUALITY_DEGRADED);
    EXPECT_LT(s.error(beside), 0.01) << "it is held";
}

TEST(SunPyramids, one_more_sensor_of_a_faulty_converter_takes_its_rest)
{
    for (const bool first : {true, false}) {
        for (const double reads : {0.0, 0.6, 0.9, 1.2}) {
            Sensors s;
            const std::size_t known = first ? 1 : 5, next = first ? 3 : 7;
            s.see(20, beside, broken(s, 1u << known, Fault::high));
            ASSERT_EQ(s.status().unused, 1u << known);
            s.see(25, beside, [&](Counts &counts) {
                counts[known] = 4095;
                counts[next] = s.count(next, reads);
            });
            EXPECT_EQ(s.status().unused, first ? 0xFu : 0xF0u) << reads;
            EXPECT_EQ(s.status().faulty, first ? 1u : 2u);
            EXPECT_EQ(s.quality(), QUALITY_GOOD);
            EXPECT_LT(s.error(beside), 0.01);
        }
    }
}

TEST(SunPyramids, another_sun_is_laid_to_the_converter_that_was_faulty_before)
{
    const Vector3d elsewhere = Vector3d(1, 0.5, 0.05).normalized();
    for (const std::size_t dark : {0, 4}) {
        for (const bool faulty : {true, false}) {
            Sensors s;
            s.see(20, beside, faulty ? broken(s, 1u << dark, Fault::high) : Break{});
            ASSERT_EQ(s.status().unused, faulty ? 1u << dark : 0u);
            s.see(25, beside, [&](Counts &counts) {
                for (std::size_t i = dark; i < dark + 4; i++) {
                    counts[i] = s.count(i, std::max(0.0, s.cosine(i, elsewhere)));
                }
            });
            EXPECT_EQ(s.status().unused, faulty ? 0xFu << dark : 0u);
            EXPECT_EQ(s.status().suspects, faulty ? 0u : 3u) << "each has a Sun, and neither was faulty";
            EXPECT_EQ(s.quality(), faulty ? QUALITY_GOOD : QUALITY_DEGRADED);
            EXPECT_LT(s.error(beside), 0.01);
        }
    }
}

TEST(SunPyramids, of_both_at_once_neither_is_blamed)
{
    for (const Fault fault : {Fault::high, Fault::low, Fault::babble}) {
        Sensors s;
        s.see(20, beside);
        s.see(100, beside, broken(s, 0xFF, fault));
        EXPECT_EQ(s.status().faulty, 0u);
        EXPECT_EQ(s.status().unresolved > 10, fault != Fault::low) << "low looks like an eclipse";
        EXPECT_EQ(s.quality(), QUALITY_DEGRADED);
        EXPECT_LT(s.error(beside), 0.01);
        s.see(5, beside);
        EXPECT_EQ(s.quality(), QUALITY_GOOD);
    }
}

TEST(SunPyramids, one_converter_is_enough)
{
    for (const bool first : {false, true}) {
        Sensors s;
        (first ? s.m.in.a : s.m.in.b).head = {};
        EXPECT_LT((s.see(beside) - beside).norm(), 5e-3);
        EXPECT_EQ(s.quality(), QUALITY_GOOD);
        EXPECT_EQ(s.status().suspects, 0u);
        s.see(20, beside, broken(s, first ? 0xF0 : 0xF, Fault::high));
        EXPECT_EQ(s.status().faulty, first ? 2u : 1u);
    }
    Sensors s;
    s.m.in.a.head = s.m.in.b.head = {};
    s.see(20, beside);
    EXPECT_EQ(s.quality(), QUALITY_NONE);
    EXPECT_EQ(s.status().faulty + s.status().suspects, 0u);
}

} // namespace sun_pyramids_test
} // namespace flight::testing
