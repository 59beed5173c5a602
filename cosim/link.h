// SPDX-License-Identifier: Apache-2.0
// One controller and one node on a pair of sockets: frames, and whether the other side is still there.
#pragma once

#include "cosim/protocol.h"

#include <chrono>
#include <span>
#include <stdexcept>
#include <string>
#include <zmq.hpp>

namespace fledge::cosim {

/// A connection that cannot be made or is gone.
class LinkError : public std::runtime_error {
    using runtime_error::runtime_error;
};

/// libzmq's addresses: "tcp://127.0.0.1:7000", "ipc://@name" (an abstract socket, which leaves nothing
/// behind), "inproc://name" (within one context).
/// Whether an address can be reached from this machine only.
bool is_local(const std::string &address);

/// What every socket here has in common.
/// - A peer whose machine or network is gone is noticed within some seconds, however long it computes:
///   libzmq's own thread answers.
/// - What is larger than the limit is refused before there is room for it.
void set_up(zmq::socket_t &socket, const Limits &limits);

/// Wait until something happens to one of these, or a signal comes. A negative time: for ever.
void poll(std::span<zmq::pollitem_t> items, std::chrono::milliseconds most);

class Link {
public:
    Link(zmq::context_t &context, const Limits &limits);
    ~Link();
    Link(Link &&) = default;
    Link &operator=(Link &&) = default;

    /// To give it keys, before it is bound or connects.
    zmq::socket_t &socket() { return socket_; }

    /// Returns the address, a port that was left open filled in. Throws LinkError.
    std::string bind(const std::string &address);
    void connect(const std::string &address);

    /// To a side that is gone it does nothing: wait() and gone() say so.
    void send(const Frame &frame);

    /// The next frame that has come, into `frame`. False if there is none. Throws ProtocolError.
    bool receive(Frame &frame);

    /// Wait for a frame. Throws LinkError if the other side goes or none comes in time (0: any time).
    Frame wait(std::chrono::milliseconds most = std::chrono::milliseconds{0});

    /// Whether the other side was there and has gone. What it sent before can still be received.
    bool gone();

    /// To poll for frames, and for the other side's going.
    zmq::pollitem_t frames() { return {socket_.handle(), 0, ZMQ_POLLIN, 0}; }
    zmq::pollitem_t events() { return {monitor_.handle(), 0, ZMQ_POLLIN, 0}; }

private:
    Limits limits_;
    zmq::socket_t socket_, monitor_;
    zmq::message_t message_;
    Bytes bytes_;
    bool bound_ = false, made_ = false, gone_ = false;
    int strangers_ = 0;   ///< that came and have still to go
    std::string refusal_; ///< why the other side does not let this one in
};

} // namespace fledge::cosim
