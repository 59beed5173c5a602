// SPDX-License-Identifier: Apache-2.0
#include "flight/exec/event.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace event_test {

/// When an event fires, by its definition: looks back at each time whether the condition has held long enough without a
/// gap, and often enough, since the event was last armed.
std::vector<int> expected(const std::vector<int> &holds, const std::vector<int> &again, int hold, int count, bool once)
{
    std::vector<int> fired;
    bool armed = true;
    int armed_at = -1;
    for (int t = 0; t < static_cast<int>(holds.size()); t++) {
        if (!armed && !once && again[static_cast<std::size_t>(t)]) {
            armed = true;
            armed_at = t;
        }
        int since = t;
        while (since > armed_at && holds[static_cast<std::size_t>(since)]) {
            since--;
        }
        const int instants = t - since;
        if (armed && instants >= 1 && instants >= count && instants - 1 >= hold) {
            fired.push_back(t);
            armed = false;
        }
    }
    return fired;
}

TEST(Event, FiresAsItsDefinitionSays)
{
    std::mt19937 random(1);
    for (int run = 0; run < 2000; run++) {
        std::vector<int> holds(40), inverse(40), other(40);
        for (std::size_t t = 0; t < holds.size(); t++) {
            holds[t] = random() % 4 != 0;
            inverse[t] = !holds[t];
            other[t] = random() % 5 == 0;
        }
        for (const std::vector<int> &again : {inverse, other}) {
            for (const int hold : {0, 1, 3}) {
                for (const int count : {1, 2, 5}) {
                    for (const bool once : {false, true}) {
                        ExecEvent event = exec_armed();
                        std::vector<int> fired;
                        for (int t = 0; t < 40; t++) {
                            const auto i = static_cast<std::size_t>(t);
                            if (exec_fires(&event, holds[i], again[i], hold, count, once, t)) {
                                fired.push_back(t);
                                ASSERT_EQ(event.fired_at, t);
                            }
                        }
                        ASSERT_EQ(fired, expected(holds, again, hold, count, once));
                    }
                }
            }
        }
    }
}

TEST(Event, FiresAgainWhenItIsArmedWhileItsConditionHolds)
{
    ExecEvent event = exec_armed();
    EXPECT_TRUE(exec_fires(&event, 1, 0, 0, 1, 0, 5));
    EXPECT_FALSE(exec_fires(&event, 1, 0, 0, 1, 0, 6));
    event.armed = 1;
    EXPECT_TRUE(exec_fires(&event, 1, 0, 0, 1, 0, 6));
}

TEST(Event, CountsInstantsUpToTheMostThatItCan)
{
    ExecEvent event = exec_armed();
    event.held = std::numeric_limits<std::int32_t>::max() - 1;
    for (const std::int64_t t : {0, 1, 2}) {
        EXPECT_EQ(exec_fires(&event, 1, 0, 2, std::numeric_limits<std::int32_t>::max(), 1, t), t == 2);
        EXPECT_EQ(event.held, std::numeric_limits<std::int32_t>::max());
    }
}

TEST(Event, ThatIsDisarmedStaysSoAndCountsFromItsArmingOn)
{
    ExecEvent event = exec_disarmed();
    for (int t = 0; t < 10; t++) {
        EXPECT_FALSE(exec_fires(&event, t != 5, t == 5, 0, 1, 0, t)); // also where the condition does not hold
    }
    event.armed = 1;
    EXPECT_FALSE(exec_fires(&event, 1, 0, 2, 3, 0, 10));
    EXPECT_FALSE(exec_fires(&event, 1, 0, 2, 3, 0, 11));
    EXPECT_TRUE(exec_fires(&event, 1, 0, 2, 3, 0, 12));
    event.armed = 0; // while it waits to be armed again
    EXPECT_FALSE(exec_fires(&event, 0, 1, 0, 1, 0, 13));
    EXPECT_FALSE(exec_fires(&event, 1, 0, 0, 1, 0, 14));
}

/// The sign of a - b, in more bits than both have.
template <class A, class B> int sign(A a, B b)
{
    const auto x = static_cast<long double>(a), y = static_cast<long double>(b);
    return x < y ? -1 : x > y;
}

int sign(double x)
{
    return x < 0.0 ? -1 : x > 0.0;
}

TEST(Number, ComparesAllWholeAndFloatingNumbersExactly)
{
    std::mt19937_64 random(2);
    std::vector<std::int64_t> whole;
    std::vector<std::uint64_t> natural;
    std::vector<double> real{0.0, -0.0, 0.5, -0.5, 1e-300, -1e-300, 1e300, -1e300, HUGE_VAL, -HUGE_VAL};
    for (int bits = 0; bits < 64; bits++) {
        for (int around = -2; around <= 2; around++) {
            natural.push_back((std::uint64_t{1} << bits) + static_cast<std::uint64_t>(around));
            whole.push_back(static_cast<std::int64_t>(natural.back()));
            whole.push_back(-static_cast<std::int64_t>(natural.back() / 2));
            real.push_back(std::ldexp(1.0, bits) + around);
            real.push_back(-std::nextafter(std::ldexp(1.0, bits), around));
        }
        natural.push_back(random());
        whole.push_back(static_cast<std::int64_t>(random()));
        real.push_back(static_cast<double>(whole.back()));
    }
    for (const std::int64_t a : whole) {
        for (const std::int64_t b : whole) {
            ASSERT_EQ(sign(exec_difference(exec_signed(a), exec_signed(b))), sign(a, b)) << a << " " << b;
        }
        for (const std::uint64_t b : natural) {
            ASSERT_EQ(sign(exec_difference(exec_signed(a), exec_unsigned(b))), sign(a, b)) << a << " " << b;
        }
        for (const double b : real) {
            ASSERT_EQ(sign(exec_difference(exec_signed(a), exec_real(b))), sign(a, b)) << a << " " << b;
            ASSERT_EQ(sign(exec_difference(exec_real(b), exec_signed(a))), sign(b, a)) << a << " " << b;
        }
    }
    for (const std::uint64_t a : natural) {
        for (const std::uint64_t b : natural) {
            ASSERT_EQ(sign(exec_difference(exec_unsigned(a), exec_unsigned(b))), sign(a, b)) << a << " " << b;
        }
        for (const double b : real) {
            ASSERT_EQ(sign(exec_difference(exec_unsigned(a), exec_real(b))), sign(a, b)) << a << " " << b;
        }
    }
    EXPECT_TRUE(std::isnan(exec_difference(exec_signed(1), exec_real(std::nan("")))));
}

TEST(Measure, NormIsTheRootOfTheSumOfSquares)
{
    const double x[] = {2.0, -3.0, 6.0, 0.0, -24.0, 0.0};
    EXPECT_EQ(exec_norm(x, 3), 7.0);
    EXPECT_EQ(exec_norm(x, 5), 25.0);
    EXPECT_EQ(exec_norm(x, 0), 0.0);
}

TEST(Measure, LargestMagnitudeLeavesOutWhatIsNoNumber)
{
    const double nan = std::numeric_limits<double>::quiet_NaN();
    const double x[] = {1.0, nan, -4.0, 3.0};
    EXPECT_EQ(exec_max_abs(x, 4), 4.0);
    EXPECT_EQ(exec_max_abs(x, 2), 1.0);
    EXPECT_EQ(exec_max_abs(x + 1, 1), 0.0);
    EXPECT_FALSE(std::signbit(exec_max_abs(x, 0)));
}

} // namespace event_test
