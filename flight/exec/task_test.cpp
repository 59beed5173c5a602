// SPDX-License-Identifier: Apache-2.0
// Grids, tasks and ages against searches through every nanosecond of a short time.
#include "flight/exec/message.h"
#include "flight/exec/task.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

namespace task_test {

/// The first time of the grid at or after t, by trying them all.
int64_t search(ExecRate rate, int64_t t)
{
    int64_t time = rate.offset;
    while (time < t) {
        time += rate.period;
    }
    return time;
}

TEST(Grid, NextTimeIsThatOfASearch)
{
    for (int64_t period = 1; period <= 7; period++) {
        for (int64_t offset = 0; offset <= 9; offset++) {
            for (int64_t t = -3; t <= 40; t++) {
                ASSERT_EQ(exec_on_grid({period, offset}, t), search({period, offset}, t)) << period << offset << t;
            }
        }
    }
}

TEST(Grid, ReachesOverYears)
{
    const ExecRate rate{100000000, 30000000};
    const int64_t n = 10ll * 365 * 86400 * 10;
    EXPECT_EQ(exec_on_grid(rate, n * rate.period + rate.offset), n * rate.period + rate.offset);
    EXPECT_EQ(exec_on_grid(rate, n * rate.period + rate.offset + 1), (n + 1) * rate.period + rate.offset);
}

TEST(Grid, StaysWithinTheNumbersAtTheEndsOfTime)
{
    constexpr int64_t ends[] = {INT64_MIN, INT64_MIN + 1, -1, 0, 1, INT64_MAX - 1, INT64_MAX};
    for (int64_t period : {int64_t{1}, int64_t{500'000'000}, INT64_MAX}) {
        for (int64_t offset : {int64_t{0}, int64_t{7}, INT64_MAX}) {
            for (int64_t t : ends) {
                const int64_t next = exec_on_grid({period, offset}, t);
                EXPECT_GE(next, t);
                EXPECT_GE(next, offset);
                EXPECT_TRUE(next == INT64_MAX || (next - offset) % period == 0);
            }
            const ExecRate rate{period, offset};
            ExecTask task = exec_start(rate, 1, INT64_MAX - 1);
            exec_begin(&task, rate, INT64_MAX);
            EXPECT_EQ(task.next, INT64_MAX);
            EXPECT_EQ(exec_next(&task, rate, 1, INT64_MAX), INT64_MAX);
        }
    }
    for (int64_t t : ends) {
        for (int64_t sent : ends) {
            Head head{sent, QUALITY_GOOD, 1};
            exec_age(&head, t, 1000);
            EXPECT_EQ(head.quality == QUALITY_STALE, static_cast<__int128>(t) - sent > 1000);
            const __int128 exact = static_cast<__int128>(t) - sent;
            const __int128 held = std::clamp<__int128>(exact, INT64_MIN, INT64_MAX);
            EXPECT_TRUE(tick_since(t, sent) == held);
        }
    }
}

TEST(Task, RunsOnItsGridAndAfterLateCallsAtTheNextTimeOfIt)
{
    for (int64_t period = 1; period <= 6; period++) {
        for (int64_t offset = 0; offset <= 4; offset++) {
            for (int64_t stride = 1; stride <= 9; stride++) { // the host looks that often
                const ExecRate rate{period, offset};
                ExecTask task = exec_start(rate, 1, 0);
                int64_t last = -1, due = offset;
                for (int64_t t = 0; t < 60; t += stride) {
                    ASSERT_EQ(exec_due(&task, t), t >= due);
                    if (t >= due) {
                        const Tick tick = exec_begin(&task, rate, t);
                        ASSERT_EQ(tick.t, t);
                        ASSERT_EQ(tick.dt, last < 0 ? 0 : t - last);
                        last = t;
                        due = search(rate, t + 1);
                    }
                    ASSERT_EQ(exec_next(&task, rate, 0, t), due);
                }
            }
        }
    }
}

TEST(Task, RunsOnlyInItsModesAndBeginsAnewWithEachOfThem)
{
    const ExecRate rate{10, 3};
    ExecTask task = exec_start(rate, 0, 0);
    EXPECT_FALSE(exec_due(&task, 1000));
    EXPECT_EQ(exec_next(&task, rate, 0, 20), INT64_MAX);
    EXPECT_EQ(exec_next(&task, rate, 1, 22), 23) << "the mode that was asked for runs it";
    EXPECT_EQ(exec_next(&task, rate, 1, 23), 33) << "after now, not at it";

    EXPECT_EQ(exec_switch(&task, 1, rate, 25), 1) << "its modules are reset";
    EXPECT_FALSE(exec_due(&task, 32));
    EXPECT_TRUE(exec_due(&task, 33));
    EXPECT_EQ(exec_begin(&task, rate, 33).dt, 0);
    EXPECT_EQ(exec_begin(&task, rate, 43).dt, 10);
    EXPECT_EQ(exec_switch(&task, 1, rate, 50), 0) << "it was active";
    EXPECT_EQ(task.last, 43);
    EXPECT_EQ(exec_switch(&task, 0, rate, 60), 0);
    EXPECT_FALSE(exec_due(&task, 1000));
    EXPECT_EQ(exec_switch(&task, 1, rate, 73), 1);
    EXPECT_EQ(task.next, 73) << "a time of the grid is the first one";
    EXPECT_EQ(exec_begin(&task, rate, 73).dt, 0);
}

TEST(Task, TheSoonerOfTwoTimes)
{
    EXPECT_EQ(exec_sooner(3, 5), 3);
    EXPECT_EQ(exec_sooner(5, 3), 3);
    EXPECT_EQ(exec_sooner(INT64_MAX, 3), 3);
}

TEST(Message, IsStaleWhenOlderThanItsWireAllows)
{
    for (const Quality quality : {QUALITY_NONE, QUALITY_STALE, QUALITY_DEGRADED, QUALITY_GOOD}) {
        for (int64_t t = 95; t <= 115; t++) {
            Head head{100, quality, 7};
            exec_age(&head, t, 10);
            const bool old = t > 110 && quality > QUALITY_STALE;
            ASSERT_EQ(head.quality, old ? QUALITY_STALE : quality) << t;
            ASSERT_EQ(head.t, 100);
            ASSERT_EQ(head.sequence, 7u);
        }
    }
}

} // namespace task_test
