// SPDX-License-Identifier: Apache-2.0
// What happens, instruction by instruction: for traces, coverage and profiles. Machine::observe() tells it; while an
// observer is there, the plain interpreter runs.
#pragma once

#include "emulator/cpu/state.h"

namespace fledge::emulator {

/// What one step has done.
struct Executed {
    std::uint32_t pc, word; ///< the instruction
    std::uint64_t begun;    ///< [cycles] when it began
    std::uint32_t address;  ///< of an instruction of memory: where it reads or writes
    bool trapped;           ///< it trapped, or an interrupt came in front of it: it was not executed
    const CpuState &state;  ///< behind it
};

class Observer {
public:
    virtual ~Observer() = default;
    virtual void executed(const Executed &step) = 0;
};

} // namespace fledge::emulator
