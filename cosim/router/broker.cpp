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
constexpr const char *ready_topic = "ready"; ///< an observer subscribes to it behind its first topics

std::string listen(zmq::socket_t &socket, const std::string &address, const char *what)
{
    try {
        bind(socket, address);
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
    std::vector<zmq::socket_t *> sockets = {&frontend_, &backend_};
    for (const auto &[program, observers] : config_.observers) {
        for (unsigned n = 0; n < observers; n++) {
            complete_.emplace_back(program, zmq::socket_t(context, zmq::socket_type::xpub));
            sockets.push_back(&complete_.back().socket);
        }
    }
    for (zmq::socket_t *socket : sockets) {
        set_up(*socket, config_.limits);
        if (!config_.any_user) {
            refuse_other_users(*socket);
        }
        if (authenticator_) {
            authenticator_->guard(*socket);
        }
    }
    for (zmq::socket_t *socket : std::span(sockets).subspan(1)) {
        socket->set(zmq::sockopt::maxmsgsize, longest_subscription); // it receives only subscriptions
        socket->set(zmq::sockopt::sndhwm, config_.waiting);
        socket->set(zmq::sockopt::xpub_verbose, true);
    }
    frontend_address_ = listen(frontend_, config_.frontend, "what asynchronous programs publish");
    backend_address_ = listen(backend_, config_.backend, "observers");
    for (Complete &observer : complete_) {
        observer.socket.set(zmq::sockopt::xpub_nodrop, true);
        const std::string number = config_.complete.starts_with("tcp://") ? "" : "-" + std::to_string(given_++);
        observer.address = listen(observer.socket, config_.complete + number, "complete observers");
    }
    send_part(frontend_, zmq::buffer("\1", 1), zmq::send_flags::none); // subscribe to all topics of all programs
    thread_ = std::thread([this] { serve(); });
}

Broker::~Broker()
{
    ends_ = true;
    for (int n = 0; (end_is_late_ || !late_.empty()) && (n < 200 || !complete_.empty()); n++) {
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
    const auto same = [&](const auto &late) { return late.first == topic; };
    const auto older = std::find_if(late_.begin(), late_.end(), same);
    if (older == late_.end() && (late_.empty() || complete_.empty()) && put(Kind::record, topic, node, record)) {
        return;
    }
    if (sizeof(Head) + topic.size() + node.size() + record.payload.size() > ring_.largest()) {
        dropped_.fetch_add(1, std::memory_order_relaxed); // it is too large for the ring
        return;
    }
    if (older == late_.end() || !complete_.empty()) {
        late_.emplace_back(topic, Published{record, node});
        return;
    }
    older->second = {record, node};
    dropped_.fetch_add(1, std::memory_order_relaxed);
}

void Broker::send_late()
{
    for (; !late_.empty(); late_.pop_front()) {
        const auto &[topic, published] = late_.front();
        if (!put(Kind::record, topic, published.node, published.record)) {
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

const std::string &Broker::backend(const std::string &program)
{
    std::optional<std::size_t> shared;
    for (std::size_t n = 1; n <= complete_.size(); n++) {
        const std::size_t at = (given_ + n) % complete_.size();
        if (complete_[at].program != program) {
            continue;
        }
        if (!complete_[at].taken) {
            given_ = at;
            return complete_[at].address;
        }
        shared = shared.value_or(at);
    }
    given_ = shared.value_or(given_);
    return shared ? complete_[*shared].address : backend_address_;
}

std::size_t Broker::came(const std::string &program) const
{
    std::size_t n = 0;
    for (const Complete &observer : complete_) {
        n += observer.program == program ? observer.came.load(std::memory_order_relaxed) : 0;
    }
    return n;
}

// ---- on the broker's thread

void Broker::serve()
{
    if (complete_.empty()) { // the run has priority
        setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), background);
    }
    std::vector<zmq::pollitem_t> items{{frontend_.handle(), 0, ZMQ_POLLIN, 0}, {backend_.handle(), 0, ZMQ_POLLIN, 0}};
    for (Complete &observer : complete_) {
        items.push_back({observer.socket.handle(), 0, ZMQ_POLLIN, 0});
    }
    std::optional<std::chrono::steady_clock::time_point> stopped_at;
    for (auto pause = shortest;;) {
        try {
            const bool stop = stop_; // read before the ring, so that no entry is missed
            if (ends_ && config_.patience == 0ms) {
                config_.patience = config_.last_patience;
                for (Complete &observer : complete_) {
                    observer.stuck.clear(); // its time begins now
                }
            }
            receive_subscriptions(backend_, nullptr);
            for (Complete &observer : complete_) {
                receive_subscriptions(observer.socket, &observer);
            }
            bool busy = receive_messages();
            busy = drain() || busy;
            const bool waits = shown_, delivered = !waits && send_end();
            const auto now = std::chrono::steady_clock::now();
            if (stop && (!stopped_at || waits)) {
                stopped_at = now;
            }
            const auto most = complete_.empty() ? end_timeout : config_.patience;
            if (!busy && stop && !waits && (delivered || now - *stopped_at >= most)) {
                return;
            }
            pause = busy || waits ? shortest : std::min(2 * pause, std::chrono::milliseconds(longest));
            poll(items, busy || waits ? 0ms : pause);
            if (busy || waits) {
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
        if (!std::exchange(shown_, true)) {
            publish(entry);
        }
        if (!deliver()) {
            break; // it waits at the head of the ring
        }
        shown_ = false;
        ring_.pop();
    }
    if (!shown_ && std::chrono::steady_clock::now() - seen_newest_ >= longest) {
        show_newest();
    }
    return n > 0;
}

bool Broker::send_to(Complete &observer)
{
    const bool sent =
        send_part(observer.socket, zmq::buffer(topic_), zmq::send_flags::sndmore | zmq::send_flags::dontwait) &&
        send_part(observer.socket, zmq::buffer(frame_), zmq::send_flags::dontwait);
    const auto takes_it = [&](const auto &its) { return its.first == &observer && topic_.starts_with(its.second); };
    if (sent && !observer.stuck.empty() && std::any_of(subscribed_.begin(), subscribed_.end(), takes_it)) {
        observer.stuck.clear();
    }
    return sent;
}

/// Show complete observers the newest message of the topics of which they may miss some.
void Broker::show_newest()
{
    seen_newest_ = std::chrono::steady_clock::now();
    for (Complete &observer : complete_) {
        for (auto it = observer.newer.begin(); it != observer.newer.end(); it = observer.newer.erase(it)) {
            encode({0, last_[*it].published}, frame_);
            topic_ = *it;
            if (!send_to(observer)) {
                break; // later
            }
        }
    }
    topic_.clear();
}

/// Whether all complete observers have the message that was sent to the others.
bool Broker::deliver()
{
    bool all = true;
    for (Complete &observer : complete_) {
        observer.has = topic_.empty() || observer.has || send_to(observer) || gave_up(observer);
        all = all && observer.has;
    }
    if (all) {
        topic_.clear();
    }
    return all;
}

/// Whether the observer, which does not take the message, has lost it.
bool Broker::gave_up(Complete &observer)
{
    const auto now = std::chrono::steady_clock::now();
    if (observer.stuck.empty()) {
        observer.stuck = topic_;
        observer.stuck_since = now;
    }
    if (config_.patience == 0ms || now - observer.stuck_since < config_.patience) {
        return false;
    }
    const std::string stuck = observer.stuck;
    observer.socket.set(zmq::sockopt::xpub_nodrop, false);
    (void)send_to(observer); // to others of this backend; libzmq drops for it until it takes some
    observer.socket.set(zmq::sockopt::xpub_nodrop, true);
    observer.stuck = stuck;
    report("a program that is to hear everything, of " + observer.program + ", has taken no message of " + stuck +
           " for " + std::to_string(config_.patience / 1ms) + " ms; the run goes on, and it misses messages");
    return true;
}

void Broker::publish(std::span<const std::byte> entry)
{
    Head head;
    std::memcpy(&head, entry.data(), sizeof head);
    const char *text = reinterpret_cast<const char *>(entry.data()) + sizeof head;
    const std::string topic(text, head.topic);
    if (head.kind == Kind::finish) {
        finish_ = Finish{topic};
        show_newest();
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
        if (!config_.complete_topics.empty() && !config_.complete_topics.contains(topic)) {
            topic_.clear();
            for (Complete &observer : complete_) {
                observer.newer.insert(topic);
            }
        }
    }
}

void Broker::send(const std::string &topic, const Message &message)
{
    encode({0, message}, frame_);
    topic_ = topic;
    for (Complete &observer : complete_) {
        observer.has = false;
    }
    // libzmq drops the whole message for observers whose queue is full.
    (void)send_part(backend_, zmq::buffer(topic), zmq::send_flags::sndmore | zmq::send_flags::dontwait);
    (void)send_part(backend_, zmq::buffer(frame_), zmq::send_flags::dontwait);
}

/// Whether all observers have received the end of the run.
bool Broker::send_end()
{
    const auto hears_end = [](const auto &subscription) { return subscription.second == finish_topic; };
    if (finish_ && std::any_of(subscribed_.begin(), subscribed_.end(), hears_end)) {
        send(finish_topic, *finish_);
        (void)deliver();
        return false;
    }
    return true;
}

bool Broker::subscribed(const std::string &topic, Last &last)
{
    if (last.looked != subscriptions_) {
        last.looked = subscriptions_;
        last.subscribed = std::any_of(subscribed_.begin(), subscribed_.end(),
                                      [&](const auto &subscription) { return topic.starts_with(subscription.second); });
    }
    return last.subscribed;
}

void Broker::receive_subscriptions(zmq::socket_t &socket, Complete *complete)
{
    zmq::message_t message;
    for (int n = 0; n < most_messages && !shown_ && receive_part(socket, message); n++) {
        const std::string_view text = message.to_string_view();
        if (text.empty() || text[0] > 1 || text[0] < 0) {
            refused_++; // it is not a subscription
            continue;
        }
        const std::string prefix(text.substr(1));
        if (complete && prefix == ready_topic) {
            complete->came += text[0] == 1;
            complete->taken = text[0] == 1;
        }
        if (text[0] == 0) {
            subscribed_.erase({complete, prefix});
            subscriptions_++;
            continue;
        }
        if (subscribed_.emplace(complete, prefix).second) {
            subscriptions_++;
        }
        for (auto it = last_.lower_bound(prefix); it != last_.end() && it->first.starts_with(prefix); ++it) {
            send(it->first, it->second.published);
            if (complete) {
                (void)send_to(*complete); // a full queue has newer messages than this initial value
            }
            topic_.clear();
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
    report("the broker refused a message: " + why);
}

void Broker::report(const std::string &text)
{
    const std::lock_guard lock(mutex_);
    if (reported_.size() < most_reports && reported_.insert(text).second) {
        reports_.push_back(text);
    }
}

} // namespace fledge::cosim
