// SPDX-License-Identifier: Apache-2.0
// Who reads whose messages: before the run, and again at each boundary, an instant through which all have
// stepped and beyond which none has. There nodes join:
//
// - A joiner begins after the boundary, and what it writes first is seen after it, too. To its wires the
//   boundary is an exchange: it sees the last of all that was written until then.
// - All other wires stay as they are, with the messages on their way.
//
// So what anybody sees follows from the boundary's time, however it came about.
#include "cosim/controller/controller_parts.h"

#include <algorithm>

namespace fledge::cosim {

namespace {

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

} // namespace

// ---- boundaries

/// Those who come of themselves join where nobody has gone further yet.
void Controller::look_for_joiners()
{
    if (phase_ != Phase::running) {
        return;
    }
    const auto any = [&](const auto &is) { return std::any_of(nodes_.begin(), nodes_.end(), is); };
    const bool some = any([](const Node &n) { return n.joining && !n.scheduled() && n.connected(); });
    const bool owed = spoilt_ && any([](const Node &n) { return !n.over(); });
    if (some && !called_) {
        called_ = -1;
        for (const Node &node : nodes_) {
            if (node.been) { // also what those have written that are gone
                called_ = std::max(*called_, node.stage == Stage::ticking ? node.until : node.reached);
            }
        }
        for (const Topic &topic : topics_) {
            called_ = topic.ahead.empty() ? *called_ : std::max(*called_, topic.ahead.back().t);
        }
        called_ = std::min(*called_, config_.end);
    } else if (!some && !owed) {
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
    if (node.member) {
        return false;
    }
    return node.scheduled() ? node.config.joins_after == *boundary_ : node.joining && called_ && *called_ <= *boundary_;
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
    meeting_ = begun_ ? *boundary_ : -1;
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

void Controller::reply(NodeId id, Matched &m)
{
    Node &node = nodes_[id];
    if (node.returning) {
        std::size_t known = 0;
        for (const Offer &offer : m.offers) {
            known += offer.channel < topics_.size() && topics_[offer.channel].writer == id &&
                     (!offer.schema.given() || offer.schema == topics_[offer.channel].schema);
        }
        const auto before =
            std::count_if(topics_.begin(), topics_.end(), [&](const Topic &topic) { return topic.writer == id; });
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
        called_ = meeting_;
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
            report(format_list(joined) + (joined.size() == 1 ? " joins after " : " join after ") + when(meeting_));
        }
        begun_ = true;
        met_ = meeting_;
        if (config_.tell) {
            act(action::Began{exchange()});
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
        const bool may_stay_away =
            std::none_of(joiners.begin(), joiners.end(), [&](NodeId id) { return nodes_[id].scheduled(); });
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
    for (const Injection &injection : std::exchange(injected_, {})) {
        inject(injection.program, injection.topic, injection.payload);
    }
    look_for_joiners();
    look_at_boundary();
    grant_all();
    finish_if_complete();
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
    for (Topic &topic : topics_) {
        topic.count = topic.writer == id ? 0 : topic.count;
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

} // namespace fledge::cosim
