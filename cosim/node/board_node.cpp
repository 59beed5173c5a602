// SPDX-License-Identifier: Apache-2.0
#include "cosim/node/board_node.h"

#include "flight/msg/computer.h"
#include "sim/text.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>

namespace fledge::cosim {

static_assert(static_cast<int>(Latency::next_instant) == MISSION_NEXT_INSTANT &&
              static_cast<int>(Latency::next_exchange) == MISSION_NEXT_EXCHANGE);

namespace {

constexpr std::size_t commands_max = 1000; ///< that wait for their lane; a program that sends more loses them

constexpr std::array<char, 16> version = {"fledge board 1"};

/// Collects a snapshot.
struct Writer {
    template <class T> void value(const T &v) { bytes(std::span(&v, 1)); }
    std::size_t size(std::size_t n)
    {
        value(n);
        return n;
    }
    template <class Range> void bytes(const Range &range)
    {
        const auto all = std::as_bytes(std::span(range));
        out.insert(out.end(), all.begin(), all.end());
    }
    Bytes out;
};

/// Reads what a Writer has collected.
struct Reader {
    template <class T> void value(T &v) { bytes(std::span(&v, 1)); }
    std::size_t size(std::size_t n)
    {
        value(n);
        check(n);
        return n;
    }
    template <class Range> void bytes(Range &&range)
    {
        const auto to = std::as_writable_bytes(std::span(range));
        check(to.size());
        std::copy_n(in.begin(), to.size(), to.begin());
        in = in.subspan(to.size());
    }
    void check(std::size_t n) const
    {
        if (n > in.size()) {
            throw registers::Error("its snapshot is cut off, or of another mission");
        }
    }
    std::span<const std::byte> in;
};

/// How long a packet is that begins here, by its header; at most n.
std::size_t length_of(const std::byte *packet, std::size_t n)
{
    return n < 6 ? n
                 : std::min<std::size_t>(n, std::to_integer<std::size_t>(packet[4]) * 256 +
                                                std::to_integer<std::size_t>(packet[5]) + 7);
}

/// The topic of another name in the same process.
std::string beside(const std::string &topic, const char *name)
{
    return topic.substr(0, topic.rfind('/') + 1) + name;
}

} // namespace

/// A message has room for all packets of the lane.
BoardNode::Link::Link(const MissionHost &mission, MissionQueue queue, const char *name)
{
    if (queue.board == MISSION_NO_BOARD || !mission.executive) {
        return;
    }
    const RegisterLane &lane = mission.io->boards[queue.board]->lanes[queue.lane];
    const std::string mode = mission.executive->mode_topic,
                      room = std::to_string((lane.capacity * lane.depth + 3u) / 4u * 4u);
    topic = beside(mode, name);
    schema = make_schema("Packets" + room, "uint32 n  # n [byte] of the packets\nuint8[" + room +
                                               "] bytes  # bytes [-] CCSDS packets, one after another\n");
    fields = parse_schema(schema.text);
    held.resize(schema.size);
}

BoardNode::BoardNode(const MissionHost &mission, registers::Backend &backend, std::chrono::nanoseconds reply_timeout)
    : mission_(mission), backend_(backend), outside_(backend), reply_timeout_(reply_timeout),
      commands_(mission, mission.io->commands, "commands"), telemetry_(mission, mission.io->telemetry, "telemetry")
{
    const MissionIo &io = *mission.io;
    for (std::uint32_t id = 0; id < io.n_messages; id++) {
        const MissionMessage &m = io.messages[id];
        const MissionDefinition &d = mission.definitions[mission.topics[id].definition];
        Message message;
        message.topic = mission.topics[id].topic;
        message.schema = make_schema(d.type, d.text);
        message.fields = parse_schema(d.text);
        message.held.resize(m.size);
        message.to_flight = m.direction == MISSION_IN;
        message.carried = mission_io_carries(&io, id) != 0;
        messages_.push_back(std::move(message));
    }
    if (const MissionQueue lane = io.telemetry; lane.board != MISSION_NO_BOARD) {
        packet_.resize(io.boards[lane.board]->lanes[lane.lane].capacity);
    }
}

void BoardNode::command(Ns after, std::vector<std::uint8_t> packet)
{
    if (mission_.io->commands.board == MISSION_NO_BOARD) {
        throw registers::Error("no snorkel carries commands; add one with carries = \"commands\"");
    }
    script_.push_back({after, std::move(packet)});
}

void BoardNode::speak_by_radio()
{
    if (commands_.topic.empty() || telemetry_.topic.empty()) {
        throw registers::Error("flight has a radio, but no snorkels carry its commands and telemetry; add those with "
                               "carries = \"commands\" and carries = \"telemetry\"");
    }
    by_radio_ = true;
}

Initialized BoardNode::initialize(const Initialize &request)
{
    Initialized answer;
    answer.saves = backend_.saves();
    for (std::uint16_t i = 0; i < mission_.n_rates; i++) {
        answer.rates.push_back({mission_.rates[i].period, mission_.rates[i].offset});
    }
    if (!request.snapshot.empty()) {
        restore(request);
        return answer;
    }
    if (request.start >= 0) {
        throw registers::Error("flight on a board cannot begin at " + sim::format_time(request.start) +
                               " without a snapshot to go on from");
    }
    for (std::uint32_t id = 0; id < messages_.size(); id++) {
        Message &message = messages_[id];
        std::fill(message.held.begin(), message.held.end(), std::byte{});
        if (reached_ >= 0 && message.to_flight) { // the lanes hold messages of the last run
            mission_io_put(mission_.io, backend_.windows().data(), id, message.held.data(), &counts_);
        }
    }
    reached_ = -1;
    sent_ = 0;
    waiting_.clear();
    found_.clear();
    was_down_ = false;
    exchange(-1);
    return answer;
}

std::vector<Subscription> BoardNode::desired()
{
    std::vector<Subscription> subscriptions;
    for (std::uint32_t id = 0; id < messages_.size(); id++) {
        const MissionTopic &topic = mission_.topics[id];
        if (messages_[id].to_flight && (messages_[id].carried || id == mission_.reset)) {
            subscriptions.push_back(
                {messages_[id].topic, static_cast<Latency>(topic.latency), topic.optional != 0, messages_[id].schema});
        }
    }
    if (!commands_.topic.empty()) {
        subscriptions.push_back({commands_.topic, Latency::next_instant, true, commands_.schema});
    }
    if (by_radio_) {
        subscriptions.push_back({beside(commands_.topic, "uplink"), Latency::same_instant, true, {}});
    }
    return subscriptions;
}

std::vector<Publication> BoardNode::match(const std::vector<Channel> &channels)
{
    std::vector<Publication> publications;
    outbox_.clear();
    telemetry_.channel.reset();
    published_ = 0;
    downlink_.close();
    for (const Channel &channel : channels) {
        if (!telemetry_.topic.empty() && channel.topic == telemetry_.topic) {
            telemetry_.channel = channel.channel;
            publications.push_back({channel.channel, telemetry_.schema, make_payload(telemetry_.held)});
        }
        if (by_radio_ && channel.topic == beside(telemetry_.topic, "downlink")) {
            const MissionQueue lane = mission_.io->telemetry;
            const std::uint32_t depth = mission_.io->boards[lane.board]->lanes[lane.lane].depth;
            publications.push_back(downlink_.open(
                channel.channel,
                std::max<std::size_t>(std::min<std::size_t>(telemetry_.room() + unit_header * depth, 1u << 15),
                                      packet_.size() + unit_header),
                0));
        }
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
    commands_.channel.reset();
    uplink_.reset();
    for (const Channel &channel : wired) {
        if (by_radio_ && channel.topic == beside(commands_.topic, "uplink")) {
            uplink_ = channel.channel;
            continue;
        }
        if (!commands_.topic.empty() && channel.topic == commands_.topic) {
            commands_.channel = channel.channel;
            continue;
        }
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
            if (record.channel == commands_.channel) {
                take_commands(record);
                return;
            }
            if (record.channel == uplink_) {
                received_ = units_of(record.payload);
                return;
            }
            const std::uint32_t id = inputs_.at(record.channel);
            read_payload(record.payload, messages_[id].fields, messages_[id].held);
            mission_io_put(mission_.io, backend_.windows().data(), id, messages_[id].held.data(), &counts_);
        });
        const bool down = is_down(t);
        for (const sim::Packet &unit : received_) { // what comes while the computer is down is lost, as on the desktop
            if (!down && !was_down_) {
                take_unit(reinterpret_cast<const std::byte *>(unit.bytes.data()), unit.bytes.size());
            }
        }
        received_.clear();
        was_down_ = down;
        if (!down) {
            send_commands(t);
            exchange(t);
            outbox_.collect(t, tock.records);
            put_telemetry(t, tock.records);
            if (downlink_) {
                downlink_.write(t, transmitted_, tock.records);
            }
        }
        reached_ = t;
    }
    return tock;
}

/// All that decides what the node does next, besides flight's computer and its registers.
template <class Archive> void BoardNode::pass_state(Archive &archive)
{
    archive.value(reached_);
    archive.value(sent_);
    archive.value(counts_);
    archive.value(was_down_);
    for (Message &message : messages_) {
        archive.bytes(message.held);
    }
    archive.bytes(telemetry_.held);
    for (auto *packets : {&waiting_, &found_}) {
        packets->resize(archive.size(packets->size()));
        for (auto &packet : *packets) {
            packet.resize(archive.size(packet.size()));
            archive.bytes(packet);
        }
    }
}

Bytes BoardNode::save()
{
    Writer writer;
    writer.value(version);
    pass_state(writer);
    for (const Bytes &part : {outside_.save(), backend_.save(reply_timeout_)}) {
        writer.size(part.size());
        writer.bytes(part);
    }
    return std::move(writer.out);
}

void BoardNode::restore(const Initialize &request)
{
    Reader reader{request.snapshot};
    auto found = version;
    reader.value(found);
    if (found != version) {
        throw registers::Error("its snapshot is of another version of Fledge");
    }
    pass_state(reader);
    Bytes outside, computer;
    for (Bytes *part : {&outside, &computer}) {
        part->resize(reader.size(0));
        reader.bytes(*part);
    }
    if (!reader.in.empty()) {
        throw registers::Error("its snapshot is of another mission");
    }
    if (reached_ > request.start || next_after(reached_) <= request.start) {
        throw registers::Error("its snapshot is of " + sim::format_time(reached_) + ", but it has to begin after " +
                               sim::format_time(request.start));
    }
    outside_.restore(outside);
    backend_.restore(computer, reply_timeout_);
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

/// Whether the computer is down at t. sim/runtime.cpp does the same for flight on the desktop.
bool BoardNode::is_down(Ns t)
{
    ComputerReset line{};
    if (mission_.reset < messages_.size()) {
        std::memcpy(&line, messages_[mission_.reset].held.data(), sizeof line);
    }
    return outside_.is_down(t, line.count, mission_.down);
}

/// The packets of a message. What is no whole packet goes to flight, too, which refuses and reports it. Where flight
/// speaks frames, a message is one unit of them.
void BoardNode::take_commands(const Record &record)
{
    read_payload(record.payload, commands_.fields, commands_.held);
    std::uint32_t n;
    std::memcpy(&n, commands_.held.data(), sizeof n);
    const CommandServices *services = mission_.commands ? mission_.commands->services : nullptr;
    const bool framed = services && services->unwrap;
    const std::byte *at = commands_.held.data() + sizeof n;
    for (const std::byte *end = at + std::min(n, commands_.room()); at < end;) {
        const auto left = static_cast<std::size_t>(end - at);
        const std::size_t size = framed ? left : length_of(at, left);
        take_unit(at, size);
        at += size;
    }
}

/// A unit of bytes waits for the lane of commands.
void BoardNode::take_unit(const std::byte *unit, std::size_t size)
{
    const MissionQueue lane = mission_.io->commands;
    if (size > mission_.io->boards[lane.board]->lanes[lane.lane].capacity || waiting_.size() == commands_max) {
        counts_.refused++;
    } else {
        const auto *bytes = reinterpret_cast<const std::uint8_t *>(unit);
        waiting_.emplace_back(bytes, bytes + size);
    }
}

/// Publish the packets that flight sent in the instant t, and earlier ones that had no room.
void BoardNode::put_telemetry(Ns t, std::vector<Record> &records)
{
    if (!telemetry_.channel || found_.empty()) {
        return;
    }
    std::fill(telemetry_.held.begin(), telemetry_.held.end(), std::byte{});
    std::uint32_t n = 0;
    for (; !found_.empty() && n + found_.front().size() <= telemetry_.room(); found_.pop_front()) {
        std::memcpy(telemetry_.held.data() + sizeof n + n, found_.front().data(), found_.front().size());
        n += static_cast<std::uint32_t>(found_.front().size());
    }
    std::memcpy(telemetry_.held.data(), &n, sizeof n);
    records.push_back({*telemetry_.channel, ++published_, t, make_payload(telemetry_.held)});
}

/// Put the commands of the script before t into their lane, then those of other programs, as far as it has room.
void BoardNode::send_commands(Ns t)
{
    const MissionIo &io = *mission_.io;
    for (; sent_ < script_.size() && script_[sent_].after < t; sent_++) {
        const Command &command = script_[sent_];
        if (!mission_io_send(&io, backend_.windows().data(), io.commands, command.packet.data(),
                             static_cast<std::uint32_t>(command.packet.size()), &counts_)) {
            throw registers::Error("the snorkel of commands has no room for those of " +
                                   sim::format_time(command.after) + ": it needs a longer queue or a larger capacity");
        }
    }
    for (; !waiting_.empty(); waiting_.pop_front()) {
        MissionIoCounts full{}; // it waits for the next instant
        if (!mission_io_send(&io, backend_.windows().data(), io.commands, waiting_.front().data(),
                             static_cast<std::uint32_t>(waiting_.front().size()), &full)) {
            break;
        }
    }
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
    const auto receive = [&] {
        return mission_io_receive(mission_.io, backend_.windows().data(), mission_.io->telemetry, packet_.data(),
                                  static_cast<std::uint32_t>(packet_.size()), &counts_);
    };
    for (std::uint32_t n = receive(); n != 0; n = receive()) {
        if (telemetry) {
            telemetry(t, {packet_.data(), n});
        }
        if (telemetry_.channel && t >= 0) {
            found_.emplace_back(packet_.data(), packet_.data() + n);
        }
        if (downlink_ && t >= 0) {
            transmitted_.push_back({t, {packet_.data(), packet_.data() + n}});
        }
    }
}

} // namespace fledge::cosim
