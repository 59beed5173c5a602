// SPDX-License-Identifier: Apache-2.0
// What every node in C++ does with its messages: those that come wait for the instant that sees them,
// those that go are the ones that have changed.
#pragma once

#include "cosim/protocol/protocol.h"

#include <deque>
#include <map>
#include <span>
#include <vector>

namespace fledge::cosim {

/// What has come and no instant has seen, in the order of the times from which it is seen.
class Inbox {
public:
    /// For what follows a matching: these channels, from their first message on. Nothing waits.
    void open(const std::vector<Channel> &wired);
    /// Throws ProtocolError if a record is not the next one of its channel.
    void take(const std::vector<Record> &records);
    /// Hand what is seen at t to a function of a Record.
    template <class See> void see(Ns t, See see)
    {
        for (; !coming_.empty() && coming_.front().t <= t; coming_.pop_front()) {
            see(coming_.front());
        }
    }

private:
    std::map<std::uint32_t, std::uint32_t> counts_; ///< of what came, by channel
    std::deque<Record> coming_;
};

/// Structs in memory that others read.
class Outbox {
public:
    void clear() { outputs_.clear(); }
    /// The others have what stands there now; it stays where it is.
    void add(std::uint32_t channel, std::span<const std::byte> message);
    /// Send the message at this place with the next say(), even if it has not changed.
    void resend(std::span<const std::byte> message);
    /// What has changed since: the others still have the rest.
    void say(Ns t, std::vector<Record> &records);

private:
    struct Output {
        std::uint32_t channel;
        std::span<const std::byte> message;
        Bytes sent;
        std::uint32_t count;
    };
    std::vector<Output> outputs_;
};

} // namespace fledge::cosim
