// SPDX-License-Identifier: Apache-2.0
// A way to execute instructions. All engines give the same states at the same cycles, so one can go on where another
// stopped: the plain interpreter is the reference, the threaded interpreter and the translator are fast. timing.h says
// what counts as an instruction and as a cycle, step.h what happens between two instructions.
//
// Example:
//
//     emulator::Exit execute(emulator::Bus &bus, std::uint64_t cycles)
//     {
//         emulator::Core core;
//         core.bus = &bus;
//         return emulator::make_threaded()->run(core, cycles);
//     }
#pragma once

#include <cstdint>
#include <memory>
#include <set>

#include "emulator/bus/bus.h"
#include "emulator/cpu/state.h"
#include "emulator/cpu/timing.h"

namespace fledge::emulator {

/// Results of arithmetic that implementations may choose.
enum class FpuPersonality : std::uint8_t {
    grfpu, ///< Gaisler's: subnormal operands trap (unfinished_FPop), its own NaN
    qemu   ///< as stock QEMU computes
};

/// A processor with all that it needs to run: what the engines share with the machine.
struct Core {
    CpuState state;
    Bus *bus = nullptr;
    Timing timing; ///< cycles of each instruction
    FpuPersonality fpu = FpuPersonality::grfpu;

    /// The highest pending interrupt that the interrupt controller shows, 0 to 15. Devices change it.
    std::uint32_t interrupt_level = 0;
    /// The processor acknowledges an interrupt when it takes its trap.
    void (*acknowledge)(void *user, std::uint32_t level) = nullptr;
    void *user = nullptr;
    /// Set by a bus access that changed what the machine waits for (an interrupt, a time, a request to stop): the
    /// engine returns behind this instruction with Exit::attention.
    bool attention = false;

    std::set<std::uint32_t> breakpoints; ///< addresses; change them through Engine::set_breakpoint

    /// Whether an interrupt would be taken now: traps are enabled, and its level is above PIL, or 15.
    bool interrupted() const
    {
        return interrupt_level != 0 && (state.psr & psr::enable_traps) != 0 &&
               (interrupt_level == 15 || interrupt_level > ((state.psr & psr::pil) >> 8));
    }
};

enum class Exit : std::uint8_t {
    time,       ///< state.cycles >= until
    attention,  ///< a device requested it
    power_down, ///< the processor waits for an interrupt
    breakpoint, ///< the instruction at pc is a breakpoint and was not executed
    watchpoint, ///< the instruction before made a watched access
    error       ///< a trap while traps are disabled: the error mode
};

/// It serves one Core. After a change of the core's timing or FPU, or of its breakpoints by another engine, invalidate
/// all addresses.
class Engine {
public:
    virtual ~Engine() = default;
    virtual const char *name() const = 0;

    /// Execute instructions until the first boundary of instructions at which state.cycles >= until, or until another
    /// Exit. It takes an interrupt that is due (Core::interrupted) before any instruction. The first instruction
    /// executes even if it is a breakpoint and `step_over` is set.
    virtual Exit run(Core &core, std::uint64_t until, bool step_over = false) = 0;

    /// Bytes of memory changed: forget what was decoded from them.
    virtual void invalidate(std::uint32_t address, std::uint32_t size) = 0;

    virtual void set_breakpoint(Core &core, std::uint32_t address, bool on) = 0;
};

/// (a) The reference: one instruction after the other, readable beside the manual.
std::unique_ptr<Engine> make_interpreter();

/// (b) Pre-decoded instructions, threaded, on the host's FPU.
std::unique_ptr<Engine> make_threaded();

/// (c) Blocks translated to the host's instructions; on hosts that it does not know, (b).
std::unique_ptr<Engine> make_translator();

/// Take a trap: enter the supervisor, change the window, save pc and npc, go to the table; the error mode if traps are
/// disabled. Shared by all engines.
void take_trap(Core &core, std::uint32_t trap_type);

} // namespace fledge::emulator
