// SPDX-License-Identifier: Apache-2.0
// A C++ program as a node, whose messages are its own structs:
//
//     StructNode node({.node = "spring"}, {10 * ms, 0});
//     node.read("/mass/state", Latency::same_instant, state);
//     node.write("/spring/force", force, make_schema("Force", "float64[2] F  # F [N] (2) force\n"));
//     node.run([&](Ns t) { force.F[0] = -state.x[0]; });
//
// A struct has the fields of its definition in their order, without padding. Before each step, what is
// read holds what is seen at that instant; after it, what was changed is sent. A definition is needed on
// one side only: without one here, that of the partner is taken, whose size must be that of the struct.
// Other byte orders are turned round.
#pragma once

#include "cosim/node/delegate.h"
#include "cosim/node/mailbox.h"

#include <functional>
#include <map>
#include <type_traits>

namespace fledge::cosim {

class StructNode final : private Node {
public:
    /// What the config does not say is as the environment does. It steps at offset + k period.
    StructNode(DelegateConfig config, Rate steps) : config_(std::move(config)), rate_(steps) {}

    /// Read a topic into `message`, which lives as long as the node. Throws SchemaError.
    void read(const std::string &topic, Latency latency, std::span<std::byte> message, Schema schema = {});
    /// Write a topic from `message`, which lives as long as the node. What it holds when the run begins
    /// is its initial value. Throws SchemaError.
    void write(const std::string &topic, std::span<std::byte> message, Schema schema = {});

    template <class T>
    requires(!std::is_convertible_v<T &, std::span<const std::byte>>) void read(const std::string &topic,
                                                                                Latency latency, T &message,
                                                                                Schema schema = {})
    {
        static_assert(std::is_trivially_copyable_v<T>);
        read(topic, latency, std::as_writable_bytes(std::span(&message, 1)), std::move(schema));
    }
    template <class T>
    requires(!std::is_convertible_v<T &, std::span<const std::byte>>) void write(const std::string &topic, T &message,
                                                                                 Schema schema = {})
    {
        static_assert(std::is_trivially_copyable_v<T>);
        write(topic, std::as_writable_bytes(std::span(&message, 1)), std::move(schema));
    }

    /// All that its steps depend on, besides the messages, is in this memory (and what else is told so), which
    /// lives as long as the node, without pointers. With it one that was lost goes on from a snapshot, and not
    /// by all its steps from the beginning.
    void keep(std::span<std::byte> state) { kept_.push_back(state); }
    template <class T>
    requires(!std::is_convertible_v<T &, std::span<const std::byte>>) void keep(T &state)
    {
        static_assert(std::is_trivially_copyable_v<T>);
        keep(std::as_writable_bytes(std::span(&state, 1)));
    }

    /// Take part in a run, with a function that does what is due at an instant. Returns the reason of its
    /// end, "" if it is the regular one. Throws what Delegate::serve does, and what the function throws.
    std::string run(const std::function<void(Ns)> &step);

    /// From within the step: take no further part. What this step writes is the last, and run() returns.
    void leave() { leaving_ = true; }

private:
    struct Input {
        Want want;
        std::span<std::byte> message;
    };
    struct Output {
        std::string topic;
        Schema schema;
        std::span<std::byte> message; ///< written to by a snapshot only
    };
    struct Wired {
        std::span<std::byte> message;
        std::vector<SchemaField> fields;
    };

    Initialized initialize(const Initialize &request) override;
    std::vector<Want> desired() override;
    std::vector<Offer> match(const std::vector<Channel> &asked) override;
    void start(const std::vector<Channel> &channels) override;
    Tock tick(const Tick &tick) override;
    Bytes save() override;
    void go_on_from(std::span<const std::byte> snapshot);
    std::vector<std::span<std::byte>> memory() const;

    DelegateConfig config_;
    Rate rate_;
    std::function<void(Ns)> step_;
    std::vector<Input> inputs_;
    std::vector<Output> outputs_;
    std::map<std::uint32_t, Wired> wired_; ///< by channel
    std::vector<std::span<std::byte>> kept_;
    Inbox inbox_;
    Outbox outbox_;
    Ns next_ = 0;
    bool leaving_ = false;
};

} // namespace fledge::cosim
