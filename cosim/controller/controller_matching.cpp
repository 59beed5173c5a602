// SPDX-License-Identifier: Apache-2.0
// How nodes join and are matched: before the run, and at each boundary where nodes join.
#include "cosim/controller/controller.h"

#include <algorithm>

namespace fledge::cosim {

std::string Controller::refusal(const Hello &hello) const
{
    if (hello.oldest > protocol_version || hello.newest < protocol_version) {
        return "this controller speaks version " + std::to_string(protocol_version) +
               " of the format, the node versions " + std::to_string(hello.oldest) + " to " +
               std::to_string(hello.newest);
    }
    return hello.simulation == config_.simulation
               ? ""
               : "this is the simulation " + config_.simulation + ", not " + hello.simulation;
}

void Controller::hello(std::uint64_t peer, const Hello &hello)
{
    const auto refuse = [&](const std::string &reason) { act(action::Refuse{peer, reason}); };
    if (const std::string reason = refusal(hello); !reason.empty()) {
        return refuse(reason);
    }
    std::vector<std::string> names;
    for (const NodeConfig &node : config_.nodes) {
        names.push_back(node.name);
    }
    const auto id = static_cast<NodeId>(std::find(names.begin(), names.end(), hello.node) - names.begin());
    if (id == names.size()) {
        return refuse(config_.simulation + " has no node " + hello.node + "; it has " + format_list(names));
    }
    NodeState &node = nodes_[id];
    if (finishing() || done()) {
        return refuse("the run is over" + (reason_.empty() ? "" : ": " + reason_));
    }
    if (node.connected()) {
        return refuse(hello.node + " is already connected");
    }
    if (node.been && !node.member && !node.config.rejoins) {
        return refuse(hello.node + (node.stage == Stage::lost ? " was lost at " : " left at ") + when(node.reached) +
                      ", and the run goes on without it");
    }
    node.returning = node.member && begun_;
    node.joining = !node.member;
    node.stage = Stage::entered;
    node.number = 0;
    act(action::Accept{peer, id});
    if (node.scheduled()) {
        node.reached = node.config.joins_after; // it prepares while the others run
        initialize(id);
    } else if (node.joining) {
        go_on_all();
    } else if (phase_ != Phase::matching) {
        initialize(id);
    }
}

void Controller::initialize(NodeId id)
{
    const NodeState &node = nodes_[id];
    const RestartLog *log = node.returning && node.log.kept() ? &node.log : node.played() ? &node.past : nullptr;
    ask<Initialized>(id, Initialize{config_.seed, config_.end, log ? log->saved() : node.reached, config_.frontend,
                                    config_.backend, log ? log->snapshot() : Bytes{}});
}

void Controller::reply(NodeId id, Initialized &m)
{
    NodeState &node = nodes_[id];
    Schedule schedule{std::move(m.rates), m.any_time};
    std::string fault = schedule.fault();
    if (fault.empty() && !node.config.steps.empty() && schedule.rates != node.config.steps) {
        fault = "it steps every " + format_rates(schedule.rates) + ", but is to step every " +
                format_rates(node.config.steps) + "; one of them has to be changed";
    }
    if (node.returning && schedule != node.schedule) {
        fault = "it came back with other steps";
    }
    if (!fault.empty()) {
        return lost(id, fault);
    }
    if (!node.returning) {
        node.schedule = std::move(schedule);
        node.saves = m.saves;
        node.log.drop();
        if (node.config.on_loss == Policy::restart || (node.config.on_loss == Policy::pause && m.saves)) {
            node.log.begin(node.reached);
            if (node.played()) {
                node.log.take_snapshot(node.from, node.past.snapshot());
            }
        }
        const Ns every = config_.keep_every;
        node.keep = every && m.saves ? (std::max({node.reached, node.from, Ns{0}}) / every + 1) * every : for_ever;
    }
    node.stage = Stage::initialized;
    ask<Desired>(id, ProvideDesired{});
}

void Controller::reply(NodeId id, Desired &m)
{
    NodeState &node = nodes_[id];
    node.stage = Stage::desired;
    const TopicMap &names = node.config.names;
    for (Subscription &subscription : m.subscriptions) {
        const std::string ours = std::exchange(subscription.topic, names.to_run(subscription.topic));
        if (names.to_node(subscription.topic) != ours) {
            return lost(id, "its topics " + ours + " and " + *names.to_node(subscription.topic) + " both become " +
                                subscription.topic);
        }
    }
    if (node.returning) {
        return m.subscriptions == node.subscriptions ? ask<Matched>(id, wiring_.request_for(id, node.config.names))
                                                     : lost(id, "it came back with other subscriptions");
    }
    node.subscriptions = std::move(m.subscriptions);
    if (!node.member) {
        return look_at_boundary();
    }
    if (all([](const NodeState &n) { return n.over() || n.stage == Stage::desired; })) {
        begin_matching();
    }
}

// ---- boundaries

/// If all nodes have met at the boundary and the joiners are ready, match them.
void Controller::look_at_boundary()
{
    if (phase_ != Phase::running || !admission_.all_met(nodes_)) {
        return;
    }
    bool ready = true;
    for (NodeId id = 0; id < nodes_.size(); id++) {
        NodeState &node = nodes_[id];
        if (!admission_.joins_next(node)) {
            continue;
        }
        if (node.stage == Stage::entered && !node.awaited) {
            node.reached = *admission_.boundary();
            initialize(id);
        }
        ready = ready && node.stage == Stage::desired;
    }
    if (ready) {
        begin_matching();
    }
}

// ---- matching

void Controller::begin_matching()
{
    phase_ = Phase::matching;
    matching_outdated_ = false;
    boundary_ = begun_ ? *admission_.boundary() : -1;
    for (NodeState &node : nodes_) {
        node.matching = !node.over() || (begun_ && admission_.joins_next(node));
        node.publications.clear();
    }
    wiring_before_ = wiring_;
    wiring_.begin_matching(nodes_, config_.watched, boundary_, !begun_);
    for (NodeId id = 0; id < nodes_.size(); id++) {
        if (nodes_[id].matching) {
            nodes_[id].stage = Stage::desired;
            ask<Matched>(id, wiring_.request_for(id, nodes_[id].config.names));
        }
    }
}

void Controller::reply(NodeId id, Matched &m)
{
    NodeState &node = nodes_[id];
    if (node.returning && !wiring_.same_publications(id, m.publications)) {
        return lost(id, "it came back with other messages");
    }
    node.stage = Stage::matched;
    if (node.returning) {
        return start(id);
    }
    if (node.played()) {
        take_initial_values(m.publications);
    }
    node.publications = std::move(m.publications);
    look_at_matching();
}

/// A program that goes on from a snapshot has other values than its node had at the beginning.
void Controller::take_initial_values(std::vector<Publication> &publications) const
{
    for (Publication &publication : publications) {
        for (const Past::Topic &topic : config_.past->topics) {
            if (publication.channel < wiring_.topics().size() &&
                topic.name == wiring_.topics()[publication.channel].name) {
                publication.initial = topic.initial;
            }
        }
    }
}

/// The next step of the matching, when all nodes have answered.
void Controller::look_at_matching()
{
    const auto all_matching = [&](const auto &is) {
        return all([&](const NodeState &n) { return !n.matching || is(n); });
    };
    if (phase_ != Phase::matching || !all_matching([](const NodeState &n) { return !n.awaited; })) {
        return;
    }
    if (matching_outdated_) {
        // Channels have changed: match all nodes again, at the same boundary.
        admission_.call_again(boundary_);
        for (NodeState &node : nodes_) {
            if (std::exchange(node.matching, false)) {
                node.stage = node.member ? Stage::idle : Stage::desired;
            }
        }
        resume();
    } else if (all_matching([](const NodeState &n) { return n.stage == Stage::matched; })) {
        connect();
    } else if (all_matching([](const NodeState &n) { return n.stage == Stage::idle; })) {
        finish_matching();
    }
}

/// All nodes have sent their publications.
void Controller::connect()
{
    std::vector<std::string> notes;
    wiring_.connect(nodes_, notes);
    for (std::string &note : notes) {
        report(std::move(note));
    }
    const std::string faults = wiring_.faults();
    if (faults.empty()) {
        for (NodeId id = 0; id < nodes_.size(); id++) {
            if (nodes_[id].matching) {
                start(id);
            }
        }
        return;
    }
    std::vector<NodeId> joiners;
    bool scheduled = false;
    for (NodeId id = 0; id < nodes_.size(); id++) {
        if (begun_ && nodes_[id].matching && !nodes_[id].member) {
            joiners.push_back(id);
            scheduled = scheduled || nodes_[id].scheduled();
        }
    }
    if (joiners.empty() || scheduled) {
        return finish(faults);
    }
    restart_matching();
    for (const NodeId id : joiners) {
        report(nodes_[id].name() + " cannot join: " + faults);
        dismiss(id, "it cannot join: " + faults);
    }
    look_at_matching();
}

/// Forget the results of this matching.
void Controller::restart_matching()
{
    if (!std::exchange(matching_outdated_, true)) {
        wiring_ = wiring_before_;
    }
}

void Controller::finish_matching()
{
    std::vector<std::string> joined;
    for (NodeId id = 0; id < nodes_.size(); id++) {
        NodeState &node = nodes_[id];
        if (std::exchange(node.matching, false) && !std::exchange(node.member, true)) {
            changes_.push_back({Change::joined, id, node.reached});
            joined.push_back(node.name());
        }
        node.joining = node.joining && !node.member;
        node.been = node.been || node.member;
    }
    if (!joined.empty()) {
        report(format_list(joined) + (joined.size() == 1 ? " joins after " : " join after ") + when(boundary_));
    }
    begun_ = true;
    met_ = boundary_;
    if (config_.listened) {
        act(action::Began{wiring_.exchange(nodes_)});
    }
    admission_.met();
    wiring_.end_matching();
    wiring_before_ = Wiring(nodes_.size());
    if (const auto past = config_.past; past && boundary_ < 0) {
        take_past(*past);
    }
    resume();
}

/// What nodes wrote, for them to write again; messages of asynchronous programs are on their way from the start.
void Controller::take_past(const Past &past)
{
    for (const Past::Topic &before : past.topics) {
        const auto channel = wiring_.find(before.name);
        if (!channel || !wiring_.topics()[*channel].writer) {
            continue;
        }
        Topic &topic = wiring_.topic(*channel);
        std::vector<Record> records;
        for (const auto &[t, payload] : before.messages) {
            records.push_back({*channel, static_cast<std::uint32_t>(records.size() + 1), t, payload});
        }
        if (!nodes_[*topic.writer].program) {
            nodes_[*topic.writer].past.log_output(*channel, records);
            continue;
        }
        for (const Record &record : records) {
            topic.count = record.count;
            topic.last = record.t;
            wiring_.write_ahead(*channel, record.t, record.payload, nodes_);
        }
        if (config_.listened && !records.empty()) {
            act(action::Wrote{*topic.writer, std::move(records)});
        }
    }
    config_.past = std::make_shared<Past>(Past{past.until, {}, {}}); // the nodes have the rest
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
    go_on_all();
}

/// Counts begin at 1. The controller sends again the messages that the node has not yet seen.
void Controller::start(NodeId id)
{
    NodeState &node = nodes_[id];
    node.log.forget_inputs_after(node.reached);
    ask<Ready>(id, wiring_.start(id, node));
}

void Controller::reply(NodeId id, Ready &)
{
    NodeState &node = nodes_[id];
    node.stage = Stage::idle;
    if (phase_ == Phase::matching) {
        return look_at_matching();
    }
    node.log.begin_replay(node.log.kept() ? node.log.saved() : node.reached);
    repeat_tick(id);
}

} // namespace fledge::cosim
