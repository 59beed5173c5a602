// SPDX-License-Identifier: Apache-2.0
#include "cosim/node/observer.h"

#include "cosim/protocol/text.h"

#include <algorithm>

namespace fledge::cosim {

namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr auto gone_after = 2s; ///< libzmq has so much time to connect again
constexpr const char *broker = "the broker at ";

} // namespace

Observer::Observer(zmq::context_t &context, MemberConfig config)
    : member_(context, std::move(config), Role::asynchronous), seen_(context, zmq::socket_type::sub),
      handshake_(context, seen_, member_.keys.has_value(), member_.config.any_user),
      written_(context, zmq::socket_type::xpub)
{
    attach();
    seen_.set(zmq::sockopt::rcvhwm, member_.config.waiting);
    seen_.set(zmq::sockopt::subscribe, "finish");
    member_.connect(seen_, broker, backend_);
}

/// Ask the controller for the broker's addresses and all topics.
void Observer::attach()
{
    auto attached = member_.greet<Attached>();
    member_.hang_up();
    frontend_ = member_.reachable(attached.frontend);
    backend_ = member_.reachable(attached.backend);
    const std::lock_guard lock(mutex_);
    for (Channel &channel : attached.channels) {
        outputs_[channel.topic].first = channel.schema.size;
        topics_[channel.topic] = std::move(channel.schema);
    }
}

void Observer::subscribe(const std::string &prefix)
{
    seen_.set(zmq::sockopt::subscribe, prefix);
    seen_.set(zmq::sockopt::subscribe, "ready"); // to the broker: it hears from here on
}

const Schema &Observer::schema(const std::string &topic)
{
    if (!topics_.contains(topic)) {
        attach(); // nodes may have joined
    }
    const auto found = topics_.find(topic);
    if (found == topics_.end()) {
        throw LinkError("there is no topic " + topic);
    }
    return found->second;
}

std::optional<Observed> Observer::next(std::chrono::milliseconds most)
{
    zmq::message_t topic;
    for (const auto end = Clock::now() + most; !over_;) {
        const auto rest = std::chrono::ceil<std::chrono::milliseconds>(end - Clock::now());
        if (handshake_.receive(topic, std::clamp(rest, 0ms, 100ms), broker + backend_, member_.config.node)) {
            if (auto observed = read(std::move(topic))) {
                return observed;
            }
        } else if (handshake_.gone_for(gone_after)) {
            throw LinkError("the controller is gone");
        } else if (rest <= 0ms) {
            break;
        }
    }
    return {};
}

/// Read the message that begins with this part. Nothing for the end, and for a message that came before.
std::optional<Observed> Observer::read(zmq::message_t topic)
{
    zmq::message_t bytes;
    bool more = topic.more();
    for (int parts = 1; more; parts++) {
        if (parts > 1 || !receive_part(seen_, bytes)) {
            throw ProtocolError("the broker sends a message that is not of two parts");
        }
        more = bytes.more();
    }
    if (const std::string fault = text_fault(topic.to_string_view(), TextKind::name); !fault.empty()) {
        throw ProtocolError("the broker sends a topic whose name " + fault);
    }
    Frame frame = decode({bytes.data<std::byte>(), bytes.size()}, member_.config.limits);
    if (auto *finish = std::get_if<Finish>(&frame.message)) {
        over_ = true;
        seen_.set(zmq::sockopt::unsubscribe, "finish"); // which confirms it
        reason_ = std::move(finish->reason);
        return {};
    }
    auto *published = std::get_if<Published>(&frame.message);
    if (!published) {
        throw ProtocolError(std::string("the broker sends ") + kind_name(frame.message));
    }
    Record &record = published->record;
    const auto [at, first] = positions_.try_emplace(topic.to_string());
    Position &position = at->second;
    if (!first && position.count == record.count && position.t == record.t) {
        return {}; // the broker sent it again, for a new subscriber
    }
    // A count that is not greater: counts began at 1 again.
    const bool goes_on = !first && record.count > position.count;
    const std::uint32_t missed = goes_on                  ? record.count - position.count - 1
                                 : !first && record.count ? record.count - 1
                                                          : 0;
    missed_ += missed;
    position = {record.count, record.t};
    return Observed{at->first, std::move(published->node), record.t, record.count, missed, std::move(record.payload)};
}

/// Wait until the broker listens: libzmq drops messages before.
void Observer::prepare_writing()
{
    Handshake handshake(member_.context, written_, member_.keys.has_value(), member_.config.any_user);
    written_.set(zmq::sockopt::xpub_nodrop, true);
    member_.connect(written_, broker, frontend_);
    zmq::message_t subscription;
    if (!handshake.receive(subscription, member_.config.connect_timeout, broker + frontend_, member_.config.node)) {
        throw LinkError("no broker listens at " + frontend_);
    }
    writing_ = true;
}

void Observer::write(const std::string &topic, const Payload &payload)
{
    const std::lock_guard lock(mutex_);
    const auto output = outputs_.find(topic);
    if (output == outputs_.end()) {
        throw LinkError("no node reads " + topic);
    }
    auto &[size, count] = output->second;
    if (payload.size() != size + 4) {
        throw LinkError("a message of " + topic + " has " + std::to_string(payload.size()) +
                        " bytes; expected a CDR header and " + std::to_string(size));
    }
    if (!writing_) {
        prepare_writing();
    }
    Frame published{0, Published{}};
    std::get<Published>(published.message).node = member_.config.node;
    std::get<Published>(published.message).record.count = count + 1;
    std::get<Published>(published.message).record.payload = payload;
    const Bytes frame = encode(published);
    zmq::pollitem_t item{written_.handle(), 0, ZMQ_POLLOUT, 0};
    for (const auto end = Clock::now() + member_.config.connect_timeout;
         !send_part(written_, zmq::buffer(topic), zmq::send_flags::sndmore | zmq::send_flags::dontwait);) {
        const auto rest = std::chrono::ceil<std::chrono::milliseconds>(end - Clock::now());
        if (rest <= 0ms) {
            throw LinkError(broker + frontend_ + " takes no more");
        }
        poll({&item, 1}, rest);
    }
    send_part(written_, zmq::buffer(frame), zmq::send_flags::none);
    count++;
}

} // namespace fledge::cosim
