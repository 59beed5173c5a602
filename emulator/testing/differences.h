// SPDX-License-Identifier: Apache-2.0
// Two states of a processor, member by member.
#pragma once

#include <cstdio>
#include <string>

#include "emulator/cpu/state.h"

namespace fledge::emulator::testing {

/// All members of two states that differ, one per line.
inline std::string differences(const CpuState &a, const CpuState &b)
{
    std::string text;
    const auto check = [&text](const std::string &name, std::uint64_t x, std::uint64_t y) {
        char line[120];
        std::snprintf(line, sizeof line, "  %s is %llx, expected %llx\n", name.c_str(),
                      static_cast<unsigned long long>(y), static_cast<unsigned long long>(x));
        if (x != y)
            text += line;
    };
    for (std::size_t i = 0; i < a.globals.size(); ++i)
        check("%g" + std::to_string(i), a.globals[i], b.globals[i]);
    for (std::size_t i = 0; i < a.windows.size(); ++i)
        check("window " + std::to_string(i / 16) + " register " + std::to_string(8 + i % 16), a.windows[i],
              b.windows[i]);
    for (std::size_t i = 0; i < a.floats.size(); ++i)
        check("%f" + std::to_string(2 * i), a.floats[i], b.floats[i]);
    check("pc", a.pc, b.pc);
    check("npc", a.npc, b.npc);
    check("psr", a.psr, b.psr);
    check("wim", a.wim, b.wim);
    check("tbr", a.tbr, b.tbr);
    check("y", a.y, b.y);
    check("fsr", a.fsr, b.fsr);
    check("fp queue", std::uint64_t{a.fp_queue.pc} << 32 | a.fp_queue.word,
          std::uint64_t{b.fp_queue.pc} << 32 | b.fp_queue.word);
    check("fp queue trapped", a.fp_queue.trapped, b.fp_queue.trapped);
    check("asr17", a.asr17, b.asr17);
    check("asr22", a.asr22, b.asr22);
    check("cache control", a.cache_control, b.cache_control);
    check("mode", static_cast<std::uint64_t>(a.mode), static_cast<std::uint64_t>(b.mode));
    check("trap type", a.trap_type, b.trap_type);
    check("cycles", a.cycles, b.cycles);
    check("instructions", a.instructions, b.instructions);
    check("traps", a.traps, b.traps);
    return text;
}

} // namespace fledge::emulator::testing
