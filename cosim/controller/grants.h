// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "cosim/controller/wiring.h"

namespace fledge::cosim {

/// How far each node may step.
///
/// A node may step through all instants for which its inputs are known. With s the first instant at which a
/// producer may still write, a consumer may go, by the latency of the wire,
///
///     same_instant    until s - 1
///     next_instant    until s
///     next_exchange   until E + X, with E the last multiple of X before s,
///
/// where X is the longest period of the two. The least of these is its grant. Therefore producers step before their
/// consumers, nodes joined by exchanges step side by side, and a fast node takes many steps in one tick between two
/// messages of a slow one. The order of replies changes how instants are grouped into ticks, but never the messages
/// that a node sees at an instant.
class Grants {
public:
    /// A view of these. No node steps beyond `last`.
    Grants(const ControllerConfig &config, const Nodes &nodes, const Wiring &wiring, Ns last)
        : config_(config), nodes_(nodes), wiring_(wiring), last_(last)
    {
    }

    /// The last instant of an idle node's next tick; its `reached` if it has to wait.
    Ns grant(NodeId id) const;
    /// No node will write up to this instant any more. Nodes that join begin after all grants.
    Ns settled() const;
    /// Marks some of the ticking nodes, so that the controller has nothing to do until one of these has finished its
    /// tick. False if the controller may have to react to any other tock, too.
    bool unblocking_nodes(std::vector<char> &marked) const;

private:
    bool too_far_ahead(const Wire &wire) const { return wire.waiting() >= config_.ahead; }
    bool knows(const Wire &input, Ns t) const { return input.known_until(nodes_[input.from].first_write()) >= t; }
    Ns known_until(NodeId id) const;
    bool blocked(NodeId id, Ns next) const;
    std::size_t count_deliverable(NodeId id, Ns until) const;

    const ControllerConfig &config_;
    const Nodes &nodes_;
    const Wiring &wiring_;
    Ns last_;
};

/// Where the run has to stop next: at its end, at the horizon of a paced run, or at a boundary, an instant that all
/// nodes reach and none passes so that others join.
class Admission {
public:
    explicit Admission(const ControllerConfig &config) : end_(config.end), horizon_(config.horizon) {}

    /// Choose the boundary for unscheduled joiners: the first instant beyond which no node was granted. `rematch`:
    /// keep it for a new matching, even if the joiner has gone.
    void call_joiners(const Nodes &nodes, const Wiring &wiring, bool rematch);
    /// The nodes have to be matched again at t.
    void call_again(Ns t) { called_ = t; }
    /// The nodes are matched at the boundary.
    void met() { called_.reset(); }
    void set_horizon(Ns horizon, const Nodes &nodes);
    /// Choose the next boundary, after nodes or the horizon have changed.
    void choose(const Nodes &nodes);

    Ns horizon() const { return horizon_; }
    /// No node steps beyond it.
    Ns last() const { return last_; }
    std::optional<Ns> boundary() const { return boundary_; }
    /// Whether there is a boundary ahead.
    bool calls() const { return boundary_ || called_; }
    /// Whether the node joins at the next boundary.
    bool joins_next(const NodeState &node) const;
    /// Whether all nodes have reached the boundary.
    bool all_met(const Nodes &nodes) const;

private:
    Ns end_, horizon_, last_ = 0;
    std::optional<Ns> called_;   ///< the boundary for unscheduled joiners
    std::optional<Ns> boundary_; ///< the next one
};

} // namespace fledge::cosim
