// SPDX-License-Identifier: Apache-2.0
#include "cosim/node/delegate.h"

#include "cosim/transport/greeting.h"
#include "cosim/transport/shared_channel.h"

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
        throw ProtocolError(std::string("the controller sent ") + kind_name(Message(m)) + ", which is no request");
    }
};

} // namespace

Message answer(Node &node, const Message &request)
{
    return std::visit(Answer{node}, request);
}

Delegate::Delegate(zmq::context_t &context, DelegateConfig config) : context_(context), config_(std::move(config))
{
    ask_environment(config_.simulation, config_.node, config_.address);
    hello_ = {protocol_version, protocol_version, config_.simulation, config_.node};
    if (const std::string place = place_of_keys(config_.keys); !place.empty()) {
        keys_ = read_client_keys(place, config_.node);
    }
}

/// Returns the address of the node's own socket.
Welcome Delegate::greet()
{
    Frame frame = cosim::greet(context_, config_.address, keys_, hello_, config_.connect_timeout, config_.limits);
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

/// A tock without news: the controller need not wake for it if it waits for other nodes.
static bool is_whole(const Message &request, const Message &reply)
{
    const auto *tick = std::get_if<Tick>(&request);
    const auto *tock = std::get_if<Tock>(&reply);
    return tick && tock && tock->reached == tick->until && !tock->leaving;
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
    for (auto connect_timeout = config_.connect_timeout;; connect_timeout = {}) {
        Frame request;
        try {
            request = link.wait(connect_timeout);
        } catch (const ProtocolError &error) {
            link.send({0, Failed{error.what()}});
            throw;
        }
        try {
            const Frame reply{request.number, answer(node, request.message)};
            link.send(reply, !is_whole(request.message, reply.message));
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
