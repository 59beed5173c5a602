// SPDX-License-Identifier: Apache-2.0
#include "cosim/transport/link.h"

#include "cosim/transport/handshake.h"
#include "cosim/transport/shared_channel.h"

#include <arpa/inet.h>
#include <array>
#include <atomic>
#include <poll.h>
#include <sys/eventfd.h>
#include <thread>
#include <unistd.h>
#include <utility>

namespace fledge::cosim {

namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr int linger_ms = 1000;
constexpr int idle_s = 2, probe_s = 1, probes = 3;  ///< of an idle connection
constexpr int unread_ms = 5000;                     ///< for the other side to take bytes
constexpr int most_waiting = 10;                    ///< frames; in lock step, few are on their way
constexpr std::chrono::milliseconds look = 100ms;   ///< between two checks of a silent side
constexpr std::chrono::milliseconds long_look = 1s; ///< for the end of the program; a signal wakes it at once
constexpr std::chrono::milliseconds for_ever = -1ms;
constexpr std::string_view tcp = "tcp://", localhost = "tcp://localhost:";

/// Only an address in brackets is one of IPv6: libzmq would write those of IPv4 as such, too.
void choose_family(zmq::socket_t &socket, const std::string &address)
{
    socket.set(zmq::sockopt::ipv6, address.starts_with("tcp://["));
}

} // namespace

bool is_local(const std::string &address)
{
    if (!address.starts_with(tcp)) {
        return address.starts_with("ipc://") || address.starts_with("inproc://");
    }
    std::string host = address.substr(tcp.size(), address.rfind(':') - tcp.size());
    if (host.starts_with('[') && host.ends_with(']')) {
        host = host.substr(1, host.size() - 2);
    }
    std::array<std::uint8_t, 16> bytes;
    if (inet_pton(AF_INET, host.c_str(), bytes.data()) == 1) {
        return bytes[0] == 127;
    }
    in6_addr six;
    return inet_pton(AF_INET6, host.c_str(), &six) == 1
               ? IN6_IS_ADDR_LOOPBACK(&six) || (IN6_IS_ADDR_V4MAPPED(&six) && six.s6_addr[12] == 127)
               : host == "localhost";
}

void bind(zmq::socket_t &socket, std::string address)
{
    if (address.starts_with(localhost)) { // libzmq does not resolve what it binds
        address.replace(0, localhost.size(), "tcp://127.0.0.1:");
    }
    choose_family(socket, address);
    uninterrupted([&] { socket.bind(address); });
}

void connect(zmq::socket_t &socket, const std::string &address)
{
    choose_family(socket, address);
    uninterrupted([&] { socket.connect(address); });
}

void set_up(zmq::socket_t &socket, const Limits &limits)
{
    socket.set(zmq::sockopt::linger, linger_ms);
    socket.set(zmq::sockopt::maxmsgsize, static_cast<std::int64_t>(limits.frame));
    socket.set(zmq::sockopt::tcp_keepalive, 1);
    socket.set(zmq::sockopt::tcp_keepalive_idle, idle_s);
    socket.set(zmq::sockopt::tcp_keepalive_intvl, probe_s);
    socket.set(zmq::sockopt::tcp_keepalive_cnt, probes);
    socket.set(zmq::sockopt::tcp_maxrt, unread_ms);
}

void allow_silence(zmq::socket_t &socket)
{
    socket.set(zmq::sockopt::tcp_maxrt, 0);
}

void refuse_other_users(zmq::socket_t &socket)
{
    const uid_t own = geteuid();
    if (zmq_setsockopt(socket.handle(), ZMQ_IPC_FILTER_UID, &own, sizeof own)) {
        throw LinkError(std::string("cannot refuse other users: ") + zmq_strerror(zmq_errno()));
    }
}

bool send_part(zmq::socket_t &socket, zmq::const_buffer bytes, zmq::send_flags flags)
{
    return uninterrupted([&] { return socket.send(bytes, flags).has_value(); });
}

bool receive_part(zmq::socket_t &socket, zmq::message_t &part)
{
    return uninterrupted([&] { return socket.recv(part, zmq::recv_flags::dontwait).has_value(); });
}

void poll(std::span<zmq::pollitem_t> items, std::chrono::milliseconds most)
{
    try {
        zmq::poll(items.data(), items.size(), most);
    } catch (const zmq::error_t &error) {
        if (error.num() != EINTR) {
            throw;
        }
        for (zmq::pollitem_t &item : items) { // a signal came: nothing has happened here
            item.revents = 0;
        }
    }
}

std::size_t receive_parts(zmq::socket_t &socket, std::span<zmq::message_t> parts)
{
    std::size_t n = 0;
    zmq::message_t rest;
    for (bool more = true; more; n++) {
        zmq::message_t &part = n < parts.size() ? parts[n] : rest;
        if (!receive_part(socket, part)) {
            break;
        }
        more = part.more();
    }
    return n;
}

int descriptor(zmq::socket_t &socket)
{
    return socket.get(zmq::sockopt::fd);
}

Link::Link(zmq::context_t &context, const Limits &limits, End end)
    : limits_(limits), end_(end),
      socket_(context, end == End::node ? zmq::socket_type::dealer : zmq::socket_type::router)
{
    set_up(socket_, limits);
    if (end_ == End::controller) {
        socket_.set(zmq::sockopt::router_mandatory, true); // send() reports that the node is gone
        socket_.set(zmq::sockopt::rcvhwm, most_waiting);   // of each stranger
        connections_ = std::make_unique<Connections>(context, socket_);
    } else {
        monitor_ = monitor(context, socket_);
    }
    gone(); // its descriptor reports only what comes after a first look
}

int Link::events()
{
    return descriptor(connections_ ? connections_->events() : monitor_);
}

/// Notices that the controller is gone while its node sleeps without a timeout: timers would cost each tick some
/// hundred nanoseconds.
class Link::Watcher {
public:
    Watcher(zmq::socket_t monitor, SharedChannel &channel)
        : monitor_(std::move(monitor)), channel_(channel), stop_(eventfd(0, EFD_CLOEXEC)), thread_([this] { watch(); })
    {
    }
    ~Watcher()
    {
        eventfd_write(stop_, 1);
        thread_.join();
        close(stop_);
    }
    Watcher(const Watcher &) = delete;
    Watcher &operator=(const Watcher &) = delete;

    bool gone() const { return gone_; }

private:
    void watch()
    {
        try {
            pollfd fds[] = {{descriptor(monitor_), POLLIN, 0}, {stop_, POLLIN, 0}};
            while (!fds[1].revents) {
                std::uint16_t kind = 0;
                for (std::uint32_t value = 0; next_event(monitor_, kind, value);) {
                    gone_ = gone_ || kind == ZMQ_EVENT_DISCONNECTED;
                }
                if (gone_) {
                    channel_.interrupt();
                }
                ::poll(fds, std::size(fds), -1);
            }
        } catch (const zmq::error_t &) { // the context is being closed, and with it the link
            gone_ = true;
            channel_.interrupt();
        }
    }

    zmq::socket_t monitor_;
    SharedChannel &channel_;
    int stop_;
    std::atomic<bool> gone_{false};
    std::thread thread_; ///< the last, for it uses the others
};

Link::~Link()
{
    if (shared_ && !shared_->is_controllers()) {
        // The last frame may be a long one.
        const auto end = Clock::now() + std::chrono::milliseconds(linger_ms);
        try {
            while (!shared_->flush() && !gone() && Clock::now() < end) {
                shared_->wait(look);
            }
        } catch (const ProtocolError &) {
            // The other side reads no more.
        }
    }
    zmq_socket_monitor(socket_.handle(), nullptr, 0); // before its other end is closed
    watcher_.reset();
}

void Link::share(std::unique_ptr<SharedChannel> channel)
{
    shared_ = std::move(channel);
    shared_->hide();
    if (!shared_->is_controllers() && !gone()) {
        watcher_ = std::make_unique<Watcher>(std::move(monitor_), *shared_);
    }
}

std::string Link::bind(const std::string &address)
{
    try {
        cosim::bind(socket_, address);
    } catch (const zmq::error_t &error) {
        throw LinkError("cannot listen at " + address + ": " + error.what());
    }
    return socket_.get(zmq::sockopt::last_endpoint);
}

void Link::accept()
{
    accepted_ = true;
    connection_ = connections_->number(fd_);
    gone_ = fd_ >= 0 && !connection_;
}

void Link::send(const Frame &frame, bool urgent)
{
    encode(frame, bytes_, native_order(), shared_ ? Sum::zero : Sum::crc);
    if (shared_) {
        return shared_->send(bytes_, urgent);
    }
    // It never waits: in lock step only a few frames are on their way, so a side that takes no more is gone. Its
    // last frame, which may end the run, can still be read.
    try {
        if ((end_ == End::controller && !send_part(socket_, zmq::buffer(peer_.data(), peer_.size()),
                                                   zmq::send_flags::sndmore | zmq::send_flags::dontwait)) ||
            !send_part(socket_, zmq::buffer(bytes_), zmq::send_flags::dontwait)) {
            gone_ = true;
        }
    } catch (const zmq::error_t &error) {
        if (error.num() != EHOSTUNREACH) {
            throw;
        }
        gone_ = true;
    }
}

bool Link::receive(Frame &frame)
{
    if (shared_) {
        if (!shared_->receive(received_)) {
            return false;
        }
        frame = decode(received_, limits_, Sum::zero);
        return true;
    }
    const bool known = end_ == End::node || accepted_;
    const auto parts = std::span(parts_).subspan(end_ == End::node ? 1 : 0);
    while (const std::size_t n = receive_parts(socket_, parts)) {
        if (accepted_ && parts_[0] != peer_) {
            continue; // a stranger's
        }
        try {
            if (n != parts.size()) {
                throw ProtocolError("a frame is one part, not " + std::to_string(n + 1 - parts.size()));
            }
            frame = decode({parts_[1].data<std::byte>(), parts_[1].size()}, limits_);
        } catch (const ProtocolError &) {
            if (known) {
                throw;
            }
            continue;
        }
        if (!known) {
            peer_.copy(parts_[0]);
            fd_ = zmq_msg_get(parts_[1].handle(), ZMQ_SRCFD);
        }
        return true;
    }
    return false;
}

Frame Link::wait(std::chrono::milliseconds most, const std::atomic<bool> *stopped)
{
    Frame frame;
    const bool limited = most.count() > 0;
    const auto end = limited ? Clock::now() + most : Clock::time_point::max();
    while (!receive(frame)) {
        const auto rest = limited ? std::chrono::ceil<std::chrono::milliseconds>(end - Clock::now()) : look;
        if (stopped && *stopped) {
            throw LinkError("the program ended it");
        }
        if (rest.count() <= 0) {
            throw LinkError("the controller let this program in, but asks nothing of it");
        }
        if (silent(limited || !watcher_ ? std::min(rest, look) : stopped ? long_look : for_ever) && gone()) {
            if (receive(frame)) {
                break;
            }
            throw LinkError(refusal_.empty() ? "the controller is gone" : refusal_);
        }
    }
    return frame;
}

/// Wait for a frame. True if none came, so that the other side has to be checked.
bool Link::silent(std::chrono::milliseconds most)
{
    if (shared_) {
        shared_->wait(most);
        return !shared_->pending();
    }
    pollfd fds[] = {{frames(), POLLIN, 0}, {events(), POLLIN, 0}};
    ::poll(fds, std::size(fds), static_cast<int>(most.count()));
    return fds[1].revents || !fds[0].revents;
}

bool Link::gone()
{
    if (watcher_) {
        return watcher_->gone();
    }
    if (connections_) {
        gone_ = gone_ || (connections_->number(fd_) != connection_ && accepted_);
        return gone_;
    }
    std::uint16_t kind = 0;
    for (std::uint32_t value = 0; next_event(monitor_, kind, value);) {
        gone_ = gone_ || kind == ZMQ_EVENT_DISCONNECTED;
        refusal_ = kind == ZMQ_EVENT_HANDSHAKE_FAILED_AUTH ? refusal(kind, value, true) : refusal_;
    }
    return gone_;
}

} // namespace fledge::cosim
