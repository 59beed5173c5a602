// SPDX-License-Identifier: Apache-2.0
// A program that does not step: a viewer, a ground system. It comes and goes at any time, sees what nodes write, and
// may write the topics that the controller's configuration assigns to it. The run never waits for it: it misses the
// messages that it does not take in time, and gets their number.
//
//     Observer observer(context, {.simulation = "nadir_spin", .node = "viewer"});
//     observer.subscribe("/world/");
//     while (auto seen = observer.next(1s)) { ... }
//
// One thread uses an observer; another thread may call write().
#pragma once

#include "cosim/transport/greeting.h"

#include <chrono>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

namespace fledge::cosim {

/// A message of some node, as it was written.
struct Observed {
    std::string topic, node;
    Ns t = 0;                 ///< of writing; -1: before the first step
    std::uint32_t count = 0;  ///< on its topic; 0: the initial value
    std::uint32_t missed = 0; ///< messages between the one seen before and this one
    Payload payload;
};

class Observer {
public:
    /// Returns when the nodes have met. Throws LinkError, KeyError.
    Observer(zmq::context_t &context, MemberConfig config);

    /// Subscribe to all topics with this prefix. The last message of each comes at once.
    void subscribe(const std::string &prefix);

    /// The next message. Nothing after a timeout, or if the run is over. Throws LinkError if the controller is gone.
    std::optional<Observed> next(std::chrono::milliseconds most);

    /// Write a message. Throws LinkError if the topic is unknown, the payload has the wrong size, or the controller
    /// takes no more.
    void write(const std::string &topic, const Payload &payload);

    /// All topics, as of the last request to the controller.
    const std::map<std::string, Schema> &topics() const { return topics_; }
    /// The definition of a topic. Asks the controller if it is new. Throws LinkError if there is none.
    const Schema &schema(const std::string &topic);

    bool over() const { return over_; }
    const std::string &reason() const { return reason_; } ///< of the end; "" at the regular one
    std::uint64_t missed() const { return missed_; }      ///< messages, of all topics

private:
    struct Position {
        std::uint32_t count = 0;
        Ns t = -2;
    };

    void attach();
    std::optional<Observed> read(zmq::message_t topic);
    void prepare_writing();

    Member member_;
    std::string frontend_, backend_;
    std::map<std::string, Schema> topics_;
    zmq::socket_t seen_;
    Handshake handshake_;
    std::map<std::string, Position> positions_; ///< of the last message seen, by topic
    std::uint64_t missed_ = 0;
    bool over_ = false;
    std::string reason_;

    std::mutex mutex_; ///< of what follows
    zmq::socket_t written_;
    bool writing_ = false;
    std::map<std::string, std::pair<std::uint32_t, std::uint32_t>> outputs_; ///< size and count
};

} // namespace fledge::cosim
