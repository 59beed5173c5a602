// SPDX-License-Identifier: Apache-2.0
#include "emulator/machine.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cstring>
#include <thread>

#include "emulator/devices/apbuart.h"
#include "emulator/devices/gptimer.h"
#include "emulator/devices/irqmp.h"
#include "emulator/devices/register_space.h"
#include "emulator/elf.h"
#include "emulator/snapshot.h"
#include "emulator/testing/board.h"
#include "emulator/testing/program.h"
#include "emulator/testing/register_boards.h"
#include "tests/error_of.h"

namespace fledge::emulator {
namespace machine_test {

using namespace testing;
using ::testing::HasSubstr;

/// A loop that counts in %g7, and at `data`, for ever.
const Words counter = set(g(1), data) + Words{add(g(7), g(7), 1), st(g(7), g(1), 0), ba(-2), nop};

class OnMachine : public ::testing::TestWithParam<EngineKind> {
protected:
    Machine m{test_board(), GetParam()};

    void start(const Words &words) { m.load(Program(program_file(words), "p")); }
    std::uint32_t r(std::uint32_t n) { return Banks(m.core().state)[n]; }
    std::uint32_t word(std::uint32_t address)
    {
        std::array<std::byte, 4> b{};
        EXPECT_TRUE(m.peek(address, b));
        return std::to_integer<std::uint32_t>(b[0]) << 24 | std::to_integer<std::uint32_t>(b[1]) << 16 |
               std::to_integer<std::uint32_t>(b[2]) << 8 | std::to_integer<std::uint32_t>(b[3]);
    }
};

std::string name_of(const ::testing::TestParamInfo<EngineKind> &engine)
{
    static constexpr std::array<const char *, 3> names{"interpreter", "threaded", "translator"};
    return names[static_cast<std::size_t>(engine.param)];
}

INSTANTIATE_TEST_SUITE_P(Engines, OnMachine,
                         ::testing::Values(EngineKind::interpreter, EngineKind::threaded, EngineKind::translator),
                         name_of);

TEST_P(OnMachine, time_is_instructions)
{
    start(counter);
    EXPECT_EQ(m.run_until(1'000'000), StopReason::time);
    EXPECT_EQ(m.now(), 1'000'000);
    EXPECT_EQ(m.instructions(), 1000u);
    EXPECT_EQ(m.run_to_instruction(1234), StopReason::time);
    EXPECT_EQ(m.instructions(), 1234u);
    EXPECT_EQ(m.step(), StopReason::time);
    EXPECT_EQ(m.instructions(), 1235u);
}

TEST_P(OnMachine, a_program_in_ram_finds_what_a_boot_loader_leaves)
{
    start(counter);
    for (int i = 1; i <= 2; i++) {
        constexpr std::uint32_t expected = psr::enable_fpu | psr::supervisor | psr::previous_supervisor;
        EXPECT_EQ(m.core().state.psr, psr::version | expected | psr::enable_traps);
        EXPECT_EQ(r(14) % 8, 0u);
        m.run_until(i * 1'000'000);
        std::uint64_t count = 0;
        m.bus().read(0x80000310, 4, count);
        EXPECT_EQ(count, 0xFFFFFFFFu - 1000) << "the first timer counts microseconds";
        m.reset();
    }
}

TEST_P(OnMachine, a_timer_interrupts_a_processor_that_sleeps)
{
    start(store(0x80000240, 1u << 6) + store(0x80000304, 0) + store(0x80000314, 9999) + store(0x80000318, 0xF) +
          Words{power_down, nop, ba(-2), nop});
    m.run_until(1'000'000'000);
    EXPECT_EQ(r(g(6)), 99u) << "every 10 ms, the first 10 ms after the start";
    EXPECT_LT(m.instructions(), 1000u);
    EXPECT_EQ(m.core().state.mode, Mode::power_down);
}

TEST_P(OnMachine, a_program_sees_the_time_of_its_own_access)
{
    // Free-running: %g4 - %g5 is the difference of two readings, five instructions apart.
    start(store(0x80000304, 0) + store(0x80000324, 0xFFFFFFFF) + store(0x80000328, 7) + set(g(1), 0x80000320) +
          Words{ld(g(4), g(1), 0), nop, nop, nop, nop, ld(g(5), g(1), 0), ba(0), nop});
    m.run_until(100'000);
    EXPECT_EQ(r(g(4)) - r(g(5)), 5u);
}

TEST_P(OnMachine, a_device_that_answers_late_takes_time)
{
    std::string text = board_text;
    text.insert(text.find("interrupt = 6"), "wait = 100\n");
    const Words program =
        set(g(1), 0x80000310) +
        Words{ld(g(4), g(1), 0), nop, nop, ld(g(5), g(1), 0), st(g(5), g(1), 4), ld(g(7), g(1), 0), ba(0), nop};
    const BoardDescription board = BoardDescription::parse(text, "late.toml");
    Machine late(board, GetParam());
    late.load(Program(program_file(program), "p"));
    late.run_until(1'000'000);
    Banks found(late.core().state);
    EXPECT_EQ(found[g(4)] - found[g(5)], 3u + 100);
    EXPECT_EQ(found[g(5)] - found[g(7)], 2u + 200);
}

TEST_P(OnMachine, the_uart_sends)
{
    std::string sent;
    m.device_of<Apbuart>()->transmit = [&](std::uint8_t byte) { sent += static_cast<char>(byte); };
    start(store(0x80000100, 'O') + store(0x80000100, 'K') + Words{ba(0), nop});
    m.run_until(100'000);
    EXPECT_EQ(sent, "OK");
}

TEST_P(OnMachine, an_access_to_nothing_traps_and_is_recorded)
{
    start(store(0x80000240, 0) + store(0x60000000, 1) + store(0x100, 1) + Words{ba(0), nop});
    m.run_until(100'000);
    EXPECT_EQ(r(g(6)), 2u);
    std::uint64_t address = 0;
    m.bus().read(0x80000F04, 4, address);
    EXPECT_EQ(address, 0x60000000u);
}

TEST_P(OnMachine, a_hole_of_the_apb_answers)
{
    start(set(g(1), 0x80000500) + Words{mov(g(4), 7), ld(g(4), g(1), 0), st(g(1), g(1), 0), ba(0), nop});
    m.run_until(100'000);
    EXPECT_EQ(r(g(6)), 0u);
    EXPECT_EQ(r(g(4)), 0u);
}

TEST_P(OnMachine, ancillary_registers_count_cycles_since_the_reset)
{
    constexpr std::uint32_t rdasr = 0x28;
    start({with_number(2, 0x30, 22, 0, 0), with_register(2, rdasr, g(4), 22, 0), with_register(2, rdasr, g(5), 23, 0),
           nop, nop, with_register(2, rdasr, l(0), 23, 0), ba(0), nop});
    m.run_until(100'000);
    const std::uint32_t first = r(g(5));
    EXPECT_EQ(r(g(4)), 0u);
    EXPECT_EQ(r(l(0)), first + 3);
    m.reset();
    m.run_until(200'000);
    EXPECT_EQ(r(g(5)), first);
}

TEST_P(OnMachine, a_store_beside_code_leaves_it_and_one_into_it_changes_it)
{
    // The loop counts in %g4, stores %g4 into the word behind itself, and, when %g5 is set, a nop into itself.
    const std::uint32_t at = code + 4 * 7;
    start({call(1), nop, add(g(4), g(4), 1), st(g(4), o(7), 4 * 11), subcc(g(0), g(5), 0), branch(2, 1, false, -3), nop,
           sethi(g(1), nop), st(g(1), o(7), 4 * 2), ba(-7), nop, 0});
    m.run_until(100'000);
    const std::uint32_t count = r(g(4));
    EXPECT_GT(count, 10u);
    EXPECT_LE(count - word(at + 4 * 11), 1u);
    Banks(m.core().state)[g(5)] = 1;
    m.run_until(200'000);
    EXPECT_LE(r(g(4)), count + 1) << "the addition has become a nop";
    EXPECT_EQ(word(at + 4 * 2), nop);
}

TEST_P(OnMachine, a_snapshot_is_the_same_point_again)
{
    start(counter);
    m.run_to_instruction(501);
    const auto first = m.snapshot();
    m.run_until(1'000'000);
    const CpuState at_end = m.core().state;
    const std::uint32_t count = word(data);
    const auto second = m.snapshot();
    for (int i = 0; i < 3; i++) {
        m.restore(*first);
        EXPECT_EQ(m.instructions(), 501u);
        EXPECT_LT(word(data), count);
        m.run_until(1'000'000);
        EXPECT_EQ(word(data), count);
        EXPECT_EQ(std::memcmp(&m.core().state, &at_end, sizeof at_end), 0);
        m.restore(*second);
        EXPECT_EQ(word(data), count);
    }
    EXPECT_EQ(first->pages[base / page_size - base / page_size + 1], second->pages[1]) << "code did not change";
    EXPECT_NE(first->pages[8], second->pages[8]);
    EXPECT_EQ(first->pages[15], nullptr) << "nothing is there";
}

TEST_P(OnMachine, a_snapshot_has_devices_memory_errors_and_registers)
{
    RegisterSpace *space = m.device_of<RegisterSpace>();
    space->make(boards);
    start(store(0x80000304, 9) + store(0x80000314, 9999) + store(0x80000318, 0xB) + counter);
    m.run_until(1'000'000);
    register_store(&space->windows()[1], 32, 77);
    m.bus().flip(data + 64, {1, 0});
    const auto snapshot = m.snapshot();
    const auto file = m.save();
    m.run_until(2'000'000);
    register_store(&space->windows()[1], 32, 0);
    m.bus().set_flips({});
    m.restore(*snapshot);
    EXPECT_EQ(register_load(&space->windows()[1], 32), 77u);
    EXPECT_EQ(m.bus().flips().size(), 1u);

    Machine other(test_board(), GetParam());
    other.device_of<RegisterSpace>()->make(boards);
    other.load_snapshot(file);
    m.run_until(3'000'000);
    other.run_until(3'000'000);
    EXPECT_EQ(std::memcmp(&m.core().state, &other.core().state, sizeof(CpuState)), 0);
    EXPECT_EQ(m.save(), other.save());
    other.reset();
    other.run_until(4'000'000);
    EXPECT_GT(Banks(other.core().state)[g(7)], 0u) << "it has the program, too";
}

TEST_P(OnMachine, code_that_a_snapshot_brings_back_is_executed)
{
    start(counter);
    m.run_until(100'000);
    const auto before = m.snapshot();
    // %g7 counts down from now on.
    const std::uint32_t at = code + 4 * 9;
    ASSERT_EQ(word(at), add(g(7), g(7), 1)) << "the counter is elsewhere";
    const std::uint32_t down = __builtin_bswap32(add(g(7), g(7), -1));
    m.poke(at, std::as_bytes(std::span(&down, 1)));
    const std::uint32_t present = r(g(7));
    m.run_until(200'000);
    EXPECT_LT(static_cast<std::int32_t>(r(g(7))), static_cast<std::int32_t>(present));
    m.restore(*before);
    m.run_until(200'000);
    EXPECT_GT(r(g(7)), present);
}

TEST_P(OnMachine, a_reset_starts_the_program_again_and_time_goes_on)
{
    start(counter);
    m.run_until(1'000'000);
    const std::uint32_t broken = 0;
    m.poke(code, std::as_bytes(std::span(&broken, 1)));
    m.poke(data + 4, std::as_bytes(std::span("kept", 4)));
    unsigned calls = 0;
    m.on_reset = [&] { calls++; };
    m.reset();
    EXPECT_EQ(m.now(), 1'000'000);
    EXPECT_EQ(r(g(7)), 0u);
    EXPECT_EQ(word(data + 4), 0x6B657074u);
    EXPECT_EQ(m.resets(), 1u);
    EXPECT_EQ(calls, 1u);
    m.run_until(2'000'000);
    EXPECT_GT(r(g(7)), 100u) << "the program was copied again";
    m.reset_until(5'000'000);
    EXPECT_EQ(m.now(), 5'000'000);
}

TEST_P(OnMachine, the_watchdog_resets_a_program_that_hangs)
{
    start(store(0x80000304, 0) + store(0x80000334, 999) + store(0x80000338, 5) + counter);
    m.run_until(10'000'000);
    EXPECT_EQ(m.watchdog_resets(), 9u) << "every millisecond, and the start-up";
    EXPECT_EQ(m.resets(), 9u);
}

TEST_P(OnMachine, the_watchdog_resets_a_processor_in_its_error_mode)
{
    start(store(0x80000304, 0) + store(0x80000334, 999) + store(0x80000338, 5) +
          Words{wr_psr(0, 0xC6), nop, nop, nop, 0});
    unsigned errors = 0;
    std::string text;
    m.on_error = [&] {
        errors++;
        text = m.report();
    };
    EXPECT_EQ(m.run_until(5'000'000), StopReason::time);
    EXPECT_EQ(m.resets(), 4u);
    EXPECT_EQ(errors, 5u);
    EXPECT_THAT(text, HasSubstr("illegal_instruction (0x02) while traps are disabled"));
}

TEST_P(OnMachine, memory_may_be_cleared_by_a_reset)
{
    BoardDescription board = test_board();
    board.ram.kept = false;
    Machine cleared(board, GetParam());
    cleared.load(Program(make_elf(code, counter), "p"));
    cleared.run_until(1'000'000);
    cleared.reset();
    std::array<std::byte, 4> bytes{};
    cleared.peek(data, bytes);
    EXPECT_EQ(bytes[3], std::byte{0});
    cleared.run_until(2'000'000);
    cleared.peek(data, bytes);
    EXPECT_NE(bytes[3], std::byte{0});
}

TEST_P(OnMachine, a_program_in_rom_starts_there)
{
    m.load(Program(make_elf(0, counter), "rom"));
    EXPECT_EQ(m.core().state.pc, 0u);
    m.run_until(1'000'000);
    EXPECT_GT(word(data), 0u);
}

TEST_P(OnMachine, breakpoints_and_watchpoints_stop)
{
    start(counter);
    m.set_breakpoint(code + 4 * 9, true);
    EXPECT_EQ(m.run_until(1'000'000), StopReason::breakpoint);
    EXPECT_EQ(m.core().state.pc, code + 4 * 9);
    const std::uint32_t before = r(g(7));
    EXPECT_EQ(m.run_until(1'000'000), StopReason::breakpoint);
    EXPECT_EQ(r(g(7)), before + 1);
    EXPECT_EQ(m.run_to_instruction(1'000'000), StopReason::breakpoint);
    m.set_breakpoint(code + 4 * 9, false);
    m.set_watchpoint(data, 4, false, true, true);
    EXPECT_EQ(m.run_until(1'000'000), StopReason::watchpoint);
    EXPECT_EQ(word(data), r(g(7)));
    EXPECT_EQ(m.core().state.pc, code + 4 * 11);
    m.set_watchpoint(data, 4, false, true, false);
    EXPECT_EQ(m.run_until(1'000'000), StopReason::time);
}

TEST_P(OnMachine, code_that_is_written_from_outside_is_executed_as_it_is)
{
    start(counter);
    m.run_until(1'000'000);
    for (std::int32_t n = 1; n < 20; n++) {
        const std::uint32_t word = __builtin_bswap32(add(g(7), g(7), n)), before = r(g(7));
        EXPECT_TRUE(m.poke(code + 4 * 9, std::as_bytes(std::span(&word, 1))));
        m.run_until((n + 1) * 1'000'000);
        EXPECT_EQ(r(g(7)) - before, 250u * static_cast<std::uint32_t>(n));
    }
}

TEST_P(OnMachine, stops_where_nothing_can_be_are_refused)
{
    start(counter);
    for (const std::uint32_t address : {code + 2, 0x80000200u, 0x30000000u, 0xFFFFFFFCu}) {
        EXPECT_THROW(m.set_breakpoint(address, true), Error) << address;
        EXPECT_NO_THROW(m.set_breakpoint(address, false)) << "there is none";
    }
    EXPECT_THROW(m.set_watchpoint(0x80000200, 4, true, true, true), Error);
    EXPECT_THROW(m.set_watchpoint(data, 0, true, true, true), Error);
    EXPECT_THROW(m.set_watchpoint(data, 0xFFFFFFFF, true, true, true), Error);
    EXPECT_THROW(m.set_watchpoint(data, 4, false, false, true), Error);
    EXPECT_EQ(m.run_until(1'000'000), StopReason::time);
}

TEST_P(OnMachine, a_hook_stops_behind_the_instruction)
{
    start(counter);
    RegisterSpace *space = m.device_of<RegisterSpace>();
    space->make(boards);
    space->done = [&] { m.stop(); };
    start(store(0xA0000004, 5) + counter);
    EXPECT_EQ(m.run_until(1'000'000), StopReason::early);
    EXPECT_EQ(m.core().state.pc, code + 4 * 12) << "behind the store";
    EXPECT_EQ(m.run_until(1'000'000), StopReason::time);
}

TEST_P(OnMachine, write_protection_keeps_memory)
{
    start(store(0x80000E04, data) + store(0x80000E00, data | 1) + store(data, 5) + store(data + page_size, 6) +
          Words{ba(0), nop});
    m.run_until(100'000);
    EXPECT_EQ(r(g(6)), 1u);
    EXPECT_EQ(word(data), 0u);
    EXPECT_EQ(word(data + page_size), 6u);
}

TEST_P(OnMachine, edac_corrects_data_and_code)
{
    start(counter);
    m.run_until(100'000);
    const std::uint32_t count = r(g(7));
    m.bus().flip(data, {1u << 20, 0});
    m.bus().flip(code + 4 * 9, {1u << 3, 0});
    m.run_until(200'000);
    EXPECT_EQ(r(g(7)), count + 25);
    EXPECT_TRUE(m.bus().flips().empty()) << "the code was corrected, the data written anew";
}

TEST_P(OnMachine, without_edac_a_flip_in_code_is_executed)
{
    start(counter);
    m.run_until(100'000);
    const std::uint32_t count = r(g(7));
    m.bus().enable_edac(false);
    m.bus().flip(code + 4 * 9, {2, 0}); // add 3
    m.run_until(200'000);
    EXPECT_EQ(r(g(7)), count + 75);
}

TEST_P(OnMachine, an_uncorrectable_word_traps)
{
    start(set(g(1), data) + Words{ld(g(3), g(1), 0), ba(0), nop});
    m.bus().flip(data, {3, 0});
    m.run_until(100'000);
    EXPECT_EQ(m.core().state.trap_type, 0x09u);
    EXPECT_EQ(r(g(6)), 1u);
}

TEST_P(OnMachine, a_flipped_bus_read_is_seen_once)
{
    start(set(g(1), data) + Words{ld(g(3), g(1), 0), ld(g(4), g(1), 0), ba(0), nop});
    const auto before = m.snapshot();
    m.bus().flip_next_read(0x20);
    m.restore(*before);
    m.bus().flip_next_read(0x10);
    m.run_until(100'000);
    EXPECT_EQ(r(g(3)), 0x10u);
    EXPECT_EQ(r(g(4)), 0u);
    m.bus().flip_next_read(0x10);
    m.restore(*before);
    m.run_until(100'000);
    EXPECT_EQ(r(g(3)), 0u);
}

TEST_P(OnMachine, a_spurious_interrupt_is_taken)
{
    start(store(0x80000240, 0xFFFE) + counter);
    m.run_until(100'000);
    m.device_of<Irqmp>()->raise(5);
    m.run_until(200'000);
    EXPECT_EQ(r(g(6)), 1u);
    m.device_of<Irqmp>()->stick(1u << 5, 0);
    const std::uint32_t count = r(g(7));
    m.run_until(1'000'000);
    EXPECT_GT(r(g(6)), 100u);
    EXPECT_LE(r(g(7)), count + 1) << "nothing else gets time";
}

TEST_P(OnMachine, machines_in_threads_do_not_meet)
{
    start(counter);
    m.run_until(100'000);
    const auto snapshot = m.snapshot();
    m.run_until(3'000'000);
    std::vector<std::thread> threads;
    std::array<CpuState, 4> states;
    for (CpuState &state : states) {
        threads.emplace_back([&] {
            Machine other(test_board(), GetParam());
            for (int i = 0; i < 20; i++) {
                other.restore(*snapshot);
                other.run_until(3'000'000);
            }
            state = other.core().state;
        });
    }
    for (std::thread &thread : threads) {
        thread.join();
    }
    for (const CpuState &state : states) {
        EXPECT_EQ(std::memcmp(&m.core().state, &state, sizeof state), 0);
    }
}

TEST_P(OnMachine, an_engine_goes_on_where_another_stopped)
{
    start(counter);
    m.run_to_instruction(333);
    m.select(EngineKind::interpreter);
    m.run_to_instruction(666);
    m.select(GetParam());
    m.run_until(1'000'000);
    Machine whole(test_board(), GetParam());
    whole.load_snapshot(m.save());
    EXPECT_EQ(m.instructions(), 1000u);
    EXPECT_EQ(word(data), r(g(7)));
}

TEST(Machine, a_program_that_does_not_fit_is_refused)
{
    Machine m(test_board(), EngineKind::interpreter);
    try {
        m.load(Program(make_elf(0x4000F000, {1}, {}, 0x1000), "big.elf"));
        FAIL();
    } catch (const Error &e) {
        EXPECT_STREQ(e.what(),
                     "big.elf: a segment lies at 0x4000f000 to 0x40010003; the board has RAM at 0x40000000 to "
                     "0x4000ffff and ROM at 0x00000000 to 0x00001fff");
    }
}

TEST(Machine, snapshots_of_others_are_refused)
{
    Machine m(test_board(), EngineKind::interpreter);
    const auto snapshot = m.snapshot();
    auto file = m.save();
    BoardDescription board = test_board();
    board.hash++;
    Machine other(board, EngineKind::interpreter);
    EXPECT_THROW(other.restore(*snapshot), Error);
    EXPECT_THROW(other.load_snapshot(file), Error);
    EXPECT_NO_THROW(m.load_snapshot(file));
    const auto what = [&](std::span<const std::byte> bytes) -> std::string {
        return error_of<Error>([&] { m.load_snapshot(bytes); });
    };
    EXPECT_EQ(what(std::span(file).first(file.size() - 1)), "the snapshot is truncated or damaged");
    EXPECT_EQ(what(std::span(file).first(10)), "the snapshot is truncated");
    file[100] ^= std::byte{1};
    EXPECT_EQ(what(file), "the snapshot is truncated or damaged");
    file[0] ^= std::byte{1};
    EXPECT_EQ(what(file), "this is no snapshot, or one of another version");
    Machine with_boards(test_board(), EngineKind::interpreter);
    with_boards.device_of<RegisterSpace>()->make(boards);
    EXPECT_THROW(with_boards.restore(*snapshot), Error);
}

TEST(Machine, the_tables_show_the_devices)
{
    Machine m(test_board(), EngineKind::interpreter);
    const auto word = [&](std::uint32_t address) {
        std::uint64_t value = 0;
        EXPECT_EQ(m.bus().read(address, 4, value), Access::done);
        return static_cast<std::uint32_t>(value);
    };
    EXPECT_EQ(word(0xFFFFF000), 0x01003000u);
    EXPECT_EQ(word(0xFFFFF820) >> 12, 0xF1001u);
    EXPECT_EQ(word(0xFFFFF820) & 31, 10u);
    EXPECT_EQ(word(0x800FF000) >> 12, 0x0100Du);
    EXPECT_EQ(word(0x800FF008) >> 12, 0x01011u);
}

TEST(Machine, a_report_has_registers_and_calls)
{
    // main calls outer, outer calls inner with a window of its own, inner calls leaf without one, which fails.
    const Words words = Words{wr_psr(0, 0xC6), nop,          nop,     nop, sethi(o(6), base + 0xF000),
                              mov(i(6), 0),    mov(i(7), 0), call(3), nop, nop} + // main: 0 to 9
                        Words{save(o(6), o(6), -96), call(3), nop, nop} +         // outer: 10 to 13
                        Words{save(o(6), o(6), -96), call(3), nop, nop} +         // inner: 14 to 17
                        Words{0, nop};                                            // leaf: 18
    const auto at = [](std::uint32_t n) { return code + 4 * n; };
    const Program program(
        make_elf(code, words, {{"main", at(0), 40}, {"outer", at(10), 16}, {"inner", at(14), 16}, {"leaf", at(18), 8}}),
        "p");
    Machine m(test_board(), EngineKind::interpreter);
    m.load(program);
    m.core().state.wim = 0;
    EXPECT_EQ(m.run_until(1'000'000), StopReason::error);
    const std::string text = m.report(&program);
    EXPECT_THAT(text, HasSubstr("the processor is in its error mode, at 0x40001048 leaf\n"));
    EXPECT_THAT(text, HasSubstr("illegal_instruction (0x02) while traps are disabled; the instruction is 0x00000000"));
    EXPECT_THAT(text, HasSubstr("#0  0x40001048 leaf"));
    EXPECT_THAT(text, HasSubstr("#1  0x4000103c inner+0x4"));
    EXPECT_THAT(text, HasSubstr("#2  0x4000102c outer+0x4"));
    EXPECT_THAT(text, HasSubstr("#3  0x4000101c main+0x1c"));
    EXPECT_THAT(text, HasSubstr("%o0-7 00000000"));
    EXPECT_THAT(text, HasSubstr("4000103c\n  %l0-7")) << "the values of registers";
    EXPECT_THAT(m.report(), HasSubstr("at 0x40001048\n"));
}

TEST(Machine, a_backtrace_reads_windows_that_were_saved_in_memory)
{
    const Program program(make_elf(code, {nop}, {{"deep", code, 4}}), "p");
    Machine m(test_board(), EngineKind::interpreter);
    m.load(program);
    CpuState &s = m.core().state;
    Banks r(s);
    s.wim = 1u << 1; // the caller's window is not in the registers
    r[o(6)] = data;
    r[i(6)] = data + 96;
    r[i(7)] = code + 0x100;
    const std::array<std::uint32_t, 2> saved{__builtin_bswap32(data + 192), __builtin_bswap32(code + 0x200)};
    m.poke(data + 96 + 56, std::as_bytes(std::span(saved)));
    const std::string text = m.report();
    EXPECT_THAT(text, HasSubstr("#1  0x40001100  sp 0x40008060\n    #2  0x40001200  sp 0x400080c0\n"));
    s.traps = 1;
    s.trap_type = 0x07;
    EXPECT_THAT(m.report(), HasSubstr("the processor runs, at 0x40001000\n  the last trap was "
                                      "mem_address_not_aligned (0x07)\n"));
    // A damaged stack ends it.
    r[i(6)] = 0x12345677;
    EXPECT_THAT(m.report(), HasSubstr("#1  0x40001100"));
}

} // namespace machine_test
} // namespace fledge::emulator
