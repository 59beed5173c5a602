// SPDX-License-Identifier: Apache-2.0
// The controller on the network: it moves frames between nodes and the Controller, and measures times.
//
// Nodes send a Hello to one static address; the Welcome names a socket for each node. Nodes only connect. (Thesis,
// appendix C.)
//
// Example:
//
//     using namespace cosim;
//     zmq::context_t context;
//     ControllerConfig config{.simulation = "spin"};
//     config.nodes = {{.name = "world"}, {.name = "flight"}};
//     Router router(context, config, {.address = "tcp://127.0.0.1:7000"});
//     const std::string reason = router.run(); // "" for the regular end
#pragma once

#include "cosim/controller/controller.h"
#include "cosim/controller/run_listener.h"
#include "cosim/node/delegate.h"
#include "cosim/router/broker.h"
#include "cosim/router/pace.h"
#include "cosim/security/authenticator.h"
#include "cosim/transport/handshake.h"
#include "cosim/transport/poller.h"
#include "cosim/transport/shared_channel.h"

#include <chrono>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>

namespace fledge::cosim {

struct RouterConfig {
    std::string address;                            ///< for greetings; TCP port "*": any free one
    std::string keys;                               ///< a folder (keys.h): only programs with these keys may connect
    bool unencrypted_beyond_machine = false;        ///< without keys, allow an address that other machines can reach
    bool broker = false;                            ///< for observers and asynchronous programs (broker.h)
    std::string frontend, backend;                  ///< its addresses; "": free ones beside `address`
    bool any_user = false;                          ///< over "ipc://", let in other users of this machine
    std::chrono::milliseconds join{60'000};         ///< limit for all nodes to greet the controller
    std::chrono::milliseconds greet{30'000};        ///< from the Welcome to the first reply; then its place is free
                                                    ///< again. None for a node whose limit for a reply is 0
    std::chrono::milliseconds reply{60'000};        ///< limit for a reply, computing time included; 0: none
    std::vector<std::chrono::milliseconds> replies; ///< the same for each node; empty: `reply` for all
    double pace = 0.0;                              ///< simulated seconds per second; 0: as fast as possible
    bool steered = false;                           ///< the pace may change, and the run may pause: Router::steer()
    Ns window = 0; ///< without a pace, no node steps farther ahead of all: bounds what a reply holds; 0: no limit
    std::chrono::milliseconds finish{5'000}; ///< limit for the reply to the last request
    Limits limits;
    Sharing sharing = Sharing::allowed;              ///< memory with nodes on this machine
    std::function<void(const std::string &)> report; ///< messages for the user; may be empty
    std::vector<RunListener *> listeners;            ///< they outlive the router
};

/// What a user has to know of an address that other machines can reach without keys; "" for any other.
std::string warning(const RouterConfig &config);

/// How a node spent its time [ns of wall time].
struct NodeTimes {
    std::uint64_t ticks = 0;
    Ns compute = 0;   ///< spent in steps, as its tocks report; of each tock at most the time since its request
    Ns transport = 0; ///< from request to reply, without `compute`
    Ns wait = 0;      ///< from reply to the next request: for other nodes, and for the pace
    Ns pending = 0;   ///< since a request without a reply yet; not part of the above
};

class Router {
public:
    /// Throws KeyError. Throws LinkError if the address is in use, or if other machines can reach it without keys.
    Router(zmq::context_t &context, const ControllerConfig &controller, RouterConfig config);
    /// Ends the run, if it is not over.
    ~Router();

    const std::string &address() const { return address_; }

    /// Run a node in this program: the router calls it without a socket. `node` has to live until the run is over.
    /// Throws LinkError if there is no node of this name, or if it is hosted already.
    void host(const std::string &name, Node &node);

    /// From the first greeting to the end. `poll` is called about ten times a second; false ends the run. Returns the
    /// reason of the end, "" for the regular end.
    std::string run(const std::function<bool()> &poll = {});

    /// The times until now. Their sum is the time since the node was ready.
    NodeTimes times(NodeId node) const;
    const Controller &controller() const { return controller_; }
    /// Delays of a paced run; null without a pace.
    const PaceReport *pace() const { return pace_ ? &pace_->report() : nullptr; }
    /// To change the pace, from `poll`; null unless the run is steered.
    Pace *steer() { return config_.steered ? &*pace_ : nullptr; }
    const Pace *steer() const { return config_.steered ? &*pace_ : nullptr; }
    /// Wait no longer for complete observers of this program that have not come yet.
    void go_without(const std::string &program) { awaited_.erase(program); }
    /// Null without a broker.
    const Broker *broker() const { return broker_.get(); }

private:
    using Clock = std::chrono::steady_clock;
    struct NodeSlot {
        std::unique_ptr<Link> link;
        std::unique_ptr<SharedChannel> proposed; ///< shared memory that the node has not accepted yet
        Node *hosted = nullptr;
        std::optional<Frame> first;           ///< the first request, until the node's first frame on its socket
        bool joined = false, replied = false; ///< it has taken its socket; it has replied on it
        int greeting_fd = -1;                 ///< of the connection on which it greeted,
        std::uint64_t greeting = 0;           ///< and its number
        Clock::time_point welcomed, requested, answered;
        bool unsure = false; ///< its descriptor may miss a frame: see descriptor()
        NodeTimes times;
    };

    void greet();
    void hear(const Hello &hello);
    void hear_waiting();
    void check_greeting_programs();
    void listen(NodeId id);
    void check_connection(NodeId id);
    void check_limits(NodeId id);
    std::chrono::milliseconds reply_limit(NodeId id) const;
    void join(NodeId id, const Frame &frame);
    void act();
    template <class Call> void notify(Call call);
    Welcome open(NodeId id);
    std::string bind(Link &link);
    void close(NodeId id);
    void wait(std::chrono::milliseconds most);
    bool listen_to_shared();
    void listen_again();
    bool anything_shared() const;
    bool choose_waking_nodes();
    void call_hosted();
    void received(NodeId id, Frame &&frame);
    bool keyed() const;
    ControllerConfig with_broker(ControllerConfig controller);
    void check_address(const std::string &address) const;
    void attach(const Hello &hello);
    Message attached(const std::string &program) const;
    bool holds(std::chrono::steady_clock::time_point now);
    void answer_attaching();
    void inject_messages();
    void report(const std::string &text);
    void reply(std::span<const std::byte> peer, const Message &message);
    void check_periodically(const std::function<bool()> &poll);

    zmq::context_t &context_;
    RouterConfig config_;
    std::string simulation_;
    std::vector<std::string> names_;
    std::unique_ptr<Authenticator> authenticator_; ///< null without keys; outlives all sockets
    std::unique_ptr<Broker> broker_;
    std::vector<std::pair<Bytes, std::string>> attaching_; ///< libzmq's and their names of asynchronous programs that
                                                           ///< wait for the matching
    std::vector<std::string> complete_programs_;           ///< asynchronous programs that miss no message
    std::map<std::string, unsigned> awaited_;              ///< so many observers of these, before the run begins
    std::chrono::steady_clock::time_point began_;          ///< the run, which then waits for them
    Controller controller_;
    zmq::socket_t greetings_;
    Connections greeters_;
    std::string address_;
    std::optional<WakeUp> wake_up_; ///< none: no shared memory
    std::vector<NodeSlot> nodes_;
    std::optional<Pace> pace_; ///< none: as fast as possible
    Poller poller_;
    std::chrono::nanoseconds busy_wait_{0}; ///< duration of busy waiting before a sleep
    Spin spin_;
    std::vector<NodeId> sharing_; ///< nodes with shared memory
    std::vector<NodeId> unsure_;
    std::vector<char> unblocking_;
    std::vector<Action> actions_; ///< of act()
    bool greetings_unsure_ = true;
    std::vector<Node *> hosted_;                 ///< in the order of host()
    std::deque<std::pair<NodeId, Frame>> calls_; ///< requests to hosted nodes
    Bytes greeting_peer_;                        ///< libzmq's name of the greeting program
    int greeting_fd_ = -1;                       ///< of its connection
    struct Waiting {
        Hello hello;
        Bytes peer;
        int fd;
    };
    std::vector<Waiting> waiting_; ///< greetings for places of programs that have only greeted
    unsigned opened_ = 0;
    Clock::time_point checked_;
    Clock::time_point complete_; ///< the last time at which no node was missing
    std::string outcome_;
};

} // namespace fledge::cosim
