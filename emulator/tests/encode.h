// SPDX-License-Identifier: Apache-2.0
// SPARC V8 instruction words, and a place to put them: what tests need of an assembler.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace fledge::emulator::testing {

inline constexpr std::uint32_t g0 = 0, g1 = 1, g2 = 2, g3 = 3, o7 = 15, l0 = 16, l1 = 17, l2 = 18, l3 = 19, l4 = 20,
                               l5 = 21, l6 = 22, l7 = 23, i0 = 24;

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
inline constexpr std::uint32_t add = 0x00, and_ = 0x01, or_ = 0x02, xor_ = 0x03, sub = 0x04, andn = 0x05, addcc = 0x10,
                               subcc = 0x14, sll = 0x25, rdy = 0x28, rdpsr = 0x29, rdwim = 0x2A, rdtbr = 0x2B,
                               wry = 0x30, wrpsr = 0x31, wrwim = 0x32, wrtbr = 0x33, fpop1 = 0x34, fpop2 = 0x35,
                               jmpl = 0x38, rett = 0x39, ticc = 0x3A, flush = 0x3B, save = 0x3C, restore = 0x3D;
}
namespace mem {
inline constexpr std::uint32_t ld = 0x00, ldd = 0x03, st = 0x04, std = 0x07, ldf = 0x20, ldfsr = 0x21, lddf = 0x23,
                               stf = 0x24, stfsr = 0x25, stdfq = 0x26, stdf = 0x27;
}
namespace condition {
inline constexpr std::uint32_t never = 0, e = 1, a = 8, ne = 9, g = 10;
}

inline constexpr std::uint32_t nop = 0x01000000;

/// Words at an address that grow; labels may be used before they are placed.
class Code {
public:
    explicit Code(std::uint32_t base) : base_(base) {}

    std::uint32_t pc() const { return base_ + 4 * static_cast<std::uint32_t>(words_.size()); }
    const std::vector<std::uint32_t> &words() const { return words_; }
    void word(std::uint32_t w) { words_.push_back(w); }

    void op(std::uint32_t op3, std::uint32_t rs1, std::uint32_t rs2, std::uint32_t rd)
    {
        word(format3(2, rd, op3, rs1, rs2));
    }
    void opi(std::uint32_t op3, std::uint32_t rs1, std::int32_t simm13, std::uint32_t rd)
    {
        word(format3(2, rd, op3, rs1, immediate(simm13)));
    }
    void memory(std::uint32_t op3, std::uint32_t rd, std::uint32_t rs1, std::int32_t simm13)
    {
        word(format3(3, rd, op3, rs1, immediate(simm13)));
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
    void trap(std::uint32_t number) { word(format3(2, condition::a, alu::ticc, 0, immediate(std::int32_t(number)))); }
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

inline void Code::link()
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

} // namespace fledge::emulator::testing
