// SPDX-License-Identifier: Apache-2.0
// The node's side: a program implements Node, and a Delegate speaks for it.
#pragma once

#include "cosim/security/keys.h"
#include "cosim/transport/link.h"

#include <chrono>
#include <optional>
#include <string>

namespace fledge::cosim {

/// What a program is to others. An exception ends its part in the run, and its text reaches the user.
class Node {
public:
    virtual ~Node() = default;

    /// A run is about to begin: say when you step. If request.start is not -1, this program joins a run
    /// or takes the place of one that was lost, and begins after that instant; request.snapshot is then
    /// what the lost one had saved, if anything.
    virtual Initialized initialize(const Initialize &request) = 0;
    /// What you want to read.
    virtual std::vector<Want> desired() = 0;
    /// Which of these topics you write, and what they hold now. It comes again, with start(), where other
    /// programs join the run: between ticks, and all counts of messages begin at 1 again.
    virtual std::vector<Offer> match(const std::vector<Channel> &asked) = 0;
    /// What you will read, of what you wanted.
    virtual void start(const std::vector<Channel> &wired) = 0;
    /// Step through all instants up to tick.until, with each record from its time on. In the answer
    /// compute_ns may be left at 0: the delegate measures it.
    virtual Tock tick(const Tick &tick) = 0;
    /// All that another program of this name needs to go on from here: for nodes that say `saves`.
    virtual Bytes save() { return {}; }
    /// The run is over; "" if regularly.
    virtual void finish(const std::string &reason) { (void)reason; }
};

/// The node's reply to a request of the controller. Throws what the node throws, and ProtocolError if
/// this is no request.
Message answer(Node &node, const Message &request);

/// What is not given is as the environment says: FLEDGE_SIMULATION, FLEDGE_NODE, FLEDGE_ADDRESS, FLEDGE_KEYS.
struct DelegateConfig {
    std::string simulation = {}, node = {};
    std::string address = {};                   ///< of the controller
    std::chrono::milliseconds patience{60'000}; ///< for the controller to be there
    Limits limits = {};
    std::string keys = {};              ///< a folder or file (keys.h); if FLEDGE_KEYS does not say so either, none
    Sharing sharing = Sharing::allowed; ///< of memory, with a controller on this machine
};

class Delegate {
public:
    /// Throws LinkError if neither the configuration nor the environment says where to go, and KeyError.
    Delegate(zmq::context_t &context, DelegateConfig config);

    /// Take part in a run, from the greeting to the end. Returns the reason of the end, "" if it is the
    /// regular one. Throws LinkError if the controller refuses the node, is not there, or goes; and what
    /// the node throws, after telling it.
    std::string serve(Node &node);

private:
    Welcome greet();
    std::unique_ptr<SharedChannel> shared_with(const Welcome &welcome) const;

    zmq::context_t &context_;
    DelegateConfig config_;
    std::optional<ClientKeys> keys_;
    Hello hello_;
};

} // namespace fledge::cosim
