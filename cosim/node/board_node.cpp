// SPDX-License-Identifier: Apache-2.0
#include "cosim/node/board_node.h"

#include "sim/text.h"

#include <algorithm>
#include <limits>

namespace fledge::cosim {

static_assert(static_cast<int>(Latency::next_instant) == MISSION_NEXT_INSTANT &&
              static_cast<int>(Latency::next_exchange) == MISSION_NEXT_EXCHANGE);

BoardNode::BoardNode(const MissionHost &mission, registers::Backend &backend, std::chrono::nanoseconds reply_timeout)
    : mission_(mission), backend_(backend), outside_(backend), reply_timeout_(reply_timeout)
{
    const MissionIo &io = *mission.io;
    for (std::uint32_t id = 0; id < io.n_messages; id++) {
        const MissionMessage &m = io.messages[id];
        const MissionDefinition &d = mission.definitions[mission.topics[id].definition];
        Message one;
        one.topic = mission.topics[id].topic;
        one.schema = make_schema(d.type, d.text);
        one.fields = parse_schema(d.text);
        one.held.resize(m.size);
        one.to_flight = m.direction == MISSION_IN;
        one.carried = mission_io_carries(&io, id) != 0;
        messages_.push_back(std::move(one));
    }
}

void BoardNode::load(Ns after, std::uint32_t id, Bytes block)
{
    const MissionIo &io = *mission_.io;
    const std::uint32_t place = id - io.n_messages;
    if (id < io.n_messages || place >= io.n_parameters || !mission_io_carries(&io, id)) {
        throw registers::Error("no snorkel carries parameters of the id " + std::to_string(id));
    }
    if (block.size() != io.parameters[place].size) {
        throw registers::Error(std::string("the parameters of ") + io.parameters[place].path + " have " +
                               std::to_string(io.parameters[place].size) + " bytes, found " +
                               std::to_string(block.size()));
    }
    loads_.push_back({after, id, std::move(block)});
}

Initialized BoardNode::initialize(const Initialize &request)
{
    if (request.start >= 0) {
        throw registers::Error("flight on a board cannot begin at " + sim::format_time(request.start) +
                               ": it makes no snapshots to go on from");
    }
    for (std::uint32_t id = 0; id < messages_.size(); id++) {
        Message &message = messages_[id];
        std::fill(message.held.begin(), message.held.end(), std::byte{});
        if (reached_ >= 0 && message.to_flight) { // the lanes hold messages of the last run
            mission_io_put(mission_.io, backend_.windows().data(), id, message.held.data(), &counts_);
        }
    }
    reached_ = -1;
    loaded_ = 0;
    exchange(-1);
    Initialized answer;
    for (std::uint16_t i = 0; i < mission_.n_rates; i++) {
        answer.rates.push_back({mission_.rates[i].period, mission_.rates[i].offset});
    }
    return answer;
}

std::vector<Subscription> BoardNode::desired()
{
    std::vector<Subscription> subscriptions;
    for (std::uint32_t id = 0; id < messages_.size(); id++) {
        const MissionTopic &topic = mission_.topics[id];
        if (messages_[id].to_flight && messages_[id].carried) {
            subscriptions.push_back(
                {messages_[id].topic, static_cast<Latency>(topic.latency), topic.optional != 0, messages_[id].schema});
        }
    }
    return subscriptions;
}

std::vector<Publication> BoardNode::match(const std::vector<Channel> &asked)
{
    std::vector<Publication> publications;
    outbox_.clear();
    for (const Channel &channel : asked) {
        for (std::uint32_t id = 0; id < messages_.size(); id++) {
            const Message &message = messages_[id];
            if (!message.to_flight && message.carried && message.topic == channel.topic) {
                publications.push_back({channel.channel, message.schema, make_payload(message.held)});
                outbox_.add(channel.channel, message.held);
            }
        }
    }
    return publications;
}

void BoardNode::start(const std::vector<Channel> &wired)
{
    inbox_.open(wired);
    inputs_.clear();
    for (const Channel &channel : wired) {
        const auto found = std::find_if(messages_.begin(), messages_.end(),
                                        [&](const Message &m) { return m.topic == channel.topic; });
        if (found == messages_.end()) {
            throw ProtocolError("the controller sends " + channel.topic + ", which flight does not read");
        }
        inputs_[channel.channel] = static_cast<std::uint32_t>(found - messages_.begin());
    }
}

Tock BoardNode::tick(const Tick &tick)
{
    inbox_.take(tick.records);
    Tock tock;
    tock.reached = tick.until;
    for (Ns t = next_after(reached_); t <= tick.until; t = next_after(t)) {
        inbox_.see(t, [this](const Record &record) {
            const std::uint32_t id = inputs_.at(record.channel);
            read_payload(record.payload, messages_[id].fields, messages_[id].held);
            mission_io_put(mission_.io, backend_.windows().data(), id, messages_[id].held.data(), &counts_);
        });
        for (; loaded_ < loads_.size() && loads_[loaded_].after < t; loaded_++) {
            const Load &load = loads_[loaded_];
            mission_io_put(mission_.io, backend_.windows().data(), load.id, load.block.data(), &counts_);
        }
        exchange(t);
        outbox_.collect(t, tock.records);
        reached_ = t;
    }
    return tock;
}

void BoardNode::finish(const std::string &)
{
    outside_.stop();
}

/// The first of flight's instants after t.
Ns BoardNode::next_after(Ns t) const
{
    Ns next = std::numeric_limits<Ns>::max();
    for (std::uint16_t i = 0; i < mission_.n_rates; i++) {
        next = std::min(next, exec_on_grid(mission_.rates[i], t + 1));
    }
    return next;
}

/// Let flight step at t, and take its outputs.
void BoardNode::exchange(Ns t)
{
    switch (outside_.tick({t, t < 0 || reached_ < 0 ? 0 : t - reached_}, reply_timeout_)) {
    case registers::Wait::done: break;
    case registers::Wait::late:
        throw registers::Error("flight on the board did not answer the tick at " + sim::format_time(t) + " within " +
                               sim::format_time(reply_timeout_.count()));
    case registers::Wait::gone:
        throw registers::Error("flight on the board ended in the tick at " + sim::format_time(t));
    }
    for (std::uint32_t id = 0; id < messages_.size(); id++) {
        Message &message = messages_[id];
        if (!message.to_flight && message.carried) {
            mission_io_take(mission_.io, backend_.windows().data(), id, message.held.data(), t, &counts_);
        }
    }
}

} // namespace fledge::cosim
