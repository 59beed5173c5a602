// SPDX-License-Identifier: Apache-2.0
extern "C" {
#include "flight/actuation/burn_schedule.h"
}

#include <gtest/gtest.h>

#include <vector>

namespace burn_schedule_test {

constexpr std::int64_t s = 1'000'000'000;

struct Loop {
    BurnSchedule m{};
    std::vector<std::int64_t> given; // the starts of the burns, at the times below
    std::vector<std::int64_t> when;

    Loop()
    {
        m.par.n = 4;
        m.par.ahead = 2 * s;
        for (std::uint32_t k = 0; k < 4; k++) {
            m.par.start[k] = 10 + 5 * k;
            m.par.duration[k] = 0.1 * (k + 1);
            m.par.thruster[k] = k < 3 ? 2 - k : 0;
        }
        m.par.start[3] = 22; // behind the third one, of the same thruster
        m.par.duration[2] = 1.5;
        burn_schedule_reset(&m);
    }
    void fly(std::int64_t from, std::int64_t until)
    {
        const double durations[] = {1.5, 0.2, 0.1};
        std::int64_t last = 0;
        for (std::int64_t t = from; t < until; t += s) {
            const ThrusterTimes before = m.out.times;
            burn_schedule_update(&m, {t, t == from ? 0 : s});
            EXPECT_EQ(m.out.times.head.t, t);
            EXPECT_EQ(m.out.times.head.quality, QUALITY_GOOD);
            for (std::size_t i = 0; i < THRUSTERS_MAX; i++) {
                if (m.out.times.burns[i] == before.burns[i]) {
                    EXPECT_EQ(m.out.times.off[i], before.off[i]);
                    continue;
                }
                EXPECT_EQ(m.out.times.burns[i], before.burns[i] + 1);
                given.push_back(m.out.times.on[i]);
                when.push_back(t);
                const double duration = given.back() == 22 * s ? 0.4 : durations[i];
                EXPECT_EQ(m.out.times.off[i] - m.out.times.on[i], static_cast<std::int64_t>(duration * 1e9 + 0.5));
                EXPECT_GE(m.out.times.on[i], last);
                last = m.out.times.on[i];
            }
        }
    }
};

TEST(BurnSchedule, each_burn_is_given_before_its_start_and_behind_the_last_one_of_its_thruster)
{
    Loop loop;
    loop.fly(0, 60 * s);
    EXPECT_EQ(loop.given, (std::vector<std::int64_t>{10 * s, 15 * s, 20 * s, 22 * s}));
    EXPECT_EQ(loop.when, (std::vector<std::int64_t>{8 * s, 13 * s, 18 * s, 22 * s}));
}

TEST(BurnSchedule, after_a_start_within_the_run_old_burns_are_not_given)
{
    Loop loop;
    loop.fly(12 * s, 60 * s);
    EXPECT_EQ(loop.given, (std::vector<std::int64_t>{15 * s, 20 * s, 22 * s}));
}

TEST(BurnSchedule, a_burn_that_was_over_before_an_update_is_left_out)
{
    Loop loop;
    burn_schedule_update(&loop.m, {0, 0});
    burn_schedule_update(&loop.m, {12 * s, s}); // the first one was from 10 s to 10.1 s
    EXPECT_EQ(loop.m.out.times.burns[2], 0u);
    burn_schedule_update(&loop.m, {15 * s, s}); // the second one begins
    EXPECT_EQ(loop.m.out.times.burns[1], 1u);
}

} // namespace burn_schedule_test
