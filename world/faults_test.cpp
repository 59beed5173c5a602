// SPDX-License-Identifier: Apache-2.0
#include "world/faults.h"

#include "world/testing/flyer.h"

#include <gtest/gtest.h>

#include <cstring>
#include <random>
#include <set>
#include <utility>

namespace faults_test {

using namespace fledge;
using namespace fledge::world;
using namespace fledge::world::testing;

constexpr Ns period = 100 * ms;

/// Four channels that give t + 10 k [s], within 1000, read every 0.1 s.
struct Channels {
    Faults<4> faults;
    FaultSet injected{};
    std::vector<Fault> planned;
    Ns t = 0;
    std::array<double, 4> x{};
    bool speaks = true;

    explicit Channels(std::vector<Fault> plan = {}, std::uint64_t seed = 1) : planned(std::move(plan))
    {
        faults.reset(sim::Random(seed, "world.sensor"));
    }
    double truth(std::size_t k) const { return seconds(t) + 10.0 * static_cast<double>(k); }
    const std::array<double, 4> &read(Ns dt = period)
    {
        t += dt;
        for (std::size_t k = 0; k < 4; k++) {
            x[k] = truth(k);
        }
        faults.begin(t, static_cast<std::uint32_t>(planned.size()), planned.data(), injected);
        speaks = faults.apply(0, x, -1000.0, 1000.0);
        return x;
    }
    static double seconds(Ns ns) { return tick_seconds(ns); }
};

/// Each kind on the channels 1 and 2 from 2 s to 5 s, against what it does to t + 10 k.
TEST(Faults, EachHasItsEffectOnItsChannelsInItsTime)
{
    const std::vector<std::pair<Fault, std::function<double(double t, std::size_t k)>>> kinds = {
        {{FAULT_NONE, 6, 3.0, 0, 0}, [](double t, std::size_t k) { return t + 10.0 * static_cast<double>(k); }},
        {{FAULT_HIGH, 6, 3.0, 0, 0}, [](double, std::size_t) { return 1000.0; }},
        {{FAULT_LOW, 6, 3.0, 0, 0}, [](double, std::size_t) { return -1000.0; }},
        {{FAULT_BIAS, 6, 3.0, 0, 0}, [](double t, std::size_t k) { return t + 10.0 * static_cast<double>(k) + 3.0; }},
        {{FAULT_DRIFT, 6, 3.0, 0, 0},
         [](double t, std::size_t k) { return t + 10.0 * static_cast<double>(k) + 3.0 * (t - 2.0); }},
        {{FAULT_DROPOUT, 6, 0.0, 0, 0}, [](double, std::size_t k) { return 1.9 + 10.0 * static_cast<double>(k); }},
        {{FAULT_DELAY, 6, 0.5, 0, 0},
         [](double t, std::size_t k) { return std::max(t - 0.5, 2.0) + 10.0 * static_cast<double>(k); }},
        {{FAULT_DEAD, 6, 3.0, 0, 0}, [](double, std::size_t) { return 0.0; }},
    };
    for (auto [fault, effect] : kinds) {
        fault.begin = 2 * second;
        fault.lasts = 3 * second;
        Channels c({fault});
        for (int i = 0; i < 70; i++) {
            c.read();
            EXPECT_TRUE(c.speaks) << "channels 0 and 3 do";
            const bool acts = c.t >= 2 * second && c.t < 5 * second;
            for (std::size_t k = 0; k < 4; k++) {
                const bool hit = acts && (k == 1 || k == 2);
                ASSERT_NEAR(c.x[k], hit ? effect(Channels::seconds(c.t), k) : c.truth(k), 1e-12)
                    << fault.kind << " " << k;
            }
        }
    }
}

TEST(Faults, BabbleIsAnythingBetweenTheLimits)
{
    Channels c({{FAULT_BABBLE, 1, 0.0, 0, 0}}), other({{FAULT_BABBLE, 1, 0.0, 0, 0}}, 2);
    double sum = 0.0, square = 0.0;
    constexpr int n = 4000;
    std::set<double> seen;
    for (int i = 0; i < n; i++) {
        const double x = c.read()[0] / 1000.0;
        ASSERT_LE(std::abs(x), 1.0);
        sum += x / n;
        square += x * x / n;
        seen.insert(x);
        EXPECT_NE(x, other.read()[0] / 1000.0);
    }
    EXPECT_EQ(seen.size(), static_cast<std::size_t>(n));
    EXPECT_NEAR(sum, 0.0, 4.0 / std::sqrt(3.0 * n));
    EXPECT_NEAR(square, 1.0 / 3.0, 4.0 * std::sqrt(4.0 / 45.0 / n));
}

TEST(Faults, WithoutLimitsTheSizeSaysWhereTheyAre)
{
    for (const auto &[kind, expected] : {std::pair{FAULT_HIGH, 7.0}, {FAULT_LOW, -7.0}}) {
        const Fault fault{kind, 0, 7.0, 0, 0};
        Faults<1> faults;
        double x = 1.0;
        faults.begin(0, 1, &fault, {});
        faults.apply(0, {&x, 1});
        EXPECT_EQ(x, expected);
    }
}

TEST(Faults, ADropoutTakesItsShareOfTheUpdates)
{
    // All channels of one fault drop together, those of two faults do not.
    Channels c({{FAULT_DROPOUT, 3, 0.3, 0, 0}, {FAULT_DROPOUT, 12, 0.3, 0, 0}});
    constexpr int n = 4000;
    int dropped = 0, together = 0, silent = 0;
    for (int i = 0; i < n; i++) {
        const auto before = c.x;
        c.read();
        const bool first = c.x[0] != c.truth(0), second = c.x[2] != c.truth(2);
        EXPECT_EQ(c.x[1] != c.truth(1), first);
        if (first) {
            EXPECT_EQ(c.x[0], before[0]);
        }
        dropped += first;
        together += first && second;
        silent += !c.speaks;
    }
    EXPECT_NEAR(dropped, 0.3 * n, 4.0 * std::sqrt(0.21 * n));
    EXPECT_NEAR(together, 0.09 * n, 4.0 * std::sqrt(0.09 * 0.91 * n));
    EXPECT_EQ(silent, together);
}

TEST(Faults, ADelayIsThatOfItsSizeHoweverLongItIs)
{
    for (const double delay : {0.1, 0.3, 6.3, 6.4, 20.0, 1000.0}) {
        Channels c({{FAULT_DELAY, 0, delay, 0, 0}});
        // Beyond 63 updates it moves in steps of a 63rd, of whole updates.
        const double grain = delay > 6.35 ? delay / 63.0 + 0.1 : 0.0;
        for (int i = 0; i < 12000; i++) {
            c.read();
            const double late = Channels::seconds(c.t) - c.x[0];
            if (Channels::seconds(c.t) > delay + 0.15) {
                ASSERT_GE(late, delay - 1e-9);
                ASSERT_LE(late, delay + grain + 1e-9) << delay;
            }
        }
    }
}

TEST(Faults, ADelayThatBeginsAgainKnowsNothingOfTheOneBefore)
{
    Channels c({{FAULT_DELAY, 1, 1.0, 0, 0}});
    c.read(10 * second);
    const auto faults = std::exchange(c.planned, {});
    c.read(10 * second);
    c.planned = faults;
    c.read(10 * second);
    EXPECT_EQ(c.x[0], 30.0) << "the first of this delay, not that of 10 s";
}

TEST(Faults, AMessageAddsFaultsAndTakesThemAwayAgain)
{
    Channels c({{FAULT_BIAS, 1, 1.0, 0, 0}});
    EXPECT_NEAR(c.read()[0] - c.truth(0), 1.0, 1e-12);
    c.injected.head = {0, QUALITY_GOOD, 1};
    c.injected.n = 2;
    c.injected.list[0] = {FAULT_BIAS, 1, 2.0, 0, 0};
    c.injected.list[1] = {FAULT_DEAD, 2, 0.0, 0, 0};
    EXPECT_NEAR(c.read()[0] - c.truth(0), 3.0, 1e-12);
    EXPECT_EQ(c.x[1], 0.0);
    c.injected.n = 0;
    EXPECT_NEAR(c.read()[0] - c.truth(0), 1.0, 1e-12);
    EXPECT_EQ(c.x[1], c.truth(1));

    // From another program anything may come.
    c.injected.n = 1000;
    const std::int32_t unknown = 77;
    c.injected.list[0] = {FAULT_NONE, 0xffffffff, 1.0, 0, 0};
    std::memcpy(&c.injected.list[0].kind, &unknown, sizeof unknown);
    c.injected.list[1] = {FAULT_BIAS, 0xffffffff, NAN, INT64_MIN, -7};
    c.injected.list[2] = {FAULT_DELAY, 0xffffffff, -1.0, 0, INT64_MAX};
    c.injected.list[3] = {FAULT_DELAY, 8, 1e300, 0, 0};
    std::mt19937_64 random(1);
    constexpr std::int64_t times[] = {INT64_MIN, -1, 0, 1, second, INT64_MAX};
    constexpr double sizes[] = {0.0, -1.0, 0.15, 1e9, -1e300, HUGE_VAL, NAN};
    for (int i = 0; i < 2000; i++) {
        for (const double x : c.read()) {
            ASSERT_TRUE(std::isfinite(x));
        }
        c.injected.n = static_cast<std::uint32_t>(random() % 6);
        for (Fault &fault : c.injected.list) {
            const auto kind = static_cast<std::int32_t>(random() % 12) - 1;
            fault = {FAULT_NONE, static_cast<std::uint32_t>(random()), sizes[random() % 7], times[random() % 6],
                     times[random() % 6]};
            std::memcpy(&fault.kind, &kind, sizeof kind);
        }
    }
}

TEST(Faults, TheirBytesAreTheirState)
{
    Channels c({{FAULT_BABBLE, 1, 0.0, 0, 0}, {FAULT_DROPOUT, 2, 0.5, 0, 0}, {FAULT_DELAY, 4, 1.0, 0, 0}});
    for (int i = 0; i < 30; i++) {
        c.read();
    }
    Channels copy = c;
    std::array<std::byte, sizeof c.faults> bytes;
    std::memcpy(bytes.data(), &c.faults, bytes.size());
    std::vector<std::array<double, 4>> first, again;
    for (int i = 0; i < 30; i++) {
        first.push_back(c.read());
    }
    copy.faults.reset(sim::Random(9, "another"));
    std::memcpy(static_cast<void *>(&copy.faults), bytes.data(), bytes.size());
    for (int i = 0; i < 30; i++) {
        again.push_back(copy.read());
    }
    EXPECT_EQ(first, again);
}

TEST(Faults, PlansThatMakeNoSenseAreRefused)
{
    const auto refusal = [](Fault fault, bool limited = true) {
        const std::array<Fault, 2> faults{Fault{}, fault};
        return error_of([&] { check_faults("world.gyro", faults, 3, limited); });
    };
    const std::string at = "world.gyro.faults[1]";
    EXPECT_EQ(refusal({FAULT_DEAD, 8, 0.0, 0, 0}),
              at + ".channels: there are 3, a bit for each, so it must be below 8; found 8");
    EXPECT_EQ(refusal({FAULT_DROPOUT, 1, 1.5, 0, 0}),
              at + ".size: of a drop-out, a share of the updates, must be in [0, 1]; found 1.5");
    EXPECT_EQ(refusal({FAULT_DELAY, 1, 0.0, 0, 0}), at + ".size: of a delay, in seconds, must be in (0, 1e9]; found 0");
    EXPECT_EQ(refusal({FAULT_HIGH, 1, 0.0, 0, 0}, false),
              at + ".size: not every channel has limits, so it must be > 0, the limit; found 0");
    EXPECT_EQ(refusal({FAULT_HIGH, 1, 0.0, 0, 0}), "");
    EXPECT_EQ(refusal({FAULT_BIAS, 7, -4.0, 5, 6}), "");
}

} // namespace faults_test
