// SPDX-License-Identifier: Apache-2.0
// Rasters: their times in whole nanoseconds at any rate of updates, and patterns that they make.
#include "flight/testing/base.h"
#include "flight/testing/poison.h"

extern "C" {
#include "flight/guidance/euler_rotation.h"
#include "flight/guidance/inertial_pointing.h"
#include "flight/guidance/raster_manager.h"
}

#include <gtest/gtest.h>

#include <numeric>
#include <vector>

namespace flight::testing {
namespace raster_manager_test {

using Ns = std::int64_t;

struct Raster {
    Vector3d angles, rates;
    double duration;
};

template <class List> // the parameters, or a message
void fill(List &list, const std::vector<Raster> &rasters, bool repeat)
{
    list.n = static_cast<std::uint32_t>(rasters.size());
    list.repeat = repeat;
    for (std::size_t i = 0; i < rasters.size(); i++) {
        list.angles[i] = vec(rasters[i].angles);
        list.rates[i] = vec(rasters[i].rates);
        list.durations[i] = rasters[i].duration;
    }
}

RasterManager manager(const std::vector<Raster> &rasters, bool repeat = false)
{
    RasterManager m{};
    fill(m.par, rasters, repeat);
    return m;
}

RasterList list(Ns start, const std::vector<Raster> &rasters, bool repeat = false)
{
    RasterList list{};
    list.head = good();
    list.start = start;
    fill(list, rasters, repeat);
    return list;
}

std::vector<Raster> any_rasters(Random &random, int n)
{
    std::vector<Raster> rasters;
    for (int i = 0; i < n; i++) {
        rasters.push_back({random.vector(), random.vector(0.01), random.real(0.1, 20)});
    }
    return rasters;
}

/// What should be commanded at t, found by walking through raster after raster.
struct Expected {
    Ns start;
    std::size_t index;
    Ns cycle;
    bool done;
};

Expected walk(const std::vector<Raster> &rasters, bool repeat, Ns start, Ns t)
{
    for (Ns cycle = 0;; cycle++) {
        for (std::size_t i = 0; i < rasters.size(); i++) {
            Ns end = start + ns(rasters[i].duration);
            if (t < end) {
                return {start, i, cycle, false};
            }
            start = end;
        }
        if (!repeat) {
            return {start, rasters.size() - 1, 1, true};
        }
    }
}

void expect(const RasterManager &m, const std::vector<Raster> &rasters, const Expected &e, Ns t)
{
    const EulerCommand &command = m.out.command;
    const RasterStatus &status = m.out.status;
    const Raster &raster = rasters[e.index];
    ASSERT_EQ(command.start, e.start) << t;
    ASSERT_EQ(status.index, e.index) << t;
    ASSERT_EQ(status.cycle, e.cycle) << t;
    ASSERT_EQ(status.done, e.done) << t;
    ASSERT_EQ(status.elapsed, t - e.start) << t;
    if (e.done) {
        Vector3d end = raster.angles + tick_seconds(ns(raster.duration)) * raster.rates;
        ASSERT_EQ(eigen(command.angles), end) << t;
        ASSERT_EQ(eigen(command.rates), Vector3d::Zero()) << t;
    } else {
        ASSERT_EQ(eigen(command.angles), raster.angles) << t;
        ASSERT_EQ(eigen(command.rates), raster.rates) << t;
    }
    ASSERT_EQ(command.head.t, t);
    ASSERT_EQ(status.head.t, t);
}

TEST(RasterManager, rasters_begin_to_the_nanosecond_whenever_it_is_updated)
{
    Random random{1};
    for (int trial = 0; trial < 200; trial++) {
        std::vector<Raster> rasters = any_rasters(random, 1 + random.below(RASTERS_MAX));
        bool repeat = trial % 2;
        RasterManager m = manager(rasters, repeat);
        Ns start = random.below(1'000'000'000), t = start;
        for (int k = 0; k < 300; k++) {
            raster_manager_update(&m, {t, 0});
            expect(m, rasters, walk(rasters, repeat, start, t), t);
            ASSERT_EQ(m.out.command.head.quality, QUALITY_GOOD);
            ASSERT_EQ(m.out.command.head.sequence, static_cast<std::uint32_t>(k + 1));
            t += random.below(2'000'000'000);
        }
    }
}

TEST(RasterManager, a_raster_ends_where_the_next_begins)
{
    Random random{2};
    std::vector<Raster> rasters = any_rasters(random, RASTERS_MAX);
    rasters[3].duration = 0.1;
    rasters[4].duration = 1600;
    rasters[5].duration = 1.0 / 3;
    rasters[6].duration = 1e-9;
    rasters[7].duration = 1.4999e-9; // to the nearest nanosecond
    rasters[8].duration = 1.5001e-9;
    for (bool repeat : {false, true}) {
        RasterManager m = manager(rasters, repeat);
        Ns start = 123'456'789;
        raster_manager_update(&m, {start, 0});
        Ns boundary = start;
        for (int i = 0; i < 3 * RASTERS_MAX; i++) {
            boundary += ns(rasters[static_cast<std::size_t>(i % RASTERS_MAX)].duration);
            for (Ns t : {boundary - 1, boundary}) {
                raster_manager_update(&m, {t, 0});
                expect(m, rasters, walk(rasters, repeat, start, t), t);
            }
        }
    }
    EXPECT_EQ(ns(rasters[7].duration), 1);
    EXPECT_EQ(ns(rasters[8].duration), 2);
}

TEST(RasterManager, the_longest_list_of_the_longest_rasters)
{
    Random random{3};
    std::vector<Raster> rasters = any_rasters(random, RASTERS_MAX);
    for (Raster &raster : rasters) {
        raster.duration = 5e8;
    }
    RasterManager m = manager(rasters);
    raster_manager_update(&m, {1, 0});
    Ns most = std::numeric_limits<Ns>::max();
    for (Ns t : {Ns{500'000'000'000'000'000}, Ns{500'000'000'000'000'001}, most - 1, most}) {
        raster_manager_update(&m, {t, 0});
        expect(m, rasters, walk(rasters, false, 1, t), t);
    }
    m = manager({{{0, 0, 0}, {0, 0, 0}, 1e-9}}, true); // the shortest, as often as it can be
    raster_manager_update(&m, {0, 0});
    raster_manager_update(&m, {most, 0});
    EXPECT_EQ(m.out.status.cycle, most);
    EXPECT_EQ(m.out.command.start, most);
}

TEST(RasterManager, a_list_at_the_input_replaces_the_parameters_exactly_when_it_starts)
{
    Random random{4};
    std::vector<Raster> first = any_rasters(random, 3), second = any_rasters(random, 5);
    RasterManager m = manager(first, true);
    Ns start = 7'123'456'789;
    m.in.list = list(start, second);
    for (Ns t = 0; t < 200'000'000'000; t += 37'000'001) {
        raster_manager_update(&m, {t, 0});
        if (t < start) {
            expect(m, first, walk(first, true, 0, t), t);
        } else {
            expect(m, second, walk(second, false, start, t), t);
        }
        ASSERT_EQ(m.out.command.head.quality, QUALITY_GOOD);
        ASSERT_EQ(m.out.status.refused, 0u);
    }
}

TEST(RasterManager, a_list_stays_until_the_next_one_starts)
{
    Random random{5};
    auto a = any_rasters(random, 3), b = any_rasters(random, 2), c = any_rasters(random, 1);
    RasterManager m = manager(a, true);
    auto update = [&](Ns t) { raster_manager_update(&m, {t, 0}); };
    update(0);
    m.in.list = list(5, b, true);
    update(10'000'000'000);
    expect(m, b, walk(b, true, 5, 10'000'000'000), 10'000'000'000);
    m.in.list = list(20'000'000'000, a);
    update(15'000'000'000);
    expect(m, b, walk(b, true, 5, 15'000'000'000), 15'000'000'000);
    m.in.list = list(17'000'000'000, c, true); // given instead of the one that was to come
    update(20'000'000'000);
    expect(m, c, walk(c, true, 17'000'000'000, 20'000'000'000), 20'000'000'000);
    m.in.list.head = Head{}; // its sender was reset
    update(30'000'000'000);
    expect(m, c, walk(c, true, 17'000'000'000, 30'000'000'000), 30'000'000'000);
    raster_manager_reset(&m);
    EXPECT_TRUE(all_zero(m.out));
    EXPECT_TRUE(all_zero(m.mem));
    update(40'000'000'000);
    expect(m, a, walk(a, true, 40'000'000'000, 40'000'000'000), 40'000'000'000);
}

/// Spoils a list, or the parameters.
struct Fault {
    const char *what;
    std::uint32_t n;
    double duration, angle, rate;
};

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

const Fault faults[] = {{"empty", 0, 1, 0, 0},
                        {"too many", RASTERS_MAX + 1, 1, 0, 0},
                        {"far too many", 0xffffffffu, 1, 0, 0},
                        {"no duration", 3, 0, 0, 0},
                        {"less than half a nanosecond", 3, 4.9e-10, 0, 0},
                        {"a negative duration", 3, -1, 0, 0},
                        {"a duration beyond the bound", 3, 5.1e8, 0, 0},
                        {"an infinite duration", 3, HUGE_VAL, 0, 0},
                        {"a duration that is no number", 3, nan, 0, 0},
                        {"an angle that is no number", 3, 1, nan, 0},
                        {"an infinite rate", 3, 1, 0, HUGE_VAL}};

template <class List> void spoil(List &list, const Fault &fault)
{
    list.n = fault.n;
    list.durations[2] = fault.duration;
    list.angles[2].v[1] = fault.angle;
    list.rates[2].v[2] = fault.rate;
}

TEST(RasterManager, refuses_a_list_that_is_none_and_goes_on_with_the_one_before)
{
    Random random{6};
    std::vector<Raster> rasters = any_rasters(random, 3), other = any_rasters(random, 3);
    for (const Fault &fault : faults) {
        RasterManager m = manager(rasters, true);
        m.in.list = list(1, other); // refused as soon as it is seen, also before it would start
        spoil(m.in.list, fault);
        for (Ns t : {Ns{0}, Ns{500'000'000}, Ns{60'000'000'000}}) {
            raster_manager_update(&m, {t, 0});
            expect(m, rasters, walk(rasters, true, 0, t), t);
            EXPECT_EQ(m.out.command.head.quality, QUALITY_DEGRADED) << fault.what;
            EXPECT_EQ(m.out.status.head.quality, QUALITY_DEGRADED) << fault.what;
            EXPECT_EQ(m.out.status.refused, 1u) << fault.what;
        }
        EXPECT_TRUE(all_zero(m.mem.commanded)) << fault.what;
        m.in.list = list(1, other);
        raster_manager_update(&m, {70'000'000'000, 0});
        expect(m, other, walk(other, false, 1, 70'000'000'000), 70'000'000'000);
        EXPECT_EQ(m.out.status.head.quality, QUALITY_GOOD) << fault.what;
        EXPECT_EQ(m.out.status.refused, 0u) << fault.what;
    }
    RasterManager m = manager(rasters);
    m.in.list = list(std::numeric_limits<Ns>::min(), other);
    raster_manager_update(&m, {0, 0});
    EXPECT_EQ(m.out.status.refused, 1u) << "it starts before the run";
}

TEST(RasterManager, with_parameters_that_are_no_list_nothing_is_commanded_anew)
{
    Random random{7};
    std::vector<Raster> rasters = any_rasters(random, 3);
    for (const Fault &fault : faults) {
        RasterManager m = manager(rasters);
        spoil(m.par, fault);
        raster_manager_update(&m, {0, 0});
        EXPECT_TRUE(all_zero(m.out)) << fault.what;

        m = manager(rasters);
        raster_manager_update(&m, {0, 0});
        RasterManager last = m;
        spoil(m.par, fault);
        raster_manager_update(&m, {60'000'000'000, 0});
        EXPECT_TRUE(same_content(m.out.command, last.out.command)) << fault.what;
        EXPECT_EQ(m.out.command.head.quality, QUALITY_DEGRADED) << fault.what;
        EXPECT_EQ(m.out.status.head.quality, QUALITY_DEGRADED) << fault.what;
        EXPECT_EQ(m.out.command.head.t, 0) << fault.what;

        m.in.list = list(0, rasters); // a good list at the input is all it needs
        raster_manager_update(&m, {60'000'000'000, 0});
        EXPECT_EQ(m.out.command.head.quality, QUALITY_GOOD) << fault.what;
    }
}

TEST(RasterManager, a_stale_list_degrades)
{
    Random random{8};
    RasterManager m = manager(any_rasters(random, 2));
    m.in.list = list(0, any_rasters(random, 2));
    m.in.list.head.quality = QUALITY_STALE;
    raster_manager_update(&m, {0, 0});
    EXPECT_EQ(m.out.command.head.quality, QUALITY_DEGRADED);
    EXPECT_EQ(m.out.status.head.quality, QUALITY_DEGRADED);
    EXPECT_EQ(m.out.status.refused, 0u);
}

TEST(RasterManager, gives_finite_numbers_whatever_it_is_given)
{
    Random random{9};
    RasterManager m{};
    RasterList &in = m.in.list;
    auto any_integer = [&] { return static_cast<Ns>(random.real(-9.2e18, 9.2e18)); };
    Ns t = 0;
    for (int round = 0; round < 20000; round++) {
        throw_numbers(doubles(in.angles, in.rates, in.durations, m.par.angles, m.par.rates, m.par.durations), random,
                      round);
        if (round % 2) { // as they come, hardly any list is one
            std::iota(in.durations, in.durations + RASTERS_MAX, random.real(1e-9, 10));
            std::iota(m.par.durations, m.par.durations + RASTERS_MAX, random.real(1e-9, 10));
        }
        in.head.quality = any_quality(random);
        in.start = random.below(2) ? any_integer() : t;
        in.n = static_cast<std::uint32_t>(random.below(20));
        m.par.n = static_cast<std::uint32_t>(random.below(20));
        in.repeat = static_cast<std::uint32_t>(random.below(2));
        m.par.repeat = static_cast<std::uint32_t>(random.below(2));
        t += round % 3 ? random.below(1'000'000'000) : 200'000'000'000'000;
        raster_manager_update(&m, {t, 0});
        expect_finite(doubles(m.out.command.angles, m.out.command.rates), round);
        if (m.out.command.head.t == t) {
            ASSERT_LE(m.out.command.start, t);
            ASSERT_LT(m.out.status.index, static_cast<std::uint32_t>(RASTERS_MAX));
            ASSERT_EQ(m.out.command.start + m.out.status.elapsed, t);
        }
    }
    EXPECT_GT(m.out.command.head.sequence, 1000u);
}

// Patterns

TEST(Pattern, is_the_same_at_any_rate_of_updates)
{
    Random random{10};
    std::vector<Raster> rasters = any_rasters(random, 7);
    RasterManager slow = manager(rasters, true), fast = slow;
    EulerRotation slowly{}, quickly{};
    slowly.in.base.head = quickly.in.base.head = good();
    for (Ns t = 0; t < 300'000'000'000; t += 10'000'000) {
        raster_manager_update(&fast, {t, 0});
        quickly.in.command = fast.out.command;
        euler_rotation_update(&quickly, {t, 0});
        if (t % 700'000'000 == 0) {
            raster_manager_update(&slow, {t, 0});
            slowly.in.command = slow.out.command;
            euler_rotation_update(&slowly, {t, 0});
            ASSERT_TRUE(same_content(slowly.out.reference, quickly.out.reference)) << t;
            ASSERT_TRUE(same_content(slowly.out.euler, quickly.out.euler)) << t;
        }
    }
}

TEST(Pattern, asterisk_of_table_2_4)
{
    constexpr double alpha = 8 * pi / 180, duration = 1600, rate = 2 * alpha / duration;
    RasterManager m = manager({{{alpha, 0, 0}, {-rate, 0, 0}, duration},
                               {{-alpha, -alpha, 0}, {rate, rate, 0}, duration},
                               {{alpha, -alpha, 0}, {-rate, rate, 0}, duration},
                               {{0, alpha, 0}, {0, -rate, 0}, duration},
                               {{alpha, 0, 0}, {0, 0, 0}, duration}}); // back to 1(a)
    const Vector3d ends[][2] = {{{alpha, 0, 0}, {-alpha, 0, 0}},
                                {{-alpha, -alpha, 0}, {alpha, alpha, 0}},
                                {{alpha, -alpha, 0}, {-alpha, alpha, 0}},
                                {{0, alpha, 0}, {0, -alpha, 0}},
                                {{alpha, 0, 0}, {alpha, 0, 0}}};
    EulerRotation turned{};
    turned.in.base.head = good();
    auto angles_at = [&](Ns t) -> Vector3d {
        raster_manager_update(&m, {t, 500'000'000});
        turned.in.command = m.out.command;
        euler_rotation_update(&turned, {t, 500'000'000});
        return eigen(turned.out.euler.angles);
    };
    for (Ns i = 0; i < 5; i++) {
        EXPECT_EQ(angles_at(1'600'000'000'000 * i), ends[i][0]) << "raster " << i + 1 << "(a)";
        EXPECT_LT((angles_at(1'600'000'000'000 * (i + 1) - 1) - ends[i][1]).norm(), rate * 2e-9)
            << "raster " << i + 1 << "(b)";
    }
    EXPECT_EQ(angles_at(9'000'000'000'000), ends[4][1]) << "held";
    EXPECT_EQ(m.out.status.done, 1u);
}

/// Figure 2.17: a base at rest, three centres about which the roll turns, and a pitch that grows
/// anew from each. The boresight is then growth t away from the centre, in a direction that turns.
TEST(Pattern, triple_spiral)
{
    Random random{11};
    constexpr double duration = 900, roll = 2 * pi / 150, growth = 0.02 / duration;
    const Vector3d centres[] = {{0.05, 0, 0}, {-0.03, 0.04, 0}, {-0.03, -0.04, 0}};
    std::vector<Raster> spirals;
    for (const Vector3d &centre : centres) {
        spirals.push_back({centre, {0, 0, roll}, duration});
    }
    InertialPointing base{};
    base.par.sigma_RN = random.mrp();
    Matrix3d R0N = dcm(base.par.sigma_RN);
    RasterManager centred = manager(spirals);
    RasterManager grown = manager({{{0, 0, 0}, {0, growth, 0}, duration}}, true);
    EulerRotation about{}, away{};
    for (Ns t = 0; t < 3 * ns(duration); t += 450'000'000) {
        inertial_pointing_update(&base, {t, 0});
        raster_manager_update(&centred, {t, 0});
        raster_manager_update(&grown, {t, 0});
        about.in.base = base.out.reference;
        about.in.command = centred.out.command;
        euler_rotation_update(&about, {t, 0});
        away.in.base = about.out.reference;
        away.in.command = grown.out.command;
        euler_rotation_update(&away, {t, 0});

        double since = tick_seconds(t % ns(duration));
        const Vector3d &centre = centres[t / ns(duration)];
        Matrix3d C = turn(1, centre.y()) * turn(2, centre.x()) * R0N;
        Vector3d boresight = C * dcm(away.out.reference.sigma_RN).row(0).transpose();
        double off = growth * since, way = roll * since;
        Vector3d spiral{std::cos(off), std::sin(off) * std::sin(way), -std::sin(off) * std::cos(way)};
        ASSERT_LT((boresight - spiral).norm(), 1e-14) << t;
        ASSERT_EQ(away.out.reference.head.quality, QUALITY_GOOD);
    }
    EXPECT_EQ(centred.out.status.index, 2u);
    EXPECT_EQ(grown.out.status.cycle, 2);
}

} // namespace raster_manager_test
} // namespace flight::testing
