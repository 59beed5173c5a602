// SPDX-License-Identifier: Apache-2.0
// A machine that can also run backwards: it keeps snapshots on its way, and goes back by running again from one of them
// to the wanted instruction.
#pragma once

#include <deque>
#include <vector>

#include "emulator/machine.h"

namespace fledge::emulator {

/// The machine must be run by this object alone between two calls of begin().
class History {
public:
    /// every: [ns] of simulated time from snapshot to snapshot. The oldest are dropped, so that there are at most
    /// `most`; the one of begin() stays.
    explicit History(Machine &machine, Ns every = 20'000'000, std::size_t most = 200);

    /// The past begins here: something else has changed the machine.
    void begin();
    /// The user has changed the machine: what comes is another future.
    void changed();

    /// As those of the machine. A breakpoint at the present instruction does not stop it again.
    StopReason run_until(Ns t);
    StopReason step();

    /// Go back by one instruction, or trap. Returns false where the past begins.
    bool step_back();
    /// Go back to the last breakpoint, or in front of the last watched access. Returns `time` where the past begins.
    StopReason continue_back();

private:
    struct Moment {
        std::uint64_t position;
        std::shared_ptr<const Snapshot> snapshot;
    };

    std::uint64_t position() const;
    const Moment &restore_before(std::uint64_t position);
    template <class Stopped> void replay(std::uint64_t to, Stopped stopped);

    Machine &machine_;
    Ns every_, next_ = 0;
    std::size_t most_;
    std::deque<Moment> moments_; ///< in the order of their positions
};

} // namespace fledge::emulator
