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

#include "cosim/protocol/protocol.h"

#include <deque>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

namespace fledge::cosim {

/// What to do when a node is lost during the run. Before its first tick, a loss ends it.
enum class Policy {
    abort,   ///< end the run
    pause,   ///< let nobody step until the node is back
    hold,    ///< go on; its messages keep their last values
    drop,    ///< go on; its messages become all zero, which is "never written"
    restart, ///< another program of its name goes on from its last snapshot, and nobody sees it
};

/// When a node takes part.
enum class Join {
    at_start,      ///< the run does not begin without it
    at_time,       ///< the run waits for it at NodeConfig::joins_after
    when_it_comes, ///< at the first time to which all others can go together, or never
};

struct NodeConfig {
    std::string name;
    Policy on_loss = Policy::abort;
    Join joins = Join::at_start;
    Ns joins_after = -1;          ///< at_time: it begins after this instant
    bool rejoins = false;         ///< one that left or was given up (hold, drop) may come again
    Ns save_every = 0;            ///< of simulated time, from one snapshot to the next; 0: where there is need
    std::vector<Rate> steps = {}; ///< as it has to step; empty: as it says itself
};

/// A program that steps with nobody (a ground system): what it writes enters when it comes.
struct AsynchronousConfig {
    std::string name;
    std::vector<std::string> topics = {}; ///< that it writes, if nodes want them; empty: all "/NAME/..."
};

inline constexpr Ns for_ever = std::numeric_limits<Ns>::max();

struct ControllerConfig {
    std::string simulation;
    std::vector<NodeConfig> nodes;
    Ns end = 0; ///< the last instant
    std::uint64_t seed = 0;
    std::string frontend, backend;            ///< of the broker, handed on to the nodes
    std::uint32_t batch = 1000;               ///< most instants in one tick
    std::uint32_t ahead = 4096;               ///< most messages that wait for one reader; at least 4
    bool tell = false;                        ///< give Began and Wrote, for records and for those who watch
    std::size_t log = std::size_t{256} << 20; ///< most bytes that are kept for one that is to be restarted
    std::vector<AsynchronousConfig> asynchronous = {};
    std::vector<std::string> watched = {}; ///< topics that are written even if no node wants them
    Ns horizon = for_ever;                 ///< nobody goes beyond it: for pacing, see set_horizon()
};

/// Who takes part, and what passes between them.
struct Exchange {
    struct Member {
        std::string name;
        bool present = true; ///< it takes part
        std::vector<Rate> rates;
        bool any_time = false;
        std::vector<Want> wants; ///< optional ones that nobody writes included
    };
    struct Topic {
        std::string name;
        Schema schema;
        std::string writer; ///< a node's name; "" if there is none
        Bytes initial;      ///< payload: what it holds at the beginning
    };
    Ns after = -1; ///< it holds after this instant; -1: from the reset on
    std::vector<Member> members;
    std::vector<Topic> topics; ///< by channel number
};

/// A node's place in ControllerConfig::nodes.
using NodeId = std::size_t;

/// Who came or went, and after which instant. What the others see follows from these alone: with
/// Join::at_time and a node that leaves at the same instants, the run is the same again.
struct Change {
    enum What { joined, left, given_up, back };
    What what;
    NodeId node;
    Ns after;
};

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
/// All have been matched, and step from here on; it comes again where nodes have joined.
struct Began {
    Exchange exchange;
};
/// What a node wrote, in order; it has been found good. The times are those of writing.
struct Wrote {
    NodeId node;
    std::vector<Record> records;
    Ns settled = -1; ///< no node will write up to and including this instant any more; unless, after
                     ///< one was lost, another comes
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
    /// An asynchronous program writes. Returns why it may not; "" if it may. All readers see it as of the
    /// first time that none of them was granted yet, and before the next message of the topic.
    std::string inject(const std::string &program, const std::string &topic, const Bytes &payload);
    /// The user asks for the end.
    void stop(const std::string &why);

    /// What is to be done, in this order. Empties the list.
    std::vector<Action> take_actions() { return std::exchange(actions_, {}); }

    /// For pacing: let the nodes go on, up to and including this instant.
    void set_horizon(Ns horizon);
    /// The first instant after the horizon at which a node steps, or the end; for_ever if it is behind.
    Ns next_due() const;
    /// The first instant after t at which the node steps, as it said.
    Ns next_after(NodeId node, Ns t) const { return nodes_[node].next_after(t); }
    /// Whether all stand still for one that is lost or joins.
    bool waiting() const;

    /// Whether the node owes a reply; how long it may, is for the caller to know.
    bool waiting_for(NodeId node) const { return nodes_[node].awaited; }
    /// Marks some of the nodes that owe a tock, so that nothing is to be done until one of these has
    /// answered with a whole tick: who waits for tocks need not wake for the others. False: all count.
    bool decisive(std::vector<char> &nodes) const;
    /// The names of the nodes that are not there, and without which the run cannot begin or go on.
    std::vector<std::string> absent() const;
    /// All comings and goings after the start, in their order.
    const std::vector<Change> &changes() const { return changes_; }

    /// Whether the nodes know one another's messages.
    bool matched() const { return begun_; }
    /// All topics, by channel number.
    std::vector<Channel> channels() const;

    bool running() const { return begun_ && !finishing() && !done(); }
    bool finishing() const { return phase_ == Phase::finishing; }
    bool done() const { return phase_ == Phase::done; }
    Ns reached(NodeId node) const { return nodes_[node].reached; }
    /// Where a node is, in a word: absent, joining, running, left, finished, lost.
    const char *state(NodeId node) const;

private:
    /// Matching: before the run, and at each boundary where nodes join.
    enum class Phase { gathering, matching, running, finishing, done };
    /// Where a node is. From `entered` to `matched` they wait for one another.
    enum class Stage {
        absent,
        entered,
        initialized,
        desired,
        matched,
        idle,
        ticking,
        saving,
        dismissed, ///< asked to finish, while the run goes on
        finished,
        lost,
    };

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
        std::uint32_t count = 0;     ///< sent since the last Start
        Bytes last;                  ///< what the reader has passed: for one that comes back
    };
    struct Topic {
        std::string name;
        Schema schema;
        std::optional<NodeId> writer;
        Bytes initial;
        Ns since = -1;             ///< the writer was asked for it after this instant
        std::uint32_t count = 0;   ///< written since the last Start
        Ns last = -1;              ///< when it was written
        std::deque<Pending> ahead; ///< written at times that some have not reached, by no node's step
        Bytes held;                ///< what it holds until then
        std::vector<std::size_t> wires;
        std::vector<NodeId> wanted_by;
    };
    struct Node {
        NodeConfig config;
        Stage stage = Stage::absent;
        bool asynchronous = false; ///< no node, but what writes a topic; it is always over()
        bool member = false;       ///< it takes part
        bool been = false;         ///< it took part, now or before
        bool joining = false;      ///< it will, from the next boundary on
        bool matching = false;     ///< it takes part in the matching that is going on
        bool returning = false;    ///< it was lost, and must be what it was
        std::uint32_t number = 0;  ///< of the last request
        bool awaited = false;      ///< whether the reply to it is owed
        std::size_t expected = 0;  ///< the kind of the reply
        std::vector<Rate> rates;
        bool any_time = false, saves = false;
        std::vector<Want> wants;
        std::vector<Offer> offers;
        std::vector<std::size_t> in, out; ///< wires
        std::size_t waits_for = 0;        ///< in `in`: what blocked it last
        Ns reached = -1, until = -1;

        // What another program of its name needs to take its place.
        bool kept = false; ///< all of it is there
        Bytes snapshot;
        Ns saved = -1;                                     ///< the time of the snapshot; without one, of its beginning
        std::vector<Record> told;                          ///< what it was sent and sees after `saved`
        std::map<std::uint32_t, std::vector<Record>> said; ///< what it wrote after it, by channel
        std::size_t logged = 0;                            ///< bytes of the two
        std::size_t told_again = 0;                        ///< so many of `told`
        std::map<std::uint32_t, std::size_t> said_again;
        Ns replayed = -1; ///< as `reached`, of the one that comes back
        int tries = 0;    ///< restarts since it last went further

        Ns next_after(Ns t) const; ///< the first instant after t
        Ns safe() const;           ///< the first instant at which it may still write
        bool connected() const;
        bool over() const { return !member || stage == Stage::finished; } ///< it writes nothing more
        /// It has not come yet, and the run waits for it at its time.
        bool scheduled() const { return config.joins == Join::at_time && !been; }
    };

    void reply(NodeId id, Initialized &m);
    void reply(NodeId id, Desired &m);
    void reply(NodeId id, Matched &m);
    void reply(NodeId id, Ready &m);
    void reply(NodeId id, Tock &m);
    void reply(NodeId id, Saved &m);
    void reply(NodeId id, Finished &m);
    template <class M> void reply(NodeId id, M &m);

    template <class Request, class Reply> void send(NodeId id, Request request);
    void ask(NodeId id, Message request, std::size_t kind_of_reply);
    void initialize(NodeId id);
    void lose_joiner(NodeId id, const std::string &why);
    void give_up(NodeId id);
    void leave(NodeId id);
    void dismiss(NodeId id, const std::string &why);
    void finish(const std::string &why);
    void finish_if_complete();
    void look_whether_done();
    bool all_at(Stage stage) const;
    bool all_over() const;
    bool paused() const;
    template <class A> void act(A what) { actions_.emplace_back(std::in_place_type<A>, std::move(what)); }
    void report(std::string text) { act(action::Report{std::move(text)}); }

    // controller_matching.cpp
    void look_for_joiners();
    void set_last();
    bool due(const Node &node) const;
    bool all_met() const;
    void look_at_boundary();
    void begin_matching();
    void look_at_matching();
    void match();
    void spoil_matching();
    void resume();
    void start(NodeId id);

    // controller_wiring.cpp
    void number_topics();
    void ask_for_match(NodeId id);
    void take_offers(NodeId id);
    void connect();
    void list_wires();
    const Bytes &value(const Topic &topic, Ns t) const;
    std::string find_cycle() const;
    Exchange exchange() const;
    Ns settled() const;

    // controller_restart.cpp
    bool save_if_due(NodeId id);
    void keep_told(Node &node, const std::vector<Record> &records);
    void keep_said(Node &node, const std::vector<Record> &records);
    void look_at_log(NodeId id);
    void tell_again(NodeId id);
    void hear_again(NodeId id, const Tock &m);
    void come_back(NodeId id);

    // controller_asynchronous.cpp
    void take_asynchronous();
    Ns earliest(const Wire &wire) const;

    // controller_ticks.cpp
    std::string fault_of(NodeId id, const Tock &m) const;
    void push(Wire &wire, Ns written, const Bytes &payload);
    void write_ahead(Topic &topic, Ns written, const Bytes &payload);
    void grant(NodeId id);
    void grant_all();
    void grant_around(NodeId id);
    Ns bound(const Wire &wire) const;
    bool blocked(Node &node) const;
    Ns limit(const Node &node) const;
    bool complete(const Node &node, Ns t) const;

    ControllerConfig config_;
    std::vector<Node> nodes_;
    std::vector<Topic> topics_; ///< by channel number, which is the order of their names at each matching
    std::map<std::string, std::uint32_t> channels_; ///< by topic
    std::vector<Wire> wires_;
    std::vector<Action> actions_;
    std::vector<Change> changes_;
    Phase phase_ = Phase::gathering;
    bool begun_ = false;
    std::string reason_, faults_;

    Ns horizon_ = for_ever, last_ = 0; ///< nobody goes beyond last_, by end, horizon and boundary
    std::optional<Ns> called_;         ///< where all meet for those who came of themselves
    std::optional<Ns> boundary_;       ///< where all meet next
    struct Injection {
        std::string program, topic;
        Bytes payload;
    };
    std::vector<Injection> injected_; ///< while nodes are matched
    Ns met_ = -1;                     ///< the last boundary
    Ns meeting_ = -1;                 ///< that of the matching that is going on
    bool spoilt_ = false;             ///< the matching has to be done again
    struct {
        std::vector<Topic> topics;
        std::map<std::string, std::uint32_t> channels;
        std::vector<Wire> wires;
    } before_; ///< the matching that is going on
};

} // namespace fledge::cosim
