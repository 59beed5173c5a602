// SPDX-License-Identifier: Apache-2.0
#include "emulator/debug/stack_depth.h"

#include <algorithm>

namespace fledge::emulator {

namespace {

constexpr std::uint32_t apart = 64 * 1024; // [bytes] two stacks of which no object tells

} // namespace

StackDepth::Stack StackDepth::made(std::uint32_t pointer, std::uint32_t pc) const
{
    const Program::Symbol *object = program_.at(pointer);
    if (object && !object->function && object->size != 0) {
        return {object->name, object->address + object->size, pointer, object->size};
    }
    const Program::Symbol *from = program_.named("leon3_stack"), *end = program_.named("leon3_stack_end");
    if (from && end && pointer >= from->address && pointer <= end->address) {
        return {"main", end->address, pointer, end->address - from->address};
    }
    const Program::Symbol *function = program_.at(pc);
    return {function ? function->name : "", pointer, pointer, 0};
}

void StackDepth::executed(const Executed &step)
{
    const std::uint32_t pointer = Banks(const_cast<CpuState &>(step.state))[14];
    // In the window of a trap it is no pointer before the handler has made it one.
    if (pointer == pointer_ || pointer % 8 != 0 || (step.state.psr & psr::enable_traps) == 0) {
        return;
    }
    pointer_ = pointer;
    const auto holds = [&](const Stack &one) {
        return one.size ? pointer - (one.top - one.size) <= one.size
                        : pointer <= one.top + apart && pointer + apart >= one.lowest;
    };
    if (stacks_.empty() || !holds(stacks_[present_])) {
        const auto found = std::find_if(stacks_.begin(), stacks_.end(), holds);
        present_ = static_cast<std::size_t>(found - stacks_.begin());
        if (found == stacks_.end()) {
            stacks_.push_back(made(pointer, step.pc));
        }
    }
    Stack &one = stacks_[present_];
    one.lowest = std::min(one.lowest, pointer);
    one.top = std::max(one.top, pointer);
}

} // namespace fledge::emulator
