// SPDX-License-Identifier: Apache-2.0
// How a program reaches a controller: it takes missing options from its environment, sends a Hello to the one
// static address, and gets a Welcome or a reason.
#pragma once

#include "cosim/security/keys.h"
#include "cosim/transport/handshake.h"
#include "cosim/transport/link.h"

#include <atomic>
#include <chrono>
#include <optional>
#include <string>

namespace fledge::cosim {

/// A program's name and how it connects. Empty strings are taken from FLEDGE_SIMULATION, FLEDGE_NODE,
/// FLEDGE_ADDRESS and FLEDGE_KEYS.
struct MemberConfig {
    std::string simulation = {}, node = {};
    std::string address = {};                          ///< of the controller
    std::chrono::milliseconds connect_timeout{60'000}; ///< for its answer; to an observer it answers after matching
    Limits limits = {};
    std::string keys = {};              ///< a folder or file (keys.h)
    Sharing sharing = Sharing::allowed; ///< nodes: of memory, with a controller on this machine
    int waiting = 1000;                 ///< observers: most messages in the queue
    bool any_user = false;              ///< over "ipc://", the controller may be of another user; FLEDGE_ANY_USER=1
    const std::atomic<bool> *stopped = nullptr; ///< nodes: true ends the wait for the controller with LinkError
};

/// Fill in simulation, node, address and any_user from the environment. Throws LinkError.
void ask_environment(MemberConfig &config);

/// A program that takes part in a simulation.
struct Member {
    /// Throws KeyError, and LinkError if neither the configuration nor the environment has an address.
    Member(zmq::context_t &context, MemberConfig config, Role role);

    /// The controller's answer. The connection stays open until hang_up(): until then, its loss is the program's.
    /// Throws ProtocolError, and LinkError if the controller refuses, does not accept the key, or does not answer in
    /// time.
    template <class Answer> Answer greet()
    {
        Frame frame = ask();
        if (auto *answer = std::get_if<Answer>(&frame.message)) {
            return std::move(*answer);
        }
        throw ProtocolError(std::string("the controller answers a Hello with ") + kind_name(frame.message));
    }

    /// Close the connection on which it greeted.
    void hang_up() { greetings_.reset(); }

    /// Connect with this program's keys and limits. `peer`: "the controller at ". Throws LinkError.
    void connect(zmq::socket_t &socket, const char *peer, const std::string &address) const;

    /// A controller that listens at all addresses does not know its host name: take it from the configuration.
    std::string reachable(const std::string &address) const;

    zmq::context_t &context;
    MemberConfig config;
    std::optional<ClientKeys> keys;
    Hello hello;

private:
    Frame ask();

    std::optional<zmq::socket_t> greetings_;
};

} // namespace fledge::cosim
