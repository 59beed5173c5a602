// SPDX-License-Identifier: Apache-2.0
// The connection of one controller and one node: it carries frames, and notices when the other side is gone. It
// begins on a pair of sockets; on one machine, frames may then go through shared memory.
//
// Example:
//
//     using namespace cosim;
//     zmq::context_t context;
//     Link controller(context, Limits(), Link::End::controller), node(context, Limits());
//     node.socket().connect(controller.bind("tcp://127.0.0.1:*"));
//     node.send({1, Hello{.simulation = "spin", .node = "world"}});
//     for (Frame frame; controller.receive(frame);) {
//         controller.accept(); // its sender is the node
//     }
#pragma once

#include "cosim/protocol/words.h"
#include "cosim/security/uninterrupted.h"
#include "cosim/transport/link_error.h"

#include <array>
#include <atomic>
#include <chrono>
#include <memory>
#include <span>
#include <string>
#include <zmq.hpp>

namespace fledge::cosim {

class Connections;
class SharedChannel;

/// Whether frames may go through shared memory.
enum class Sharing {
    allowed,   ///< where both sides have it
    forbidden, ///< they go over sockets
    required,  ///< without it, the run does not begin
};

inline constexpr std::pair<std::string_view, Sharing> sharing_words[] = {
    {"allowed", Sharing::allowed}, {"forbidden", Sharing::forbidden}, {"required", Sharing::required}};

/// Whether only this machine can reach an address of libzmq: "tcp://127.0.0.1:7000", "tcp://[::1]:7000",
/// "tcp://localhost:7000", "ipc://@name" (an abstract socket, which leaves no file behind), "inproc://name" (within one
/// context).
bool is_local(const std::string &address);

/// Listen or connect at such an address, or at one of another machine. Throws zmq::error_t.
void bind(zmq::socket_t &socket, std::string address);
void connect(zmq::socket_t &socket, const std::string &address);

/// Set the options of every socket:
/// - The kernels of both machines check each TCP connection. So a lost machine or network is noticed within seconds,
///   and a program that computes for long, or that a debugger stops, is not taken for lost.
/// - libzmq refuses a message above the limit before it allocates memory for it.
void set_up(zmq::socket_t &socket, const Limits &limits);

/// Before a socket is bound: the other side may leave bytes unread for ever, as a stopped program does.
void allow_silence(zmq::socket_t &socket);

/// Before a socket is bound: over "ipc://", only programs of this user can connect.
void refuse_other_users(zmq::socket_t &socket);

/// Send one part of a message; false if the socket takes no more and `flags` forbid to wait.
bool send_part(zmq::socket_t &socket, zmq::const_buffer bytes, zmq::send_flags flags);

/// Receive the next part of a message, if one has come, without waiting.
bool receive_part(zmq::socket_t &socket, zmq::message_t &part);

/// Wait for an event on one of these sockets, or a signal. A negative time: for ever.
void poll(std::span<zmq::pollitem_t> items, std::chrono::milliseconds most);

/// Receive the next message, if one has come, without waiting. Returns the number of its parts, which may exceed
/// that of `parts`; 0 if no message has come.
std::size_t receive_parts(zmq::socket_t &socket, std::span<zmq::message_t> parts);

/// The descriptor that becomes readable when a socket has an event. It is edge-triggered: before the caller waits
/// for it, it has to receive all messages, also after each sending.
int descriptor(zmq::socket_t &socket);

class Link {
public:
    enum class End { node, controller };

    Link(zmq::context_t &context, const Limits &limits, End end = End::node);
    ~Link();
    Link(const Link &) = delete;
    Link &operator=(const Link &) = delete;

    /// A node connects it; a controller gives it keys before bind().
    zmq::socket_t &socket() { return socket_; }

    /// The controller's end. Returns the address with the chosen port. Throws LinkError.
    std::string bind(const std::string &address);

    /// The controller's end: other programs can connect, too. The sender of the last frame is the node; from now on,
    /// receive() gives only its frames, and only the loss of its connection counts.
    void accept();

    /// From now on frames go through this memory. The socket only shows whether the other side is there.
    void share(std::unique_ptr<SharedChannel> channel);
    SharedChannel *shared() const { return shared_.get(); }

    /// Does nothing if the other side is gone: wait() and gone() report that. `urgent`: see SharedChannel.
    void send(const Frame &frame, bool urgent = true);

    /// Take the next frame that has come. False if there is none. Throws ProtocolError. It also sends more of a
    /// long frame through shared memory. Before accept(), it skips what is no frame.
    bool receive(Frame &frame);

    /// A node: wait for a frame. Throws LinkError if the controller goes, sends none in time (0: no limit), or if
    /// `stopped` becomes true.
    Frame wait(std::chrono::milliseconds most = std::chrono::milliseconds{0},
               const std::atomic<bool> *stopped = nullptr);

    /// Whether the other side was there and has gone. receive() still gives what it sent before.
    bool gone();

    /// To poll for frames, and for the loss of the other side: see descriptor().
    int frames() { return descriptor(socket_); }
    int events();

private:
    class Watcher;
    bool silent(std::chrono::milliseconds most);

    Limits limits_;
    End end_;
    zmq::socket_t socket_;
    zmq::socket_t monitor_;               ///< of a node
    std::array<zmq::message_t, 2> parts_; ///< libzmq's name of the sender, at the controller's end; a frame
    Bytes bytes_, received_;
    std::unique_ptr<SharedChannel> shared_;
    std::unique_ptr<Watcher> watcher_; ///< of a node that shares memory
    bool gone_ = false;
    std::string refusal_; ///< why the other side refuses this program

    // The controller's end.
    bool accepted_ = false;
    zmq::message_t peer_;          ///< libzmq's name of the node, or of the sender of the last frame
    int fd_ = -1;                  ///< of its connection; -1: within one context
    std::uint64_t connection_ = 0; ///< the number of that
    std::unique_ptr<Connections> connections_;
};

} // namespace fledge::cosim
