// SPDX-License-Identifier: Apache-2.0
// Nodes join at a boundary, an instant that all nodes have reached and none has passed:
//
// - A joiner begins after the boundary and sees the last message of each topic written until then. Readers see its
//   first messages after the boundary.
// - All other wires stay as they are, with the messages on their way.
//
// So the messages that a node sees depend on the boundary's time alone.
#include "cosim/controller/wiring.h"

#include <algorithm>
#include <set>

namespace fledge::cosim {

namespace {

template <class List, class T> bool contains(const List &list, const T &item)
{
    return std::find(list.begin(), list.end(), item) != list.end();
}

std::string size_fault(const Payload &payload, const Schema &schema)
{
    return std::to_string(payload.size()) + " bytes; expected a CDR header and " + std::to_string(schema.size);
}

} // namespace

// ---- matching

/// Channels are numbered in the order of the topics' names; the topics of joiners follow.
void Wiring::begin_matching(const Nodes &nodes, const std::vector<std::string> &watched, Ns boundary, bool first)
{
    matching_ = true;
    first_ = first;
    boundary_ = boundary;
    watched_ = watched;
    faults_.clear();
    std::set<std::string> names(watched.begin(), watched.end());
    for (const NodeState &node : nodes) {
        for (std::size_t i = 0; node.matching && i < node.subscriptions.size(); i++) {
            names.insert(node.subscriptions[i].topic);
        }
    }
    for (const std::string &name : names) {
        if (channels_.try_emplace(name, static_cast<std::uint32_t>(topics_.size())).second) {
            topics_.emplace_back().name = name;
        }
    }
    for (NodeId id = 0; id < nodes.size(); id++) {
        const NodeState &node = nodes[id];
        for (std::size_t i = 0; node.matching && i < node.subscriptions.size(); i++) {
            const Subscription &subscription = node.subscriptions[i];
            Topic &topic = topics_[channels_.at(subscription.topic)];
            if (!contains(topic.readers, id)) {
                topic.readers.push_back(id);
            }
            if (!topic.schema.given()) {
                topic.schema = subscription.schema; // for a writer without a definition
            }
            if (const std::string why = schema_fault(subscription.schema); !why.empty()) {
                fault(node.name() + " subscribes to " + topic.name + " with a bad definition: " + why);
            }
        }
    }
}

Match Wiring::request_for(NodeId id, const TopicMap &names) const
{
    Match match;
    for (std::uint32_t channel = 0; channel < topics_.size(); channel++) {
        const Topic &topic = topics_[channel];
        const std::optional<std::string> ours = names.to_node(topic.name);
        if (ours && (contains(watched_, topic.name) || std::any_of(topic.readers.begin(), topic.readers.end(),
                                                                   [&](NodeId reader) { return reader != id; }))) {
            match.channels.push_back({channel, *ours, topic.schema});
        }
    }
    return match;
}

void Wiring::connect(Nodes &nodes, std::vector<std::string> &notes)
{
    for (Topic &topic : topics_) {
        topic.vacant = topic.vacant || (topic.writer && nodes[*topic.writer].over());
    }
    for (NodeId id = 0; id < nodes.size(); id++) {
        if (nodes[id].matching) {
            take_publications(id, nodes[id], nodes);
        }
    }
    take_asynchronous(nodes);
    for (NodeId id = 0; id < nodes.size(); id++) {
        if (nodes[id].matching) {
            lay_wires(id, nodes, notes);
        }
    }
    for (Wire &wire : wires_) {
        const Topic &topic = topics_[wire.channel];
        if (!topic.vacant && topic.since == boundary_ && !nodes[wire.to].matching) {
            wire.from = *topic.writer; // the reader is away and may come again
            wire.empty();
            wire.set_last(topic.initial);
        }
    }
    list_wires(nodes);
    if (const std::string cycle = find_cycle(nodes); !cycle.empty()) {
        fault(cycle);
    }
}

void Wiring::take_publications(NodeId id, NodeState &node, const Nodes &nodes)
{
    const std::string &name = node.name();
    std::vector<bool> published(topics_.size());
    for (Publication &publication : node.publications) {
        if (publication.channel >= topics_.size()) {
            fault(name + " publishes channel " + std::to_string(publication.channel) + ", which no node subscribes to");
            continue;
        }
        Topic &topic = topics_[publication.channel];
        published[publication.channel] = true;
        if (topic.writer == id && !topic.vacant && node.member && !first_) {
            if (publication.schema.given() && publication.schema != topic.schema) {
                fault(name + " publishes " + topic.name + " with another definition than before");
            }
            continue;
        }
        if (topic.writer && !topic.vacant) {
            fault(topic.name + " is written by " + nodes[*topic.writer].name() + " and by " + name +
                  "; one of them has to rename it");
            continue;
        }
        topic.take(id, boundary_);
        if (const std::string why = schema_fault(publication.schema); !why.empty()) {
            fault(name + " publishes " + topic.name + " with a bad definition: " + why);
            continue;
        }
        if (publication.schema.given()) {
            topic.schema = publication.schema;
        }
        if (!topic.schema.given()) {
            fault(name + " publishes " + topic.name + ", which neither it nor a reader defines");
        } else if (!is_payload(publication.initial, topic.schema.size)) {
            fault(name + " publishes " + topic.name + " with an initial value of " +
                  size_fault(publication.initial, topic.schema));
        }
        topic.initial = std::move(publication.initial);
    }
    for (std::size_t channel = 0; channel < topics_.size(); channel++) {
        if (topics_[channel].writer == id && node.member && !published[channel]) {
            fault(name + " no longer publishes " + topics_[channel].name);
        }
    }
}

/// Asynchronous programs write the topics that no node writes.
void Wiring::take_asynchronous(const Nodes &nodes)
{
    for (Topic &topic : topics_) {
        topic.count = topic.before = 0; // all writers begin again at 1
        if (topic.readers.empty() || (topic.writer && !nodes[*topic.writer].over())) {
            continue;
        }
        for (NodeId id = 0; id < nodes.size(); id++) {
            const auto &program = nodes[id].program;
            if (!program || topic.writer == id || !program->writes(topic.name)) {
                continue;
            }
            if (!topic.schema.given()) {
                fault(topic.name + " comes from " + program->name +
                      ", an asynchronous program, and no reader defines it; one of them has to");
            }
            topic.take(id, boundary_);
            topic.initial = zero_payload(topic.schema.size);
        }
    }
}

void Wiring::lay_wires(NodeId id, const Nodes &nodes, std::vector<std::string> &notes)
{
    const bool late =
        std::any_of(nodes.begin(), nodes.end(), [](const NodeState &n) { return !n.matching && !n.program; });
    const NodeState &node = nodes[id];
    const bool joins = !node.member;
    std::set<std::string> seen;
    for (const Subscription &subscription : node.subscriptions) {
        const std::string what = node.name() + " subscribes to " + subscription.topic;
        if (!seen.insert(subscription.topic).second) {
            fault(what + " twice");
            continue;
        }
        const std::uint32_t channel = channels_.at(subscription.topic);
        const Topic &topic = topics_[channel];
        if (!topic.writer || *topic.writer == id) {
            if (!subscription.optional) {
                fault(what + ", which no other node writes" +
                      (late ? "; if one that joins later does, the subscription has to be optional" : ""));
            } else if ((first_ || joins) && !late) {
                notes.push_back(what + ", which no other node writes; the subscription is optional");
            }
            continue;
        }
        const NodeState &writer = nodes[*topic.writer];
        if (!schema_fault(topic.schema).empty() || !schema_fault(subscription.schema).empty()) {
            continue; // reported above
        }
        if (const std::string why = schema_difference(topic.schema, subscription.schema); !why.empty()) {
            fault(what + " of " + writer.name() + ", but " + why);
            continue;
        }
        const Ns exchange = std::max(node.schedule.longest_period(), writer.schedule.longest_period());
        if (subscription.latency == Latency::next_exchange && !exchange) {
            fault(what + " at exchanges, but neither it nor " + writer.name() + " has a period");
            continue;
        }
        const bool fresh = !topic.vacant && topic.since == boundary_; // its writer is new
        auto wire = std::find_if(wires_.begin(), wires_.end(),
                                 [&](const Wire &w) { return w.to == id && w.channel == channel; });
        if (wire != wires_.end() && !joins && !fresh) {
            continue; // as before, with the messages on their way
        }
        const Payload first = fresh ? topic.initial : value(topic, boundary_);
        if (wire == wires_.end()) {
            wire = wires_.emplace(wires_.end(), channel, id);
        }
        wire->lay(*topic.writer, subscription.latency, exchange, boundary_, first);
        for (const TimedPayload &write : topic.ahead) {
            if (write.t > boundary_) {
                push(*wire, write.t, write.payload, nodes);
            }
        }
    }
}

void Wiring::list_wires(const Nodes &nodes)
{
    std::map<std::pair<NodeId, std::uint32_t>, std::size_t> place;
    links_.assign(nodes.size(), {});
    for (Topic &topic : topics_) {
        topic.wires.clear();
    }
    for (std::size_t w = 0; w < wires_.size(); w++) {
        place[{wires_[w].to, wires_[w].channel}] = w;
        links_[wires_[w].from].out.push_back(w);
        topics_[wires_[w].channel].wires.push_back(w);
    }
    for (NodeId id = 0; id < nodes.size(); id++) {
        for (const Subscription &subscription : nodes[id].subscriptions) {
            const auto channel = find(subscription.topic);
            const auto wire = channel ? place.find({id, *channel}) : place.end();
            if (wire != place.end()) {
                links_[id].in.push_back(wire->second);
            }
        }
    }
    for (Links &links : links_) {
        const auto add = [&](NodeId id) {
            if (std::ranges::find(links.around, id) == links.around.end()) {
                links.around.push_back(id);
            }
        };
        for (const std::size_t w : links.out) {
            add(wires_[w].to);
        }
        for (const std::size_t w : links.in) {
            add(wires_[w].from);
        }
    }
}

/// Nodes that wait for each other at the same instant could never step. Two nodes that may write at any time and wait
/// for each other's next instant would step one nanosecond per tick.
std::string Wiring::find_cycle(const Nodes &nodes) const
{
    const auto waits = [&](const Wire &wire) {
        const NodeState &from = nodes[wire.from], &to = nodes[wire.to];
        return from.matching && to.matching &&
               (wire.latency() == Latency::same_instant ||
                (wire.latency() == Latency::next_instant && from.schedule.any_time && to.schedule.any_time));
    };
    enum Colour { white, grey, black };
    std::vector<Colour> colour(nodes.size(), white);
    std::vector<const Wire *> path;
    std::string found;
    const auto visit = [&](const auto &self, NodeId id) -> void {
        colour[id] = grey;
        for (const std::size_t w : links_[id].out) {
            const Wire &wire = wires_[w];
            if (!waits(wire) || !found.empty() || colour[wire.to] == black) {
                continue;
            }
            path.push_back(&wire);
            if (colour[wire.to] == grey) {
                const auto begin =
                    std::find_if(path.begin(), path.end(), [&](const Wire *p) { return p->from == wire.to; });
                for (auto it = begin; it != path.end(); ++it) {
                    found += (it == begin ? "" : ", ") + nodes[(*it)->to].name() + " for " +
                             topics_[(*it)->channel].name + " of " + nodes[(*it)->from].name();
                }
            } else {
                self(self, wire.to);
            }
            path.pop_back();
        }
        colour[id] = black;
    };
    for (NodeId id = 0; id < nodes.size(); id++) {
        if (colour[id] == white && found.empty()) {
            visit(visit, id);
        }
    }
    return found.empty() ? ""
                         : "these nodes wait for each other in a cycle: " + found +
                               "; one of these messages has to be read later, at the next instant "
                               "or exchange";
}

Start Wiring::start(NodeId id, const NodeState &node)
{
    Start start;
    for (const std::size_t w : links_[id].in) {
        Wire &wire = wires_[w];
        const Topic &topic = topics_[wire.channel];
        start.wired.push_back({wire.channel, node.config.names.to_node(topic.name).value(), topic.schema});
        wire.restart();
        if (node.returning && !node.log.kept()) {
            wire.resend_last(node.reached);
        }
    }
    for (Topic &topic : topics_) {
        if (topic.writer == id && !node.played()) {
            topic.count = topic.before = 0;
        }
    }
    return start;
}

void Wiring::begin_at(NodeId id)
{
    for (const std::size_t w : links_[id].in) {
        wires_[w].restart();
    }
    for (Topic &topic : topics_) {
        topic.before = topic.writer == id ? topic.count : topic.before;
    }
}

bool Wiring::same_publications(NodeId id, const std::vector<Publication> &publications) const
{
    std::size_t known = 0, before = 0;
    for (const Publication &publication : publications) {
        known += publication.channel < topics_.size() && topics_[publication.channel].writer == id &&
                 (!publication.schema.given() || publication.schema == topics_[publication.channel].schema);
    }
    for (const Topic &topic : topics_) {
        before += topic.writer == id;
    }
    return known == publications.size() && known == before;
}

// ---- the run

std::string Wiring::fault_of(NodeId id, const NodeState &node, const Tock &tock) const
{
    if (tock.reached <= node.reached || tock.reached > node.until) {
        return "it reports that it reached " + when(tock.reached) + "; its tick goes from " + when(node.reached) +
               " to " + when(node.until);
    }
    ends_.resize(topics_.size());
    for (const Record &record : tock.records) {
        if (record.channel < topics_.size()) {
            ends_[record.channel] = {topics_[record.channel].count, topics_[record.channel].last};
        }
    }
    for (const Record &record : tock.records) {
        if (record.channel >= topics_.size() || topics_[record.channel].writer != id) {
            return "it wrote on channel " + std::to_string(record.channel) + ", which it does not publish";
        }
        const Topic &topic = topics_[record.channel];
        auto &[count, last] = ends_[record.channel];
        const auto what = [&] { return "message " + std::to_string(record.count) + " of " + topic.name; };
        if (record.count != count + 1) {
            return record.count <= count ? "duplicate: " + what() + " came before"
                                         : "gap: " + what() + " follows message " + std::to_string(count);
        }
        if (record.t <= node.reached) {
            return "late: " + what() + " was written at " + when(record.t) + ", which other nodes have passed";
        }
        if (record.t > tock.reached) {
            return "early: " + what() + " was written at " + when(record.t) + ", which the node has not reached";
        }
        if (record.t <= last) {
            return "out of order: " + what() + " was written at " + when(record.t) + ", the one before at " +
                   when(last);
        }
        if (!node.schedule.any_time && node.schedule.next_after(record.t - 1) != record.t) {
            return "out of step: " + what() + " was written at " + when(record.t) + ", when the node does not step";
        }
        if (!is_payload(record.payload, topic.schema.size)) {
            return "incomplete: " + what() + " has " + size_fault(record.payload, topic.schema);
        }
        count = record.count;
        last = record.t;
    }
    return "";
}

void Wiring::write(NodeId id, const Nodes &nodes, const std::vector<Record> &records)
{
    for (const std::size_t w : links_[id].in) {
        wires_[w].pass(nodes[id].reached);
    }
    for (const Record &record : records) {
        Topic &topic = topics_[record.channel];
        topic.count = record.count;
        topic.last = record.t;
        for (const std::size_t w : topic.wires) {
            push(wires_[w], record.t, record.payload, nodes);
        }
        if (topic.wires.empty()) {
            topic.initial = record.payload; // for a reader that joins
        }
    }
}

void Wiring::push(Wire &wire, Ns written, const Payload &payload, const Nodes &nodes) const
{
    const NodeState &reader = nodes[wire.to];
    if (reader.over() && !(matching_ && reader.matching)) {
        wire.set_last(payload); // for a reader that joins
    } else {
        wire.push(written, payload, reader.schedule);
    }
}

void Wiring::write_ahead(std::uint32_t channel, Ns t, const Payload &payload, const Nodes &nodes)
{
    Topic &topic = topics_[channel];
    Ns furthest = -1; // no boundary lies before
    for (const NodeState &node : nodes) {
        furthest = node.been ? std::max(furthest, node.reached) : furthest;
    }
    if (topic.ahead.empty()) {
        topic.held = value(topic, furthest);
    }
    for (; !topic.ahead.empty() && topic.ahead.front().t <= furthest; topic.ahead.pop_front()) {
        topic.held = std::move(topic.ahead.front().payload);
    }
    topic.ahead.push_back({t, payload});
    for (const std::size_t w : topic.wires) {
        push(wires_[w], t, payload, nodes);
    }
}

Ns Wiring::time_to_write(const Topic &topic, const Nodes &nodes, Ns earliest, std::size_t most, std::string &why) const
{
    Ns t = std::max(topic.last + 1, earliest);
    for (const std::size_t w : topic.wires) {
        const Wire &wire = wires_[w];
        const NodeState &reader = nodes[wire.to];
        if (wire.waiting() >= most) {
            why = reader.name() + " has not yet seen " + std::to_string(wire.waiting()) + " messages of " + topic.name;
            return t;
        }
        t = std::max(t, reader.over()
                            ? reader.reached + 1
                            : wire.earliest_write(std::max(reader.granted(), reader.reached), reader.schedule));
    }
    return t;
}

/// The last message written until t, which all nodes have reached.
const Payload &Wiring::value(const Topic &topic, Ns t) const
{
    if (!topic.ahead.empty()) {
        const Payload *last = &topic.held;
        for (const TimedPayload &write : topic.ahead) {
            last = write.t <= t ? &write.payload : last;
        }
        return *last;
    }
    return topic.wires.empty() ? topic.initial : wires_[topic.wires.front()].latest();
}

std::vector<Record> Wiring::deliver(NodeId id, Ns until)
{
    std::vector<Record> records;
    for (const std::size_t w : links_[id].in) {
        wires_[w].deliver(until, records);
    }
    return records;
}

void Wiring::resend(NodeId id, std::vector<Record> &records)
{
    for (Record &record : records) {
        for (const std::size_t w : links_[id].in) {
            if (wires_[w].channel == record.channel) {
                record.count = wires_[w].next_count();
            }
        }
    }
}

std::string Wiring::repeat_count(NodeId id, const Record &record)
{
    if (record.channel >= topics_.size() || topics_[record.channel].writer != id) {
        return "it wrote on channel " + std::to_string(record.channel) + ", which it does not publish";
    }
    Topic &topic = topics_[record.channel];
    if (record.count != ++topic.count) {
        return "gap or duplicate: message " + std::to_string(record.count) + " of " + topic.name + " follows message " +
               std::to_string(topic.count - 1);
    }
    return "";
}

void Wiring::empty_inputs(NodeId id)
{
    for (const std::size_t w : links_[id].in) {
        wires_[w].empty();
    }
}

std::optional<std::uint32_t> Wiring::find(const std::string &topic) const
{
    const auto channel = channels_.find(topic);
    return channel == channels_.end() ? std::nullopt : std::optional(channel->second);
}

std::vector<Channel> Wiring::channels() const
{
    std::vector<Channel> channels;
    for (std::uint32_t channel = 0; channel < topics_.size(); channel++) {
        channels.push_back({channel, topics_[channel].name, topics_[channel].schema});
    }
    return channels;
}

Exchange Wiring::exchange(const Nodes &nodes) const
{
    Exchange exchange;
    exchange.after = boundary_;
    for (const NodeState &node : nodes) {
        exchange.members.push_back({node.name(), !node.over(), node.schedule.rates, node.schedule.any_time,
                                    node.subscriptions, node.config.names});
    }
    for (const Topic &topic : topics_) {
        exchange.topics.push_back(
            {topic.name, topic.schema, topic.writer ? nodes[*topic.writer].name() : "", value(topic, boundary_)});
    }
    return exchange;
}

} // namespace fledge::cosim
