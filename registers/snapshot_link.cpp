// SPDX-License-Identifier: Apache-2.0
// A message: its number of bytes as an int64, and these; of an error, the number is negative and they are its text.
#include "registers/snapshot_link.h"

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <fcntl.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include "registers/outside.h"

namespace fledge::registers {

namespace {

constexpr std::chrono::seconds between_bytes{10}; ///< of one message

[[noreturn]] void gone()
{
    throw Error("the other side of the link for snapshots has ended");
}

} // namespace

std::pair<int, int> SnapshotLink::make()
{
    int ends[2];
    if (socketpair(AF_UNIX, SOCK_STREAM, 0, ends) != 0 || fcntl(ends[0], F_SETFD, FD_CLOEXEC) != 0) {
        throw Error(std::string("no socket for snapshots can be made: ") + std::strerror(errno));
    }
    return {ends[0], ends[1]};
}

SnapshotLink::~SnapshotLink()
{
    close(fd_);
}

std::vector<std::byte> SnapshotLink::ask(std::span<const std::byte> request, const std::function<void()> &ring,
                                         std::chrono::nanoseconds timeout)
{
    send(request, false, ring);
    return receive(timeout);
}

void SnapshotLink::answer(const std::function<std::vector<std::byte>()> &save,
                          const std::function<void(std::span<const std::byte>)> &restore)
{
    if (!waits({})) {
        return;
    }
    const std::vector<std::byte> request = receive(between_bytes);
    std::vector<std::byte> answer;
    std::string wrong;
    try {
        if (request.empty()) {
            answer = save();
        } else {
            restore(request);
        }
    } catch (const std::exception &error) {
        wrong = error.what();
    }
    wrong.empty() ? send(answer) : send(std::as_bytes(std::span(wrong)), true);
}

bool SnapshotLink::waits(std::chrono::nanoseconds timeout) const
{
    pollfd request{fd_, POLLIN, 0};
    const auto ms = std::chrono::duration_cast<std::chrono::milliseconds>(timeout).count();
    return poll(&request, 1, static_cast<int>(ms)) > 0;
}

void SnapshotLink::send(std::span<const std::byte> bytes, bool failed, const std::function<void()> &ring) const
{
    const auto write = [&](std::span<const std::byte> part) {
        while (!part.empty()) {
            const ssize_t sent = ::send(fd_, part.data(), part.size(), MSG_NOSIGNAL);
            if (sent < 0 && errno != EINTR) {
                gone();
            }
            part = part.subspan(static_cast<std::size_t>(std::max<ssize_t>(sent, 0)));
        }
    };
    const auto n = static_cast<std::int64_t>(bytes.size()), head = failed ? -n : n;
    write(std::as_bytes(std::span(&head, 1)));
    if (ring) { // once there is something to read, and before the socket is full
        ring();
    }
    write(bytes);
}

std::vector<std::byte> SnapshotLink::receive(std::chrono::nanoseconds timeout) const
{
    const auto read = [&](void *to, std::size_t n) {
        for (auto *at = static_cast<std::byte *>(to); n > 0;) {
            if (!waits(timeout)) {
                throw Error("the other side of the link for snapshots does not answer");
            }
            const ssize_t got = recv(fd_, at, n, 0);
            if (got == 0 || (got < 0 && errno != EINTR)) {
                gone();
            }
            at += std::max<ssize_t>(got, 0);
            n -= static_cast<std::size_t>(std::max<ssize_t>(got, 0));
        }
    };
    std::int64_t size = 0;
    read(&size, sizeof size);
    std::vector<std::byte> bytes(static_cast<std::size_t>(size < 0 ? -size : size));
    read(bytes.data(), bytes.size());
    if (size < 0) {
        throw Error({reinterpret_cast<const char *>(bytes.data()), bytes.size()});
    }
    return bytes;
}

} // namespace fledge::registers
