// SPDX-License-Identifier: Apache-2.0
#include "cosim/router/broker.h"

#include "cosim/protocol/text.h"

#include <algorithm>
#include <cstring>
#include <sys/resource.h>
#include <unistd.h>
#include <utility>

namespace fledge::cosim {

namespace {

using namespace std::chrono_literals;

constexpr auto shortest = 1ms, longest = 20ms; ///< between two looks at the ring
constexpr auto end_timeout = 500ms;
constexpr int background = 10; ///< niceness of the thread
constexpr int most_entries = 4096, most_messages = 256;
constexpr std::int64_t longest_subscription = 4096;
constexpr std::size_t most_written = 1024, most_reports = 20;
constexpr const char *finish_topic = "finish";

std::string listen(zmq::socket_t &socket, const std::string &address, const char *what)
{
    try {
        socket.bind(address);
    } catch (const zmq::error_t &error) {
        throw LinkError(std::string("cannot listen at ") + address + " for " + what + ": " + error.what());
    }
    return socket.get(zmq::sockopt::last_endpoint);
}

} // namespace

Broker::Broker(zmq::context_t &context, BrokerConfig config, Authenticator *authenticator)
    : config_(std::move(config)), authenticator_(authenticator), frontend_(context, zmq::socket_type::xsub),
      backend_(context, zmq::socket_type::xpub), ring_(config_.room)
{
    for (zmq::socket_t *socket : {&frontend_, &backend_}) {
        set_up(*socket, config_.limits);
        if (!config_.any_user) {
            refuse_other_users(*socket);
        }
        if (authenticator_) {
            authenticator_->guard(*socket);
        }
    }
    backend_.set(zmq::sockopt::maxmsgsize, longest_subscription); // it receives only subscriptions
    backend_.set(zmq::sockopt::sndhwm, config_.waiting);
    backend_.set(zmq::sockopt::xpub_verbose, true);
    frontend_address_ = listen(frontend_, config_.frontend, "what asynchronous programs publish");
    backend_address_ = listen(backend_, config_.backend, "observers");
    frontend_.send(zmq::buffer("\1", 1), zmq::send_flags::none); // subscribe to all topics of all programs
    thread_ = std::thread([this] { serve(); });
}

Broker::~Broker()
{
    for (int n = 0; (end_is_late_ || !late_.empty()) && n < 200; n++) {
        std::this_thread::sleep_for(shortest);
        send_late();
    }
    stop_ = true;
    thread_.join();
}

// ---- on the Router's thread

void Broker::began(const Exchange &exchange)
{
    topics_.clear();
    for (std::uint32_t channel = 0; channel < exchange.topics.size(); channel++) {
        const Exchange::Topic &topic = exchange.topics[channel];
        topics_.push_back(topic.name);
        if (!topic.initial.empty()) {
            put_now_or_later(topic.name, topic.writer, {channel, 0, exchange.after, topic.initial});
        }
    }
}

void Broker::wrote(const std::string &node, const std::vector<Record> &records)
{
    if (!late_.empty()) {
        send_late();
    }
    for (const Record &record : records) {
        if (record.t <= config_.after) {
            past_.insert_or_assign(record.channel, std::pair(node, record));
            continue;
        }
        pass_on_past(record.channel);
        pass_on(node, record);
    }
}

void Broker::settled(Ns t)
{
    while (t >= config_.after && !past_.empty()) {
        pass_on_past(past_.begin()->first);
    }
}

void Broker::pass_on_past(std::uint32_t channel)
{
    if (const auto past = past_.extract(channel)) {
        pass_on(past.mapped().first, past.mapped().second);
    }
}

void Broker::pass_on(const std::string &node, const Record &record)
{
    put_now_or_later(topics_[record.channel], node, record);
    published_.fetch_add(1, std::memory_order_relaxed);
}

void Broker::ended(const std::string &reason)
{
    end_ = reason;
    end_is_late_ = true;
    send_late();
}

void Broker::put_now_or_later(const std::string &topic, const std::string &node, const Record &record)
{
    if ((late_.empty() || !late_.contains(topic)) && put(Kind::record, topic, node, record)) {
        return;
    }
    if (sizeof(Head) + topic.size() + node.size() + record.payload.size() > ring_.largest()) {
        dropped_.fetch_add(1, std::memory_order_relaxed); // it is too large for the ring
        return;
    }
    const bool first = late_.insert_or_assign(topic, Published{record, node}).second;
    dropped_.fetch_add(!first, std::memory_order_relaxed);
}

void Broker::send_late()
{
    for (auto it = late_.begin(); it != late_.end(); it = late_.erase(it)) {
        if (!put(Kind::record, it->first, it->second.node, it->second.record)) {
            return;
        }
    }
    if (end_is_late_) {
        end_is_late_ = !put(Kind::finish, end_.substr(0, config_.limits.text), "", {});
    }
}

bool Broker::put(Kind kind, const std::string &topic, const std::string &node, const Record &record)
{
    std::byte *at = ring_.claim(sizeof(Head) + topic.size() + node.size() + record.payload.size());
    if (!at) {
        return false;
    }
    const Head head{kind,
                    record.channel,
                    record.count,
                    static_cast<std::uint32_t>(topic.size()),
                    static_cast<std::uint32_t>(node.size()),
                    0,
                    record.payload.size(),
                    record.t};
    const auto append = [&](const void *from, std::size_t n) {
        if (n) {
            std::memcpy(at, from, n);
            at += n;
        }
    };
    append(&head, sizeof head);
    append(topic.data(), topic.size());
    append(node.data(), node.size());
    append(record.payload.data(), record.payload.size());
    ring_.commit();
    return true;
}

std::vector<Broker::Written> Broker::take()
{
    const std::lock_guard lock(mutex_);
    received_any_ = false;
    inbox_bytes_ = 0;
    return std::exchange(inbox_, {});
}

std::vector<std::string> Broker::take_reports()
{
    const std::lock_guard lock(mutex_);
    return std::exchange(reports_, {});
}

BrokerCounts Broker::counts() const
{
    return {published_, dropped_, received_, refused_};
}

// ---- on the broker's thread

void Broker::serve()
{
    // The run has priority.
    setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), background);
    zmq::pollitem_t items[] = {{frontend_.handle(), 0, ZMQ_POLLIN, 0}, {backend_.handle(), 0, ZMQ_POLLIN, 0}};
    std::optional<std::chrono::steady_clock::time_point> stopped_at;
    for (auto pause = shortest;;) {
        try {
            const bool stop = stop_; // read before the ring, so that no entry is missed
            receive_subscriptions();
            bool busy = receive_messages();
            busy = drain() || busy;
            const bool delivered = send_end();
            if (stop && !stopped_at) {
                stopped_at = std::chrono::steady_clock::now();
            }
            if (!busy && stop && (delivered || std::chrono::steady_clock::now() - *stopped_at >= end_timeout)) {
                return;
            }
            pause = busy ? shortest : std::min(2 * pause, std::chrono::milliseconds(longest));
            poll(items, busy ? 0ms : pause);
            if (busy) {
                std::this_thread::sleep_for(shortest); // work in batches: the run needs the processor
            }
        } catch (const zmq::error_t &error) {
            if (error.num() == ETERM) {
                return;
            }
        }
    }
}

bool Broker::drain()
{
    int n = 0;
    for (; n < most_entries; n++) {
        const auto entry = ring_.front();
        if (!entry.data()) {
            break;
        }
        publish(entry);
        ring_.pop();
    }
    return n > 0;
}

void Broker::publish(std::span<const std::byte> entry)
{
    Head head;
    std::memcpy(&head, entry.data(), sizeof head);
    const char *text = reinterpret_cast<const char *>(entry.data()) + sizeof head;
    const std::string topic(text, head.topic);
    if (head.kind == Kind::finish) {
        finish_ = Finish{topic};
        return send(finish_topic, *finish_);
    }
    Last &last = last_[topic];
    last.published.node.assign(text + head.topic, head.node);
    Record &record = last.published.record;
    record.channel = head.channel;
    record.count = head.count;
    record.t = head.t;
    const auto payload = entry.subspan(sizeof head + head.topic + head.node);
    record.payload = payload;
    if (subscribed(topic, last)) {
        send(topic, last.published);
    }
}

void Broker::send(const std::string &topic, const Message &message)
{
    encode({0, message}, frame_);
    // libzmq drops the whole message for observers whose queue is full.
    (void)backend_.send(zmq::buffer(topic), zmq::send_flags::sndmore | zmq::send_flags::dontwait);
    (void)backend_.send(zmq::buffer(frame_), zmq::send_flags::dontwait);
}

/// Whether all observers have received the end of the run.
bool Broker::send_end()
{
    if (finish_ && subscribed_.contains(finish_topic)) {
        send(finish_topic, *finish_);
        return false;
    }
    return true;
}

bool Broker::subscribed(const std::string &topic, Last &last)
{
    if (last.looked != subscriptions_) {
        last.looked = subscriptions_;
        last.subscribed = std::any_of(subscribed_.begin(), subscribed_.end(),
                                      [&](const std::string &prefix) { return topic.starts_with(prefix); });
    }
    return last.subscribed;
}

void Broker::receive_subscriptions()
{
    zmq::message_t message;
    for (int n = 0; n < most_messages && backend_.recv(message, zmq::recv_flags::dontwait); n++) {
        const std::string_view text = message.to_string_view();
        if (text.empty() || text[0] > 1 || text[0] < 0) {
            refused_++; // it is not a subscription
            continue;
        }
        const std::string prefix(text.substr(1));
        if (text[0] == 0) {
            subscribed_.erase(prefix);
            subscriptions_++;
            continue;
        }
        if (subscribed_.insert(prefix).second) {
            subscriptions_++;
        }
        for (auto it = last_.lower_bound(prefix); it != last_.end() && it->first.starts_with(prefix); ++it) {
            send(it->first, it->second.published);
        }
    }
}

bool Broker::receive_messages()
{
    int n = 0;
    for (zmq::message_t parts[2]; n < most_messages; n++) {
        const std::size_t count = receive_parts(frontend_, parts);
        if (!count) {
            break;
        }
        Written written;
        const std::string why =
            count == 2 ? read(parts, written) : "a message of " + std::to_string(count) + " parts, not 2";
        if (!why.empty()) {
            refuse(why);
            continue;
        }
        received_++;
        const std::lock_guard lock(mutex_);
        inbox_bytes_ += written.payload.size();
        inbox_.push_back(std::move(written));
        received_any_ = true;
    }
    return n > 0;
}

/// Why the broker refuses a message; "" if it accepts it.
std::string Broker::read(std::span<zmq::message_t, 2> parts, Written &written)
{
    if (parts[0].size() > config_.limits.name) {
        return "a topic's name of " + std::to_string(parts[0].size()) + " bytes";
    }
    written.topic = parts[0].to_string();
    if (const std::string fault = text_fault(written.topic, TextKind::name); !fault.empty()) {
        return "a topic's name " + fault;
    }
    try {
        Frame frame = decode({parts[1].data<std::byte>(), parts[1].size()}, config_.limits);
        auto *published = std::get_if<Published>(&frame.message);
        if (!published) {
            return std::string("expected Published, found ") + kind_name(frame.message);
        }
        written.program = std::move(published->node);
        written.payload = std::move(published->record.payload);
    } catch (const ProtocolError &error) {
        return error.what();
    }
    if (authenticator_ && !config_.frontend.starts_with("inproc://") &&
        !authenticator_->may_speak_as(parts[1], written.program)) {
        return "the key " + authenticator_->name_of(parts[1]) + " is not allowed to speak as " + written.program;
    }
    const std::lock_guard lock(mutex_);
    return inbox_.size() >= most_written || inbox_bytes_ + written.payload.size() > config_.limits.frame
               ? written.program + " writes faster than the run can take it"
               : "";
}

void Broker::refuse(const std::string &why)
{
    refused_++;
    const std::lock_guard lock(mutex_);
    if (reported_.size() < most_reports && reported_.insert(why).second) {
        reports_.push_back("the broker refused a message: " + why);
    }
}

} // namespace fledge::cosim
