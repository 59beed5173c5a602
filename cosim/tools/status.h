// SPDX-License-Identifier: Apache-2.0
// How a run goes, as lines of JSON for a program that shows it, and what that program asks for.
//
//     {"listening": "ipc://@spring"}
//     {"report": "mass: its connection is gone (it had reached 1 s); the run waits for it"}
//     {"phase": "running", "wall": 1.25, "t": 4.1, "nodes": [
//         {"name": "mass", "state": "running", "t": 4.1, "ticks": 411,
//          "compute": 0.9, "transport": 0.1, "wait": 0.2, "asked": 0.05}, ...]}
//     {"ended": "", "wall": 9.5, "t": 60, "nodes": [...]}
//
// Each on one line. Of a run that is paced there are also "overruns", the instants that began more than
// 1 ms late, and "worst", the largest delay. Times are in seconds: `t` what is simulated (-1 before the
// first instant; of the run: what all nodes have reached), the others of wall time, as NodeTimes has them.
// In the other direction, if it is a socket: "stop" and a reason, on one line. Its end ends the run too.
#pragma once

#include "cosim/router/router.h"

#include <string>

namespace fledge::cosim {

class StatusStream {
public:
    /// -1: nobody listens, and nothing is done.
    explicit StatusStream(int fd);

    void listening(const std::string &address);
    void report(const std::string &text);
    /// How it goes; called often, it writes some times a second.
    void progress(const Router &router, const ControllerConfig &config);
    void ended(const std::string &reason, const Router &router, const ControllerConfig &config);

    /// Why the other side asks for the end; "" if it does not.
    std::string asked_to_stop();

private:
    using Clock = std::chrono::steady_clock;

    void write(const std::string &line);
    bool flush();

    int fd_;
    bool socket_ = false, heard_end_ = false;
    std::string rest_; ///< of a line that was not taken whole
    std::string heard_;
    Clock::time_point begun_, told_;
};

} // namespace fledge::cosim
