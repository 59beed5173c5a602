// SPDX-License-Identifier: Apache-2.0
// Programs of words for machines of testing/board.h.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "emulator/elf.h"
#include "emulator/testing/encode.h"
#include "emulator/testing/make_elf.h"

namespace fledge::emulator::testing {

inline constexpr std::uint32_t base = 0x40000000, code = base + 0x1000, data = base + 0x8000;

using Words = std::vector<std::uint32_t>;

inline Words operator+(Words a, const Words &b)
{
    a.insert(a.end(), b.begin(), b.end());
    return a;
}

constexpr std::uint32_t wr_psr(std::uint32_t rs1, std::int32_t number)
{
    return with_number(2, 0x31, 0, rs1, number);
}
constexpr std::uint32_t wr_tbr(std::uint32_t rs1)
{
    return with_number(2, 0x33, 0, rs1, 0);
}
inline constexpr std::uint32_t power_down = with_number(2, 0x30, 19, 0, 0);

/// rd = value
inline Words set(std::uint32_t rd, std::uint32_t value)
{
    return {sethi(rd, value), or_(rd, rd, static_cast<std::int32_t>(value & 0x3FF))};
}

/// Store a value at an address; %g1 and %g2 change.
inline Words store(std::uint32_t address, std::uint32_t value)
{
    return set(g(1), address) + set(g(2), value) + Words{st(g(2), g(1), 0)};
}

/// Traps on, window 6, the trap table at the beginning of RAM; %g1 changes. Seven instructions.
inline Words prologue()
{
    return set(g(1), base) + Words{wr_tbr(g(1)), wr_psr(0, 0xE6), nop, nop, nop};
}

/// The trap table: an interrupt or trap adds 1 to %g6, and goes on; interrupts at the present, traps behind it.
inline Words trap_table()
{
    Words words;
    for (std::uint32_t type = 0; type < 256; type++) {
        const bool interrupt = type > 0x10 && type < 0x20;
        words = words + (interrupt ? Words{add(g(6), g(6), 1), jmpl(0, l(1), 0), rett(l(2), 0), nop}
                                   : Words{add(g(6), g(6), 1), jmpl(0, l(2), 0), rett(l(2), 4), nop});
    }
    return words;
}

/// The trap table and, at `code`, the words behind the prologue, as one program that starts there.
inline std::vector<std::byte> program_file(const Words &words)
{
    Words all = trap_table();
    all.resize((code - base) / 4);
    all = all + prologue() + words;
    auto file = make_elf(base, all, {{"main", code, static_cast<std::uint32_t>(4 * all.size()) - (code - base)}});
    // The entry is `code`.
    file[24 + 2] = static_cast<std::byte>(code >> 8 & 0xFF);
    return file;
}

} // namespace fledge::emulator::testing
