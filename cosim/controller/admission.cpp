// SPDX-License-Identifier: Apache-2.0
#include "cosim/controller/admission.h"

#include <algorithm>

namespace fledge::cosim {

void Admission::call_joiners(const Nodes &nodes, const Wiring &wiring, bool rematch)
{
    const auto any = [&](const auto &is) { return std::any_of(nodes.begin(), nodes.end(), is); };
    const bool some = any([](const NodeState &n) { return n.joining && !n.scheduled() && n.connected(); });
    if (some && !called_) {
        Ns t = -1;
        for (const NodeState &node : nodes) {
            t = node.been ? std::max(t, node.granted()) : t; // also of nodes that left: they have written
        }
        for (const Topic &topic : wiring.topics()) {
            t = topic.ahead.empty() ? t : std::max(t, topic.ahead.back().t);
        }
        called_ = std::min(t, end_);
    } else if (!some && !(rematch && any([](const NodeState &n) { return !n.over(); }))) {
        called_.reset();
    }
    choose(nodes);
}

void Admission::choose(const Nodes &nodes)
{
    boundary_ = called_;
    for (const NodeState &node : nodes) {
        if (node.scheduled() && (!boundary_ || node.config.joins_after < *boundary_)) {
            boundary_ = node.config.joins_after;
        }
    }
    last_ = std::min({end_, horizon_, boundary_.value_or(for_ever)});
}

void Admission::set_horizon(Ns horizon, const Nodes &nodes)
{
    horizon_ = std::max(horizon_, horizon);
    choose(nodes);
}

bool Admission::joins_next(const NodeState &node) const
{
    if (node.member) {
        return false;
    }
    return node.scheduled() ? node.config.joins_after == *boundary_ : node.joining && called_ && *called_ <= *boundary_;
}

bool Admission::all_met(const Nodes &nodes) const
{
    return boundary_ && std::all_of(nodes.begin(), nodes.end(), [&](const NodeState &n) {
               return n.over() || (n.stage == Stage::idle && n.complete(*boundary_));
           });
}

} // namespace fledge::cosim
