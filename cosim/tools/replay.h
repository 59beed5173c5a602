// SPDX-License-Identifier: Apache-2.0
// One node alone, against the record of the other nodes: players write the recorded messages at the recorded times,
// and so the node has to write the same as before.
#pragma once

#include "cosim/router/router.h"
#include "cosim/tools/exchange_record.h"

#include <string>
#include <vector>

namespace fledge::cosim {

/// What a node wrote in a recorded run.
struct Part {
    struct Topic {
        std::string name;
        Schema schema;
        Payload initial;
        std::vector<Ns> times; ///< of writing, ascending
        std::vector<Payload> payloads;
    };
    std::string node;
    std::vector<Rate> rates;
    bool any_time = false;
    std::vector<Topic> topics;
};

/// Writes a part. It steps as its node did, so that exchanges stay at their times.
class Player final : public Node {
public:
    /// The part must outlive it.
    explicit Player(const Part &part) : part_(part), next_(part.topics.size()) {}

    Initialized initialize(const Initialize &) override { return {part_.rates, part_.any_time, false}; }
    std::vector<Subscription> desired() override { return {}; }
    std::vector<Publication> match(const std::vector<Channel> &channels) override;
    void start(const std::vector<Channel> &) override {}
    Tock tick(const Tick &tick) override;

private:
    const Part &part_;
    std::vector<std::size_t> next_;                                ///< the next message of each topic
    std::vector<std::pair<std::uint32_t, std::size_t>> published_; ///< channel, topic
};

/// Reads topics that may have no other reader, so that the node writes them.
class Listener final : public Node {
public:
    explicit Listener(std::vector<std::string> topics) : topics_(std::move(topics)) {}

    Initialized initialize(const Initialize &) override { return {{}, true, false}; }
    std::vector<Subscription> desired() override;
    std::vector<Publication> match(const std::vector<Channel> &) override { return {}; }
    void start(const std::vector<Channel> &) override {}
    Tock tick(const Tick &tick) override { return {tick.until, 0, {}, false}; }

private:
    std::vector<std::string> topics_;
};

struct ReplayConfig {
    std::string simulation, node; ///< the replayed one
    std::uint64_t seed = 0;
    Ns end = 0;
    std::vector<Part> others;        ///< all other nodes
    std::vector<std::string> topics; ///< that the node wrote
    std::string record;              ///< archive of the replay
    TopicMap names;                  ///< of the replayed node
};

/// A run of one node with players for the others, in this program.
class Replay {
public:
    /// Throws LinkError as the Router does, std::invalid_argument if the parts do not fit together.
    Replay(zmq::context_t &context, ReplayConfig config, RouterConfig router);

    /// Where the node greets.
    const std::string &address() const { return router_.address(); }
    /// The node, if it is in this program.
    void host(Node &node) { router_.host(config_.node, node); }
    /// As Router::run.
    std::string run(const std::function<bool()> &poll = {}) { return router_.run(poll); }

private:
    ReplayConfig config_;
    Listener listener_;
    std::vector<Player> players_;
    ExchangeRecord record_;
    Router router_;
};

} // namespace fledge::cosim
