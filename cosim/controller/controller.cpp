// SPDX-License-Identifier: Apache-2.0
#include "cosim/controller/controller.h"

#include "cosim/protocol/text.h"

#include <algorithm>
#include <set>

namespace fledge::cosim {

namespace {

constexpr int most_tries = 3;
constexpr int most_played = 1000; // ticks, before the controller looks at other things
constexpr Ns fine = 10'000'000;   // step of the horizon for nodes without rates

} // namespace

void ControllerConfig::check() const
{
    if (end < 0 || end > longest_time || batch < 1 || ahead < 4 || nodes.empty()) {
        throw std::invalid_argument("a co-simulation has nodes, an end from 0 to 31 years, batches of at least 1 "
                                    "instant, and readers that may lag by at least 4 messages");
    }
    const auto check_name = [](const char *what, const std::string &name) {
        if (name.size() > Limits{}.name) {
            throw std::invalid_argument(std::string(what) + " of " + std::to_string(name.size()) + " bytes; " +
                                        std::to_string(Limits{}.name) + " are the most");
        }
        if (const std::string fault = text_fault(name, TextKind::name); !fault.empty()) {
            throw std::invalid_argument(std::string(what) + " " + fault);
        }
    };
    check_name("the simulation's name", simulation);
    for (const std::string &topic : watched) {
        check_name("a watched topic's name", topic);
    }
    std::set<std::string> names;
    for (const NodeConfig &node : nodes) {
        check_name("a node's name", node.name);
        if (!names.insert(node.name).second) {
            throw std::invalid_argument("two nodes are called " + node.name);
        }
        if (node.joins == Join::at_time && (node.joins_after < 0 || node.joins_after >= end)) {
            throw std::invalid_argument(node.name + " joins after " + when(node.joins_after) +
                                        "; expected a time from 0 to before the end at " + when(end));
        }
        if (const std::string fault = node.names.fault(); !fault.empty()) {
            throw std::invalid_argument(node.name + ": " + fault);
        }
        if (node.save_every < 0) {
            throw std::invalid_argument(node.name + " saves every " + std::to_string(node.save_every) +
                                        " ns; expected a time > 0, or 0 to save when the log is full");
        }
    }
    if (keep_every < 0) {
        throw std::invalid_argument("snapshots every " + std::to_string(keep_every) + " ns; expected a time >= 0");
    }
    if (past && past->until > end) {
        throw std::invalid_argument("the run goes on from " + when(past->until) + ", behind its end at " + when(end));
    }
    if (std::none_of(nodes.begin(), nodes.end(), [](const NodeConfig &n) { return n.joins == Join::at_start; })) {
        throw std::invalid_argument("no node joins at the start; at least one has to");
    }
    for (const AsynchronousConfig &program : asynchronous) {
        check_name("a program's name", program.name);
        if (!names.insert(program.name).second) {
            throw std::invalid_argument("two programs are called " + program.name);
        }
        for (const AsynchronousConfig &other : asynchronous) {
            for (const std::string &topic : program.topics) {
                if (&other != &program && other.writes(topic)) {
                    throw std::invalid_argument("a topic has one writer; " + other.name + " and " + program.name +
                                                " both write " + topic);
                }
            }
        }
    }
}

Controller::Controller(ControllerConfig config)
    : config_(std::move(config)), wiring_(config_.nodes.size() + config_.asynchronous.size()), wiring_before_(wiring_),
      admission_(config_)
{
    config_.check();
    for (const NodeConfig &node : config_.nodes) {
        nodes_.emplace_back().config = node;
        nodes_.back().member = node.joins == Join::at_start;
        pauses_ = pauses_ || node.on_loss == Policy::pause;
    }
    for (std::size_t i = 0; config_.past && i < config_.past->snapshots.size(); i++) {
        const NodeSnapshot &snapshot = config_.past->snapshots[i];
        const auto node =
            std::find_if(nodes_.begin(), nodes_.end(), [&](const NodeState &n) { return n.name() == snapshot.node; });
        if (node == nodes_.end() || !node->member || snapshot.reached > config_.past->until) {
            throw std::invalid_argument("a snapshot of " + snapshot.node + " at " + when(snapshot.reached) +
                                        "; expected one of a node that is there at the start, up to " +
                                        when(config_.past->until));
        }
        node->from = snapshot.reached;
        node->past.take_snapshot(snapshot.reached, snapshot.bytes.copy());
    }
    for (const AsynchronousConfig &program : config_.asynchronous) {
        NodeState &node = nodes_.emplace_back();
        node.config.name = program.name;
        node.program = program;
        node.stage = Stage::finished;
        node.schedule.any_time = true;
    }
    admission_.choose(nodes_);
}

void Controller::received(NodeId id, Frame frame)
{
    NodeState &node = nodes_[id];
    if (!node.connected() || done()) {
        return;
    }
    if (const auto *failed = std::get_if<Failed>(&frame.message)) {
        return lost(id, "it failed: " + failed->reason);
    }
    if ((finishing() || node.stage == Stage::dismissed) && !std::holds_alternative<Finished>(frame.message)) {
        return; // the reply to an earlier request
    }
    const auto found = [&] { return std::string(kind_name(frame.message)) + " " + std::to_string(frame.number); };
    if (!node.awaited) {
        return forget(id, "it sent " + found() + ", which the controller did not ask for");
    }
    if (frame.number != node.number || frame.message.index() != node.expected) {
        return forget(id, "it sent " + found() + "; expected " + kind_name(node.expected) + " " +
                              std::to_string(node.number));
    }
    node.awaited = false;
    std::visit([&](auto &m) { reply(id, m); }, frame.message);
}

/// Any message that is no reply.
template <class M> void Controller::reply(NodeId id, M &)
{
    lost(id, "it sent a message that only a controller sends");
}

// ---- steps

void Controller::reply(NodeId id, Tock &m)
{
    NodeState &node = nodes_[id];
    if (node.returning) {
        return repeat_tock(id, m);
    }
    for (Record &record : m.records) {
        record.count += record.channel < wiring_.topics().size() ? wiring_.topics()[record.channel].before : 0;
    }
    if (const std::string fault = wiring_.fault_of(id, node, m); !fault.empty()) {
        return lost(id, fault);
    }
    const bool played = node.played();
    if (const std::string difference = played ? "" : difference_to_past(node, m); !difference.empty()) {
        return finish(node.name() + " does not repeat what it wrote before: " + difference);
    }
    node.stage = Stage::idle;
    node.tries = 0;
    node.reached = m.reached;
    if (config_.past && node.reached >= config_.past->until) {
        node.past.drop();
    }
    wiring_.write(id, nodes_, m.records);
    if (played && !node.played()) {
        wiring_.begin_at(id);
    } else if (node.log.kept() && !played) {
        node.log.log_output(m.records);
        drop_log_if_full(node);
    }
    if (config_.listened && !m.records.empty()) {
        act(action::Wrote{id, std::move(m.records), grants().settled()});
    }
    look_at_kept();
    if (m.leaving) {
        return leave(id);
    }
    go_on(id);
}

void Controller::grant(NodeId id)
{
    NodeState &node = nodes_[id];
    if (phase_ != Phase::running || !node.member || node.stage != Stage::idle || node.returning || paused() ||
        node.complete(admission_.last()) || save_if_due(id)) {
        return;
    }
    const Ns until = grants().grant(id);
    if (until == node.reached) {
        return;
    }
    Tick tick{until, wiring_.deliver(id, until)};
    node.until = until;
    node.stage = Stage::ticking;
    if (node.played()) {
        return playing_.push_back(id);
    }
    if (node.log.kept()) {
        node.log.log_input(tick.records);
    }
    ask<Tock>(id, std::move(tick));
}

bool Controller::play()
{
    const bool any = !playing_.empty();
    for (int n = 0; n < most_played && !playing_.empty(); n++) {
        const NodeId id = playing_.front();
        playing_.pop_front();
        if (NodeState &node = nodes_[id]; node.stage == Stage::ticking && node.played() && !finishing() && !done()) {
            Tock tock{node.until, 0, node.past.repeat_until(node.until), false};
            reply(id, tock);
        }
    }
    return any;
}

/// A program without a snapshot, or behind it, writes again what was written up to the end of the past.
std::string Controller::difference_to_past(NodeState &node, const Tock &m)
{
    const Ns until = config_.past ? config_.past->until : -1;
    if (node.reached >= until) {
        return "";
    }
    for (const Record &record : m.records) {
        if (record.t <= until && node.past.has(record.channel)) {
            const std::string &name = wiring_.topics()[record.channel].name;
            if (std::string difference = node.past.repeat_output(record, name); !difference.empty()) {
                return difference;
            }
        }
    }
    return node.past.finish_tick(std::min(m.reached, until),
                                 [&](std::uint32_t channel) { return wiring_.topics()[channel].name; });
}

/// A node has stepped or is gone: it may step again, and so may the nodes that waited for it.
void Controller::go_on(NodeId id)
{
    grant(id);
    for (const NodeId other : wiring_.neighbours(id)) {
        grant(other);
    }
    look_at_boundary();
    finish_if_complete();
}

void Controller::go_on_all()
{
    if (phase_ == Phase::running) {
        admission_.call_joiners(nodes_, wiring_, matching_outdated_);
    }
    look_at_boundary();
    for (NodeId id = 0; id < nodes_.size(); id++) {
        grant(id);
    }
    finish_if_complete();
}

bool Controller::unblocking_nodes(std::vector<char> &marked) const
{
    marked.assign(nodes_.size(), false);
    return phase_ == Phase::running && !admission_.calls() && grants().unblocking_nodes(marked);
}

void Controller::set_horizon(Ns horizon)
{
    admission_.set_horizon(horizon, nodes_);
    for (NodeId id = 0; id < nodes_.size(); id++) {
        grant(id);
    }
}

Ns Controller::next_due() const
{
    const Ns horizon = admission_.horizon();
    if (horizon >= config_.end) {
        return for_ever;
    }
    Ns next = config_.end;
    for (const NodeState &node : nodes_) {
        if (!node.over()) {
            next = std::min(next, node.schedule.rates.empty() ? horizon + fine : node.schedule.next_after(horizon));
        }
    }
    return next;
}

std::string Controller::inject(const std::string &program, const std::string &name, const Payload &payload)
{
    if (!begun_ || finishing() || done()) {
        return begun_ ? "the run is over" : "the run has not begun";
    }
    const auto channel = wiring_.find(name);
    if (!channel) {
        return "no node reads " + name;
    }
    Topic &topic = wiring_.topic(*channel);
    if (!topic.writer || !nodes_[*topic.writer].program || nodes_[*topic.writer].name() != program) {
        return name + " is not written by " + program;
    }
    if (!is_payload(payload, topic.schema.size)) {
        return "a message of " + name + " has " + std::to_string(payload.size()) +
               " bytes; expected a CDR header and " + std::to_string(topic.schema.size);
    }
    if (phase_ == Phase::matching) {
        injected_.push_back({program, name, payload}); // the wires may change
        return "";
    }
    std::string fault;
    const Ns past = config_.past ? config_.past->until : -1;
    const Ns written = wiring_.time_to_write(topic, nodes_, std::max(met_, past) + 1, config_.ahead, fault);
    if (!fault.empty()) {
        return fault;
    }
    topic.count++;
    topic.last = written;
    wiring_.write_ahead(*channel, written, payload, nodes_);
    if (config_.listened) {
        act(action::Wrote{*topic.writer, {{*channel, topic.count, written, payload}}});
    }
    return "";
}

// ---- snapshots, and programs that take the place of lost ones

bool Controller::save_if_due(NodeId id)
{
    NodeState &node = nodes_[id];
    const Ns every = node.config.save_every, since = node.reached - node.log.saved();
    const bool due = node.complete(node.keep) || (node.log.kept() && node.saves && since > 0 &&
                                                  ((every && since >= every) || node.log.bytes() > config_.log));
    if (due) {
        node.stage = Stage::saving;
        ask<Saved>(id, Save{node.reached});
    }
    return due;
}

/// Without snapshots, the log of a node grows until it is full.
void Controller::drop_log_if_full(NodeState &node)
{
    if (node.log.bytes() > config_.log && !node.saves) {
        report(node.name() + " cannot be restarted from now on: its messages since " + when(node.log.saved()) +
               " exceed " + std::to_string(config_.log) + " bytes" +
               (node.log.saved() < 0 ? ", and it makes no snapshots" : ""));
        node.log.drop();
    }
}

void Controller::reply(NodeId id, Saved &m)
{
    NodeState &node = nodes_[id];
    node.stage = Stage::idle;
    if (m.snapshot.empty()) {
        node.saves = false;
        node.keep = for_ever;
        report(node.name() + " makes no snapshot at " + when(node.reached));
        drop_log_if_full(node);
    } else {
        const NodeSnapshot snapshot{node.name(), node.reached, node.complete(node.keep) ? m.snapshot : Payload()};
        for (; node.keep <= config_.end && node.complete(node.keep); node.keep += config_.keep_every) {
            kept_[node.keep][id] = snapshot;
        }
        if (node.log.kept()) {
            node.log.take_snapshot(node.reached, std::move(m.snapshot));
        }
    }
    look_at_kept();
    go_on(id);
}

/// Give the snapshots of an instant to the listeners, when all nodes are behind it.
void Controller::look_at_kept()
{
    const auto is_behind = [&](const NodeState &n) {
        const Ns t = kept_.begin()->first;
        return n.over() || (n.complete(t) && n.keep > t);
    };
    while (!kept_.empty() && all(is_behind)) {
        auto first = kept_.extract(kept_.begin());
        action::Kept kept{first.key(), {}};
        for (auto &[id, snapshot] : first.mapped()) {
            kept.snapshots.push_back(std::move(snapshot));
        }
        act(std::move(kept));
    }
}

/// Send the next tick of the replay; after the last one, the node steps with the others again.
void Controller::repeat_tick(NodeId id)
{
    NodeState &node = nodes_[id];
    if (node.log.replayed() >= node.reached) {
        node.returning = false;
        changes_.push_back({Change::back, id, node.reached});
        report(node.name() + " is back at " + when(node.reached));
        return go_on_all(); // all nodes may have waited for it
    }
    Tick tick = node.log.next_tick(node.reached);
    wiring_.resend(id, tick.records);
    node.until = tick.until;
    node.stage = Stage::ticking;
    ask<Tock>(id, std::move(tick));
}

void Controller::repeat_tock(NodeId id, const Tock &m)
{
    NodeState &node = nodes_[id];
    if (m.reached <= node.log.replayed() || m.reached > node.until) {
        return lost(id, "it reports that it reached " + when(m.reached) + "; its tick goes from " +
                            when(node.log.replayed()) + " to " + when(node.until));
    }
    std::string difference;
    for (const Record &record : m.records) {
        if (const std::string fault = wiring_.repeat_count(id, record); !fault.empty()) {
            return lost(id, fault);
        }
        const Topic &topic = wiring_.topics()[record.channel];
        if (record.t > topic.since) { // the lost program wrote this topic, too
            difference = node.log.repeat_output(record, topic.name);
        }
        if (!difference.empty()) {
            break;
        }
    }
    if (difference.empty()) {
        difference =
            node.log.finish_tick(m.reached, [&](std::uint32_t channel) { return wiring_.topics()[channel].name; });
    }
    if (!difference.empty()) {
        return finish(node.name() + ": restarted from " + when(node.log.saved()) +
                      ", it does not repeat its messages: " + difference);
    }
    node.stage = Stage::idle;
    repeat_tick(id);
}

// ---- losses

void Controller::lost(NodeId id, const std::string &why)
{
    NodeState &node = nodes_[id];
    if (!node.connected() || done()) {
        return;
    }
    node.awaited = false;
    act(action::ShutOut{id, why});
    if (finishing()) {
        node.stage = Stage::lost;
        return look_whether_done();
    }
    if (!node.member) {
        return lose_joiner(id, why);
    }
    std::string text = node.name() + ": " + why;
    if (!begun_) {
        node.stage = Stage::lost;
        return finish(text);
    }
    text += " (it had reached " + when(node.reached) + ")";
    if (phase_ == Phase::matching) {
        restart_matching(); // before the calls below, which change the wiring
        node.matching = false;
    }
    const Policy policy = node.config.on_loss;
    node.returning = false;
    const bool kept = node.log.kept();
    if (policy == Policy::hold || policy == Policy::drop) {
        give_up(id, Change::given_up);
    }
    node.stage = Stage::lost;
    if (policy == Policy::abort) {
        return finish(text);
    }
    if (policy == Policy::hold) {
        report(text + "; its messages keep their last values");
    } else if (policy == Policy::drop) {
        report(text + "; its messages are never written from now on");
    } else if (!kept && (policy == Policy::restart || node.saves)) {
        return finish(text + "; its log is too large, so it cannot be restarted");
    } else if (kept && ++node.tries > most_tries) {
        return finish(text + "; it was restarted " + std::to_string(most_tries) + " times without progress");
    } else if (policy == Policy::pause) {
        report(text + "; the run waits for it");
    } else {
        report(text + "; restarted, it goes on from " + when(node.log.saved()));
    }
    if (all_over()) {
        return finish("all nodes were lost; the last was " + text);
    }
    if (phase_ == Phase::matching) {
        return look_at_matching();
    }
    go_on(id);
}

void Controller::forget(NodeId id, const std::string &why)
{
    NodeState &node = nodes_[id];
    if (!node.member || node.stage != Stage::entered || finishing() || done()) {
        return lost(id, why);
    }
    node.awaited = node.returning = false;
    node.stage = begun_ ? Stage::lost : Stage::absent;
    act(action::ShutOut{id, why});
    report(node.name() + ": " + why + "; another program may take its place");
}

/// A node was lost before it joined: the others go on.
void Controller::lose_joiner(NodeId id, const std::string &why)
{
    NodeState &node = nodes_[id];
    const bool dismissed = node.stage == Stage::dismissed;
    node.stage = node.been ? Stage::lost : Stage::absent;
    if (dismissed) {
        return;
    }
    report(node.name() + ": " + why + ", before it took part" +
           (node.scheduled() ? "; the controller waits for it again" : ""));
    node.joining = false;
    if (std::exchange(node.matching, false)) {
        restart_matching();
        return look_at_matching();
    }
    go_on_all();
}

/// The node writes nothing more, and no other node waits for it.
void Controller::give_up(NodeId id, Change::What what)
{
    NodeState &node = nodes_[id];
    const Ns next = node.first_write();
    node.member = false;
    changes_.push_back({what, id, std::max(node.reached, met_)});
    for (std::uint32_t channel = 0; channel < wiring_.topics().size() && node.config.on_loss == Policy::drop;
         channel++) {
        const Topic &topic = wiring_.topics()[channel];
        if (topic.writer != id || next > config_.end) {
            continue;
        }
        const Payload nothing = zero_payload(topic.schema.size);
        wiring_.write_ahead(channel, next, nothing, nodes_);
        if (config_.listened) {
            act(action::Wrote{id, {{channel, topic.count + 1, next, nothing}}});
        }
    }
    wiring_.empty_inputs(id);
    node.log.drop();
    look_at_kept();
}

void Controller::leave(NodeId id)
{
    NodeState &node = nodes_[id];
    report(node.name() + " leaves at " + when(node.reached) +
           (node.config.on_loss == Policy::drop ? "; its messages are never written from now on"
                                                : "; its messages keep their last values"));
    give_up(id, Change::left);
    dismiss(id, "");
    if (all_over()) {
        return finish("all nodes have left");
    }
    go_on(id);
}

/// Ask the node to finish, while the run goes on.
void Controller::dismiss(NodeId id, const std::string &why)
{
    NodeState &node = nodes_[id];
    node.joining = node.matching = false;
    node.stage = Stage::dismissed;
    ask<Finished>(id, Finish{why});
}

// ---- the state

std::vector<std::string> Controller::absent() const
{
    std::vector<std::string> names;
    const bool met = admission_.all_met(nodes_);
    for (const NodeState &node : nodes_) {
        const bool awaited = node.stage == Stage::absent &&
                             (begun_ ? met && node.scheduled() && admission_.joins_next(node) : node.member);
        if (awaited || (node.stage == Stage::lost && node.member && node.config.on_loss == Policy::restart)) {
            names.push_back(node.name());
        }
    }
    return names;
}

const char *Controller::state(NodeId id) const
{
    const NodeState &node = nodes_[id];
    if (node.returning) {
        return "joining";
    }
    switch (node.stage) {
    case Stage::absent:
    case Stage::dismissed: return node.been ? "left" : "absent";
    case Stage::entered: return "greeted";
    case Stage::finished: return "finished";
    case Stage::lost: return "lost";
    case Stage::idle:
    case Stage::saving:
    case Stage::ticking: return "running";
    default: return node.member && begun_ ? "running" : "joining";
    }
}

bool Controller::busy(NodeId id) const
{
    const NodeState &node = nodes_[id];
    return node.member && (node.returning || (node.connected() && node.awaited));
}

bool Controller::paused() const
{
    return pauses_ && !all([](const NodeState &n) {
               return !n.member || n.config.on_loss != Policy::pause || !(n.returning || n.stage == Stage::lost);
           });
}

bool Controller::waiting() const
{
    return begun_ && (paused() || phase_ == Phase::matching || admission_.all_met(nodes_) || !absent().empty());
}

// ---- the end

void Controller::finish(const std::string &why)
{
    if (finishing() || done()) {
        return;
    }
    phase_ = Phase::finishing;
    reason_ = why;
    for (NodeId id = 0; id < nodes_.size(); id++) {
        if (nodes_[id].connected() && nodes_[id].stage != Stage::dismissed) {
            ask<Finished>(id, Finish{why});
        }
    }
    look_whether_done();
}

void Controller::reply(NodeId id, Finished &)
{
    if (nodes_[id].stage == Stage::dismissed && !finishing()) {
        nodes_[id].stage = Stage::absent;
        act(action::ShutOut{id, ""});
        return;
    }
    nodes_[id].stage = Stage::finished;
    look_whether_done();
}

void Controller::look_whether_done()
{
    if (all([](const NodeState &n) { return !n.connected(); })) {
        phase_ = Phase::done;
        act(action::Done{reason_});
    }
}

void Controller::finish_if_complete()
{
    if (phase_ == Phase::running &&
        all([&](const NodeState &n) { return n.complete(config_.end) && !n.scheduled(); })) {
        finish("");
    }
}

/// Whether no node takes part any more or joins later.
bool Controller::all_over() const
{
    return all([](const NodeState &n) { return n.over() && !n.scheduled(); });
}

} // namespace fledge::cosim
