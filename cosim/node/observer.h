// SPDX-License-Identifier: Apache-2.0
// A program that steps with nobody: a viewer, a ground system. It comes and goes as it likes, sees what nodes
// write, and may write what nodes read and the controller's configuration says comes from it. The run
// never waits for it, so what it does not take in time it misses, and is told how much.
//
//     Observer observer(context, {"nadir_spin", "viewer"});
//     observer.subscribe("/world/");
//     while (auto seen = observer.next(1s)) { ... }
//
// An observer is one thread's, but write() may be called by another.
#pragma once

#include "cosim/transport/greeting.h"

#include <chrono>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

namespace fledge::cosim {

/// What is not given is as FLEDGE_SIMULATION, FLEDGE_NODE, FLEDGE_ADDRESS and FLEDGE_KEYS say.
struct ObserverConfig {
    std::string simulation = {}, name = {};
    std::string address = {};                   ///< of the controller
    std::chrono::milliseconds patience{60'000}; ///< for the controller to be there, and the nodes to have met
    std::string keys = {};                      ///< a folder or file
    Limits limits = {};
    int waiting = 1000; ///< most messages that wait here
};

/// A message of some node, as it was written.
struct Observed {
    std::string topic, node;
    Ns t = 0;                 ///< of writing; -1: before the first step
    std::uint32_t count = 0;  ///< on its topic; 0: what the topic held at the beginning
    std::uint32_t missed = 0; ///< messages between the one seen before and this one
    Bytes payload;
};

class Observer {
public:
    /// Returns when the nodes have met. Throws LinkError, KeyError.
    Observer(zmq::context_t &context, ObserverConfig config);
    ~Observer();
    Observer(const Observer &) = delete;
    Observer &operator=(const Observer &) = delete;

    /// See all topics that begin like this; "": all. Of each the last comes at once.
    void subscribe(const std::string &prefix);

    /// The next message. Nothing if none comes in time, or the run is over. Throws LinkError if the
    /// controller is gone.
    std::optional<Observed> next(std::chrono::milliseconds most);

    /// Write a message, all of whose bytes are here (a payload, protocol.h). Throws LinkError if the topic is
    /// unknown, the payload of the wrong size, or the controller takes no more.
    void write(const std::string &topic, const Bytes &payload);

    /// All topics that there were when it was last asked.
    const std::map<std::string, Schema> &topics() const { return topics_; }
    /// What it looks like. Throws LinkError if there is no such topic, even now.
    const Schema &schema(const std::string &topic);

    bool over() const { return over_; }
    const std::string &reason() const { return reason_; } ///< of the end; "" at the regular one
    std::uint64_t missed() const { return missed_; }      ///< messages, of all topics

private:
    struct Place {
        std::uint32_t count = 0;
        Ns t = -2;
    };

    void attach();
    void connect(zmq::socket_t &socket, const std::string &address);
    bool receive(std::optional<Observed> &observed);
    void prepare_writing();

    zmq::context_t &context_;
    ObserverConfig config_;
    std::optional<ClientKeys> keys_;
    std::string frontend_, backend_;
    std::map<std::string, Schema> topics_;
    zmq::socket_t seen_;
    Handshake handshake_;
    std::map<std::string, Place> places_; ///< by topic: what was seen last
    std::uint64_t missed_ = 0;
    bool over_ = false;
    std::string reason_;

    std::mutex mutex_; ///< of what follows
    zmq::socket_t written_;
    bool writing_ = false;
    std::map<std::string, std::pair<std::uint32_t, std::uint32_t>> outputs_; ///< size and count
};

} // namespace fledge::cosim
