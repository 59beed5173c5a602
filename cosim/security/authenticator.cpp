// SPDX-License-Identifier: Apache-2.0
#include "cosim/security/authenticator.h"

#include "cosim/security/uninterrupted.h"

#include <array>
#include <cstdio>
#include <utility>

namespace fledge::cosim {

namespace {

using namespace std::chrono_literals;

constexpr auto read_again_after = 200ms;
constexpr std::size_t most_reports = 100;

/// The key that libzmq kept with a message, since the authenticator gave it as the user's name.
std::string key_of(zmq::message_t &message)
{
    const char *key = zmq_msg_gets(message.handle(), "User-Id");
    return key ? key : "";
}

} // namespace

Authenticator::Authenticator(zmq::context_t &context, std::filesystem::path folder)
    : folder_(std::move(folder)), own_(read_controller_keys(folder_)), requests_(context, zmq::socket_type::rep),
      end_(context, zmq::socket_type::pair), ended_(context, zmq::socket_type::pair),
      allowed_(read_allowed_keys(folder_)), read_(std::chrono::steady_clock::now())
{
    for (zmq::socket_t *socket : {&requests_, &end_, &ended_}) {
        socket->set(zmq::sockopt::linger, 0);
    }
    char name[64];
    std::snprintf(name, sizeof name, "inproc://fledge-authenticator-%p", static_cast<void *>(this));
    try {
        uninterrupted([&] { requests_.bind("inproc://zeromq.zap.01"); });
    } catch (const zmq::error_t &) {
        throw KeyError("there is another controller with keys in this program; give each a context of its own");
    }
    uninterrupted([&] { end_.bind(name); });
    uninterrupted([&] { ended_.connect(name); });
    thread_ = std::thread([this] { serve(); });
}

Authenticator::~Authenticator()
{
    try {
        uninterrupted([&] { end_.send(zmq::message_t(), zmq::send_flags::dontwait); });
    } catch (const zmq::error_t &) {
        // The context ends, and its thread with it.
    }
    thread_.join();
}

void Authenticator::guard(zmq::socket_t &socket, const std::string &node)
{
    const std::lock_guard lock(mutex_);
    std::string domain = "all";
    if (!node.empty()) {
        domain = "node-" + std::to_string(nodes_.size());
        for (const auto &[known, name] : nodes_) {
            domain = name == node ? known : domain;
        }
        nodes_[domain] = node;
    }
    socket.set(zmq::sockopt::curve_server, true);
    socket.set(zmq::sockopt::curve_secretkey, own_.secret);
    socket.set(zmq::sockopt::zap_domain, domain);
}

bool Authenticator::may_speak_as(zmq::message_t &message, const std::string &node) const
{
    const std::lock_guard lock(mutex_);
    const AllowedKey *allowed = find(key_of(message));
    return allowed && allowed->may_speak_as(node);
}

std::string Authenticator::name_of(zmq::message_t &message) const
{
    const std::lock_guard lock(mutex_);
    const AllowedKey *allowed = find(key_of(message));
    return allowed ? allowed->name : "";
}

std::vector<std::string> Authenticator::take_reports()
{
    const std::lock_guard lock(mutex_);
    return std::exchange(reports_, {});
}

void Authenticator::serve()
{
    zmq::pollitem_t items[] = {{requests_.handle(), 0, ZMQ_POLLIN, 0}, {ended_.handle(), 0, ZMQ_POLLIN, 0}};
    try {
        while (!items[1].revents) {
            uninterrupted([&] { zmq::poll(items, 2, -1ms); });
            if (items[0].revents) {
                answer();
            }
        }
    } catch (const zmq::error_t &) {
        // The context is gone.
    }
}

/// One request: version, number, domain, address, identity, mechanism, credentials.
void Authenticator::answer()
{
    std::vector<zmq::message_t> parts;
    do {
        zmq::message_t part;
        uninterrupted([&] { (void)requests_.recv(part); });
        parts.push_back(std::move(part));
    } while (parts.back().more());
    std::string key;
    if (parts.size() == 7 && parts[5].to_string_view() == "CURVE" && parts[6].size() == 32) {
        char text[41];
        zmq_z85_encode(text, parts[6].data<std::uint8_t>(), 32);
        key = text;
    }
    const std::string why = [&]() -> std::string {
        const std::lock_guard lock(mutex_);
        read_again();
        const std::string address = parts.size() > 3 ? parts[3].to_string() : "";
        const std::string program = "a program" + (address.empty() ? "" : " at " + address);
        const AllowedKey *allowed = find(key);
        if (!allowed) {
            report(program + " was not let in: its public key is not allowed here: " + key +
                   "; ./fledge keys allow lets it in");
            return "unknown key";
        }
        const auto node = nodes_.find(parts[2].to_string());
        if (node != nodes_.end() && !allowed->may_speak_as(node->second)) {
            report(program + " was not let in as " + node->second + ", for which its key " + allowed->name +
                   " is not allowed");
            return "not for this node";
        }
        return "";
    }();
    const std::string version = parts[0].to_string(), number = parts.size() > 1 ? parts[1].to_string() : "";
    const std::string code = why.empty() ? "200" : "400", text = why.empty() ? "OK" : why;
    const std::string user = why.empty() ? key : "";
    const std::array<const std::string *, 5> reply{&version, &number, &code, &text, &user};
    for (const std::string *part : reply) {
        uninterrupted([&] { requests_.send(zmq::buffer(*part), zmq::send_flags::sndmore); });
    }
    uninterrupted([&] { requests_.send(zmq::message_t(), zmq::send_flags::none); }); // no metadata
}

const AllowedKey *Authenticator::find(const std::string &key) const
{
    for (const AllowedKey &allowed : allowed_) {
        if (allowed.key == key) {
            return &allowed;
        }
    }
    return nullptr;
}

void Authenticator::read_again()
{
    const auto now = std::chrono::steady_clock::now();
    std::error_code missing;
    const auto changed = std::filesystem::last_write_time(folder_ / "allowed", missing);
    if (changed == changed_ && now - read_ < read_again_after) {
        return;
    }
    read_ = now;
    changed_ = changed;
    try {
        allowed_ = read_allowed_keys(folder_);
    } catch (const KeyError &error) {
        report(std::string(error.what()) + "; the keys allowed before stay allowed");
    }
}

void Authenticator::report(const std::string &text)
{
    if (reported_.size() < most_reports && reported_.insert(text).second) {
        reports_.push_back(text);
    }
}

} // namespace fledge::cosim
