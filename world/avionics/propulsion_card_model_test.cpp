// SPDX-License-Identifier: Apache-2.0
#include "world/avionics/propulsion_card_model.h"

#include "world/testing/flyer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

namespace {

using namespace fledge::world;
using namespace fledge::world::testing;

struct Card {
    PropulsionCard i{};
    PropulsionCardModel model{i};
    Ns t = 0;

    Card()
    {
        i.par.n = 3;
        i.par.load = 2;
        i.par.min_on = 20 * ms;
        i.in.burn.armed = 1;
        i.in.power.head = {0, QUALITY_GOOD, 1};
        i.in.power.on = 1u << 2;
        model.reset(0);
        model.update({0, 0});
    }
    void step(Ns dt = 100 * ms)
    {
        t += dt;
        model.update({t, dt});
    }
    void burn(std::uint32_t thruster, Ns start, Ns duration)
    {
        i.in.burn.number++;
        i.in.burn.thruster = thruster;
        i.in.burn.start = start;
        i.in.burn.duration = duration;
    }
    const ThrusterTimes &thrusters() const { return i.out.thrusters; }
};

TEST(PropulsionCard, ABurnHasItsStartAndItsDuration)
{
    Card c;
    c.burn(1, 1530 * ms, 250 * ms);
    for (; c.t < 1500 * ms; c.step()) {
        ASSERT_EQ(c.thrusters().burns[1], 0u);
    }
    EXPECT_EQ(c.i.out.state.queued, 1u);
    c.step();
    EXPECT_EQ(c.thrusters().on[1], 1530 * ms);
    EXPECT_EQ(c.thrusters().off[1], 1780 * ms);
    EXPECT_EQ(c.i.out.state.begun, 1u);
    EXPECT_EQ(c.i.out.state.queued, 0u);
}

TEST(PropulsionCard, EachBurnOpensItsThrusterOnceAndForItsTime)
{
    // Random burns: whatever their order, of each thruster the times add up, and none overlaps the one before.
    std::mt19937 random(8);
    Card c;
    std::vector<Ns> asked[3], open[3];
    Ns last_off[3] = {0, 0, 0};
    for (int k = 0; k < 3000; k++) {
        if (k < 2000 && random() % 5 == 0 && c.i.out.state.queued < BURNS_QUEUED) {
            const std::uint32_t thruster = random() % 3;
            const Ns duration = 20 * ms + static_cast<Ns>(random() % 400) * ms;
            c.burn(thruster, c.t + static_cast<Ns>(random() % 500) * ms, duration);
            asked[thruster].push_back(duration);
        }
        const ThrusterTimes before = c.thrusters();
        c.step();
        for (std::size_t i = 0; i < 3; i++) {
            const auto &now = c.thrusters();
            ASSERT_LE(now.burns[i], before.burns[i] + 1);
            if (now.burns[i] != before.burns[i]) {
                ASSERT_GE(now.on[i], last_off[i]);
                ASSERT_TRUE(now.on[i] >= c.t - 100 * ms && now.on[i] <= c.t) << "within the step";
                open[i].push_back(now.off[i] - now.on[i]);
                last_off[i] = now.off[i];
            }
        }
    }
    EXPECT_EQ(c.i.out.state.refused, 0u);
    for (std::size_t i = 0; i < 3; i++) {
        EXPECT_GT(asked[i].size(), 50u);
        EXPECT_EQ(asked[i], open[i]) << "in the order in which they came";
    }
}

TEST(PropulsionCard, WhatItCannotBurnIsRefused)
{
    Card c;
    c.burn(0, 0, 19 * ms); // too short
    c.step();
    c.burn(3, 0, second); // no such thruster
    c.step();
    EXPECT_EQ(c.i.out.state.refused, 2u);
    for (int k = 0; k < BURNS_QUEUED + 1; k++) {
        c.burn(0, 100 * second, second);
        c.step();
    }
    EXPECT_EQ(c.i.out.state.refused, 3u) << "no room";
    EXPECT_EQ(c.i.out.state.queued, BURNS_QUEUED);
    EXPECT_EQ(c.i.out.state.number, c.i.in.burn.number) << "also what was refused is answered";
}

TEST(PropulsionCard, DisarmedByEitherKeyItCloses)
{
    for (const bool by_switch : {true, false}) {
        Card c;
        c.burn(0, 0, 10 * second);
        c.step();
        c.burn(0, 0, 10 * second);
        c.step();
        EXPECT_EQ(c.thrusters().off[0], 10'100 * ms);
        (by_switch ? c.i.in.power.on : c.i.in.burn.armed) = 0;
        c.step();
        EXPECT_EQ(c.thrusters().off[0], 300 * ms);
        EXPECT_EQ(c.i.out.state.armed, 0u);
        c.burn(1, 0, second);
        c.step();
        EXPECT_EQ(c.i.out.state.refused, 1u);
        (by_switch ? c.i.in.power.on : c.i.in.burn.armed) = 1u << 2;
        for (int k = 0; k < 50; k++) {
            c.step();
        }
        EXPECT_EQ(c.i.out.state.armed, 1u);
        EXPECT_EQ(c.i.out.state.begun, 1u) << "the queue was emptied";
    }
}

} // namespace
