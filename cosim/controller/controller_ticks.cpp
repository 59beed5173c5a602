// SPDX-License-Identifier: Apache-2.0
// Who may step how far, and what comes of it.
#include "cosim/controller/controller_parts.h"

#include <algorithm>

namespace fledge::cosim {

namespace {

constexpr Ns fine = 10'000'000;              // by which the horizon of those moves that have no instants of their own
constexpr std::size_t most_records = 32'768; // in one tick

} // namespace

// ---- a node's times

Ns Controller::Node::next_after(Ns t) const
{
    Ns next = for_ever;
    for (const Rate &rate : rates) {
        next = std::min(next, t < rate.offset ? rate.offset
                                              : rate.offset + ((t - rate.offset) / rate.period + 1) * rate.period);
    }
    return next;
}

Ns Controller::Node::safe() const
{
    return over() ? for_ever : any_time ? reached + 1 : next_after(reached);
}

/// The last instant that all have passed, as far as writing goes. Who comes later begins after the
/// furthest that anybody was granted.
Ns Controller::settled() const
{
    Ns last = config_.end, furthest = -1;
    for (const Node &node : nodes_) {
        last = std::min(last, node.safe() - 1);
        if (!node.over()) {
            furthest = std::max(furthest, node.stage == Stage::ticking ? node.until : node.reached);
        }
    }
    return std::min(last, furthest);
}

/// The last instant for which what comes by this wire is known.
Ns Controller::bound(const Wire &wire) const
{
    const Ns s = nodes_[wire.from].safe();
    if (s == for_ever) {
        return for_ever;
    }
    if (wire.latency == Latency::next_exchange) {
        const Ns exchanges = s > 0 ? (s - 1) / wire.exchange : -1;
        return (exchanges + 1) * wire.exchange;
    }
    return wire.latency == Latency::same_instant ? s - 1 : s;
}

/// The last instant for which all inputs are known.
Ns Controller::limit(const Node &node) const
{
    Ns last = last_;
    for (const std::size_t w : node.in) {
        last = std::min(last, bound(wires_[w]));
    }
    return last;
}

/// Whether some input of its next instant is not known yet. Who stood in its way is asked first: in a
/// large exchange it is asked often.
bool Controller::blocked(Node &node) const
{
    if (node.any_time || node.rates.empty()) {
        return false;
    }
    const Ns next = node.next_after(node.reached);
    const std::size_t n = node.in.size();
    for (std::size_t i = 0; i < n; i++) {
        const std::size_t at = (node.waits_for + i) % n;
        if (bound(wires_[node.in[at]]) < next) {
            node.waits_for = at;
            return true;
        }
    }
    return false;
}

/// Whether it has nothing more to do up to t.
bool Controller::complete(const Node &node, Ns t) const
{
    return node.over() || (node.any_time ? node.reached >= t : node.next_after(node.reached) > t);
}

void Controller::set_horizon(Ns horizon)
{
    horizon_ = std::max(horizon_, horizon);
    set_last();
    if (phase_ == Phase::running) {
        grant_all();
    }
}

Ns Controller::next_due() const
{
    if (horizon_ >= config_.end) {
        return for_ever;
    }
    Ns next = config_.end;
    for (const Node &node : nodes_) {
        if (!node.over()) {
            next = std::min(next, node.rates.empty() ? horizon_ + fine : node.next_after(horizon_));
        }
    }
    return next;
}

// ---- ticks

void Controller::reply(NodeId id, Tock &m)
{
    Node &node = nodes_[id];
    if (node.returning) {
        return hear_again(id, m);
    }
    if (const std::string fault = fault_of(id, m); !fault.empty()) {
        return lost(id, fault);
    }
    node.stage = Stage::idle;
    node.tries = 0;
    node.reached = m.reached;
    for (const std::size_t w : node.in) {
        Wire &wire = wires_[w];
        while (wire.delivered && wire.pending.front().t <= node.reached) {
            wire.last = std::move(wire.pending.front().payload);
            wire.pending.pop_front();
            wire.delivered--;
        }
    }
    for (const Record &record : m.records) {
        Topic &topic = topics_[record.channel];
        topic.count = record.count;
        topic.last = record.t;
        for (const std::size_t w : topic.wires) {
            push(wires_[w], record.t, record.payload);
        }
        if (topic.wires.empty()) {
            topic.initial = record.payload; // for a reader that joins
        }
    }
    if (node.kept) {
        keep_said(node, m.records);
        look_at_log(id);
    }
    if (config_.tell && !m.records.empty()) {
        act(action::Wrote{id, std::move(m.records), settled()});
    }
    if (m.leaving) {
        return leave(id);
    }
    grant_around(id);
    look_at_boundary();
    finish_if_complete();
}

std::string Controller::fault_of(NodeId id, const Tock &m) const
{
    const Node &node = nodes_[id];
    if (m.reached <= node.reached || m.reached > node.until) {
        return "it says that it reached " + when(m.reached) + "; it may go from " + when(node.reached) + " to " +
               when(node.until);
    }
    // Counts and times follow one another within the tock, too.
    std::vector<std::pair<std::uint32_t, Ns>> ends(topics_.size(), {0, -1});
    std::vector<bool> seen(topics_.size());
    for (const Record &record : m.records) {
        if (record.channel >= topics_.size() || topics_[record.channel].writer != id) {
            return "it wrote on channel " + std::to_string(record.channel) + ", which is not its own";
        }
        const Topic &topic = topics_[record.channel];
        auto &[count, last] = ends[record.channel];
        if (!seen[record.channel]) {
            seen[record.channel] = true;
            count = topic.count;
            last = topic.last;
        }
        const std::string what = "message " + std::to_string(record.count) + " of " + topic.name;
        if (record.count != count + 1) {
            return record.count <= count ? "duplicate: " + what + " came before"
                                         : "gap: " + what + " follows message " + std::to_string(count);
        }
        if (record.t <= node.reached) {
            return "late: " + what + " is of " + when(record.t) + ", and others have passed it";
        }
        if (record.t > m.reached) {
            return "early: " + what + " is of " + when(record.t) + ", which it has not reached";
        }
        if (record.t <= last) {
            return "out of order: " + what + " is of " + when(record.t) + ", the one before of " + when(last);
        }
        if (!node.any_time && node.next_after(record.t - 1) != record.t) {
            return "out of step: " + what + " is of " + when(record.t) + ", when it does not step";
        }
        if (!is_payload(record.payload, topic.schema.size)) {
            return "incomplete: " + what + " has " + std::to_string(record.payload.size()) +
                   " bytes; expected a CDR header and " + std::to_string(topic.schema.size);
        }
        count = record.count;
        last = record.t;
    }
    return "";
}

/// Messages that no instant of the reader would see make room for the next.
void Controller::push(Wire &wire, Ns written, const Bytes &payload)
{
    const Node &reader = nodes_[wire.to];
    if (reader.over() && (!reader.matching || spoilt_)) {
        wire.last = payload; // for one that joins
        return;
    }
    const Ns seen = wire.latency == Latency::same_instant ? written
                    : wire.latency == Latency::next_instant
                        ? written + 1
                        : (written + wire.exchange - 1) / wire.exchange * wire.exchange + 1;
    while (wire.pending.size() > wire.delivered) {
        const Ns before = wire.pending.back().t;
        if (before < seen && (reader.any_time || reader.next_after(before - 1) < seen)) {
            break;
        }
        wire.pending.pop_back();
    }
    wire.pending.push_back({seen, payload});
}

void Controller::grant(NodeId id)
{
    Node &node = nodes_[id];
    if (phase_ != Phase::running || !node.member || node.stage != Stage::idle || node.returning || paused() ||
        complete(node, last_) || save_if_due(id)) {
        return;
    }
    for (const std::size_t w : node.out) {
        if (wires_[w].pending.size() >= config_.ahead) {
            return; // it is far ahead of this reader
        }
    }
    if (blocked(node)) {
        return;
    }
    const Ns most = limit(node);
    Tick tick;
    for (std::uint32_t batch = config_.batch;; batch /= 2) {
        tick.until = most;
        std::uint32_t n = 1;
        if (!node.rates.empty()) {
            Ns t = node.next_after(node.reached);
            if (!node.any_time && t > most) {
                return;
            }
            for (Ns next = node.next_after(t); next <= most && n < batch; next = node.next_after(t), n++) {
                t = next;
            }
            if (!node.any_time || n == batch) {
                tick.until = std::min(most, t);
            }
        }
        if (tick.until <= node.reached) {
            return;
        }
        std::size_t records = 0;
        for (const std::size_t w : node.in) {
            const Wire &wire = wires_[w];
            for (auto i = wire.delivered; i < wire.pending.size() && wire.pending[i].t <= tick.until; i++) {
                records++;
            }
        }
        if (records <= most_records || n == 1) {
            tick.records.reserve(records);
            break;
        }
    }
    for (const std::size_t w : node.in) {
        Wire &wire = wires_[w];
        for (; wire.delivered < wire.pending.size() && wire.pending[wire.delivered].t <= tick.until; wire.delivered++) {
            const Pending &pending = wire.pending[wire.delivered];
            tick.records.push_back({wire.channel, ++wire.count, pending.t, pending.payload});
        }
    }
    if (node.kept) {
        keep_told(node, tick.records);
    }
    node.until = tick.until;
    node.stage = Stage::ticking;
    send<Tick, Tock>(id, std::move(tick));
}

void Controller::grant_all()
{
    for (NodeId id = 0; id < nodes_.size(); id++) {
        grant(id);
    }
}

/// Before a node is granted anything, its own tock has to come, and those of all that block it then. To
/// watch for one of these is enough. One that stands still blocks it only until another of its own comes.
bool Controller::decisive(std::vector<char> &nodes) const
{
    nodes.assign(nodes_.size(), false);
    if (phase_ != Phase::running || boundary_ || called_) {
        return false;
    }
    const NodeId nobody = nodes_.size();
    NodeId ticking = nobody;
    for (NodeId id = 0; id < nodes_.size(); id++) {
        const Node &node = nodes_[id];
        const bool ticks = node.stage == Stage::ticking;
        if ((node.awaited && !ticks) || node.returning) {
            return false;
        }
        ticking = ticks ? id : ticking;
        const Ns from = ticks ? node.until : node.reached;
        const Ns next = node.any_time ? from + 1 : node.next_after(from);
        if (node.over() || next > last_) {
            continue;
        }
        // The last of them, for it was asked last and is perhaps the last to answer.
        NodeId watched = ticks ? id : nobody;
        bool enough = ticks && nodes[id];
        const auto blocked_by = [&](NodeId other) {
            enough = enough || nodes[other] || nodes_[other].stage != Stage::ticking;
            watched = watched == nobody ? other : std::max(watched, other);
        };
        for (const std::size_t w : node.out) {
            if (!ticks && wires_[w].pending.size() >= config_.ahead) {
                blocked_by(wires_[w].to);
            }
        }
        for (const std::size_t w : node.in) {
            if (bound(wires_[w]) < next) {
                blocked_by(wires_[w].from);
            }
        }
        if (watched == nobody) {
            return false; // it is held by something else
        }
        if (!enough) {
            nodes[watched] = true;
        }
    }
    if (ticking != nobody && std::find(nodes.begin(), nodes.end(), true) == nodes.end()) {
        nodes[ticking] = true; // the end comes with the last tock
    }
    return ticking != nobody;
}

/// A node has gone on: it may go further, and so may those that wait for it, before or behind.
void Controller::grant_around(NodeId id)
{
    grant(id);
    for (const std::size_t w : nodes_[id].out) {
        grant(wires_[w].to);
    }
    for (const std::size_t w : nodes_[id].in) {
        grant(wires_[w].from);
    }
}

} // namespace fledge::cosim
