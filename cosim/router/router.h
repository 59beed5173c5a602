// SPDX-License-Identifier: Apache-2.0
// The controller on the network: it moves frames between nodes and the Controller, and measures.
//
// One static address, where nodes greet, and one socket per node, to which the greeting leads. Nodes
// only connect. (Thesis, appendix C.)
#pragma once

#include "cosim/controller/controller.h"
#include "cosim/controller/run_listener.h"
#include "cosim/node/delegate.h"
#include "cosim/router/broker.h"
#include "cosim/router/pace.h"
#include "cosim/security/authenticator.h"
#include "cosim/transport/poller.h"
#include "cosim/transport/shared_channel.h"

#include <chrono>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>

namespace fledge::cosim {

struct RouterConfig {
    std::string address;                     ///< where nodes greet; of a TCP port "*", any free one
    std::string keys;                        ///< a folder (keys.h): only programs whose keys are there are let in
    bool unencrypted_beyond_machine = false; ///< without keys, allow an address that others can reach
    bool broker = false;                     ///< for those who watch, and for asynchronous programs (broker.h)
    std::string frontend, backend;           ///< its addresses; "": beside `address`, where there is room
    std::chrono::milliseconds join{60'000};  ///< for all nodes to be there
    std::chrono::milliseconds reply{60'000}; ///< for a node to answer, computing included; 0: for ever
    std::vector<std::chrono::milliseconds> replies; ///< the same, node by node; empty: `reply` for all
    double pace = 0.0;                              ///< simulated seconds per second; 0: as fast as possible
    std::chrono::milliseconds finish{5'000};        ///< for a node to answer the last request
    Limits limits;
    Sharing sharing = Sharing::allowed;              ///< of memory, with nodes on this machine
    std::function<void(const std::string &)> report; ///< what the user should know; may be empty
    std::vector<Witness *> witnesses;                ///< that live as long as the router
};

/// Where a node's time went [ns of wall time].
struct NodeTimes {
    std::uint64_t ticks = 0;
    Ns compute = 0;   ///< stepping, as it says
    Ns transport = 0; ///< from request to reply, less that
    Ns wait = 0;      ///< from reply to request: for others, and for the pace
    Ns asked = 0;     ///< the request that is not yet answered: how long ago; in none of the above
};

class Router {
public:
    /// Throws LinkError if the address is in use, or may be reached by others without keys; KeyError.
    Router(zmq::context_t &context, ControllerConfig controller, RouterConfig config);
    /// Ends the run, if it was left.
    ~Router();

    const std::string &address() const { return address_; }

    /// Let this program be that node itself: it is called, without a socket between. It lives until the
    /// run is over. Throws LinkError if there is no such node, or it was hosted already.
    void host(const std::string &name, Node &node);

    /// From the first greeting to the end. `poll` is called about ten times a second; false ends the
    /// run. Returns the reason of the end, "" if it is the regular one.
    std::string run(const std::function<bool()> &poll = {});

    /// Until now. The three add up to all the time since the node was ready, less `asked`.
    NodeTimes times(NodeId node) const;
    const Controller &controller() const { return controller_; }
    /// How it kept up; null: it is not paced.
    const PaceReport *pace() const { return pace_ ? &pace_->report() : nullptr; }
    /// Null if there is none.
    const Broker *broker() const { return broker_.get(); }

private:
    using Clock = std::chrono::steady_clock;
    struct Place {
        std::unique_ptr<Link> link;
        std::unique_ptr<SharedChannel> offered; ///< memory that the node has not answered for
        Node *hosted = nullptr;
        std::optional<Frame> first; ///< waits for the node to speak on its socket
        bool joined = false;
        Clock::time_point asked, answered;
        bool unsure = false; ///< whether its socket still tells of what comes: see descriptor()
        NodeTimes times;
    };

    void greet();
    void listen(NodeId id);
    void join(NodeId id, const Frame &frame);
    void act();
    template <class Call> void tell(Call call);
    Welcome open(NodeId id);
    void close(NodeId id);
    void wait(std::chrono::milliseconds most);
    bool listen_to_shared();
    void listen_again();
    bool anything_shared() const;
    bool expect();
    void call_hosted();
    void heard(NodeId id, Frame frame);
    bool keyed() const;
    ControllerConfig with_broker(ControllerConfig controller);
    void check_address(const std::string &address) const;
    void attach(const Hello &hello);
    Message attached() const;
    void answer_attaching();
    void hear_programs();
    void report(const std::string &text);
    void reply(std::span<const std::byte> peer, const Message &message);
    void look_at_clock(const std::function<bool()> &poll);

    zmq::context_t &context_;
    RouterConfig config_;
    std::string simulation_;
    std::vector<std::string> names_;
    std::unique_ptr<Gate> gate_; ///< none without keys. Outlives all sockets
    std::unique_ptr<Broker> broker_;
    std::vector<Bytes> attaching_; ///< libzmq's names of asynchronous programs that wait for the matching
    Controller controller_;
    zmq::socket_t lobby_;
    std::string address_;
    std::optional<Bell> bell_; ///< none: no memory is shared
    std::vector<Place> nodes_;
    std::optional<Pace> pace_; ///< none: as fast as possible
    Poller poller_;
    std::chrono::nanoseconds spins_{0}; ///< so long who waits looks for frames before it sleeps
    Spin spin_;
    std::vector<NodeId> sharing_; ///< who does
    std::vector<NodeId> unsure_;
    std::vector<char> decisive_;
    bool lobby_unsure_ = true;
    std::vector<Node *> hosted_;                 ///< in the order of their coming
    std::deque<std::pair<NodeId, Frame>> calls_; ///< to hosted nodes, in the order of asking
    Bytes greeting_peer_;                        ///< libzmq's name of who is being greeted
    unsigned opened_ = 0;
    Clock::time_point looked_;
    Clock::time_point complete_; ///< when all were there that the run needs, or it began
    std::string outcome_;
};

} // namespace fledge::cosim
