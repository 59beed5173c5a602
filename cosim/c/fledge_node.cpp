// SPDX-License-Identifier: Apache-2.0
// The C face of the C++ delegate.
#include "cosim/c/fledge_node.h"

#include "cosim/delegate.h"

#include <algorithm>
#include <cstring>
#include <map>
#include <new>

using namespace fledge::cosim;

namespace {

struct Input {
    Want want;
    std::span<std::byte> message;
};

struct Output {
    std::string topic;
    Schema schema;
    std::span<const std::byte> message;
};

Schema schema_of(const char *type, const char *definition, std::size_t size)
{
    Schema schema;
    if (definition) {
        schema = make_schema(type ? type : "", definition);
        if (schema.size != size) {
            throw SchemaError("its definition makes " + std::to_string(schema.size) + " bytes, the struct has " +
                              std::to_string(size));
        }
    } else if (type) {
        schema.name = type;
    }
    return schema;
}

} // namespace

struct FledgeNode final : private Node {
    FledgeNode(std::string simulation, std::string node, std::string address, Rate steps)
        : rate(steps)
    {
        config.simulation = std::move(simulation);
        config.node = std::move(node);
        config.address = std::move(address);
    }

    /// Do this; what it throws is the error.
    template <class F> int attempt(F function)
    {
        try {
            error.clear();
            function();
        } catch (const std::exception &e) {
            error = e.what();
        }
        return error.empty() ? 0 : -1;
    }

    void run(FledgeStep function, void *its_user)
    {
        step = function;
        user = its_user;
        zmq::context_t context;
        error = Delegate(context, config).serve(*this);
    }

    DelegateConfig config;
    Rate rate;
    std::vector<Input> inputs;
    std::vector<Output> outputs;
    std::string error;
    bool leaving = false;

private:
    struct Wired {
        Input *input;
        std::vector<SchemaField> fields;
        std::uint32_t count = 0;
    };
    struct Written {
        std::uint32_t channel;
        Output *output;
        Bytes sent;
        std::uint32_t count = 0;
    };

    Initialized initialize(const Initialize &m) override
    {
        next = rate.offset;
        if (m.start >= rate.offset) {
            next += ((m.start - rate.offset) / rate.period + 1) * rate.period;
        }
        leaving = false;
        return {{rate}, false};
    }

    std::vector<Want> desired() override
    {
        std::vector<Want> wants;
        for (const Input &input : inputs) {
            wants.push_back(input.want);
        }
        return wants;
    }

    std::vector<Offer> match(const std::vector<Channel> &asked) override
    {
        std::vector<Offer> offers;
        written.clear();
        for (const Channel &channel : asked) {
            for (Output &output : outputs) {
                if (output.topic == channel.topic) {
                    const Schema &schema = output.schema.given() ? output.schema : channel.schema;
                    if (schema.given() && schema.size != output.message.size()) {
                        throw SchemaError(output.topic + " has " + std::to_string(schema.size) +
                                          " bytes where it is read, the struct here " +
                                          std::to_string(output.message.size()));
                    }
                    offers.push_back({channel.channel, schema, make_payload(output.message)});
                    written.push_back({channel.channel, &output, Bytes(output.message.begin(), output.message.end())});
                }
            }
        }
        return offers;
    }

    void start(const std::vector<Channel> &channels_in) override
    {
        wired.clear();
        coming.clear();
        for (const Channel &channel : channels_in) {
            const auto input = std::find_if(inputs.begin(), inputs.end(),
                                            [&](const Input &i) { return i.want.topic == channel.topic; });
            if (input == inputs.end() || channel.schema.size != input->message.size()) {
                throw SchemaError(channel.topic + " has " + std::to_string(channel.schema.size) +
                                  " bytes where it is written, which is not the size of the struct here");
            }
            wired[channel.channel] = {&*input, parse_schema(channel.schema.text)};
        }
    }

    Tock tick(const Tick &tick) override
    {
        for (const Record &record : tick.records) {
            const auto it = wired.find(record.channel);
            if (it == wired.end() || record.count != ++it->second.count) {
                throw ProtocolError("message " + std::to_string(record.count) + " on channel " +
                                    std::to_string(record.channel) + " is not the next one");
            }
            coming.push_back(record);
        }
        std::stable_sort(coming.begin(), coming.end(), [](const Record &a, const Record &b) { return a.t < b.t; });
        Tock tock;
        tock.reached = tick.until;
        auto record = coming.begin();
        for (; next <= tock.reached; next += rate.period) {
            for (; record != coming.end() && record->t <= next; ++record) {
                const Wired &wire = wired.at(record->channel);
                read_payload(record->payload, wire.fields, wire.input->message);
            }
            if (const int code = step(user, next)) {
                throw std::runtime_error("its step returned " + std::to_string(code));
            }
            for (Written &w : written) {
                if (std::memcmp(w.sent.data(), w.output->message.data(), w.sent.size())) {
                    w.sent.assign(w.output->message.begin(), w.output->message.end());
                    tock.records.push_back({w.channel, ++w.count, next, make_payload(w.sent)});
                }
            }
            if (leaving) {
                tock.reached = next;
                tock.leaving = true;
            }
        }
        coming.erase(coming.begin(), record);
        return tock;
    }

    FledgeStep step = nullptr;
    void *user = nullptr;
    Ns next = 0;
    std::map<std::uint32_t, Wired> wired; ///< by channel
    std::vector<Written> written;
    std::vector<Record> coming;
};

FledgeNode *fledge_node_create(const char *simulation, const char *node, const char *address, int64_t every,
                               int64_t offset)
{
    const auto given = [](const char *text) { return std::string(text ? text : ""); };
    try {
        return new FledgeNode(given(simulation), given(node), given(address), {every, offset});
    } catch (const std::bad_alloc &) {
        return nullptr;
    }
}

void fledge_node_destroy(FledgeNode *node)
{
    delete node;
}

int fledge_node_reads(FledgeNode *node, const char *topic, FledgeLatency latency, const char *type,
                      const char *definition, void *message, size_t size)
{
    return node->attempt([&] {
        node->inputs.push_back({{topic, static_cast<Latency>(latency), false, schema_of(type, definition, size)},
                                {static_cast<std::byte *>(message), size}});
    });
}

int fledge_node_writes(FledgeNode *node, const char *topic, const char *type, const char *definition,
                       const void *message, size_t size)
{
    return node->attempt([&] {
        node->outputs.push_back(
            {topic, schema_of(type, definition, size), {static_cast<const std::byte *>(message), size}});
    });
}

int fledge_node_run(FledgeNode *node, FledgeStep step, void *user)
{
    return node->attempt([&] { node->run(step, user); });
}

void fledge_node_leave(FledgeNode *node)
{
    node->leaving = true;
}

const char *fledge_node_error(const FledgeNode *node)
{
    return node->error.c_str();
}
