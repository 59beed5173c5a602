// SPDX-License-Identifier: Apache-2.0
// A computer on a board: processor, memory, devices, and its time. Everything is in the object; a program may hold many
// machines, each in a thread. Simulated time is a function of the executed instructions and of the times of events.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "emulator/cpu/engine.h"

namespace fledge::emulator {

struct BoardDescription; // board.h: read from a TOML file
class Program;           // elf.h: an ELF file with its symbols and lines
class Device;

using Ns = std::int64_t;

enum class EngineKind : std::uint8_t { interpreter, threaded, translator };

enum class StopReason : std::uint8_t {
    time,       ///< the time has come
    early,      ///< somebody called stop(): flight has finished its tick
    breakpoint, ///< at pc
    watchpoint, ///< behind the instruction that made the access
    error       ///< the processor is in its error mode; report() says why
};

/// A copy of all state of a machine, in memory. Pages that are equal to those of an older snapshot are shared.
class Snapshot;

class Machine {
public:
    explicit Machine(const BoardDescription &board, EngineKind engine = EngineKind::translator);
    ~Machine();
    Machine(const Machine &) = delete;
    Machine &operator=(const Machine &) = delete;

    /// Copy a program into memory, and make a reset start it. Throws Error if it does not fit.
    void load(const Program &program);
    /// As after power-on, or by the watchdog; memory stays as it is, time goes on.
    void reset();

    /// Run until a time [ns]; idle time is skipped. The processor stops at the first boundary of instructions at or
    /// after it.
    StopReason run_until(Ns t);
    /// Execute one instruction (or take one trap).
    StopReason step();
    /// Run until so many instructions were executed since the machine was made: the same point in every repetition.
    StopReason run_to_instruction(std::uint64_t n);
    /// End run_until behind the present instruction; devices and hooks call it.
    void stop();

    Ns now() const;
    std::uint64_t instructions() const;
    Core &core();
    Bus &bus();
    void select(EngineKind engine);

    std::shared_ptr<const Snapshot> snapshot() const;
    void restore(const Snapshot &snapshot);
    std::vector<std::byte> save() const;              ///< for a file
    void load_snapshot(std::span<const std::byte> s); ///< throws Error if it is of another board

    /// Bytes as a debugger sees them: no side effects, no protection. False: no memory is there.
    bool peek(std::uint32_t address, std::span<std::byte> bytes) const;
    bool poke(std::uint32_t address, std::span<const std::byte> bytes);

    void set_breakpoint(std::uint32_t address, bool on);
    void set_watchpoint(std::uint32_t address, std::uint32_t size, bool on_read, bool on_write, bool on);

    /// PC, symbol, registers and backtrace, for a person.
    std::string report(const Program *program = nullptr) const;

    Device *device(std::string_view name);

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

} // namespace fledge::emulator
