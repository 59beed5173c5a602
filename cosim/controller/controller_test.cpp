// SPDX-License-Identifier: Apache-2.0
// Runs from the first greeting to the end, in every order of replies, and the faults that the controller refuses.
// life_test.cpp has nodes that join and leave.
#include "cosim/controller/testing/network.h"
#include "tests/error_of.h"

#include <array>

namespace fledge::cosim {
namespace controller_test {

TEST(Controller, InputsDependOnlyOnTheLatenciesInEveryOrderOfReplies)
{
    for (unsigned network = 0; network < 400; network++) {
        Random random(network);
        const auto specs = random_network(random);
        const History wanted = expected(specs, 400);
        for (unsigned order = 0; order < 8; order++) {
            const std::uint32_t batch = order % 3 == 0 ? 1 : order % 3 == 1 ? 3 : 1000;
            Bench bench(specs, 400, 1000 * network + order, batch, order % 2 ? 4 : 4096);
            ASSERT_EQ(bench.run(), "") << "network " << network << ", order " << order;
            for (const Spec &spec : specs) {
                ASSERT_EQ(bench.history()[spec.name],
                          wanted.contains(spec.name) ? wanted.at(spec.name) : History::mapped_type{})
                    << spec.name << " in network " << network << ", order " << order;
            }
        }
    }
}

/// A node that steps every 10 ns.
Spec spec_of(const std::string &name, std::vector<Subscription> subscriptions, std::vector<std::string> writes)
{
    return {name, {{10, 0}}, false, std::move(subscriptions), std::move(writes)};
}

TEST(Controller, NodesSeeAnAsynchronousMessageFromItsReportedTimeOn)
{
    std::size_t seen = 0, written = 0;
    for (unsigned network = 0; network < 300; network++) {
        Random random(network);
        auto specs = random_network(random);
        for (Spec &spec : specs) {
            if (random() % 2) {
                spec.subscriptions.push_back(subscription("/ground/command", static_cast<Latency>(random() % 3)));
            }
        }
        Bench bench(specs, 400, network, network % 3 ? 1 + network % 5 : 1000);
        EXPECT_NE(bench.controller.inject("ground", "/ground/command", word(1)), "");
        bench.arrive_all();
        std::uint64_t x = 100;
        while (bench.reply_somewhere()) {
            for (auto n = bench.controller.running() && random() % 8 == 0 ? random() % 3 : 0; n; n--) {
                bench.sleeping = false;
                const std::string fault = bench.controller.inject("ground", "/ground/command", word(x + 1));
                ASSERT_TRUE(fault.empty() || fault == "no node reads /ground/command") << fault;
                x += fault.empty();
            }
        }
        ASSERT_EQ(bench.outcome, "") << network;
        std::vector<Write> writes{{-1, 0}};
        for (const auto &[t, value] : bench.written["/ground/command"]) {
            ASSERT_GT(t, writes.back().t);
            writes.push_back({t, value});
        }
        EXPECT_EQ(writes.size() - 1, x - 100) << "all accepted messages are reported";
        const History wanted = expected(specs, 400, lives_of(specs, {}), {{"/ground/command", writes}});
        for (const Spec &spec : specs) {
            ASSERT_EQ(bench.history()[spec.name],
                      wanted.contains(spec.name) ? wanted.at(spec.name) : History::mapped_type{})
                << spec.name << " in network " << network;
            // Each reader sees each message, unless the run ends first.
            for (const Subscription &subscription : spec.subscriptions) {
                if (subscription.topic != "/ground/command" || spec.any_time) {
                    continue;
                }
                std::size_t last = 0;
                for (const Ns t : spec.instants(400)) {
                    const Ns latest = latest_seen(subscription.latency, t, spec.rates);
                    std::size_t now = last;
                    while (now + 1 < writes.size() && writes[now + 1].t <= latest) {
                        now++;
                    }
                    if (last) {
                        EXPECT_LE(now, last + 1) << spec.name << " misses a message in network " << network;
                    }
                    last = now;
                }
                seen += last;
                written += writes.size() - 1;
            }
        }
    }
    EXPECT_GT(seen, 1000u);
    EXPECT_GT(written, seen / 2);
}

TEST(Controller, AnAsynchronousMessageIsRefusedWithTheReason)
{
    std::vector<Spec> specs{spec_of("a", {subscription("/ground/command", Latency::same_instant)}, {"/a/x"}),
                            spec_of("b", {subscription("/a/x", Latency::next_instant)}, {})};
    Bench bench(specs, 100, 1);
    bench.begin();
    ASSERT_TRUE(bench.controller.running());
    const auto inject = [&](const std::string &program, const std::string &topic, const Payload &payload) {
        return bench.controller.inject(program, topic, payload);
    };
    EXPECT_EQ(inject("ground", "/ground/command", word(5)), "");
    EXPECT_EQ(inject("ground", "/a/x", word(5)), "/a/x is not written by ground");
    EXPECT_EQ(inject("viewer", "/ground/command", word(5)), "/ground/command is not written by viewer");
    EXPECT_EQ(inject("ground", "/ground/other", word(5)), "no node reads /ground/other");
    EXPECT_EQ(inject("ground", "/ground/command", Bytes(7)),
              "a message of /ground/command has 7 bytes; expected a CDR header and 8");
    Bytes head = word(5).copy();
    head[0] = std::byte{9};
    EXPECT_NE(inject("ground", "/ground/command", head), "");
    std::string full;
    for (int i = 0; i < 5000 && full.empty(); i++) {
        full = inject("ground", "/ground/command", word(5));
    }
    EXPECT_EQ(full, "a has not yet seen 4096 messages of /ground/command");
    EXPECT_EQ(bench.go_on(), "");
    EXPECT_EQ(inject("ground", "/ground/command", word(5)), "the run is over");
    // No node may greet by its name, and a reader has to define its messages.
    Bench other({spec_of("a", {{"/ground/command", Latency::same_instant, false, {}}}, {})}, 100, 1);
    other.controller.hello(1, {1, 1, "bench", "ground"});
    other.act();
    EXPECT_EQ(other.refusals.at(0), "bench has no node ground; it has a");
    EXPECT_EQ(other.run(), "/ground/command comes from ground, an asynchronous program, and no reader defines it; "
                           "one of them has to");
}

TEST(Controller, TheMessagesOfAnAsynchronousProgramCountFrom1AfterEachMatching)
{
    Spec writer = spec_of("w", {}, {"/ground/command"}), late = spec_of("late", {}, {});
    writer.leaves_at = 200;
    late.joins = Join::at_time;
    late.joins_after = 500;
    Bench bench({spec_of("a", {subscription("/ground/command", Latency::same_instant)}, {}), writer, late}, 1000, 1);
    bench.begin();
    bench.arrive(2);
    const auto joined = [](const Change &change) { return change.what == Change::joined; };
    while (std::none_of(bench.controller.changes().begin(), bench.controller.changes().end(), joined) &&
           bench.reply_somewhere()) {
    }
    bench.act();
    EXPECT_GT(bench.written["/ground/command"].size(), 1u) << "before the writer left";
    for (std::uint32_t count = 1; count <= 2; count++) {
        EXPECT_EQ(bench.controller.inject("ground", "/ground/command", word(5)), "");
        const std::vector<Action> actions = bench.controller.take_actions();
        ASSERT_EQ(actions.size(), 1u);
        EXPECT_EQ(std::get<action::Wrote>(actions[0]).records.at(0).count, count);
    }
}

TEST(Controller, AWatchedTopicIsWrittenWithoutAReader)
{
    ControllerConfig config = Bench::configured({spec_of("a", {}, {"/a/x"})}, 50, 1000, 4096);
    config.watched = {"/a/x", "/a/none"};
    Bench bench({spec_of("a", {}, {"/a/x"})}, 50, 1);
    bench.controller = Controller(config);
    EXPECT_EQ(bench.run(), "");
    EXPECT_EQ(bench.exchange.topics.at(1).name, "/a/x");
    EXPECT_EQ(bench.exchange.topics.at(0).writer, "");
    EXPECT_FALSE(bench.written["/a/x"].empty());
}

/// A node that reads and writes one word.
Spec spec(const std::string &name, Ns period, std::vector<Subscription> subscriptions, std::vector<std::string> writes)
{
    return {name, {{period, 0}}, false, std::move(subscriptions), std::move(writes)};
}

constexpr NodeId world = 0, flight = 1;

std::vector<Spec> pair(Latency there = Latency::same_instant, Latency back = Latency::next_instant)
{
    return {spec("world", 100, {subscription("/flight/u", back)}, {"/world/x"}),
            spec("flight", 500, {subscription("/world/x", there)}, {"/flight/u"})};
}

TEST(Controller, ListenersGetAllMessagesInOrder)
{
    for (unsigned network = 0; network < 40; network++) {
        Random random(network);
        const auto specs = random_network(random);
        Bench bench(specs, 400, network);
        ASSERT_EQ(bench.run(), "");
        ASSERT_EQ(bench.exchange.after, -1);
        History history = bench.history();
        for (std::size_t i = 0; i < specs.size(); i++) {
            EXPECT_EQ(bench.exchange.members[i].name, specs[i].name);
            EXPECT_EQ(bench.exchange.members[i].rates, specs[i].rates);
            EXPECT_EQ(bench.exchange.members[i].subscriptions, specs[i].subscriptions);
        }
        for (const Exchange::Topic &topic : bench.exchange.topics) {
            const auto &spec =
                *std::find_if(specs.begin(), specs.end(), [&](const Spec &s) { return s.name == topic.writer; });
            const auto k = static_cast<std::size_t>(std::find(spec.writes.begin(), spec.writes.end(), topic.name) -
                                                    spec.writes.begin());
            EXPECT_EQ(topic.initial, word(spec.initial(k)));
            std::vector<std::pair<Ns, std::uint64_t>> written;
            for (const auto &[t, state] : history[spec.name]) {
                if (spec.writes_at(t, k)) {
                    written.emplace_back(t, Spec::output(state, k));
                }
            }
            EXPECT_EQ(bench.written[topic.name], written) << topic.name << " in network " << network;
        }
    }
}

TEST(Controller, AFastNodeStepsManyTimesPerTickOfASlowNode)
{
    // Steps of 10 ms and of 1 s coincide once a second: two ticks each, not a hundred.
    const std::vector<Spec> specs = {
        spec("control", 10, {subscription("/thermal/t", Latency::next_instant)}, {"/control/u"}),
        spec("thermal", 1000, {subscription("/control/u", Latency::same_instant)}, {"/thermal/t"})};
    Bench bench(specs, 10'000, 1);
    std::size_t instants = 0;
    ASSERT_EQ(bench.run(), "");
    for (const FakeNode &node : bench.nodes) {
        instants += node.history.size();
    }
    EXPECT_EQ(instants, 1001u + 11u);
    // Without early returns it would be one tick per second and node, and one for the instant 0.
    EXPECT_LT(bench.ticks, 200u);
    // And the slow node gets only the messages that it sees.
    EXPECT_EQ(bench.nodes[1].counts.begin()->second, 11u);
}

TEST(Controller, NodesConnectedByExchangesStepAtTheSameTime)
{
    Bench bench(pair(Latency::next_exchange, Latency::next_exchange), 2000, 1);
    bench.begin();
    EXPECT_EQ(bench.tick_of(world), 0);
    EXPECT_EQ(bench.tick_of(flight), 0);
}

TEST(Controller, AWriterOfTheSameInstantStepsFirst)
{
    Bench bench(pair(Latency::same_instant, Latency::next_instant), 2000, 1);
    bench.begin();
    EXPECT_EQ(bench.tick_of(world), 0);
    EXPECT_EQ(bench.tick_of(flight), std::nullopt);
    bench.tock(world, {0, 0, {}});
    EXPECT_EQ(bench.tick_of(world), std::nullopt) << "flight may write at 0";
    EXPECT_EQ(bench.tick_of(flight), 0);
    bench.tock(flight, {0, 0, {}});
    EXPECT_EQ(bench.tick_of(world), 500) << "flight's command of 0 holds until then";
    EXPECT_EQ(bench.tick_of(flight), std::nullopt);
}

TEST(Controller, AllFaultsOfANetworkAreReportedBeforeTheFirstTick)
{
    auto specs = pair(Latency::same_instant, Latency::same_instant);
    const auto outcome = [&] { return Bench(specs, 1000, 5).run(); };
    EXPECT_EQ(outcome(),
              "these nodes wait for each other in a cycle: flight for /world/x of world, world for /flight/u "
              "of flight; one of these messages has to be read later, at the next instant or exchange");
    specs = pair();
    specs[0].subscriptions.push_back(subscription("/flight/v", Latency::next_instant));
    specs[0].subscriptions.push_back(subscription("/world/x", Latency::next_instant));
    specs[0].subscriptions.push_back(specs[0].subscriptions[0]);
    EXPECT_EQ(outcome(), "world subscribes to /flight/v, which no other node writes\n"
                         "world subscribes to /world/x, which no other node writes\n"
                         "world subscribes to /flight/u twice");
    specs[0].subscriptions.resize(2);
    specs[0].subscriptions[1].optional = true;
    Bench without(specs, 1000, 5);
    EXPECT_EQ(without.run(), "");
    ASSERT_EQ(without.reports.size(), 1u); // the run goes on, and the user gets a note
    EXPECT_EQ(without.reports[0],
              "world subscribes to /flight/v, which no other node writes; the subscription is optional");
    specs = pair();
    specs.push_back(spec("other", 100, {}, {"/world/x"}));
    const std::string why = outcome(); // in the order of matching
    EXPECT_TRUE(why.starts_with("/world/x is written by world and by other; one of them has to rename it") ||
                why.starts_with("/world/x is written by other and by world; one of them has to rename it"))
        << why;
    specs = pair();
    specs[1].subscriptions[0].schema = make_schema("Word", "uint64 x  # x [m] a word\n");
    EXPECT_EQ(outcome(), "flight subscribes to /world/x of world, but field x is uint64 [-] in the publication and "
                         "uint64 [m] in the subscription");
    specs[1].subscriptions[0].schema.hash++;
    EXPECT_EQ(outcome(), "flight subscribes to /world/x with a bad definition: its hash is not that of its text");
    specs = pair();
    specs[1].rates[0].period = 0;
    EXPECT_EQ(outcome().substr(0, 42), "flight: a step of 0 ns from 0 ns on; a per");
    specs[1].rates.clear();
    EXPECT_EQ(outcome(), "flight: it never steps");
}

TEST(Controller, AGreetingIsRefusedWithTheReason)
{
    Bench bench(pair(), 1000, 1);
    bench.controller.hello(9, {2, 3, "bench", "world"});
    bench.controller.hello(9, {1, 1, "other", "world"});
    bench.controller.hello(9, {1, 1, "bench", "wrold"});
    bench.controller.hello(9, {0, 5, "bench", "world"});
    bench.controller.hello(9, {1, 1, "bench", "world"});
    bench.sleeping = false;
    bench.controller.stop("enough");
    bench.controller.hello(9, {1, 1, "bench", "flight"});
    bench.act();
    EXPECT_EQ(bench.refusals, (std::vector<std::string>{
                                  "this controller speaks version 1 of the format, the node versions 2 to 3",
                                  "this is the simulation bench, not other",
                                  "bench has no node wrold; it has world and flight",
                                  "world is already connected",
                                  "the run is over: enough",
                              }));
    EXPECT_EQ(bench.go_on(), "enough");
}

/// The outcome when the first Tock of `world` that has a record is changed.
template <class Change> std::string outcome_of(Change change)
{
    Bench bench(pair(), 1000, 3);
    bench.arrive(0);
    bench.arrive(1);
    for (bool changed = false; bench.act(), bench.requests[0] || bench.requests[1];) {
        if (const NodeId id = bench.requests[0] ? 0 : 1; id == 0 && !changed) {
            const Frame request = *std::exchange(bench.requests[0], std::nullopt);
            Frame answer{request.number, bench.nodes[0].answer(request.message, bench.random, bench.end)};
            if (auto *tock = std::get_if<Tock>(&answer.message); tock && !tock->records.empty()) {
                change(answer, *tock);
                changed = true;
            }
            bench.controller.received(0, answer);
        } else {
            bench.reply(id);
        }
    }
    return bench.outcome.value_or("the run hangs");
}

TEST(Controller, AnInvalidTockIsReportedWithItsFault)
{
    const auto starts = [](const std::string &outcome, const std::string &start) {
        EXPECT_TRUE(outcome.starts_with("world: " + start)) << outcome;
    };
    starts(outcome_of([](Frame &, Tock &m) { m.records[0].count = 0; }),
           "duplicate: message 0 of /world/x came before");
    starts(outcome_of([](Frame &, Tock &m) { m.records[0].count++; }), "gap: message 2 of /world/x follows message 0");
    starts(outcome_of([](Frame &, Tock &m) { m.records[0].t = -1; }),
           "late: message 1 of /world/x was written at the start, which other nodes have passed");
    starts(outcome_of([](Frame &, Tock &m) { m.records[0].t = m.reached + 1; }), "early: message 1 of /world/x");
    starts(outcome_of([](Frame &, Tock &m) {
               m.reached = std::max<Ns>(m.reached, 0);
               m.records.push_back(m.records.back());
               m.records.back().count++;
           }),
           "out of order: message ");
    starts(outcome_of([](Frame &, Tock &m) { m.records[0].payload = Bytes(11); }),
           "incomplete: message 1 of /world/x has 11 bytes");
    starts(outcome_of([](Frame &, Tock &m) { m.records[0].channel = 0; }),
           "it wrote on channel 0, which it does not publish");
    starts(outcome_of([](Frame &, Tock &m) { m.records[0].channel = 77; }),
           "it wrote on channel 77, which it does not publish");
    starts(outcome_of([](Frame &, Tock &m) { m.reached = -1; }),
           "it reports that it reached the start; its tick goes from the start to 0 s");
    starts(outcome_of([](Frame &, Tock &m) { m.reached += 1000; }), "it reports that it reached ");
    starts(outcome_of([](Frame &f, Tock &) { f.number++; }), "it sent Tock ");
    starts(outcome_of([](Frame &f, Tock &) { f.message = Ready{}; }), "it sent Ready ");
    starts(outcome_of([](Frame &f, Tock &) { f.message = Failed{"a pole"}; }), "it failed: a pole");
    EXPECT_EQ(outcome_of([](Frame &, Tock &) {}), "");
}

TEST(Controller, AMessageBetweenTheStepsOfItsNodeIsRefused)
{
    Bench bench(pair(), 1000, 3);
    bench.begin();
    bench.tock(world, {0, 0, {}});
    bench.tock(flight, {0, 0, {}});
    ASSERT_EQ(bench.tick_of(world), 500);
    const auto channel = bench.nodes[world].written.at("/world/x").first;
    bench.tock(world, {500, 0, {{channel, 1, 150, word(1)}}});
    EXPECT_EQ(bench.go_on(),
              "world: out of step: message 1 of /world/x was written at 0.00000015 s, when the node does not step "
              "(it had reached 0 s)");
}

/// Run until the node has an unfinished tick beyond `t`, and lose it then.
bool lose(Bench &bench, NodeId id, Ns t)
{
    for (;;) {
        bench.act();
        if (bench.requests[id] && std::holds_alternative<Tick>(bench.requests[id]->message) &&
            bench.controller.reached(id) >= t) {
            bench.sleeping = false;
            bench.controller.lost(id, "it was killed");
            return true;
        }
        if (!bench.reply_somewhere()) {
            return false;
        }
    }
}

TEST(Controller, ThePolicyDecidesWhetherALostNodeEndsTheRun)
{
    for (const Policy policy : {Policy::abort, Policy::hold, Policy::drop}) {
        auto specs = pair(Latency::next_exchange, Latency::next_exchange);
        specs[1].on_loss = policy;
        Bench bench(specs, 5000, 11);
        bench.arrive_all();
        ASSERT_TRUE(lose(bench, 1, 1000));
        const std::string outcome = bench.go_on();
        if (policy == Policy::abort) {
            EXPECT_TRUE(outcome.starts_with("flight: it was killed (it had reached ")) << outcome;
            continue;
        }
        EXPECT_EQ(outcome, "");
        EXPECT_EQ(bench.nodes[0].history.back().first, 5000);
        ASSERT_EQ(bench.reports.size(), 1u);
        EXPECT_TRUE(bench.reports[0].starts_with("flight: it was killed")) << bench.reports[0];
        const std::uint64_t seen = bench.nodes[0].seen.at("/flight/u");
        EXPECT_EQ(seen == 0, policy == Policy::drop);
    }
}

TEST(Controller, APauseDoesNotChangeTheResults)
{
    std::size_t losses = 0;
    for (unsigned network = 0; network < 100; network++) {
        Random random(network);
        auto specs = random_network(random);
        for (Spec &spec : specs) {
            spec.on_loss = Policy::pause;
        }
        const History wanted = expected(specs, 400);
        Bench bench(specs, 400, network);
        bench.arrive_all();
        for (int n = 0; n < 4; n++) {
            const NodeId id = random() % specs.size();
            if (!lose(bench, id, static_cast<Ns>(random() % 300))) {
                break;
            }
            losses++;
            while (bench.reply_somewhere()) {
            }
            ASSERT_FALSE(bench.outcome) << "all nodes wait for the lost one";
            // It comes back with its state at the end of its last tick, but without its inputs.
            FakeNode &node = bench.nodes[id];
            node.counts.clear();
            node.seen.clear();
            node.coming.clear();
            node.wired.clear();
            bench.arrive(id);
        }
        ASSERT_EQ(bench.go_on(), "") << network;
        for (const Spec &spec : specs) {
            ASSERT_EQ(bench.history()[spec.name],
                      wanted.contains(spec.name) ? wanted.at(spec.name) : History::mapped_type{})
                << spec.name << " in network " << network;
        }
        EXPECT_EQ(bench.reports.size() % 2, 0u);
    }
    EXPECT_GT(losses, 100u);
}

TEST(Controller, ARestartedNodeWithOtherStepsOrTopicsIsRefused)
{
    auto specs = pair();
    specs[1].on_loss = Policy::pause;
    Bench bench(specs, 5000, 11);
    bench.arrive_all();
    ASSERT_TRUE(lose(bench, 1, 1000));
    bench.specs[1].rates[0].period = 250;
    bench.arrive(1);
    while (bench.reply_somewhere()) {
    }
    ASSERT_FALSE(bench.reports.empty());
    EXPECT_TRUE(bench.reports.back().starts_with("flight: it came back with other steps")) << bench.reports.back();
    bench.sleeping = false;
    bench.controller.stop("no flight");
    EXPECT_EQ(bench.go_on(), "no flight");
}

TEST(Controller, TheRunEndsWheneverANodeDies)
{
    // A node dies after any number of replies, others while they finish: the run still ends.
    for (unsigned seed = 0; seed < 2000; seed++) {
        Random random(seed);
        auto specs = random_network(random);
        for (Spec &spec : specs) {
            spec.on_loss = std::array{Policy::abort, Policy::hold, Policy::drop}[random() % 3];
        }
        Bench bench(specs, 200, seed);
        bench.arrive_all();
        for (auto n = random() % 60; n; n--) {
            bench.reply_somewhere();
        }
        for (auto n = 1 + random() % 2; n; n--) {
            bench.sleeping = false;
            bench.controller.lost(random() % specs.size(), "it was killed");
            for (auto k = random() % 10; k; k--) {
                bench.reply_somewhere();
            }
        }
        if (random() % 4 == 0) {
            bench.sleeping = false;
            bench.controller.stop("asked");
        }
        ASSERT_NE(bench.go_on(), "the run hangs") << seed;
        ASSERT_TRUE(bench.controller.done());
        for (NodeId id = 0; id < specs.size(); id++) {
            EXPECT_FALSE(bench.controller.waiting_for(id));
        }
    }
}

TEST(Controller, AnInvalidConfigurationIsRefused)
{
    const auto configured = [](const std::vector<Spec> &specs, Ns end) {
        return Controller(Bench::configured(specs, end, 1000, 4096));
    };
    const Spec node = spec("one", 1, {}, {});
    EXPECT_THROW(configured({}, 1), std::invalid_argument);
    EXPECT_THROW(configured({node, node}, 1), std::invalid_argument);
    EXPECT_THROW(configured({node}, -1), std::invalid_argument);
    const auto why = [](ControllerConfig config) -> std::string {
        return error_of<std::invalid_argument>([&] { config.check(); });
    };
    ControllerConfig config;
    config.nodes = {{"one", Policy::abort}};
    EXPECT_EQ(why(config), "");
    for (std::string *name : {&config.simulation, &config.nodes[0].name, &config.watched.emplace_back(),
                              &config.asynchronous.emplace_back(AsynchronousConfig{"two", {}}).name}) {
        const std::string good = *name;
        *name = "a\x1b[2J";
        EXPECT_TRUE(why(config).ends_with("'s name holds the control character U+001B")) << why(config);
        *name = std::string(256, 'a');
        EXPECT_TRUE(why(config).ends_with("'s name of 256 bytes; 255 are the most")) << why(config);
        *name = good;
    }
    config.asynchronous = {{"ground", {}}, {"room", {"/up", "/ground/command"}}};
    EXPECT_EQ(why(config), "a topic has one writer; ground and room both write /ground/command");
    config.asynchronous[0].topics = {"/up"};
    EXPECT_EQ(why(config), "a topic has one writer; room and ground both write /up");
    config.asynchronous[1].topics = {"/ground/command"};
    EXPECT_EQ(why(config), "");
    EXPECT_NO_THROW(configured({node}, 0));
}

} // namespace controller_test
} // namespace fledge::cosim
