// SPDX-License-Identifier: Apache-2.0
#include "emulator/devices/gptimer.h"

#include <gtest/gtest.h>

#include <random>

#include "emulator/testing/fake_host.h"

namespace fledge::emulator {
namespace gptimer_test {

using testing::FakeHost;
using Lines = std::vector<std::uint32_t>;

enum : std::uint32_t { enable = 1, restart = 2, load = 4, interrupt = 8, pending = 16, chain = 32 };

struct Bench {
    explicit Bench(const Gptimer::Settings &settings) : timer("gptimer", host, settings) {}
    FakeHost host;
    Gptimer timer;
};

TEST(Gptimer, a_timer_interrupts_at_its_period)
{
    Bench b({.timers = 2, .interrupt = 6, .scaler = 79});
    b.timer.write(0x14, 999);
    b.timer.write(0x18, enable | restart | load | interrupt);
    b.host.run(b.timer, 79'999);
    EXPECT_EQ(b.host.take(), Lines{});
    b.host.run(b.timer, 80'000);
    EXPECT_EQ(b.host.take(), Lines{6});
    b.host.run(b.timer, 320'000);
    EXPECT_EQ(b.host.take(), (Lines{6, 6, 6}));
    EXPECT_EQ(b.timer.read(0x18), enable | restart | interrupt | pending);
    b.timer.write(0x18, enable | restart | interrupt | pending);
    EXPECT_EQ(b.timer.read(0x18), enable | restart | interrupt);
    EXPECT_EQ(b.timer.read(0x08) & 0xFF, 2u | 6u << 3);
}

TEST(Gptimer, a_timer_without_restart_stops)
{
    Bench b({.timers = 1, .interrupt = 6, .scaler = 0});
    b.timer.write(0x10, 4);
    b.timer.write(0x18, enable | interrupt);
    b.host.run(b.timer, 4);
    EXPECT_EQ(b.timer.read(0x10), 0u);
    b.host.run(b.timer, 100);
    EXPECT_EQ(b.host.take(), Lines{6});
    EXPECT_EQ(b.timer.read(0x10), 0xFFFFFFFFu);
    EXPECT_EQ(b.timer.read(0x18) & enable, 0u);
    EXPECT_EQ(b.timer.next_event(), never);
}

TEST(Gptimer, a_timer_that_no_line_waits_for_has_no_events)
{
    Bench b({.timers = 2, .interrupt = 6, .scaler = 9});
    b.timer.write(0x24, 0xFFFFFFFF);
    b.timer.write(0x28, enable | restart | load);
    EXPECT_EQ(b.timer.next_event(), never);
    b.host.now = 1'000'005;
    EXPECT_EQ(b.timer.read(0x20), 0xFFFFFFFFu - 100'000);
}

TEST(Gptimer, the_watchdog_resets_unless_it_is_started_again)
{
    Bench b({.timers = 3, .interrupt = 6, .scaler = 0, .watchdog = true});
    EXPECT_FALSE(b.timer.watchdog_runs());
    b.timer.write(0x34, 99);
    b.timer.write(0x38, enable | load);
    EXPECT_TRUE(b.timer.watchdog_runs());
    b.host.run(b.timer, 90);
    b.timer.write(0x38, enable | load);
    b.host.run(b.timer, 189);
    EXPECT_EQ(b.host.resets, 0u);
    b.host.run(b.timer, 190);
    EXPECT_EQ(b.host.resets, 1u);
    EXPECT_EQ(b.timer.watchdog_resets(), 1u);
    EXPECT_EQ(b.host.take(), Lines{}) << "its interrupt is not enabled";
    b.timer.reset();
    EXPECT_FALSE(b.timer.watchdog_runs());
    EXPECT_EQ(b.timer.watchdog_resets(), 1u);
}

TEST(Gptimer, a_watchdog_may_run_from_the_reset_on)
{
    Bench b({.timers = 2, .interrupt = 6, .scaler = 9, .watchdog = true, .watchdog_after_reset = 5});
    b.host.run(b.timer, 49);
    EXPECT_EQ(b.host.resets, 0u);
    b.host.run(b.timer, 50);
    EXPECT_EQ(b.host.resets, 1u);
}

/// Counts every cycle, as the hardware does.
struct Slow {
    struct Timer {
        std::uint32_t counter = 0, reload = 0;
        bool on = false, restart = false, interrupt = false, chain = false;
    };
    std::uint32_t scaler = 0, scaler_reload = 0;
    std::vector<Timer> timers;
    std::vector<std::pair<std::uint64_t, std::uint32_t>> raised;

    void cycle(std::uint64_t now)
    {
        if (scaler-- != 0) {
            return;
        }
        scaler = scaler_reload;
        bool before = false;
        for (std::size_t i = 0; i < timers.size(); i++) {
            Timer &t = timers[i];
            const bool counts = t.on && (!t.chain || i == 0 || before);
            before = counts && t.counter == 0;
            if (!counts) {
                continue;
            }
            if (t.counter-- == 0) {
                t.on = t.restart;
                t.counter = t.restart ? t.reload : t.counter;
                if (t.interrupt) {
                    raised.emplace_back(now, static_cast<std::uint32_t>(i + 1));
                }
            }
        }
    }
};

TEST(Gptimer, counts_as_one_that_counts_every_cycle)
{
    std::mt19937 random(1);
    const auto up_to = [&](std::uint32_t n) { return static_cast<std::uint32_t>(random() % (n + 1)); };
    for (int run = 0; run < 300; run++) {
        const std::uint32_t n = 1 + up_to(3);
        Bench b({.timers = n, .interrupt = 1, .scaler = up_to(5)});
        Slow slow;
        slow.scaler = slow.scaler_reload = b.timer.read(0x04);
        slow.timers.resize(n);
        std::vector<std::pair<std::uint64_t, std::uint32_t>> raised;
        for (int change = 0; change < 6; change++) {
            const std::uint32_t i = up_to(n - 1), at = 16 + 16 * i;
            Slow::Timer &t = slow.timers[i];
            t.reload = up_to(12);
            t.on = up_to(3) != 0;
            t.restart = up_to(1) != 0;
            t.interrupt = up_to(1) != 0;
            t.chain = up_to(2) == 0;
            t.counter = t.reload;
            b.timer.write(at + 4, t.reload);
            b.timer.write(at + 8, load | (t.on ? enable : 0u) | (t.restart ? restart : 0u) |
                                      (t.interrupt ? interrupt : 0u) | (t.chain ? chain : 0u));
            const std::uint64_t until = b.host.now + up_to(400);
            for (std::uint64_t now = b.host.now + 1; now <= until; now++) {
                slow.cycle(now);
            }
            while (b.timer.next_event() <= until) {
                b.host.now = b.timer.next_event();
                b.timer.act();
                for (const std::uint32_t line : b.host.take()) {
                    raised.emplace_back(b.host.now, line);
                }
            }
            b.host.now = until;
            ASSERT_EQ(b.timer.read(0x00), slow.scaler);
            for (std::uint32_t k = 0; k < n; k++) {
                ASSERT_EQ(b.timer.read(16 + 16 * k), slow.timers[k].counter) << k;
                ASSERT_EQ(b.timer.read(24 + 16 * k) & enable, slow.timers[k].on ? enable : 0u) << k;
            }
            ASSERT_TRUE(b.host.take().empty()) << "an interrupt was late";
        }
        ASSERT_EQ(raised, slow.raised);
    }
}

} // namespace gptimer_test
} // namespace fledge::emulator
