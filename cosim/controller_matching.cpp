// SPDX-License-Identifier: Apache-2.0
// Who reads whose messages: before the run, and again at each boundary, an instant through which all have
// stepped and beyond which none has. There nodes join:
//
// - A joiner begins after the boundary, and what it writes first is seen after it, too. To its wires the
//   boundary is an exchange: it sees the last of all that was written until then.
// - All other wires stay as they are, with the messages on their way.
//
// So what anybody sees follows from the boundary's time, however it came about.
#include "cosim/controller_parts.h"

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
        return made.size != schema.size   ? "its text makes " + std::to_string(made.size) + " bytes, not " +
                                              std::to_string(schema.size)
               : made.hash != schema.hash ? "its hash is not that of its text"
                                          : "";
    } catch (const SchemaError &error) {
        return error.what();
    }
}

std::string text_of(const std::vector<Rate> &rates)
{
    std::vector<std::string> each;
    for (const Rate &rate : rates) {
        each.push_back(format_time(rate.period) + (rate.offset ? " from " + format_time(rate.offset) + " on" : ""));
    }
    return format_list(each);
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

// ---- boundaries

/// Those who come of themselves join where nobody has gone further yet.
void Controller::look_for_joiners()
{
    if (phase_ != Phase::running) {
        return;
    }
    const bool some = std::any_of(nodes_.begin(), nodes_.end(),
                                  [](const Node &n) { return n.joining && !n.scheduled() && n.connected(); });
    if (some && !called_) {
        called_ = -1;
        for (const Node &node : nodes_) {
            if (!node.over()) {
                called_ = std::max(*called_, node.stage == Stage::ticking ? node.until : node.reached);
            }
        }
    } else if (!some && !spoilt_) {
        called_.reset();
    }
    set_last();
}

void Controller::set_last()
{
    boundary_ = called_;
    for (const Node &node : nodes_) {
        if (node.scheduled() && (!boundary_ || node.config.joins_after < *boundary_)) {
            boundary_ = node.config.joins_after;
        }
    }
    last_ = std::min({config_.end, horizon_, boundary_.value_or(for_ever)});
}

/// Whether it joins at the boundary that comes next.
bool Controller::due(const Node &node) const
{
    return !node.member && (node.scheduled() ? node.config.joins_after == *boundary_ : node.joining);
}

bool Controller::all_met() const
{
    return boundary_ && std::all_of(nodes_.begin(), nodes_.end(), [&](const Node &n) {
               return n.over() || (n.stage == Stage::idle && complete(n, *boundary_));
           });
}

void Controller::look_at_boundary()
{
    if (phase_ != Phase::running || !all_met()) {
        return;
    }
    bool ready = true;
    for (NodeId id = 0; id < nodes_.size(); id++) {
        Node &node = nodes_[id];
        if (!due(node)) {
            continue;
        }
        if (node.stage == Stage::entered && !node.awaited) {
            node.reached = *boundary_;
            initialize(id);
        }
        ready = ready && node.stage == Stage::desired;
    }
    if (ready) {
        begin_matching();
    }
}

// ---- what nodes say of themselves

void Controller::reply(NodeId id, Initialized &m)
{
    Node &node = nodes_[id];
    std::string fault = cosim::fault_of(m.rates);
    if (fault.empty() && m.rates.empty() && !m.any_time) {
        fault = "it never steps";
    }
    if (fault.empty() && !node.config.steps.empty() && m.rates != node.config.steps) {
        fault = "it steps every " + text_of(m.rates) + ", but is to step every " + text_of(node.config.steps) +
                "; one of them has to be changed";
    }
    if (node.returning && (m.rates != node.rates || m.any_time != node.any_time)) {
        fault = "it came back with other steps";
    }
    if (!fault.empty()) {
        return lost(id, fault);
    }
    if (!node.returning) {
        node.rates = std::move(m.rates);
        node.any_time = m.any_time;
        node.saves = m.saves;
        node.kept = node.config.on_loss == Policy::restart || (node.config.on_loss == Policy::pause && m.saves);
        node.saved = node.reached;
    }
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
    if (!node.member) {
        return look_at_boundary();
    }
    if (all_at(Stage::desired)) {
        begin_matching();
    }
}

// ---- matching

void Controller::begin_matching()
{
    phase_ = Phase::matching;
    spoilt_ = false;
    faults_.clear();
    before_ = {topics_, channels_, wires_};
    for (Node &node : nodes_) {
        node.matching = !node.over() || (begun_ && due(node));
        node.offers.clear();
    }
    number_topics();
    for (NodeId id = 0; id < nodes_.size(); id++) {
        if (nodes_[id].matching) {
            nodes_[id].stage = Stage::desired;
            ask_for_match(id);
        }
    }
}

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
        const auto &wanted_by = topics_[channel].wanted_by;
        const auto &watched = config_.watched;
        if (std::find(watched.begin(), watched.end(), topics_[channel].name) != watched.end() ||
            std::any_of(wanted_by.begin(), wanted_by.end(), [&](NodeId other) { return other != id; })) {
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
    node.offers = std::move(m.offers);
    node.stage = Stage::matched;
    look_at_matching();
}

/// The next step of the matching, when all have answered.
void Controller::look_at_matching()
{
    const auto all = [&](const auto &is) {
        return std::all_of(nodes_.begin(), nodes_.end(), [&](const Node &n) { return !n.matching || is(n); });
    };
    if (phase_ != Phase::matching || !all([](const Node &n) { return !n.awaited; })) {
        return;
    }
    if (spoilt_) {
        // Nodes have heard of channels that there are no more: all are matched again, where they stand.
        called_ = boundary_;
        for (Node &node : nodes_) {
            if (std::exchange(node.matching, false)) {
                node.stage = node.member ? Stage::idle : Stage::desired;
            }
        }
        resume();
    } else if (all([](const Node &n) { return n.stage == Stage::matched; })) {
        match();
    } else if (all([](const Node &n) { return n.stage == Stage::idle; })) {
        std::vector<std::string> joined;
        for (NodeId id = 0; id < nodes_.size(); id++) {
            Node &node = nodes_[id];
            if (std::exchange(node.matching, false) && !std::exchange(node.member, true)) {
                changes_.push_back({Change::joined, id, node.reached});
                joined.push_back(node.config.name);
            }
            node.joining = node.joining && !node.member;
            node.been = node.been || node.member;
        }
        if (!joined.empty()) {
            report(format_list(joined) + (joined.size() == 1 ? " joins after " : " join after ") +
                   when(*boundary_));
        }
        begun_ = true;
        if (config_.tell) {
            Exchange now = exchange();
            now.after = boundary_.value_or(-1);
            act(action::Began{std::move(now)});
        }
        called_.reset();
        before_ = {};
        resume();
    }
}

void Controller::match()
{
    for (Topic &topic : topics_) {
        if (topic.writer && nodes_[*topic.writer].over()) {
            topic.since = -2; // free to be written by another
        }
    }
    for (NodeId id = 0; id < nodes_.size(); id++) {
        if (nodes_[id].matching) {
            take_offers(id);
        }
    }
    take_asynchronous();
    connect();
    if (!faults_.empty()) {
        std::vector<NodeId> joiners;
        for (NodeId id = 0; id < nodes_.size(); id++) {
            if (begun_ && nodes_[id].matching && !nodes_[id].member) {
                joiners.push_back(id);
            }
        }
        const bool may_stay_away = std::none_of(joiners.begin(), joiners.end(),
                                                [&](NodeId id) { return nodes_[id].scheduled(); });
        if (joiners.empty() || !may_stay_away) {
            return finish(faults_);
        }
        spoil_matching();
        for (const NodeId id : joiners) {
            report(nodes_[id].config.name + " cannot join: " + faults_);
            dismiss(id, "it cannot join: " + faults_);
        }
        return look_at_matching();
    }
    for (NodeId id = 0; id < nodes_.size(); id++) {
        if (nodes_[id].matching) {
            start(id);
        }
    }
}

/// What it has brought so far does not hold.
void Controller::spoil_matching()
{
    if (!std::exchange(spoilt_, true)) {
        topics_ = before_.topics;
        channels_ = before_.channels;
        wires_ = before_.wires;
        list_wires();
    }
}

void Controller::resume()
{
    phase_ = Phase::running;
    for (NodeId id = 0; id < nodes_.size(); id++) {
        if (nodes_[id].returning && nodes_[id].stage == Stage::entered && !nodes_[id].awaited) {
            initialize(id);
        }
    }
    look_for_joiners();
    look_at_boundary();
    grant_all();
    finish_if_complete();
}

void Controller::take_offers(NodeId id)
{
    Node &node = nodes_[id];
    const std::string &name = node.config.name;
    std::vector<bool> offered(topics_.size());
    for (Offer &offer : node.offers) {
        if (offer.channel >= topics_.size()) {
            add_fault(faults_,
                      name + " offers a channel " + std::to_string(offer.channel) + " that nobody asked for");
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
            add_fault(faults_, topic.name + " is written by " + nodes_[*topic.writer].config.name + " and by " +
                                   name + "; one of them has to leave it or call it otherwise");
            continue;
        }
        topic.writer = id;
        topic.since = boundary_.value_or(-1);
        topic.last = topic.since;
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

/// The last that was written.
const Bytes &Controller::value(const Topic &topic) const
{
    if (topic.wires.empty()) {
        return topic.initial;
    }
    const Wire &wire = wires_[topic.wires.front()];
    return wire.pending.empty() ? wire.last : wire.pending.back().payload;
}

void Controller::connect()
{
    const Ns boundary = boundary_.value_or(-1);
    const bool late = std::any_of(nodes_.begin(), nodes_.end(),
                                  [](const Node &n) { return !n.matching && !n.asynchronous; });
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
            const bool fresh = topic.since == boundary; // its writer, to it, is new
            auto wire = std::find_if(wires_.begin(), wires_.end(),
                                     [&](const Wire &w) { return w.to == id && w.channel == channel; });
            const Bytes seen_first = fresh ? topic.initial : value(topic);
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
            wire->pending.push_back({boundary + 1, seen_first});
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
               (wire.latency == Latency::next_instant && nodes_[wire.from].any_time &&
                nodes_[wire.to].any_time));
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

/// Counts begin anew, and what was sent but not yet seen is sent again.
void Controller::start(NodeId id)
{
    Node &node = nodes_[id];
    Start start;
    for (const std::size_t w : node.in) {
        Wire &wire = wires_[w];
        const Topic &topic = topics_[wire.channel];
        start.wired.push_back({wire.channel, topic.name, topic.schema});
        wire.delivered = 0;
        wire.count = 0;
        if (node.returning && !node.kept && !wire.last.empty() &&
            (wire.pending.empty() || wire.pending.front().t > node.reached)) {
            wire.pending.push_front({node.reached, wire.last}); // it knows nothing of what it has passed
        }
    }
    for (const std::size_t w : node.out) {
        topics_[wires_[w].channel].count = 0;
    }
    std::erase_if(node.told, [&](const Record &record) { return record.t > node.reached; });
    send<Start, Ready>(id, std::move(start));
}

void Controller::reply(NodeId id, Ready &)
{
    Node &node = nodes_[id];
    node.stage = Stage::idle;
    if (phase_ == Phase::matching) {
        return look_at_matching();
    }
    node.replayed = node.kept ? node.saved : node.reached;
    node.told_again = 0;
    node.said_again.clear();
    tell_again(id);
}

Exchange Controller::exchange() const
{
    Exchange exchange;
    for (const Node &node : nodes_) {
        exchange.members.push_back({node.config.name, !node.over(), node.rates, node.any_time, node.wants});
    }
    for (const Topic &topic : topics_) {
        exchange.topics.push_back({topic.name, topic.schema,
                                   topic.writer ? nodes_[*topic.writer].config.name : "", value(topic)});
    }
    return exchange;
}

} // namespace fledge::cosim
