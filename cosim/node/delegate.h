// SPDX-License-Identifier: Apache-2.0
// The node's side: a program implements Node, and a Delegate exchanges frames with the controller for it.
#pragma once

#include "cosim/transport/greeting.h"

#include <memory>
#include <string>

namespace fledge::cosim {

/// A program as a node. An exception ends its part in the run, and the controller reports its text.
class Node {
public:
    virtual ~Node() = default;

    /// A run begins: return when the node steps. If request.start is not -1, this program joins a run, or takes
    /// the place of a lost program, and begins after that instant. request.snapshot is the last snapshot of the
    /// lost program, if there is one.
    virtual Initialized initialize(const Initialize &request) = 0;
    /// What the node reads.
    virtual std::vector<Subscription> desired() = 0;
    /// Which of these topics the node writes, and their values now. The controller calls match() and start() again,
    /// between ticks, where other programs join the run. All counts of messages then begin at 1.
    virtual std::vector<Publication> match(const std::vector<Channel> &channels) = 0;
    /// Which subscriptions have a writer.
    virtual void start(const std::vector<Channel> &wired) = 0;
    /// Step through all instants up to tick.until. An instant sees each record from the record's time on. The
    /// delegate sets compute_ns if it is 0.
    virtual Tock tick(const Tick &tick) = 0;
    /// All that another program of this name needs to go on from here: for nodes that set `saves`.
    virtual Bytes save() { return {}; }
    /// The run is over; "" if regularly.
    virtual void finish(const std::string &reason) { (void)reason; }
};

/// The node's reply to a request. Throws what the node throws, and ProtocolError if the message is no request.
Message answer(Node &node, const Message &request);

/// Exchanges frames with the controller for a node.
class Delegate {
public:
    /// Throws KeyError, and LinkError if neither the configuration nor the environment has an address.
    Delegate(zmq::context_t &context, MemberConfig config) : member_(context, std::move(config), Role::node) {}

    /// Take part in a run, from the greeting to the end. Returns the reason of the end, "" for the regular end.
    /// Throws LinkError if the controller refuses the node, does not answer, or is lost. Rethrows what the node
    /// throws, after reporting it to the controller.
    std::string serve(Node &node);

private:
    std::unique_ptr<SharedChannel> shared_with(const Welcome &welcome) const;

    Member member_;
};

} // namespace fledge::cosim
