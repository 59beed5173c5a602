// SPDX-License-Identifier: Apache-2.0
// Traps, and what happens between two instructions.
#include "emulator/cpu/step.h"

namespace fledge::emulator {

void take_trap(Core &core, std::uint32_t trap_type)
{
    CpuState &s = core.state;
    s.cycles += core.timing.trap;
    s.traps++;
    s.trap_type = trap_type;
    if ((s.psr & psr::enable_traps) == 0) {
        s.mode = Mode::error;
        return;
    }
    s.tbr = (s.tbr & 0xFFFFF000u) | trap_type << 4;
    const std::uint32_t previous = (s.psr & psr::supervisor) != 0 ? psr::previous_supervisor : 0;
    const std::uint32_t window = ((s.psr & psr::cwp) + window_count - 1) % window_count;
    s.psr = (s.psr & ~(psr::enable_traps | psr::previous_supervisor | psr::cwp)) | psr::supervisor | previous | window;
    Banks r(s);
    r[17] = s.pc;
    r[18] = s.npc;
    s.pc = (s.asr17 & asr::single_vector) != 0 ? s.tbr & 0xFFFFF000u : s.tbr;
    s.npc = s.pc + 4;
}

Boundary at_boundary(Core &core, std::uint64_t until, bool watched, bool step_over, Exit &exit)
{
    CpuState &s = core.state;
    const auto leave = [&exit](Exit reason) {
        exit = reason;
        return Boundary::exit;
    };
    if (s.mode == Mode::error) {
        return leave(Exit::error);
    }
    if (watched) {
        return leave(Exit::watchpoint);
    }
    if (core.attention) {
        core.attention = false;
        return leave(Exit::attention);
    }
    if (s.mode == Mode::power_down && !core.interrupted()) {
        return leave(Exit::power_down);
    }
    if (s.cycles >= until) {
        return leave(Exit::time);
    }
    if (core.interrupted()) {
        const std::uint32_t level = core.interrupt_level;
        s.mode = Mode::running;
        take_trap(core, trap::interrupt + level);
        if (core.acknowledge != nullptr) {
            core.acknowledge(core.user, level);
        }
        return Boundary::stepped;
    }
    if (!step_over && core.breakpoints.contains(s.pc)) {
        return leave(Exit::breakpoint);
    }
    return Boundary::execute;
}

} // namespace fledge::emulator
