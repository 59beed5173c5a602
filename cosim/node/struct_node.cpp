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
    check_size(schema, message.size());
    inputs_.push_back({{topic, latency, optional, std::move(schema)}, message});
}

void StructNode::write(const std::string &topic, std::span<std::byte> message, Schema schema)
{
    check_size(schema, message.size());
    outputs_.push_back({topic, std::move(schema), message});
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
    return {rates_, false, !saved_.empty()};
}

/// The content of a snapshot.
std::vector<std::span<std::byte>> StructNode::memory() const
{
    std::vector<std::span<std::byte>> all = saved_;
    for (const Input &input : inputs_) {
        all.push_back(input.memory);
    }
    for (const Output &output : outputs_) {
        all.push_back(output.memory);
    }
    return all;
}

/// The byte order, then each piece of memory with its size before it.
Bytes StructNode::save()
{
    if (saved_.empty()) {
        return {};
    }
    Bytes snapshot{static_cast<std::byte>(native_order())};
    for (const auto part : memory()) {
        const std::uint64_t size = part.size();
        const auto head = std::as_bytes(std::span(&size, 1));
        snapshot.insert(snapshot.end(), head.begin(), head.end());
        snapshot.insert(snapshot.end(), part.begin(), part.end());
    }
    return snapshot;
}

void StructNode::go_on_from(std::span<const std::byte> snapshot)
{
    std::vector<std::span<const std::byte>> pieces;
    bool fits = snapshot[0] == static_cast<std::byte>(native_order());
    snapshot = snapshot.subspan(1);
    const auto parts = memory();
    for (const auto part : parts) {
        std::uint64_t size = 0;
        fits = fits && snapshot.size() >= sizeof size + part.size();
        if (fits) {
            std::memcpy(&size, snapshot.data(), sizeof size);
            fits = size == part.size();
            pieces.push_back(snapshot.subspan(sizeof size, part.size()));
            snapshot = snapshot.subspan(sizeof size + part.size());
        }
    }
    if (!fits || !snapshot.empty()) {
        throw ProtocolError("the snapshot is from another program, or from another machine");
    }
    for (std::size_t i = 0; i < parts.size(); i++) {
        std::ranges::copy(pieces[i], parts[i].begin());
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

std::vector<Publication> StructNode::match(const std::vector<Channel> &channels)
{
    std::vector<Publication> publications;
    outbox_.clear();
    for (const Channel &channel : channels) {
        for (const Output &output : outputs_) {
            if (output.topic == channel.topic) {
                const Schema &schema = output.schema.given() ? output.schema : channel.schema;
                if (schema.given() && schema.size != output.memory.size()) {
                    throw SchemaError(output.topic + " has " + std::to_string(schema.size) +
                                      " bytes where it is read, the struct here " +
                                      std::to_string(output.memory.size()));
                }
                publications.push_back({channel.channel, schema, make_payload(output.memory)});
                outbox_.add(channel.channel, output.memory);
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
        if (input == inputs_.end() || channel.schema.size != input->memory.size()) {
            throw SchemaError(channel.topic + " has " + std::to_string(channel.schema.size) +
                              " bytes where it is written, which is not the size of the struct here");
        }
        wired_[channel.channel] = {input->memory, fields_of(channel.schema)};
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
            read_payload(record.payload, wire.fields, wire.memory);
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
