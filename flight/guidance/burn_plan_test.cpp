// SPDX-License-Identifier: Apache-2.0
#include "flight/testing/eigen.h"

extern "C" {
#include "flight/guidance/burn_plan.h"
}

#include <gtest/gtest.h>

namespace flight::testing {
namespace burn_plan_test {

BurnPlan three()
{
    BurnPlan m{};
    m.par.n = 3;
    for (int i = 0; i < 3; i++) {
        m.par.start[i] = 10.0 * (i + 1);
        m.par.dv_N[i] = vec3(i + 1, 0, 0);
        m.par.rate_N[i] = vec3(0, 0, 1e-3 * i);
    }
    return m;
}

/// The burn that is commanded after the execution has reported this phase of the present one.
int after(BurnPlan &m, BurnPhase phase)
{
    m.in.state.head = good();
    m.in.state.start = m.out.command.start;
    m.in.state.phase = phase;
    burn_plan_update(&m, {0, 0});
    EXPECT_EQ(m.out.command.start, std::llround(m.out.command.dv_N.v[0] * 10e9));
    return static_cast<int>(m.out.command.dv_N.v[0]);
}

TEST(BurnPlan, gives_one_burn_after_the_other)
{
    BurnPlan m = three();
    burn_plan_update(&m, {0, 0});
    EXPECT_EQ(m.out.command.head.quality, QUALITY_GOOD);
    EXPECT_EQ(after(m, BURN_WAITS), 1);
    EXPECT_EQ(after(m, BURN_RUNS), 1);
    EXPECT_EQ(after(m, BURN_COMPLETE), 2);
    EXPECT_EQ(m.out.command.rate_N.v[2], 1e-3);
    burn_plan_update(&m, {0, 0}); // the state is still that of the first
    EXPECT_EQ(m.out.command.dv_N.v[0], 2.0);
    EXPECT_EQ(after(m, BURN_COMPLETE), 3);
    EXPECT_EQ(after(m, BURN_COMPLETE), 3) << "the last one stays";
}

TEST(BurnPlan, an_aborted_burn_ends_the_plan_until_a_reset)
{
    BurnPlan m = three();
    burn_plan_update(&m, {0, 0});
    EXPECT_EQ(after(m, BURN_ABORTED), 1);
    EXPECT_EQ(after(m, BURN_COMPLETE), 1);
    burn_plan_reset(&m);
    burn_plan_update(&m, {0, 0});
    EXPECT_EQ(after(m, BURN_COMPLETE), 2);
}

TEST(BurnPlan, goes_on_with_the_burn_that_has_begun_before_the_reset)
{
    for (const BurnPhase phase : {BURN_CUT, BURN_COMPLETE}) {
        BurnPlan m = three();
        m.in.kept = {{0, QUALITY_DEGRADED, 1}, phase, BURN_NOT_ABORTED, 0, 0, 20'000'000'000, 0, 0};
        burn_plan_update(&m, {0, 0});
        EXPECT_EQ(m.out.command.head.quality, QUALITY_NONE) << "until it is known";
        m.in.kept.head = good();
        burn_plan_update(&m, {0, 0});
        EXPECT_EQ(m.out.command.dv_N.v[0], 2.0);
        EXPECT_EQ(after(m, BURN_COMPLETE), 3);
    }
    BurnPlan m = three(); // one that is none of the list
    m.in.kept = {good(), BURN_CUT, BURN_NOT_ABORTED, 0, 0, 20'000'000'001, 0, 0};
    burn_plan_update(&m, {0, 0});
    EXPECT_EQ(m.out.command.dv_N.v[0], 1.0);
}

TEST(BurnPlan, holds_its_command_against_bad_numbers)
{
    BurnPlan m = three();
    burn_plan_update(&m, {0, 0});
    const DeltaVCommand last = m.out.command;
    for (double *bad : {&m.par.start[0], &m.par.dv_N[0].v[1], &m.par.rate_N[0].v[2]}) {
        const double was = *bad;
        *bad = NAN;
        burn_plan_update(&m, {1, 1});
        EXPECT_TRUE(same_content(m.out.command, last));
        EXPECT_EQ(m.out.command.head.quality, QUALITY_DEGRADED);
        *bad = was;
    }
}

TEST(BurnPlan, a_start_beyond_all_times_is_no_command)
{
    BurnPlan m = three();
    m.par.start[0] = 1e9 + 1; // 31 years
    burn_plan_update(&m, {0, 0});
    EXPECT_FALSE(head_written(m.out.command.head));
}

TEST(BurnPlan, a_burn_that_the_plan_has_no_more_is_not_commanded)
{
    BurnPlan m = three();
    burn_plan_update(&m, {0, 0});
    EXPECT_EQ(after(m, BURN_COMPLETE), 2);
    const DeltaVCommand last = m.out.command;
    m.par.n = 1; // by a command; what the rows beyond hold is not checked
    m.par.dv_N[1] = vec3(9, 9, 9);
    burn_plan_update(&m, {1, 1});
    EXPECT_TRUE(same_content(m.out.command, last));
    EXPECT_EQ(m.out.command.head.quality, QUALITY_DEGRADED);
}

} // namespace burn_plan_test
} // namespace flight::testing
