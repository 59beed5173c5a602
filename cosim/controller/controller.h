// SPDX-License-Identifier: Apache-2.0
// The decisions of the controller: it turns events into actions. It has no socket and no clock, so that a test can
// try every order of events.
//
// - Wiring: the topics, their writers and readers, and the messages on their way
// - Grants: how far each node may step
// - Admission: where the run stops so that nodes join
// - RestartLog: the data with which a new program takes the place of a lost one
//
// Example:
//
//     using namespace cosim;
//     ControllerConfig config{.simulation = "spin"};
//     config.nodes = {{.name = "world"}, {.name = "flight"}};
//     Controller controller(config);
//     controller.hello(1, Hello{.simulation = "spin", .node = "world"});
//     for (const Action &action : controller.take_actions()) {
//         if (const auto *refused = std::get_if<action::Refuse>(&action)) {
//             throw std::runtime_error(refused->reason);
//         }
//     }
#pragma once

#include "cosim/controller/grants.h"

#include <algorithm>
#include <variant>

namespace fledge::cosim {

/// A node came or went after an instant. The messages that the other nodes see depend on these times alone: if nodes
/// join (Join::at_time) and leave at the same instants, the next run has the same results.
struct Change {
    enum What { joined, left, given_up, back };
    What what;
    NodeId node;
    Ns after;
};

namespace action {

/// Accept a program as this node: open a socket for it and send its address.
struct Accept {
    std::uint64_t peer;
    NodeId node;
};
struct Refuse {
    std::uint64_t peer;
    std::string reason;
};
struct Send {
    NodeId node;
    Frame frame;
};
/// Close the socket of a node that was lost or broke the protocol.
struct ShutOut {
    NodeId node;
    std::string reason;
};
/// Something that the user should know.
struct Report {
    std::string text;
};
/// All nodes are matched and step from now on. It comes again at each boundary where nodes joined.
struct Began {
    Exchange exchange;
};
/// Messages that a node wrote: checked, in order, with the times of writing.
struct Wrote {
    NodeId node;
    std::vector<Record> records;
    Ns settled = -1; ///< see RunListener::settled
};
/// See RunListener::kept.
struct Kept {
    Ns t;
    std::vector<NodeSnapshot> snapshots;
};
/// The run is over. "" if it came to its end.
struct Done {
    std::string reason;
};

} // namespace action

using Action = std::variant<action::Accept, action::Refuse, action::Send, action::ShutOut, action::Report,
                            action::Began, action::Wrote, action::Kept, action::Done>;

class Controller {
public:
    /// Throws std::invalid_argument if the configuration makes no sense.
    explicit Controller(ControllerConfig config);

    // Events. Each may add actions to the list.

    /// A program greets. The caller chooses `peer`; the answer repeats it.
    void hello(std::uint64_t peer, const Hello &hello);
    /// Why this simulation refuses any program with this greeting; "" if it accepts it.
    std::string refusal(const Hello &hello) const;
    /// A node's frame.
    void received(NodeId node, Frame frame);
    /// A node's connection is gone, its reply is late, or it sent an invalid frame.
    void lost(NodeId node, const std::string &why);
    /// The same, which for a program that has greeted as this node and not answered the first request yet is no loss:
    /// another one may take its place.
    void forget(NodeId node, const std::string &why);
    /// Whether the place of a node is taken by a program that has not answered the first request yet.
    bool only_greeted(NodeId node) const { return nodes_[node].stage == Stage::entered && !finishing() && !done(); }
    /// An asynchronous program writes. Returns why the controller refuses the message; "" if it accepts it. The message
    /// gets the first time that no reader was granted yet. Each reader sees it before the topic's next message.
    std::string inject(const std::string &program, const std::string &topic, const Payload &payload);
    /// The user asks for the end.
    void stop(const std::string &why) { finish(why); }

    /// The list of actions, to be done in this order. Empties it, and goes on with the memory of `spent`.
    std::vector<Action> take_actions(std::vector<Action> spent = {})
    {
        spent.clear();
        return std::exchange(actions_, std::move(spent));
    }

    /// A run with a past: answer some ticks of nodes that their snapshots have passed. False if there were none.
    bool play();

    /// For pacing: nodes may step up to and including this instant.
    void set_horizon(Ns horizon);
    /// The first instant after the horizon at which a node steps, or the end; for_ever if the horizon has passed the
    /// end.
    Ns next_due() const;
    /// Whether all nodes wait for a node that was lost or that joins.
    bool waiting() const;

    /// Whether the node owes a reply.
    bool waiting_for(NodeId node) const { return nodes_[node].awaited; }
    /// Whether a node that takes part has not answered yet, or its new program still repeats its ticks.
    bool busy(NodeId node) const;
    /// Marks nodes: the controller has nothing to do until one of these has finished its tick. False: the controller
    /// may have to react to any reply.
    bool unblocking_nodes(std::vector<char> &marked) const;
    /// The names of the missing nodes without which the run cannot begin or go on.
    std::vector<std::string> absent() const;
    /// All changes after the start, in their order.
    const std::vector<Change> &changes() const { return changes_; }

    /// Whether the first matching is complete.
    bool matched() const { return begun_; }
    /// All topics, by channel number.
    std::vector<Channel> channels() const { return wiring_.channels(); }

    bool running() const { return begun_ && !finishing() && !done(); }
    bool finishing() const { return phase_ == Phase::finishing; }
    bool done() const { return phase_ == Phase::done; }
    Ns reached(NodeId node) const { return nodes_[node].reached; }
    /// absent, greeted (not yet on its own socket), joining, running, left, finished or lost.
    const char *state(NodeId id) const;

private:
    /// Matching: before the run, and at each boundary where nodes join.
    enum class Phase { gathering, matching, running, finishing, done };

    template <class A> void act(A what) { actions_.emplace_back(std::in_place_type<A>, std::move(what)); }
    void report(std::string text) { act(action::Report{std::move(text)}); }
    template <class Reply> void ask(NodeId id, Message request);
    template <class Test> bool all(Test test) const { return std::all_of(nodes_.begin(), nodes_.end(), test); }
    Grants grants() const { return {config_, nodes_, wiring_, admission_.last()}; }

    void reply(NodeId id, Initialized &m);
    void reply(NodeId id, Desired &m);
    void reply(NodeId id, Matched &m);
    void reply(NodeId id, Ready &m);
    void reply(NodeId id, Tock &m);
    void reply(NodeId id, Saved &m);
    void reply(NodeId id, Finished &m);
    template <class M> void reply(NodeId id, M &m);

    // Joining and matching: controller_matching.cpp.
    void initialize(NodeId id);
    void look_at_boundary();
    void begin_matching();
    void look_at_matching();
    void connect();
    void restart_matching();
    void finish_matching();
    void resume();
    void start(NodeId id);
    void take_past(const Past &past);
    void take_initial_values(std::vector<Publication> &publications) const;

    // Steps.
    void grant(NodeId id);
    void go_on(NodeId id);
    void go_on_all();
    std::string difference_to_past(NodeState &node, const Tock &m);
    bool save_if_due(NodeId id);
    void look_at_kept();
    void drop_log_if_full(NodeState &node);
    bool paused() const;

    // A new program repeats the ticks of the lost one.
    void repeat_tick(NodeId id);
    void repeat_tock(NodeId id, const Tock &m);

    // Losses and the end.
    void lose_joiner(NodeId id, const std::string &why);
    void give_up(NodeId id, Change::What what);
    void leave(NodeId id);
    void dismiss(NodeId id, const std::string &why);
    void finish(const std::string &why);
    void finish_if_complete();
    void look_whether_done();
    bool all_over() const;

    ControllerConfig config_;
    Nodes nodes_; ///< followed by the asynchronous programs
    Wiring wiring_;
    Wiring wiring_before_; ///< the wiring before the current matching
    Admission admission_;
    Phase phase_ = Phase::gathering;
    bool begun_ = false;
    bool pauses_ = false;            ///< some node has the policy pause
    bool matching_outdated_ = false; ///< a node was lost: the matching has to begin again
    Ns boundary_ = -1;               ///< of the current or last matching
    Ns met_ = -1;                    ///< the boundary of the last completed matching
    struct Injection {
        std::string program, topic;
        Payload payload;
    };
    std::vector<Injection> injected_;                   ///< received during a matching
    std::deque<NodeId> playing_;                        ///< nodes whose tick `past` answers
    std::map<Ns, std::map<NodeId, NodeSnapshot>> kept_; ///< snapshots that wait for those of other nodes
    std::string reason_;
    std::vector<Action> actions_;
    std::vector<Change> changes_;
};

/// The index of a kind in Message.
template <class M, std::size_t I = 0> constexpr std::size_t kind_of()
{
    if constexpr (std::is_same_v<M, std::variant_alternative_t<I, Message>>) {
        return I;
    } else {
        return kind_of<M, I + 1>();
    }
}

template <class Reply> void Controller::ask(NodeId id, Message request)
{
    NodeState &node = nodes_[id];
    node.awaited = true;
    node.expected = kind_of<Reply>();
    act(action::Send{id, {++node.number, std::move(request)}});
}

} // namespace fledge::cosim
