// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "cosim/controller/wiring.h"

namespace fledge::cosim {

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
