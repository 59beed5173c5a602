// SPDX-License-Identifier: Apache-2.0
// A run on the wall clock: its pace, and the calls of its caller's poll. Private to the kernel.
#pragma once

#include "sim/simulation.h"

#include <chrono>

namespace fledge::sim {

class Pacing {
public:
    /// start: [ns] simulated.
    Pacing(const RunControl &control, Ns start, PaceReport &report);

    /// Before an instant: sleep until its time, and poll now and then. Returns false if the poll stopped the run.
    bool admits(Ns instant, Ns now)
    {
        if (control_.pace > 0.0) {
            report_.instants++;
            return sleep_until(instant, now);
        }
        return !control_.poll || --until_read_ != 0 || read_clock(now);
    }

    /// At the end, which need not be an instant.
    bool end(Ns t, Ns now) { return !(control_.pace > 0.0) || now >= t || sleep_until(t, now); }

private:
    using Clock = std::chrono::steady_clock;

    bool read_clock(Ns now);
    bool poll(Clock::time_point at, Ns now);
    bool sleep_until(Ns simulated, Ns now);

    const RunControl &control_;
    PaceReport &report_;
    const Ns simulated_start_;
    const Clock::time_point start_;
    Clock::time_point polled_ = start_, read_;
    // Read the clock only sometimes, for it takes as long as a small update; more often where updates are slow.
    int reads_after_ = 16, until_read_ = reads_after_;
};

} // namespace fledge::sim
