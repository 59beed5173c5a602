// SPDX-License-Identifier: Apache-2.0
// What bench/cosim.py measures: nodes of a co-simulation in their own programs, and bare sockets and futexes for
// comparison.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace fledge::bench {

/// Programs that end with this one, also after a kill.
class Children {
public:
    ~Children();
    /// Run a function in a new program, before this one has threads. Exceptions go to stderr.
    void start(const std::function<void()> &work);
    /// Wait for all programs. Throws std::runtime_error if one failed.
    void join();

private:
    std::vector<int> pids_;
};

/// The time of a round [ns]: the median over groups of rounds, without the first groups.
class Stopwatch {
public:
    void lap();
    double median() const;

private:
    static constexpr std::uint64_t group = 16;
    std::uint64_t laps_ = 0;
    std::chrono::steady_clock::time_point last_;
    std::vector<double> groups_;
};

/// 64 bytes there and back over bare REQ and REP sockets, n times.
double req_rep(const std::string &transport, std::uint64_t n);

/// k programs that a futex releases all at once; the last one to have seen it wakes the first program.
double futex_barrier(std::uint64_t k, std::uint64_t n);

} // namespace fledge::bench
