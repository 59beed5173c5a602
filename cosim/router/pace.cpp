// SPDX-License-Identifier: Apache-2.0
#include "cosim/router/pace.h"

#include "cosim/transport/link_error.h"

#include <algorithm>
#include <cmath>
#include <string_view>
#include <sys/timerfd.h>
#include <unistd.h>

namespace fledge::cosim {

namespace {

using namespace std::chrono_literals;

} // namespace

bool finished(const Controller &controller, std::size_t nodes)
{
    for (NodeId id = 0; id < nodes; id++) {
        const std::string_view state = controller.state(id);
        if (state == "joining" || (state == "running" && controller.waiting_for(id))) {
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

void Pace::update(Controller &controller, std::size_t nodes, Clock::time_point now)
{
    if (armed_ != Clock::time_point{} && now >= armed_) {
        std::uint64_t times;
        if (read(fd_, &times, sizeof times) > 0) { // else the descriptor stays readable
            armed_ = {};
        }
    }
    if (!controller.running() || controller.waiting()) {
        stopped_ = true;
        return;
    }
    const Ns due = controller.next_due();
    if (due == for_ever || !finished(controller, nodes)) {
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
    controller.set_horizon(std::max(due, static_cast<Ns>(std::min(here, 1e18))));
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
