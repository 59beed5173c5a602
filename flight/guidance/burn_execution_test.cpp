// SPDX-License-Identifier: Apache-2.0
// Burns on a craft that gets lighter: the cut-off, and what aborts.
#include "flight/testing/eigen.h"

extern "C" {
#include "flight/guidance/burn_execution.h"
#include "flight/guidance/delta_v_accumulation.h"
}

#include <gtest/gtest.h>

#include <functional>

namespace flight::testing {
namespace burn_execution_test {

constexpr std::int64_t ms = 1'000'000, period = 100 * ms;

/// A craft whose engine pushes along N's third axis.
struct Craft {
    BurnExecution m{};
    DeltaVAccumulation sum{};
    double mass = 100, flow = 0.5, thrust = 200, dv = 0, bias = 0;
    std::int64_t t = 0;
    bool accelerometer = true;

    Craft()
    {
        m.par.engines_used = 0b100;
        m.par.longest = 1000;
        m.in.command = {good(), 1000 * ms, vec3(0, 0, 20), {}};
        sum.in.attitude.head = good();
    }

    bool open(std::int64_t at) const { return m.out.engines.on[2] <= at && at < m.out.engines.off[2]; }

    /// One period of flight, then the world in steps of a millisecond.
    void step()
    {
        const Tick tick{t, t ? period : 0};
        if (accelerometer) {
            sum.in.force = {good(t), vec3(0, 0, bias + (m.out.state.phase == BURN_RUNS && open(t) ? thrust / mass : 0)),
                            vec3(0, 0, dv)};
        } else {
            sum.in.force.head = {};
        }
        delta_v_accumulation_update(&sum, tick);
        m.in.sum = sum.out.sum;
        burn_execution_update(&m, tick);
        for (std::int64_t end = t + period; t < end; t += ms) {
            // Within this millisecond it is open for a part.
            const double part = static_cast<double>(std::clamp<std::int64_t>(m.out.engines.off[2] - t, 0, ms)) / 1e9;
            if (m.out.engines.on[2] <= t && m.out.engines.burns[2] > 0) {
                const double after = mass - flow * part;
                dv += thrust / flow * std::log(mass / after);
                mass = after;
            }
        }
    }

    const BurnState &fly(
        double seconds, const std::function<void(double)> &each = [](double) {})
    {
        for (double now = 0; now < seconds; now += 0.1) {
            each(now);
            step();
        }
        return m.out.state;
    }
};

TEST(BurnExecution, cuts_off_at_the_commanded_change_within_a_step)
{
    for (const double wanted : {0.3, 5.0, 20.0, 60.037}) {
        Craft craft;
        craft.m.in.command.dv_N.v[2] = wanted;
        const BurnState &state = craft.fly(60);
        EXPECT_EQ(state.phase, BURN_COMPLETE);
        EXPECT_NEAR(craft.dv, wanted, 1e-3);
        EXPECT_NEAR(state.gained, wanted, 0.1 * craft.thrust / craft.mass) << "at the last update before";
        EXPECT_EQ(state.begun, 1000 * ms);
        // Tsiolkovsky: how long the engine needs for it.
        const double burnt = 100 / craft.flow * (1 - std::exp(-craft.dv * craft.flow / craft.thrust));
        EXPECT_NEAR(static_cast<double>(state.ended - state.begun) / 1e9, burnt, 1e-3);
        EXPECT_EQ(craft.m.out.engines.burns[2], 1u);
        EXPECT_EQ(craft.m.out.engines.burns[0], 0u);
    }
}

TEST(BurnExecution, an_update_before_the_end_that_was_foreseen_does_not_end_it)
{
    Craft craft;
    while (craft.m.out.state.ended == 0 && craft.t < 60'000 * ms) {
        craft.step();
    }
    const std::int64_t last = craft.t - period, end = craft.m.out.state.ended;
    ASSERT_GT(end, last + 2);
    BurnExecution m = craft.m;
    burn_execution_update(&m, {last + 1, 1});
    EXPECT_EQ(m.out.state.phase, BURN_RUNS);
    EXPECT_EQ(m.out.engines.off[2], last + 3) << "two periods, since the end is not within this one";
    burn_execution_update(&m, {end, end - last - 1});
    EXPECT_NEAR(static_cast<double>(m.out.state.ended - end), 0, 2);
}

TEST(BurnExecution, a_direction_that_turns_counts_the_path)
{
    Craft craft;
    craft.m.in.command.rate_N = vec3(1e-3, 0, 0);
    craft.sum.in.attitude.sigma_BN = vec3(0, 0.2, 0); // the thrust is elsewhere by now
    EXPECT_EQ(craft.fly(40).phase, BURN_COMPLETE);
    EXPECT_NEAR(craft.dv, 20, 1e-3);
}

TEST(BurnExecution, waits_for_the_attitude_and_aborts_off_it)
{
    const auto error = [](Craft &craft, double angle) {
        craft.m.in.error = {good(), vec3(0, std::tan(angle / 4), 0), {}, {}, {}};
    };
    Craft craft;
    craft.m.par.error_max = 0.1;
    craft.m.par.wait = 5;
    const BurnState &state = craft.fly(20, [&](double t) { error(craft, t < 3.95 ? 0.2 : t < 8.95 ? 0.05 : 0.3); });
    EXPECT_NEAR(static_cast<double>(state.begun) / 1e9, 4.0, 0.051);
    EXPECT_EQ(state.phase, BURN_ABORTED);
    EXPECT_EQ(state.abort, BURN_OFF_POINT);
    EXPECT_NEAR(static_cast<double>(state.ended) / 1e9, 9.0, 0.051);
    EXPECT_FALSE(craft.open(craft.t));

    Craft settles; // while it waits, less is allowed
    settles.m.par.error_max = 0.1;
    settles.m.par.error_open = 0.01;
    settles.m.par.wait = 5;
    settles.fly(40, [&](double t) { error(settles, t < 3.95 ? 0.05 : t < 4.95 ? 0.005 : 0.08); });
    EXPECT_NEAR(static_cast<double>(settles.m.out.state.begun) / 1e9, 4.0, 0.051);
    EXPECT_EQ(settles.m.out.state.phase, BURN_COMPLETE);

    Craft late;
    late.m.par.error_max = 0.1;
    late.m.par.wait = 5;
    EXPECT_EQ(late.fly(20, [&](double) { error(late, 0.2); }).abort, BURN_OFF_POINT);
    EXPECT_EQ(late.dv, 0.0);
    EXPECT_EQ(late.m.out.engines.burns[2], 0u);

    Craft never; // no error is known
    never.m.par.error_max = 0.1;
    EXPECT_EQ(never.fly(20).abort, BURN_OFF_POINT);
    EXPECT_EQ(never.dv, 0.0);

    Craft lost; // the error ends in the burn
    lost.m.par.error_max = 0.1;
    lost.fly(20, [&](double t) {
        error(lost, 0.01);
        lost.m.in.error.head = t < 5 ? good() : Head{5000 * ms, QUALITY_DEGRADED, 7};
    });
    EXPECT_EQ(lost.m.out.state.abort, BURN_OFF_POINT);
}

TEST(BurnExecution, aborts_blind_without_thrust_and_after_the_longest_time)
{
    Craft blind;
    blind.m.par.hold = 1;
    blind.fly(20, [&](double t) { blind.accelerometer = t < 4; });
    EXPECT_EQ(blind.m.out.state.abort, BURN_BLIND);
    EXPECT_NEAR(static_cast<double>(blind.m.out.state.ended) / 1e9, 5.0, 0.21);
    EXPECT_LT(blind.dv, 10.0);

    Craft gap; // a shorter one is bridged by the last acceleration
    gap.m.par.hold = 3;
    gap.fly(40, [&](double t) { gap.accelerometer = t < 4 || t > 6; });
    EXPECT_EQ(gap.m.out.state.phase, BURN_COMPLETE);
    EXPECT_NEAR(gap.dv, 20, 0.2);

    Craft dead;
    dead.thrust = 1e-9;
    dead.m.par.a_min = 0.1;
    dead.m.par.settle = 2;
    dead.fly(20);
    EXPECT_EQ(dead.m.out.state.abort, BURN_NO_THRUST);
    EXPECT_NEAR(static_cast<double>(dead.m.out.state.ended) / 1e9, 3.0, 0.21);

    Craft unchecked; // without a_min, a reading below 0 before the first thrust is none either
    unchecked.bias = -1e-9;
    unchecked.fly(40);
    EXPECT_EQ(unchecked.m.out.state.phase, BURN_COMPLETE);

    Craft weak;
    weak.thrust = 20;
    weak.m.par.longest = 10;
    weak.fly(30);
    EXPECT_EQ(weak.m.out.state.abort, BURN_TOO_LONG);
    EXPECT_NEAR(static_cast<double>(weak.m.out.state.ended - weak.m.out.state.begun) / 1e9, 10.0, 1e-9);
    EXPECT_FALSE(weak.open(weak.t));
}

TEST(BurnExecution, goes_on_without_its_command_and_flies_the_next_one)
{
    Craft craft;
    craft.fly(5);
    const DeltaVCommand first = craft.m.in.command;
    craft.m.in.command.head = {};
    EXPECT_EQ(craft.fly(30).phase, BURN_COMPLETE);
    EXPECT_NEAR(craft.dv, 20, 0.12);
    craft.m.in.command = first; // the same again is none
    craft.fly(5);
    EXPECT_NEAR(craft.dv, 20, 0.12);
    craft.m.in.command.start = craft.t + 1000 * ms;
    craft.m.in.command.dv_N.v[2] = 4;
    EXPECT_EQ(craft.fly(20).phase, BURN_COMPLETE);
    EXPECT_NEAR(craft.dv, 24, 0.3);
    EXPECT_EQ(craft.m.out.engines.burns[2], 2u);
}

TEST(BurnExecution, a_reset_does_not_repeat_a_burn)
{
    for (const double wait : {0.0, 3.0}) {
        Craft craft;
        craft.m.par.wait = wait;
        craft.m.in.command.start += 30 * ms; // between two updates
        EXPECT_EQ(craft.fly(30).phase, BURN_COMPLETE);
        burn_execution_reset(&craft.m);
        EXPECT_EQ(craft.fly(30).abort, BURN_LATE);
        EXPECT_NEAR(craft.dv, 20, 1e-3);
        EXPECT_EQ(craft.m.out.engines.burns[2], 0u) << "counted since the reset";
    }
}

TEST(BurnExecution, what_was_cut_off_goes_on_to_the_whole_change)
{
    for (const double turns : {0.0, 1e-3}) {
        Craft craft;
        craft.m.in.command.rate_N = vec3(turns, 0, 0);
        craft.m.in.kept.head = good();
        craft.fly(5);
        ASSERT_EQ(craft.m.out.state.phase, BURN_RUNS);
        craft.m.in.kept = craft.m.out.state;
        craft.m.in.kept.phase = BURN_CUT;
        const double gained = craft.m.out.state.gained, before = craft.dv;
        burn_execution_reset(&craft.m);
        delta_v_accumulation_reset(&craft.sum);
        craft.m.in.kept.head.quality = QUALITY_DEGRADED;
        EXPECT_EQ(craft.fly(60).phase, BURN_NONE) << "until it is known";
        craft.m.in.kept.head = good();
        const BurnState &state = craft.fly(40);
        EXPECT_EQ(state.phase, BURN_COMPLETE);
        EXPECT_EQ(state.begun, 1000 * ms);
        EXPECT_NEAR(craft.dv - before, 20 - gained, 1e-2);
        EXPECT_NEAR(state.gained, 20, 0.3);
        EXPECT_EQ(craft.m.out.engines.burns[2], 1u);

        craft.m.in.kept = state; // and not again after another reset
        burn_execution_reset(&craft.m);
        const double all = craft.dv;
        EXPECT_EQ(craft.fly(10).phase, BURN_COMPLETE);
        EXPECT_EQ(craft.dv, all);
    }
}

TEST(BurnExecution, what_was_cut_off_is_not_resumed_too_late_or_as_another_burn)
{
    Craft craft;
    craft.m.in.kept = {good(), BURN_CUT, BURN_NOT_ABORTED, 12, 0, 1000 * ms, 1000 * ms, 0};
    craft.m.par.longest = 30;
    craft.t = 31'100 * ms;
    EXPECT_EQ(craft.fly(10).abort, BURN_LATE);
    EXPECT_EQ(craft.m.out.state.gained, 12.0);
    EXPECT_EQ(craft.dv, 0.0);

    Craft ended;
    ended.m.in.kept = {good(), BURN_ABORTED, BURN_LEFT, 12, 0, 1000 * ms, 1000 * ms, 0};
    EXPECT_EQ(ended.fly(10).abort, BURN_LEFT);
    EXPECT_EQ(ended.dv, 0.0);

    Craft other;
    other.m.in.kept = {good(), BURN_CUT, BURN_NOT_ABORTED, 12, 0, 1001 * ms, 1001 * ms, 0};
    EXPECT_EQ(other.fly(40).phase, BURN_COMPLETE);
    EXPECT_NEAR(other.dv, 20, 1e-2);
}

TEST(BurnExecution, what_was_cut_off_is_not_resumed_where_what_is_left_is_not_known)
{
    for (const double gained : {static_cast<double>(NAN), HUGE_VAL}) {
        for (const BurnPhase phase : {BURN_CUT, BURN_COMPLETE}) {
            Craft craft;
            craft.m.in.kept = {good(), phase, BURN_NOT_ABORTED, gained, 0, 1000 * ms, 1000 * ms, 0};
            const BurnState &state = craft.fly(5);
            EXPECT_EQ(state.to_go, 20.0);
            EXPECT_EQ(state.phase, phase == BURN_CUT ? BURN_ABORTED : BURN_COMPLETE);
            EXPECT_EQ(state.abort, phase == BURN_CUT ? BURN_BLIND : BURN_NOT_ABORTED);
            EXPECT_EQ(craft.dv, 0.0);
        }
    }
}

TEST(BurnExecution, the_engines_close_without_the_module)
{
    Craft craft;
    craft.fly(5);
    ASSERT_EQ(craft.m.out.state.phase, BURN_RUNS);
    EXPECT_TRUE(craft.open(craft.t + period / 2));
    EXPECT_FALSE(craft.open(craft.t + period));
}

TEST(BurnExecution, a_command_of_no_length_is_none)
{
    for (const double none : {0.0, HUGE_VAL, static_cast<double>(NAN)}) {
        Craft craft;
        craft.m.in.command.dv_N.v[2] = none;
        EXPECT_EQ(craft.fly(5).phase, BURN_NONE);
        EXPECT_TRUE(all_zero(craft.m.out));
    }
}

TEST(BurnExecution, a_command_that_turns_otherwise_is_another_one)
{
    Craft craft;
    craft.step();
    craft.m.in.command.rate_N = vec3(0, 1e-3, 0);
    craft.step();
    EXPECT_EQ(craft.m.mem.taken.rate_N.v[1], 1e-3);
}

} // namespace burn_execution_test
} // namespace flight::testing
