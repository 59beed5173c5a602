// SPDX-License-Identifier: Apache-2.0
// Each node of a run once more, alone with the record of the others: it does what it did.
#include "cosim/protocol/testing/words.h"
#include "cosim/tools/replay.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <deque>
#include <filesystem>
#include <map>
#include <random>
#include <unistd.h>

namespace fledge::cosim {
namespace replay_test {

/// A node whose words depend on all that it has received; sometimes it writes none.
class Mixer final : public Node {
public:
    Mixer(std::string name, std::vector<Rate> rates, std::vector<Subscription> subscriptions, std::uint64_t salt = 0)
        : name_(std::move(name)), rates_(std::move(rates)), subscriptions_(std::move(subscriptions)), state_(salt)
    {
    }

    Initialized initialize(const Initialize &m) override
    {
        state_ = state_ * 31 + m.seed + name_.back();
        return {rates_, false, false};
    }
    std::vector<Subscription> desired() override { return subscriptions_; }
    std::vector<Publication> match(const std::vector<Channel> &channels) override
    {
        for (const Channel &channel : channels) {
            if (channel.topic == "/" + name_ + "/x") {
                channel_ = channel.channel;
                return {{channel_, make_schema("Word", word_text), word(state_)}};
            }
        }
        return {};
    }
    void start(const std::vector<Channel> &) override {}
    Tock tick(const Tick &tick) override
    {
        Tock tock;
        tock.reached = tick.until;
        coming_.insert(coming_.end(), tick.records.begin(), tick.records.end());
        std::stable_sort(coming_.begin(), coming_.end(), [](auto &a, auto &b) { return a.t < b.t; });
        for (Ns t = reached_ + 1; t <= tick.until; t++) {
            if (std::none_of(rates_.begin(), rates_.end(),
                             [&](const Rate &r) { return t >= r.offset && (t - r.offset) % r.period == 0; })) {
                continue;
            }
            for (; !coming_.empty() && coming_.front().t <= t; coming_.pop_front()) {
                received_[coming_.front().channel] = coming_.front();
            }
            for (const auto &[channel, record] : received_) {
                std::uint64_t x = 0;
                std::memcpy(&x, record.payload.data() + 4, 8);
                state_ = (state_ ^ x) * 0x9e3779b97f4a7c15u + static_cast<std::uint64_t>(t);
            }
            if (state_ >> 62) {
                tock.records.push_back({channel_, ++count_, t, word(state_)});
            }
        }
        reached_ = tick.until;
        return tock;
    }

private:
    std::string name_;
    std::vector<Rate> rates_;
    std::vector<Subscription> subscriptions_;
    std::uint64_t state_;
    std::deque<Record> coming_;
    std::map<std::uint32_t, Record> received_;
    std::uint32_t channel_ = 0, count_ = 0;
    Ns reached_ = -1;
};

/// The messages of a run, as parts.
class Memory final : public RunListener {
public:
    void began(const Exchange &exchange) override
    {
        for (const Exchange::Member &member : exchange.members) {
            parts.push_back({member.name, member.rates, member.any_time, {}});
        }
        for (const Exchange::Topic &topic : exchange.topics) {
            auto &topics = part(topic.writer).topics;
            where.emplace_back(topic.writer, topics.size());
            topics.push_back({topic.name, topic.schema, topic.initial, {}, {}});
        }
    }
    void wrote(const std::string &node, const std::vector<Record> &records) override
    {
        for (const Record &record : records) {
            EXPECT_EQ(where.at(record.channel).first, node);
            Part::Topic &topic = part(node).topics[where.at(record.channel).second];
            topic.times.push_back(record.t);
            topic.payloads.push_back(record.payload);
        }
    }
    void ended(const std::string &reason) override { outcome = reason; }

    Part &part(const std::string &node)
    {
        return *std::find_if(parts.begin(), parts.end(), [&](const Part &p) { return p.node == node; });
    }

    std::vector<Part> parts;
    std::vector<std::pair<std::string, std::size_t>> where; ///< by channel: node, topic
    std::string outcome = "(no end)";
};

Subscription subscription(const std::string &topic, Latency latency)
{
    return {topic, latency, false, {}};
}

/// Three nodes of different rates, with every latency.
std::map<std::string, std::unique_ptr<Mixer>> make_nodes(std::uint64_t salt = 0)
{
    std::map<std::string, std::unique_ptr<Mixer>> nodes;
    const auto add = [&](const std::string &name, std::vector<Rate> rates, std::vector<Subscription> subscriptions,
                         std::uint64_t own = 0) {
        nodes[name] = std::make_unique<Mixer>(name, std::move(rates), std::move(subscriptions), own);
    };
    add("a", {{10, 0}}, {subscription("/b/x", Latency::next_instant), subscription("/c/x", Latency::next_exchange)});
    add("b", {{25, 5}, {40, 0}}, {subscription("/a/x", Latency::same_instant)}, salt);
    add("c", {{100, 0}}, {subscription("/b/x", Latency::next_exchange), subscription("/a/x", Latency::same_instant)});
    return nodes;
}

constexpr Ns run_end = 20'000;

RouterConfig inside()
{
    static int count = 0;
    RouterConfig config;
    config.address = "inproc://fledge-replay-" + std::to_string(count++);
    return config;
}

class Folder {
public:
    Folder() { std::filesystem::create_directories(path); }
    ~Folder() { std::filesystem::remove_all(path); }
    std::string file(const std::string &name) const { return path / name; }

private:
    std::filesystem::path path = std::filesystem::temp_directory_path() / ("fledge-replay-" + std::to_string(getpid()));
};

void fly(Memory &memory)
{
    zmq::context_t context;
    ControllerConfig config;
    config.simulation = "mix";
    config.seed = 3;
    config.nodes = {{"a", {}}, {"b", {}}, {"c", {}}};
    config.end = run_end;
    RouterConfig router_config = inside();
    router_config.listeners = {&memory};
    Router router(context, config, router_config);
    const auto nodes = make_nodes();
    for (const auto &[name, node] : nodes) {
        router.host(name, *node);
    }
    ASSERT_EQ(router.run(), "");
    ASSERT_EQ(memory.outcome, "");
}

/// What the node says, alone with the others' parts.
Memory replay(const Memory &run, const std::string &name, const std::string &file, std::uint64_t salt = 0)
{
    ReplayConfig config;
    config.simulation = "mix";
    config.node = name;
    config.seed = 3;
    config.end = run_end;
    config.record = file;
    for (const Part &part : run.parts) {
        if (part.node != name) {
            config.others.push_back(part);
        } else {
            for (const Part::Topic &topic : part.topics) {
                config.topics.push_back(topic.name);
            }
        }
    }
    Memory again;
    zmq::context_t context;
    RouterConfig router = inside();
    router.listeners = {&again};
    Replay replay(context, config, router);
    const auto nodes = make_nodes(salt);
    replay.host(*nodes.at(name));
    EXPECT_EQ(replay.run(), "");
    EXPECT_TRUE(std::filesystem::exists(file));
    return again;
}

TEST(Replay, EachNodeAloneWritesTheSameAsBefore)
{
    Folder folder;
    Memory run;
    fly(run);
    ASSERT_FALSE(HasFailure());
    for (const std::string name : {"a", "b", "c"}) {
        Memory again = replay(run, name, folder.file(name + ".mcap"));
        ASSERT_GT(run.part(name).topics.at(0).times.size(), 50u);
        for (const Part &part : run.parts) { // players write again, if the topic has a reader
            for (const Part::Topic &topic : again.part(part.node).topics) {
                EXPECT_EQ(topic.name, part.topics.at(0).name);
                EXPECT_TRUE(topic.times == part.topics.at(0).times) << topic.name << " beside " << name;
                EXPECT_TRUE(topic.payloads == part.topics.at(0).payloads) << topic.name << " beside " << name;
                EXPECT_EQ(topic.initial, part.topics.at(0).initial);
            }
        }
    }
}

TEST(Replay, ANodeThatWritesSomethingElseIsReported)
{
    Folder folder;
    Memory run;
    fly(run);
    ASSERT_FALSE(HasFailure());
    Memory again = replay(run, "b", folder.file("b.mcap"), 1);
    EXPECT_NE(again.part("b").topics.at(0).payloads, run.part("b").topics.at(0).payloads);
}

TEST(Replay, PartsThatDoNotFitAreRefused)
{
    zmq::context_t context;
    ReplayConfig config;
    config.simulation = "mix";
    config.node = "b";
    const Part::Topic topic{"/a/x", make_schema("Word", word_text), word(0), {10, 10}, {word(1), word(2)}};
    config.others = {{"a", {{10, 0}}, false, {topic}}};
    EXPECT_THROW(Replay(context, config, inside()), std::invalid_argument);
}

TEST(Replay, ARecordThatCannotBeWrittenEndsTheRun)
{
    zmq::context_t context;
    ReplayConfig config;
    config.simulation = "mix";
    config.node = "b";
    config.end = 100;
    config.record = "/nowhere/at/all.mcap";
    config.topics = {"/b/x"};
    config.others = {{"a", {{10, 0}}, false, {{"/a/x", make_schema("Word", word_text), word(0), {}, {}}}}};
    Replay replay(context, config, inside());
    const auto nodes = make_nodes();
    replay.host(*nodes.at("b"));
    EXPECT_EQ(replay.run(), "cannot write /nowhere/at/all.mcap: No such file or directory");
}

} // namespace replay_test
} // namespace fledge::cosim
