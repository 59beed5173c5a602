// SPDX-License-Identifier: Apache-2.0
// Random programs from a seed: all instructions, with windows, traps, branches, changing code and the corner cases of
// floating point. Two engines that get the same program must go the same way.
#pragma once

#include <array>
#include <cstdint>
#include <random>

#include "emulator/testing/encode.h"
#include "emulator/testing/small_computer.h"

namespace fledge::emulator::testing {

class RandomProgram {
public:
    static constexpr std::uint32_t code = SmallComputer::start, words = 1536; ///< one page and a half
    static constexpr std::uint32_t data = SmallComputer::data;

    explicit RandomProgram(std::uint64_t seed) : random_(seed) {}

    /// Put a program, its data and a table of trap handlers into a computer, and begin it.
    void load(SmallComputer &c)
    {
        for (std::uint32_t entry = 0; entry < 256; entry++) {
            // The handler skips the instruction that trapped; an interrupt comes back to its own.
            const bool interrupt = entry > 0x10 && entry < 0x20;
            const std::uint32_t handler = ram_base + entry * 16;
            if (entry == 5 || entry == 6) { // a window moves: all become valid
                c.write(handler, {with_number(2, 0x32, 0, 0, 0), nop, jmpl(0, l(1), 0), rett(l(2), 0)});
            } else if (entry == 8 && c.core.fpu == FpuPersonality::grfpu) {
                c.write(handler, {sethi(l(3), data), with_number(3, 0x26, 0, l(3), 0), // std %fq,[%l3]
                                  jmpl(0, l(2), 0), rett(l(2), 4)});
            } else {
                c.write(handler, {nop, jmpl(0, l(interrupt ? 1 : 2), 0), rett(l(2), interrupt ? 0 : 4), nop});
            }
        }
        for (std::uint32_t k = 0; k < words; k++) {
            c.bus.store(code + 4 * k, instruction());
        }
        for (std::uint32_t k = 0; k < 1024; k += 2) {
            const std::uint64_t value = number();
            c.bus.store(data + 4 * k, static_cast<std::uint32_t>(value >> 32));
            c.bus.store(data + 4 * k + 4, static_cast<std::uint32_t>(value));
        }
        restart(c);
    }

    /// Registers with new random contents, pointers among them; pc anywhere in the code.
    void restart(SmallComputer &c)
    {
        CpuState &s = c.s;
        s.mode = Mode::running;
        s.psr = psr::version | psr::supervisor | psr::enable_traps | below(window_count) | below(16) << 20 |
                (chance(90) ? psr::enable_fpu : 0);
        s.tbr = ram_base;
        s.wim = chance(70) ? 1u << below(window_count) : 0;
        s.y = word();
        s.fp_queue = {};
        s.fsr = below(4) << 30 | (chance(20) ? below(32) << fsr::tem_shift : 0) | below(1024) |
                (chance(5) ? fsr::nonstandard : 0);
        for (std::uint32_t &r : s.windows) {
            r = operand();
        }
        for (std::uint32_t k = 1; k < 8; k++) {
            s.globals[k] = k < 4 ? pointer() : operand();
        }
        for (std::uint64_t &f : s.floats) {
            f = number();
        }
        c.go(code + 4 * below(words));
        if (chance(20)) { // as behind a branch
            s.npc = code + 4 * below(words);
        }
    }

    std::uint32_t below(std::uint32_t n) { return static_cast<std::uint32_t>(random_() % n); }
    bool chance(std::uint32_t percent) { return below(100) < percent; }

    /// Any word: most are instructions that can go on.
    std::uint32_t instruction()
    {
        const std::uint32_t rd = below(32), rs1 = below(32), rs2 = below(32);
        switch (below(16)) {
        case 0: return branch(2, below(16), chance(50), static_cast<std::int32_t>(below(40)) - 12);
        case 1: return branch(6, below(16), chance(50), static_cast<std::int32_t>(below(40)) - 12);
        case 2:
            switch (below(8)) {
            case 0: return call(static_cast<std::int32_t>(below(600)) - 300);
            case 1: return word();                                // anything
            case 2: return with_number(2, 0x3A, below(16), 0, 5); // ticc
            case 3: return with_number(2, 0x3C + below(2), rd, rs1, small());
            case 4: return jmpl(rd, below(4), small() & ~3);
            default: return sethi(rd, word());
            }
        case 3:
        case 4:
        case 5: return memory(rd, rs2);
        case 6: { // state registers, the ancillary ones too
            constexpr std::uint32_t op3[] = {0x28, 0x29, 0x2A, 0x2B, 0x30, 0x31, 0x32, 0x3B};
            const std::uint32_t which = op3[below(8)];
            return which == 0x28 ? with_register(2, which, rd, chance(30) ? 0 : rs1, 0)
                                 : with_number(2, which, which == 0x30 && (rd == 17 || chance(30)) ? 0 : rd,
                                               which == 0x32 ? 0 : rs1, 0);
        }
        case 7:
        case 8:
        case 9:
        case 10: return floating();
        default: {
            const std::uint32_t op3 = below(0x28);
            return chance(50) ? with_number(2, op3, rd, rs1, small()) : with_register(2, op3, rd, rs1, rs2);
        }
        }
    }

private:
    std::uint32_t word() { return static_cast<std::uint32_t>(random_()); }
    std::int32_t small() { return static_cast<std::int32_t>(below(8192)) - 4096; }

    /// Mostly into data, sometimes into code, to a device or nowhere.
    std::uint32_t pointer()
    {
        switch (below(20)) {
        case 0: return code + 4 * below(words);
        case 1: return device_base;
        case 2: return word();
        default: return data + 8 * below(256) + 1024;
        }
    }

    std::uint32_t operand()
    {
        constexpr std::uint32_t corners[] = {0, 1, 2, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 0xFFFFFFFE, 4};
        return chance(30) ? pointer() : chance(40) ? corners[below(8)] : word();
    }

    /// Bits of a double, or of two singles.
    std::uint64_t number()
    {
        constexpr std::uint64_t corners[] = {
            0x0000000000000000, 0x8000000000000000, 0x0000000000000001, 0x000FFFFFFFFFFFFF, 0x0010000000000000,
            0x0010000000000001, 0x3FF0000000000000, 0x7FEFFFFFFFFFFFFF, 0x7FF0000000000000, 0xFFF0000000000000,
            0x7FF8000000000001, 0x7FF0000000000001, 0x41E0000000000000, 0xC1E0000000000000, 0x7F80000000000001,
            0x7F7FFFFF00800000, 0x3F8000007F800000, 0x007FFFFF7FC00001, 0x369FFFFFFFFFFFFF, 0x380FFFFFF0000000,
        };
        if (chance(40)) {
            return corners[below(std::size(corners))] ^ (chance(20) ? std::uint64_t{1} << 63 : 0);
        }
        const std::uint64_t bits = random_();
        return chance(70) ? (bits & 0x800FFFFFFFFFFFFF) | std::uint64_t{0x3F8 + below(16)} << 52 : bits;
    }

    std::uint32_t memory(std::uint32_t rd, std::uint32_t rs2)
    {
        constexpr std::uint32_t plain[] = {0x00, 0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0x07, 0x09, 0x0A, 0x0D,
                                           0x0F, 0x20, 0x20, 0x21, 0x23, 0x23, 0x24, 0x25, 0x26, 0x27, 0x27};
        constexpr std::uint32_t alternate[] = {0x10, 0x11, 0x12, 0x13, 0x14, 0x15, 0x16, 0x17, 0x19, 0x1A, 0x1D, 0x1F};
        const std::uint32_t rs1 = chance(90) ? 1 + below(3) : below(32);
        if (chance(8)) {
            const std::uint32_t asi = chance(60) ? 0x0A : below(256);
            return with_register(3, chance(30) ? 0x3C : alternate[below(12)], rd, rs1, chance(50) ? 0 : rs2, asi);
        }
        const std::uint32_t op3 = plain[below(std::size(plain))];
        const std::int32_t offset = chance(90) ? static_cast<std::int32_t>(8 * below(32)) : small();
        return with_number(3, op3, chance(80) ? rd & ~1u : rd, rs1, offset);
    }

    std::uint32_t floating()
    {
        constexpr std::uint32_t op1[] = {0x01, 0x05, 0x09, 0x29, 0x2A, 0x41, 0x42, 0x45, 0x46, 0x49, 0x4A,
                                         0x4D, 0x4E, 0x69, 0xC4, 0xC6, 0xC8, 0xC9, 0xD1, 0xD2, 0x43};
        constexpr std::uint32_t op2[] = {0x51, 0x52, 0x55, 0x56};
        const std::uint32_t rd = below(32), rs1 = below(32), rs2 = below(32);
        return chance(20) ? fpop(0x35, op2[below(4)], rd, rs1, rs2)
                          : fpop(0x34, op1[below(std::size(op1))], rd, rs1, rs2);
    }

    std::mt19937_64 random_;
};

} // namespace fledge::emulator::testing
