// SPDX-License-Identifier: Apache-2.0
#include "cosim/node/observer.h"

namespace fledge::cosim {

namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr auto gone_after = 2s; ///< libzmq has so much time to connect again

ObserverConfig completed(ObserverConfig config)
{
    ask_environment(config.simulation, config.name, config.address);
    return config;
}

std::optional<ClientKeys> keys_of(const ObserverConfig &config)
{
    const std::string place = place_of_keys(config.keys);
    return place.empty() ? std::nullopt : std::optional(read_client_keys(place, config.name));
}

std::chrono::milliseconds until(Clock::time_point end)
{
    return std::max(0ms, std::chrono::ceil<std::chrono::milliseconds>(end - Clock::now()));
}

} // namespace

Observer::Observer(zmq::context_t &context, ObserverConfig config)
    : context_(context), config_(completed(std::move(config))), keys_(keys_of(config_)),
      seen_(context, zmq::socket_type::sub), handshake_(context, seen_, keys_.has_value()),
      written_(context, zmq::socket_type::xpub)
{
    attach();
    seen_.set(zmq::sockopt::rcvhwm, config_.waiting);
    seen_.set(zmq::sockopt::subscribe, "finish");
    connect(seen_, backend_);
}

Observer::~Observer() = default;

void Observer::attach()
{
    Hello hello;
    hello.simulation = config_.simulation;
    hello.node = config_.name;
    hello.role = Role::asynchronous;
    Frame frame = greet(context_, config_.address, keys_, hello, config_.connect_timeout, config_.limits);
    auto *attached = std::get_if<Attached>(&frame.message);
    if (!attached) {
        throw ProtocolError(std::string("the controller answers an asynchronous program with ") +
                            kind_name(frame.message));
    }
    frontend_ = reachable(attached->frontend, config_.address);
    backend_ = reachable(attached->backend, config_.address);
    const std::lock_guard lock(mutex_);
    for (Channel &channel : attached->channels) {
        outputs_[channel.topic].first = channel.schema.size;
        topics_[channel.topic] = std::move(channel.schema);
    }
}

void Observer::connect(zmq::socket_t &socket, const std::string &address)
{
    set_up(socket, config_.limits);
    if (keys_) {
        use_keys(socket, *keys_);
    }
    try {
        socket.connect(address);
    } catch (const zmq::error_t &error) {
        throw LinkError("cannot connect to the broker at " + address + ": " + error.what());
    }
}

void Observer::subscribe(const std::string &prefix)
{
    seen_.set(zmq::sockopt::subscribe, prefix);
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
    std::optional<Observed> observed;
    zmq::pollitem_t items[] = {{seen_.handle(), 0, ZMQ_POLLIN, 0}, handshake_.events()};
    for (const auto end = Clock::now() + most; !over_;) {
        if (receive(observed)) {
            if (observed) {
                break;
            }
            continue;
        }
        if (!handshake_.failure().empty()) {
            throw LinkError("the broker at " + backend_ + " does not let " + config_.name +
                            " in: " + handshake_.failure());
        }
        if (handshake_.gone_for(gone_after)) {
            throw LinkError("the controller is gone");
        }
        const auto rest = until(end);
        if (!rest.count()) {
            break;
        }
        poll(items, std::min(rest, std::chrono::milliseconds(100)));
    }
    return observed;
}

/// False if nothing has come. A repeated message, or the end, leaves `observed` empty.
bool Observer::receive(std::optional<Observed> &observed)
{
    zmq::message_t parts[2];
    auto &[topic, bytes] = parts;
    const std::size_t n = receive_parts(seen_, parts);
    if (!n) {
        return false;
    }
    if (n != 2) {
        throw ProtocolError("the broker sends a message that is not of two parts");
    }
    Frame frame = decode({bytes.data<std::byte>(), bytes.size()}, config_.limits);
    if (auto *finish = std::get_if<Finish>(&frame.message)) {
        over_ = true;
        seen_.set(zmq::sockopt::unsubscribe, "finish"); // which confirms it
        reason_ = std::move(finish->reason);
        return true;
    }
    auto *published = std::get_if<Published>(&frame.message);
    if (!published) {
        throw ProtocolError(std::string("the broker sends ") + kind_name(frame.message));
    }
    Record &record = published->record;
    const auto [at, first] = positions_.try_emplace(topic.to_string());
    Position &position = at->second;
    if (!first && position.count == record.count && position.t == record.t) {
        return true; // it came again for a new subscriber
    }
    // A count that is not greater: counts began at 1 again.
    const bool goes_on = !first && record.count > position.count;
    const std::uint32_t missed = goes_on                  ? record.count - position.count - 1
                                 : !first && record.count ? record.count - 1
                                                          : 0;
    missed_ += missed;
    position = {record.count, record.t};
    observed =
        Observed{at->first, std::move(published->node), record.t, record.count, missed, std::move(record.payload)};
    return true;
}

/// Wait until the broker listens: libzmq drops messages before.
void Observer::prepare_writing()
{
    Handshake handshake(context_, written_, keys_.has_value());
    written_.set(zmq::sockopt::xpub_nodrop, true);
    connect(written_, frontend_);
    zmq::pollitem_t items[] = {{written_.handle(), 0, ZMQ_POLLIN, 0}, handshake.events()};
    zmq::message_t subscription;
    for (const auto end = Clock::now() + config_.connect_timeout;
         !written_.recv(subscription, zmq::recv_flags::dontwait);) {
        if (!handshake.failure().empty()) {
            throw LinkError("the broker at " + frontend_ + " does not let " + config_.name +
                            " in: " + handshake.failure());
        }
        const auto rest = until(end);
        if (!rest.count()) {
            throw LinkError("no broker listens at " + frontend_);
        }
        poll(items, rest);
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
    std::get<Published>(published.message).node = config_.name;
    std::get<Published>(published.message).record.count = count + 1;
    std::get<Published>(published.message).record.payload = payload;
    const Bytes frame = encode(published);
    zmq::pollitem_t item{written_.handle(), 0, ZMQ_POLLOUT, 0};
    for (const auto end = Clock::now() + config_.connect_timeout;
         !written_.send(zmq::buffer(topic), zmq::send_flags::sndmore | zmq::send_flags::dontwait);) {
        const auto rest = until(end);
        if (!rest.count()) {
            throw LinkError("the broker at " + frontend_ + " takes no more");
        }
        poll({&item, 1}, rest);
    }
    written_.send(zmq::buffer(frame), zmq::send_flags::none);
    count++;
}

} // namespace fledge::cosim
