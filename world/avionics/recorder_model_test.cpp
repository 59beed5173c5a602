// SPDX-License-Identifier: Apache-2.0
#include "world/avionics/recorder_model.h"

#include "world/testing/flyer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <vector>

namespace recorder_model_test {

using namespace fledge::world;
using namespace fledge::world::testing;
using Page = std::vector<std::uint8_t>;

struct Bench {
    Recorder r{};
    RecorderModel model{r};
    Ns t = 0;

    Bench()
    {
        r.par.pages = 9;
        model.prepare({"world.recorder", 7, nullptr});
        model.reset(0);
    }
    const RecorderReply &step(Ns dt = 100 * ms)
    {
        t += dt;
        model.update({t, dt});
        return r.out.reply;
    }
    const RecorderReply &ask(RecorderCode code, std::uint32_t page, const Page &data = Page(RECORDER_PAGE))
    {
        r.in.request.code = code;
        r.in.request.number++;
        r.in.request.page = page;
        std::copy(data.begin(), data.end(), r.in.request.data);
        return step();
    }
    void power(bool on)
    {
        r.in.power.head = head_next(r.in.power.head, t, QUALITY_GOOD);
        r.in.power.on = on;
    }
    Page read(std::uint32_t page)
    {
        const RecorderReply &reply = ask(RECORDER_READ, page);
        EXPECT_LE(reply.answer, RECORDER_CORRECTED);
        return {std::begin(reply.data), std::end(reply.data)};
    }
    void flip(std::uint32_t page, std::uint32_t word, std::uint32_t bit) // bits 64 to 71: of the code
    {
        (bit < 64 ? r.mem.memory[page][8 * word + bit / 8] : r.mem.code[page][word]) ^=
            static_cast<std::uint8_t>(1 << bit % 8);
    }
};

Page any_page(std::mt19937 &random)
{
    Page page(RECORDER_PAGE);
    std::generate(page.begin(), page.end(), [&] { return static_cast<std::uint8_t>(random()); });
    return page;
}

TEST(Recorder, WhatIsWrittenComesBackAndEachRequestIsServedOnce)
{
    std::mt19937 random(1);
    Bench b;
    std::map<std::uint32_t, Page> memory;
    std::uint32_t written = 0, read = 0, refused = 0, used = 0;
    for (int k = 0; k < 1000; k++) {
        const std::uint32_t page = random() % 10;
        if (random() % 2) {
            const Page data = any_page(random);
            EXPECT_EQ(b.ask(RECORDER_WRITE, page, data).answer, page < 9 ? RECORDER_DONE : RECORDER_REFUSED);
            written += page < 9;
            used = page < 9 ? std::max(used, page + 1) : used;
            memory[page] = data;
        } else {
            const RecorderReply reply = b.ask(RECORDER_READ, page);
            EXPECT_EQ(reply.answer, page < 9 ? RECORDER_DONE : RECORDER_REFUSED);
            read += page < 9;
            const Page expected = page < 9 && memory.count(page) ? memory[page] : Page(RECORDER_PAGE);
            EXPECT_EQ(Page(std::begin(reply.data), std::end(reply.data)), expected);
        }
        refused += page >= 9;
        EXPECT_EQ(b.r.out.reply.number, b.r.in.request.number);
        EXPECT_EQ(b.r.out.reply.page, page);
        EXPECT_EQ(b.r.out.reply.used, used);
        for (unsigned n = random() % 3; n-- > 0;) {
            b.step();
        }
    }
    b.r.in.request = {}; // as flight's output is after a reset of the computer
    EXPECT_EQ(b.step().pages, 9u);
    EXPECT_EQ(b.r.out.state.written, written);
    EXPECT_EQ(b.r.out.state.read, read);
    EXPECT_EQ(b.r.out.state.refused, refused);
}

TEST(Recorder, OneWrongBitOfAWordIsSetRightAndTwoAreFound)
{
    std::mt19937 random(2);
    Bench b;
    for (std::uint32_t first = 0; first < 72; first++) {
        for (std::uint32_t second = first; second < 72; second++) {
            const Page data = any_page(random);
            b.ask(RECORDER_WRITE, 4, data);
            const std::uint32_t word = random() % RECORDER_WORDS;
            b.flip(4, word, first);
            if (second == first) {
                EXPECT_EQ(b.ask(RECORDER_READ, 4).answer, RECORDER_CORRECTED) << first;
                EXPECT_EQ(Page(std::begin(b.r.out.reply.data), std::end(b.r.out.reply.data)), data);
                EXPECT_EQ(b.ask(RECORDER_READ, 4).answer, RECORDER_DONE) << "it was set right in memory too";
            } else {
                b.flip(4, word, second);
                EXPECT_EQ(b.ask(RECORDER_READ, 4).answer, RECORDER_DAMAGED) << first << " " << second;
                EXPECT_EQ(Page(std::begin(b.r.out.reply.data), std::end(b.r.out.reply.data)), Page(RECORDER_PAGE));
            }
        }
    }
    EXPECT_EQ(b.r.out.state.corrected, 72u);
    EXPECT_EQ(b.r.out.state.damaged, 72u * 71u / 2u);
}

TEST(Recorder, PlannedBitsFlipOnceAtTheirTime)
{
    Bench b;
    b.r.par.n_faults = 3;
    b.r.par.faults[0] = {RECORDER_FLIP, 2, 100, 1, 1050 * ms};
    b.r.par.faults[1] = {RECORDER_FLIP, 3, 63, 2, 1100 * ms}; // of two words
    b.r.par.faults[2] = {RECORDER_FLIP, 4, 0, 1, 0};
    b.step(0);
    while (b.t < 1 * second) {
        b.step();
    }
    EXPECT_EQ(b.r.mem.memory[2][12], 0);
    for (int k = 0; k < 5; k++) {
        b.step();
        EXPECT_EQ(b.r.mem.memory[2][12], 1 << 4);
    }
    EXPECT_EQ(b.r.mem.memory[4][0], 1);
    EXPECT_EQ(b.r.mem.memory[3][7], 0x80);
    EXPECT_EQ(b.r.mem.memory[3][8], 0x01);
    EXPECT_EQ(b.read(3), Page(RECORDER_PAGE));
    EXPECT_EQ(b.r.out.state.corrected, 2u);
}

TEST(Recorder, BitsFlipAtRandomAsOftenAsStated)
{
    Bench b;
    b.r.par.upsets = 20;
    const auto ones = [&] {
        int n = 0;
        for (std::uint32_t page = 0; page < RECORDER_PAGES; page++) {
            for (std::uint32_t word = 0; word < RECORDER_WORDS; word++) {
                for (std::uint32_t bit = 0; bit < 72; bit++) {
                    n += (bit < 64 ? b.r.mem.memory[page][8 * word + bit / 8] >> bit % 8
                                   : b.r.mem.code[page][word] >> (bit - 64)) &
                         1;
                }
            }
        }
        return n;
    };
    for (int k = 0; k < 500; k++) {
        b.step();
    }
    // Flips are a Poisson process of 20 / s x 50 s; a bit that was hit an odd number of times is 1.
    const double bits = 9 * RECORDER_WORDS * 72.0, hits = 1000;
    const double expected = bits / 2 * (1 - std::exp(-2 * hits / bits));
    EXPECT_NEAR(ones(), expected, 4 * std::sqrt(hits));
    const int first = ones();
    Bench again;
    again.r.par.upsets = 20;
    std::swap(again.r.mem, b.r.mem);
    b.model.reset(0);
    b.t = 0;
    for (int k = 0; k < 500; k++) {
        b.step();
    }
    EXPECT_EQ(ones(), first) << "a run with the same seed repeats";
}

TEST(Recorder, AWornPageRefusesAndKeepsWhatItHad)
{
    std::mt19937 random(3);
    Bench b;
    b.r.par.endurance = 3;
    b.r.par.n_faults = 1;
    b.r.par.faults[0] = {RECORDER_WEAR, 5, 0, 0, 1 * second};
    Page last;
    for (int k = 0; k < 5; k++) {
        const Page data = any_page(random);
        EXPECT_EQ(b.ask(RECORDER_WRITE, 1, data).answer, k < 3 ? RECORDER_DONE : RECORDER_WORN);
        last = k < 3 ? data : last;
    }
    EXPECT_EQ(b.read(1), last);
    last = any_page(random);
    EXPECT_EQ(b.ask(RECORDER_WRITE, 5, last).answer, RECORDER_DONE);
    b.step(1 * second);
    EXPECT_EQ(b.ask(RECORDER_WRITE, 5, any_page(random)).answer, RECORDER_WORN);
    EXPECT_EQ(b.read(5), last);
    EXPECT_EQ(b.r.out.state.worn, 3u);
}

TEST(Recorder, IsBusyForItsTimeAndThenServesTheRequestThatStands)
{
    Bench b;
    b.r.par.write_time = 250 * ms;
    b.r.par.read_time = 100 * ms;
    b.ask(RECORDER_WRITE, 0, Page(RECORDER_PAGE, 1)); // begun here
    EXPECT_EQ(b.r.out.state.busy, 1u);
    b.r.in.request.number++;
    b.r.in.request.page = 1;
    EXPECT_EQ(b.step().number, 0u);
    EXPECT_EQ(b.step().number, 0u);
    EXPECT_EQ(b.step().number, 1u); // 300 ms; the next one begins
    EXPECT_EQ(b.step().number, 1u);
    EXPECT_EQ(b.step().number, 1u);
    EXPECT_EQ(b.step().number, 2u);
    EXPECT_EQ(b.r.out.state.busy, 0u);
    EXPECT_EQ(b.ask(RECORDER_READ, 0).number, 2u);
    EXPECT_EQ(b.step().number, 3u);
    EXPECT_EQ(b.r.mem.memory[1][255], 1);
    EXPECT_EQ(b.r.out.state.written, 2u);
}

TEST(Recorder, APageIsTornWherePowerFails)
{
    Bench b;
    b.power(true);
    b.ask(RECORDER_WRITE, 0, Page(RECORDER_PAGE, 1));
    b.r.par.write_time = 800 * ms;
    b.ask(RECORDER_WRITE, 0, Page(RECORDER_PAGE, 2));
    b.step();
    b.step();
    b.power(false);
    const Head before = b.r.out.reply.head;
    EXPECT_EQ(b.step().number, 0u); // after 300 of 800 ms: 12 of 32 words
    EXPECT_EQ(b.r.out.reply.head.t, before.t);
    for (int i = 0; i < RECORDER_PAGE; i++) {
        EXPECT_EQ(b.r.mem.memory[0][i], i < 12 * 8 ? 2 : 1) << i;
    }
    EXPECT_EQ(b.r.out.state.torn, 1u);
    b.step();
    b.power(true);
    b.r.in.request = {}; // the computer was off too
    b.r.par.read_time = 0;
    b.step();
    EXPECT_EQ(b.read(0)[0], 2) << "each word is whole, so its code says nothing";
    EXPECT_EQ(b.r.out.state.corrected + b.r.out.state.damaged, 0u);

    b.power(false);
    b.step();
    b.power(true);
    EXPECT_EQ(b.step().number, b.r.in.request.number) << "the request that stands is served anew";
}

} // namespace recorder_model_test
