// SPDX-License-Identifier: Apache-2.0
// What libzmq's monitor says about the connections of a socket.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <zmq.hpp>

namespace fledge::cosim {

/// Watches a socket that connects, and notices refusals: libzmq itself would try for ever.
class Handshake {
public:
    Handshake(zmq::context_t &context, zmq::socket_t &socket, bool keyed);
    ~Handshake();
    Handshake(const Handshake &) = delete;
    Handshake &operator=(const Handshake &) = delete;

    /// Whether the socket gets a message in time. Throws LinkError if the other side, `where`, refuses this program.
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
    void read_events();

    zmq::socket_t &socket_;
    zmq::socket_t monitor_;
    bool keyed_, made_ = false;
    std::optional<std::chrono::steady_clock::time_point> lost_;
    int broken_off_ = 0;
    std::string failure_;
};

/// A socket that receives the connection events of `socket`.
zmq::socket_t monitor(zmq::context_t &context, zmq::socket_t &socket);

/// The kind and value of the next event on a monitor's socket; false if there is none.
bool next_event(zmq::socket_t &monitor, std::uint16_t &kind, std::uint32_t &value);

/// What an event says, if it means that the other side refuses a socket; "" otherwise.
std::string refusal(std::uint16_t kind, std::uint32_t value, bool keyed);

} // namespace fledge::cosim
