// SPDX-License-Identifier: Apache-2.0
// The table of faults in README.md: each node is lost in each phase under each policy; and each wrong action of a
// node.
#include "cosim/controller/testing/network.h"
#include "cosim/protocol/words.h"
#include "tests/error_of.h"

#include <functional>

namespace fledge::cosim {
namespace fault_test {

/// Two nodes that exchange words, and one that joins after 300 ns.
std::vector<Spec> three(Policy policy)
{
    std::vector<Spec> specs(3);
    specs[0] = {"world", {{10, 0}}, false, {subscription("/flight/u", Latency::next_instant)}, {"/world/x"}};
    specs[1] = {"flight", {{50, 0}}, false, {subscription("/world/x", Latency::same_instant)}, {"/flight/u"}};
    specs[2] = {"late", {{20, 0}}, false, {subscription("/world/x", Latency::next_instant)}, {}};
    specs[2].joins = Join::at_time;
    specs[2].joins_after = 300;
    for (Spec &spec : specs) {
        spec.on_loss = policy;
        spec.saves = policy == Policy::restart;
        spec.save_every = 100;
    }
    return specs;
}

struct Case {
    std::string phase;
    std::function<bool(const Bench &)> reached;
};

/// Run until the condition holds; the late node joins at its time. False if the run ends before.
bool until(Bench &bench, const std::function<bool(const Bench &)> &reached)
{
    for (bool some = true; some; some = bench.reply_somewhere()) {
        bench.act();
        if (bench.controller.absent() == std::vector<std::string>{"late"}) {
            bench.arrive(2);
            bench.act();
        }
        if (reached(bench)) {
            return true;
        }
    }
    return false;
}

/// Run to the end; the nodes for which the run waits connect (again).
std::string to_the_end(Bench &bench)
{
    for (int comings = 0; comings < 20; comings++) {
        until(bench, [](const Bench &) { return false; });
        bool some = false;
        for (NodeId id = 0; id < bench.specs.size() && !bench.outcome; id++) {
            const std::string state = bench.controller.state(id);
            const Policy policy = bench.specs[id].on_loss;
            if (state == "lost" && (policy == Policy::pause || policy == Policy::restart)) {
                bench.nodes[id].start_anew(policy == Policy::pause);
                bench.arrive(id);
                some = true;
            }
        }
        if (!some) {
            break;
        }
    }
    return bench.outcome.value_or("the run hangs");
}

TEST(Faults, ANodeIsKilledInEveryPhase)
{
    const auto requested = [](NodeId id, const char *kind) {
        return [id, kind](const Bench &b) {
            return b.requests[id] && std::string(kind_name(b.requests[id]->message)) == kind;
        };
    };
    for (const auto &[name, policy] : policy_words) {
        for (const NodeId victim : {NodeId{0}, NodeId{1}}) {
            const std::string victim_name = three(policy)[victim].name;
            const History undisturbed = [&, p = policy] {
                Bench bench(three(p), 600, 1);
                bench.arrive(0);
                bench.arrive(1);
                EXPECT_EQ(to_the_end(bench), "");
                return bench.history();
            }();
            // Before the first tick, each loss ends the run, by name.
            for (const char *kind : {"Initialize", "ProvideDesired", "Match", "Start"}) {
                Bench bench(three(policy), 600, 2);
                bench.arrive(0);
                bench.arrive(1);
                bench.act();
                ASSERT_TRUE(until(bench, requested(victim, kind)));
                bench.controller.lost(victim, "it was killed");
                EXPECT_EQ(to_the_end(bench), victim_name + ": it was killed") << name << kind;
            }
            // The node dies during a tick; at the boundary where the late node joins; during the matching there;
            // and while it makes a snapshot.
            for (const char *kind : {"Tick", "boundary", "Match", "Start", "Save"}) {
                if (std::string(kind) == "Save" && policy != Policy::restart) {
                    continue;
                }
                Bench bench(three(policy), 600, 3);
                bench.arrive(0);
                bench.arrive(1);
                const std::string where = std::string(name) + " of " + victim_name + " at its " + kind;
                ASSERT_TRUE(until(bench, [&](const Bench &b) {
                    return std::string(kind) == "boundary"
                               ? b.requests[2] && !b.requests[0] && !b.requests[1] && b.controller.waiting()
                               : b.controller.reached(victim) >= 100 && requested(victim, kind)(b);
                })) << where;
                bench.controller.lost(victim, "it was killed");
                const std::string outcome = to_the_end(bench);
                const History history = bench.history();
                if (policy == Policy::abort) {
                    EXPECT_TRUE(outcome.starts_with(victim_name + ": it was killed (it had reached "))
                        << where << outcome;
                    continue;
                }
                EXPECT_EQ(outcome, "") << where;
                const bool same = policy == Policy::pause || policy == Policy::restart;
                for (NodeId id = 0; id < 3; id++) {
                    const std::string &node = bench.specs[id].name;
                    if (same) {
                        EXPECT_EQ(history.at(node), undisturbed.at(node)) << where << ", " << node;
                    } else if (id != victim) {
                        EXPECT_EQ(history.at(node).size(), undisturbed.at(node).size()) << where << ", " << node;
                    }
                }
                EXPECT_EQ(history.at("late").front().first, 320) << where;
                EXPECT_EQ(history.at("late").back().first, 600) << where;
                ASSERT_FALSE(bench.reports.empty()) << where;
                EXPECT_TRUE(bench.reports[0].starts_with(victim_name + ": it was killed (it had reached "))
                    << bench.reports[0];
            }
            // While all nodes finish, it does not count as a loss.
            Bench bench(three(policy), 600, 4);
            bench.arrive(0);
            bench.arrive(1);
            ASSERT_TRUE(until(bench, requested(victim, "Finish")));
            bench.controller.lost(victim, "it was killed");
            EXPECT_EQ(to_the_end(bench), "") << name;
        }
    }
}

TEST(Faults, AJoinerThatIsKilledDoesNotStopTheOthers)
{
    for (const char *kind : {"Initialize", "ProvideDesired", "Match", "Start"}) {
        Bench bench(three(Policy::abort), 600, 5);
        bench.arrive(0);
        bench.arrive(1);
        ASSERT_TRUE(until(bench, [&](const Bench &b) {
            return b.requests[2] && std::string(kind_name(b.requests[2]->message)) == kind;
        }));
        bench.controller.lost(2, "it was killed");
        bench.nodes[2].start_anew(false);
        EXPECT_EQ(to_the_end(bench), "") << kind;
        EXPECT_EQ(bench.reports[0], "late: it was killed, before it took part; the controller waits for it again");
        EXPECT_EQ(bench.history().at("late").size(), 15u);
    }
}

TEST(Faults, AnIncompatibleJoinerIsRefusedAndTheRunGoesOn)
{
    auto specs = three(Policy::abort);
    specs[2].joins = Join::when_it_comes;
    specs[2].subscriptions[0].schema = make_schema("Word", "uint64 x  # x [m] a word\n");
    Bench bench(specs, 600, 6);
    bench.arrive(0);
    bench.arrive(1);
    ASSERT_TRUE(until(bench, [](const Bench &b) { return b.controller.reached(0) >= 100; }));
    bench.arrive(2);
    EXPECT_EQ(to_the_end(bench), "");
    ASSERT_EQ(bench.reports.size(), 1u);
    EXPECT_EQ(bench.reports[0],
              "late cannot join: late subscribes to /world/x of world, but field x is uint64 [-] in the "
              "publication and uint64 [m] in the subscription");
    EXPECT_TRUE(bench.controller.changes().empty());
    Bench undisturbed(three(Policy::abort), 600, 7);
    undisturbed.arrive(0);
    undisturbed.arrive(1);
    EXPECT_EQ(to_the_end(undisturbed), "");
    EXPECT_EQ(bench.history().at("flight"), undisturbed.history().at("flight"));

    // Without a node that has to join at a time, the run ends.
    specs[2].joins = Join::at_time;
    Bench awaited(specs, 600, 8);
    awaited.arrive(0);
    awaited.arrive(1);
    EXPECT_TRUE(to_the_end(awaited).starts_with("late subscribes to /world/x of world, but field x is "));
}

TEST(Faults, ARestartedProgramWithOtherOutputsEndsTheRun)
{
    for (const auto &[mischief, complaint] :
         std::map<std::string, std::string>{{"value", " differs from the value before"},
                                            {"more", ", which the program before did not"},
                                            {"less", ", but the program before did"}}) {
        Bench bench(three(Policy::restart), 600, 9);
        bench.arrive(0);
        bench.arrive(1);
        ASSERT_TRUE(until(bench, [](const Bench &b) { return b.controller.reached(0) >= 190 && b.requests[0]; }));
        bench.controller.lost(0, "it was killed");
        bench.nodes[0].start_anew(false);
        bench.arrive(0);
        bool changed = false;
        while (!bench.outcome) {
            bench.act();
            if (bench.outcome || !bench.requests[0]) {
                if (!bench.reply_somewhere()) {
                    break;
                }
                continue;
            }
            const Frame request = *std::exchange(bench.requests[0], std::nullopt);
            Frame answer{request.number, bench.nodes[0].answer(request.message, bench.random, bench.end)};
            if (auto *tock = std::get_if<Tock>(&answer.message); tock && !changed && !tock->records.empty()) {
                changed = true;
                if (mischief == "value") {
                    tock->records[0].payload = word(1);
                } else if (mischief == "less") {
                    tock->records.clear();
                } else {
                    tock->records[0].t -= 1;
                }
            }
            bench.controller.received(0, answer);
        }
        EXPECT_TRUE(changed);
        const std::string outcome = bench.outcome.value_or("none");
        EXPECT_TRUE(outcome.starts_with("world: restarted from 0.0000001 s")) << outcome;
        EXPECT_TRUE(outcome.find("it does not repeat its messages: ") != std::string::npos) << outcome;
        EXPECT_TRUE(outcome.ends_with(complaint)) << outcome;
    }
}

TEST(Faults, AProgramThatDiesRepeatedlyEndsTheRun)
{
    Bench bench(three(Policy::restart), 600, 10);
    bench.arrive(0);
    bench.arrive(1);
    ASSERT_TRUE(until(bench, [](const Bench &b) { return b.controller.reached(0) >= 150 && b.requests[0]; }));
    for (int deaths = 0; deaths < 4; deaths++) {
        bench.controller.lost(0, "it was killed");
        bench.nodes[0].start_anew(false);
        bench.arrive(0);
        bench.act();
    }
    EXPECT_TRUE(to_the_end(bench).ends_with("; it was restarted 3 times without progress"));
}

TEST(Faults, ARestartLogIsBounded)
{
    for (const bool saves : {true, false}) {
        auto specs = three(Policy::restart);
        for (Spec &spec : specs) {
            spec.saves = saves;
            spec.save_every = 0;
        }
        auto config = Bench::configured(specs, 600, 1000, 4096);
        config.log = 1000;
        Bench bench(specs, config, 11);
        bench.arrive(0);
        bench.arrive(1);
        ASSERT_TRUE(until(bench, [](const Bench &b) { return b.controller.reached(0) >= 500 && b.requests[0]; }));
        bench.controller.lost(0, "it was killed");
        const std::string outcome = to_the_end(bench);
        if (saves) {
            EXPECT_EQ(outcome, ""); // it made a snapshot in time
        } else {
            EXPECT_TRUE(outcome.ends_with("; its log is too large, so it cannot be restarted")) << outcome;
            EXPECT_NE(bench.reports[0].find(" cannot be restarted from now on"), std::string::npos);
        }
    }
}

TEST(Faults, StepsOtherThanConfiguredAreRefusedBeforeTheFirstTick)
{
    const auto specs = three(Policy::abort);
    auto config = Bench::configured(specs, 600, 1000, 4096);
    config.nodes[1].steps = {{40, 0}};
    Bench bench(specs, config, 12);
    bench.arrive(0);
    bench.arrive(1);
    EXPECT_EQ(to_the_end(bench), "flight: it steps every 0.00000005 s, but is to step every 0.00000004 s; one of them "
                                 "has to be changed");
}

TEST(Faults, AnInvalidConfigurationOfJoinsAndRestartsIsRefused)
{
    const auto refusal = [](const auto &change) -> std::string {
        auto config = Bench::configured(three(Policy::abort), 600, 1000, 4096);
        change(config);
        return error_of<std::invalid_argument>([&] { Controller controller(config); });
    };
    EXPECT_EQ(refusal([](auto &) {}), "");
    EXPECT_EQ(refusal([](auto &c) { c.nodes[2].joins_after = 600; }),
              "late joins after 0.0000006 s; expected a time from 0 to before the end at 0.0000006 s");
    EXPECT_EQ(refusal([](auto &c) { c.nodes[0].save_every = -1; }),
              "world saves every -1 ns; expected a time > 0, or 0 to save when the log is full");
    EXPECT_EQ(refusal([](auto &c) {
                  c.nodes.resize(1);
                  c.nodes[0].joins = Join::when_it_comes;
              }),
              "no node joins at the start; at least one has to");
}

} // namespace fault_test
} // namespace fledge::cosim
