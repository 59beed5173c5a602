// SPDX-License-Identifier: Apache-2.0
#include "sim/pacing.h"

#include <algorithm>
#include <ctime>

namespace fledge::sim {

Pacing::Pacing(const RunControl &control, Ns start, PaceReport &report)
    : control_(control), report_(report), simulated_start_(start),
      start_(control.pace > 0.0 ? Clock::now() : Clock::time_point{})
{
}

bool Pacing::read_clock(Ns now)
{
    using namespace std::chrono_literals;
    const auto at = Clock::now();
    reads_after_ = at - read_ > 5ms ? std::max(1, reads_after_ / 2) : std::min(256, 2 * reads_after_);
    until_read_ = reads_after_;
    read_ = at;
    return poll(at, now);
}

bool Pacing::poll(Clock::time_point at, Ns now)
{
    if (control_.poll && at - polled_ >= std::chrono::milliseconds(50)) {
        polled_ = at;
        return control_.poll(now);
    }
    return true;
}

/// Until the simulated time's place on the wall clock.
bool Pacing::sleep_until(Ns simulated, Ns now)
{
    using namespace std::chrono_literals;
    const auto due = start_ + std::chrono::nanoseconds(
                                  static_cast<Ns>(static_cast<double>(simulated - simulated_start_) / control_.pace));
    auto at = Clock::now();
    report_.worst = std::max<Ns>(report_.worst, (at - due) / 1ns);
    report_.overruns += at - due > 1ms;
    while (poll(at, now)) { // also where the run is late
        if (at >= due) {
            return true;
        }
        const auto until = std::min(due, at + 50ms).time_since_epoch();
        const timespec wake{until / 1s, (until % 1s) / 1ns};
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &wake, nullptr);
        at = Clock::now();
    }
    return false;
}

} // namespace fledge::sim
