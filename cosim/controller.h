// SPDX-License-Identifier: Apache-2.0
// The controller's mind: who is there, who reads whose messages, who may step how far. It has no
// socket and no clock. What happens is told to it; what is to be done, it gives back as actions. So
// every order of events can be tried by a test.
//
// A node may step through all instants for which its inputs are known. With s the first instant at
// which a producer may still write, a consumer may go, by the latency of the wire,
//
//     same_instant    until s - 1
//     next_instant    until s
//     next_exchange   until E + X, with E the last multiple of X before s,
//
// where X is the longest period of the two. The least of these is its grant. From that follows all
// the rest: producers step before their consumers, nodes joined by exchanges side by side, fast nodes
// many times in one tick while a slow one has nothing to say. The order of replies changes how
// instants are grouped into ticks, but never what a node sees at an instant.
#pragma once

#include "cosim/protocol.h"

#include <deque>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

namespace fledge::cosim {

/// What to do when a node is lost during the run. Before its first tick, a loss ends it.
enum class Policy {
    abort, ///< end the run
    pause, ///< let nobody step until the node is back
    hold,  ///< go on; its messages keep their last values
    drop,  ///< go on; its messages become all zero, which is "never written"
};

struct NodeConfig {
    std::string name;
    Policy on_loss = Policy::abort;
};

struct ControllerConfig {
    std::string simulation;
    std::vector<NodeConfig> nodes;
    Ns end = 0; ///< the last instant
    std::uint64_t seed = 0;
    std::string frontend, backend; ///< of the broker, handed on to the nodes
    std::uint32_t batch = 1000;    ///< most instants in one tick
    std::uint32_t ahead = 4096;    ///< most messages that wait for one reader; at least 4
    bool tell = false;             ///< give Began and Wrote, for records and for those who watch
};

/// Who takes part, and what passes between them.
struct Exchange {
    struct Member {
        std::string name;
        std::vector<Rate> rates;
        bool any_time = false;
        std::vector<Want> wants; ///< optional ones that nobody writes included
    };
    struct Topic {
        std::string name;
        Schema schema;
        std::string writer; ///< a node's name; "" if there is none
        Bytes initial;      ///< payload
    };
    Ns after = -1; ///< it holds after this instant; -1: from the reset on
    std::vector<Member> members;
    std::vector<Topic> topics; ///< by channel number
};

/// A node's place in ControllerConfig::nodes.
using NodeId = std::size_t;

namespace action {

/// Let a program in as this node: open its socket, welcome it there.
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
/// Close the socket of a node, which was lost or broke the rules.
struct ShutOut {
    NodeId node;
    std::string reason;
};
/// Something that the user should know.
struct Report {
    std::string text;
};
/// All have been matched, and step from here on.
struct Began {
    Exchange exchange;
};
/// What a node wrote, in order; it has been found good. The times are those of writing.
struct Wrote {
    NodeId node;
    std::vector<Record> records;
};
/// All is over. "" if the run came to its end.
struct Done {
    std::string reason;
};

} // namespace action

using Action = std::variant<action::Accept, action::Refuse, action::Send, action::ShutOut, action::Report,
                            action::Began, action::Wrote, action::Done>;

class Controller {
public:
    /// Throws std::invalid_argument if the configuration makes no sense.
    explicit Controller(ControllerConfig config);

    // What happens. Each may leave actions.

    /// A program asks to be let in. `peer` is the caller's own name for it.
    void hello(std::uint64_t peer, const Hello &hello);
    /// A node's frame.
    void received(NodeId node, Frame frame);
    /// A node is gone, is late, or sent what is no frame.
    void lost(NodeId node, const std::string &why);
    /// The user asks for the end.
    void stop(const std::string &why);

    /// What is to be done, in this order. Empties the list.
    std::vector<Action> take_actions() { return std::exchange(actions_, {}); }

    /// Whether the node owes a reply; how long it may, is for the caller to know.
    bool waiting_for(NodeId node) const { return nodes_[node].awaited; }
    /// The names of the nodes that are not there yet.
    std::vector<std::string> absent() const;

    bool running() const { return phase_ == Phase::running; }
    bool finishing() const { return phase_ == Phase::finishing; }
    bool done() const { return phase_ == Phase::done; }
    Ns reached(NodeId node) const { return nodes_[node].reached; }
    /// Where a node is, in a word: absent, joining, running, finished, lost.
    const char *state(NodeId node) const;

private:
    enum class Phase { gathering, running, finishing, done };
    /// Where a node is. From `entered` to `matched` they wait for one another.
    enum class Stage { absent, entered, initialized, desired, matched, idle, ticking, finished, lost };

    struct Pending {
        Ns t; ///< the first instant that may see it
        Bytes payload;
    };
    /// From a channel to one reader.
    struct Wire {
        std::uint32_t channel;
        NodeId from, to;
        Latency latency;
        Ns exchange = 0;             ///< its period
        std::deque<Pending> pending; ///< in order of t, until the reader has passed them
        std::size_t delivered = 0;   ///< so many of them were sent
        std::uint32_t count = 0;     ///< sent since the reader began
        Bytes last;                  ///< what the reader has passed: for one that comes back
    };
    struct Topic {
        std::string name;
        Schema schema;
        std::optional<NodeId> writer;
        Bytes initial;
        std::uint32_t count = 0; ///< written since the writer began
        Ns last = -1;            ///< when it was written
        std::vector<std::size_t> wires;
    };
    struct Node {
        NodeConfig config;
        Stage stage = Stage::absent;
        std::uint32_t number = 0;  ///< of the last request
        bool awaited = false;      ///< whether the reply to it is owed
        std::size_t expected = 0;  ///< the kind of the reply
        std::vector<Rate> rates;
        bool any_time = false;
        std::vector<Want> wants;
        std::vector<std::size_t> in, out; ///< wires
        Ns reached = -1, until = -1;
        bool returning = false; ///< it was lost, and must be what it was

        Ns next_after(Ns t) const; ///< the first instant after t
        Ns safe() const;           ///< the first instant at which it may still write
        bool connected() const;
        bool over() const;         ///< it will write nothing more, and the others go on
    };

    void reply(NodeId id, Initialized &m);
    void reply(NodeId id, Desired &m);
    void reply(NodeId id, Matched &m);
    void reply(NodeId id, Ready &m);
    void reply(NodeId id, Tock &m);
    void reply(NodeId id, Finished &m);
    template <class M> void reply(NodeId id, M &m);

    template <class Request, class Reply> void send(NodeId id, Request request);
    void finish(const std::string &why);
    void finish_if_complete();
    void look_whether_done();
    bool all_at(Stage stage) const;
    bool paused() const;

    void number_topics();
    void ask_for_match(NodeId id);
    void take_offers(NodeId id, const Matched &m, std::string &faults);
    void connect();
    std::string find_cycle() const;
    void start(NodeId id);
    Exchange exchange() const;

    std::string fault_of(NodeId id, const Tock &m) const;
    void push(Wire &wire, Ns written, const Bytes &payload);
    void grant(NodeId id);
    void grant_around(NodeId id);
    Ns limit(const Node &node) const;
    bool complete(const Node &node) const;

    ControllerConfig config_;
    std::vector<Node> nodes_;
    std::vector<Topic> topics_; ///< by channel number, which is the order of their names
    std::vector<Wire> wires_;
    std::vector<Action> actions_;
    Phase phase_ = Phase::gathering;
    std::string reason_, faults_;
};

} // namespace fledge::cosim
