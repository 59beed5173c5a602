// SPDX-License-Identifier: Apache-2.0
// Topics, their channels, and the wires from writers to readers.
#include "cosim/controller/controller_parts.h"

#include <algorithm>
#include <set>

namespace fledge::cosim {

namespace {

/// Why a definition cannot be used; "" if it can.
std::string fault_of(const Schema &schema)
{
    if (!schema.given()) {
        return schema.size || schema.hash ? "it has a size or hash, but no text" : "";
    }
    try {
        const Schema made = make_schema(schema.name, schema.text);
        return made.size != schema.size
                   ? "its text makes " + std::to_string(made.size) + " bytes, not " + std::to_string(schema.size)
               : made.hash != schema.hash ? "its hash is not that of its text"
                                          : "";
    } catch (const SchemaError &error) {
        return error.what();
    }
}

Ns longest_period(const std::vector<Rate> &a, const std::vector<Rate> &b)
{
    Ns longest = 0;
    for (const auto *rates : {&a, &b}) {
        for (const Rate &rate : *rates) {
            longest = std::max(longest, rate.period);
        }
    }
    return longest;
}

} // namespace

/// Channels are numbered in the order of their topics' names, whoever came first; those of joiners
/// follow.
void Controller::number_topics()
{
    std::set<std::string> names;
    for (const std::string &topic : config_.watched) {
        if (!channels_.contains(topic)) {
            names.insert(topic);
        }
    }
    for (const Node &node : nodes_) {
        for (const Want &want : node.wants) {
            if (node.matching && !channels_.contains(want.topic)) {
                names.insert(want.topic);
            }
        }
    }
    for (const std::string &name : names) {
        channels_[name] = static_cast<std::uint32_t>(topics_.size());
        topics_.emplace_back().name = name;
    }
    for (NodeId id = 0; id < nodes_.size(); id++) {
        const Node &node = nodes_[id];
        for (const Want &want : node.wants) {
            if (!node.matching) {
                continue;
            }
            Topic &topic = topics_[channels_.at(want.topic)];
            if (std::find(topic.wanted_by.begin(), topic.wanted_by.end(), id) == topic.wanted_by.end()) {
                topic.wanted_by.push_back(id);
            }
            if (!topic.schema.given()) {
                topic.schema = want.schema; // for a writer that has no definition of its own
            }
            if (const std::string fault = cosim::fault_of(want.schema); !fault.empty()) {
                add_fault(faults_, node.config.name + " wants " + want.topic + " with a bad definition: " + fault);
            }
        }
    }
}

void Controller::ask_for_match(NodeId id)
{
    Match match;
    for (std::uint32_t channel = 0; channel < topics_.size(); channel++) {
        const auto &wanted_by = topics_[channel].wanted_by;
        const auto &watched = config_.watched;
        if (std::find(watched.begin(), watched.end(), topics_[channel].name) != watched.end() ||
            std::any_of(wanted_by.begin(), wanted_by.end(), [&](NodeId other) { return other != id; })) {
            match.asked.push_back({channel, topics_[channel].name, topics_[channel].schema});
        }
    }
    send<Match, Matched>(id, std::move(match));
}

void Controller::take_offers(NodeId id)
{
    Node &node = nodes_[id];
    const std::string &name = node.config.name;
    std::vector<bool> offered(topics_.size());
    for (Offer &offer : node.offers) {
        if (offer.channel >= topics_.size()) {
            add_fault(faults_, name + " offers a channel " + std::to_string(offer.channel) + " that nobody asked for");
            continue;
        }
        Topic &topic = topics_[offer.channel];
        offered[offer.channel] = true;
        const bool again = topic.writer == id && topic.since >= -1 && node.member && begun_;
        if (again) {
            if (offer.schema.given() && offer.schema != topic.schema) {
                add_fault(faults_, name + " offers " + topic.name + " with another definition than before");
            }
            continue;
        }
        if (topic.writer && topic.since >= -1) {
            add_fault(faults_, topic.name + " is written by " + nodes_[*topic.writer].config.name + " and by " + name +
                                   "; one of them has to leave it or call it otherwise");
            continue;
        }
        topic.writer = id;
        topic.since = meeting_;
        topic.last = topic.since;
        topic.ahead.clear();
        if (const std::string fault = cosim::fault_of(offer.schema); !fault.empty()) {
            add_fault(faults_, name + " offers " + topic.name + " with a bad definition: " + fault);
            continue;
        }
        if (offer.schema.given()) {
            topic.schema = offer.schema;
        }
        if (!topic.schema.given()) {
            add_fault(faults_, name + " offers " + topic.name + ", which neither it nor a reader defines");
        } else if (!is_payload(offer.initial, topic.schema.size)) {
            add_fault(faults_, name + " offers " + topic.name + " with an initial value of " +
                                   std::to_string(offer.initial.size()) + " bytes; expected a CDR header and " +
                                   std::to_string(topic.schema.size));
        }
        topic.initial = std::move(offer.initial);
    }
    for (std::size_t channel = 0; channel < topics_.size(); channel++) {
        if (topics_[channel].writer == id && node.member && !offered[channel]) {
            add_fault(faults_, name + " no longer offers " + topics_[channel].name);
        }
    }
}

/// The last that was written until t, which all have reached.
const Bytes &Controller::value(const Topic &topic, Ns t) const
{
    if (!topic.ahead.empty()) {
        const Bytes *last = &topic.held;
        for (const Pending &write : topic.ahead) {
            last = write.t <= t ? &write.payload : last;
        }
        return *last;
    }
    if (topic.wires.empty()) {
        return topic.initial;
    }
    const Wire &wire = wires_[topic.wires.front()];
    return wire.pending.empty() ? wire.last : wire.pending.back().payload;
}

/// What comes from no node's step may be of a time that not all have reached.
void Controller::write_ahead(Topic &topic, Ns written, const Bytes &payload)
{
    Ns furthest = -1; // no boundary lies before
    for (const Node &node : nodes_) {
        furthest = node.been ? std::max(furthest, node.reached) : furthest;
    }
    if (topic.ahead.empty()) {
        topic.held = value(topic, furthest);
    }
    for (; !topic.ahead.empty() && topic.ahead.front().t <= furthest; topic.ahead.pop_front()) {
        topic.held = std::move(topic.ahead.front().payload);
    }
    topic.ahead.push_back({written, payload});
    for (const std::size_t w : topic.wires) {
        push(wires_[w], written, payload);
    }
}

void Controller::connect()
{
    const bool late =
        std::any_of(nodes_.begin(), nodes_.end(), [](const Node &n) { return !n.matching && !n.asynchronous; });
    constexpr const char *later = "; if one that joins later does, the wish has to be optional";
    for (NodeId id = 0; id < nodes_.size(); id++) {
        Node &node = nodes_[id];
        if (!node.matching) {
            continue;
        }
        const bool joins = !node.member;
        std::set<std::string> seen;
        for (const Want &want : node.wants) {
            const std::string wish = node.config.name + " wants " + want.topic;
            if (!seen.insert(want.topic).second) {
                add_fault(faults_, wish + " twice");
                continue;
            }
            const std::uint32_t channel = channels_.at(want.topic);
            Topic &topic = topics_[channel];
            if (!topic.writer || *topic.writer == id) {
                if (!want.optional) {
                    add_fault(faults_, wish + ", which no other node writes" + (late ? later : ""));
                } else if ((!begun_ || joins) && !late) {
                    report(wish + ", which no other node writes; it can do without");
                }
                continue;
            }
            const Node &writer = nodes_[*topic.writer];
            if (!cosim::fault_of(topic.schema).empty() || !cosim::fault_of(want.schema).empty()) {
                continue; // said already
            }
            if (const std::string why = schema_difference(topic.schema, want.schema); !why.empty()) {
                add_fault(faults_, wish + " of " + writer.config.name + ", but " + why);
                continue;
            }
            const Ns exchange = longest_period(node.rates, writer.rates);
            if (want.latency == Latency::next_exchange && !exchange) {
                add_fault(faults_, wish + " at exchanges, but neither it nor " + writer.config.name +
                                       " says how often it steps");
                continue;
            }
            const bool fresh = topic.since == meeting_; // its writer, to it, is new
            auto wire = std::find_if(wires_.begin(), wires_.end(),
                                     [&](const Wire &w) { return w.to == id && w.channel == channel; });
            const Bytes seen_first = fresh ? topic.initial : value(topic, meeting_);
            if (wire == wires_.end()) {
                wires_.push_back({channel, *topic.writer, id, want.latency, exchange, {}, 0, 0, {}});
                wire = wires_.end() - 1;
            } else if (!joins && !fresh) {
                continue; // as before, with what is on its way
            }
            wire->from = *topic.writer;
            wire->latency = want.latency;
            wire->exchange = exchange;
            wire->delivered = 0;
            wire->pending.clear();
            wire->pending.push_back({meeting_ + 1, seen_first});
            for (const Pending &write : topic.ahead) {
                if (write.t > meeting_) {
                    push(*wire, write.t, write.payload);
                }
            }
        }
    }
    for (Wire &wire : wires_) {
        const Topic &topic = topics_[wire.channel];
        if (topic.since == meeting_ && !nodes_[wire.to].matching) { // its reader has gone, perhaps to come again
            wire.from = *topic.writer;
            wire.last = topic.initial;
            wire.pending.clear();
            wire.delivered = 0;
        }
    }
    list_wires();
    if (const std::string cycle = find_cycle(); !cycle.empty()) {
        add_fault(faults_, cycle);
    }
}

/// What follows from the wires: who has which, inputs in the order of the wishes.
void Controller::list_wires()
{
    std::map<std::pair<NodeId, std::uint32_t>, std::size_t> place;
    for (Node &node : nodes_) {
        node.in.clear();
        node.out.clear();
    }
    for (Topic &topic : topics_) {
        topic.wires.clear();
    }
    for (std::size_t w = 0; w < wires_.size(); w++) {
        place[{wires_[w].to, wires_[w].channel}] = w;
        nodes_[wires_[w].from].out.push_back(w);
        topics_[wires_[w].channel].wires.push_back(w);
    }
    for (NodeId id = 0; id < nodes_.size(); id++) {
        for (const Want &want : nodes_[id].wants) {
            const auto channel = channels_.find(want.topic);
            const auto wire = channel == channels_.end() ? place.end() : place.find({id, channel->second});
            if (wire != place.end()) {
                nodes_[id].in.push_back(wire->second);
            }
        }
    }
}

/// Nodes that wait for one another at the same instant could not step at all. Two that may write at
/// any time and wait for one another's next instant would go on by a nanosecond at a time.
std::string Controller::find_cycle() const
{
    const auto waits = [&](const Wire &wire) {
        return nodes_[wire.from].matching && nodes_[wire.to].matching &&
               (wire.latency == Latency::same_instant ||
                (wire.latency == Latency::next_instant && nodes_[wire.from].any_time && nodes_[wire.to].any_time));
    };
    enum Colour { white, grey, black };
    std::vector<Colour> colour(nodes_.size(), white);
    std::vector<const Wire *> path;
    std::string found;
    const auto visit = [&](const auto &self, NodeId id) -> void {
        colour[id] = grey;
        for (const std::size_t w : nodes_[id].out) {
            const Wire &wire = wires_[w];
            if (!waits(wire) || !found.empty() || colour[wire.to] == black) {
                continue;
            }
            path.push_back(&wire);
            if (colour[wire.to] == grey) {
                const auto begin =
                    std::find_if(path.begin(), path.end(), [&](const Wire *p) { return p->from == wire.to; });
                for (auto it = begin; it != path.end(); ++it) {
                    found += (it == begin ? "" : ", ") + nodes_[(*it)->to].config.name + " for " +
                             topics_[(*it)->channel].name + " of " + nodes_[(*it)->from].config.name;
                }
            } else {
                self(self, wire.to);
            }
            path.pop_back();
        }
        colour[id] = black;
    };
    for (NodeId id = 0; id < nodes_.size(); id++) {
        if (colour[id] == white && found.empty()) {
            visit(visit, id);
        }
    }
    return found.empty() ? ""
                         : "these wait for one another without end: " + found +
                               "; one of these messages has to be read later, at the next instant "
                               "or exchange";
}

Exchange Controller::exchange() const
{
    Exchange exchange;
    exchange.after = meeting_;
    for (const Node &node : nodes_) {
        exchange.members.push_back({node.config.name, !node.over(), node.rates, node.any_time, node.wants});
    }
    for (const Topic &topic : topics_) {
        exchange.topics.push_back(
            {topic.name, topic.schema, topic.writer ? nodes_[*topic.writer].config.name : "", value(topic, meeting_)});
    }
    return exchange;
}

} // namespace fledge::cosim
