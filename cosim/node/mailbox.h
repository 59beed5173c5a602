// SPDX-License-Identifier: Apache-2.0
// The messages of a node in C++: inputs wait for the instant that sees them, outputs are sent when they change.
#pragma once

#include "cosim/protocol/protocol.h"

#include <deque>
#include <map>
#include <span>
#include <vector>

namespace fledge::cosim {

/// Messages that no instant has seen yet, in the order of their times.
class Inbox {
public:
    /// After a matching: empty, with these channels; counts begin at 1.
    void open(const std::vector<Channel> &wired);
    /// Throws ProtocolError if a record is not the next one of its channel.
    void take(const std::vector<Record> &records);
    /// Call `see` with each record that the instant t sees first.
    template <class See> void see(Ns t, See see)
    {
        for (; !coming_.empty() && coming_.front().t <= t; coming_.pop_front()) {
            see(coming_.front());
        }
    }

private:
    std::map<std::uint32_t, std::uint32_t> counts_; ///< of received messages, by channel
    std::deque<Record> coming_;
};

/// Structs in memory that other nodes read.
class Outbox {
public:
    void clear() { outputs_.clear(); }
    /// Publish the struct at this address. The other nodes know its present value.
    void add(std::uint32_t channel, std::span<const std::byte> message);
    /// Add a record for each struct that has changed.
    void collect(Ns t, std::vector<Record> &records);

private:
    struct Output {
        std::uint32_t channel;
        std::span<const std::byte> message;
        Payload sent;
        std::uint32_t count;
    };
    std::vector<Output> outputs_;
};

} // namespace fledge::cosim
