// SPDX-License-Identifier: Apache-2.0
// Two engines run the same random programs side by side, and must have the same state wherever both stop.
#pragma once

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <string>

#include "emulator/cpu/instruction.h"
#include "emulator/testing/random_program.h"

namespace fledge::emulator::testing {

using MakeEngine = std::unique_ptr<Engine> (*)();

inline std::string registers_of(const CpuState &s)
{
    char line[160];
    std::snprintf(line, sizeof line,
                  "pc %08x npc %08x psr %08x wim %02x y %08x fsr %08x mode %u tt %02x cycles %llu instructions %llu\n",
                  s.pc, s.npc, s.psr, s.wim, s.y, s.fsr, static_cast<unsigned>(s.mode), s.trap_type,
                  static_cast<unsigned long long>(s.cycles), static_cast<unsigned long long>(s.instructions));
    return line;
}

/// Run one program in slices of random length, with interrupts. Returns what differs, with the words before the place,
/// or an empty text.
inline std::string difference_of(std::uint64_t seed, MakeEngine make_a, MakeEngine make_b, int slices = 40)
{
    RandomProgram random(seed);
    const Timing timing = random.chance(50) ? plain_timing() : leon3_timing();
    SmallComputer a(make_a(), timing), b(make_b(), timing);
    a.core.fpu = b.core.fpu = random.chance(50) ? FpuPersonality::grfpu : FpuPersonality::qemu;
    random.load(a);
    std::ranges::copy(a.bus.bytes(), b.bus.bytes().begin());
    b.s = a.s;
    // A device that raises interrupts, a page that takes no writes, and pages that a debugger watches.
    const std::uint32_t protected_page = random.chance(10) ? ram_base + random.below(ram_size) : ram_base;
    const std::uint32_t watched_page = RandomProgram::data + page_size * random.below(2);
    const auto watch = random.chance(30) ? page_watch_read : random.chance(30) ? page_watch_write : PageFlags{};
    for (SmallComputer *c : {&a, &b}) {
        c->bus.on_device_write = [c](std::uint32_t, std::uint32_t value) {
            c->core.interrupt_level = value & 15;
            c->core.attention = true;
        };
        c->bus.on_device_read = [c](std::uint32_t) { return static_cast<std::uint32_t>(c->s.cycles); };
        c->bus.flags_of(protected_page) |= protected_page == ram_base ? 0 : page_protected;
        c->bus.flags_of(watched_page) |= watch;
    }
    for (int slice = 0; slice < slices; slice++) {
        const CpuState before = a.s;
        const std::uint64_t until = a.s.cycles + 1 + random.below(random.chance(50) ? 8 : 400);
        a.core.interrupt_level = b.core.interrupt_level = random.chance(20) ? random.below(16) : 0;
        if (random.chance(10)) {
            const std::uint32_t address = RandomProgram::code + 4 * random.below(RandomProgram::words);
            const bool on = random.chance(70);
            a.engine->set_breakpoint(a.core, address, on);
            b.engine->set_breakpoint(b.core, address, on);
        }
        const bool step_over = random.chance(80);
        const Exit exit_a = a.engine->run(a.core, until, step_over);
        const Exit exit_b = b.engine->run(b.core, until, step_over);
        if (exit_a != exit_b || !(a.s == b.s) || a.core.interrupt_level != b.core.interrupt_level ||
            a.core.attention != b.core.attention ||
            std::memcmp(a.bus.bytes().data(), b.bus.bytes().data(), ram_size) != 0) {
            std::string text = "seed " + std::to_string(seed) + " slice " + std::to_string(slice) + ", from\n" +
                               registers_of(before) + registers_of(a.s) + registers_of(b.s);
            for (std::uint32_t k = 0; k < 16; k++) {
                if (a.s.floats[k] != b.s.floats[k]) {
                    text += "float " + std::to_string(2 * k) + '\n';
                }
            }
            for (std::uint32_t k = 0; k < a.s.windows.size(); k++) {
                if (a.s.windows[k] != b.s.windows[k]) {
                    text += "register " + std::to_string(k % 16 + 8) + " of window " + std::to_string(k / 16) + '\n';
                }
            }
            for (std::uint32_t pc = a.s.pc - 48; pc != a.s.pc + 8; pc += 4) {
                if (pc - ram_base < ram_size) {
                    const std::uint32_t word = a.bus.load(pc);
                    char line[64];
                    std::snprintf(line, sizeof line, "%08x: %08x ", pc, word);
                    text += line + std::string(name_of(decode(word).op)) + '\n';
                }
            }
            return text;
        }
        if (a.s.mode == Mode::error || random.chance(5)) {
            random.restart(a);
            b.s = a.s;
        }
    }
    return "";
}

} // namespace fledge::emulator::testing
