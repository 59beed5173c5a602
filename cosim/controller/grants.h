// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "cosim/controller/wiring.h"

namespace fledge::cosim {

/// Who may step how far.
///
/// A node may step through all instants for which its inputs are known. With s the first instant at which a
/// producer may still write, a consumer may go, by the latency of the wire,
///
///     same_instant    until s - 1
///     next_instant    until s
///     next_exchange   until E + X, with E the last multiple of X before s,
///
/// where X is the longest period of the two. The least of these is its grant. From that follows all the rest:
/// producers step before their consumers, nodes joined by exchanges side by side, fast nodes many times in one
/// tick while a slow one has nothing to say. The order of replies changes how instants are grouped into ticks, but
/// never what a node sees at an instant.
class Grants {
public:
    /// A view of these. No node steps beyond `last`.
    Grants(const ControllerConfig &config, const Nodes &nodes, const Wiring &wiring, Ns last)
        : config_(config), nodes_(nodes), wiring_(wiring), last_(last)
    {
    }

    /// Until when an idle node may step in its next tick; its `reached` if it has to wait.
    Ns grant(NodeId id) const;
    /// The last instant at which no node will write any more. Nodes that join begin after all grants.
    Ns settled() const;
    /// Marks some of the nodes that owe a tock, so that the controller has nothing to do until one of these has
    /// answered with a whole tick. False if it may have to act on any other tock, too.
    bool unblocking_nodes(std::vector<char> &marked) const;

private:
    bool too_far_ahead(const Wire &wire) const { return wire.waiting() >= config_.ahead; }
    bool knows(const Wire &input, Ns t) const { return input.known_until(nodes_[input.from].first_write()) >= t; }
    Ns known_until(NodeId id) const;
    bool blocked(NodeId id) const;
    std::size_t count_deliverable(NodeId id, Ns until) const;

    const ControllerConfig &config_;
    const Nodes &nodes_;
    const Wiring &wiring_;
    Ns last_;
};

/// How far the run goes before something else has to happen: its end, the horizon of a paced run, or a boundary,
/// an instant at which all nodes meet so that others join.
class Admission {
public:
    explicit Admission(const ControllerConfig &config) : end_(config.end), horizon_(config.horizon) {}

    /// Choose the boundary for nodes that came by themselves: the first instant that no node was granted beyond.
    /// `rematch`: the last matching has to be done again there, even if the joiner has gone.
    void call_joiners(const Nodes &nodes, const Wiring &wiring, bool rematch);
    /// The nodes have to meet at t once more.
    void call_again(Ns t) { called_ = t; }
    /// The nodes have met.
    void met() { called_.reset(); }
    void set_horizon(Ns horizon, const Nodes &nodes);
    /// Choose the next boundary, after nodes or the horizon have changed.
    void choose(const Nodes &nodes);

    Ns horizon() const { return horizon_; }
    /// No node steps beyond it.
    Ns last() const { return last_; }
    std::optional<Ns> boundary() const { return boundary_; }
    /// Whether nodes meet at some time to come.
    bool calls() const { return boundary_ || called_; }
    /// Whether the node joins at the next boundary.
    bool joins_next(const NodeState &node) const;
    /// Whether all nodes have reached the boundary.
    bool all_met(const Nodes &nodes) const;

private:
    Ns end_, horizon_, last_ = 0;
    std::optional<Ns> called_;   ///< the boundary for nodes that came by themselves
    std::optional<Ns> boundary_; ///< the next one
};

} // namespace fledge::cosim
