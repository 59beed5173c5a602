// SPDX-License-Identifier: Apache-2.0
#include "cosim/node/delegate.h"

#include "cosim/transport/shared_channel.h"

namespace fledge::cosim {

namespace {

using Clock = std::chrono::steady_clock;

/// The reply of a node to a request.
struct Answer {
    Node &node;

    Message operator()(const Initialize &m) { return node.initialize(m); }
    Message operator()(const ProvideDesired &) { return Desired{node.desired()}; }
    Message operator()(const Match &m) { return Matched{node.match(m.channels)}; }
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

/// The memory that the controller offers, if both are on one machine.
std::unique_ptr<SharedChannel> Delegate::shared_with(const Welcome &welcome) const
{
    if (member_.config.sharing == Sharing::forbidden) {
        return nullptr;
    }
    try {
        if (welcome.shared.empty()) {
            throw LinkError("the controller shares no memory");
        }
        return std::make_unique<SharedChannel>(welcome.shared, welcome.nonce, member_.config.limits);
    } catch (const LinkError &) {
        if (member_.config.sharing == Sharing::required) {
            throw;
        }
        return nullptr;
    }
}

/// A complete tock. It need not wake a controller that waits for other nodes.
static bool is_whole(const Message &request, const Message &reply)
{
    const auto *tick = std::get_if<Tick>(&request);
    const auto *tock = std::get_if<Tock>(&reply);
    return tick && tock && tock->reached == tick->until && !tock->leaving;
}

std::string Delegate::serve(Node &node)
{
    const auto welcome = member_.greet<Welcome>();
    auto shared = shared_with(welcome);
    Link link(member_.context, member_.config.limits);
    member_.connect(link.socket(), "", member_.reachable(welcome.address));
    Hello hello = member_.hello;
    hello.shared = shared != nullptr;
    link.send({1, hello});
    if (shared) {
        link.share(std::move(shared));
    }
    for (auto connect_timeout = member_.config.connect_timeout;; connect_timeout = {}) {
        Frame request;
        try {
            request = link.wait(connect_timeout, member_.config.stopped);
            member_.hang_up(); // the controller knows this program by its own connection now
        } catch (const ProtocolError &error) {
            link.send({0, Failed{error.what()}});
            throw;
        } catch (const LinkError &error) {
            if (member_.config.stopped && *member_.config.stopped) {
                link.send({0, Failed{error.what()}});
            }
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
