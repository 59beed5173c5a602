// SPDX-License-Identifier: Apache-2.0
#include "cosim/transport/greeting.h"

#include <cstdlib>

namespace fledge::cosim {

namespace {

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

void ask_environment(std::string &simulation, std::string &node, std::string &address)
{
    fill_in(simulation, "simulation", "FLEDGE_SIMULATION");
    fill_in(node, "name", "FLEDGE_NODE");
    fill_in(address, "address", "FLEDGE_ADDRESS");
}

Frame greet(zmq::context_t &context, const std::string &address, const std::optional<ClientKeys> &keys,
            const Hello &hello, std::chrono::milliseconds connect_timeout, const Limits &limits)
{
    using Clock = std::chrono::steady_clock;
    zmq::socket_t greetings(context, zmq::socket_type::dealer);
    set_up(greetings, limits);
    greetings.set(zmq::sockopt::linger, 0);
    if (keys) {
        use_keys(greetings, *keys);
    }
    Handshake handshake(context, greetings, keys.has_value());
    try {
        greetings.connect(address);
    } catch (const zmq::error_t &error) {
        throw LinkError("cannot connect to the controller at " + address + ": " + error.what() +
                        "; expected tcp://HOST:PORT or ipc://@NAME");
    }
    greetings.send(zmq::buffer(encode({1, hello})), zmq::send_flags::none);
    zmq::message_t reply;
    zmq::pollitem_t items[] = {{greetings.handle(), 0, ZMQ_POLLIN, 0}, handshake.events()};
    for (const auto end = Clock::now() + connect_timeout; !greetings.recv(reply, zmq::recv_flags::dontwait);) {
        if (!handshake.failure().empty()) {
            throw LinkError("the controller at " + address + " does not let " + hello.node +
                            " in: " + handshake.failure());
        }
        const auto rest = std::chrono::ceil<std::chrono::milliseconds>(end - Clock::now());
        if (rest.count() <= 0) {
            throw LinkError(handshake.made() && hello.role == Role::asynchronous
                                ? "the nodes have not met at " + address + " so far"
                                : "no controller answers at " + address);
        }
        poll(items, rest);
    }
    Frame frame = decode({reply.data<std::byte>(), reply.size()}, limits);
    if (const auto *refused = std::get_if<Refused>(&frame.message)) {
        throw LinkError("the controller refuses " + hello.node + ": " + refused->reason);
    }
    return frame;
}

std::string reachable(std::string address, const std::string &controller)
{
    constexpr std::string_view anywhere = "tcp://0.0.0.0:";
    if (address.starts_with(anywhere)) {
        address = controller.substr(0, controller.rfind(':') + 1) + address.substr(anywhere.size());
    }
    return address;
}

} // namespace fledge::cosim
