// SPDX-License-Identifier: Apache-2.0
#include "cosim/transport/greeting.h"

#include <algorithm>
#include <cstdlib>

namespace fledge::cosim {

namespace {

constexpr std::chrono::milliseconds look{100}; ///< between two looks whether the program has stopped

void fill_in(std::string &text, const char *what, const char *variable)
{
    if (const char *value = std::getenv(variable); text.empty() && value) {
        text = value;
    }
    if (text.empty()) {
        throw LinkError(std::string("a node needs its ") + what + ", given here or by " + variable);
    }
}

} // namespace

void ask_environment(MemberConfig &config)
{
    fill_in(config.simulation, "simulation", "FLEDGE_SIMULATION");
    fill_in(config.node, "name", "FLEDGE_NODE");
    fill_in(config.address, "address", "FLEDGE_ADDRESS");
}

Member::Member(zmq::context_t &its_context, MemberConfig its_config, Role role)
    : context(its_context), config(std::move(its_config))
{
    ask_environment(config);
    hello.simulation = config.simulation;
    hello.node = config.node;
    hello.role = role;
    if (const std::string place = place_of_keys(config.keys); !place.empty()) {
        keys = read_client_keys(place, config.node);
    }
}

void Member::connect(zmq::socket_t &socket, const char *peer, const std::string &address) const
{
    set_up(socket, config.limits);
    if (keys) {
        use_keys(socket, *keys);
    }
    try {
        socket.connect(address);
    } catch (const zmq::error_t &error) {
        throw LinkError(std::string("cannot connect to ") + peer + address + ": " + error.what() +
                        "; expected tcp://HOST:PORT or ipc://@NAME");
    }
}

Frame Member::ask() const
{
    zmq::socket_t greetings(context, zmq::socket_type::dealer);
    Handshake handshake(context, greetings, keys.has_value());
    connect(greetings, "the controller at ", config.address);
    greetings.set(zmq::sockopt::linger, 0);
    greetings.send(zmq::buffer(encode({1, hello})), zmq::send_flags::none);
    zmq::message_t reply;
    const auto end = std::chrono::steady_clock::now() + config.connect_timeout;
    for (auto rest = config.connect_timeout;
         !handshake.receive(reply, std::min(rest, look), "the controller at " + config.address, hello.node);) {
        if (config.stopped && *config.stopped) {
            throw LinkError("the program ended it");
        }
        rest = std::chrono::ceil<std::chrono::milliseconds>(end - std::chrono::steady_clock::now());
        if (rest.count() > 0) {
            continue;
        }
        throw LinkError(handshake.made() && hello.role == Role::asynchronous
                            ? "the nodes have not met at " + config.address + " so far"
                            : "no controller answers at " + config.address);
    }
    Frame frame = decode({reply.data<std::byte>(), reply.size()}, config.limits);
    if (const auto *refused = std::get_if<Refused>(&frame.message)) {
        throw LinkError("the controller refuses " + hello.node + ": " + refused->reason);
    }
    return frame;
}

std::string Member::reachable(const std::string &address) const
{
    constexpr std::string_view anywhere = "tcp://0.0.0.0:";
    return address.starts_with(anywhere)
               ? config.address.substr(0, config.address.rfind(':') + 1) + address.substr(anywhere.size())
               : address;
}

} // namespace fledge::cosim
