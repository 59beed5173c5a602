// SPDX-License-Identifier: Apache-2.0
#include "emulator/debug/stack_depth.h"

#include <algorithm>

namespace fledge::emulator {

namespace {

constexpr std::uint32_t frame = 4096; // [bytes] no function takes more at once

} // namespace

void StackDepth::executed(const Executed &step)
{
    const std::uint32_t pointer = Banks(const_cast<CpuState &>(step.state))[14];
    // In the window of a trap it is no pointer before the handler has made it one.
    if (pointer == pointer_ || pointer % 8 != 0 || (step.state.psr & psr::enable_traps) == 0) {
        return;
    }
    pointer_ = pointer;
    const auto holds = [&](const Stack &stack) { return pointer <= stack.top && pointer + frame >= stack.lowest; };
    if (stacks_.empty() || !holds(stacks_[present_])) {
        const auto found = std::find_if(stacks_.begin(), stacks_.end(), holds);
        present_ = static_cast<std::size_t>(found - stacks_.begin());
        if (found == stacks_.end()) {
            stacks_.push_back(made(pointer));
        }
    }
    stacks_[present_].lowest = std::min(stacks_[present_].lowest, pointer);
}

/// The stack of the board support is between two symbols; that of a task begins where its first function has it.
StackDepth::Stack StackDepth::made(std::uint32_t pointer) const
{
    const Program::Symbol *from = program_.named("leon3_stack"), *end = program_.named("leon3_stack_end");
    if (from && end && pointer >= from->address && pointer <= end->address) {
        return {"main", end->address, pointer, end->address - from->address};
    }
    return {program_.place(pointer), pointer, pointer, 0};
}

} // namespace fledge::emulator
