// SPDX-License-Identifier: Apache-2.0
#include "cosim/node/struct_node.h"

#include <algorithm>
#include <cstring>
#include <limits>

namespace fledge::cosim {

namespace {

void check_size(const Schema &schema, std::size_t size)
{
    if (schema.given() && schema.size != size) {
        throw SchemaError("its definition makes " + std::to_string(schema.size) + " bytes, the struct has " +
                          std::to_string(size));
    }
}

} // namespace

void StructNode::Memory::resize(std::size_t size)
{
    own.resize(size);
    bytes = own;
}

void StructNode::also_step(Rate steps)
{
    const auto [period, offset] = steps;
    if (period <= 0 || period > longest_time || offset < 0 || offset > longest_time) {
        throw std::invalid_argument(config_.node +
                                    ": it steps at offset + k every, with every > 0 and offset >= 0, "
                                    "both up to 31 years; found " +
                                    std::to_string(offset) + " and " + std::to_string(period) + " ns");
    }
    rates_.push_back(steps);
}

void StructNode::read(const std::string &topic, Latency latency, std::span<std::byte> message, Schema schema,
                      bool optional)
{
    if (!message.empty()) {
        check_size(schema, message.size());
    }
    inputs_.push_back({{topic, latency, optional, std::move(schema)}, Memory(message)});
}

void StructNode::write(const std::string &topic, std::span<std::byte> message, Schema schema)
{
    if (!message.empty()) {
        check_size(schema, message.size());
    }
    outputs_.push_back({topic, std::move(schema), Memory(message)});
    if (Output &output = outputs_.back(); output.memory.owned) {
        output.memory.resize(output.schema.size);
    }
}

std::span<const std::byte> StructNode::message(const std::string &topic) const
{
    const auto input = std::ranges::find_if(inputs_, [&](const Input &i) { return i.subscription.topic == topic; });
    return input == inputs_.end() ? std::span<const std::byte>() : input->memory.bytes;
}

void StructNode::put(const std::string &topic, std::span<const std::byte> message)
{
    const auto output = std::ranges::find(outputs_, topic, &Output::topic);
    if (output == outputs_.end() || output->memory.bytes.size() != message.size()) {
        throw SchemaError(topic + (output == outputs_.end()
                                       ? " is not written here"
                                       : " has " + std::to_string(output->memory.bytes.size()) +
                                             " bytes, the message here " + std::to_string(message.size())));
    }
    std::ranges::copy(message, output->memory.bytes.begin());
    outbox_.resend(output->memory.bytes);
}

std::string StructNode::run(const std::function<void(Ns)> &step)
{
    step_ = step;
    config_.stopped = &stopped_;
    zmq::context_t context;
    return Delegate(context, config_).serve(*this);
}

/// The first instant after t at which the node steps.
Ns StructNode::instant_after(Ns t) const
{
    Ns first = std::numeric_limits<Ns>::max();
    for (const Rate &rate : rates_) {
        first = std::min(first, t < rate.offset ? rate.offset
                                                : rate.offset + ((t - rate.offset) / rate.period + 1) * rate.period);
    }
    return first;
}

Initialized StructNode::initialize(const Initialize &m)
{
    next_ = instant_after(m.start);
    seed_ = m.seed;
    end_ = m.end;
    leaving_ = false;
    if (!m.snapshot.empty()) {
        go_on_from(m.snapshot);
    }
    return {rates_, false, !saved_.empty() || hooks_.save};
}

/// The content of a snapshot.
std::vector<StructNode::Memory *> StructNode::memory()
{
    std::vector<Memory *> all;
    for (Memory &state : saved_) {
        all.push_back(&state);
    }
    for (Input &input : inputs_) {
        all.push_back(&input.memory);
    }
    for (Output &output : outputs_) {
        all.push_back(&output.memory);
    }
    return all;
}

/// The byte order, then each piece of memory with its size before it, then what the program saves.
Bytes StructNode::save()
{
    if (saved_.empty() && !hooks_.save) {
        return {};
    }
    Bytes snapshot{static_cast<std::byte>(native_order())};
    for (const Memory *part : memory()) {
        const std::uint64_t size = part->bytes.size();
        const auto head = std::as_bytes(std::span(&size, 1));
        snapshot.insert(snapshot.end(), head.begin(), head.end());
        snapshot.insert(snapshot.end(), part->bytes.begin(), part->bytes.end());
    }
    if (hooks_.save) {
        const Bytes saved = hooks_.save();
        if (saved.empty()) {
            return {};
        }
        snapshot.insert(snapshot.end(), saved.begin(), saved.end());
    }
    return snapshot;
}

void StructNode::go_on_from(std::span<const std::byte> snapshot)
{
    std::vector<std::span<const std::byte>> pieces;
    bool fits = snapshot[0] == static_cast<std::byte>(native_order());
    snapshot = snapshot.subspan(1);
    const auto parts = memory();
    for (const Memory *part : parts) {
        std::uint64_t size = 0;
        fits = fits && snapshot.size() >= sizeof size;
        if (fits) {
            std::memcpy(&size, snapshot.data(), sizeof size);
            snapshot = snapshot.subspan(sizeof size);
            fits = size <= snapshot.size() && (part->owned || size == part->bytes.size());
        }
        if (fits) {
            pieces.push_back(snapshot.first(size));
            snapshot = snapshot.subspan(size);
        }
    }
    if (!fits || (!hooks_.restore && !snapshot.empty())) {
        throw ProtocolError("the snapshot is from another program, or from another machine");
    }
    for (std::size_t i = 0; i < parts.size(); i++) {
        if (parts[i]->owned) {
            parts[i]->resize(pieces[i].size());
        }
        std::ranges::copy(pieces[i], parts[i]->bytes.begin());
    }
    if (hooks_.restore) {
        hooks_.restore(snapshot);
    }
}

std::vector<Subscription> StructNode::desired()
{
    std::vector<Subscription> subscriptions;
    for (const Input &input : inputs_) {
        subscriptions.push_back(input.subscription);
    }
    return subscriptions;
}

std::vector<Publication> StructNode::match(const std::vector<Channel> &asked)
{
    std::vector<Publication> publications;
    outbox_.clear();
    for (const Channel &channel : asked) {
        for (Output &output : outputs_) {
            if (output.topic == channel.topic) {
                const Schema &schema = output.schema.given() ? output.schema : channel.schema;
                Memory &memory = output.memory;
                if (memory.owned && !output.schema.given() && schema.given()) {
                    (void)fields_of(schema); // it throws, if the definition is a bad one
                    output.schema = channel.schema;
                    memory.resize(schema.size);
                    if (hooks_.define) {
                        hooks_.define(output.topic, schema);
                    }
                }
                if (schema.given() && schema.size != memory.bytes.size()) {
                    throw SchemaError(output.topic + " has " + std::to_string(schema.size) +
                                      " bytes where it is read, the struct here " +
                                      std::to_string(memory.bytes.size()));
                }
                publications.push_back({channel.channel, schema, make_payload(memory.bytes)});
                outbox_.add(channel.channel, memory.bytes);
            }
        }
    }
    return publications;
}

void StructNode::start(const std::vector<Channel> &channels)
{
    inbox_.open(channels);
    wired_.clear();
    for (const Channel &channel : channels) {
        const auto input =
            std::ranges::find_if(inputs_, [&](const Input &i) { return i.subscription.topic == channel.topic; });
        if (input == inputs_.end() || (!input->memory.owned && channel.schema.size != input->memory.bytes.size())) {
            throw SchemaError(channel.topic + " has " + std::to_string(channel.schema.size) +
                              " bytes where it is written, which is not the size of the struct here");
        }
        if (input->memory.owned && !input->subscription.schema.given() && hooks_.define) {
            hooks_.define(channel.topic, channel.schema);
        }
        wired_[channel.channel] = {&input->memory, channel.schema.size, fields_of(channel.schema)};
    }
}

Tock StructNode::tick(const Tick &tick)
{
    inbox_.take(tick.records);
    Tock tock;
    tock.reached = tick.until;
    for (; next_ <= tock.reached; next_ = instant_after(next_)) {
        inbox_.see(next_, [this](const Record &record) {
            const Wired &wire = wired_.at(record.channel);
            if (wire.memory->owned) {
                wire.memory->resize(wire.size);
            }
            read_payload(record.payload, wire.fields, wire.memory->bytes);
        });
        if (stopped_) {
            throw std::runtime_error("the program ended it");
        }
        step_(next_);
        outbox_.collect(next_, tock.records);
        if (leaving_) {
            tock.reached = next_;
            tock.leaving = true;
        }
    }
    return tock;
}

} // namespace fledge::cosim
