// SPDX-License-Identifier: Apache-2.0
// Each class of the controller on its own.
#include "cosim/controller/grants.h"
#include "cosim/protocol/testing/words.h"

#include <gtest/gtest.h>

namespace fledge::cosim {
namespace parts_test {

const Schedule every_10{{{10, 0}}, false};

TEST(Schedule, TheNextInstantIsTheFirstOfAllRates)
{
    const Schedule schedule{{{10, 0}, {25, 5}}, false};
    EXPECT_EQ(schedule.next_after(-1), 0);
    EXPECT_EQ(schedule.next_after(0), 5);
    EXPECT_EQ(schedule.next_after(20), 30); // of both
    EXPECT_EQ(schedule.longest_period(), 25);
    EXPECT_EQ(Schedule{}.next_after(0), for_ever);
}

TEST(Schedule, ANodeThatStepsAtAnyTimeMayWriteAtTheNextNanosecond)
{
    EXPECT_EQ(every_10.first_write_after(3), 10);
    EXPECT_EQ((Schedule{{{10, 0}}, true}).first_write_after(3), 4);
}

TEST(Schedule, AnInvalidScheduleIsReported)
{
    EXPECT_EQ(every_10.fault(), "");
    EXPECT_EQ(Schedule{}.fault(), "it never steps");
    EXPECT_EQ((Schedule{{{0, 5}}, false}).fault(), "a step of 0 ns from 5 ns on; a period is > 0, an offset >= 0");
    EXPECT_EQ(format_rates({{1'000'000'000, 0}, {500'000'000, 250'000'000}}), "1 s and 0.5 s from 0.25 s on");
}

TEST(TopicMap, TopicsHaveAPrefixOrAnotherName)
{
    const TopicMap plain, map{"a", {{"/x", "/b/y"}, {"/z", "/a/w"}}};
    EXPECT_EQ(plain.to_run("/x"), "/x");
    EXPECT_EQ(plain.to_node("/x"), "/x");
    EXPECT_EQ(map.to_run("/world/q"), "/a/world/q");
    EXPECT_EQ(map.to_node("/a/world/q"), "/world/q");
    EXPECT_EQ(map.to_node("/world/q"), std::nullopt);
    EXPECT_EQ(map.to_node("/ab/world/q"), std::nullopt);
    EXPECT_EQ(map.to_run("/x"), "/b/y");
    EXPECT_EQ(map.to_node("/b/y"), "/x");
    EXPECT_EQ(map.to_node("/a/x"), std::nullopt); // it is called otherwise
    EXPECT_EQ(map.to_node("/a/w"), "/z");
    EXPECT_EQ(map.fault(), "");
    EXPECT_EQ((TopicMap{"", {{"/x", "/q"}, {"/y", "/q"}}}).fault(), "two of its topics become /q");
    EXPECT_EQ((TopicMap{"", {{"x", "/q"}}}).fault(), "its topics begin with a slash; found x as /q");
}

Wire wire(Latency latency, Ns exchange = 100)
{
    Wire w(0, 1);
    w.lay(0, latency, exchange, -1, word(1));
    return w;
}

std::vector<std::pair<Ns, std::uint64_t>> delivered(Wire &w, Ns until)
{
    std::vector<Record> records;
    w.deliver(until, records);
    std::vector<std::pair<Ns, std::uint64_t>> found;
    for (const Record &record : records) {
        found.emplace_back(record.t, word_of(record.payload));
    }
    return found;
}

using Words = std::vector<std::pair<Ns, std::uint64_t>>;

TEST(Wire, TheLatencyDecidesWhenTheReaderSeesAMessage)
{
    EXPECT_EQ(wire(Latency::same_instant).first_seen(30), 30);
    EXPECT_EQ(wire(Latency::next_instant).first_seen(30), 31);
    EXPECT_EQ(wire(Latency::next_exchange).first_seen(30), 101);
    EXPECT_EQ(wire(Latency::next_exchange).first_seen(100), 101);
}

TEST(Wire, InputsAreKnownUntilTheWritersNextMessageCanBeSeen)
{
    EXPECT_EQ(wire(Latency::same_instant).known_until(30), 29);
    EXPECT_EQ(wire(Latency::next_instant).known_until(30), 30);
    EXPECT_EQ(wire(Latency::next_exchange).known_until(30), 100);
    EXPECT_EQ(wire(Latency::next_exchange).known_until(101), 200);
    EXPECT_EQ(wire(Latency::same_instant).known_until(for_ever), for_ever);
}

TEST(Wire, AMessageIsDeliveredOnceAndInOrder)
{
    Wire w = wire(Latency::same_instant);
    w.push(10, word(2), every_10);
    w.push(20, word(3), every_10);
    EXPECT_EQ(delivered(w, 10), (Words{{0, 1}, {10, 2}}));
    EXPECT_EQ(delivered(w, 10), Words{});
    EXPECT_EQ(delivered(w, 20), (Words{{20, 3}}));
}

TEST(Wire, AMessageThatTheReaderNeverSeesIsReplaced)
{
    Wire w = wire(Latency::same_instant);
    w.push(11, word(2), every_10);
    w.push(13, word(3), every_10); // the reader steps at 10 and 20
    EXPECT_EQ(delivered(w, 20), (Words{{0, 1}, {13, 3}}));
}

TEST(Wire, MessagesAreCountedAndDeliveredUpToTheGivenTime)
{
    Wire w = wire(Latency::same_instant);
    w.push(10, word(2), every_10);
    w.push(20, word(3), every_10);
    EXPECT_EQ(w.count_deliverable(9), 1u);
    EXPECT_EQ(w.count_deliverable(10), 2u);
    EXPECT_EQ(w.count_deliverable(100), 3u);
    EXPECT_EQ(delivered(w, 9), (Words{{0, 1}}));
    EXPECT_EQ(w.count_deliverable(9), 0u);
    EXPECT_EQ(w.count_deliverable(100), 2u);
    EXPECT_EQ(delivered(w, 100), (Words{{10, 2}, {20, 3}}));
    EXPECT_EQ(w.count_deliverable(100), 0u);
}

TEST(Wire, ARestartedReaderGetsItsUnreadMessagesAgain)
{
    Wire w = wire(Latency::same_instant);
    w.push(10, word(2), every_10);
    w.push(20, word(3), every_10);
    delivered(w, 20);
    w.pass(10);
    w.restart();
    EXPECT_EQ(delivered(w, 20), (Words{{20, 3}}));
    w.restart();
    w.resend_last(10); // to a program without a snapshot
    EXPECT_EQ(delivered(w, 20), (Words{{10, 2}, {20, 3}}));
}

TEST(Wire, AnAsynchronousMessageIsSeenAfterTheReadersGrant)
{
    Wire w = wire(Latency::same_instant);
    delivered(w, 40);
    EXPECT_EQ(w.earliest_write(40, every_10), 41);
    w.push(41, word(2), every_10);
    EXPECT_EQ(w.earliest_write(40, every_10), 51) << "the instant 50 sees the message before";
}

/// Nodes 0, 1, ... that step every 10 ns; each reads the topic of the node before it, the first that of the last.
class Ring {
public:
    explicit Ring(const std::vector<Latency> &latencies) : wiring(latencies.size()), nodes(latencies.size())
    {
        config.end = 1000;
        for (NodeId id = 0; id < nodes.size(); id++) {
            const NodeId before = (id + nodes.size() - 1) % nodes.size();
            nodes[id].config.name = name(id);
            nodes[id].member = nodes[id].been = nodes[id].matching = true;
            nodes[id].stage = Stage::idle;
            nodes[id].schedule = every_10;
            nodes[id].subscriptions = {{"/" + name(before) + "/x", latencies[id], false, schema}};
        }
        wiring.begin_matching(nodes, {}, -1, true);
        for (NodeId id = 0; id < nodes.size(); id++) {
            nodes[id].publications = {{*wiring.find("/" + name(id) + "/x"), schema, word(id)}};
        }
        std::vector<std::string> notes;
        wiring.connect(nodes, notes);
        wiring.end_matching();
    }

    static std::string name(NodeId id) { return std::string(1, static_cast<char>('a' + id)); }
    Ns grant(NodeId id, Ns last = 1000) const { return Grants(config, nodes, wiring, last).grant(id); }
    /// The node steps up to t and writes at t.
    void step(NodeId id, Ns t, std::uint32_t count)
    {
        nodes[id].reached = t;
        wiring.write(id, nodes, {{static_cast<std::uint32_t>(id), count, t, word(t)}});
    }

    ControllerConfig config;
    Wiring wiring;
    Nodes nodes;
    const Schema schema = make_schema("Word", word_text);
};

TEST(Wiring, ACycleOfNodesIsReported)
{
    const Ring ring({Latency::same_instant, Latency::same_instant});
    EXPECT_EQ(ring.wiring.faults(),
              "these nodes wait for each other in a cycle: b for /a/x of a, a for /b/x of b; one of "
              "these messages has to be read later, at the next instant or exchange");
    EXPECT_EQ(Ring({Latency::next_instant, Latency::same_instant}).wiring.faults(), "");
}

TEST(Wiring, AnInvalidTockIsReportedWithItsFault)
{
    Ring ring({Latency::next_instant, Latency::same_instant});
    ring.nodes[0].until = 20;
    const auto fault = [&](const Record &record) {
        return ring.wiring.fault_of(0, ring.nodes[0], {20, 0, {record}, false});
    };
    EXPECT_EQ(fault({0, 1, 10, word(1)}), "");
    EXPECT_EQ(fault({1, 1, 10, word(1)}), "it wrote on channel 1, which it does not publish");
    EXPECT_EQ(fault({0, 2, 10, word(1)}), "gap: message 2 of /a/x follows message 0");
    EXPECT_EQ(fault({0, 1, 15, word(1)}).substr(0, 12), "out of step:");
    EXPECT_EQ(fault({0, 1, 30, word(1)}).substr(0, 6), "early:");
    const Record first{0, 1, 10, word(1)};
    EXPECT_EQ(ring.wiring.fault_of(0, ring.nodes[0], {20, 0, {first, {0, 2, 20, word(2)}}, false}), "");
    EXPECT_EQ(ring.wiring.fault_of(0, ring.nodes[0], {20, 0, {first, first}, false}),
              "duplicate: message 1 of /a/x came before");
    EXPECT_EQ(fault(first), "") << "no tock was taken";
}

TEST(Wiring, ANeighbourIsThereOnceHoweverManyWiresJoinIt)
{
    const Ring pair({Latency::next_instant, Latency::same_instant});
    EXPECT_EQ(pair.wiring.neighbours(0), std::vector<NodeId>{1});
    const Ring three(std::vector(3, Latency::next_exchange));
    EXPECT_EQ(three.wiring.neighbours(0), (std::vector<NodeId>{1, 2})) << "its reader, its writer";
}

TEST(Grants, AProducerStepsBeforeItsConsumer)
{
    Ring ring({Latency::next_instant, Latency::same_instant});
    EXPECT_EQ(ring.grant(0), 0);
    EXPECT_EQ(ring.grant(1), -1) << "it waits for the message of the same instant";
    ring.step(0, 0, 1);
    EXPECT_EQ(ring.grant(0), 0) << "it waits for the message of the instant before";
    EXPECT_EQ(ring.grant(1), 0);
    ring.step(1, 0, 1);
    EXPECT_EQ(ring.grant(0), 10);
}

TEST(Grants, NodesConnectedByExchangesStepAtTheSameTime)
{
    Ring ring({Latency::next_exchange, Latency::next_exchange});
    EXPECT_EQ(ring.grant(0), 0);
    EXPECT_EQ(ring.grant(1), 0);
}

TEST(Grants, NoNodeStepsBeyondTheLastInstant)
{
    Ring ring({Latency::next_instant, Latency::next_instant});
    EXPECT_EQ(ring.grant(0, -1), -1);
    EXPECT_EQ(ring.grant(0, 5), 0);
}

TEST(Grants, ATickHasAtMostABatchOfInstants)
{
    Ring ring({Latency::same_instant});
    ring.config.batch = 3;
    EXPECT_EQ(ring.grant(0), 20);
    EXPECT_EQ(ring.grant(0, 15), 10);
    EXPECT_EQ(ring.grant(0, 10), 10);
    ring.nodes[0].schedule.any_time = true;
    EXPECT_EQ(ring.grant(0), 20);
    EXPECT_EQ(ring.grant(0, 15), 15) << "it may step between its rates";
}

TEST(Grants, ATockThatNoNodeWaitsForIsNotUnblocking)
{
    Ring ring({Latency::next_instant, Latency::same_instant});
    ring.nodes[0].stage = Stage::ticking;
    ring.nodes[0].until = 0;
    std::vector<char> marked;
    EXPECT_TRUE(Grants(ring.config, ring.nodes, ring.wiring, 1000).unblocking_nodes(marked));
    EXPECT_EQ(marked, (std::vector<char>{true, false}));
}

TEST(Admission, TheBoundaryIsTheFirstInstantBeyondWhichNoNodeWasGranted)
{
    Ring ring({Latency::next_instant, Latency::same_instant});
    Admission admission(ring.config);
    admission.choose(ring.nodes);
    EXPECT_EQ(admission.last(), 1000);
    ring.nodes[0].reached = 20;
    ring.nodes[1].reached = 10;
    NodeState &joiner = ring.nodes.emplace_back();
    joiner.stage = Stage::entered;
    joiner.joining = true;
    admission.call_joiners(ring.nodes, ring.wiring, false);
    EXPECT_EQ(admission.boundary(), 20);
    EXPECT_EQ(admission.last(), 20);
    EXPECT_TRUE(admission.joins_next(joiner));
    EXPECT_FALSE(admission.all_met(ring.nodes));
    ring.nodes[1].reached = 20;
    EXPECT_TRUE(admission.all_met(ring.nodes));
    joiner.joining = false; // it has left
    admission.call_joiners(ring.nodes, ring.wiring, false);
    EXPECT_FALSE(admission.boundary());
}

TEST(Admission, ANodeThatJoinsAtATimeStopsTheRunThere)
{
    Ring ring({Latency::next_instant, Latency::same_instant});
    NodeState &late = ring.nodes.emplace_back();
    late.config.joins = Join::at_time;
    late.config.joins_after = 300;
    Admission admission(ring.config);
    admission.choose(ring.nodes);
    EXPECT_EQ(admission.last(), 300);
    EXPECT_TRUE(admission.joins_next(late));
}

TEST(RestartLog, ANewProgramRepeatsItsInputsAndOutputs)
{
    RestartLog log;
    log.begin(-1);
    log.log_input({{0, 1, 0, word(1)}, {0, 2, 10, word(2)}});
    log.log_output({{1, 1, 5, word(7)}, {1, 2, 15, word(8)}});
    log.begin_replay(log.saved());
    const Tick tick = log.next_tick(20);
    EXPECT_EQ(tick.until, 20);
    EXPECT_EQ(tick.records.size(), 2u);
    const auto name = [](std::uint32_t) { return "/a/x"; };
    EXPECT_EQ(log.repeat_output({1, 1, 5, word(7)}, "/a/x"), "");
    EXPECT_EQ(log.repeat_output({1, 2, 15, word(9)}, "/a/x"), "/a/x at 0.000000015 s differs from the value before");
    EXPECT_EQ(log.finish_tick(20, name), "it does not write /a/x at 0.000000015 s, but the program before did");
    EXPECT_EQ(log.repeat_output({1, 2, 15, word(8)}, "/a/x"), "");
    EXPECT_EQ(log.finish_tick(20, name), "");
    EXPECT_EQ(log.replayed(), 20);
    EXPECT_EQ(log.repeat_output({1, 3, 16, word(8)}, "/a/x"),
              "it writes /a/x at 0.000000016 s, which the program before did not");
}

TEST(RestartLog, ASnapshotReplacesOlderMessages)
{
    RestartLog log;
    log.begin(-1);
    log.log_input({{0, 1, 0, word(1)}, {0, 2, 10, word(2)}});
    log.log_output({{1, 1, 5, word(7)}});
    const std::size_t before = log.bytes();
    log.log_input({{0, 3, 20, word(3)}});
    log.forget_inputs_after(10);
    EXPECT_EQ(log.bytes(), before);
    log.take_snapshot(5, Bytes(3));
    EXPECT_EQ(log.saved(), 5);
    EXPECT_EQ(log.bytes(), before / 3);
    log.begin_replay(log.saved());
    EXPECT_EQ(log.next_tick(20).records.size(), 1u);
    EXPECT_EQ(log.repeat_output({1, 1, 5, word(7)}, "/a/x"),
              "it writes /a/x at 0.000000005 s, which the program before did not");
}

} // namespace parts_test
} // namespace fledge::cosim
