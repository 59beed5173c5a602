// SPDX-License-Identifier: Apache-2.0
#include "emulator/testing/stream.h"

#include <array>
#include <bit>
#include <cstdio>
#include <cstring>
#include <map>
#include <random>

#include "emulator/testing/encode.h"

namespace fledge::emulator::testing {
namespace {

constexpr std::uint32_t g0 = g(0), g1 = g(1), g2 = g(2), o7 = o(7), l0 = l(0), l1 = l(1), l2 = l(2), l3 = l(3),
                        l4 = l(4), l5 = l(5), l6 = l(6), l7 = l(7);

/// Format 3 from its fields; of the last 14 bits any.
constexpr std::uint32_t format3(std::uint32_t op, std::uint32_t rd, std::uint32_t op3, std::uint32_t rs1,
                                std::uint32_t low14)
{
    return op << 30 | (rd & 31) << 25 | op3 << 19 | (rs1 & 31) << 14 | (low14 & 0x3FFF);
}
constexpr std::uint32_t immediate(std::int32_t simm13)
{
    return 0x2000u | (static_cast<std::uint32_t>(simm13) & 0x1FFFu);
}

/// The field op3 of what the tests write by hand.
namespace alu {
constexpr std::uint32_t add = 0x00, and_ = 0x01, or_ = 0x02, xor_ = 0x03, sub = 0x04, andn = 0x05, addcc = 0x10,
                        subcc = 0x14, sll = 0x25, rdy = 0x28, rdpsr = 0x29, rdwim = 0x2A, rdtbr = 0x2B, wry = 0x30,
                        wrpsr = 0x31, wrwim = 0x32, wrtbr = 0x33, fpop1 = 0x34, fpop2 = 0x35, jmpl = 0x38, rett = 0x39,
                        ticc = 0x3A, flush = 0x3B, save = 0x3C, restore = 0x3D;
}
namespace mem {
constexpr std::uint32_t ld = 0x00, ldd = 0x03, st = 0x04, std = 0x07, ldf = 0x20, ldfsr = 0x21, lddf = 0x23, stf = 0x24,
                        stfsr = 0x25, stdfq = 0x26, stdf = 0x27;
}
namespace condition {
constexpr std::uint32_t never = 0, e = 1, a = 8, ne = 9, g = 10, geu = 13;
}

/// Words at an address that grow; labels may be used before they are placed.
class Code {
public:
    explicit Code(std::uint32_t base) : base_(base) {}

    std::uint32_t pc() const { return base_ + 4 * static_cast<std::uint32_t>(words_.size()); }
    const std::vector<std::uint32_t> &words() const { return words_; }
    void word(std::uint32_t w) { words_.push_back(w); }

    void op(std::uint32_t op3, std::uint32_t rs1, std::uint32_t rs2, std::uint32_t rd)
    {
        word(with_register(2, op3, rd, rs1, rs2));
    }
    void opi(std::uint32_t op3, std::uint32_t rs1, std::int32_t simm13, std::uint32_t rd)
    {
        word(with_number(2, op3, rd, rs1, simm13));
    }
    void memory(std::uint32_t op3, std::uint32_t rd, std::uint32_t rs1, std::int32_t simm13)
    {
        word(with_number(3, op3, rd, rs1, simm13));
    }
    void sethi(std::uint32_t value, std::uint32_t rd) { word((rd & 31) << 25 | 4u << 22 | value >> 10); }
    void set(std::uint32_t value, std::uint32_t rd)
    {
        sethi(value, rd);
        opi(alu::or_, rd, static_cast<std::int32_t>(value & 0x3FF), rd);
    }
    /// A branch on icc (op2 = 2) or fcc (6) to a label.
    void branch(std::uint32_t cond, const std::string &label, bool annul = false, std::uint32_t op2 = 2)
    {
        fixups_.push_back({words_.size(), label});
        word((annul ? 1u : 0u) << 29 | cond << 25 | op2 << 22);
    }
    void call(const std::string &label)
    {
        fixups_.push_back({words_.size(), label});
        word(1u << 30);
    }
    /// `set` of a label's address.
    void set(const std::string &label, std::uint32_t rd)
    {
        fixups_.push_back({words_.size(), label});
        set(0, rd);
    }
    void trap(std::uint32_t number) { word(with_number(2, alu::ticc, condition::a, 0, std::int32_t(number))); }
    void place(const std::string &label) { labels_[label] = pc(); }
    std::uint32_t address(const std::string &label) const { return labels_.at(label); }

    /// Put the addresses of labels into the instructions that use them.
    void link();

private:
    struct Fixup {
        std::size_t at;
        std::string label;
    };
    std::uint32_t base_;
    std::vector<std::uint32_t> words_;
    std::vector<Fixup> fixups_;
    std::map<std::string, std::uint32_t> labels_;
};

void Code::link()
{
    for (const Fixup &f : fixups_) {
        const std::uint32_t target = labels_.at(f.label);
        const std::uint32_t distance = (target - base_) / 4 - static_cast<std::uint32_t>(f.at);
        std::uint32_t &w = words_[f.at];
        if (w >> 30 == 1)
            w |= distance & 0x3FFFFFFF;
        else if ((w >> 22 & 7) == 4) {
            w |= target >> 10;
            words_[f.at + 1] |= target & 0x3FF;
        } else
            w |= distance & 0x3FFFFF;
    }
    fixups_.clear();
}

constexpr std::uint32_t runtime_base = ram_base + 0x1000;
constexpr std::uint32_t variables = ram_base + 0x8000; // the present block, and the end of the last
constexpr std::uint32_t done_trap = 0x7F;              // `ta`: the block has ended

constexpr std::int32_t left = offsetof(Block, left);
constexpr std::int32_t at(std::size_t member)
{
    return static_cast<std::int32_t>(member);
}

// Into %psr; %g2 changes.
void write_psr(Code &c, std::uint32_t value)
{
    c.set(value, g2);
    c.op(alu::wrpsr, g2, g0, 0);
    for (int i = 0; i < 3; ++i)
        c.word(nop);
}

// What surrounds the blocks. A trap may use the locals of its window; all else keeps its value.
void write_runtime(Code &c)
{
    c.place("start");
    write_psr(c, 0x00001F80); // EF, PIL 15, S
    c.op(alu::wrwim, g0, g0, 0);
    c.set(ram_base, g2);
    c.op(alu::wrtbr, g2, g0, 0);
    c.set(blocks_base, g1);
    c.set(variables, g2);
    c.memory(mem::st, g1, g2, 0);

    c.place("load"); // %g1: the block
    c.memory(mem::ldfsr, 0, g1, at(offsetof(Record, fsr)));
    for (std::uint32_t f = 0; f < 32; f += 2)
        c.memory(mem::lddf, f, g1, at(offsetof(Record, floats) + 4 * f));
    for (std::uint32_t w = 0; w < 8; ++w) {
        for (std::uint32_t r = 0; r < 16; ++r)
            c.memory(mem::ld, l0 + r, g1, at(offsetof(Record, windows) + 64 * w + 4 * r));
        c.op(alu::restore, g0, g0, g0);
    }
    c.memory(mem::ld, g2, g1, at(offsetof(Record, y)));
    c.op(alu::wry, g2, g0, 0);
    c.memory(mem::ld, g2, g1, at(offsetof(Record, wim)));
    c.op(alu::wrwim, g2, g0, 0);
    c.memory(mem::ld, g2, g1, at(offsetof(Record, psr)));
    c.op(alu::wrpsr, g2, g0, 0);
    for (int i = 0; i < 3; ++i)
        c.word(nop);
    c.memory(mem::ld, l1, g1, at(offsetof(Record, pc)));
    c.opi(alu::add, l1, 4, l2);
    for (std::uint32_t r = 2; r < 8; ++r)
        c.memory(mem::ld, r, g1, at(offsetof(Record, globals) + 4 * (r - 1)));
    c.memory(mem::ld, g1, g1, at(offsetof(Record, globals)));
    c.op(alu::jmpl, l1, g0, g0);
    c.op(alu::rett, l2, g0, 0);

    c.place("done"); // %l0: PSR, %l1: pc, %l2: npc
    c.set(variables, l3);
    c.memory(mem::ld, l3, l3, 0);
    c.memory(mem::st, l0, l3, left + at(offsetof(Record, psr)));
    c.memory(mem::st, l1, l3, left + at(offsetof(Record, pc)));
    c.memory(mem::st, l2, l3, left + at(offsetof(Record, npc)));
    c.op(alu::rdwim, g0, g0, l0);
    c.memory(mem::st, l0, l3, left + at(offsetof(Record, wim)));
    c.op(alu::wrwim, g0, g0, 0);
    c.op(alu::rdy, g0, g0, l0);
    c.memory(mem::st, l0, l3, left + at(offsetof(Record, y)));
    for (std::uint32_t r = 1; r < 8; ++r)
        c.memory(mem::st, r, l3, left + at(offsetof(Record, globals) + 4 * (r - 1)));
    c.op(alu::or_, l3, g0, g1);
    write_psr(c, 0x00001F80);
    for (std::uint32_t w = 0; w < 8; ++w) {
        for (std::uint32_t r = 0; r < 16; ++r)
            c.memory(mem::st, l0 + r, g1, left + at(offsetof(Record, windows) + 64 * w + 4 * r));
        c.op(alu::restore, g0, g0, g0);
    }
    write_psr(c, 0x00001FA0); // a branch that is never taken takes a trap that the FPU has deferred
    c.word(condition::never << 25 | 6u << 22 | 2);
    c.word(nop);
    write_psr(c, 0x00001F80);
    c.memory(mem::stfsr, 0, g1, left + at(offsetof(Record, fsr)));
    for (std::uint32_t f = 0; f < 32; f += 2)
        c.memory(mem::stdf, f, g1, left + at(offsetof(Record, floats) + 4 * f));
    c.opi(alu::add, g1, sizeof(Block), g1);
    c.set(variables, g2);
    c.memory(mem::st, g1, g2, 0);
    c.memory(mem::ld, g2, g2, 4);
    c.op(alu::subcc, g1, g2, g0);
    c.branch(condition::ne, "load");
    c.word(nop);
    c.trap(0); // traps are disabled: the end
    c.word(nop);

    c.place("trap"); // %l0: PSR, %l1: pc, %l2: npc, %l3: TBR. Note it, and go on, behind the instruction that trapped.
    c.set(variables, l4);
    c.memory(mem::ld, l4, l4, 0);
    c.memory(mem::ld, l5, l4, at(offsetof(Block, trap_count)));
    c.opi(alu::add, l5, 1, l6);
    c.memory(mem::st, l6, l4, at(offsetof(Block, trap_count)));
    c.opi(alu::and_, l5, 15, l5);
    c.opi(alu::sll, l5, std::countr_zero(sizeof(TrapEntry)), l5);
    c.op(alu::add, l4, l5, l5);
    constexpr std::int32_t log = offsetof(Block, traps);
    c.memory(mem::st, l3, l5, log + at(offsetof(TrapEntry, tbr)));
    c.memory(mem::st, l1, l5, log + at(offsetof(TrapEntry, pc)));
    c.memory(mem::st, l2, l5, log + at(offsetof(TrapEntry, npc)));
    c.memory(mem::st, l0, l5, log + at(offsetof(TrapEntry, psr)));
    c.op(alu::rdwim, g0, g0, l6);
    c.memory(mem::st, l6, l5, log + at(offsetof(TrapEntry, wim)));
    c.opi(alu::add, l0, 1, l7); // the window that the program was in must be valid for its return
    c.opi(alu::and_, l7, 7, l7);
    c.opi(alu::or_, g0, 1, l4);
    c.op(alu::sll, l4, l7, l4);
    c.op(alu::andn, l6, l4, l6);
    c.op(alu::wrwim, l6, g0, 0);
    c.opi(alu::and_, l3, 0xFF0, l6);
    c.opi(alu::subcc, l6, 0x200, g0);
    c.branch(condition::geu, "skip");
    c.opi(alu::subcc, l6, 0x110, g0);
    c.branch(condition::geu, "back"); // an interrupt: the instruction follows
    c.word(nop);
    c.place("skip");
    c.op(alu::or_, l2, g0, l1);
    c.opi(alu::add, l2, 4, l2);
    c.opi(alu::subcc, l6, 0x080, g0); // fp_exception
    c.branch(condition::ne, "back");
    c.word(nop);
    c.place("queue"); // until the queue of the FPU is empty
    c.memory(mem::stfsr, 0, l5, log + at(offsetof(TrapEntry, fsr)));
    c.memory(mem::ld, l6, l5, log + at(offsetof(TrapEntry, fsr)));
    c.set(1u << 13, l7);
    c.op(alu::addcc, g0, g0, g0);
    c.op(0x11, l6, l7, g0); // andcc
    c.branch(condition::e, "back");
    c.word(nop);
    c.branch(condition::a, "queue");
    c.memory(mem::stdfq, 0, l5, log + at(offsetof(TrapEntry, unused)));
    c.place("back");
    c.op(alu::wrpsr, l0, g0, 0);
    for (int i = 0; i < 3; ++i)
        c.word(nop);
    c.op(alu::jmpl, l1, g0, g0);
    c.op(alu::rett, l2, g0, 0);
}

class Generator {
public:
    explicit Generator(const StreamOptions &options) : o_(options), random_(options.seed) {}

    std::uint32_t below(std::uint32_t n) { return static_cast<std::uint32_t>(random_() % n); }
    bool chance(std::uint32_t percent) { return below(100) < percent; }
    std::uint32_t bits() { return static_cast<std::uint32_t>(random_()); }
    template <std::size_t n> std::uint32_t one_of(const std::uint32_t (&values)[n]) { return values[below(n)]; }

    std::uint32_t integer()
    {
        switch (below(4)) {
        case 0:
            return one_of({0u, 1u, 2u, 3u, 0x7Fu, 0x80u, 0xFFu, 0x7FFFu, 0x8000u, 0xFFFFu, 0x10000u, 0x7FFFFFFFu,
                           0x80000000u, 0x80000001u, 0xFFFFFFFFu, 0xFFFFFFFEu, 0x40000000u, 0xC0000000u});
        case 1: return static_cast<std::uint32_t>(static_cast<std::int32_t>(bits()) >> below(32));
        case 2: return bits() >> below(32);
        default: return bits();
        }
    }

    std::uint32_t single()
    {
        std::uint32_t exponent = 0, fraction = 0;
        switch (below(8)) {
        case 0: exponent = 0; break;
        case 1: exponent = 255; break;
        case 2: exponent = one_of({1u, 2u, 23u, 24u, 231u, 253u, 254u}); break;
        case 3: exponent = 127 + 30 + below(4) - 1; break; // about the largest integers
        default: exponent = 127 - 12 + below(24); break;
        }
        switch (below(4)) {
        case 0: fraction = one_of({0u, 1u, 0x7FFFFFu, 0x400000u, 0x3FFFFFu, 0x400001u, 0x200000u}); break;
        case 1: fraction = bits() << below(23); break;
        default: fraction = bits(); break;
        }
        return bits() << 31 | exponent << 23 | (fraction & 0x7FFFFF);
    }

    std::uint64_t real()
    {
        if (chance(15)) {
            float f;
            const std::uint32_t s = single();
            std::memcpy(&f, &s, 4);
            if (f == f) // a double that is a single, or halfway to one
                return std::bit_cast<std::uint64_t>(double{f}) + (chance(50) ? 0x10000000u : 0u);
        }
        std::uint64_t exponent = 0, fraction = 0;
        switch (below(8)) {
        case 0: exponent = 0; break;
        case 1: exponent = 2047; break;
        case 2: exponent = one_of({1u, 2u, 52u, 53u, 2045u, 2046u}); break;
        case 3: exponent = 1023 + 30 + below(4) - 1; break;
        case 4: exponent = 1023 - 152 + below(8); break; // about the smallest singles
        default: exponent = 1023 - 25 + below(50); break;
        }
        const std::uint64_t any = std::uint64_t{bits()} << 32 | bits();
        switch (below(4)) {
        case 0: {
            const std::uint64_t corners[] = {
                0, 1, (1ull << 52) - 1, 1ull << 51, (1ull << 51) - 1, (1ull << 51) + 1, 1ull << 28, 1ull << 29};
            fraction = corners[below(8)];
            break;
        }
        case 1: fraction = any << below(52); break;
        default: fraction = any; break;
        }
        return std::uint64_t{below(2)} << 63 | exponent << 52 | (fraction & ((1ull << 52) - 1));
    }

    Record given()
    {
        Record r{};
        trapping_ = chance(15);
        r.psr =
            0x00000F80 | below(8) | (chance(80) ? 1u << 6 : 0u) | (chance(92) ? 1u << 12 : 0u) | (bits() & 0x00F00000);
        r.psr &= ~0xF00u | below(16) << 8;
        // The block's window must be valid; the trap window may be invalid.
        r.wim = chance(60) ? 1u << below(8) : chance(50) ? bits() & 0xFF : 0;
        r.wim &= ~(1u << ((r.psr + 1) & 7));
        r.y = integer();
        r.fsr = fsr();
        for (int f = 0; f < 32; f += 2) {
            if (chance(60)) {
                const std::uint64_t d = real();
                r.floats[f] = static_cast<std::uint32_t>(d >> 32);
                r.floats[f + 1] = static_cast<std::uint32_t>(d);
            } else {
                r.floats[f] = chance(80) ? single() : integer();
                r.floats[f + 1] = chance(80) ? single() : integer();
            }
        }
        for (auto &window : r.windows)
            for (std::uint32_t &v : window)
                v = integer();
        for (std::uint32_t &v : r.globals)
            v = integer();
        r.globals[7] = 0;
        return r;
    }

    void block(Code &c, std::uint32_t data)
    {
        data_ = data;
        units_ = 6 + below(30);
        loops_ = 0;
        for (unit_ = 0; unit_ < units_; ++unit_) {
            c.place(label(unit_));
            unit(c);
        }
        c.place(label(unit_));
        c.trap(done_trap);
        c.word(nop);
    }

private:
    std::string label(std::uint32_t unit) const { return std::to_string(data_) + "u" + std::to_string(unit); }
    std::string later() { return label(unit_ + 1 + below(std::min(units_ - unit_, 4u))); }
    std::uint32_t reg() { return below(32); }
    std::uint32_t other(std::uint32_t than)
    {
        for (;;)
            if (const std::uint32_t r = reg(); r != than && r != 0)
                return r;
    }
    std::uint32_t second() // rs2 or an immediate
    {
        if (chance(50))
            return reg();
        return immediate(static_cast<std::int32_t>(
            chance(30) ? one_of({0u, 1u, 0xFFFFFFFFu, 4095u, 0xFFFFF000u, 31u, 32u, 2u, 3u}) : bits()));
    }
    std::uint32_t fsr() // rounding, and seldom traps; NS is not set
    {
        std::uint32_t v = below(4) << 30 | (bits() & 0x3FF) | below(4) << 10;
        if (trapping_ && chance(70))
            v |= bits() & (31u << 23);
        return v;
    }

    void arithmetic(Code &c)
    {
        static constexpr std::uint32_t ops[] = {0x00, 0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0x07, 0x08, 0x0A, 0x0B, 0x0C,
                                                0x0E, 0x0F, 0x10, 0x11, 0x12, 0x13, 0x14, 0x15, 0x16, 0x17, 0x18, 0x1A,
                                                0x1B, 0x1C, 0x1E, 0x1F, 0x20, 0x21, 0x22, 0x23, 0x24, 0x25, 0x26, 0x27,
                                                0x08, 0x0C, 0x18, 0x1C, 0x24, 0x0E, 0x0F, 0x1E, 0x1F};
        const std::uint32_t op3 = ops[below(std::size(ops))];
        if ((op3 == 0x18 || op3 == 0x1C) && o_.for_qemu) // addxcc, subxcc: not behind a logic operation
            c.word(format3(2, reg(), op3 & ~0x08u, reg(), second()));
        c.word(format3(2, reg(), op3, reg(), second()));
    }

    // One instruction alone, for a delay slot.
    void alone(Code &c, void (Generator::*make)(Code &))
    {
        Code instruction(0);
        do {
            instruction = Code(0);
            (this->*make)(instruction);
        } while (instruction.words().size() > 1);
        c.word(instruction.words()[0]);
    }
    void simple(Code &c) { alone(c, &Generator::arithmetic); }

    void floating(Code &c)
    {
        constexpr std::uint32_t fadds = 0x41, fstod = 0xC9;
        static constexpr std::uint32_t first[] = {0x01, 0x05, 0x09, 0x29, 0x2A, 0x41, 0x42, 0x45, 0x46, 0x49,
                                                  0x4A, 0x4D, 0x4E, 0x69, 0xC4, 0xC6, 0xC8, 0xC9, 0xD1, 0xD2,
                                                  0x41, 0x42, 0x45, 0x46, 0x49, 0x4A, 0x4D, 0x4E};
        static constexpr std::uint32_t singles[] = {0x01, 0x29, 0x41, 0x45, 0x49, 0x4D, 0xC4, 0xC6, 0xD1, 0xD2};
        static constexpr std::uint32_t compares[] = {0x51, 0x52, 0x55, 0x56};
        std::uint32_t rd = reg(), rs1 = reg(), rs2 = reg();
        if (chance(95)) // doubles mostly at even registers, as the manual asks
            rd &= ~1u, rs1 &= ~1u, rs2 &= ~1u;
        if (chance(2)) { // of four words: the LEON3 has none
            static constexpr std::uint32_t quads[] = {0x2B, 0x43, 0x47, 0x4B, 0x4F, 0x6E,
                                                      0xC7, 0xCB, 0xCC, 0xCD, 0xCE, 0xD3};
            c.word(format3(2, rd & ~3u, alu::fpop1, rs1 & ~3u, quads[below(std::size(quads))] << 5 | (rs2 & ~3u)));
        } else if (chance(15))
            c.word(format3(2, 0, alu::fpop2, rs1, compares[below(4)] << 5 | rs2));
        else {
            const bool single = trapping_ && o_.for_qemu;
            const std::uint32_t opf = single ? singles[below(std::size(singles))] : first[below(std::size(first))];
            if (opf == fstod && o_.for_qemu) // not of a signaling NaN: this makes it quiet
                c.word(format3(2, rs2, alu::fpop1, rs2, fadds << 5 | rs2));
            c.word(format3(2, rd, alu::fpop1, rs1, opf << 5 | rs2));
        }
    }

    // An address in the block's data, in a register, before an access; accesses are then `[%base + offset]`.
    void point(Code &c)
    {
        base_ = other(0);
        offset_ = below(data_size) & ~7u;
        c.set(data_ + offset_, base_);
    }

    void access(Code &c)
    {
        struct Kind {
            std::uint32_t op3, size;
        };
        static constexpr Kind kinds[] = {{0x00, 4}, {0x01, 1}, {0x02, 2}, {0x03, 8}, {0x04, 4}, {0x05, 1},
                                         {0x06, 2}, {0x07, 8}, {0x09, 1}, {0x0A, 2}, {0x0D, 1}, {0x0F, 4},
                                         {0x20, 4}, {0x23, 8}, {0x24, 4}, {0x27, 8}, {0x25, 4}};
        const Kind &kind = kinds[below(std::size(kinds))];
        std::uint32_t move = below(8) & ~(kind.size - 1);
        if (chance(4))
            move = kind.op3 >= 0x20 && kind.size == 8 && o_.for_qemu ? 0 : below(8); // not aligned: a trap
        std::uint32_t rd = reg();
        if (kind.size == 8 && chance(98))
            rd &= ~1u;
        if (kind.op3 < 0x20 && chance(8)) { // of an alternate space, data of the supervisor or of the user
            if (kind.size == 8 && o_.for_qemu)
                rd &= ~1u;
            const std::uint32_t asi = o_.for_qemu || chance(50) ? 0x0Bu : bits() & 0xFF;
            c.word(format3(3, rd, kind.op3 | 0x10, base_, asi << 5));
            return;
        }
        if (chance(4)) { // casa: compares with %rs2; in the user's space
            c.word(format3(3, rd, 0x3C, base_, 0x0Au << 5 | reg()));
            return;
        }
        c.memory(kind.op3, rd, base_, static_cast<std::int32_t>(move));
    }

    void delayed(Code &c, bool pointed)
    {
        switch (below(pointed ? 7 : 5)) {
        case 0: c.word(nop); break;
        case 1: alone(c, &Generator::floating); break;
        case 2: c.op(chance(50) ? alu::save : alu::restore, reg(), reg(), reg()); break;
        case 5:
        case 6: access(c); break;
        default: simple(c); break;
        }
    }

    void transfer(Code &c)
    {
        bool pointed = chance(40);
        if (pointed)
            point(c);
        const bool annul = chance(40);
        switch (below(8)) {
        case 0:
            c.call(later());
            pointed = pointed && base_ != o7;
            break;
        case 1: {
            const std::uint32_t r = pointed ? other(base_) : other(0);
            c.set(later(), r);
            std::uint32_t rd = reg();
            if (pointed && rd == base_)
                rd = 0;
            // Seldom to an address that is not aligned: it traps, and the delay slot is simply next.
            c.opi(alu::jmpl, r, chance(4) && !o_.for_qemu ? 2 : 0, rd);
            break;
        }
        case 2:
        case 3: c.branch(below(16), later(), annul, 6); break;
        case 4: { // the delay slot of an unconditional branch holds another
            const bool plain = o_.for_qemu || chance(50);
            const std::string landing = label(unit_) + "l";
            c.branch(condition::a, landing);
            c.branch(plain ? condition::a : below(16), later(), annul && !o_.for_qemu);
            simple(c);
            c.place(landing); // where one instruction is executed
            return simple(c);
        }
        default: c.branch(below(16), later(), annul); break;
        }
        delayed(c, pointed);
    }

    // The counter lies in memory and is not set again, so that a block always ends.
    void loop(Code &c)
    {
        const std::uint32_t counter = other(0), value = other(counter);
        c.set(data_ + data_size + 4 * loops_, counter); // behind what accesses reach
        ++loops_;
        c.memory(mem::ld, value, counter, 0);
        c.opi(alu::subcc, value, 1, value);
        c.memory(mem::st, value, counter, 0);
        c.branch(condition::g, label(below(unit_ + 1)), chance(30));
        delayed(c, false);
    }

    // A word of a later place becomes another instruction.
    void modify(Code &c)
    {
        const std::uint32_t where = other(0), word = other(where);
        const std::string target = label(unit_) + "m";
        Code patch(0);
        simple(patch);
        c.set(patch.words()[0], word);
        c.set(target, where);
        c.memory(mem::st, word, where, 0);
        c.opi(alu::flush, where, 0, 0);
        c.branch(condition::a, target);
        c.word(nop);
        c.place(target);
        c.word(nop);
    }

    void status(Code &c)
    {
        const std::uint32_t r = other(0), q = other(r);
        switch (below(10)) {
        case 8: c.op(alu::rdy, ancillary(false), g0, reg()); break;
        case 9:
            if (const std::uint32_t n = ancillary(true);
                n == 17) { // but no single vector: the table has no handler for it
                c.sethi(bits() & ~(1u << 13), q);
                c.op(alu::wry, q, g0, n);
            } else {
                c.word(format3(2, n, alu::wry, reg(), second()));
            }
            break;
        case 0: c.op(alu::rdy, g0, g0, reg()); break;
        case 1: c.word(format3(2, 0, alu::wry, reg(), second())); break;
        case 2: c.op(alu::rdpsr, g0, g0, reg()); break;
        case 3: c.op(alu::rdwim, g0, g0, reg()); break;
        case 4: c.op(alu::rdtbr, g0, g0, reg()); break;
        case 5: c.opi(alu::wrwim, g0, static_cast<std::int32_t>(bits() & 0xFF), 0); break;
        case 6: // rounding and traps of the FPU
            point(c);
            c.set(fsr(), other(base_));
            c.memory(mem::st, c.words().back() >> 25 & 31, base_, 0);
            c.memory(mem::ldfsr, 0, base_, 0);
            break;
        default: // turn some bits of PSR over, but not ET: icc, EF, PIL, S, PS, CWP
            c.op(alu::rdpsr, g0, g0, r);
            c.sethi(bits() & 0x00F01000 & (chance(70) ? ~0x1000u : ~0u), q);
            c.op(alu::xor_, r, q, r);
            c.word(format3(2, 0, alu::wrpsr, r,
                           immediate(static_cast<std::int32_t>((chance(50) ? bits() & 0xF00 : 0) |
                                                               (chance(20) ? 0x80 : 0) | (bits() & 0x40) |
                                                               (chance(5) ? 0x18 : 0) | (chance(50) ? below(8) : 0)))));
            for (int i = 0; i < 3; ++i)
                c.word(nop);
            break;
        }
    }

    // An ancillary state register. Stock QEMU has none but 17, lets users write all, and reads the others as Y.
    std::uint32_t ancillary(bool write)
    {
        for (;;) {
            const std::uint32_t n = 1 + below(31);
            const bool special = n == 17 || n == 19 || (n >= 21 && n <= 23), privileged = n >= 16 && n != 18;
            const bool sleeps = write && n == 19;
            if (o_.for_qemu ? !(write ? privileged : special) : !sleeps)
                return n;
        }
    }

    void refused(Code &c)
    {
        switch (below(6)) {
        case 0: c.word(bits() & 0x003FFFFF); break; // unimp
        case 1: c.word(format3(2, reg(), one_of({0x09u, 0x0Du, 0x19u, 0x1Du}), reg(), bits())); break;
        case 2: c.word(format3(3, reg(), one_of({0x08u, 0x0Bu, 0x0Cu, 0x0Eu}), reg(), bits())); break;
        case 3: c.opi(alu::rett, g0, std::int32_t(4 * below(100)), 0); break;      // traps are enabled
        case 4: c.branch(below(16), later(), chance(50), 7); return c.word(nop);   // cbccc
        default: c.word(format3(2, reg(), 0x36 + below(2), reg(), bits())); break; // cpop1, cpop2
        }
    }

    void unit(Code &c)
    {
        const std::uint32_t kind = below(100);
        if (kind < 26)
            arithmetic(c);
        else if (kind < 46)
            floating(c);
        else if (kind < 60) {
            point(c);
            access(c);
        } else if (kind < 76)
            transfer(c);
        else if (kind < 81)
            c.word(format3(2, reg(), chance(50) ? alu::save : alu::restore, reg(), second()));
        else if (kind < 87)
            status(c);
        else if (kind < 89) // ticc; not with the number that ends the block
            c.word(format3(2, below(16), alu::ticc, 0, immediate(std::int32_t(1 + below(0x7E)))));
        else if (kind < 91)
            refused(c);
        else if (kind < 93)
            c.word((reg() << 25) | 4u << 22 | (bits() & 0x3FFFFF)); // sethi
        else if (kind < 94) {
            point(c);
            c.opi(alu::flush, base_, 0, 0);
        } else if (kind < 95 && !o_.for_qemu) { // nothing, the interrupt controller, a hole of the APB
            const std::uint32_t device = one_of({0x80000208u, 0x80000280u, 0x80000500u});
            c.set(chance(50) ? 0x20000000 + (bits() & 0xFFFFF8) : device, base_ = other(0));
            access(c);
        } else if (kind < 96 && !o_.for_qemu && chance(50)) { // only reads, so that interrupts go on
            c.set(one_of({0x80000200u, 0x80000300u}) + 4 * below(20), base_ = other(0));
            c.memory(mem::ld, reg(), base_, 0);
        } else if (kind < 96 && !o_.for_qemu)
            modify(c);
        else if (kind < 97 && o_.sleep)
            c.op(alu::wry, g0, g0, 19); // %asr19
        else if (loops_ < loop_slots && unit_ > 0)
            loop(c);
        else
            arithmetic(c);
    }

public:
    static constexpr std::uint32_t loop_slots = 4;

private:
    StreamOptions o_;
    std::mt19937_64 random_;
    bool trapping_ = false; // floating-point exceptions trap in this block
    std::uint32_t data_ = 0, units_ = 0, unit_ = 0, loops_ = 0, base_ = 1, offset_ = 0;
};

void put(std::vector<std::uint8_t> &image, std::uint32_t address, std::uint32_t word)
{
    for (std::uint32_t i = 0; i < 4; ++i)
        image[address - ram_base + i] = static_cast<std::uint8_t>(word >> (24 - 8 * i));
}

std::uint32_t get(const std::vector<std::uint8_t> &image, std::uint32_t address)
{
    std::uint32_t w = 0;
    for (std::uint32_t i = 0; i < 4; ++i)
        w = w << 8 | image[address - ram_base + i];
    return w;
}

std::string member(std::uint32_t offset)
{
    static constexpr const char *names[] = {"psr", "pc", "npc", "wim", "y", "fsr"};
    char text[40];
    if (offset < 24)
        return names[offset / 4];
    if (offset < offsetof(Record, windows)) {
        std::snprintf(text, sizeof text, "%%f%u", (offset - 24) / 4);
        return text;
    }
    if (offset < offsetof(Record, globals)) {
        const auto o = static_cast<std::uint32_t>((offset - offsetof(Record, windows)) / 4);
        std::snprintf(text, sizeof text, "window %u %%%c%u", o / 16, o % 16 < 8 ? 'l' : 'i', o % 8);
        return text;
    }
    std::snprintf(text, sizeof text, "%%g%u", static_cast<std::uint32_t>((offset - offsetof(Record, globals)) / 4 + 1));
    return text;
}

} // namespace

Stream make_stream(const StreamOptions &options)
{
    Generator generate(options);
    Stream s;
    const std::uint32_t data_stride = data_size + 64; // with the counters of loops
    s.data = blocks_base + options.blocks * sizeof(Block);
    const std::uint32_t code_base = (s.data + options.blocks * data_stride + 0xFFFF) & ~0xFFFFu;

    Code runtime(runtime_base);
    write_runtime(runtime);
    runtime.link();
    s.entry = runtime_base;

    Code out(code_base);
    std::vector<Record> given;
    for (std::uint32_t b = 0; b < options.blocks; ++b) {
        given.push_back(generate.given());
        s.first.push_back(given.back().pc = out.pc());
        generate.block(out, s.data + b * data_stride);
    }
    s.first.push_back(out.pc());
    out.link();

    s.size = 1u << 20;
    while (ram_base + s.size < out.pc() + 0x1000)
        s.size *= 2;
    s.image.assign(s.size, 0);

    // The trap table: its entries end in the runtime.
    for (std::uint32_t type = 0; type < 256; ++type) {
        Code entry(ram_base + 16 * type);
        entry.op(alu::rdpsr, g0, g0, l0);
        const std::uint32_t target = runtime.address(type == 0x80 + done_trap ? "done" : "trap");
        entry.word(condition::a << 25 | 2u << 22 | ((target - entry.pc()) / 4 & 0x3FFFFF));
        entry.op(alu::rdtbr, g0, g0, l3);
        entry.word(nop);
        for (std::uint32_t i = 0; i < 4; ++i)
            put(s.image, ram_base + 16 * type + 4 * i, entry.words()[i]);
    }
    for (std::size_t i = 0; i < runtime.words().size(); ++i)
        put(s.image, runtime_base + static_cast<std::uint32_t>(4 * i), runtime.words()[i]);
    for (std::size_t i = 0; i < out.words().size(); ++i)
        put(s.image, code_base + static_cast<std::uint32_t>(4 * i), out.words()[i]);
    put(s.image, variables + 4, s.data);

    for (std::uint32_t b = 0; b < options.blocks; ++b) {
        std::array<std::uint32_t, sizeof(Record) / 4> words;
        std::memcpy(words.data(), &given[b], sizeof(Record));
        for (std::uint32_t i = 0; i < words.size(); ++i)
            put(s.image, static_cast<std::uint32_t>(blocks_base + b * sizeof(Block) + 4 * i), words[i]);
        const std::uint32_t block_data = s.data + b * data_stride;
        for (std::uint32_t i = 0; i < data_size; i += 8) {
            const std::uint64_t d = generate.real();
            put(s.image, block_data + i, static_cast<std::uint32_t>(d >> 32));
            put(s.image, block_data + i + 4, static_cast<std::uint32_t>(d));
        }
        for (std::uint32_t i = 0; i < Generator::loop_slots; ++i)
            put(s.image, block_data + data_size + 4 * i, 1 + generate.below(options.loop));
    }
    return s;
}

std::string compare(const Stream &stream, const std::vector<std::uint8_t> &expected,
                    const std::vector<std::uint8_t> &found)
{
    for (std::uint32_t a = ram_base; a < ram_base + stream.size; a += 4) {
        const std::uint32_t want = get(expected, a), have = get(found, a);
        if (want == have)
            continue;
        char text[200];
        if (a >= blocks_base && a < stream.data) {
            const auto block = static_cast<std::uint32_t>((a - blocks_base) / sizeof(Block));
            const auto offset = static_cast<std::uint32_t>((a - blocks_base) % sizeof(Block));
            std::string what = offset < offsetof(Block, left)         ? "given"
                               : offset < offsetof(Block, trap_count) ? member(offset - left)
                               : offset < offsetof(Block, traps)      ? "number of traps"
                                                                      : "trap";
            if (what == "trap") {
                static constexpr const char *names[] = {"tbr", "pc", "npc", "psr", "wim", "fsr", "queue", "queue"};
                const std::uint32_t o = offset - static_cast<std::uint32_t>(offsetof(Block, traps));
                what += " " + std::to_string(o / sizeof(TrapEntry)) + " " + names[o % sizeof(TrapEntry) / 4];
            }
            std::snprintf(text, sizeof text, "block %u (code from %08x to %08x): %s is %08x, expected %08x", block,
                          stream.first[block], stream.first[block + 1], what.c_str(), have, want);
        } else
            std::snprintf(text, sizeof text, "memory at %08x is %08x, expected %08x", a, have, want);
        return text;
    }
    return "";
}

} // namespace fledge::emulator::testing
