// SPDX-License-Identifier: Apache-2.0
#include "cosim/transport/greeting.h"

#include <algorithm>
#include <cstdlib>

namespace fledge::cosim {

namespace {

constexpr std::chrono::milliseconds stop_check{100}; ///< between two looks whether the program has stopped

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
    const char *any_user = std::getenv("FLEDGE_ANY_USER");
    config.any_user = config.any_user || (any_user && std::string_view(any_user) == "1");
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
        cosim::connect(socket, address);
    } catch (const zmq::error_t &error) {
        throw LinkError(std::string("cannot connect to ") + peer + address + ": " + error.what() +
                        "; expected tcp://HOST:PORT or ipc://@NAME");
    }
}

Frame Member::ask()
{
    zmq::socket_t &greetings = greetings_.emplace(context, zmq::socket_type::dealer);
    Handshake handshake(context, greetings, keys.has_value(), config.any_user);
    connect(greetings, "the controller at ", config.address);
    greetings.set(zmq::sockopt::linger, 0);
    const std::string where = "the controller at " + config.address;
    const auto end = std::chrono::steady_clock::now() + config.connect_timeout;
    const auto in_time = [&](const auto &attempt) { // repeats it, at least once; a stopped program throws
        std::chrono::milliseconds rest;
        do {
            rest = std::chrono::ceil<std::chrono::milliseconds>(end - std::chrono::steady_clock::now());
            if (attempt(std::min(rest, stop_check))) {
                return true;
            }
            if (config.stopped && *config.stopped) {
                throw LinkError("the program ended it");
            }
        } while (rest.count() > 0);
        return false;
    };
    zmq::message_t reply;
    // Over "ipc://", another user's program must not get the Hello: a connection shows whose it is.
    if (!config.address.starts_with("ipc://") ||
        in_time([&](auto most) { return handshake.connect(most, where, hello.node); })) {
        send_part(greetings, zmq::buffer(encode({.number = 1, .message = hello})), zmq::send_flags::none);
    }
    if (!in_time([&](auto most) { return handshake.receive(reply, most, where, hello.node); })) {
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
