// SPDX-License-Identifier: Apache-2.0
// Real time, or a multiple of it: lets the nodes go to an instant when its time has come.
//
// It moves the controller's horizon and nothing else, so no message depends on it.
#pragma once

#include "cosim/controller/controller.h"

#include <chrono>

namespace fledge::cosim {

/// How a paced run kept up.
struct PaceReport {
    std::uint64_t overruns = 0; ///< instants that began later than 1 ms after their time
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

    /// Readable when there is something to do.
    int fd() const { return fd_; }
    /// Let the nodes go as far as they may by now. To be called when something has happened. An instant
    /// does not begin before all have done the one before; what is late then is made up for.
    void tend(Controller &controller, std::size_t nodes, Clock::time_point now);

    const PaceReport &report() const { return report_; }

private:
    void wake_at(Clock::time_point t);

    int fd_;
    double speed_;
    bool stands_ = true;             ///< the simulated time does, so the real one does not count
    Clock::time_point zero_, armed_; ///< when t = 0 was, or would have been
    PaceReport report_;
};

} // namespace fledge::cosim
