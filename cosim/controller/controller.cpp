// SPDX-License-Identifier: Apache-2.0
// What happens, from outside: who comes, replies, goes; and the end.
#include "cosim/controller/controller_parts.h"

#include <algorithm>
#include <stdexcept>

namespace fledge::cosim {

namespace {

constexpr int most_tries = 3;

} // namespace

Controller::Controller(ControllerConfig config) : config_(std::move(config)), horizon_(config_.horizon)
{
    if (config_.end < 0 || config_.end > longest_time || config_.batch < 1 || config_.ahead < 4 ||
        config_.nodes.empty()) {
        throw std::invalid_argument("a co-simulation has nodes, an end from 0 to 31 years, batches of at least 1 "
                                    "instant, and readers that may lag by at least 4 messages");
    }
    bool some = false;
    for (const NodeConfig &node : config_.nodes) {
        for (const Node &other : nodes_) {
            if (other.config.name == node.name) {
                throw std::invalid_argument("two nodes are called " + node.name);
            }
        }
        if (node.joins == Join::at_time && (node.joins_after < 0 || node.joins_after >= config_.end)) {
            throw std::invalid_argument(node.name + " joins after " + when(node.joins_after) +
                                        "; expected a time from 0 to before the end at " + when(config_.end));
        }
        if (node.save_every < 0) {
            throw std::invalid_argument(node.name + " saves every " + std::to_string(node.save_every) +
                                        " ns; expected a time > 0, or 0 for where there is need");
        }
        nodes_.emplace_back().config = node;
        nodes_.back().member = node.joins == Join::at_start;
        some = some || nodes_.back().member;
    }
    if (!some) {
        throw std::invalid_argument("no node is there at the start; at least one has to be");
    }
    for (const AsynchronousConfig &program : config_.asynchronous) {
        for (const Node &other : nodes_) {
            if (other.config.name == program.name) {
                throw std::invalid_argument("an asynchronous program is called " + program.name + ", as another is");
            }
        }
        Node &node = nodes_.emplace_back();
        node.config.name = program.name;
        node.stage = Stage::finished;
        node.asynchronous = node.any_time = true;
    }
    set_last();
}

bool Controller::Node::connected() const
{
    return stage != Stage::absent && stage != Stage::finished && stage != Stage::lost;
}

void Controller::hello(std::uint64_t peer, const Hello &hello)
{
    const auto refuse = [&](const std::string &reason) { act(action::Refuse{peer, reason}); };
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
        if (!node.asynchronous) {
            names.push_back(node.config.name);
        }
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
        node.reached = node.config.joins_after; // known by now, so it can prepare while the others run
        initialize(id);
    } else if (node.joining) {
        look_for_joiners();
        look_at_boundary();
    } else if (phase_ != Phase::matching) {
        initialize(id);
    }
}

void Controller::initialize(NodeId id)
{
    const Node &node = nodes_[id];
    const bool from_log = node.returning && node.kept;
    send<Initialize, Initialized>(id, {config_.seed, config_.end, from_log ? node.saved : node.reached,
                                       config_.frontend, config_.backend, from_log ? node.snapshot : Bytes{}});
}

void Controller::ask(NodeId id, Message request, std::size_t kind_of_reply)
{
    Node &node = nodes_[id];
    node.awaited = true;
    node.expected = kind_of_reply;
    actions_.emplace_back(std::in_place_type<action::Send>, id, Frame{++node.number, std::move(request)});
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
    if ((phase_ == Phase::finishing || node.stage == Stage::dismissed) &&
        !std::holds_alternative<Finished>(frame.message)) {
        return; // the reply to what was asked before the end
    }
    const std::string found = std::string(kind_name(frame.message)) + " " + std::to_string(frame.number);
    if (!node.awaited) {
        return lost(id, "it sent " + found + ", which nobody asked for");
    }
    if (frame.number != node.number || frame.message.index() != node.expected) {
        return lost(id,
                    "it sent " + found + "; expected " + kind_name(node.expected) + " " + std::to_string(node.number));
    }
    node.awaited = false;
    std::visit([&](auto &m) { reply(id, m); }, frame.message);
}

/// All that is no reply, or not one to what was asked.
template <class M> void Controller::reply(NodeId id, M &)
{
    lost(id, "it sent what only a controller sends");
}

void Controller::lost(NodeId id, const std::string &why)
{
    Node &node = nodes_[id];
    if (!node.connected() || phase_ == Phase::done) {
        return;
    }
    node.awaited = false;
    act(action::ShutOut{id, why});
    if (phase_ == Phase::finishing) {
        node.stage = Stage::lost;
        return look_whether_done();
    }
    if (!node.member) {
        return lose_joiner(id, why);
    }
    std::string text = node.config.name + ": " + why;
    if (!begun_) {
        node.stage = Stage::lost;
        return finish(text);
    }
    text += " (it had reached " + when(node.reached) + ")";
    if (phase_ == Phase::matching) {
        spoil_matching(); // first, for what follows is to stay
        node.matching = false;
    }
    const Policy policy = node.config.on_loss;
    node.returning = false;
    if (policy == Policy::hold || policy == Policy::drop) {
        give_up(id);
    }
    node.stage = Stage::lost;
    if (policy == Policy::abort) {
        return finish(text);
    }
    if (policy == Policy::hold) {
        report(text + "; its messages keep their last values");
    } else if (policy == Policy::drop) {
        report(text + "; its messages are never written from now on");
    } else if (!node.kept && (policy == Policy::restart || node.saves)) {
        return finish(text + "; what it was told is no longer kept, so it cannot be started again");
    } else if (node.kept && ++node.tries > most_tries) {
        return finish(text + "; it was started again " + std::to_string(most_tries) + " times and came no further");
    } else if (policy == Policy::pause) {
        report(text + "; the run waits for it");
    } else {
        report(text + "; started again, it goes on from " + when(node.saved));
    }
    if (all_over()) {
        return finish("all nodes were lost; the last was " + text);
    }
    if (phase_ == Phase::matching) {
        return look_at_matching();
    }
    grant_around(id);
    look_at_boundary();
    finish_if_complete();
}

/// It goes before it has taken part; the others go on.
void Controller::lose_joiner(NodeId id, const std::string &why)
{
    Node &node = nodes_[id];
    if (node.stage == Stage::dismissed) {
        node.stage = node.been ? Stage::lost : Stage::absent;
        return; // it was to go
    }
    report(node.config.name + ": " + why + ", before it took part" + (node.scheduled() ? "; it is awaited again" : ""));
    node.stage = node.been ? Stage::lost : Stage::absent;
    node.joining = false;
    if (std::exchange(node.matching, false)) {
        spoil_matching();
        return look_at_matching();
    }
    if (phase_ == Phase::running) {
        look_for_joiners();
        look_at_boundary();
        grant_all();
        finish_if_complete();
    }
}

/// From here on it writes nothing more, and nobody waits for it.
void Controller::give_up(NodeId id)
{
    Node &node = nodes_[id];
    const Ns next = node.safe();
    node.member = false;
    changes_.push_back({Change::given_up, id, std::max(node.reached, met_)}); // it was there when they met
    for (std::uint32_t channel = 0; channel < topics_.size() && node.config.on_loss == Policy::drop; channel++) {
        Topic &topic = topics_[channel];
        if (topic.writer != id || next > config_.end) {
            continue;
        }
        Bytes nothing(topic.schema.size + 4);
        nothing[1] = static_cast<std::byte>(native_order());
        write_ahead(topic, next, nothing);
        if (config_.tell) {
            act(action::Wrote{id, {{channel, topic.count + 1, next, nothing}}});
        }
    }
    for (const std::size_t w : node.in) {
        Wire &wire = wires_[w];
        if (!wire.pending.empty()) {
            wire.last = std::move(wire.pending.back().payload);
        }
        wire.pending.clear();
        wire.delivered = 0;
    }
    node.kept = false;
    node.told.clear();
    node.said.clear();
    node.snapshot.clear();
    node.logged = 0;
}

void Controller::leave(NodeId id)
{
    Node &node = nodes_[id];
    report(node.config.name + " leaves at " + when(node.reached) +
           (node.config.on_loss == Policy::drop ? "; its messages are never written from now on"
                                                : "; its messages keep their last values"));
    give_up(id);
    changes_.back().what = Change::left;
    dismiss(id, "");
    if (all_over()) {
        return finish("all nodes have left");
    }
    grant_around(id);
    look_at_boundary();
    finish_if_complete();
}

/// It is asked to finish, while the run goes on.
void Controller::dismiss(NodeId id, const std::string &why)
{
    Node &node = nodes_[id];
    node.joining = node.matching = false;
    node.stage = Stage::dismissed;
    send<Finish, Finished>(id, {why});
}

void Controller::stop(const std::string &why)
{
    finish(why);
}

std::vector<std::string> Controller::absent() const
{
    std::vector<std::string> names;
    const bool met = all_met();
    for (const Node &node : nodes_) {
        const bool awaited =
            node.stage == Stage::absent && (begun_ ? met && node.scheduled() && due(node) : node.member);
        if (awaited || (node.stage == Stage::lost && node.member && node.config.on_loss == Policy::restart)) {
            names.push_back(node.config.name);
        }
    }
    return names;
}

const char *Controller::state(NodeId id) const
{
    const Node &node = nodes_[id];
    if (node.returning) {
        return "joining";
    }
    switch (node.stage) {
    case Stage::absent:
    case Stage::dismissed: return node.been ? "left" : "absent";
    case Stage::finished: return "finished";
    case Stage::lost: return "lost";
    case Stage::idle:
    case Stage::saving:
    case Stage::ticking: return "running";
    default: return node.member && begun_ ? "running" : "joining";
    }
}

bool Controller::waiting() const
{
    return begun_ && (paused() || phase_ == Phase::matching || all_met() || !absent().empty());
}

// ---- the end

void Controller::finish(const std::string &why)
{
    if (phase_ == Phase::finishing || phase_ == Phase::done) {
        return;
    }
    phase_ = Phase::finishing;
    reason_ = why;
    for (NodeId id = 0; id < nodes_.size(); id++) {
        if (nodes_[id].connected() && nodes_[id].stage != Stage::dismissed) {
            send<Finish, Finished>(id, {why});
        }
    }
    look_whether_done();
}

void Controller::look_whether_done()
{
    if (std::none_of(nodes_.begin(), nodes_.end(), [](const Node &n) { return n.connected(); })) {
        phase_ = Phase::done;
        act(action::Done{reason_});
    }
}

void Controller::finish_if_complete()
{
    if (phase_ == Phase::running && std::all_of(nodes_.begin(), nodes_.end(), [&](const Node &n) {
            return complete(n, config_.end) && !n.scheduled();
        })) {
        finish("");
    }
}

void Controller::reply(NodeId id, Finished &)
{
    if (nodes_[id].stage == Stage::dismissed && phase_ != Phase::finishing) {
        nodes_[id].stage = Stage::absent;
        act(action::ShutOut{id, ""});
        return;
    }
    nodes_[id].stage = Stage::finished;
    look_whether_done();
}

/// All that take part.
bool Controller::all_at(Stage stage) const
{
    return std::all_of(nodes_.begin(), nodes_.end(), [&](const Node &n) { return n.over() || n.stage == stage; });
}

/// Nobody takes part, nor is to come.
bool Controller::all_over() const
{
    return std::all_of(nodes_.begin(), nodes_.end(), [](const Node &n) { return n.over() && !n.scheduled(); });
}

bool Controller::paused() const
{
    return std::any_of(nodes_.begin(), nodes_.end(), [](const Node &n) {
        return n.member && n.config.on_loss == Policy::pause && (n.returning || n.stage == Stage::lost);
    });
}

} // namespace fledge::cosim
