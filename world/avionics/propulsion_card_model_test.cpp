// SPDX-License-Identifier: Apache-2.0
#include "world/avionics/propulsion_card_model.h"

#include "world/testing/flyer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <random>

namespace propulsion_card_model_test {

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
        i.in.command.head = i.in.power.head = {0, QUALITY_GOOD, 1};
        i.in.command.armed = 1;
        i.in.power.on = 1u << 2;
        model.prepare({"world.card", 1, nullptr});
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
        i.in.command.number++;
        i.in.command.start[thruster] = start;
        i.in.command.duration[thruster] = duration;
    }
    const ThrusterTimes &thrusters() const { return i.out.thrusters; }
    const PropulsionState &state() const { return i.out.state; }
};

TEST(PropulsionCard, ABurnHasItsStartAndItsDuration)
{
    Card c;
    c.burn(1, 1530 * ms, 250 * ms);
    for (; c.t < 1500 * ms; c.step()) {
        ASSERT_EQ(c.thrusters().burns[1], 0u);
    }
    EXPECT_EQ(c.state().number, 1u);
    c.step();
    EXPECT_EQ(c.thrusters().on[1], 1530 * ms);
    EXPECT_EQ(c.thrusters().off[1], 1780 * ms);
    EXPECT_EQ(c.state().begun, 1u);
    c.step();
    EXPECT_EQ(c.thrusters().burns[1], 1u) << "once for a command that stands";
}

TEST(PropulsionCard, PulsesOfAllThrustersAtTheRateOfControlAreThoseThatWereCommanded)
{
    // Each 250 ms, on-times of zero to the whole period, which go on without a gap where they meet.
    std::mt19937 random(8);
    Card c;
    Ns requested[3] = {0, 0, 0}, open[3] = {0, 0, 0}, begun[3] = {0, 0, 0}, until[3] = {0, 0, 0};
    for (int k = 0; k < 4000; k++) {
        if (c.t % (250 * ms) == 0) {
            c.i.in.command.number++;
            for (std::uint32_t i = 0; i < 3; i++) {
                const Ns w = random() % 3 ? 20 * ms + static_cast<Ns>(random() % 231) * ms : 0;
                const bool goes_on = w > 0 && until[i] == c.t && c.t > 0;
                begun[i] = goes_on ? begun[i] : c.t;
                until[i] = c.t + w;
                c.i.in.command.start[i] = w > 0 ? begun[i] : 0;
                c.i.in.command.duration[i] = w > 0 ? until[i] - begun[i] : 0;
                requested[i] += w;
            }
        }
        c.step(50 * ms);
        for (std::size_t i = 0; i < 3; i++) { // what a valve would do in the step
            open[i] +=
                std::max<Ns>(0, std::min(c.thrusters().off[i], c.t) - std::max(c.thrusters().on[i], c.t - 50 * ms));
        }
    }
    EXPECT_EQ(c.state().refused, 0u);
    for (std::size_t i = 0; i < 3; i++) {
        EXPECT_EQ(requested[i], open[i]) << i;
        EXPECT_GT(requested[i], 60 * second);
    }
}

TEST(PropulsionCard, ABurnGoesOnWithALongerDurationAndEndsWithAShorterOne)
{
    Card c;
    for (Ns end = 500 * ms; end <= 3 * second; end += 100 * ms) { // opened for two updates only
        c.burn(0, 300 * ms, end - 300 * ms);
        c.step();
    }
    EXPECT_EQ(c.thrusters().on[0], 300 * ms);
    EXPECT_EQ(c.thrusters().off[0], 3 * second);
    EXPECT_EQ(c.thrusters().burns[0], 1u);
    c.burn(0, 300 * ms, c.t + 30 * ms - 300 * ms); // the cut-off
    c.step();
    EXPECT_EQ(c.thrusters().off[0], c.t - 70 * ms);
    c.burn(0, 0, 0);
    c.step();
    EXPECT_EQ(c.thrusters().off[0], c.t - 170 * ms) << "it has been shut already";
}

TEST(PropulsionCard, WhatItCannotBurnIsRefused)
{
    Card c;
    c.burn(0, 0, 19 * ms); // too short
    c.step();
    c.step();
    EXPECT_EQ(c.state().refused, 1u) << "once";
    c.burn(3, 0, second); // no such thruster
    c.step();
    c.burn(1, 50 * ms, 50 * ms); // over
    c.step();
    EXPECT_EQ(c.state().refused, 3u);
    EXPECT_EQ(c.state().begun, 0u);
    EXPECT_EQ(c.state().number, c.i.in.command.number) << "also what was refused is answered";
    c.burn(2, 50 * ms, second); // late, but not over
    c.step();
    EXPECT_EQ(c.thrusters().on[2], c.t - 100 * ms);
    EXPECT_EQ(c.thrusters().off[2], 1050 * ms);
}

TEST(PropulsionCard, DisarmedUnpoweredOrLostItShutsAllValves)
{
    for (const int how : {0, 1, 2}) {
        Card c;
        if (how == 2) {
            c.i.par.n_faults = 1;
            c.i.par.faults[0] = {FAULT_DEAD, 1u << 8, 0.0, 300 * ms, 700 * ms};
        }
        c.burn(0, 0, 10 * second);
        c.burn(1, 0, 800 * ms);
        c.step();
        c.step();
        EXPECT_EQ(c.thrusters().off[0], 10 * second);
        EXPECT_EQ(c.state().armed, 1u);
        EXPECT_EQ(c.state().driven[0] + c.state().driven[1], 2u) << "in the first step";
        const std::uint32_t counter = c.state().counter;
        if (how == 0) {
            c.i.in.command.armed = 0;
        } else if (how == 1) {
            c.i.in.power.on = ~(1u << 2);
        }
        while (c.t < 900 * ms) {
            c.step();
            EXPECT_EQ(c.thrusters().off[0], 200 * ms);
        }
        EXPECT_EQ(c.state().counter, how == 0 ? counter + 7 : counter) << "its housekeeping stands still";
        EXPECT_EQ(c.state().armed, how == 0 ? 0u : 1u);
        c.i.in.command.armed = 1;
        c.i.in.power.on = ~0u;
        c.step();
        EXPECT_EQ(c.thrusters().burns[0], 2u) << "of what stands, the burn that is not over goes on";
        EXPECT_EQ(c.thrusters().on[0], 900 * ms);
        EXPECT_EQ(c.thrusters().off[0], 10 * second);
        EXPECT_EQ(c.thrusters().burns[1], 1u);
    }
}

TEST(PropulsionCard, ADriverThatIsLostOpensItsValveNoMore)
{
    Card c;
    c.i.par.n_faults = 1;
    c.i.par.faults[0] = {FAULT_DEAD, 1u << 1, 0.0, 500 * ms, 500 * ms};
    c.burn(0, 0, 10 * second);
    c.burn(1, 0, 10 * second);
    for (int k = 1; k <= 12; k++) {
        c.step();
        const Ns step = c.t - 100 * ms;
        EXPECT_EQ(c.thrusters().off[1] > step, k < 5 || k >= 10) << k;
        EXPECT_EQ(c.thrusters().off[0], 10 * second);
        EXPECT_EQ(c.state().driven[0], static_cast<std::uint32_t>(k - 1));
        EXPECT_EQ(c.state().driven[1], static_cast<std::uint32_t>(k - 1)) << "the card does not know it";
    }
    EXPECT_EQ(c.thrusters().burns[1], 1u);
}

TEST(PropulsionCard, PressureShowsAValveThatIsStuck)
{
    Card c;
    c.i.in.thrust.head.quality = QUALITY_GOOD;
    c.burn(0, 0, 10 * second);
    c.burn(1, 0, 10 * second);
    for (int k = 0; k < 5; k++) {
        c.step();
        // The spacecraft flies the step after the card: thruster 0 is sound, 1 stuck shut, and 2 stuck open.
        c.i.in.thrust.impulse[0] += 0.1;
        c.i.in.thrust.impulse[2] += 0.1;
    }
    constexpr std::uint32_t driven[] = {4, 4, 0}, flowing[] = {4, 0, 4};
    for (std::size_t i = 0; i < 3; i++) {
        EXPECT_EQ(c.state().driven[i], driven[i]) << i;
        EXPECT_EQ(c.state().flowing[i], flowing[i]) << i;
    }
}

} // namespace propulsion_card_model_test
