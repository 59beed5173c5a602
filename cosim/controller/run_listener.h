// SPDX-License-Identifier: Apache-2.0
// Listeners, such as records and the broker, see all messages between nodes without taking part in the run.
#pragma once

#include "cosim/controller/topic_map.h"
#include "cosim/protocol/protocol.h"

namespace fledge::cosim {

/// The nodes of a run, and their topics.
struct Exchange {
    struct Member {
        std::string name;
        bool present = true; ///< in the run
        std::vector<Rate> rates;
        bool any_time = false;
        std::vector<Subscription> subscriptions; ///< also optional ones without a writer
        TopicMap names;
    };
    struct Topic {
        std::string name;
        Schema schema;
        std::string writer; ///< a node's name; "" if there is none
        Payload initial;    ///< its value at the beginning
    };
    Ns after = -1; ///< valid after this instant; -1: from the reset on
    std::vector<Member> members;
    std::vector<Topic> topics; ///< by channel number
};

/// A node with all its state, from which another program goes on as the node would have.
struct NodeSnapshot {
    std::string node;
    Ns reached = -1; ///< it has stepped through this instant
    Payload bytes;
};

/// The Router calls it between two ticks: its time slows the run. An exception ends the run.
class RunListener {
public:
    virtual ~RunListener() = default;

    /// The nodes are matched and step from here on; again at each boundary where nodes join.
    virtual void began(const Exchange &exchange) = 0;
    /// Messages that a node wrote: checked, in order, with the times of writing.
    virtual void wrote(const std::string &node, const std::vector<Record> &records) = 0;
    /// No node will write up to this instant any more, except a node that joins after a loss.
    virtual void settled(Ns) {}
    /// All nodes that can have made snapshots of what they are at t: each has made its steps up to t, and no later one.
    /// All messages until t were given before.
    virtual void kept(Ns, const std::vector<NodeSnapshot> &) {}
    /// The run is over; "" for the regular end.
    virtual void ended(const std::string &reason) = 0;
};

} // namespace fledge::cosim
