// SPDX-License-Identifier: Apache-2.0
extern "C" {
#include "flight/actuation/burn_schedule.h"
}

#include <gtest/gtest.h>

#include <vector>

namespace {

constexpr std::int64_t s = 1'000'000'000;

struct Loop {
    BurnSchedule m{};
    std::vector<std::int64_t> given; // the starts of the burns, at the times below
    std::vector<std::int64_t> when;

    Loop()
    {
        m.par.n = 3;
        m.par.armed = 1;
        m.par.ahead = 2 * s;
        for (std::uint32_t k = 0; k < 3; k++) {
            m.par.start[k] = 10 + 5 * k;
            m.par.duration[k] = 0.1 * (k + 1);
            m.par.thruster[k] = 2 - k;
        }
        burn_schedule_reset(&m);
        m.in.card.head.quality = QUALITY_GOOD;
        m.in.card.number = 9;
    }
    void fly(std::int64_t from, std::int64_t until)
    {
        for (std::int64_t t = from; t < until; t += s) {
            burn_schedule_update(&m, {t, t == from ? 0 : s});
            EXPECT_EQ(m.out.burn.head.t, t);
            EXPECT_EQ(m.out.burn.head.quality, QUALITY_GOOD);
            EXPECT_EQ(m.out.burn.head.sequence, 1 + static_cast<std::uint32_t>((t - from) / s));
            m.in.card.armed = m.out.burn.armed;
            if (m.out.burn.number != m.in.card.number && m.out.burn.number != 0) {
                m.in.card.number = m.out.burn.number;
                given.push_back(m.out.burn.start);
                when.push_back(t);
                EXPECT_EQ(m.out.burn.duration, static_cast<std::int64_t>(3 - m.out.burn.thruster) * s / 10);
            }
        }
    }
};

TEST(BurnSchedule, each_burn_is_given_before_its_start)
{
    Loop loop;
    loop.fly(0, 60 * s);
    EXPECT_EQ(loop.given, (std::vector<std::int64_t>{10 * s, 15 * s, 20 * s}));
    EXPECT_EQ(loop.when, (std::vector<std::int64_t>{8 * s, 13 * s, 18 * s}));
}

TEST(BurnSchedule, after_a_start_within_the_run_old_burns_are_not_given)
{
    Loop loop;
    loop.fly(12 * s, 60 * s);
    EXPECT_EQ(loop.given, (std::vector<std::int64_t>{15 * s, 20 * s}));
}

TEST(BurnSchedule, disarmed_it_gives_none)
{
    Loop loop;
    loop.m.par.armed = 0;
    loop.fly(0, 60 * s);
    EXPECT_TRUE(loop.given.empty());
    EXPECT_EQ(loop.m.out.burn.armed, 0u);
}

} // namespace
