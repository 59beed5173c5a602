// SPDX-License-Identifier: Apache-2.0
// A run goes on from the past of another: from any instant, from snapshots or from the start, random networks write
// what the first run wrote.
#include "cosim/controller/testing/network.h"
#include "tests/error_of.h"

namespace fledge::cosim {
namespace time_travel_test {

constexpr Ns the_end = 600;

/// Nodes that are there from the start, some with snapshots, and asynchronous commands.
std::vector<Spec> random_nodes(Random &random)
{
    auto specs = random_network(random);
    for (Spec &spec : specs) {
        spec.saves = random() % 3;
        spec.on_loss = random() % 2 ? Policy::restart : Policy::abort;
        if (random() % 2) {
            spec.subscriptions.push_back(subscription("/ground/command", static_cast<Latency>(random() % 3)));
            spec.subscriptions.back().optional = true;
        }
    }
    return specs;
}

/// A world and its flight computer, which obeys commands.
std::vector<Spec> two()
{
    std::vector<Spec> specs(2);
    specs[0].name = "world";
    specs[0].writes = {"/world/q"};
    specs[0].subscriptions = {subscription("/flight/u", Latency::next_instant)};
    specs[1].name = "flight";
    specs[1].writes = {"/flight/u"};
    specs[1].subscriptions = {subscription("/world/q", Latency::same_instant),
                              subscription("/ground/command", Latency::next_instant)};
    for (Spec &spec : specs) {
        spec.rates = {{10, 0}};
        spec.saves = true;
    }
    return specs;
}

/// The commands come until t at the latest, and `losses` programs are lost. Returns the outcome.
std::string fly(Bench &bench, Ns t, int losses)
{
    bench.arrive_all();
    while (bench.reply_somewhere()) {
        Ns furthest = -1;
        for (NodeId id = 0; id < bench.specs.size(); id++) {
            furthest = std::max(furthest, bench.controller.reached(id));
        }
        const NodeId id = bench.random() % bench.specs.size();
        if (furthest < t && bench.random() % 10 == 0) {
            bench.controller.inject("ground", "/ground/command", word(bench.random()));
        } else if (losses && bench.random() % 20 == 0 && bench.controller.running() &&
                   bench.specs[id].on_loss == Policy::restart) {
            losses--;
            bench.act();
            bench.controller.lost(id, "it was killed");
            bench.act();
            bench.nodes[id].start_anew(false);
            bench.arrive(id);
        }
        bench.sleeping = false;
    }
    return bench.outcome.value_or("the run hangs");
}

/// What the run wrote until t, and its last snapshots of all nodes until then.
std::shared_ptr<Past> past_of(const Bench &bench, Ns t, bool with_snapshots = true)
{
    auto past = std::make_shared<Past>();
    past->until = t;
    for (const Exchange::Topic &topic : bench.exchange.topics) {
        past->topics.push_back({topic.name, topic.initial, {}});
        if (const auto found = bench.written.find(topic.name); found != bench.written.end()) {
            for (const auto &[at, x] : found->second) {
                if (at <= t) {
                    past->topics.back().messages.emplace_back(at, word(x));
                }
            }
        }
    }
    if (auto after = bench.kept.upper_bound(t); with_snapshots && after != bench.kept.begin()) {
        past->snapshots = std::prev(after)->second;
        std::erase_if(past->snapshots, [](const NodeSnapshot &s) { return s.reached < 0; });
    }
    return past;
}

ControllerConfig kept_config(const std::vector<Spec> &specs, Random &random)
{
    auto config = Bench::configured(specs, the_end, 1 + random() % 50, 4 + random() % 40);
    config.keep_every = 20 + static_cast<Ns>(random() % 150);
    return config;
}

TEST(TimeTravel, FromAnyInstantARunGoesOnAsTheFirstDid)
{
    unsigned from_snapshots = 0, from_start = 0;
    for (unsigned seed = 0; seed < 2000 && !testing::Test::HasFailure(); seed++) {
        SCOPED_TRACE(seed);
        Random random(seed);
        const auto specs = random_nodes(random);
        auto config = kept_config(specs, random);
        const Ns last_command = static_cast<Ns>(random() % the_end);
        Bench first(specs, config, seed);
        ASSERT_EQ(fly(first, last_command, static_cast<int>(random() % 3)), "");
        Ns t = last_command;
        if (const auto found = first.written.find("/ground/command"); found != first.written.end()) {
            t = std::min(std::max(t, found->second.back().first), the_end);
            std::erase_if(found->second, [](const auto &command) { return command.first > the_end; });
        }
        std::erase_if(first.written, [](const auto &topic) { return topic.second.empty(); });

        config.past = past_of(first, t, random() % 4);
        config.batch = 1 + static_cast<std::uint32_t>(random() % 50);
        Bench again(specs, config, seed + 1);
        ASSERT_EQ(fly(again, -1, static_cast<int>(random() % 3)), "") << "from " << t;
        EXPECT_EQ(again.written, first.written);
        if (again.exchange.topics.size() == first.exchange.topics.size()) {
            for (std::size_t i = 0; i < first.exchange.topics.size(); i++) {
                EXPECT_EQ(again.exchange.topics[i].initial, first.exchange.topics[i].initial);
            }
        }
        for (const NodeSnapshot &snapshot : config.past->snapshots) {
            from_snapshots += snapshot.reached >= 0;
        }
        from_start += config.past->snapshots.empty();
        for (auto &[name, history] : again.history()) {
            const auto steps = first.history()[name];
            const auto begin = std::find(steps.begin(), steps.end(), history.empty() ? steps.back() : history.front());
            if (!history.empty()) {
                EXPECT_TRUE(std::equal(history.begin(), history.end(), begin, steps.end())) << name;
            }
        }
    }
    EXPECT_GT(from_snapshots, 1000u);
    EXPECT_GT(from_start, 100u);
}

TEST(TimeTravel, TheCountsOfMessagesGoOn)
{
    for (unsigned seed = 0; seed < 200; seed++) {
        SCOPED_TRACE(seed);
        Random random(seed);
        auto specs = random_nodes(random);
        auto config = kept_config(specs, random);
        Bench first(specs, config, seed);
        ASSERT_EQ(fly(first, -1, 0), "");
        config.past = past_of(first, static_cast<Ns>(random() % the_end));
        Bench again(specs, config, seed);
        ASSERT_EQ(fly(again, -1, 0), "");
        EXPECT_EQ(again.counts, first.counts);
    }
}

TEST(TimeTravel, SnapshotsComeAtCommonTimesOfAllNodesThatMakeThem)
{
    Random random(3);
    auto specs = random_network(random);
    for (Spec &spec : specs) {
        spec.saves = true;
        spec.any_time = false;
        spec.rates = {{10, 0}};
    }
    specs.back().saves = false;
    auto config = Bench::configured(specs, 100, 1000, 4096);
    config.keep_every = 30;
    Bench bench(specs, config, 4);
    ASSERT_EQ(bench.run(), "");
    ASSERT_EQ(bench.kept.size(), 3u);
    for (const Ns t : {30, 60, 90}) {
        ASSERT_EQ(bench.kept.at(t).size(), specs.size() - 1);
        for (const NodeSnapshot &snapshot : bench.kept.at(t)) {
            EXPECT_EQ(snapshot.reached, t);
            EXPECT_NE(snapshot.node, specs.back().name);
        }
    }
}

TEST(TimeTravel, AProgramThatWritesOtherThingsThanBeforeIsNamedWithTopicAndTime)
{
    const auto specs = two();
    auto config = Bench::configured(specs, 300, 1000, 4096);
    Bench first(specs, config, 1);
    ASSERT_EQ(first.run(), "");
    const auto past = past_of(first, 200);
    for (Past::Topic &topic : past->topics) {
        auto at =
            std::find_if(topic.messages.begin(), topic.messages.end(), [](const auto &m) { return m.first > 90; });
        if (topic.name == "/world/q") {
            at->second = word(1); // the next program does not repeat it
            config.past = past;
            Bench again(specs, config, 1);
            EXPECT_EQ(again.run(), "world does not repeat what it wrote before: /world/q at " + when(at->first) +
                                       " differs from the value before");
        }
    }
}

TEST(TimeTravel, ACommandAfterThePastMakesAnotherBranch)
{
    const auto specs = two();
    auto config = Bench::configured(specs, 300, 1000, 4096);
    config.keep_every = 50;
    Bench first(specs, config, 1);
    ASSERT_EQ(first.run(), "");
    config.past = past_of(first, 170);
    Bench branch(specs, config, 1);
    branch.arrive_all();
    while (!branch.controller.running() && branch.reply_somewhere()) {
    }
    ASSERT_EQ(branch.controller.inject("ground", "/ground/command", word(5)), "");
    ASSERT_EQ(branch.go_on(), "");
    const Ns t = branch.written.at("/ground/command").front().first;
    EXPECT_GT(t, 170) << "the past does not change";
    for (const auto &[topic, before] : first.written) {
        const auto &now = branch.written.at(topic);
        for (std::size_t i = 0; i < before.size() && before[i].first <= t; i++) {
            EXPECT_EQ(now.at(i), before[i]);
        }
        EXPECT_NE(now, before);
    }
}

TEST(TimeTravel, APastThatMakesNoSenseIsRefused)
{
    auto config = Bench::configured(two(), 100, 1000, 4096);
    const auto fault = [&](const Past &past) -> std::string {
        config.past = std::make_shared<Past>(past);
        return error_of<std::invalid_argument>([&] { Controller{config}; });
    };
    EXPECT_EQ(fault({100, {}, {}}), "");
    EXPECT_EQ(fault({101, {}, {}}), "the run goes on from 0.000000101 s, behind its end at 0.0000001 s");
    EXPECT_EQ(
        fault({50, {}, {{"moon", 40, {}}}}),
        "a snapshot of moon at 0.00000004 s; expected one of a node that is there at the start, up to 0.00000005 s");
    EXPECT_NE(fault({50, {}, {{"world", 60, {}}}}), "");
}

} // namespace time_travel_test
} // namespace fledge::cosim
