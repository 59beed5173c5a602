// SPDX-License-Identifier: Apache-2.0
// Where a burn stands, over changes of the mode and resets, with a non-volatile memory that answers late.
#include "flight/testing/eigen.h"

extern "C" {
#include "flight/guidance/burn_memory.h"
}

#include <gtest/gtest.h>

#include <vector>

namespace flight::testing {
namespace burn_memory_test {

constexpr std::int64_t period = 100'000'000;

struct Craft {
    BurnMemory m{};
    std::uint32_t slot[NVM_WORDS] = {};
    NvmPacket reply{};
    int delay = 1, late = 0;
    std::int64_t t = 0;
    std::vector<std::vector<double>> events{};

    Craft() { m.par.slot = 3; }

    void step()
    {
        t += period;
        if (m.out.request.code != NVM_NOTHING && m.out.request.number != reply.number && late++ >= delay) {
            late = 0;
            reply.number = m.out.request.number;
            if (m.out.request.code == NVM_STORE) {
                std::copy_n(m.out.request.data, NVM_WORDS, slot);
            }
            std::copy_n(slot, NVM_WORDS, reply.data);
        }
        reply.head = good(t);
        m.in.reply = reply;
        const std::uint32_t before = m.out.event.count;
        burn_memory_update(&m, {t, period});
        if (m.out.event.count != before) {
            events.push_back({static_cast<double>(m.out.event.id), m.out.event.arguments[0]});
        }
    }
    /// The execution says how far it is, and gains 1 m/s at each update.
    void burn(BurnPhase phase, int updates)
    {
        for (int i = 0; i < updates; i++) {
            BurnState &state = m.in.state;
            state.head = head_next(state.head, t + period, QUALITY_GOOD);
            state.phase = phase;
            state.start = 7;
            state.begun = 9;
            state.gained += phase == BURN_RUNS ? 1 : 0;
            step();
        }
    }
    void reset_computer()
    {
        m.mem = {};
        m.in = {};
        burn_memory_reset(&m);
        late = 0;
    }
    using Events = std::vector<std::vector<double>>;
};

TEST(BurnMemory, a_reset_of_the_computer_cuts_a_burn_off_that_may_go_on)
{
    for (const int delay : {0, 1, 4}) {
        Craft craft;
        craft.delay = delay;
        craft.burn(BURN_WAITS, 10);
        EXPECT_EQ(craft.m.out.kept.phase, BURN_NONE);
        craft.burn(BURN_RUNS, 50);
        craft.reset_computer();
        craft.step();
        EXPECT_EQ(craft.m.out.kept.head.quality, QUALITY_DEGRADED);
        for (int i = 0; i < 8; i++) {
            craft.step();
        }
        const BurnState kept = craft.m.out.kept;
        EXPECT_EQ(kept.head.quality, QUALITY_GOOD);
        EXPECT_EQ(kept.phase, BURN_CUT);
        EXPECT_EQ(kept.start, 7);
        EXPECT_EQ(kept.begun, 9);
        EXPECT_LE(kept.gained, 50.0);
        EXPECT_GE(kept.gained, 50.0 - 2 * (delay + 1)) << "the last answer, and the one that was under way";

        craft.reset_computer(); // once more, before it goes on
        for (int i = 0; i < 9; i++) {
            craft.step();
        }
        EXPECT_EQ(craft.m.out.kept.phase, BURN_CUT);
        EXPECT_EQ(craft.m.out.kept.gained, kept.gained);

        craft.burn(BURN_WAITS, 3);
        EXPECT_EQ(craft.m.out.kept.phase, BURN_CUT);
        craft.m.in.state.gained = 60;
        craft.burn(BURN_RUNS, 10);
        EXPECT_EQ(craft.m.out.kept.phase, BURN_RUNS);
        craft.burn(BURN_COMPLETE, 20);
        craft.reset_computer();
        for (int i = 0; i < 9; i++) {
            craft.step();
        }
        EXPECT_EQ(craft.m.out.kept.phase, BURN_COMPLETE);
        EXPECT_EQ(craft.m.out.kept.gained, 70.0);
        EXPECT_EQ(craft.events, (Craft::Events{{BURN_MEMORY_BEGUN, 0},
                                               {BURN_MEMORY_CUT, kept.gained},
                                               {BURN_MEMORY_CUT, kept.gained},
                                               {BURN_MEMORY_RESUMED, 61},
                                               {BURN_MEMORY_ENDED, 70}}));
    }
}

TEST(BurnMemory, a_reset_of_flight_cuts_it_off_too_and_a_mode_that_is_left_aborts_it)
{
    Craft craft;
    craft.m.par.slot = 0;
    craft.burn(BURN_RUNS, 20);
    burn_memory_reset(&craft.m);
    craft.step(); // its input is still that of before
    EXPECT_EQ(craft.m.out.kept.phase, BURN_CUT);
    EXPECT_EQ(craft.m.out.kept.head.quality, QUALITY_GOOD) << "without a slot there is nothing to wait for";
    craft.burn(BURN_RUNS, 5);
    for (int i = 0; i < 10; i++) {
        craft.step();
        EXPECT_EQ(craft.m.out.kept.phase, BURN_RUNS) << i;
    }
    craft.step();
    EXPECT_EQ(craft.m.out.kept.phase, BURN_ABORTED);
    EXPECT_EQ(craft.m.out.kept.abort, BURN_LEFT);
    EXPECT_EQ(craft.events.back(), (std::vector<double>{BURN_MEMORY_ABORTED, BURN_LEFT}));
}

TEST(BurnMemory, a_memory_that_is_silent_damaged_or_empty_is_not_waited_for)
{
    Craft craft;
    craft.burn(BURN_RUNS, 20);
    craft.slot[4] ^= 1u << 7;
    craft.reset_computer();
    for (int i = 0; i < 9; i++) {
        craft.step();
    }
    EXPECT_EQ(craft.m.out.kept.phase, BURN_NONE);
    EXPECT_EQ(craft.m.out.kept.head.quality, QUALITY_GOOD);
    EXPECT_EQ(craft.events.back()[0], BURN_MEMORY_DAMAGED);

    craft.reset_computer();
    craft.delay = 1000;
    for (int i = 0; i < BURN_MEMORY_PATIENCE; i++) {
        EXPECT_NE(craft.m.out.kept.head.quality, QUALITY_GOOD) << i;
        craft.step();
    }
    EXPECT_EQ(craft.m.out.kept.head.quality, QUALITY_GOOD);
}

TEST(BurnMemory, numbers_that_are_not_finite_are_not_kept)
{
    for (double BurnState::*number : {&BurnState::gained, &BurnState::to_go}) {
        Craft craft;
        craft.m.par.silent = 1;
        craft.burn(BURN_RUNS, 5);
        craft.m.in.state.*number = NAN;
        craft.burn(BURN_RUNS, 5);
        EXPECT_EQ(craft.m.out.kept.gained, 5.0);
        EXPECT_EQ(craft.m.out.kept.phase, BURN_RUNS);
        craft.burn(BURN_RUNS, 10);
        EXPECT_EQ(craft.m.out.kept.phase, BURN_ABORTED) << "as if it said nothing";
        EXPECT_EQ(craft.events.back(), (std::vector<double>{BURN_MEMORY_ABORTED, BURN_LEFT}));
    }
}

TEST(BurnMemory, a_number_that_is_not_finite_in_the_memory_is_damage)
{
    Craft craft;
    craft.burn(BURN_RUNS, 20);
    craft.m.mem.burn.gained = HUGE_VAL;
    craft.m.mem.changed = 1;
    craft.burn(BURN_NONE, 9); // it is stored
    craft.reset_computer();
    craft.burn(BURN_NONE, 9);
    EXPECT_EQ(craft.events.back()[0], BURN_MEMORY_DAMAGED);
    EXPECT_EQ(craft.m.out.kept.phase, BURN_NONE);
    EXPECT_EQ(craft.m.out.kept.gained, 0.0);
}

TEST(BurnMemory, a_burn_that_is_aborted_is_reported_once_and_kept)
{
    Craft craft;
    craft.burn(BURN_RUNS, 5);
    craft.m.in.state.abort = BURN_BLIND;
    craft.burn(BURN_ABORTED, 5);
    EXPECT_EQ(craft.events, (Craft::Events{{BURN_MEMORY_BEGUN, 0}, {BURN_MEMORY_ABORTED, BURN_BLIND}}));
    craft.reset_computer();
    craft.burn(BURN_NONE, 5);
    EXPECT_EQ(craft.m.out.kept.phase, BURN_ABORTED);
    EXPECT_EQ(craft.m.out.kept.abort, BURN_BLIND);
}

TEST(BurnMemory, a_burn_that_completes_is_reported_once)
{
    Craft craft;
    craft.burn(BURN_RUNS, 5);
    craft.burn(BURN_COMPLETE, 5);
    EXPECT_EQ(craft.events, (Craft::Events{{BURN_MEMORY_BEGUN, 0}, {BURN_MEMORY_ENDED, 5}}));
}

TEST(BurnMemory, what_the_memory_answers_late_or_refuses_changes_no_burn_that_runs)
{
    Craft before;
    before.burn(BURN_RUNS, 20);
    for (const bool refuses : {false, true}) {
        Craft craft;
        std::copy_n(before.slot, NVM_WORDS, craft.slot);
        craft.delay = 5;
        craft.reply.refused = refuses;
        craft.burn(refuses ? BURN_NONE : BURN_RUNS, 8);
        EXPECT_EQ(craft.m.out.kept.phase, refuses ? BURN_NONE : BURN_RUNS);
        EXPECT_EQ(craft.m.out.kept.gained, refuses ? 0.0 : 8.0);
    }
}

} // namespace burn_memory_test
} // namespace flight::testing
