// SPDX-License-Identifier: Apache-2.0
// One controller and one node: frames, and whether the other side is still there. They meet on a pair
// of sockets; on one machine, frames may then go through shared memory instead.
#pragma once

#include "cosim/protocol/protocol.h"

#include <chrono>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <zmq.hpp>

namespace fledge::cosim {

class SharedChannel;

/// Whether frames may go through shared memory.
enum class Sharing {
    allowed,   ///< where both sides have it
    forbidden, ///< they go over sockets
    required,  ///< or the run does not begin
};

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

/// The descriptor that becomes readable when a socket has something to say: once, so what is there has
/// to be received to the last before it is waited for, also after each sending.
int descriptor(zmq::socket_t &socket);

class Link {
public:
    Link(zmq::context_t &context, const Limits &limits);
    ~Link();
    Link(Link &&) noexcept;
    Link &operator=(Link &&) noexcept;

    /// To give it keys, before it is bound or connects.
    zmq::socket_t &socket() { return socket_; }

    /// Returns the address, a port that was left open filled in. Throws LinkError.
    std::string bind(const std::string &address);
    void connect(const std::string &address);

    /// From now on frames go through this memory, and the socket only tells who is there.
    void share(std::unique_ptr<SharedChannel> channel);
    SharedChannel *shared() const { return shared_.get(); }

    /// To a side that is gone it does nothing: wait() and gone() say so. `urgent`: see SharedChannel.
    void send(const Frame &frame, bool urgent = true);

    /// The next frame that has come, into `frame`. False if there is none. Throws ProtocolError. A long
    /// frame that is sent through shared memory goes on its way here, too.
    bool receive(Frame &frame);

    /// Wait for a frame. Throws LinkError if the other side goes or none comes in time (0: any time).
    Frame wait(std::chrono::milliseconds most = std::chrono::milliseconds{0});

    /// Whether the other side was there and has gone. What it sent before can still be received.
    bool gone();

    /// To poll for frames, and for the other side's going: see descriptor().
    int frames() { return descriptor(socket_); }
    int events() { return descriptor(monitor_); }

private:
    class Watcher;
    bool silent(std::chrono::milliseconds most);

    Limits limits_;
    zmq::socket_t socket_, monitor_;
    zmq::message_t message_;
    Bytes bytes_, received_;
    std::unique_ptr<SharedChannel> shared_;
    std::unique_ptr<Watcher> watcher_; ///< of a node that shares memory
    bool bound_ = false, made_ = false, gone_ = false;
    int strangers_ = 0;   ///< that came and have still to go
    std::string refusal_; ///< why the other side does not let this one in
};

} // namespace fledge::cosim
