// SPDX-License-Identifier: Apache-2.0
// What the Controller wants done.
#pragma once

#include "cosim/controller/config.h"
#include "cosim/controller/run_listener.h"

#include <variant>

namespace fledge::cosim {

/// A node came or went, after an instant. What the other nodes see follows from these times alone: with
/// Join::at_time and a node that leaves at the same instants, the run is the same again.
struct Change {
    enum What { joined, left, given_up, back };
    What what;
    NodeId node;
    Ns after;
};

namespace action {

/// Let a program in as this node: open its socket, welcome it there.
struct Accept {
    std::uint64_t peer;
    NodeId node;
};
struct Refuse {
    std::uint64_t peer;
    std::string reason;
};
struct Send {
    NodeId node;
    Frame frame;
};
/// Close the socket of a node, which was lost or broke the rules.
struct ShutOut {
    NodeId node;
    std::string reason;
};
/// Something that the user should know.
struct Report {
    std::string text;
};
/// All nodes have been matched, and step from here on; it comes again where nodes have joined.
struct Began {
    Exchange exchange;
};
/// What a node wrote, in order and checked. The times are those of writing.
struct Wrote {
    NodeId node;
    std::vector<Record> records;
    Ns settled = -1; ///< see RunListener::settled
};
/// The run is over. "" if it came to its end.
struct Done {
    std::string reason;
};

} // namespace action

using Action = std::variant<action::Accept, action::Refuse, action::Send, action::ShutOut, action::Report,
                            action::Began, action::Wrote, action::Done>;

} // namespace fledge::cosim
