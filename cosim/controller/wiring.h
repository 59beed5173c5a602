// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "cosim/controller/node_state.h"
#include "cosim/controller/run_listener.h"
#include "cosim/controller/wire.h"

#include <map>

namespace fledge::cosim {

struct Topic {
    std::string name;
    Schema schema;
    std::optional<NodeId> writer;
    bool vacant = false; ///< the writer is over: another node may write the topic
    Payload initial;
    Ns since = -1;                  ///< the boundary at which the writer took the topic
    std::uint32_t count = 0;        ///< messages written since the last Start
    std::uint32_t before = 0;       ///< so many of these were written before its program's own
    Ns last = -1;                   ///< when the last one was written
    std::deque<TimedPayload> ahead; ///< asynchronous messages at times that some nodes have not reached
    Payload held;                   ///< the value before those
    std::vector<std::size_t> wires;
    std::vector<NodeId> readers;

    void take(NodeId id, Ns boundary)
    {
        writer = id;
        vacant = false;
        since = last = boundary;
        ahead.clear();
    }
};

/// The topics, their writers and readers, and the messages on their way.
class Wiring {
public:
    explicit Wiring(std::size_t nodes) : links_(nodes) {}

    // A matching, in this order. The nodes of which `matching` is set take part. All faults are collected.

    /// `boundary`: the instant at which nodes join; `first`: the matching before the run.
    void begin_matching(const Nodes &nodes, const std::vector<std::string> &watched, Ns boundary, bool first);
    /// The topics that other nodes read, by the node's own names; the node answers which of these it writes.
    Match request_for(NodeId id, const TopicMap &names) const;
    /// All nodes have answered: take their publications and connect the wires. Notes are for the user.
    void connect(Nodes &nodes, std::vector<std::string> &notes);
    const std::string &faults() const { return faults_; }
    /// The topics that the node will read, by its own names. Its counts begin at 1.
    Start start(NodeId id, const NodeState &node);
    void end_matching() { matching_ = false; }
    /// Whether a restarted node publishes the same topics as before.
    bool same_publications(NodeId id, const std::vector<Publication> &publications) const;

    // During the run.

    /// Which rule a tock breaks; "" if none.
    std::string fault_of(NodeId id, const NodeState &node, const Tock &tock) const;
    /// A node has stepped: queue its messages for their readers, and remove those that it has seen.
    void write(NodeId id, const Nodes &nodes, const std::vector<Record> &records);
    /// Queue a message that no step of a node wrote. Some nodes may not have reached its time.
    void write_ahead(std::uint32_t channel, Ns t, const Payload &payload, const Nodes &nodes);
    /// The first time after `earliest` at which an asynchronous message can be written. If a reader has too many
    /// messages waiting, `why` says so.
    Ns time_to_write(const Topic &topic, const Nodes &nodes, Ns earliest, std::size_t most, std::string &why) const;
    /// The messages that the node sees up to `until`.
    std::vector<Record> deliver(NodeId id, Ns until);
    /// A new program reads the messages of the lost one again, and writes them again.
    void resend(NodeId id, std::vector<Record> &records);
    std::string repeat_count(NodeId id, const Record &record);
    /// The node's program steps from here on: its inputs come again, and counts begin at 1.
    void begin_at(NodeId id);
    /// The node reads nothing more.
    void empty_inputs(NodeId id);

    const std::vector<Topic> &topics() const { return topics_; }
    Topic &topic(std::uint32_t channel) { return topics_[channel]; }
    std::optional<std::uint32_t> find(const std::string &topic) const;
    std::vector<Channel> channels() const;
    Exchange exchange(const Nodes &nodes) const;

    const std::vector<Wire> &wires() const { return wires_; }
    /// Indices into wires(), in the order of the subscriptions.
    const std::vector<std::size_t> &inputs(NodeId id) const { return links_[id].in; }
    const std::vector<std::size_t> &outputs(NodeId id) const { return links_[id].out; }
    /// The nodes at the other ends of these.
    const std::vector<NodeId> &neighbours(NodeId id) const { return links_[id].around; }
    /// The index into inputs() of the wire that blocked the node last: a hint for Grants.
    std::size_t &last_blocker(NodeId id) const { return links_[id].blocker; }

private:
    struct Links {
        std::vector<std::size_t> in, out;
        std::vector<NodeId> around;
        mutable std::size_t blocker = 0;
    };

    void fault(const std::string &text) { faults_ += (faults_.empty() ? "" : "\n") + text; }
    void take_publications(NodeId id, NodeState &node, const Nodes &nodes);
    void take_asynchronous(const Nodes &nodes);
    void lay_wires(NodeId id, const Nodes &nodes, std::vector<std::string> &notes);
    void list_wires(const Nodes &nodes);
    void push(Wire &wire, Ns written, const Payload &payload, const Nodes &nodes) const;
    const Payload &value(const Topic &topic, Ns t) const;
    std::string find_cycle(const Nodes &nodes) const;

    std::vector<Topic> topics_; ///< by channel: in the order of their names at each matching
    std::map<std::string, std::uint32_t> channels_;
    std::vector<Wire> wires_;
    std::vector<Links> links_; ///< by node
    std::vector<std::string> watched_;
    mutable std::vector<std::pair<std::uint32_t, Ns>> ends_; ///< of fault_of(): last count and time, by topic
    bool matching_ = false, first_ = true;
    Ns boundary_ = -1; ///< of the last matching
    std::string faults_;
};

} // namespace fledge::cosim
