// SPDX-License-Identifier: Apache-2.0
#include "cosim/transport/poller.h"

#include "cosim/transport/link_error.h"

#include <array>
#include <cerrno>
#include <cstring>
#include <sys/epoll.h>
#include <unistd.h>

namespace fledge::cosim {

Poller::Poller() : fd_(epoll_create1(EPOLL_CLOEXEC))
{
    if (fd_ < 0) {
        throw LinkError(std::string("cannot watch sockets: ") + std::strerror(errno));
    }
}

Poller::~Poller()
{
    close(fd_);
}

void Poller::add(int fd, std::uint64_t key)
{
    epoll_event event{};
    event.events = EPOLLIN;
    event.data.u64 = key;
    if (epoll_ctl(fd_, EPOLL_CTL_ADD, fd, &event)) {
        throw LinkError(std::string("cannot watch a socket: ") + std::strerror(errno));
    }
}

void Poller::remove(int fd)
{
    epoll_ctl(fd_, EPOLL_CTL_DEL, fd, nullptr);
}

const std::vector<std::uint64_t> &Poller::wait(std::chrono::milliseconds most)
{
    std::array<epoll_event, 64> events;
    const int n = epoll_wait(fd_, events.data(), static_cast<int>(events.size()), static_cast<int>(most.count()));
    ready_.clear();
    for (int i = 0; i < n; i++) {
        ready_.push_back(events[static_cast<std::size_t>(i)].data.u64);
    }
    return ready_;
}

} // namespace fledge::cosim
