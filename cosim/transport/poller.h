// SPDX-License-Identifier: Apache-2.0
// Which of many descriptors have something to say, in a time that does not grow with their number.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace fledge::cosim {

class Poller {
public:
    /// Throws LinkError.
    Poller();
    ~Poller();
    Poller(const Poller &) = delete;
    Poller &operator=(const Poller &) = delete;

    /// Watch a descriptor under a number of the caller's. Throws LinkError.
    void add(int fd, std::uint64_t key);
    /// No longer; before it is closed.
    void remove(int fd);

    /// The keys of those that can be read; none after that time, or if a signal came.
    const std::vector<std::uint64_t> &wait(std::chrono::milliseconds most);

private:
    int fd_;
    std::vector<std::uint64_t> ready_;
};

} // namespace fledge::cosim
