// SPDX-License-Identifier: Apache-2.0
// One node alone, against the record of the others: they say what they said, at the times at which they
// said it, and so it must do what it did.
#pragma once

#include "cosim/router/router.h"
#include "cosim/tools/exchange_record.h"

#include <string>
#include <vector>

namespace fledge::cosim {

/// What a node said in some run.
struct Part {
    struct Topic {
        std::string name;
        Schema schema;
        Bytes initial;         ///< payload
        std::vector<Ns> times; ///< of writing, ascending
        std::vector<Bytes> payloads;
    };
    std::string node;
    std::vector<Rate> rates;
    bool any_time = false;
    std::vector<Topic> topics;
};

/// Says a part. It steps as its node did, so that the others' exchanges stay where they were.
class Player final : public Node {
public:
    /// The part must outlive it.
    explicit Player(const Part &part) : part_(part), next_(part.topics.size()) {}

    Initialized initialize(const Initialize &) override { return {part_.rates, part_.any_time, false}; }
    std::vector<Want> desired() override { return {}; }
    std::vector<Offer> match(const std::vector<Channel> &asked) override;
    void start(const std::vector<Channel> &) override {}
    Tock tick(const Tick &tick) override;

private:
    const Part &part_;
    std::vector<std::size_t> next_;                              ///< what each topic says next
    std::vector<std::pair<std::uint32_t, std::size_t>> offered_; ///< channel, topic
};

/// Reads topics for which nobody else may be there, so that they are written, and leaves it at that.
class Listener final : public Node {
public:
    explicit Listener(std::vector<std::string> topics) : topics_(std::move(topics)) {}

    Initialized initialize(const Initialize &) override { return {{}, true, false}; }
    std::vector<Want> desired() override;
    std::vector<Offer> match(const std::vector<Channel> &) override { return {}; }
    void start(const std::vector<Channel> &) override {}
    Tock tick(const Tick &tick) override { return {tick.until, 0, {}, false}; }

private:
    std::vector<std::string> topics_;
};

struct ReplayConfig {
    std::string simulation, node; ///< which is replayed
    std::uint64_t seed = 0;
    Ns end = 0;
    std::vector<Part> others;        ///< all others that took part
    std::vector<std::string> topics; ///< that the node wrote
    std::string record;              ///< archive for what it writes now, with what it is told
};

/// A run of the one node with the record of the others, which live here.
class Replay {
public:
    /// Throws LinkError as the Router does, std::invalid_argument if the parts do not fit together.
    Replay(zmq::context_t &context, ReplayConfig config, RouterConfig router);

    /// Where the node greets.
    const std::string &address() const { return router_.address(); }
    /// The node, if it lives in this program.
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
