// SPDX-License-Identifier: Apache-2.0
#include "cosim/controller/grants.h"

#include <algorithm>

namespace fledge::cosim {

namespace {

constexpr std::size_t most_ahead = 32'768; // in one tick

} // namespace

Ns Grants::grant(NodeId id) const
{
    const NodeState &node = nodes_[id];
    const Schedule &schedule = node.schedule;
    const auto &out = wiring_.outputs(id);
    const Ns first = schedule.next_after(node.reached);
    if (blocked(id, first) ||
        std::any_of(out.begin(), out.end(), [&](std::size_t w) { return too_far_ahead(wiring_.wires()[w]); })) {
        return node.reached;
    }
    const Ns most = std::min(known_until(id), node.played() ? node.from : node.keep);
    for (std::uint32_t batch = config_.batch;; batch /= 2) {
        Ns until = most;
        std::uint32_t n = 1;
        if (!schedule.rates.empty()) {
            Ns t = first;
            if (!schedule.any_time && t > most) {
                return node.reached;
            }
            for (Ns next = schedule.next_after(t); next <= most && n < batch; next = schedule.next_after(t), n++) {
                t = next;
            }
            if (!schedule.any_time || n == batch) {
                until = std::min(most, t);
            }
        }
        if (until <= node.reached || n == 1 || count_deliverable(id, until) <= most_ahead) {
            return std::max(until, node.reached);
        }
    }
}

/// The last instant for which all inputs are known.
Ns Grants::known_until(NodeId id) const
{
    Ns last = last_;
    for (const std::size_t w : wiring_.inputs(id)) {
        const Wire &wire = wiring_.wires()[w];
        last = std::min(last, wire.known_until(nodes_[wire.from].first_write()));
    }
    return last;
}

/// Whether some input of the node's next instant is not known yet. It tries the input first that blocked the node
/// last, because large exchanges call this function often.
bool Grants::blocked(NodeId id, Ns next) const
{
    const NodeState &node = nodes_[id];
    if (node.schedule.any_time || node.schedule.rates.empty()) {
        return false;
    }
    const auto &in = wiring_.inputs(id);
    std::size_t &at = wiring_.last_blocker(id);
    for (std::size_t i = 0; i < in.size(); i++, at++) {
        at = at < in.size() ? at : 0;
        if (!knows(wiring_.wires()[in[at]], next)) {
            return true;
        }
    }
    return false;
}

std::size_t Grants::count_deliverable(NodeId id, Ns until) const
{
    std::size_t n = 0;
    for (const std::size_t w : wiring_.inputs(id)) {
        n += wiring_.wires()[w].count_deliverable(until);
    }
    return n;
}

Ns Grants::settled() const
{
    Ns last = config_.end, furthest = -1;
    for (const NodeState &node : nodes_) {
        last = std::min(last, node.first_write() - 1);
        if (!node.over()) {
            furthest = std::max(furthest, node.granted());
        }
    }
    return std::min(last, furthest);
}

/// Before the controller can grant a node its next tick, it needs the node's own tock and those of all nodes that block
/// it: to watch one of these is enough. If one of them is idle, it waits for another ticking node, which is watched.
bool Grants::unblocking_nodes(std::vector<char> &marked) const
{
    marked.assign(nodes_.size(), false);
    const NodeId none = nodes_.size();
    NodeId ticking = none;
    for (NodeId id = 0; id < nodes_.size(); id++) {
        const NodeState &node = nodes_[id];
        const bool ticks = node.stage == Stage::ticking;
        if ((node.awaited && !ticks) || node.returning) {
            return false;
        }
        ticking = ticks ? id : ticking;
        const Ns next = node.schedule.first_write_after(node.granted());
        if (node.over() || next > last_) {
            continue;
        }
        // The last of the blocking nodes got its tick last, and is perhaps the last to answer.
        NodeId watched = ticks ? id : none;
        bool enough = ticks && marked[id];
        const auto blocked_by = [&](NodeId other) {
            enough = enough || marked[other] || nodes_[other].stage != Stage::ticking;
            watched = watched == none ? other : std::max(watched, other);
        };
        for (const std::size_t w : wiring_.outputs(id)) {
            if (!ticks && too_far_ahead(wiring_.wires()[w])) {
                blocked_by(wiring_.wires()[w].to);
            }
        }
        for (const std::size_t w : wiring_.inputs(id)) {
            if (!knows(wiring_.wires()[w], next)) {
                blocked_by(wiring_.wires()[w].from);
            }
        }
        if (watched == none) {
            return false; // the node waits for something else than tocks
        }
        if (!enough) {
            marked[watched] = true;
        }
    }
    if (ticking != none && std::find(marked.begin(), marked.end(), true) == marked.end()) {
        marked[ticking] = true; // the run ends with the last tock
    }
    return ticking != none;
}

// ---- admission

void Admission::call_joiners(const Nodes &nodes, const Wiring &wiring, bool rematch)
{
    const auto any = [&](const auto &is) { return std::any_of(nodes.begin(), nodes.end(), is); };
    const bool some = any([](const NodeState &n) { return n.joining && !n.scheduled() && n.connected(); });
    if (some && !called_) {
        Ns t = -1;
        for (const NodeState &node : nodes) {
            t = node.been ? std::max(t, node.granted()) : t; // also nodes that left: their messages count
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
