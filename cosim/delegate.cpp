// SPDX-License-Identifier: Apache-2.0
#include "cosim/delegate.h"

#include "cosim/shared_channel.h"

#include <cstdlib>

namespace fledge::cosim {

namespace {

using Clock = std::chrono::steady_clock;

/// The reply of a node to a request.
struct Answer {
    Node &node;

    Message operator()(const Initialize &m) { return node.initialize(m); }
    Message operator()(const ProvideDesired &) { return Desired{node.desired()}; }
    Message operator()(const Match &m) { return Matched{node.match(m.asked)}; }
    Message operator()(const Start &m)
    {
        node.start(m.wired);
        return Ready{};
    }
    Message operator()(const Tick &m)
    {
        const auto start = Clock::now();
        Tock tock = node.tick(m);
        if (!tock.compute_ns) {
            tock.compute_ns = std::chrono::nanoseconds(Clock::now() - start).count();
        }
        return tock;
    }
    Message operator()(const Save &) { return Saved{node.save()}; }
    Message operator()(const Finish &m)
    {
        node.finish(m.reason);
        return Finished{};
    }
    template <class M> Message operator()(const M &m)
    {
        throw ProtocolError(std::string("the controller sent ") + kind_name(Message(m)) +
                            ", which is no request");
    }
};

/// A controller that listens everywhere does not know by which name it is reached.
std::string reachable(std::string address, const std::string &controller)
{
    constexpr std::string_view anywhere = "tcp://0.0.0.0:";
    if (address.starts_with(anywhere)) {
        address = controller.substr(0, controller.rfind(':') + 1) + address.substr(anywhere.size());
    }
    return address;
}

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

Message answer(Node &node, const Message &request)
{
    return std::visit(Answer{node}, request);
}

Delegate::Delegate(zmq::context_t &context, DelegateConfig config) : context_(context), config_(std::move(config))
{
    fill_in(config_.simulation, "simulation", "FLEDGE_SIMULATION");
    fill_in(config_.node, "name", "FLEDGE_NODE");
    fill_in(config_.address, "address", "FLEDGE_ADDRESS");
    hello_ = {protocol_version, protocol_version, config_.simulation, config_.node};
    if (const std::string place = place_of_keys(config_.keys); !place.empty()) {
        keys_ = read_client_keys(place, config_.node);
    }
}

/// Returns the way to the node's own socket.
Welcome Delegate::greet()
{
    zmq::socket_t lobby(context_, zmq::socket_type::dealer);
    set_up(lobby, config_.limits);
    lobby.set(zmq::sockopt::linger, 0);
    if (keys_) {
        use_keys(lobby, *keys_);
    }
    Handshake handshake(context_, lobby, keys_.has_value());
    try {
        lobby.connect(config_.address);
    } catch (const zmq::error_t &error) {
        throw LinkError("cannot connect to the controller at " + config_.address + ": " + error.what());
    }
    lobby.send(zmq::buffer(encode({1, hello_})), zmq::send_flags::none);
    zmq::message_t reply;
    zmq::pollitem_t items[] = {{lobby.handle(), 0, ZMQ_POLLIN, 0}, handshake.events()};
    for (const auto end = Clock::now() + config_.patience; !lobby.recv(reply, zmq::recv_flags::dontwait);) {
        if (!handshake.failure().empty()) {
            throw LinkError("the controller at " + config_.address + " does not let " + config_.node + " in: " +
                            handshake.failure());
        }
        const auto rest = std::chrono::ceil<std::chrono::milliseconds>(end - Clock::now());
        if (rest.count() <= 0) {
            throw LinkError("no controller answers at " + config_.address);
        }
        poll(items, rest);
    }
    Frame frame = decode({reply.data<std::byte>(), reply.size()}, config_.limits);
    if (const auto *refused = std::get_if<Refused>(&frame.message)) {
        throw LinkError("the controller refuses " + config_.node + ": " + refused->reason);
    }
    auto *welcome = std::get_if<Welcome>(&frame.message);
    if (!welcome) {
        throw ProtocolError(std::string("the controller answers a Hello with ") + kind_name(frame.message));
    }
    welcome->address = reachable(welcome->address, config_.address);
    return std::move(*welcome);
}

/// The memory that the controller offers, if both are on one machine.
std::unique_ptr<SharedChannel> Delegate::shared_with(const Welcome &welcome) const
{
    if (config_.sharing == Sharing::forbidden) {
        return nullptr;
    }
    try {
        if (welcome.shared.empty()) {
            throw LinkError("the controller shares no memory");
        }
        return std::make_unique<SharedChannel>(welcome.shared, welcome.nonce, config_.limits);
    } catch (const LinkError &) {
        if (config_.sharing == Sharing::required) {
            throw;
        }
        return nullptr;
    }
}

std::string Delegate::serve(Node &node)
{
    const Welcome welcome = greet();
    auto shared = shared_with(welcome);
    Link link(context_, config_.limits);
    if (keys_) {
        use_keys(link.socket(), *keys_);
    }
    link.connect(welcome.address);
    hello_.shared = shared != nullptr;
    link.send({1, hello_});
    if (shared) {
        link.share(std::move(shared));
    }
    for (auto patience = config_.patience;; patience = {}) {
        const Frame request = link.wait(patience);
        try {
            link.send({request.number, answer(node, request.message)});
        } catch (const std::exception &error) {
            link.send({request.number, Failed{error.what()}});
            throw;
        }
        if (const auto *finish = std::get_if<Finish>(&request.message)) {
            return finish->reason;
        }
    }
}

} // namespace fledge::cosim
