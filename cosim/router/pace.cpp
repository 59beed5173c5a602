// SPDX-License-Identifier: Apache-2.0
#include "cosim/router/pace.h"

#include "cosim/transport/link_error.h"

#include <algorithm>
#include <cmath>
#include <sys/timerfd.h>
#include <unistd.h>

namespace fledge::cosim {

namespace {

using namespace std::chrono_literals;

constexpr auto short_stride = 5ms, long_stride = 20ms; ///< of wall time: a pause takes effect within one
constexpr Ns longest_stride = 3'600'000'000'000;

} // namespace

bool finished(const Controller &controller, std::size_t nodes)
{
    for (NodeId id = 0; id < nodes; id++) {
        if (controller.busy(id)) {
            return false;
        }
    }
    return true;
}

Pace::Pace(double speed) : fd_(timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC)), speed_(speed)
{
    if (fd_ < 0) {
        throw LinkError("there is no timer for a paced run");
    }
}

Pace::~Pace()
{
    close(fd_);
}

void Pace::set_speed(double speed)
{
    speed_ = speed;
    stopped_ = true; // time goes on from here, without catching up
}

void Pace::update(Controller &controller, std::size_t nodes, Clock::time_point now, bool waits)
{
    if (armed_ != Clock::time_point{} && now >= armed_) {
        std::uint64_t times;
        if (read(fd_, &times, sizeof times) > 0) { // else the descriptor stays readable
            armed_ = {};
        }
    }
    if (waits) {
        return;
    }
    if (!controller.running() || controller.waiting()) {
        stopped_ = true;
        return;
    }
    const Ns due = controller.next_due();
    if (due == for_ever || !finished(controller, nodes)) {
        return;
    }
    if (held_ || due > until_) {
        held_ = stopped_ = true;
        return;
    }
    if (speed_ == 0.0) {
        const auto took = now - stride_begun_;
        stride_ = took < short_stride ? std::min(2 * stride_, longest_stride)
                                      : std::max<Ns>(took > long_stride ? stride_ / 2 : stride_, 1);
        stride_begun_ = now;
        controller.set_horizon(std::max(due, std::min(until_, due + stride_)));
        return;
    }
    const auto wall = std::chrono::nanoseconds(std::llround(static_cast<double>(due) / speed_));
    if (stopped_) {
        stopped_ = false;
        zero_ = now - wall;
    }
    if (now < zero_ + wall) {
        return wake_at(zero_ + wall);
    }
    const auto late = now - (zero_ + wall);
    report_.overruns += late > 1ms;
    report_.worst = std::max<Ns>(report_.worst, std::chrono::nanoseconds(late).count());
    const double here = static_cast<double>(std::chrono::nanoseconds(now - zero_).count()) * speed_;
    controller.set_horizon(std::max(due, std::min(until_, static_cast<Ns>(std::min(here, 1e18)))));
}

void Pace::wake_at(Clock::time_point t)
{
    if (t == armed_) {
        return;
    }
    armed_ = t;
    const auto since = std::chrono::nanoseconds(t.time_since_epoch()).count(); // CLOCK_MONOTONIC
    itimerspec when{};
    when.it_value.tv_sec = since / 1'000'000'000;
    when.it_value.tv_nsec = since % 1'000'000'000;
    timerfd_settime(fd_, TFD_TIMER_ABSTIME, &when, nullptr);
}

} // namespace fledge::cosim
