// SPDX-License-Identifier: Apache-2.0
// The state of a run, as lines of JSON for a program that shows it, and the commands of that program.
//
//     {"listening": "ipc://@spring"}
//     {"report": "mass: its connection is gone (it had reached 1 s); the run waits for it"}
//     {"phase": "running", "wall": 1.25, "t": 4.1, "nodes": [
//         {"name": "mass", "state": "running", "t": 4.1, "ticks": 411,
//          "compute": 0.9, "transport": 0.1, "wait": 0.2, "pending": 0.05}, ...]}
//     {"ended": "", "wall": 9.5, "t": 60, "nodes": [...]}
//
// Each on one line. A paced run adds "overruns", the number of instants that began more than 1 ms late, and "worst",
// the largest delay. Times are in seconds: `t` is simulated time (-1 before the first instant; for the run, what all
// nodes have reached), the others are wall time, as in NodeTimes. A steered run adds "pace" and "paused". In the other
// direction, over a socket, on a line each: "stop REASON", and of a steered run "pause", "go", "until SECONDS" (go on,
// and pause then) and "pace X". The end of the socket ends the run, too.
#pragma once

#include "cosim/router/router.h"

#include <string>

namespace fledge::cosim {

class StatusStream {
public:
    /// -1: it does nothing.
    explicit StatusStream(int fd);

    void listening(const std::string &address);
    void report(const std::string &text);
    /// The state now. It may be called often, and writes some times a second.
    void progress(const Router &router, const ControllerConfig &config);
    void ended(const std::string &reason, const Router &router, const ControllerConfig &config);

    /// The next line of the other side; "" if there is none.
    std::string read_line();

private:
    using Clock = std::chrono::steady_clock;

    void write(const std::string &line);
    bool flush();

    int fd_;
    bool socket_ = false, input_ended_ = false;
    std::string rest_; ///< of a line, not written yet
    std::string input_;
    Clock::time_point begun_, reported_;
};

} // namespace fledge::cosim
