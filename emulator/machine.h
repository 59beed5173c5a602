// SPDX-License-Identifier: Apache-2.0
// A computer on a board: processor, memory, devices, and its time. Everything is in the object; a program may hold many
// machines, each in a thread. Simulated time is a function of the executed instructions and of the times of events.
//
// Example:
//
//     #include "emulator/board.h"
//     #include "emulator/elf.h"
//     using namespace emulator;
//     Machine machine(BoardDescription::read("emulator/boards/leon3.toml"));
//     machine.load(Program::read("nadir_spin.elf"));
//     if (machine.run_until(1'000'000'000) == StopReason::error) {
//         throw std::runtime_error(machine.report());
//     }
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "emulator/bus/system_bus.h"
#include "emulator/cpu/engine.h"

namespace fledge::emulator {

struct BoardDescription; // board.h: read from a TOML file
class Program;           // elf.h: an ELF file with its symbols
class Observer;          // debug/observer.h

using Ns = std::int64_t;

enum class EngineKind : std::uint8_t { interpreter, threaded, translator };

enum class StopReason : std::uint8_t {
    time,       ///< the time has come
    early,      ///< a hook called stop(): flight has finished its tick
    breakpoint, ///< at pc
    watchpoint, ///< behind the instruction that made the access
    error       ///< the processor is in its error mode, and no watchdog will reset it; report() says why
};

/// A copy of all state of a machine, in memory. Pages that are equal to those of an older snapshot are shared, so a
/// snapshot costs the pages that were written since the last one, and so does restoring it.
class Snapshot;

class Machine {
public:
    explicit Machine(const BoardDescription &board, EngineKind engine = EngineKind::translator);
    ~Machine();
    Machine(const Machine &) = delete;
    Machine &operator=(const Machine &) = delete;

    const BoardDescription &board() const;

    /// Copy a program into memory, and make a reset start it, as after power-on. Throws Error if it does not fit. A
    /// program in RAM is copied there again at each reset, as a boot loader would; one in ROM starts at its first byte.
    void load(const Program &program);
    /// As by the watchdog: the processor starts again, devices are reset, memory is as the board says, time goes on.
    /// In a hook or a device it takes place behind the present instruction.
    void reset();
    /// The same, and the processor stands still until a time [ns] before it starts. Not in a hook.
    void reset_until(Ns t);

    /// Run until a time [ns]; idle time is skipped. The processor stops at the first boundary of instructions at or
    /// after it. A run that begins at a breakpoint goes on.
    StopReason run_until(Ns t);
    /// Execute one instruction, or take one trap; a processor that waits does so until the next event.
    StopReason step();
    /// Run until so many instructions were executed since the machine was made: the same point in every repetition.
    StopReason run_to_instruction(std::uint64_t n, Ns limit = std::numeric_limits<Ns>::max());
    /// End run_until behind the present instruction; devices and hooks call it.
    void stop();

    Ns now() const;
    std::uint64_t instructions() const;
    std::uint64_t resets() const; ///< since the machine was made
    std::uint64_t watchdog_resets() const;
    Core &core();
    const Core &core() const;
    SystemBus &bus();
    void select(EngineKind engine);

    std::shared_ptr<const Snapshot> snapshot();
    void restore(const Snapshot &snapshot);           ///< throws Error if it is of another board
    std::vector<std::byte> save();                    ///< for a file
    void load_snapshot(std::span<const std::byte> s); ///< Error if damaged, of another board or program

    /// Bytes as a debugger sees them: no side effects, no protection, no EDAC. False: no memory is there. peek also
    /// reads the register space.
    bool peek(std::uint32_t address, std::span<std::byte> bytes) const;
    bool poke(std::uint32_t address, std::span<const std::byte> bytes);

    /// Throws Error if no instruction can be there.
    void set_breakpoint(std::uint32_t address, bool on);
    /// Throws Error if these bytes are not in memory: a device cannot be watched.
    void set_watchpoint(std::uint32_t address, std::uint32_t size, bool on_read, bool on_write, bool on);

    /// PC, symbol, registers and backtrace, for a person.
    std::string report(const Program *program = nullptr) const;

    /// The device of this name in the board's file; nullptr: there is none.
    Device *device(std::string_view name);
    /// The n-th device of a type; nullptr: there is none.
    template <typename T> T *device_of(std::size_t n = 0)
    {
        for (std::size_t i = 0; i < devices().size(); i++) {
            if (T *found = dynamic_cast<T *>(devices()[i].get()); found && n-- == 0) {
                return found;
            }
        }
        return nullptr;
    }
    const std::vector<std::unique_ptr<Device>> &devices() const;

    /// Show each step to an observer, from now on; the plain interpreter runs then. nullptr: to none.
    void observe(Observer *observer);

    std::function<void()> on_reset; ///< the board was reset
    std::function<void()> on_error; ///< the processor has entered its error mode; a watchdog may reset it

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

} // namespace fledge::emulator
