// SPDX-License-Identifier: Apache-2.0
// Real time, or a multiple of it. It moves the controller's horizon and nothing else, so no message depends on it.
#pragma once

#include "cosim/controller/controller.h"

#include <chrono>

namespace fledge::cosim {

/// Delays of a paced run.
struct PaceReport {
    std::uint64_t overruns = 0; ///< instants that began more than 1 ms late
    Ns worst = 0;               ///< [ns] of wall time, the largest delay
};

class Pace {
public:
    using Clock = std::chrono::steady_clock;

    /// speed: simulated seconds per second, > 0. Throws LinkError if there is no timer.
    explicit Pace(double speed);
    ~Pace();
    Pace(const Pace &) = delete;
    Pace &operator=(const Pace &) = delete;

    /// Readable when tend() has something to do.
    int fd() const { return fd_; }
    /// Move the horizon to the present time. To be called after each event. An instant does not begin before all
    /// nodes have done the one before; a late run catches up.
    void tend(Controller &controller, std::size_t nodes, Clock::time_point now);

    const PaceReport &report() const { return report_; }

private:
    void wake_at(Clock::time_point t);

    int fd_;
    double speed_;
    bool stopped_ = true;            ///< simulated time stands still, and real time does not count
    Clock::time_point zero_, armed_; ///< when t = 0 was, or would have been
    PaceReport report_;
};

} // namespace fledge::cosim
