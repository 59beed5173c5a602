// SPDX-License-Identifier: Apache-2.0
#include "cosim/transport/handshake.h"

#include "cosim/transport/link.h"

#include <atomic>
#include <cstring>
#include <sys/socket.h>
#include <unistd.h>
#include <utility>

namespace fledge::cosim {

namespace {

constexpr int most_broken_off = 5;

/// The user of the program at the other end of a connection, if that is another one.
std::optional<uid_t> other_user(int fd)
{
    int family = 0;
    ucred peer{};
    socklen_t family_size = sizeof family, peer_size = sizeof peer;
    const bool known = !getsockopt(fd, SOL_SOCKET, SO_DOMAIN, &family, &family_size) && family == AF_UNIX &&
                       !getsockopt(fd, SOL_SOCKET, SO_PEERCRED, &peer, &peer_size);
    return known && peer.uid != geteuid() ? std::optional(peer.uid) : std::nullopt;
}

} // namespace

zmq::socket_t monitor(zmq::context_t &context, zmq::socket_t &socket)
{
    static std::atomic<unsigned> count{0};
    const std::string name = "inproc://fledge-monitor-" + std::to_string(count++);
    const int events_of_interest = ZMQ_EVENT_ACCEPTED | ZMQ_EVENT_CONNECTED | ZMQ_EVENT_DISCONNECTED |
                                   ZMQ_EVENT_HANDSHAKE_SUCCEEDED | ZMQ_EVENT_HANDSHAKE_FAILED_AUTH |
                                   ZMQ_EVENT_HANDSHAKE_FAILED_PROTOCOL | ZMQ_EVENT_HANDSHAKE_FAILED_NO_DETAIL;
    try {
        uninterrupted([&] {
            if (zmq_socket_monitor(socket.handle(), name.c_str(), events_of_interest)) {
                throw zmq::error_t();
            }
        });
    } catch (const zmq::error_t &error) {
        throw LinkError(std::string("cannot watch a socket: ") + error.what());
    }
    zmq::socket_t events(context, zmq::socket_type::pair);
    events.set(zmq::sockopt::linger, 0);
    uninterrupted([&] { events.connect(name); });
    return events;
}

Connections::Connections(zmq::context_t &context, zmq::socket_t &socket)
    : socket_(socket), monitor_(monitor(context, socket))
{
}

Connections::~Connections()
{
    // libzmq's thread writes the socket's events to the monitor, and would wait for ever for a monitor that was
    // closed before.
    zmq_socket_monitor(socket_.handle(), nullptr, 0);
}

std::uint64_t Connections::number(int fd)
{
    std::uint16_t kind = 0;
    for (std::uint32_t value = 0; next_event(monitor_, kind, value);) {
        if (kind == ZMQ_EVENT_ACCEPTED) {
            open_[static_cast<int>(value)] = ++last_;
        } else if (kind == ZMQ_EVENT_DISCONNECTED) {
            open_.erase(static_cast<int>(value));
        }
    }
    const auto found = open_.find(fd);
    return found == open_.end() ? 0 : found->second;
}

Handshake::Handshake(zmq::context_t &context, zmq::socket_t &socket, bool keyed, bool any_user)
    : socket_(socket), monitor_(monitor(context, socket)), keyed_(keyed), any_user_(any_user)
{
}

Handshake::~Handshake()
{
    zmq_socket_monitor(socket_.handle(), nullptr, 0); // before its other end is closed
}

bool Handshake::connect(std::chrono::milliseconds most, const std::string &where, const std::string &program)
{
    return wait([&] { return made_; }, most, where, program);
}

bool Handshake::receive(zmq::message_t &message, std::chrono::milliseconds most, const std::string &where,
                        const std::string &program)
{
    return wait([&] { return receive_part(socket_, message); }, most, where, program);
}

template <class Condition>
bool Handshake::wait(Condition over, std::chrono::milliseconds most, const std::string &where,
                     const std::string &program)
{
    using Clock = std::chrono::steady_clock;
    zmq::pollitem_t items[] = {{socket_.handle(), 0, ZMQ_POLLIN, 0}, {monitor_.handle(), 0, ZMQ_POLLIN, 0}};
    for (const auto end = Clock::now() + most;;) {
        read_events(); // those of a connection come before its first message
        if (!failure_.empty()) {
            throw LinkError(where + " does not let " + program + " in: " + failure_);
        }
        if (over()) {
            return true;
        }
        const auto rest = std::chrono::ceil<std::chrono::milliseconds>(end - Clock::now());
        if (rest.count() <= 0) {
            return false;
        }
        poll(items, rest);
    }
}

/// Learns whether the connection is made, lost, or refused.
void Handshake::read_events()
{
    std::uint16_t kind = 0;
    for (std::uint32_t value = 0; failure_.empty() && next_event(monitor_, kind, value);) {
        if (kind == ZMQ_EVENT_HANDSHAKE_SUCCEEDED) {
            made_ = true;
            broken_off_ = 0;
        } else if (kind == ZMQ_EVENT_DISCONNECTED) {
            if (std::exchange(made_, false)) {
                lost_ = std::chrono::steady_clock::now();
            }
        } else if (kind == ZMQ_EVENT_CONNECTED) {
            if (const auto user = any_user_ ? std::nullopt : other_user(static_cast<int>(value))) {
                failure_ = "it belongs to another user of this machine, number " + std::to_string(*user) +
                           "; FLEDGE_ANY_USER=1 allows that";
            }
        } else if (kind != ZMQ_EVENT_HANDSHAKE_FAILED_NO_DETAIL) {
            failure_ = refusal(kind, value, keyed_);
        } else if (++broken_off_ >= most_broken_off) {
            // A killed controller breaks off once; one that does not understand this program, at each attempt.
            failure_ =
                keyed_
                    ? "what listens there breaks off when it sees these keys: controller.public here is "
                      "not that of this controller, or it uses no keys"
                    : "what listens there breaks off: it is no controller, or it asks for keys, or is of another user";
        }
    }
}

bool next_event(zmq::socket_t &monitor, std::uint16_t &kind, std::uint32_t &value)
{
    zmq::message_t event, address;
    if (!receive_part(monitor, event)) {
        return false;
    }
    kind = 0;
    value = 0;
    if (event.size() >= sizeof kind + sizeof value) {
        std::memcpy(&kind, event.data(), sizeof kind);
        std::memcpy(&value, event.data<char>() + sizeof kind, sizeof value);
    }
    if (event.more()) {
        (void)receive_part(monitor, address);
    }
    return true;
}

std::string refusal(std::uint16_t kind, std::uint32_t value, bool keyed)
{
    if (kind == ZMQ_EVENT_HANDSHAKE_FAILED_AUTH) {
        return "it does not know this key: ./fledge keys allow, where the controller runs, lets it in";
    }
    if (kind != ZMQ_EVENT_HANDSHAKE_FAILED_PROTOCOL) {
        return "";
    }
    if (value == ZMQ_PROTOCOL_ERROR_ZMTP_MECHANISM_MISMATCH) {
        return keyed ? "it uses no keys, and this program does"
                     : "it asks for keys, and this program has none: give it some by FLEDGE_KEYS "
                       "(./fledge keys new makes them)";
    }
    if (value == ZMQ_PROTOCOL_ERROR_ZMTP_CRYPTOGRAPHIC) {
        return "controller.public here is not that of this controller";
    }
    return "what listens there is no controller";
}

} // namespace fledge::cosim
