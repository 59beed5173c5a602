// SPDX-License-Identifier: Apache-2.0
// Where the boards' memory is, and how the outside waits for flight. Only this differs between flight
// in this process, in another one, and on an emulated computer.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "registers/clock.h"
#include "registers/shared_file.h"

namespace fledge::registers {

enum class Wait {
    done, ///< flight has finished the tick
    late, ///< it has not, in the time given
    gone  ///< it has ended, and will not
};

/// The memory of some boards. Windows stay where they are as long as the back end lives.
///
/// An emulated computer's: windows onto its registers' RAM, bytes in the order of its addresses,
/// with a ring that raises the processor's line; await_done runs its instructions.
class Backend {
public:
    virtual ~Backend() = default;

    /// One for each board, in their order. They ring flight's side.
    virtual std::span<const RegisterWindow> windows() const = 0;

    /// Let flight go on until it has finished the tick of `clock`, at most so long.
    virtual Wait await_done(const RegisterWindow &clock, std::chrono::nanoseconds timeout) = 0;

    /// Whether it makes snapshots of flight's computer with its registers, and goes on from them, between two ticks.
    virtual bool saves() const { return false; }
    /// Both throw Error.
    virtual std::vector<std::byte> save(std::chrono::nanoseconds /*timeout*/) { return {}; }
    virtual void restore(std::span<const std::byte> /*snapshot*/, std::chrono::nanoseconds /*timeout*/) {}
};

/// Flight in this process: a function that is called for each tick, on the same memory.
class InProcess : public Backend {
public:
    /// `flight` finds the tick due and finishes it; the windows are its as well.
    InProcess(std::span<const RegisterBoard *const> boards, std::function<void()> flight);

    InProcess(const InProcess &) = delete;
    InProcess &operator=(const InProcess &) = delete;

    std::span<const RegisterWindow> windows() const override { return windows_; }
    Wait await_done(const RegisterWindow &clock, std::chrono::nanoseconds timeout) override;

private:
    std::vector<std::vector<std::uint64_t>> memory_; ///< words of 8 bytes, for their alignment
    std::vector<RegisterWindow> windows_;
    std::function<void()> flight_;
};

/// Flight in another process, which attaches to a file: see shared_file.h.
class SharedFile : public Backend {
public:
    /// Without a path the file has no name, and a child inherits fd(). Throws Error.
    SharedFile(std::span<const RegisterBoard *const> boards, const std::string &path);
    ~SharedFile() override;

    SharedFile(const SharedFile &) = delete;
    SharedFile &operator=(const SharedFile &) = delete;

    std::span<const RegisterWindow> windows() const override { return windows_; }
    Wait await_done(const RegisterWindow &clock, std::chrono::nanoseconds timeout) override;
    int fd() const { return file_.fd; }

private:
    RegisterFile file_;
    std::vector<RegisterWindow> windows_;
};

} // namespace fledge::registers
