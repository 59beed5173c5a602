// SPDX-License-Identifier: Apache-2.0
#include "cosim/controller.h"

#include "sim/text.h"

#include <algorithm>
#include <limits>
#include <stdexcept>

namespace fledge::cosim {

namespace {

using sim::format_list;
using sim::format_time;

constexpr Ns never = std::numeric_limits<Ns>::max();
constexpr Ns longest_time = 1'000'000'000'000'000'000; // 31 years; sums of a few do not overflow

/// The place of a kind in Message.
template <class M, std::size_t I = 0> constexpr std::size_t kind_of()
{
    if constexpr (std::is_same_v<M, std::variant_alternative_t<I, Message>>) {
        return I;
    } else {
        return kind_of<M, I + 1>();
    }
}

void add_fault(std::string &faults, const std::string &text)
{
    faults += (faults.empty() ? "" : "\n") + text;
}

/// "0.5 s", or what comes before the first instant.
std::string when(Ns t)
{
    return t < 0 ? "the start" : format_time(t);
}

/// Why a definition cannot be used; "" if it can.
std::string fault_of(const Schema &schema)
{
    if (!schema.given()) {
        return schema.size || schema.hash ? "it has a size or hash, but no text" : "";
    }
    try {
        const Schema made = make_schema(schema.name, schema.text);
        return made.size != schema.size   ? "its text makes " + std::to_string(made.size) + " bytes, not " +
                                              std::to_string(schema.size)
               : made.hash != schema.hash ? "its hash is not that of its text"
                                          : "";
    } catch (const SchemaError &error) {
        return error.what();
    }
}

std::string fault_of(const std::vector<Rate> &rates)
{
    for (const Rate &rate : rates) {
        if (rate.period <= 0 || rate.period > longest_time || rate.offset < 0 || rate.offset > longest_time) {
            return "a step of " + std::to_string(rate.period) + " ns from " + std::to_string(rate.offset) +
                   " ns on; a period is > 0, an offset >= 0";
        }
    }
    return "";
}

bool is_payload(const Bytes &payload, std::size_t size)
{
    return payload.size() == size + 4 && payload[0] == std::byte{0} && payload[1] <= std::byte{1} &&
           payload[2] == std::byte{0} && payload[3] == std::byte{0};
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

// ---- a node's times

Ns Controller::Node::next_after(Ns t) const
{
    Ns next = never;
    for (const Rate &rate : rates) {
        next = std::min(next, t < rate.offset
                                  ? rate.offset
                                  : rate.offset + ((t - rate.offset) / rate.period + 1) * rate.period);
    }
    return next;
}

bool Controller::Node::over() const
{
    return stage == Stage::finished || (stage == Stage::lost && config.on_loss != Policy::pause);
}

Ns Controller::Node::safe() const
{
    return over() ? never : any_time ? reached + 1 : next_after(reached);
}

bool Controller::Node::connected() const
{
    return stage != Stage::absent && stage != Stage::finished && stage != Stage::lost;
}

/// The last instant for which all inputs are known.
Ns Controller::limit(const Node &node) const
{
    Ns last = config_.end;
    for (const std::size_t w : node.in) {
        const Wire &wire = wires_[w];
        const Ns s = nodes_[wire.from].safe();
        if (s == never) {
            continue;
        }
        if (wire.latency == Latency::next_exchange) {
            const Ns exchanges = s > 0 ? (s - 1) / wire.exchange : -1;
            last = std::min(last, (exchanges + 1) * wire.exchange);
        } else {
            last = std::min(last, wire.latency == Latency::same_instant ? s - 1 : s);
        }
    }
    return last;
}

bool Controller::complete(const Node &node) const
{
    return node.over() ||
           (node.any_time ? node.reached >= config_.end : node.next_after(node.reached) > config_.end);
}

// ---- from outside

Controller::Controller(ControllerConfig config) : config_(std::move(config))
{
    if (config_.end < 0 || config_.end > longest_time || config_.batch < 1 || config_.ahead < 4 ||
        config_.nodes.empty()) {
        throw std::invalid_argument(
            "a co-simulation has nodes, an end from 0 to 31 years, batches of at least 1 "
            "instant, and readers that may lag by at least 4 messages");
    }
    for (const NodeConfig &node : config_.nodes) {
        for (const Node &other : nodes_) {
            if (other.config.name == node.name) {
                throw std::invalid_argument("two nodes are called " + node.name);
            }
        }
        nodes_.emplace_back().config = node;
    }
}

void Controller::hello(std::uint64_t peer, const Hello &hello)
{
    const auto refuse = [&](const std::string &reason) { actions_.push_back(action::Refuse{peer, reason}); };
    if (hello.oldest > protocol_version || hello.newest < protocol_version) {
        return refuse("this controller speaks version " + std::to_string(protocol_version) +
                      " of the format, the node versions " + std::to_string(hello.oldest) + " to " +
                      std::to_string(hello.newest));
    }
    if (hello.simulation != config_.simulation) {
        return refuse("this is the simulation " + config_.simulation + ", not " + hello.simulation);
    }
    std::vector<std::string> names;
    for (const Node &node : nodes_) {
        names.push_back(node.config.name);
    }
    const auto found = std::find(names.begin(), names.end(), hello.node);
    if (found == names.end()) {
        return refuse(config_.simulation + " has no node " + hello.node + "; it has " + format_list(names));
    }
    const auto id = static_cast<NodeId>(found - names.begin());
    Node &node = nodes_[id];
    if (phase_ == Phase::finishing || phase_ == Phase::done) {
        return refuse("the run is over" + (reason_.empty() ? "" : ": " + reason_));
    }
    if (node.connected()) {
        return refuse("there is a node " + hello.node + " already");
    }
    if (node.stage == Stage::lost && node.config.on_loss != Policy::pause) {
        return refuse(hello.node + " was lost at " + when(node.reached) + ", and the run goes on without it");
    }
    node.returning = node.stage == Stage::lost;
    node.stage = Stage::entered;
    node.number = 0;
    actions_.push_back(action::Accept{peer, id});
    send<Initialize, Initialized>(
        id, {config_.seed, config_.end, node.reached, config_.frontend, config_.backend});
}

void Controller::received(NodeId id, Frame frame)
{
    Node &node = nodes_[id];
    if (!node.connected() || phase_ == Phase::done) {
        return;
    }
    if (const auto *failed = std::get_if<Failed>(&frame.message)) {
        return lost(id, "it failed: " + failed->reason);
    }
    if (phase_ == Phase::finishing && !std::holds_alternative<Finished>(frame.message)) {
        return; // the reply to what was asked before the end
    }
    const std::string found = std::string(kind_name(frame.message)) + " " + std::to_string(frame.number);
    if (!node.awaited) {
        return lost(id, "it sent " + found + ", which nobody asked for");
    }
    if (frame.number != node.number || frame.message.index() != node.expected) {
        return lost(id, "it sent " + found + "; expected " + kind_name(node.expected) + " " +
                            std::to_string(node.number));
    }
    node.awaited = false;
    std::visit([&](auto &m) { reply(id, m); }, frame.message);
}

void Controller::lost(NodeId id, const std::string &why)
{
    Node &node = nodes_[id];
    if (!node.connected() || phase_ == Phase::done) {
        return;
    }
    const Ns s = node.safe();
    node.stage = Stage::lost;
    node.awaited = false;
    actions_.push_back(action::ShutOut{id, why});
    if (phase_ == Phase::finishing) {
        return look_whether_done();
    }
    std::string text = node.config.name + ": " + why;
    if (phase_ == Phase::gathering) {
        return finish(text);
    }
    text += " (it had reached " + when(node.reached) + ")";
    switch (node.config.on_loss) {
    case Policy::abort: return finish(text);
    case Policy::pause: actions_.push_back(action::Report{text + "; the run waits for it"}); break;
    case Policy::hold:
        actions_.push_back(action::Report{text + "; its messages keep their last values"});
        break;
    case Policy::drop:
        actions_.push_back(action::Report{text + "; its messages are never written from now on"});
        for (const std::size_t w : node.out) {
            Bytes nothing(topics_[wires_[w].channel].schema.size + 4);
            nothing[1] = static_cast<std::byte>(native_order());
            push(wires_[w], s, nothing);
        }
        break;
    }
    if (std::all_of(nodes_.begin(), nodes_.end(), [](const Node &n) { return n.over(); })) {
        return finish("all nodes were lost; the last was " + text);
    }
    grant_around(id);
    finish_if_complete();
}

void Controller::stop(const std::string &why)
{
    finish(why);
}

std::vector<std::string> Controller::absent() const
{
    std::vector<std::string> names;
    for (const Node &node : nodes_) {
        if (node.stage == Stage::absent) {
            names.push_back(node.config.name);
        }
    }
    return names;
}

const char *Controller::state(NodeId id) const
{
    switch (nodes_[id].stage) {
    case Stage::absent: return "absent";
    case Stage::finished: return "finished";
    case Stage::lost: return "lost";
    case Stage::idle:
    case Stage::ticking: return "running";
    default: return "joining";
    }
}

// ---- requests and the end

template <class Request, class Reply> void Controller::send(NodeId id, Request request)
{
    Node &node = nodes_[id];
    node.awaited = true;
    node.expected = kind_of<Reply>();
    actions_.push_back(action::Send{id, {++node.number, std::move(request)}});
}

void Controller::finish(const std::string &why)
{
    if (phase_ == Phase::finishing || phase_ == Phase::done) {
        return;
    }
    phase_ = Phase::finishing;
    reason_ = why;
    for (NodeId id = 0; id < nodes_.size(); id++) {
        if (nodes_[id].connected()) {
            send<Finish, Finished>(id, {why});
        }
    }
    look_whether_done();
}

void Controller::look_whether_done()
{
    if (std::none_of(nodes_.begin(), nodes_.end(), [](const Node &n) { return n.connected(); })) {
        phase_ = Phase::done;
        actions_.push_back(action::Done{reason_});
    }
}

void Controller::finish_if_complete()
{
    if (std::all_of(nodes_.begin(), nodes_.end(), [&](const Node &n) { return complete(n); })) {
        finish("");
    }
}

bool Controller::all_at(Stage stage) const
{
    return std::all_of(nodes_.begin(), nodes_.end(), [&](const Node &n) { return n.stage == stage; });
}

bool Controller::paused() const
{
    return std::any_of(nodes_.begin(), nodes_.end(), [](const Node &n) {
        return n.returning || (n.stage == Stage::lost && n.config.on_loss == Policy::pause);
    });
}

/// All that is no reply, or not one to what was asked.
template <class M> void Controller::reply(NodeId id, M &)
{
    lost(id, "it sent what only a controller sends");
}

void Controller::reply(NodeId id, Finished &)
{
    nodes_[id].stage = Stage::finished;
    look_whether_done();
}

// ---- matching

void Controller::reply(NodeId id, Initialized &m)
{
    Node &node = nodes_[id];
    std::string fault = cosim::fault_of(m.rates);
    if (fault.empty() && m.rates.empty() && !m.any_time) {
        fault = "it never steps";
    }
    if (node.returning && (m.rates != node.rates || m.any_time != node.any_time)) {
        fault = "it came back with other steps";
    }
    if (!fault.empty()) {
        return lost(id, fault);
    }
    node.rates = std::move(m.rates);
    node.any_time = m.any_time;
    node.stage = Stage::initialized;
    send<ProvideDesired, Desired>(id, {});
}

void Controller::reply(NodeId id, Desired &m)
{
    Node &node = nodes_[id];
    node.stage = Stage::desired;
    if (node.returning) {
        return m.wants == node.wants ? ask_for_match(id) : lost(id, "it came back with other wishes");
    }
    node.wants = std::move(m.wants);
    if (all_at(Stage::desired)) {
        number_topics();
        for (NodeId other = 0; other < nodes_.size(); other++) {
            ask_for_match(other);
        }
    }
}

/// Channels are numbered in the order of their topics' names, whoever came first.
void Controller::number_topics()
{
    for (const Node &node : nodes_) {
        for (const Want &want : node.wants) {
            topics_.push_back({want.topic, {}, {}, {}, 0, -1, {}});
        }
    }
    const auto name = [](const Topic &topic) -> const std::string & { return topic.name; };
    std::ranges::sort(topics_, {}, name);
    topics_.erase(std::unique(topics_.begin(), topics_.end(),
                              [](const Topic &a, const Topic &b) { return a.name == b.name; }),
                  topics_.end());
    for (const Node &node : nodes_) {
        for (const Want &want : node.wants) {
            Topic &topic = *std::ranges::lower_bound(topics_, want.topic, {}, name);
            if (!topic.schema.given()) {
                topic.schema = want.schema; // for a writer that has no definition of its own
            }
            if (const std::string fault = cosim::fault_of(want.schema); !fault.empty()) {
                add_fault(faults_,
                          node.config.name + " wants " + want.topic + " with a bad definition: " + fault);
            }
        }
    }
}

void Controller::ask_for_match(NodeId id)
{
    Match match;
    for (std::uint32_t channel = 0; channel < topics_.size(); channel++) {
        const bool wanted = std::any_of(nodes_.begin(), nodes_.end(), [&](const Node &other) {
            return &other != &nodes_[id] &&
                   std::any_of(other.wants.begin(), other.wants.end(),
                               [&](const Want &w) { return w.topic == topics_[channel].name; });
        });
        if (wanted) {
            match.asked.push_back({channel, topics_[channel].name, topics_[channel].schema});
        }
    }
    send<Match, Matched>(id, std::move(match));
}

void Controller::reply(NodeId id, Matched &m)
{
    Node &node = nodes_[id];
    if (node.returning) {
        std::size_t known = 0;
        for (const Offer &offer : m.offers) {
            known += offer.channel < topics_.size() && topics_[offer.channel].writer == id &&
                     (!offer.schema.given() || offer.schema == topics_[offer.channel].schema);
        }
        const auto before = std::count_if(topics_.begin(), topics_.end(),
                                          [&](const Topic &topic) { return topic.writer == id; });
        if (known != m.offers.size() || known != static_cast<std::size_t>(before)) {
            return lost(id, "it came back with other messages");
        }
        node.stage = Stage::matched;
        return start(id);
    }
    take_offers(id, m, faults_);
    node.stage = Stage::matched;
    if (all_at(Stage::matched)) {
        connect();
        if (!faults_.empty()) {
            return finish(faults_);
        }
        for (NodeId other = 0; other < nodes_.size(); other++) {
            start(other);
        }
    }
}

void Controller::take_offers(NodeId id, const Matched &m, std::string &faults)
{
    const std::string &name = nodes_[id].config.name;
    for (const Offer &offer : m.offers) {
        if (offer.channel >= topics_.size()) {
            add_fault(faults,
                      name + " offers a channel " + std::to_string(offer.channel) + " that nobody asked for");
            continue;
        }
        Topic &topic = topics_[offer.channel];
        if (topic.writer) {
            add_fault(faults, topic.name + " is written by " + nodes_[*topic.writer].config.name +
                                  " and by " + name + "; one of them has to leave it or call it otherwise");
            continue;
        }
        topic.writer = id;
        if (const std::string fault = cosim::fault_of(offer.schema); !fault.empty()) {
            add_fault(faults, name + " offers " + topic.name + " with a bad definition: " + fault);
            continue;
        }
        if (offer.schema.given()) {
            topic.schema = offer.schema;
        }
        if (!topic.schema.given()) {
            add_fault(faults, name + " offers " + topic.name + ", which neither it nor a reader defines");
        } else if (!is_payload(offer.initial, topic.schema.size)) {
            add_fault(faults, name + " offers " + topic.name + " with an initial value of " +
                                  std::to_string(offer.initial.size()) + " bytes; expected a CDR header and " +
                                  std::to_string(topic.schema.size));
        }
        topic.initial = offer.initial;
    }
}

void Controller::connect()
{
    for (NodeId id = 0; id < nodes_.size(); id++) {
        Node &node = nodes_[id];
        std::vector<std::string> seen;
        for (const Want &want : node.wants) {
            const std::string wish = node.config.name + " wants " + want.topic;
            if (std::find(seen.begin(), seen.end(), want.topic) != seen.end()) {
                add_fault(faults_, wish + " twice");
                continue;
            }
            seen.push_back(want.topic);
            const auto channel = static_cast<std::uint32_t>(
                std::ranges::lower_bound(topics_, want.topic, {}, [](const Topic &t) { return t.name; }) -
                topics_.begin());
            Topic &topic = topics_[channel];
            if (!topic.writer || *topic.writer == id) {
                if (!want.optional) {
                    add_fault(faults_, wish + ", which no other node writes");
                }
                continue;
            }
            Node &writer = nodes_[*topic.writer];
            if (!cosim::fault_of(topic.schema).empty() || !cosim::fault_of(want.schema).empty()) {
                continue; // said already
            }
            if (const std::string why = schema_difference(topic.schema, want.schema); !why.empty()) {
                add_fault(faults_, wish + " of " + writer.config.name + ", but " + why);
                continue;
            }
            Wire wire{channel, *topic.writer, id, want.latency, longest_period(node.rates, writer.rates),
                      {},      0,             0,  {}};
            if (wire.latency == Latency::next_exchange && !wire.exchange) {
                add_fault(faults_, wish + " at exchanges, but neither it nor " + writer.config.name +
                                       " says how often it steps");
                continue;
            }
            wire.pending.push_back({-1, topic.initial});
            node.in.push_back(wires_.size());
            writer.out.push_back(wires_.size());
            topic.wires.push_back(wires_.size());
            wires_.push_back(std::move(wire));
        }
    }
    if (const std::string cycle = find_cycle(); !cycle.empty()) {
        add_fault(faults_, cycle);
    }
}

/// Nodes that wait for one another at the same instant could not step at all. Two that may write at
/// any time and wait for one another's next instant would go on by a nanosecond at a time.
std::string Controller::find_cycle() const
{
    const auto waits = [&](const Wire &wire) {
        return wire.latency == Latency::same_instant ||
               (wire.latency == Latency::next_instant && nodes_[wire.from].any_time &&
                nodes_[wire.to].any_time);
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
                const auto begin = std::find_if(path.begin(), path.end(),
                                                [&](const Wire *p) { return p->from == wire.to; });
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
                               "; one of these messages has to be read later, at the next instant or exchange";
}

void Controller::start(NodeId id)
{
    Node &node = nodes_[id];
    Start start;
    for (const std::size_t w : node.in) {
        const Topic &topic = topics_[wires_[w].channel];
        start.wired.push_back({wires_[w].channel, topic.name, topic.schema});
    }
    if (node.returning) {
        // It knows nothing: what it has passed comes first, then all that it has not.
        for (const std::size_t w : node.in) {
            Wire &wire = wires_[w];
            wire.delivered = 0;
            wire.count = 0;
            if (!wire.last.empty() && (wire.pending.empty() || wire.pending.front().t > node.reached)) {
                wire.pending.push_front({node.reached, wire.last});
            }
        }
        for (const std::size_t w : node.out) {
            topics_[wires_[w].channel].count = 0;
        }
    }
    send<Start, Ready>(id, std::move(start));
}

Exchange Controller::exchange() const
{
    Exchange exchange;
    for (const Node &node : nodes_) {
        exchange.members.push_back({node.config.name, node.rates, node.any_time, node.wants});
    }
    for (const Topic &topic : topics_) {
        exchange.topics.push_back({topic.name, topic.schema,
                                   topic.writer ? nodes_[*topic.writer].config.name : "", topic.initial});
    }
    return exchange;
}

void Controller::reply(NodeId id, Ready &)
{
    nodes_[id].stage = Stage::idle;
    if (nodes_[id].returning) {
        nodes_[id].returning = false;
        actions_.push_back(action::Report{nodes_[id].config.name + " is back at " + when(nodes_[id].reached)});
    } else if (!all_at(Stage::idle)) {
        return;
    }
    if (phase_ == Phase::gathering && config_.tell) {
        actions_.push_back(action::Began{exchange()});
    }
    phase_ = Phase::running;
    for (NodeId other = 0; other < nodes_.size(); other++) {
        grant(other);
    }
    finish_if_complete();
}

// ---- ticks

void Controller::reply(NodeId id, Tock &m)
{
    Node &node = nodes_[id];
    if (const std::string fault = fault_of(id, m); !fault.empty()) {
        return lost(id, fault);
    }
    node.stage = Stage::idle;
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
    }
    if (config_.tell && !m.records.empty()) {
        actions_.push_back(action::Wrote{id, std::move(m.records)});
    }
    grant_around(id);
    finish_if_complete();
}

std::string Controller::fault_of(NodeId id, const Tock &m) const
{
    const Node &node = nodes_[id];
    if (m.reached <= node.reached || m.reached > node.until) {
        return "it says that it reached " + when(m.reached) + "; it may go from " +
               when(node.reached) + " to " + when(node.until);
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
            return "out of order: " + what + " is of " + when(record.t) + ", the one before of " +
                   when(last);
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
    if (reader.over()) {
        return;
    }
    const Ns seen = wire.latency == Latency::same_instant   ? written
                    : wire.latency == Latency::next_instant ? written + 1
                                                            : (written + wire.exchange - 1) / wire.exchange *
                                                                      wire.exchange + 1;
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
    if (phase_ != Phase::running || node.stage != Stage::idle || paused() || complete(node)) {
        return;
    }
    for (const std::size_t w : node.out) {
        if (wires_[w].pending.size() >= config_.ahead) {
            return; // it is far ahead of this reader
        }
    }
    Ns until = limit(node);
    if (!node.rates.empty()) {
        Ns t = node.next_after(node.reached);
        if (!node.any_time && t > until) {
            return;
        }
        std::uint32_t n = 1;
        for (Ns next = node.next_after(t); next <= until && n < config_.batch; next = node.next_after(t), n++) {
            t = next;
        }
        if (!node.any_time || n == config_.batch) {
            until = std::min(until, t);
        }
    }
    if (until <= node.reached) {
        return;
    }
    Tick tick{until, {}};
    for (const std::size_t w : node.in) {
        Wire &wire = wires_[w];
        for (; wire.delivered < wire.pending.size() && wire.pending[wire.delivered].t <= until;
             wire.delivered++) {
            const Pending &pending = wire.pending[wire.delivered];
            tick.records.push_back({wire.channel, ++wire.count, pending.t, pending.payload});
        }
    }
    node.until = until;
    node.stage = Stage::ticking;
    send<Tick, Tock>(id, std::move(tick));
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
