// SPDX-License-Identifier: Apache-2.0
// Nodes join, leave, die, come back and restart, while the horizon moves. The tests compare random networks with a
// look-up in the history of all writes, which knows only the times at which each node took part.
#include "cosim/controller/testing/network.h"

#include <array>
#include <cstdlib>

namespace fledge::cosim {
namespace life_test {

constexpr Ns the_end = 400;

/// A random network in which some nodes join late and all may leave.
std::vector<Spec> random_lives(Random &random)
{
    auto specs = random_network(random);
    for (std::size_t i = 0; i < specs.size(); i++) {
        Spec &spec = specs[i];
        spec.on_loss = std::array{Policy::pause, Policy::hold, Policy::drop, Policy::restart}[random() % 4];
        spec.rejoins = random() % 2;
        spec.saves = random() % 2;
        spec.save_every = static_cast<Ns>(random() % 3 * 35);
        if (i && random() % 2) {
            spec.joins = random() % 2 ? Join::at_time : Join::when_it_comes;
            spec.joins_after = static_cast<Ns>(random() % (the_end - 1));
        }
        if (random() % 4 == 0) {
            spec.leaves_at = static_cast<Ns>(random() % the_end);
        }
    }
    for (Spec &spec : specs) {
        if (random() % 3 == 0) {
            spec.subscriptions.push_back(subscription("/ground/command", static_cast<Latency>(random() % 3)));
        }
        for (Subscription &subscription : spec.subscriptions) {
            subscription.optional = std::any_of(specs.begin(), specs.end(), [&](const Spec &s) {
                const bool may_go = s.leaves_at != for_ever || s.on_loss == Policy::hold || s.on_loss == Policy::drop;
                return (s.joins != Join::at_start || may_go) && subscription.topic.starts_with("/" + s.name + "/");
            });
        }
    }
    return specs;
}

bool away(const Bench &bench, NodeId id)
{
    const std::string state = bench.controller.state(id);
    return state == "absent" || state == "left" || state == "lost";
}

void come(Bench &bench, NodeId id)
{
    const Spec &spec = bench.specs[id];
    const bool waited_for = std::string(bench.controller.state(id)) == "lost" && spec.on_loss == Policy::pause;
    bench.nodes[id].start_anew(waited_for && !spec.saves);
    bench.arrive(id);
}

/// Connect the nodes for which the run waits; false if there are none.
bool admit_missing(Bench &bench)
{
    bool some = false;
    const auto missed = bench.controller.absent();
    for (NodeId id = 0; id < bench.specs.size(); id++) {
        const Spec &spec = bench.specs[id];
        const bool paused = spec.on_loss == Policy::pause && std::string(bench.controller.state(id)) == "lost";
        if (away(bench, id) && (paused || std::find(missed.begin(), missed.end(), spec.name) != missed.end())) {
            come(bench, id);
            some = true;
        }
    }
    return some;
}

/// From the start to the end, with at most so many losses; a horizon delays the nodes.
std::string live(Bench &bench, int losses, bool comers)
{
    Random &random = bench.random;
    bench.arrive_all();
    while (!bench.outcome) {
        bench.act();
        const NodeId id = random() % bench.specs.size();
        const unsigned dice = random() % 100;
        if (comers && dice < 5 && away(bench, id) && bench.specs[id].joins != Join::at_start) {
            come(bench, id);
        } else if (comers && dice < 8 && bench.controller.running() && away(bench, id)) {
            come(bench, id);
        } else if (losses && dice < 14 && bench.controller.running() && !away(bench, id)) {
            bench.sleeping = false;
            bench.controller.lost(id, "it was killed");
            losses--;
        } else if (comers && dice < 17) {
            bench.controller.inject("ground", "/ground/command", word(random()));
        } else if (dice < 30 || !bench.reply_somewhere()) {
            bench.act();
            const bool idle =
                std::none_of(bench.requests.begin(), bench.requests.end(), [](const auto &r) { return r.has_value(); });
            if (idle && !bench.outcome && bench.controller.next_due() > the_end && !admit_missing(bench)) {
                break;
            }
            if (idle && admit_missing(bench)) {
                continue;
            }
            bench.sleeping = false;
            bench.controller.set_horizon(random() % 2 ? bench.controller.next_due()
                                                      : static_cast<Ns>(random() % the_end));
        }
    }
    return bench.outcome.value_or("the run hangs");
}

/// FLEDGE_CAMPAIGN=1 takes a minute.
unsigned networks()
{
    const char *campaign = std::getenv("FLEDGE_CAMPAIGN");
    return campaign && std::string(campaign) == "1" ? 200'000 : 2'000;
}

TEST(Life, InputsDependOnlyOnTheTimesAtWhichNodesJoinAndLeave)
{
    std::map<Change::What, std::size_t> changes;
    std::size_t again = 0, refused = 0, commanded = 0;
    for (unsigned network = 0; network < networks(); network++) {
        Random random(network);
        const auto specs = random_lives(random);
        auto config = Bench::configured(specs, the_end, network % 3 ? 1000 : 2, 4096);
        config.horizon = network % 2 ? -1 : for_ever;
        Bench bench(specs, config, network);
        SCOPED_TRACE("network " + std::to_string(network));
        const std::string outcome = live(bench, 6, true);
        if (outcome.find("times without progress") != std::string::npos || outcome == "all nodes have left" ||
            outcome.starts_with("all nodes were lost")) {
            continue; // a correct end, with nothing to compare
        }
        ASSERT_EQ(outcome, "");
        ASSERT_FALSE(HasFailure());
        const auto lives = lives_of(specs, bench.controller.changes());
        std::vector<Write> commands{{-1, 0}};
        for (const auto &[t, x] : bench.written["/ground/command"]) {
            commands.push_back({t, x});
            commanded++;
        }
        History wanted = expected(specs, the_end, lives, {{"/ground/command", commands}});
        const History found = bench.history();
        for (const Spec &spec : specs) {
            ASSERT_EQ(found.at(spec.name), wanted[spec.name]) << spec.name;
        }
        for (const Change &change : bench.controller.changes()) {
            changes[change.what]++;
        }
        refused += bench.refusals.size();

        // The same run again, with the reported times and without any loss.
        auto planned = specs;
        bool possible = commands.size() == 1;
        for (Spec &spec : planned) {
            const auto own = lives.parts.find(spec.name);
            possible = possible && (own == lives.parts.end() || own->second.size() == 1);
            spec.joins = own == lives.parts.end() ? Join::when_it_comes : Join::at_start;
            spec.leaves_at = for_ever;
            if (own != lives.parts.end()) {
                const auto [from, to] = own->second.front();
                spec.joins = from < 0 ? Join::at_start : Join::at_time;
                spec.joins_after = from;
                spec.leaves_at = to;
                const auto instants = spec.instants(the_end);
                // A node that was lost just after others had joined would now leave just before.
                possible = possible && std::none_of(specs.begin(), specs.end(), [&, last = to](const Spec &other) {
                               const auto part = lives.parts.find(other.name);
                               return part != lives.parts.end() && part->second.front().first == last;
                           });
                possible = possible && from < the_end &&
                           (to == for_ever ||
                            (to > from && std::find(instants.begin(), instants.end(), to) != instants.end()));
            }
        }
        if (possible) {
            Bench second(planned, the_end, network + 1);
            const std::string outcome_again = live(second, 0, false);
            ASSERT_TRUE(outcome_again.empty() || outcome_again == "all nodes have left") << outcome_again;
            if (outcome_again.empty()) {
                ASSERT_EQ(second.history(), found);
                again++;
            }
        }
    }
    EXPECT_GT(changes[Change::joined], 1000u);
    EXPECT_GT(changes[Change::left], 300u);
    EXPECT_GT(changes[Change::given_up], 1000u);
    EXPECT_GT(changes[Change::back], 1000u);
    EXPECT_GT(again, 200u);
    EXPECT_GT(refused, 100u);
    EXPECT_GT(commanded, 1000u);
}

} // namespace life_test
} // namespace fledge::cosim
