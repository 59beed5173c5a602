// SPDX-License-Identifier: Apache-2.0
// What the manual says of each instruction, with every engine that this folder has.
#include <gtest/gtest.h>

#include "emulator/cpu/step.h"
#include "emulator/testing/encode.h"
#include "emulator/testing/small_computer.h"

namespace interpreter_test {

using namespace fledge::emulator;
using namespace fledge::emulator::testing;

using Make = std::unique_ptr<Engine> (*)();

class Cpu : public ::testing::TestWithParam<Make> {
protected:
    SmallComputer c{GetParam()()};
    static constexpr std::uint32_t start = SmallComputer::start, data = SmallComputer::data;

    /// Run the program that stands at `start` for so many steps.
    Exit run(std::initializer_list<std::uint32_t> program)
    {
        c.write(c.s.pc, program);
        return c.steps(program.size());
    }
    /// Run one instruction; its trap, or 0.
    std::uint32_t trap_of(std::uint32_t word)
    {
        const CpuState before = c.s;
        c.go(start);
        c.write(start, {word});
        c.engine->invalidate(start, 4);
        c.steps(1);
        const std::uint32_t taken = c.s.traps == before.traps ? 0 : c.s.trap_type;
        if (taken != 0) {
            EXPECT_EQ(c.s.instructions, before.instructions);
            c.s.psr = before.psr;
            c.s.mode = before.mode;
        }
        return taken;
    }
    std::uint32_t icc() const { return c.core.state.psr >> 20 & 15; }
    std::uint32_t window() const { return c.core.state.psr & psr::cwp; }
};

struct Arithmetic {
    std::uint32_t op3, a, b, result;
    int nzvc = -1; ///< -1: the instruction leaves them
    std::uint32_t y = 0, y_after = 0;
    std::uint32_t nzvc_before = 0;
};

constexpr Arithmetic arithmetic[] = {
    {0x00, 1, 2, 3},
    {0x00, 0xFFFFFFFF, 2, 1},
    {0x01, 0xF0F0, 0xFF00, 0xF000},
    {0x02, 0xF0F0, 0xFF00, 0xFFF0},
    {0x03, 0xF0F0, 0xFF00, 0x0FF0},
    {0x04, 1, 2, 0xFFFFFFFF},
    {0x05, 0xF0F0, 0xFF00, 0x00F0},
    {0x06, 0xF0F0, 0xFFFFFF00, 0xF0FF},
    {0x07, 0xF0F0, 0xFF00, 0xFFFFF00F},
    {.op3 = 0x08, .a = 1, .b = 2, .result = 4, .nzvc_before = 1},
    {.op3 = 0x0C, .a = 5, .b = 2, .result = 2, .nzvc_before = 1},
    // with condition codes
    {0x10, 0x7FFFFFFF, 1, 0x80000000, 0b1010},
    {0x10, 0xFFFFFFFF, 1, 0, 0b0101},
    {0x10, 0x80000000, 0x80000000, 0, 0b0111},
    {0x11, 0xF0, 0x0F, 0, 0b0100},
    {0x12, 0x80000000, 1, 0x80000001, 0b1000},
    {0x13, 5, 5, 0, 0b0100},
    {0x14, 1, 2, 0xFFFFFFFF, 0b1001},
    {0x14, 0x80000000, 1, 0x7FFFFFFF, 0b0010},
    {0x14, 0, 0x80000000, 0x80000000, 0b1011},
    {0x14, 7, 7, 0, 0b0100},
    {0x15, 0xFF, 0xF0, 0x0F, 0b0000},
    {0x16, 0, 0, 0xFFFFFFFF, 0b1000},
    {0x17, 0x0F, 0xFFFFFFF0, 0, 0b0100},
    {0x18, 0xFFFFFFFF, 0, 0, 0b0101, 0, 0, 1},
    {0x18, 0x7FFFFFFF, 0, 0x80000000, 0b1010, 0, 0, 1},
    {0x1C, 0, 0, 0xFFFFFFFF, 0b1001, 0, 0, 1},
    {0x1C, 0, 0xFFFFFFFF, 0, 0b0101, 0, 0, 1},
    {0x1C, 0x80000000, 0, 0x7FFFFFFF, 0b0010, 0, 0, 1},
    // tagged
    {0x20, 4, 8, 12, 0b0000},
    {0x20, 5, 8, 13, 0b0010},
    {0x20, 0xFFFFFFFC, 4, 0, 0b0101},
    {0x20, 0x7FFFFFFC, 4, 0x80000000, 0b1010},
    {0x21, 8, 4, 4, 0b0000},
    {0x21, 8, 6, 2, 0b0010},
    {0x21, 0, 4, 0xFFFFFFFC, 0b1001},
    {0x22, 4, 8, 12, 0b0000},
    {0x23, 8, 4, 4, 0b0000},
    // shifts take five bits
    {0x25, 1, 33, 2},
    {0x26, 0x80000000, 31, 1},
    {0x27, 0x80000000, 31, 0xFFFFFFFF},
    // multiplication: Y has the upper half; the conditions are those of the lower
    {0x0A, 0xFFFFFFFF, 0xFFFFFFFF, 1, -1, 0, 0xFFFFFFFE},
    {0x0B, 0xFFFFFFFF, 0xFFFFFFFF, 1, -1, 0, 0},
    {0x0B, 0xFFFFFFFF, 2, 0xFFFFFFFE, -1, 0, 0xFFFFFFFF},
    {0x1A, 0x80000000, 1, 0x80000000, 0b1000, 0, 0},
    {0x1A, 0x80000000, 2, 0, 0b0100, 0, 1},
    {0x1B, 0x80000000, 2, 0, 0b0100, 0, 0xFFFFFFFF},
    // division of Y:rs1; what does not fit becomes the nearest number
    {0x0E, 7, 2, 3},
    {0x0E, 0, 2, 0x80000000, -1, 1, 1},
    {0x0E, 0, 1, 0xFFFFFFFF, -1, 1, 1},
    {0x0F, 0xFFFFFFF9, 2, 0xFFFFFFFD, -1, 0xFFFFFFFF, 0xFFFFFFFF},
    {0x0F, 0x80000000, 1, 0x7FFFFFFF},
    {0x0F, 0, 1, 0x80000000, -1, 0xFFFFFFF0, 0xFFFFFFF0},
    {0x0F, 0, 0xFFFFFFFF, 0x7FFFFFFF, -1, 0x80000000, 0x80000000},
    {0x1E, 0, 1, 0xFFFFFFFF, 0b1010, 1, 1},
    {0x1E, 1, 2, 0, 0b0100},
    {0x1F, 0x80000000, 1, 0x7FFFFFFF, 0b0010},
    {0x1F, 0x80000000, 0xFFFFFFFF, 0x80000000, 0b1000, 0, 0},
    {0x1F, 0x80000000, 1, 0x80000000, 0b1000, 0xFFFFFFFF, 0xFFFFFFFF},
    // one step of a multiplication: Y shifts right, its lowest bit decides
    {0x24, 6, 5, 8, 0b0000, 1, 0},
    {0x24, 7, 5, 3, 0b0000, 2, 0x80000001},
    {0x24, 6, 5, 0x80000003, 0b1000, 0, 0, 0b1000},
    {0x24, 6, 5, 3, 0b0000, 0, 0, 0b1010},
};

TEST_P(Cpu, ArithmeticIsThatOfTheManual)
{
    for (const Arithmetic &a : arithmetic) {
        for (bool immediate : {false, true}) {
            const auto number = static_cast<std::int32_t>(a.b);
            if (immediate && (number < -4096 || number > 4095)) {
                continue;
            }
            c.r(g(1)) = a.a;
            c.r(g(2)) = a.b;
            c.s.y = a.y;
            c.s.psr = (c.s.psr & ~psr::icc) | a.nzvc_before << 20;
            const std::uint32_t word =
                immediate ? with_number(2, a.op3, l(3), g(1), number) : with_register(2, a.op3, l(3), g(1), g(2));
            ASSERT_EQ(trap_of(word), 0u) << std::hex << a.op3;
            EXPECT_EQ(c.r(l(3)), a.result) << std::hex << a.op3 << ' ' << a.a << ' ' << a.b;
            EXPECT_EQ(c.s.y, a.y_after) << std::hex << a.op3 << ' ' << a.a << ' ' << a.b;
            EXPECT_EQ(icc(), a.nzvc < 0 ? a.nzvc_before : static_cast<std::uint32_t>(a.nzvc))
                << std::hex << a.op3 << ' ' << a.a << ' ' << a.b;
        }
    }
}

TEST_P(Cpu, TheRegisterG0StaysZero)
{
    run({mov(g(0), 5), or_(o(1), g(0), 1), sethi(g(0), 0x12345678), save(g(0), g(0), 3)});
    EXPECT_EQ(c.r(g(0)), 0u);
    EXPECT_EQ(c.r(i(1)), 1u);
}

TEST_P(Cpu, TheInsOfAWindowAreTheOutsOfItsCaller)
{
    c.r(o(6)) = 1000;
    c.r(l(0)) = 7;
    run({save(o(6), o(6), -96), mov(l(0), 9), restore(o(1), l(0), 1)});
    EXPECT_EQ(window(), 4u);
    EXPECT_EQ(c.r(o(6)), 1000u);
    EXPECT_EQ(c.r(l(0)), 7u);
    EXPECT_EQ(c.r(o(1)), 10u) << "operands are of the old window, the result of the new one";
    // The windows are a ring.
    c.s.wim = 0;
    c.s.psr = (c.s.psr & ~psr::cwp) | 0;
    c.r(o(3)) = 33;
    run({save(l(1), g(0), 1)});
    EXPECT_EQ(window(), 7u);
    EXPECT_EQ(c.r(i(3)), 33u);
    run({mov(i(3), 34), restore(g(0), g(0), 0)});
    EXPECT_EQ(window(), 0u);
    EXPECT_EQ(c.r(o(3)), 34u);
}

TEST_P(Cpu, AnInvalidWindowTraps)
{
    c.s.wim = 1u << 3 | 1u << 5;
    EXPECT_EQ(trap_of(save(g(1), g(0), 1)), trap::window_overflow);
    EXPECT_EQ(trap_of(restore(g(1), g(0), 1)), trap::window_underflow);
    EXPECT_EQ(c.r(g(1)), 0u);
}

TEST_P(Cpu, ATrapEntersTheSupervisorInANewWindow)
{
    c.s.psr &= ~psr::supervisor;
    run({nop, trap_always(5)});
    EXPECT_EQ(c.s.pc, ram_base + 0x850);
    EXPECT_EQ(c.s.npc, ram_base + 0x854);
    EXPECT_EQ(window(), 3u);
    EXPECT_EQ(c.r(l(1)), start + 4);
    EXPECT_EQ(c.r(l(2)), start + 8);
    EXPECT_EQ(c.s.psr & (psr::supervisor | psr::previous_supervisor | psr::enable_traps), psr::supervisor);
    EXPECT_EQ(c.s.instructions, 1u);
    EXPECT_EQ(c.s.traps, 1u);
    // and back, behind the instruction that trapped
    run({jmpl(g(0), l(2), 0), rett(l(2), 4)});
    EXPECT_EQ(c.s.pc, start + 8);
    EXPECT_EQ(c.s.npc, start + 12);
    EXPECT_EQ(window(), 4u);
    EXPECT_EQ(c.s.psr & (psr::supervisor | psr::enable_traps), psr::enable_traps);
}

TEST_P(Cpu, ASingleVectorTakesAllTraps)
{
    c.r(g(1)) = 1u << 13;
    run({with_register(2, 0x30, 17, g(1), g(0)), trap_always(5)});
    EXPECT_EQ(c.s.pc, ram_base);
    EXPECT_EQ(c.s.npc, ram_base + 4);
    EXPECT_EQ(c.s.tbr, ram_base + 0x850);
    c.s.psr |= psr::enable_traps;
    run({with_register(2, 0x30, 17, g(0), g(0)), trap_always(6)});
    EXPECT_EQ(c.s.pc, ram_base + 0x860);
}

TEST_P(Cpu, ATrapWhileTrapsAreDisabledIsTheEnd)
{
    c.s.psr &= ~psr::enable_traps;
    c.write(start, {nop, trap_always(3)});
    EXPECT_EQ(c.steps(100), Exit::error);
    EXPECT_EQ(c.s.mode, Mode::error);
    EXPECT_EQ(c.s.trap_type, 0x83u);
    EXPECT_EQ(c.s.pc, start + 4);
    EXPECT_EQ(c.s.cycles, 2u);
    EXPECT_EQ(c.steps(100), Exit::error);
    EXPECT_EQ(c.s.cycles, 2u);
}

TEST_P(Cpu, TrapsHaveTheirCausesAndPriorities)
{
    const std::uint32_t d = data;
    c.r(g(1)) = d + 2;
    c.r(g(2)) = 0x10000000; // nothing is there
    c.r(g(3)) = d;
    EXPECT_EQ(trap_of(0), trap::illegal_instruction);
    EXPECT_EQ(trap_of(ld(g(4), g(1), 0)), trap::mem_address_not_aligned);
    EXPECT_EQ(trap_of(with_number(3, 0x02, g(4), g(1), 1)), trap::mem_address_not_aligned);
    EXPECT_EQ(trap_of(with_number(3, 0x03, g(4), g(3), 4)), trap::mem_address_not_aligned);
    EXPECT_EQ(trap_of(with_number(3, 0x23, 4, g(3), 4)), trap::mem_address_not_aligned);
    EXPECT_EQ(trap_of(ld(g(4), g(2), 0)), trap::data_access_exception);
    EXPECT_EQ(trap_of(ld(g(4), g(2), 1)), trap::mem_address_not_aligned) << "before the access";
    EXPECT_EQ(trap_of(st(g(4), g(2), 0)), trap::data_store_error);
    EXPECT_EQ(trap_of(jmpl(g(4), g(1), 0)), trap::mem_address_not_aligned);
    EXPECT_EQ(trap_of(with_number(2, 0x0E, g(4), g(1), 0)), trap::division_by_zero);
    EXPECT_EQ(trap_of(with_number(2, 0x22, g(4), g(1), 0)), trap::tag_overflow);
    EXPECT_EQ(trap_of(with_number(2, 0x23, g(4), g(1), 0)), trap::tag_overflow);
    EXPECT_EQ(trap_of(0x81B00000), trap::cp_disabled);
    EXPECT_EQ(trap_of(branch(7, 8, false, 1)), trap::cp_disabled);
    EXPECT_EQ(trap_of(0xC1800000), trap::cp_disabled);
    EXPECT_EQ(trap_of(rett(g(3), 0)), trap::illegal_instruction) << "traps are enabled";
    EXPECT_EQ(trap_of(with_number(2, 0x31, 0, g(0), 8)), trap::illegal_instruction) << "window 8";
    EXPECT_EQ(trap_of(with_number(3, 0x10, g(4), g(3), 0)), trap::illegal_instruction) << "lda with a number";
    EXPECT_EQ(trap_of(with_register(3, 0x10, g(4), g(3), 0, 0x74)), trap::data_access_exception) << "of an MMU";
    EXPECT_EQ(trap_of(with_register(3, 0x11, g(4), g(3), 0, 0x0E)), trap::data_access_exception) << "a byte of a tag";
    EXPECT_EQ(trap_of(with_register(3, 0x10, g(4), g(2), 0, 0x77)), trap::data_access_exception) << "memory";
    EXPECT_EQ(trap_of(with_register(3, 0x13, g(5), g(3), 0, 0x0A)), trap::illegal_instruction) << "ldda into %g5";
    EXPECT_EQ(c.r(g(4)), 0u) << "no trap changed the destination";
    c.go(0x10000000);
    c.steps(1);
    EXPECT_EQ(c.s.trap_type, trap::instruction_access_exception);

    c.s.psr = (c.s.psr | psr::enable_traps) & ~psr::enable_fpu;
    EXPECT_EQ(trap_of(fpop(0x34, 0x42, 0, 2, 4)), trap::fp_disabled);
    EXPECT_EQ(trap_of(fpop(0x34, 0x43, 0, 0, 4)), trap::fp_disabled);
    EXPECT_EQ(trap_of(branch(6, 8, false, 1)), trap::fp_disabled);
    EXPECT_EQ(trap_of(with_number(3, 0x20, 4, g(2), 1)), trap::fp_disabled) << "before the alignment";
    EXPECT_EQ(trap_of(with_number(3, 0x24, 4, g(2), 1)), trap::fp_disabled);
    EXPECT_EQ(trap_of(with_number(3, 0x26, 0, g(3), 0)), trap::fp_disabled);

    c.s.psr &= ~psr::supervisor;
    EXPECT_EQ(trap_of(with_number(3, 0x26, 0, g(3), 0)), trap::privileged_instruction);
    EXPECT_EQ(trap_of(rett(g(3), 0)), trap::privileged_instruction);
    EXPECT_EQ(trap_of(with_register(3, 0x13, g(5), g(3), 0, 0x77)), trap::privileged_instruction) << "before illegal";
    for (std::uint32_t op3 : {0x29, 0x2A, 0x2B, 0x31, 0x32, 0x33}) {
        EXPECT_EQ(trap_of(with_number(2, op3, g(4), g(0), 31)), trap::privileged_instruction) << op3;
    }
    EXPECT_EQ(trap_of(with_number(2, 0x30, 19, g(0), 0)), trap::privileged_instruction) << "power-down";
    EXPECT_EQ(trap_of(with_register(2, 0x28, g(4), 17, 0)), trap::none);
    EXPECT_EQ(trap_of(with_number(2, 0x30, 0, g(0), 0)), trap::none) << "%y";
}

TEST_P(Cpu, ReadsOfAncillaryRegistersNeverTrap)
{
    c.s.y = 0x12345678;
    for (const std::uint32_t mode : {psr::supervisor, 0u}) {
        c.s.psr = (c.s.psr & ~psr::supervisor) | mode;
        for (std::uint32_t n = 1; n < 32; n++) {
            c.s.cycles = 0x3'0000'0010;
            c.s.counts_from = 0x1'0000'0004;
            EXPECT_EQ(trap_of(with_register(2, 0x28, g(4), n, 0)), trap::none) << n;
            const bool configuration = n == 17 || n == 19 || n == 21;
            EXPECT_EQ(c.r(g(4)), configuration ? 0x507u : n == 22 ? 0x80000002u : n == 23 ? 0xCu : 0x12345678u) << n;
        }
    }
}

TEST_P(Cpu, WritesOfAncillaryRegistersTrapWhereTheHardwareDoes)
{
    c.r(g(1)) = 0xFFFFFFFF;
    for (const std::uint32_t mode : {psr::supervisor, 0u}) {
        c.s.psr = (c.s.psr & ~psr::supervisor) | mode;
        for (std::uint32_t n = 1; n < 32; n++) {
            const bool refused = mode == 0 && n >= 16 && n != 18;
            EXPECT_EQ(trap_of(with_number(2, 0x30, n, g(1), 0)), refused ? trap::privileged_instruction : trap::none)
                << n;
            EXPECT_EQ(c.s.mode, n == 19 && !refused ? Mode::power_down : Mode::running);
            c.s.mode = Mode::running;
        }
    }
    EXPECT_EQ(c.s.y, 0u);
    c.s.psr |= psr::supervisor;
    EXPECT_EQ(c.s.asr17, 0x6507u) << "two bits can be written";
    c.r(g(2)) = 0x10000000;
    EXPECT_EQ(trap_of(st(g(1), g(2), 0)), trap::none) << "it keeps stores from trapping";
    EXPECT_EQ(trap_of(ld(g(1), g(2), 0)), trap::data_access_exception);
    EXPECT_EQ(c.s.asr22, 0x80000000u);
    EXPECT_EQ(trap_of(with_number(2, 0x30, 22, g(0), 0)), trap::none);
    EXPECT_EQ(c.s.asr22, 0u);
}

TEST_P(Cpu, ATrapInATrapHandlerOfRettIsTheEnd)
{
    c.s.psr &= ~psr::enable_traps;
    c.s.wim = 1u << 5;
    c.r(g(1)) = start;
    c.write(start, {rett(g(1), 0)});
    EXPECT_EQ(c.steps(2), Exit::error);
    EXPECT_EQ(c.s.trap_type, trap::window_underflow);
}

TEST_P(Cpu, ABranchExecutesItsDelaySlot)
{
    c.write(start + 12, {nop, nop});
    run({ba(3), mov(g(1), 1), mov(g(2), 2), nop});
    EXPECT_EQ(c.r(g(1)), 1u);
    EXPECT_EQ(c.r(g(2)), 0u);
    EXPECT_EQ(c.s.pc, start + 20) << "behind two instructions at the target";
    c.go(start + 0x40);
    run({call(4), mov(g(3), 3)});
    EXPECT_EQ(c.r(o(7)), start + 0x40);
    EXPECT_EQ(c.r(g(3)), 3u);
    EXPECT_EQ(c.s.pc, start + 0x50);
    c.r(g(5)) = start + 0x100;
    c.go(start + 0x80);
    run({jmpl(g(6), g(5), 8), mov(g(4), 4)});
    EXPECT_EQ(c.r(g(6)), start + 0x80);
    EXPECT_EQ(c.r(g(4)), 4u);
    EXPECT_EQ(c.s.pc, start + 0x108);
}

TEST_P(Cpu, TheAnnulBitSkipsTheDelaySlot)
{
    struct Case {
        std::uint32_t word;
        bool slot, taken;
    };
    for (const Case &k : {Case{branch(2, 8, true, 8), false, true}, Case{branch(2, 0, true, 8), false, false},
                          Case{branch(2, 0, false, 8), true, false}, Case{branch(2, 1, true, 8), true, true},
                          Case{branch(2, 9, true, 8), false, false}, Case{branch(6, 8, true, 8), false, true},
                          Case{branch(6, 9, true, 8), true, true}, Case{branch(6, 1, true, 8), false, false}}) {
        SmallComputer computer(GetParam()(), leon3_timing());
        computer.s.psr |= psr::zero;
        computer.write(start, {k.word, mov(g(1), 1), nop});
        computer.write(start + 32, {nop, nop});
        computer.steps(k.slot ? 2 : 1);
        EXPECT_EQ(computer.r(g(1)), k.slot ? 1u : 0u) << std::hex << k.word;
        EXPECT_EQ(computer.s.pc, k.taken ? start + 32 : start + 8) << std::hex << k.word;
        EXPECT_EQ(computer.s.npc, computer.s.pc + 4);
        EXPECT_EQ(computer.s.instructions, k.slot ? 2u : 1u);
        EXPECT_EQ(computer.s.cycles, 2u) << "the annulled slot costs a cycle on a LEON3";
    }
}

TEST_P(Cpu, ABranchInADelaySlotHasAnInstructionAtTheFirstTarget)
{
    c.write(start, {ba(16), ba(32), mov(g(1), 1)});
    c.write(start + 64, {mov(g(2), 2), mov(g(3), 3)});
    c.write(start + 4 + 128, {mov(g(4), 4)});
    c.steps(4);
    EXPECT_EQ(c.r(g(1)), 0u);
    EXPECT_EQ(c.r(g(2)), 2u);
    EXPECT_EQ(c.r(g(3)), 0u);
    EXPECT_EQ(c.r(g(4)), 4u);
    // and the annulled one is at the first target
    c.go(start + 0x200);
    c.r(g(2)) = 0;
    c.write(start + 0x200, {ba(16), ba(32, true)});
    c.write(start + 0x240, {mov(g(2), 2)});
    c.steps(2);
    EXPECT_EQ(c.s.pc, start + 0x204 + 128);
    EXPECT_EQ(c.r(g(2)), 0u);
}

TEST_P(Cpu, MemoryIsBigEndian)
{
    c.r(g(1)) = data;
    c.r(g(2)) = 0x80818283;
    c.r(g(3)) = 0xC4C5C6C7;
    run({with_number(3, 0x07, g(2), g(1), 8), ld(l(0), g(1), 8), with_number(3, 0x01, l(1), g(1), 9),
         with_number(3, 0x09, l(2), g(1), 9), with_number(3, 0x02, l(3), g(1), 10),
         with_number(3, 0x0A, l(4), g(1), 10), with_number(3, 0x03, o(2), g(1), 8), with_number(3, 0x05, g(3), g(1), 8),
         with_number(3, 0x06, g(3), g(1), 14), with_number(3, 0x23, 4, g(1), 8), with_number(3, 0x20, 7, g(1), 12),
         with_number(3, 0x27, 4, g(1), 16), with_number(3, 0x24, 7, g(1), 24), with_number(3, 0x24, 5, g(1), 28)});
    EXPECT_EQ(c.r(l(0)), 0x80818283u);
    EXPECT_EQ(c.r(l(1)), 0x81u);
    EXPECT_EQ(c.r(l(2)), 0xFFFFFF81u);
    EXPECT_EQ(c.r(l(3)), 0x8283u);
    EXPECT_EQ(c.r(l(4)), 0xFFFF8283u);
    EXPECT_EQ(c.r(o(2)), 0x80818283u);
    EXPECT_EQ(c.r(o(3)), 0xC4C5C6C7u);
    EXPECT_EQ(c.bus.load(data + 8), 0xC7818283u);
    EXPECT_EQ(c.bus.load(data + 12), 0xC4C5C6C7u);
    EXPECT_EQ(c.s.floats[2], 0xC7818283C4C5C6C7u);
    EXPECT_EQ(c.bus.load(data + 16), 0xC7818283u);
    EXPECT_EQ(c.bus.load(data + 20), 0xC4C5C6C7u);
    EXPECT_EQ(c.bus.load(data + 24), 0xC4C5C6C7u);
    EXPECT_EQ(c.bus.load(data + 28), 0xC4C5C6C7u);
}

TEST_P(Cpu, AtomicInstructionsReadAndWrite)
{
    c.r(g(1)) = data;
    c.r(g(2)) = 0x11111111;
    c.r(g(3)) = 0x22222222;
    c.bus.store(data, 0x12345678);
    run({with_number(3, 0x0D, l(0), g(1), 1), with_number(3, 0x0F, g(2), g(1), 0)});
    EXPECT_EQ(c.r(l(0)), 0x34u);
    EXPECT_EQ(c.r(g(2)), 0x12FF5678u);
    EXPECT_EQ(c.bus.load(data), 0x11111111u);
    run({with_register(3, 0x3C, g(3), g(1), g(2), 0x0A)}); // casa: not equal
    EXPECT_EQ(c.bus.load(data), 0x11111111u);
    EXPECT_EQ(c.r(g(3)), 0x11111111u);
    c.r(g(2)) = 0x11111111;
    c.r(g(3)) = 0x33333333;
    run({with_register(3, 0x3C, g(3), g(1), g(2), 0x0A)});
    EXPECT_EQ(c.bus.load(data), 0x33333333u);
    EXPECT_EQ(c.r(g(3)), 0x11111111u);
    c.r(g(1)) = data + 1;
    EXPECT_EQ(trap_of(with_register(3, 0x3C, g(3), g(1), g(2), 0x0A)), trap::mem_address_not_aligned);
    c.r(g(1)) = data;
    c.s.psr &= ~psr::supervisor;
    EXPECT_EQ(trap_of(with_register(3, 0x3C, g(3), g(1), g(2), 0x0A)), trap::none) << "also for users, in ASI 10";
    EXPECT_EQ(trap_of(with_register(3, 0x3C, g(3), g(1), g(2), 0x0B)), trap::privileged_instruction);
}

TEST_P(Cpu, AlternateSpacesAreMemoryOrTheCachesControl)
{
    c.r(g(1)) = data;
    c.r(g(2)) = 0x1234;
    c.bus.store(data, 77);
    for (std::uint32_t asi : {0x01, 0x08, 0x09, 0x0A, 0x0B, 0x1C}) {
        EXPECT_EQ(trap_of(with_register(3, 0x10, g(3), g(1), 0, asi)), trap::none);
        EXPECT_EQ(c.r(g(3)), 77u) << asi;
    }
    for (std::uint32_t asi : {0x02, 0x0C, 0x0D, 0x0E, 0x0F, 0x10, 0x11, 0x13, 0x18, 0x19}) {
        EXPECT_EQ(trap_of(with_register(3, 0x14, g(2), g(1), 0, asi)), trap::none);
        EXPECT_EQ(trap_of(with_register(3, 0x10, g(3), g(1), 0, asi)), trap::none);
        EXPECT_EQ(c.r(g(3)), 0u) << asi;
        EXPECT_EQ(c.bus.load(data), 77u) << asi;
    }
    c.r(g(2)) = 0x0060000F;
    EXPECT_EQ(trap_of(with_register(3, 0x14, g(2), 0, 0, 0x02)), trap::none);
    EXPECT_EQ(trap_of(with_register(3, 0x10, g(3), 0, 0, 0x02)), trap::none);
    EXPECT_EQ(c.r(g(3)), 0xFu) << "the flush is over";
}

TEST_P(Cpu, StateRegistersAreWrittenAtOnce)
{
    c.r(g(1)) = 0xFFFFFFFF;
    c.r(g(2)) = ram_base + 0x1FFF;
    EXPECT_EQ(trap_of(with_number(2, 0x32, 0, g(1), 0)), trap::none);
    EXPECT_EQ(trap_of(with_number(2, 0x33, 0, g(2), 0)), trap::none);
    EXPECT_EQ(trap_of(with_number(2, 0x30, 0, g(1), 0x0FF)), trap::none);
    EXPECT_EQ(c.s.wim, 0xFFu) << "as many bits as windows";
    EXPECT_EQ(c.s.tbr, ram_base + 0x1000);
    EXPECT_EQ(c.s.y, 0xFFFFFF00u) << "rs1 xor operand2";
    EXPECT_EQ(trap_of(with_register(2, 0x28, g(3), 17, 0)), trap::none);
    EXPECT_EQ(c.r(g(3)), 0x507u) << "%asr17: 8 windows, multiplier, GRFPU";
    c.r(g(1)) = 0xFFFFFFE2;
    EXPECT_EQ(trap_of(with_number(2, 0x31, 0, g(1), 0)), trap::none);
    EXPECT_EQ(c.s.psr, 0xF3F01FE2u) << "version and coprocessor stay";
    EXPECT_EQ(trap_of(with_register(2, 0x29, l(3), 0, 0)), trap::none);
    EXPECT_EQ(c.r(l(3)), 0xF3F01FE2u);
}

TEST_P(Cpu, AnInterruptComesBetweenTwoInstructions)
{
    std::uint32_t acknowledged = 0;
    c.core.user = &acknowledged;
    c.core.acknowledge = [](void *user, std::uint32_t level) { *static_cast<std::uint32_t *>(user) = level; };
    c.s.psr |= 5u << 8;
    c.write(start, {nop, nop, ba(-2), nop});
    c.core.interrupt_level = 5;
    EXPECT_EQ(c.steps(3), Exit::time);
    EXPECT_EQ(acknowledged, 0u) << "its level is not above PIL";
    EXPECT_EQ(c.s.pc, start + 12);
    c.core.interrupt_level = 6;
    EXPECT_EQ(c.steps(1), Exit::time);
    EXPECT_EQ(acknowledged, 6u);
    EXPECT_EQ(c.s.pc, ram_base + 0x160);
    EXPECT_EQ(c.r(l(1)), start + 12) << "in the delay slot";
    EXPECT_EQ(c.r(l(2)), start);
    c.s.psr |= psr::enable_traps | psr::pil;
    c.core.interrupt_level = 15;
    c.steps(1);
    EXPECT_EQ(acknowledged, 15u) << "that level cannot be masked";
    c.write(c.s.pc, {nop});
    c.steps(1);
    EXPECT_EQ(c.s.traps, 2u) << "traps are disabled in the handler";
}

TEST_P(Cpu, AnInterruptIsTakenBehindTheInstructionThatEnablesIt)
{
    c.core.interrupt_level = 3;
    c.s.psr |= 4u << 8;
    c.r(g(1)) = (c.s.psr & ~psr::pil) | 2u << 8;
    c.write(start, {with_number(2, 0x31, 0, g(1), 0), mov(g(2), 2)});
    c.steps(2);
    EXPECT_EQ(c.s.pc, ram_base + 0x130);
    EXPECT_EQ(c.r(l(1)), start + 4);
    EXPECT_EQ(c.r(g(2)), 0u);
}

TEST_P(Cpu, ADeviceEndsTheRunBehindItsAccess)
{
    c.r(g(1)) = device_base;
    c.bus.on_device_write = [this](std::uint32_t, std::uint32_t value) {
        c.core.interrupt_level = value;
        c.core.attention = true;
    };
    c.write(start, {mov(g(2), 9), st(g(2), g(1), 0), mov(g(3), 3)});
    EXPECT_EQ(c.steps(100), Exit::attention);
    EXPECT_EQ(c.s.pc, start + 8);
    EXPECT_FALSE(c.core.attention);
    c.steps(1);
    EXPECT_EQ(c.s.pc, ram_base + 0x190);
    EXPECT_EQ(c.r(g(3)), 0u);
}

TEST_P(Cpu, PowerDownWaitsForAnInterrupt)
{
    c.write(start, {with_number(2, 0x30, 19, g(0), 0), mov(g(3), 3)});
    EXPECT_EQ(c.steps(100), Exit::power_down);
    EXPECT_EQ(c.s.cycles, 1u);
    EXPECT_EQ(c.steps(100), Exit::power_down);
    EXPECT_EQ(c.s.cycles, 1u);
    c.s.cycles += 1000;
    c.core.interrupt_level = 4;
    EXPECT_EQ(c.steps(1), Exit::time);
    EXPECT_EQ(c.s.mode, Mode::running);
    EXPECT_EQ(c.s.cycles, 1002u);
    EXPECT_EQ(c.r(l(1)), start + 4);
}

TEST_P(Cpu, ABreakpointStopsBeforeItsInstruction)
{
    c.write(start, {nop, mov(g(1), 1), ba(-2), nop});
    c.steps(8);
    c.engine->set_breakpoint(c.core, start + 4, true);
    EXPECT_EQ(c.steps(100), Exit::breakpoint);
    EXPECT_EQ(c.s.pc, start + 4);
    const std::uint64_t at = c.s.cycles;
    EXPECT_EQ(c.steps(100), Exit::breakpoint);
    EXPECT_EQ(c.s.cycles, at);
    EXPECT_EQ(c.engine->run(c.core, at + 100, true), Exit::breakpoint);
    EXPECT_EQ(c.s.cycles, at + 4) << "once round";
    c.engine->set_breakpoint(c.core, start + 4, false);
    EXPECT_EQ(c.steps(100), Exit::time);
}

TEST_P(Cpu, AWatchpointStopsBehindItsInstruction)
{
    c.r(g(1)) = data;
    c.write(start, {st(g(1), g(1), 0), ld(g(2), g(1), 0), nop, nop});
    c.bus.flags_of(data) = page_watch_write;
    EXPECT_EQ(c.steps(3), Exit::watchpoint);
    EXPECT_EQ(c.s.pc, start + 4);
    EXPECT_EQ(c.bus.load(data), data);
    c.bus.flags_of(data) = page_watch_read;
    EXPECT_EQ(c.steps(3), Exit::watchpoint);
    EXPECT_EQ(c.s.pc, start + 8);
    EXPECT_EQ(c.r(g(2)), data);
    EXPECT_EQ(c.steps(1), Exit::time);
}

TEST_P(Cpu, CodeThatChangesItselfIsExecutedAsItIs)
{
    // A loop that replaces `mov 1, %g1` by `mov 2, %g1`, once in the instruction right behind the store.
    c.r(g(4)) = start;
    c.r(g(5)) = mov(g(1), 2);
    c.write(start, {mov(g(1), 1), add(g(3), g(1), 0), st(g(5), g(4), 12), mov(g(1), 1), ba(-4), st(g(5), g(4), 0)});
    c.steps(4);
    EXPECT_EQ(c.r(g(1)), 2u);
    EXPECT_EQ(c.r(g(3)), 1u);
    c.steps(4);
    EXPECT_EQ(c.r(g(3)), 2u);
}

TEST_P(Cpu, AProtectedPageTakesNoWrite)
{
    c.r(g(1)) = data;
    c.bus.flags_of(data) = page_protected;
    EXPECT_EQ(trap_of(st(g(1), g(1), 0)), trap::data_store_error);
    EXPECT_EQ(trap_of(with_number(3, 0x0D, g(2), g(1), 0)), trap::data_store_error);
    EXPECT_EQ(trap_of(with_number(3, 0x27, 2, g(1), 0)), trap::data_store_error);
    EXPECT_EQ(c.bus.load(data), 0u);
}

TEST_P(Cpu, CodeCrossesPagesAndTheirDelaySlots)
{
    const std::uint32_t end = start + page_size;
    c.write(end - 8, {mov(g(1), 1), ba(1024), mov(g(2), 2), mov(g(3), 3)});
    c.write(end - 4 + 4096, {mov(g(4), 4), mov(g(5), 5)});
    c.go(end - 8);
    c.steps(5);
    EXPECT_EQ(c.r(g(1)), 1u);
    EXPECT_EQ(c.r(g(2)), 2u);
    EXPECT_EQ(c.r(g(3)), 0u);
    EXPECT_EQ(c.r(g(4)), 4u);
    EXPECT_EQ(c.r(g(5)), 5u);
    EXPECT_EQ(c.s.pc, end + 4 + 4096);
    // Sequential code out of memory traps at the first word that is not there.
    const std::uint32_t last = ram_base + ram_size - 4;
    c.write(last, {mov(g(6), 6)});
    c.go(last);
    c.steps(2);
    EXPECT_EQ(c.r(g(6)), 6u);
    EXPECT_EQ(c.s.trap_type, trap::instruction_access_exception);
    EXPECT_EQ(c.r(l(1)), last + 4);
}

INSTANTIATE_TEST_SUITE_P(Engines, Cpu, ::testing::Values(&make_interpreter, &make_threaded),
                         [](const auto &made) { return std::string(made.param()->name()); });

} // namespace interpreter_test
