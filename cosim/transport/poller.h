// SPDX-License-Identifier: Apache-2.0
// Which of many descriptors are readable, in a time that does not grow with their number.
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
    /// Before it is closed.
    void remove(int fd);

    /// The keys of the readable descriptors; none after a timeout or a signal.
    const std::vector<std::uint64_t> &wait(std::chrono::milliseconds most);

private:
    int fd_;
    std::vector<std::uint64_t> ready_;
};

} // namespace fledge::cosim
