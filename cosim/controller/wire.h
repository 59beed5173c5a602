// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "cosim/controller/config.h"

#include <deque>

namespace fledge::cosim {

/// A message and the first instant that sees it, or at which it was written.
struct TimedPayload {
    Ns t;
    Payload payload;
};

/// The queue of a topic's messages for one reader, which has not yet stepped past them.
class Wire {
public:
    Wire(std::uint32_t of_channel, NodeId reader) : channel(of_channel), to(reader) {}

    std::uint32_t channel;
    NodeId from = 0, to;

    Latency latency() const { return latency_; }

    /// Connect writer and reader: the reader sees `first` after `boundary`. `exchange`: the longest period of both.
    void lay(NodeId writer, Latency latency, Ns exchange, Ns boundary, Payload first);

    /// The first instant at which the reader sees a message written at t.
    Ns first_seen(Ns t) const;
    /// The last instant for which the reader's input is known, if the writer may write from `first_write` on.
    Ns known_until(Ns first_write) const;
    /// The first time at which a message can be written so that the reader, granted until `granted`, sees it as
    /// well as all messages before.
    Ns earliest_write(Ns granted, const Schedule &reader) const;

    /// Add a message. It replaces the messages that the reader would see at no instant.
    void push(Ns written, const Payload &payload, const Schedule &reader);
    /// Send the messages that the reader sees up to `until`.
    void deliver(Ns until, std::vector<Record> &records);
    std::size_t count_deliverable(Ns until) const;
    /// The reader has reached t: remove the messages that it has seen, except the last.
    void pass(Ns t);

    /// Deliver again all messages that the reader has not passed; counts begin at 1.
    void restart();
    /// The reader is a new program without a snapshot: deliver its last message again, too.
    void resend_last(Ns reached);
    /// The next count, for a message that is sent once more.
    std::uint32_t next_count() { return ++count_; }

    /// While the reader is away, only the last message is stored, for the reader that joins.
    void set_last(const Payload &payload) { last_ = payload; }
    void empty();
    const Payload &latest() const { return pending_.empty() ? last_ : pending_.back().payload; }
    std::size_t waiting() const { return pending_.size(); }

private:
    Latency latency_ = Latency::same_instant;
    Ns exchange_ = 0;
    std::deque<TimedPayload> pending_; ///< in order of time
    std::size_t delivered_ = 0;        ///< so many of these are sent
    std::uint32_t count_ = 0;          ///< sent since the last Start
    Payload last_;                     ///< the last message that the reader has passed
};

} // namespace fledge::cosim
