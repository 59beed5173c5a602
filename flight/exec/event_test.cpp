// SPDX-License-Identifier: Apache-2.0
#include "flight/exec/event.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace {

/// When an event fires, by its definition: looks back at each time whether the condition has held long
/// enough without a gap, and whether it fired since the last gap.
std::vector<int> expected(const std::vector<int> &holds, int hold, bool once)
{
    std::vector<int> fired;
    for (int t = 0; t < static_cast<int>(holds.size()); t++) {
        int since = t;
        while (since >= 0 && holds[static_cast<std::size_t>(since)]) {
            since--;
        }
        const bool long_enough = holds[static_cast<std::size_t>(t)] && t - (since + 1) >= hold;
        const bool spent = !fired.empty() && (once || fired.back() > since);
        if (long_enough && !spent) {
            fired.push_back(t);
        }
    }
    return fired;
}

TEST(Event, FiresAsItsDefinitionSays)
{
    std::mt19937 random(1);
    for (int run = 0; run < 2000; run++) {
        std::vector<int> holds(30);
        for (int &one : holds) {
            one = random() % 4 != 0;
        }
        for (const int hold : {0, 1, 3}) {
            for (const bool once : {false, true}) {
                ExecEvent event = exec_armed();
                std::vector<int> fired;
                for (int t = 0; t < 30; t++) {
                    if (exec_fires(&event, holds[static_cast<std::size_t>(t)], hold, once, t)) {
                        fired.push_back(t);
                        ASSERT_EQ(event.fired_at, t);
                    }
                }
                ASSERT_EQ(fired, expected(holds, hold, once));
            }
        }
    }
}

TEST(Event, FiresAgainWhenItIsArmedWhileItsConditionHolds)
{
    ExecEvent event = exec_armed();
    EXPECT_TRUE(exec_fires(&event, 1, 0, 0, 5));
    EXPECT_FALSE(exec_fires(&event, 1, 0, 0, 6));
    event.armed = 1;
    EXPECT_TRUE(exec_fires(&event, 1, 0, 0, 6));
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

} // namespace
