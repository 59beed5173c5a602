// SPDX-License-Identifier: Apache-2.0
#include "registers/clock.h"

#include <cstdint>

#include <gtest/gtest.h>

#include "registers/testing/board.h"

namespace clock_test {

using fledge::registers::testing::Bench;

TEST(Clock, ATickIsDueUntilItIsFinished)
{
    for (bool big : {false, true}) {
        Bench bench({}, big);
        const RegisterWindow *w = bench.window();
        Tick tick;
        EXPECT_FALSE(register_clock_due(w, &tick));
        EXPECT_TRUE(register_clock_is_done(w));
        for (std::int64_t t :
             {std::int64_t{0}, std::int64_t{-1}, INT64_MAX, INT64_MIN, std::int64_t{0x123456789ABCDEF0}}) {
            register_clock_start(w, {t, ~t});
            EXPECT_FALSE(register_clock_is_done(w));
            for (int again = 0; again < 2; again++) {
                ASSERT_TRUE(register_clock_due(w, &tick));
                EXPECT_EQ(tick.t, t);
                EXPECT_EQ(tick.dt, ~t);
            }
            register_clock_finish(w);
            EXPECT_FALSE(register_clock_due(w, &tick));
            EXPECT_TRUE(register_clock_is_done(w));
        }
        EXPECT_FALSE(register_clock_stopped(w));
        register_clock_stop(w);
        EXPECT_TRUE(register_clock_stopped(w));
    }
}

TEST(Clock, AResetIsSeenAtTheNextTick)
{
    for (bool big : {false, true}) {
        Bench bench({}, big);
        const RegisterWindow *w = bench.window();
        Tick tick;
        EXPECT_EQ(register_clock_resets(w), 0u);
        register_clock_reset(w);
        register_clock_reset(w);
        EXPECT_FALSE(register_clock_due(w, &tick)) << "a reset is no tick";
        register_clock_start(w, {7, 1});
        EXPECT_EQ(register_clock_resets(w), 2u);
        EXPECT_FALSE(register_clock_stopped(w));
    }
}

} // namespace clock_test
