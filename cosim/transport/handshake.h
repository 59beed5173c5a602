// SPDX-License-Identifier: Apache-2.0
// What libzmq's monitor says about the connections of a socket.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <zmq.hpp>

namespace fledge::cosim {

/// Watches a socket that connects, and notices refusals: libzmq itself would try for ever.
class Handshake {
public:
    /// any_user: over "ipc://", the other side may be of another user of this machine.
    Handshake(zmq::context_t &context, zmq::socket_t &socket, bool keyed, bool any_user);
    ~Handshake();
    Handshake(const Handshake &) = delete;
    Handshake &operator=(const Handshake &) = delete;

    /// Whether the connection is made in time. Throws LinkError if the other side, `where`, refuses this program, or
    /// is of another user.
    bool connect(std::chrono::milliseconds most, const std::string &where, const std::string &program);
    /// Whether the socket gets a message in time. Throws LinkError likewise.
    bool receive(zmq::message_t &message, std::chrono::milliseconds most, const std::string &where,
                 const std::string &program);
    /// Whether the connection is made.
    bool made() const { return made_; }
    /// Whether it was made, and has been lost for this time. libzmq tries to connect again.
    bool gone_for(std::chrono::milliseconds time) const
    {
        return lost_ && !made_ && std::chrono::steady_clock::now() - *lost_ >= time;
    }

private:
    template <class Condition>
    bool wait(Condition over, std::chrono::milliseconds most, const std::string &where, const std::string &program);
    void read_events();

    zmq::socket_t &socket_;
    zmq::socket_t monitor_;
    bool keyed_, any_user_, made_ = false;
    std::optional<std::chrono::steady_clock::time_point> lost_;
    int broken_off_ = 0;
    std::string failure_;
};

/// The connections of a bound socket.
class Connections {
public:
    Connections(zmq::context_t &context, zmq::socket_t &socket);
    ~Connections();
    Connections(const Connections &) = delete;
    Connections &operator=(const Connections &) = delete;

    /// The number of the open connection with this descriptor (ZMQ_SRCFD of a message); 0: there is none. A number
    /// stands for one connection only, as a descriptor does not.
    std::uint64_t number(int fd);
    /// To poll for changes; see link.h.
    zmq::socket_t &events() { return monitor_; }

private:
    zmq::socket_t &socket_;
    zmq::socket_t monitor_;
    std::map<int, std::uint64_t> open_;
    std::uint64_t last_ = 0;
};

/// A socket that receives the connection events of `socket`.
zmq::socket_t monitor(zmq::context_t &context, zmq::socket_t &socket);

/// The kind and value of the next event on a monitor's socket; false if there is none.
bool next_event(zmq::socket_t &monitor, std::uint16_t &kind, std::uint32_t &value);

/// What an event says, if it means that the other side refuses a socket; "" otherwise.
std::string refusal(std::uint16_t kind, std::uint32_t value, bool keyed);

} // namespace fledge::cosim
