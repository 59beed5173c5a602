// SPDX-License-Identifier: Apache-2.0
// Instructions and cycles of each function and line, and of the functions that it calls.
#pragma once

#include <map>
#include <unordered_map>
#include <vector>

#include "emulator/debug/observer.h"
#include "emulator/debug/source_lines.h"
#include "emulator/elf.h"

namespace fledge::emulator {

struct Cost {
    std::uint64_t instructions = 0, cycles = 0;

    Cost &operator+=(const Cost &more)
    {
        instructions += more.instructions;
        cycles += more.cycles;
        return *this;
    }
};

class Profile final : public Observer {
public:
    explicit Profile(const Program &program) : program_(program) {}

    void executed(const Executed &step) override;

    /// Write it for callgrind_annotate, in callgrind's format. Throws Error if that fails.
    void write(const std::string &path, const SourceLines &lines);

private:
    struct Call {
        std::uint64_t count = 0;
        Cost inclusive;
    };
    struct Frame {
        std::uint32_t site, function; ///< addresses: of the call, of what it calls
        std::uint32_t back;           ///< where it returns to
        std::uint32_t stack;          ///< %sp of the caller at the call
        Cost before;                  ///< of the whole, at the call
    };

    void enter(std::uint32_t site, std::uint32_t function, std::uint32_t back, std::uint32_t stack);
    void leave(std::size_t depth);
    std::uint32_t function_of(std::uint32_t address) const;

    const Program &program_;
    std::unordered_map<std::uint32_t, Cost> self_;                  ///< by address
    std::map<std::pair<std::uint32_t, std::uint32_t>, Call> calls_; ///< by site and function
    std::vector<Frame> frames_;
    Cost total_;
    std::uint32_t site_ = 0, target_ = 0, stack_ = 0; ///< of a call whose delay slot comes; site_ 0: none
};

} // namespace fledge::emulator
