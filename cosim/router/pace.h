// SPDX-License-Identifier: Apache-2.0
// Real time, a multiple of it, or as fast as possible; and pauses. It moves the controller's horizon and nothing else,
// so no message depends on it.
#pragma once

#include "cosim/controller/controller.h"

#include <chrono>

namespace fledge::cosim {

/// Delays of a paced run.
struct PaceReport {
    std::uint64_t overruns = 0; ///< instants that began more than 1 ms late
    Ns worst = 0;               ///< [ns] of wall time, the largest delay
};

/// Whether all nodes have finished all instants up to the horizon.
bool finished(const Controller &controller, std::size_t nodes);

class Pace {
public:
    using Clock = std::chrono::steady_clock;

    /// speed: simulated seconds per second; 0: as fast as possible. Throws LinkError if there is no timer.
    explicit Pace(double speed);
    ~Pace();
    Pace(const Pace &) = delete;
    Pace &operator=(const Pace &) = delete;

    /// Readable when update() has something to do.
    int fd() const { return fd_; }
    /// Move the horizon to the present time. To be called after each event. An instant begins only after all nodes have
    /// finished the previous one; a late run catches up. waits: none may begin now.
    void update(Controller &controller, std::size_t nodes, Clock::time_point now, bool waits = false);

    // These take effect at the next update.
    /// Run at another speed, without catching up what is late.
    void set_speed(double speed);
    /// Run on, and pause before the first instant after `until`; for_ever: do not pause.
    void pause_after(Ns until) { until_ = until, held_ = false; }
    /// Pause before the next instant.
    void pause() { held_ = true; }

    double speed() const { return speed_; }
    bool paused() const { return held_; }
    Ns until() const { return until_; }
    const PaceReport &report() const { return report_; }

private:
    void wake_at(Clock::time_point t);

    int fd_;
    double speed_;
    bool held_ = false;
    Ns until_ = for_ever;
    Ns stride_ = 1;                  ///< at speed 0: how far all nodes may go before the next update
    Clock::time_point stride_begun_; ///< at speed 0: when the last stride began
    bool stopped_ = true;            ///< simulated time stands still
    Clock::time_point zero_;         ///< at other speeds: the wall time of t = 0
    Clock::time_point armed_;        ///< the time for which the timer is set
    PaceReport report_;
};

} // namespace fledge::cosim
