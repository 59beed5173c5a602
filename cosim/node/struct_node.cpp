// SPDX-License-Identifier: Apache-2.0
#include "cosim/node/struct_node.h"

#include <algorithm>
#include <cstring>

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

void StructNode::read(const std::string &topic, Latency latency, std::span<std::byte> message, Schema schema)
{
    check_size(schema, message.size());
    inputs_.push_back({{topic, latency, false, std::move(schema)}, message});
}

void StructNode::write(const std::string &topic, std::span<std::byte> message, Schema schema)
{
    check_size(schema, message.size());
    outputs_.push_back({topic, std::move(schema), message});
}

std::string StructNode::run(const std::function<void(Ns)> &step)
{
    step_ = step;
    zmq::context_t context;
    return Delegate(context, config_).serve(*this);
}

Initialized StructNode::initialize(const Initialize &m)
{
    next_ = rate_.offset;
    if (m.start >= rate_.offset) {
        next_ += ((m.start - rate_.offset) / rate_.period + 1) * rate_.period;
    }
    leaving_ = false;
    if (!m.snapshot.empty()) {
        go_on_from(m.snapshot);
    }
    return {{rate_}, false, !kept_.empty()};
}

/// The content of a snapshot.
std::vector<std::span<std::byte>> StructNode::memory() const
{
    auto all = kept_;
    for (const Input &input : inputs_) {
        all.push_back(input.message);
    }
    for (const Output &output : outputs_) {
        all.push_back(output.message);
    }
    return all;
}

/// The byte order, then each piece of memory with its size before it.
Bytes StructNode::save()
{
    if (kept_.empty()) {
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
    const auto parts = memory();
    std::size_t size = 1;
    for (const auto part : parts) {
        size += sizeof(std::uint64_t) + part.size();
    }
    bool fits = snapshot.size() == size && snapshot[0] == static_cast<std::byte>(native_order());
    for (std::size_t at = 1, i = 0; fits && i < parts.size(); i++) {
        std::uint64_t found = 0;
        std::memcpy(&found, snapshot.data() + at, sizeof found);
        fits = found == parts[i].size();
        at += sizeof found + parts[i].size();
    }
    if (!fits) {
        throw ProtocolError("the snapshot is from another program, or from another machine");
    }
    std::size_t at = 1;
    for (const auto part : parts) {
        at += sizeof(std::uint64_t);
        std::copy_n(snapshot.begin() + static_cast<std::ptrdiff_t>(at), part.size(), part.begin());
        at += part.size();
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
        for (const Output &output : outputs_) {
            if (output.topic == channel.topic) {
                const Schema &schema = output.schema.given() ? output.schema : channel.schema;
                if (schema.given() && schema.size != output.message.size()) {
                    throw SchemaError(output.topic + " has " + std::to_string(schema.size) +
                                      " bytes where it is read, the struct here " +
                                      std::to_string(output.message.size()));
                }
                publications.push_back({channel.channel, schema, make_payload(output.message)});
                outbox_.add(channel.channel, output.message);
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
        const auto input = std::find_if(inputs_.begin(), inputs_.end(),
                                        [&](const Input &i) { return i.subscription.topic == channel.topic; });
        if (input == inputs_.end() || channel.schema.size != input->message.size()) {
            throw SchemaError(channel.topic + " has " + std::to_string(channel.schema.size) +
                              " bytes where it is written, which is not the size of the struct here");
        }
        wired_[channel.channel] = {input->message, parse_schema(channel.schema.text)};
    }
}

Tock StructNode::tick(const Tick &tick)
{
    inbox_.take(tick.records);
    Tock tock;
    tock.reached = tick.until;
    for (; next_ <= tock.reached; next_ += rate_.period) {
        inbox_.see(next_, [this](const Record &record) {
            const Wired &wire = wired_.at(record.channel);
            read_payload(record.payload, wire.fields, wire.message);
        });
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
