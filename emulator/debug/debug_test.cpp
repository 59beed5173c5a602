// SPDX-License-Identifier: Apache-2.0
// What needs no compiler for the machine; emulator/python has the tests with gdb and with programs.
#include "emulator/board.h"
#include "emulator/cpu/instruction.h"
#include "emulator/debug/history.h"
#include "emulator/debug/observer.h"
#include "emulator/debug/trace.h"
#include "emulator/report.h"

#include <fstream>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <random>
#include <unistd.h>

namespace fledge::emulator {
namespace debug_test {

using testing::ElementsAre;
using testing::HasSubstr;

constexpr std::uint32_t begin = 0x40000000, data = 0x40001000;
constexpr std::uint32_t loop[] = {
    0x82006001, // add %g1, 1, %g1
    0xC2208000, // st %g1, [%g2]
    0x10BFFFFE, // ba back to the first
    0x01000000, // nop
};

struct Debug : testing::Test {
    Debug()
    {
        for (std::uint32_t i = 0; i < 4; i++) {
            std::byte bytes[4];
            for (std::uint32_t k = 0; k < 4; k++) {
                bytes[k] = std::byte(loop[i] >> (24 - 8 * k) & 255);
            }
            machine.poke(begin + 4 * i, bytes);
        }
        state.pc = begin;
        state.npc = begin + 4;
        state.globals[2] = data;
    }

    static BoardDescription board()
    {
        return BoardDescription::parse("name = \"small\"\nclock = 1000000\ntiming = \"plain\"\nfpu = \"grfpu\"\n"
                                       "[ram]\nbase = 0x40000000\nsize = 0x10000\n"
                                       "[[device]]\nkind = \"irqmp\"\naddress = 0x80000200\n",
                                       "small.toml");
    }
    auto now() const { return std::tuple(state.pc, state.npc, state.globals[1], state.cycles, word(data)); }
    std::uint32_t word(std::uint32_t address) const
    {
        std::uint32_t value = 0;
        std::byte bytes[4];
        machine.peek(address, bytes);
        for (const std::byte b : bytes) {
            value = value << 8 | static_cast<std::uint32_t>(b);
        }
        return value;
    }

    Machine machine{board(), EngineKind::interpreter};
    CpuState &state = machine.core().state;
};

TEST_F(Debug, EachStepBackLeadsToTheStateBefore)
{
    History history(machine, 10'000, 4); // a snapshot after each 10 instructions, of which few are kept
    std::vector<decltype(now())> states;
    for (int i = 0; i < 100; i++) {
        states.push_back(now());
        EXPECT_EQ(history.run_until(machine.now() + 1000), StopReason::time);
    }
    for (int i = 0; i < 100; i++) {
        ASSERT_TRUE(history.step_back());
        ASSERT_EQ(now(), states.back());
        states.pop_back();
    }
    EXPECT_FALSE(history.step_back());
    for (int i = 0; i < 17; i++) {
        history.step(); // and forth again
    }
    EXPECT_EQ(state.globals[1], 5u);
}

TEST_F(Debug, GoingBackFindsTheLastBreakpointAndTheLastWatchedAccess)
{
    History history(machine, 10'000);
    history.run_until(102'000);
    machine.set_breakpoint(begin + 8, true);
    EXPECT_EQ(history.continue_back(), StopReason::breakpoint);
    EXPECT_EQ(state.pc, begin + 8);
    EXPECT_EQ(state.cycles, 98u);
    EXPECT_EQ(history.continue_back(), StopReason::breakpoint);
    EXPECT_EQ(state.cycles, 94u);
    machine.set_breakpoint(begin + 8, false);
    machine.set_watchpoint(data, 4, false, true, true);
    EXPECT_EQ(history.continue_back(), StopReason::watchpoint);
    EXPECT_EQ(state.pc, begin + 4); // in front of the store
    EXPECT_EQ(word(data), 23u);
    EXPECT_EQ(state.globals[1], 24u);
    machine.set_watchpoint(data, 4, false, true, false);
    EXPECT_EQ(history.continue_back(), StopReason::time);
    EXPECT_EQ(state.cycles, 0u);
}

TEST_F(Debug, AChangeByTheUserBeginsAnotherFuture)
{
    History history(machine, 10'000);
    history.run_until(50'000);
    for (int i = 0; i < 6; i++) {
        EXPECT_TRUE(history.step_back());
    }
    EXPECT_EQ(state.globals[1], 11u);
    state.globals[1] = 1000;
    history.changed();
    history.run_until(50'000);
    EXPECT_EQ(state.globals[1], 1002u);
    for (int i = 0; i < 6; i++) {
        EXPECT_TRUE(history.step_back());
    }
    EXPECT_EQ(state.globals[1], 1000u);
    EXPECT_TRUE(history.step_back());
    EXPECT_EQ(state.globals[1], 11u);
}

TEST_F(Debug, AnObserverSeesEachStep)
{
    struct Seen final : Observer {
        std::vector<std::string> lines;
        void executed(const Executed &step) override
        {
            lines.push_back(std::to_string(step.begun) + " " + disassemble(step.pc, step.word) +
                            (step.trapped ? " traps" : ""));
        }
    } seen;
    machine.observe(&seen);
    state.psr &= ~psr::enable_traps;
    machine.run_until(4000);
    state.pc = 3; // there is no instruction
    machine.run_until(6000);
    EXPECT_THAT(seen.lines,
                ElementsAre("0 add %g1, 1, %g1", "1 st %g1, [%g2]", "2 ba 0x40000000", "3 nop", "4 unimp 0 traps"));
    machine.observe(nullptr);
    const std::size_t n = seen.lines.size();
    machine.run_until(10'000);
    EXPECT_EQ(seen.lines.size(), n);
}

TEST_F(Debug, ATraceShowsAddressesResultsAndTraps)
{
    const std::string path = ::testing::TempDir() + "debug_trace_" + std::to_string(getpid());
    constexpr std::string_view records = "S3094000000001000000B5\n"; // a nop
    const Program none(std::as_bytes(std::span(records)), "none");
    {
        Trace trace(path, none, 0, 1000);
        machine.observe(&trace);
        machine.run_until(2000);
        state.pc = 3;
        machine.run_until(3000);
        machine.observe(nullptr);
    }
    std::ifstream file(path);
    const std::string text{std::istreambuf_iterator<char>(file), {}};
    std::remove(path.c_str());
    EXPECT_THAT(text, HasSubstr("add %g1, 1, %g1  %g1=00000001\n"));
    EXPECT_THAT(text, HasSubstr("st %g1, [%g2]  [40001000]  %g1=00000001\n"));
    EXPECT_THAT(text, HasSubstr("traps: instruction_access_exception (0x01)\n"));
}

TEST_F(Debug, WhatTheProcessorHasIsNeverAWord)
{
    EXPECT_EQ(disassemble(0, 0x87444000), "rd %asr17, %g3");
    EXPECT_EQ(disassemble(0, 0xC2808163), "lda [%g2 + %g3] 0x0b, %g1");
    std::mt19937 random(1);
    for (int n = 0; n < 200'000; n++) {
        const auto word = static_cast<std::uint32_t>(random());
        const Op op = decode(word).op;
        if (op != Op::illegal && op != Op::cpop && op != Op::cbccc && op != Op::fpop_unimplemented) {
            ASSERT_FALSE(disassemble(0, word).starts_with(".word")) << std::hex << word;
        }
    }
}

TEST_F(Debug, WhatCannotBeWatchedIsRefused)
{
    EXPECT_THROW(machine.set_watchpoint(0x80000200, 4, true, true, true), Error) << "a device";
    EXPECT_THROW(machine.set_watchpoint(data, 0, true, true, true), Error);
    EXPECT_THROW(machine.set_watchpoint(data, 4, false, false, true), Error);
    EXPECT_THROW(machine.set_watchpoint(0x4000FFFE, 4, true, true, true), Error) << "half of it is there";
}

TEST_F(Debug, RegistersOfDevicesAreReadAndWritten)
{
    EXPECT_EQ(word(0x80000240), 0u);
    const std::byte mask[4] = {std::byte{0}, std::byte{0}, std::byte{1}, std::byte{0x40}};
    EXPECT_TRUE(machine.poke(0x80000240, mask));
    EXPECT_EQ(word(0x80000240), 0x140u);
    EXPECT_FALSE(machine.poke(0x80000244, mask)) << "no register";
    const auto found = device_words(machine);
    ASSERT_EQ(found.size(), 1u);
    EXPECT_EQ(found[0].name, "irqmp");
    EXPECT_EQ(found[0].words.at(3).name, "mask");
    EXPECT_EQ(found[0].words.at(3).value, 0x140u);
}

} // namespace debug_test
} // namespace fledge::emulator
