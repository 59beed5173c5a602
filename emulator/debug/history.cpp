// SPDX-License-Identifier: Apache-2.0
#include "emulator/debug/history.h"

#include <algorithm>

namespace fledge::emulator {

History::History(Machine &machine, Ns every, std::size_t most) : machine_(machine), every_(every), most_(most)
{
    begin();
}

void History::begin()
{
    moments_.clear();
    changed();
}

/// Each step makes it larger by one: it executes an instruction or takes a trap.
std::uint64_t History::position() const
{
    const CpuState &state = machine_.core().state;
    return state.instructions + state.traps;
}

void History::changed()
{
    while (!moments_.empty() && moments_.back().position >= position()) {
        moments_.pop_back(); // what came then may come no more
    }
    moments_.push_back({position(), machine_.snapshot()});
    if (moments_.size() > most_) {
        moments_.erase(moments_.begin() + 1);
    }
    next_ = machine_.now() + every_;
}

StopReason History::run_until(Ns t)
{
    for (;;) {
        if (machine_.now() >= next_) {
            changed();
        }
        const Ns end = std::min(t, next_);
        const StopReason reason = machine_.run_until(end);
        if (reason != StopReason::time || end == t) {
            return reason;
        }
    }
}

StopReason History::step()
{
    return machine_.step();
}

const History::Moment &History::restore_before(std::uint64_t position)
{
    const auto after = std::lower_bound(moments_.begin(), moments_.end(), position,
                                        [](const Moment &moment, std::uint64_t p) { return moment.position < p; });
    const Moment &found = after == moments_.begin() ? *after : *std::prev(after);
    machine_.restore(*found.snapshot);
    return found;
}

/// Run to a position, and call stopped(position, reason) for each stop in front of it.
template <class Stopped> void History::replay(std::uint64_t to, Stopped stopped)
{
    while (position() < to) {
        if (machine_.core().breakpoints.count(machine_.core().state.pc)) {
            stopped(position(), StopReason::breakpoint);
        }
        if (machine_.step() == StopReason::watchpoint) {
            stopped(position() - 1, StopReason::watchpoint);
        }
        while (to > position() + 8) { // traps count too, so the last instructions are stepped
            const StopReason reason = machine_.run_to_instruction(machine_.instructions() + (to - position()) / 2);
            if (reason == StopReason::watchpoint) {
                stopped(position() - 1, reason);
            } else if (reason == StopReason::breakpoint || reason == StopReason::error) {
                break;
            }
        }
    }
}

bool History::step_back()
{
    const std::uint64_t here = position();
    if (here <= moments_.front().position) {
        return false;
    }
    restore_before(here);
    replay(here - 1, [](std::uint64_t, StopReason) {});
    return true;
}

StopReason History::continue_back()
{
    std::uint64_t end = position();
    while (end > moments_.front().position) {
        std::uint64_t found = 0;
        StopReason reason = StopReason::time;
        const std::uint64_t begin = restore_before(end).position;
        replay(end, [&](std::uint64_t p, StopReason why) {
            if (p < end) {
                found = p;
                reason = why;
            }
        });
        if (reason != StopReason::time) {
            restore_before(found + 1);
            replay(found, [](std::uint64_t, StopReason) {});
            return reason;
        }
        end = begin;
    }
    machine_.restore(*moments_.front().snapshot);
    return StopReason::time;
}

} // namespace fledge::emulator
