// SPDX-License-Identifier: Apache-2.0
// The translator beside the reference: random programs, in slices of random length, with the same state at each end.
#include <bit>
#include <cmath>
#include <cstdint>
#include <random>
#include <string>
#include <thread>

#include <gtest/gtest.h>

#include "emulator/cpu/step.h"
#include "emulator/testing/differences.h"
#include "emulator/testing/encode.h"
#include "emulator/testing/small_computer.h"

namespace fledge::emulator {
namespace translator_test {

using namespace testing;

constexpr std::uint32_t program_words = 160;

/// Numbers, words and programs at random, with what is rare made frequent.
class Dice {
public:
    explicit Dice(std::uint64_t seed) : engine_(seed) {}

    std::uint32_t below(std::uint32_t n) { return static_cast<std::uint32_t>(engine_() % n); }
    bool one_in(std::uint32_t n) { return below(n) == 0; }
    std::uint32_t word() { return static_cast<std::uint32_t>(engine_()); }

    template <class T, std::size_t n> T of(const T (&values)[n]) { return values[below(n)]; }

    std::uint32_t number()
    {
        static constexpr std::uint32_t corners[] = {0,          1,          2,          0x7F,      0x80,
                                                    0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 0xFFFFFFFE};
        return one_in(2) ? of(corners) : one_in(2) ? below(256) : word();
    }

    std::uint64_t float_bits()
    {
        static constexpr std::uint64_t corners[] = {0,
                                                    0x8000000000000000,
                                                    0x3FF0000000000000,
                                                    0xBFF0000000000001,
                                                    0x7FF0000000000000,
                                                    0xFFF0000000000000,
                                                    0x7FF8000000000000,
                                                    0x7FF0000000000001,
                                                    0xFFFFFFFFFFFFFFFF,
                                                    0x0000000000000001,
                                                    0x800FFFFFFFFFFFFF,
                                                    0x0010000000000000,
                                                    0x8010000000000001,
                                                    0x7FEFFFFFFFFFFFFF,
                                                    0x3CA0000000000000,
                                                    0x41DFFFFFFFC00000,
                                                    0xC1E0000000000000,
                                                    0x3F8000003F800001,
                                                    0x0000000100800000,
                                                    0x7F8000007FC00000,
                                                    0x7F7FFFFF00800001,
                                                    0x4F0000007F800001};
        if (one_in(3)) {
            return of(corners);
        }
        const double x =
            (static_cast<double>(word()) / 4294967296.0 - 0.5) * std::ldexp(1.0, static_cast<int>(below(60)) - 30);
        return std::bit_cast<std::uint64_t>(x);
    }

    /// An instruction. %g6 and %g7 point to data, %g5 into the program; they rarely change.
    std::uint32_t instruction(std::uint32_t index)
    {
        switch (below(20)) {
        case 0:
        case 1:
        case 2:
        case 3:
        case 4:
        case 5: {
            static constexpr std::uint32_t op3[] = {
                0x00, 0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0x07, 0x08, 0x0A, 0x0B, 0x0C, 0x0E, 0x0F, 0x10, 0x11,
                0x12, 0x13, 0x14, 0x15, 0x16, 0x17, 0x18, 0x1A, 0x1B, 0x1C, 0x1E, 0x1F, 0x20, 0x21, 0x22, 0x23,
                0x24, 0x25, 0x26, 0x27, 0x00, 0x04, 0x10, 0x14, 0x02, 0x12, 0x08, 0x18, 0x28, 0x30};
            return arithmetic(of(op3));
        }
        case 6: return sethi(target(), word());
        case 7:
        case 8:
        case 9:
        case 10: {
            static constexpr std::uint32_t op3[] = {0x00, 0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0x07, 0x09, 0x0A,
                                                    0x0D, 0x0F, 0x20, 0x23, 0x24, 0x27, 0x20, 0x23, 0x24, 0x27};
            return memory(of(op3));
        }
        case 11:
        case 12:
        case 13:
        case 14: return floating();
        case 15:
        case 16: return branch(one_in(3) ? 6 : 2, below(16), one_in(2), displacement(index));
        case 17:
            return one_in(3)   ? call(displacement(index))
                   : one_in(2) ? jmpl(target(), 5, static_cast<std::int32_t>(4 * below(program_words)))
                               : nop;
        case 18: return one_in(2) ? save(target(), source(), small()) : restore(target(), source(), small());
        default: return rare(index);
        }
    }

private:
    std::uint32_t source() { return one_in(8) ? 0 : below(32); }
    std::uint32_t target()
    {
        const std::uint32_t r = below(32);
        return r >= 5 && r <= 7 && !one_in(50) ? 0 : r;
    }
    std::int32_t small()
    {
        return one_in(2) ? static_cast<std::int32_t>(below(17)) - 8 : static_cast<std::int32_t>(below(8192)) - 4096;
    }
    std::int32_t displacement(std::uint32_t index)
    {
        const auto to = static_cast<std::int32_t>(below(program_words)), near = static_cast<std::int32_t>(below(9)) - 3;
        return one_in(4) ? to - static_cast<std::int32_t>(index) : near;
    }

    std::uint32_t arithmetic(std::uint32_t op3)
    {
        return one_in(2) ? with_register(2, op3, target(), source(), source())
                         : with_number(2, op3, target(), source(), small());
    }

    std::uint32_t memory(std::uint32_t op3)
    {
        const std::uint32_t rd = op3 < 0x20 && (op3 & 4) == 0 ? target() : below(32), base = 6 + below(2);
        const bool pair = (op3 & 3) == 3 && op3 != 0x0F;
        if (one_in(20)) {
            return one_in(2) ? with_number(3, op3, rd, source(), small()) : with_register(3, op3, rd, base, source());
        }
        const std::uint32_t offset = one_in(12) ? below(4096) : pair ? 8 * below(16) : 4 * below(32);
        return with_number(3, op3,
                           pair && op3 < 0x20 ? rd & ~1u
                           : pair             ? rd & 30
                                              : rd,
                           base, static_cast<std::int32_t>(offset) - (one_in(2) ? 64 : 0));
    }

    std::uint32_t floating()
    {
        static constexpr std::uint32_t moves[] = {0x01, 0x05, 0x09};
        static constexpr std::uint32_t of_doubles[] = {0x2A, 0x42, 0x46, 0x4A, 0x4E, 0x42,
                                                       0x46, 0x4A, 0xC6, 0xC8, 0xD2};
        static constexpr std::uint32_t of_singles[] = {0x29, 0x41, 0x45, 0x49, 0x4D, 0x69, 0xC4, 0xC9, 0xD1};
        static constexpr std::uint32_t compares[] = {0x51, 0x52, 0x55, 0x56};
        const std::uint32_t even = one_in(40) ? 31 : 30;
        switch (below(8)) {
        case 0: return fpop(0x34, of(moves), below(32), 0, below(32));
        case 1: return fpop(0x35, of(compares), 0, below(32) & even, below(32) & even);
        case 2: return fpop(0x34, of(of_singles), below(32), below(32), below(32));
        default: return fpop(0x34, of(of_doubles), below(32) & even, below(32) & even, below(32) & even);
        }
    }

    std::uint32_t rare(std::uint32_t index)
    {
        switch (below(12)) {
        case 0: return word();
        case 1: return with_number(2, 0x3A, below(16), 0, static_cast<std::int32_t>(below(128)));
        case 2: return with_register(2, 0x28 + below(4), target(), 0, 0);
        case 3: return with_number(2, 0x32, 0, 0, 1 << below(8));            // wim
        case 4: return with_number(3, one_in(2) ? 0x21 : 0x25, 0, 6, 0x400); // fsr
        case 5:
            return with_number(3, 0x04, below(5), 5,
                               static_cast<std::int32_t>(4 * below(program_words))); // the program
        case 6: return with_number(3, one_in(2) ? 0x00 : 0x04, below(5), 4, 0);      // perhaps the device
        case 7: return with_number(2, 0x3B, 0, 5, 0);
        case 8: return with_register(3, 0x3C, target(), 6, source(), 0x0A);
        case 9: return fpop(0x34, one_in(2) ? 0x01 : 0x05, 2 * below(16), 0, 2 * below(16));
        default: return branch(2, 8, one_in(2), displacement(index));
        }
    }

    std::mt19937_64 engine_;
};

/// A trap returns to the instruction after the one that trapped.
void write_trap_table(SmallComputer &c)
{
    for (std::uint32_t entry = 0; entry < 256; entry++) {
        c.write(ram_base + 16 * entry, {jmpl(0, l(2), 0), rett(l(2), 4), nop, nop});
    }
}

void fill(SmallComputer &c, std::uint64_t seed)
{
    Dice dice(seed);
    write_trap_table(c);
    for (std::uint32_t k = 0; k < program_words; k++) {
        c.write(SmallComputer::start + 4 * k, {dice.instruction(k)});
    }
    c.write(SmallComputer::start + 4 * program_words, {ba(-static_cast<std::int32_t>(program_words)), nop});
    for (std::uint32_t k = 0; k < 512; k++) {
        const std::uint64_t bits =
            dice.one_in(2) ? dice.float_bits() : std::uint64_t{dice.number()} << 32 | dice.number();
        c.write(SmallComputer::data + 8 * k - 256,
                {static_cast<std::uint32_t>(bits >> 32), static_cast<std::uint32_t>(bits)});
    }
    static constexpr std::uint32_t modes[] = {0,          0,          0x00400000, 0x00400000,
                                              0x40000000, 0x80000000, 0x0F800000, 0x00400000};
    c.write(SmallComputer::data + 0x400, {dice.of(modes)});
    for (std::uint32_t &r : c.s.windows) {
        r = dice.number();
    }
    for (std::uint64_t &f : c.s.floats) {
        f = dice.float_bits();
    }
    for (std::uint32_t k = 1; k < 4; k++) {
        c.r(g(k)) = dice.number();
    }
    c.r(g(4)) = dice.one_in(2) ? device_base : SmallComputer::data;
    c.r(g(5)) = SmallComputer::start;
    c.r(g(6)) = SmallComputer::data;
    c.r(g(7)) = SmallComputer::data + 0x100;
    c.core.fpu = dice.one_in(2) ? FpuPersonality::grfpu : FpuPersonality::qemu;
    if (c.core.fpu == FpuPersonality::grfpu) { // the handler of fp_exception: std %fq,[%l3]
        c.write(ram_base + 16 * 8,
                {sethi(l(3), SmallComputer::data), with_number(3, 0x26, 0, l(3), 0), jmpl(0, l(2), 0), rett(l(2), 4)});
    }
    if (dice.one_in(8)) {
        c.s.psr &= ~psr::enable_fpu;
    }
    if (dice.one_in(2)) {
        c.s.fsr = fsr::nonstandard;
    }
    for (int k = 0; dice.one_in(4) && k < 3; k++) {
        c.engine->set_breakpoint(c.core, SmallComputer::start + 4 * dice.below(program_words), true);
    }
    c.bus.on_device_read = [&c](std::uint32_t) { return static_cast<std::uint32_t>(c.s.cycles); };
    c.bus.on_device_write = [&c](std::uint32_t, std::uint32_t value) {
        c.core.interrupt_level = value & 15;
        c.core.attention = true;
    };
    c.core.user = &c.core;
    c.core.acknowledge = [](void *core, std::uint32_t) { static_cast<Core *>(core)->interrupt_level = 0; };
}

/// Both run a program of that seed; returns what differs first.
std::string run_both(std::uint64_t seed)
{
    Dice dice(seed + 1'000'000'007);
    const Timing timing = dice.one_in(2) ? plain_timing() : leon3_timing();
    SmallComputer reference(make_interpreter(), timing), tested(make_translator(), timing);
    fill(reference, seed);
    fill(tested, seed);
    Exit last = Exit::time;
    for (int slice = 0; slice < 60; slice++) {
        static constexpr std::uint32_t lengths[] = {5, 60, 400, 2000};
        const std::uint64_t cycles = 1 + dice.below(dice.of(lengths));
        if (dice.one_in(6)) {
            reference.core.interrupt_level = tested.core.interrupt_level = dice.below(16);
        }
        if (dice.one_in(10)) { // a debugger begins or ends to watch, or the program is protected
            static constexpr std::uint8_t flags[] = {page_watch_read, page_watch_write, page_protected};
            const std::uint8_t flag = dice.of(flags);
            for (SmallComputer *c : {&reference, &tested}) {
                c->bus.flags_of(SmallComputer::data) ^= flag;
            }
        }
        const auto run = [&](SmallComputer &c) {
            return c.engine->run(c.core, c.s.cycles + cycles, last == Exit::breakpoint);
        };
        const Exit expected = run(reference), found = run(tested);
        last = expected;
        std::string text = differences(reference.s, tested.s);
        if (expected != found) {
            text += "exit: expected " + std::to_string(static_cast<int>(expected)) + ", found " +
                    std::to_string(static_cast<int>(found)) + "\n";
        }
        if (!std::ranges::equal(reference.bus.bytes(), tested.bus.bytes())) {
            text += "memory differs\n";
        }
        if (!text.empty()) {
            return "seed " + std::to_string(seed) + ", slice " + std::to_string(slice) + "\n" + text;
        }
        if (reference.s.mode != Mode::running) {
            for (SmallComputer *c : {&reference, &tested}) {
                c->s.mode = Mode::running;
                c->s.psr |= psr::enable_traps;
                c->go(SmallComputer::start + 4 * 8);
            }
        }
    }
    return "";
}

TEST(Translator, random_programs_give_the_states_of_the_reference)
{
    for (std::uint64_t seed = 1; seed <= 60; seed++) {
        const std::string text = run_both(seed);
        ASSERT_EQ(text, "");
    }
}

TEST(Translator, many_processors_run_in_several_threads)
{
    std::vector<std::string> differences(4);
    std::vector<std::thread> threads;
    for (std::size_t k = 0; k < differences.size(); k++) {
        threads.emplace_back([&text = differences[k], k] {
            for (std::uint64_t seed = 10'000 + 10 * k; seed < 10'003 + 10 * k && text.empty(); seed++) {
                text = run_both(seed);
            }
        });
    }
    for (std::thread &thread : threads) {
        thread.join();
    }
    for (const std::string &text : differences) {
        EXPECT_EQ(text, "");
    }
}

TEST(Translator, a_loop_that_changes_itself_executes_what_it_wrote)
{
    SmallComputer c(make_translator());
    // The loop adds 1 to %g1, and in its first round makes the instruction an addition of 2.
    c.write(SmallComputer::start,
            {add(g(1), g(1), 1), st(g(2), g(5), 0), subcc(g(3), g(3), 1), branch(2, 9, false, -3), nop, ba(0), nop});
    c.r(g(2)) = add(g(1), g(1), 2);
    c.r(g(3)) = 10;
    c.r(g(5)) = SmallComputer::start;
    c.steps(100);
    EXPECT_EQ(c.r(g(1)), 1 + 9 * 2u);
}

TEST(Translator, a_run_ends_at_its_first_boundary_in_a_chain_of_blocks)
{
    SmallComputer c(make_translator());
    c.write(SmallComputer::start, {add(g(1), g(1), 1), ba(-1), add(g(2), g(2), 1)});
    c.steps(3000); // the blocks are there
    for (std::uint64_t n = 1; n < 20; n++) {
        const std::uint64_t before = c.s.instructions;
        EXPECT_EQ(c.steps(n), Exit::time);
        EXPECT_EQ(c.s.instructions, before + n);
    }
}

} // namespace translator_test
} // namespace fledge::emulator
