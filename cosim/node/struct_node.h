// SPDX-License-Identifier: Apache-2.0
// A C++ program as a node, whose messages are its own structs.
//
// A struct has the fields of its definition in their order, without padding. Before each step, the node sets its
// inputs to the messages that the instant sees; after the step, it sends the outputs that have changed. Only one
// side needs a definition: without one here, the node takes its partner's, of the same size. It converts other
// byte orders.
//
// Example:
//
//     using namespace cosim;
//     struct { double x[2]; } state;
//     struct { double F[2]; } force;
//     StructNode node({.node = "spring"}, {10'000'000, 0});
//     node.read("/mass/state", Latency::same_instant, state);
//     node.write("/spring/force", force, make_schema("Force", "float64[2] F  # F [N] (2) force\n"));
//     node.run([&](Ns) { force.F[0] = -state.x[0]; });
#pragma once

#include "cosim/node/delegate.h"
#include "cosim/node/mailbox.h"

#include <atomic>
#include <functional>
#include <map>
#include <type_traits>

namespace fledge::cosim {

class StructNode final : private Node {
public:
    /// The environment gives what the config leaves out. The node steps at offset + k period. Throws
    /// std::invalid_argument if the period is not > 0, the offset negative, or one of them longer than longest_time.
    StructNode(MemberConfig config, Rate steps) : config_(std::move(config)) { also_step(steps); }

    MemberConfig &config() { return config_; } ///< before run()
    const MemberConfig &config() const { return config_; }

    /// Step at these instants, too. Throws as the constructor does.
    void also_step(Rate steps);

    /// Read a topic into `message`, which lives as long as the node. Throws SchemaError. The run begins
    /// without a writer of an optional topic.
    void read(const std::string &topic, Latency latency, std::span<std::byte> message, Schema schema = {},
              bool optional = false);
    /// Write a topic from `message`, which lives as long as the node. Its value when the run begins is the initial
    /// value. Throws SchemaError.
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

    /// Save this memory in snapshots. Together with the messages it has to hold all that the steps depend on, without
    /// pointers. It lives as long as the node. With snapshots, a restarted node need not repeat all its steps.
    void save_in_snapshots(std::span<std::byte> state) { saved_.emplace_back(state); }
    template <class T>
    requires(!std::is_convertible_v<T &, std::span<const std::byte>>) void save_in_snapshots(T &state)
    {
        static_assert(std::is_trivially_copyable_v<T>);
        save_in_snapshots(std::as_writable_bytes(std::span(&state, 1)));
    }

    /// Take part in a run. `step` is called at each instant. Returns the reason of the end, "" for the regular end.
    /// Throws what Delegate::serve and `step` throw.
    std::string run(const std::function<void(Ns)> &step);

    /// Called in a step: it is the last one, and run() returns.
    void leave() { leaving_ = true; }
    /// From any thread or a signal handler: run() throws instead of the next step, or within a second if it waits for
    /// the controller; the run's controller gets the reason.
    void stop() { stopped_ = true; }

    std::uint64_t seed() const { return seed_; } ///< of the run
    Ns end() const { return end_; }              ///< of the run

private:
    struct Input {
        Subscription subscription;
        std::span<std::byte> memory;
    };
    struct Output {
        std::string topic;
        Schema schema;
        std::span<std::byte> memory; ///< only a snapshot writes to it
    };
    struct Wired {
        std::span<std::byte> memory;
        std::vector<SchemaField> fields;
    };

    Initialized initialize(const Initialize &request) override;
    std::vector<Subscription> desired() override;
    std::vector<Publication> match(const std::vector<Channel> &channels) override;
    void start(const std::vector<Channel> &channels) override;
    Tock tick(const Tick &tick) override;
    Bytes save() override;
    void go_on_from(std::span<const std::byte> snapshot);
    std::vector<std::span<std::byte>> memory() const;
    Ns instant_after(Ns t) const;

    MemberConfig config_;
    std::vector<Rate> rates_;
    std::function<void(Ns)> step_;
    std::vector<Input> inputs_;
    std::vector<Output> outputs_;
    std::map<std::uint32_t, Wired> wired_;    ///< by channel
    std::vector<std::span<std::byte>> saved_; ///< of the program
    Inbox inbox_;
    Outbox outbox_;
    Ns next_ = 0, end_ = 0;
    std::uint64_t seed_ = 0;
    bool leaving_ = false;
    std::atomic<bool> stopped_ = false;
};

} // namespace fledge::cosim
