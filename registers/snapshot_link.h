// SPDX-License-Identifier: Apache-2.0
// A socket between the outside and an emulated computer in another process, for snapshots of that computer. Of the
// requests, an empty one asks for a snapshot; any other is a snapshot from which the computer is to go on. Each is
// answered, between two ticks.
#pragma once

#include <chrono>
#include <cstddef>
#include <functional>
#include <span>
#include <utility>
#include <vector>

namespace fledge::registers {

class SnapshotLink {
public:
    /// Both ends, of which the first is not kept open across exec. Throws Error.
    static std::pair<int, int> make();

    /// One end; closed with this object.
    explicit SnapshotLink(int fd) : fd_(fd) {}
    ~SnapshotLink();
    SnapshotLink(const SnapshotLink &) = delete;
    SnapshotLink &operator=(const SnapshotLink &) = delete;

    /// Ask, ring the other side, and wait for the answer. Throws Error: that of the other side, or if it has ended, or
    /// does not answer in time.
    std::vector<std::byte> ask(std::span<const std::byte> request, const std::function<void()> &ring,
                               std::chrono::nanoseconds timeout);

    /// Answer a request if there is one: by a snapshot, or by going on from the given one. What these throw goes to the
    /// other side. Throws Error if that has ended.
    void answer(const std::function<std::vector<std::byte>()> &save,
                const std::function<void(std::span<const std::byte>)> &restore);

private:
    bool waits(std::chrono::nanoseconds timeout) const;
    void send(std::span<const std::byte> bytes, bool failed = false, const std::function<void()> &ring = {}) const;
    std::vector<std::byte> receive(std::chrono::nanoseconds timeout) const;

    int fd_;
};

} // namespace fledge::registers
