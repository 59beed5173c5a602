// SPDX-License-Identifier: Apache-2.0
#include "emulator/backend.h"

#include <random>

#include <gtest/gtest.h>

#include "emulator/devices/register_space.h"
#include "emulator/error.h"
#include "emulator/report.h"
#include "emulator/testing/board.h"
#include "emulator/testing/program.h"
#include "emulator/testing/register_boards.h"
#include "tests/error_of.h"

namespace fledge::emulator {
namespace loop_test {

using namespace testing;

constexpr Ns ms = 1'000'000;
constexpr std::uint32_t clock_at = 0xA0000000, work = data, start_ups = data + 4, finished = data + 8;

/// Branch to a word of the program from another one.
std::uint32_t branch_if(std::uint32_t condition, int from, int to)
{
    return branch(2, condition, false, to - from);
}

/// Sleeps until a tick; then does 1 + `work` rounds of three instructions, answers, and counts it as `finished`. Counts
/// its starts at `start_ups`.
Words flight()
{
    constexpr std::uint32_t not_equal = 9;
    Words w = store(0x80000240, 1u << 10) + set(g(3), clock_at) + set(g(5), data) +
              Words{ld(g(1), g(5), 4), add(g(1), g(1), 1), st(g(1), g(5), 4)};
    const int loop = static_cast<int>(w.size());
    w = w + Words{ld(g(1), g(3), 0),
                  ld(g(2), g(3), 4),
                  with_register(2, 0x14, 0, g(1), g(2)),
                  branch_if(not_equal, loop + 3, loop + 8),
                  nop,
                  power_down,
                  branch_if(8, loop + 6, loop),
                  nop};
    w = w + Words{ld(g(4), g(5), 0),
                  subcc(g(4), g(4), 1),
                  branch(2, 14, false, -1),
                  nop,
                  st(g(1), g(3), 4),
                  ld(g(4), g(5), 8),
                  add(g(4), g(4), 1),
                  st(g(4), g(5), 8),
                  branch_if(8, loop + 16, loop),
                  nop};
    return w;
}

struct Bench {
    explicit Bench(const Words &program = flight(), EngineKind engine = EngineKind::threaded,
                   const BoardDescription &board = test_board())
        : m(board, engine), space(*m.device_of<RegisterSpace>())
    {
        space.make(boards);
        m.load(Program(program_file(program), "flight"));
        backend.emplace(m);
    }
    const RegisterWindow &clock() { return *space.clock(); }
    registers::Wait tick(Ns t, Ns dt)
    {
        register_clock_start(&clock(), {t, dt});
        return backend->await_done(clock(), {});
    }
    std::uint32_t word(std::uint32_t address)
    {
        std::uint64_t value = 0;
        m.bus().read(address, 4, value);
        return static_cast<std::uint32_t>(value);
    }
    FlightLoop::State &state() { return backend->loop.state; }

    Machine m;
    RegisterSpace &space;
    std::optional<MachineBackend> backend;
};

using registers::Wait;

TEST(FlightLoop, the_machine_follows_simulated_time)
{
    Bench b;
    EXPECT_EQ(b.tick(-1, 0), Wait::done);
    EXPECT_LT(b.m.now(), ms) << "it was switched on, and answered";
    for (Ns t = 0; t < 100 * ms; t += 10 * ms) {
        EXPECT_EQ(b.tick(t, t > 0 ? 10 * ms : 0), Wait::done);
        EXPECT_NEAR(static_cast<double>(b.m.now()), static_cast<double>(FlightLoop::boot_time + t), 30'000.0);
    }
    EXPECT_EQ(b.state().ticks, 10u);
    EXPECT_EQ(b.state().missed, 0u);
    EXPECT_EQ(b.word(start_ups), 1u);
    EXPECT_LT(b.m.instructions(), 500u) << "it sleeps between ticks";
    EXPECT_EQ(b.state().cycles, 10 * b.state().cycles_most) << "each tick is the same work";
}

TEST(FlightLoop, the_time_of_flight_is_that_of_its_work)
{
    Bench b;
    b.tick(-1, 0);
    b.tick(0, 0);
    const std::uint64_t first = b.state().cycles;
    b.m.bus().write(work, 4, 1000);
    b.tick(10 * ms, 10 * ms);
    EXPECT_EQ(b.state().cycles_most, first + 3 * 1000);
}

TEST(FlightLoop, flight_that_is_late_misses_its_tick)
{
    Bench b;
    b.tick(-1, 0);
    b.tick(0, 0);
    b.m.bus().write(work, 4, 5000); // 15 ms
    EXPECT_EQ(b.tick(10 * ms, 10 * ms), Wait::done) << "the loop answers for it";
    EXPECT_EQ(b.state().missed, 1u);
    EXPECT_EQ(b.m.now(), FlightLoop::boot_time + 20 * ms);
    EXPECT_TRUE(register_clock_is_done(&b.clock()));
    b.m.bus().write(work, 4, 1);
    b.tick(20 * ms, 10 * ms);
    b.tick(30 * ms, 10 * ms);
    EXPECT_EQ(b.state().missed, 1u);
}

TEST(FlightLoop, registers_that_answer_late_take_time_and_then_ticks)
{
    const auto flown = [](int wait) {
        std::string text = board_text;
        text.insert(text.find("tick = 10"), "wait = " + std::to_string(wait) + "\n");
        Bench b(flight(), EngineKind::threaded, BoardDescription::parse(text, "late.toml"));
        for (Ns t = -10 * ms; t < 200 * ms; t += 10 * ms) {
            EXPECT_EQ(b.tick(t < 0 ? -1 : t, t <= 0 ? 0 : 10 * ms), Wait::done);
        }
        EXPECT_EQ(b.m.resets(), 0u);
        EXPECT_EQ(b.state().ticks, 20u);
        return std::pair(b.state().missed, b.state().cycles);
    };
    const auto [none, cycles] = flown(0);
    const auto [some, more] = flown(100);
    EXPECT_EQ(none + some, 0u);
    EXPECT_EQ((more - cycles) % (20u * 100), 0u) << "as many accesses in each tick";
    EXPECT_GE(more - cycles, 20u * 300);
    EXPECT_GT(flown(5000).first, 5u);
    EXPECT_GT(flown(1'000'000).first, 15u);
}

TEST(FlightLoop, the_next_instant_may_be_known)
{
    Bench b;
    b.backend->loop.next = [](Ns t) { return t + 3 * ms; };
    b.tick(-1, 0);
    b.tick(0, 0);
    b.m.bus().write(work, 4, 100'000);
    b.tick(10 * ms, 10 * ms);
    EXPECT_EQ(b.m.now(), FlightLoop::boot_time + 13 * ms);
}

TEST(FlightLoop, a_lost_tick_is_not_seen_by_flight)
{
    Bench b;
    b.tick(-1, 0);
    b.tick(0, 0);
    const std::uint64_t before = b.m.instructions();
    b.state().lose = 2;
    b.tick(10 * ms, 10 * ms);
    b.tick(20 * ms, 10 * ms);
    EXPECT_LT(b.m.instructions(), before + 12) << "it goes to sleep";
    EXPECT_EQ(b.state().missed, 2u);
    b.tick(30 * ms, 10 * ms);
    EXPECT_EQ(b.state().missed, 2u);
}

TEST(FlightLoop, the_outside_resets_the_computer)
{
    Bench b;
    b.tick(-1, 0);
    b.tick(0, 0);
    register_clock_reset(&b.clock());
    EXPECT_EQ(b.word(finished), 1u) << "after its answer it stands";
    // The computer was down for a while.
    EXPECT_EQ(b.tick(50 * ms, 10 * ms), Wait::done);
    EXPECT_EQ(b.m.resets(), 1u);
    EXPECT_EQ(b.word(start_ups), 2u) << "memory was kept";
    EXPECT_EQ(b.word(finished), 2u) << "it finished its tick before the reset";
    EXPECT_GE(b.m.now(), FlightLoop::boot_time + 50 * ms);
    EXPECT_EQ(b.state().missed, 0u);
    b.tick(60 * ms, 10 * ms);
    EXPECT_EQ(b.m.resets(), 1u);
}

TEST(FlightLoop, the_watchdog_brings_flight_back)
{
    // Nothing stops the watchdog: it ends 25 ms after each start.
    const Words start_watchdog = store(0x80000304, 0) + store(0x80000334, 24'999) + store(0x80000338, 5);
    Bench b(start_watchdog + flight());
    b.tick(-1, 0);
    b.tick(0, 0);
    b.m.bus().write(work, 4, 1'000'000);
    for (Ns t = 10 * ms; t <= 40 * ms; t += 10 * ms) {
        EXPECT_EQ(b.tick(t, 10 * ms), Wait::done);
    }
    EXPECT_GE(b.state().missed, 1u);
    EXPECT_GE(b.m.watchdog_resets(), 1u);
    EXPECT_GE(b.word(start_ups), 2u);
}

TEST(FlightLoop, a_processor_in_its_error_mode_is_gone)
{
    Bench b(flight());
    b.tick(-1, 0);
    const std::uint32_t illegal = 0;
    b.m.poke(base, std::as_bytes(std::span(&illegal, 1)));
    b.m.core().state.psr &= ~psr::enable_traps;
    b.m.core().state.pc = base;
    EXPECT_EQ(b.tick(0, 0), Wait::gone);
}

TEST(FlightLoop, a_campaign_goes_back_to_a_snapshot)
{
    Bench b;
    b.tick(-1, 0);
    b.tick(0, 0);
    const auto snapshot = b.m.snapshot();
    const FlightLoop::State state = b.state();
    const auto fly = [&] {
        for (Ns t = 10 * ms; t <= 100 * ms; t += 10 * ms) {
            b.tick(t, 10 * ms);
        }
        return std::pair(b.m.core().state.cycles, b.state().ticks);
    };
    const auto once = fly();
    b.m.restore(*snapshot);
    b.state() = state;
    EXPECT_EQ(fly(), once);
}

/// A bench whose registers are in memory of the outside, as they are in a shared file.
struct AttachedBench : Bench {
    explicit AttachedBench(EngineKind engine, const Words &program = flight(),
                           std::span<const RegisterBoard *const> with = boards)
        : Bench(program, engine)
    {
        std::vector<RegisterWindow> windows;
        for (const RegisterBoard *board : with) {
            memory.emplace_back(board->size / 8);
            windows.push_back(register_window(board, reinterpret_cast<std::uint32_t *>(memory.back().data())));
        }
        backend.reset();
        space.attach(windows);
        backend.emplace(m);
    }
    std::vector<std::vector<std::uint64_t>> memory;
};

TEST(FlightLoop, another_program_goes_on_from_a_snapshot)
{
    // Every 10 ms a tick, of random work: some are missed, and some follow a reset.
    std::mt19937 rng(7);
    std::vector<std::pair<std::uint32_t, bool>> plan;
    for (int i = 0; i < 60; i++) {
        plan.emplace_back(rng() % 5000, rng() % 7 == 0);
    }
    const auto fly = [&](Bench &b, int from, int to) {
        for (int i = from; i < to; i++) {
            b.m.bus().write(work, 4, plan[static_cast<std::size_t>(i)].first);
            if (plan[static_cast<std::size_t>(i)].second) {
                register_clock_reset(&b.clock());
            }
            b.tick(i * 10 * ms, i > 0 ? 10 * ms : 0);
        }
    };
    AttachedBench whole(EngineKind::threaded);
    whole.tick(-1, 0);
    std::vector<std::vector<std::byte>> snapshots;
    for (int i = 0; i < 60; i++) {
        snapshots.push_back(whole.backend->loop.save());
        fly(whole, i, i + 1);
    }
    EXPECT_GT(whole.state().missed, 5u);
    EXPECT_GT(whole.m.resets(), 3u);
    const auto end = whole.backend->loop.save();
    for (const int i : {0, 1, 17, 33, 34, 35, 59}) {
        AttachedBench other(i % 2 ? EngineKind::translator : EngineKind::interpreter);
        other.backend->loop.restore(snapshots[static_cast<std::size_t>(i)]);
        fly(other, i, 60);
        EXPECT_EQ(other.state().missed, whole.state().missed);
        EXPECT_EQ(other.m.core().state.cycles, whole.m.core().state.cycles);
        EXPECT_EQ(other.memory, whole.memory);
        EXPECT_TRUE(other.backend->loop.save() == end) << i;
    }
}

TEST(FlightLoop, a_snapshot_of_others_is_refused)
{
    AttachedBench b(EngineKind::threaded);
    b.tick(-1, 0);
    auto snapshot = b.backend->loop.save();
    const auto refused = [&](FlightLoop &loop, std::span<const std::byte> bytes) -> std::string {
        return error_of<Error>([&] { loop.restore(bytes); });
    };
    for (const std::size_t n : {std::size_t{0}, std::size_t{50}, std::size_t{300}, snapshot.size() - 1}) {
        EXPECT_NE(refused(b.backend->loop, std::span(snapshot).first(n)).find("truncated"), std::string::npos) << n;
    }
    AttachedBench program(EngineKind::threaded, flight() + Words{nop});
    EXPECT_EQ(refused(program.backend->loop, snapshot),
              "the snapshot is of another program than the one that was loaded");
    RegisterBoard changed = other_board;
    changed.hash++;
    const RegisterBoard *const others[] = {&clock_board, &changed};
    AttachedBench registers(EngineKind::threaded, flight(), others);
    EXPECT_EQ(refused(registers.backend->loop, snapshot),
              "the snapshot is of other boards than those in the register space");
    EXPECT_EQ(refused(b.backend->loop, snapshot), "");
    snapshot[14] = std::byte{'9'};
    EXPECT_EQ(refused(b.backend->loop, snapshot), "this is no snapshot of flight, or one of another version");
}

TEST(FlightLoop, the_program_ends_with_the_run)
{
    // Ends as soon as the outside has stopped: `ta 0` with traps disabled, its status in %o0.
    const auto program = [](std::int32_t status) {
        constexpr std::uint32_t equal = 1;
        return set(g(3), clock_at) + Words{ld(g(1), g(3), REGISTER_CLOCK_STOP),
                                           subcc(0, g(1), 0),
                                           branch(2, equal, false, -2),
                                           mov(o(0), status),
                                           wr_psr(0, 0xC6),
                                           nop,
                                           nop,
                                           nop,
                                           mov(o(0), status),
                                           trap_always(0),
                                           nop};
    };
    Bench good(program(0)), bad(program(3));
    for (Bench *b : {&good, &bad}) {
        b->tick(-1, 0);
        register_clock_stop(&b->clock());
    }
    EXPECT_TRUE(good.backend->loop.finish());
    EXPECT_FALSE(bad.backend->loop.finish());
    int status = 0;
    std::string why;
    EXPECT_TRUE(program_ended(bad.m, nullptr, status, why));
    EXPECT_EQ(status, 3);
    Bench never_ends;
    never_ends.tick(-1, 0);
    EXPECT_FALSE(never_ends.backend->loop.finish());
}

TEST(FlightLoop, a_board_without_registers_is_refused)
{
    Machine m(test_board(), EngineKind::interpreter);
    EXPECT_THROW(FlightLoop loop(m), Error);
}

} // namespace loop_test
} // namespace fledge::emulator
