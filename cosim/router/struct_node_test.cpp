// SPDX-License-Identifier: Apache-2.0
// Programs whose messages are their own structs: they exchange messages, leave, and restart from snapshots.
#include "cosim/node/struct_node.h"

#include "cosim/router/router.h"

#include <gtest/gtest.h>

#include <future>
#include <optional>

namespace fledge::cosim {
namespace struct_node_test {

constexpr Ns ms = 1'000'000;

struct Position {
    double x, y;
};

const Schema position_schema = make_schema("Position", "float64 x  # x [m]\nfloat64 y  # y [m]\n");

/// Publishes its position, and drifts with its input; `drift` is an internal state.
struct Drifter {
    Position here{1, 0}, there{};
    double drift = 0;

    void step()
    {
        drift += 0.25 * there.x;
        here.x += 0.125 * drift;
        here.y += 1;
    }
};

/// The result of a run without a kill.
struct Outcome {
    std::vector<double> seen;
    std::string reason, victim, successor;
    Ns began_again = -1;
};

/// Whether the controller reads what programs send at once, or only when all of the following have come: the greeting
/// of a stranger, the last frame of the lost program, and the greeting of the new one.
enum class Reads { at_once, late };

/// Two drifters; one is lost at the instant `dies`, and a new program takes its place.
Outcome fly(Ns dies, bool keeps, Reads reads = Reads::at_once)
{
    static int runs = 0;
    ControllerConfig config;
    config.simulation = "drift";
    config.nodes = {{"a", Policy::restart}, {"b", Policy::abort}};
    config.nodes[0].save_every = 100 * ms;
    config.end = 1000 * ms;
    RouterConfig router_config;
    router_config.address = "ipc://@fledge-struct-node-" + std::to_string(getpid()) + "-" + std::to_string(runs++);
    router_config.sharing = reads == Reads::late ? Sharing::forbidden : Sharing::allowed;
    zmq::context_t context;
    Router router(context, config, router_config);
    Outcome outcome;
    std::atomic<bool> dying = false, held = false;
    std::promise<void> lost;
    std::future<std::string> stranger;

    const auto be_a = [&](std::optional<Ns> end) -> std::string {
        Drifter drifter;
        StructNode a({"drift", "a", router.address()}, {10 * ms, 0});
        a.read("/b/position", Latency::next_instant, drifter.there, position_schema);
        a.write("/a/position", drifter.here, position_schema);
        if (keeps) {
            a.save_in_snapshots(drifter.drift);
        }
        bool first = true;
        try {
            return a.run([&](Ns t) {
                if (!end && first) {
                    outcome.began_again = t;
                }
                first = false;
                if (t == end) {
                    dying = reads == Reads::late;
                    while (dying && !held) {
                        std::this_thread::sleep_for(std::chrono::milliseconds(1));
                    }
                    throw std::runtime_error("killed");
                }
                drifter.step();
            });
        } catch (const std::exception &error) {
            return error.what();
        }
    };
    auto b = std::async(std::launch::async, [&] {
        Drifter drifter;
        StructNode node({"drift", "b", router.address()}, {10 * ms, 0});
        node.read("/a/position", Latency::same_instant, drifter.there);
        node.write("/b/position", drifter.here, position_schema);
        outcome.reason = node.run([&](Ns) {
            outcome.seen.push_back(drifter.there.x);
            drifter.step();
        });
    });
    auto a = std::async(std::launch::async, [&] {
        outcome.victim = be_a(dies);
        if (outcome.victim == "killed") {
            lost.set_value();
            outcome.successor = be_a({});
        }
    });
    const std::string reason = router.run([&] {
        constexpr auto until_a_greeting_is_there = std::chrono::milliseconds(50);
        if (dying && !held) {
            stranger = std::async(std::launch::async, [&]() -> std::string {
                try {
                    return StructNode({"drift", "c", router.address()}, {10 * ms, 0}).run([](Ns) {});
                } catch (const LinkError &error) {
                    return error.what();
                }
            });
            std::this_thread::sleep_for(until_a_greeting_is_there);
            held = true;
            lost.get_future().wait();
            std::this_thread::sleep_for(until_a_greeting_is_there);
        }
        return true;
    });
    EXPECT_EQ(reason, "");
    if (stranger.valid()) {
        EXPECT_EQ(stranger.get(), "the controller refuses c: drift has no node c; it has a and b");
    }
    a.get();
    b.get();
    return outcome;
}

TEST(StructNode, ANewProgramGoesOnFromASnapshotOrFromTheBeginning)
{
    const Outcome whole = fly(-1, false);
    ASSERT_EQ(whole.seen.size(), 101u);
    EXPECT_EQ(whole.victim, "");
    EXPECT_NE(whole.seen.back(), whole.seen.front());
    const std::pair<bool, Reads> losses[] = {{false, Reads::at_once}, {true, Reads::at_once}, {true, Reads::late}};
    for (const auto &[keeps, reads] : losses) {
        const Outcome again = fly(500 * ms, keeps, reads);
        EXPECT_EQ(again.victim, "killed");
        EXPECT_EQ(again.successor, "");
        EXPECT_EQ(again.reason, "");
        EXPECT_EQ(again.seen, whole.seen);
        if (keeps) {
            EXPECT_GT(again.began_again, 300 * ms);
            EXPECT_LE(again.began_again, 500 * ms);
        } else {
            EXPECT_EQ(again.began_again, 0);
        }
    }
}

TEST(StructNode, AProgramStepsAtSeveralRatesAndReadsAnOptionalTopicThatNoNodeWrites)
{
    ControllerConfig config;
    config.simulation = "drift";
    config.nodes = {{"a", Policy::abort}, {"b", Policy::abort}};
    config.end = 60 * ms;
    RouterConfig router_config;
    router_config.address = "ipc://@fledge-struct-node-rates-" + std::to_string(getpid());
    zmq::context_t context;
    Router router(context, config, router_config);
    std::vector<Ns> instants;
    std::vector<double> seen;

    auto a = std::async(std::launch::async, [&] {
        Position here{};
        StructNode node({"drift", "a", router.address()}, {20 * ms, 0});
        node.also_step({30 * ms, 5 * ms});
        node.write("/a/position", here, position_schema);
        node.run([&](Ns t) {
            instants.push_back(t);
            here.x = static_cast<double>(t / ms);
        });
    });
    auto b = std::async(std::launch::async, [&] {
        StructNode node({"drift", "b", router.address()}, {30 * ms, 0});
        Position there{}, nothing{1, 2};
        node.read("/a/position", Latency::same_instant, there);
        node.read("/nothing", Latency::same_instant, std::as_writable_bytes(std::span(&nothing, 1)), {}, true);
        node.run([&](Ns) {
            seen.push_back(there.x);
            EXPECT_EQ(nothing.y, 2);
        });
    });
    EXPECT_EQ(router.run(), "");
    a.get();
    b.get();
    EXPECT_EQ(instants, (std::vector<Ns>{0, 5 * ms, 20 * ms, 35 * ms, 40 * ms, 60 * ms}));
    EXPECT_EQ(seen, (std::vector<double>{0, 20, 60}));
}

/// Run a node in another thread, and stop it once `ready` is true. Returns why it ended.
std::string stopped(StructNode &node, const std::function<bool()> &ready)
{
    auto end = std::async(std::launch::async, [&]() -> std::string {
        try {
            return node.run([](Ns) {});
        } catch (const LinkError &error) {
            return error.what();
        }
    });
    while (!ready()) {
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    node.stop();
    return end.get();
}

TEST(StructNode, AProgramCanEndItWhileItWaitsForAController)
{
    StructNode node({"drift", "a", "ipc://@fledge-struct-node-alone-" + std::to_string(getpid())}, {10 * ms, 0});
    EXPECT_EQ(stopped(node, [] { return true; }), "the program ended it");
}

TEST(StructNode, AProgramCanEndItWhileItWaitsForItsFirstTick)
{
    for (const Sharing sharing : {Sharing::required, Sharing::forbidden}) {
        ControllerConfig config;
        config.simulation = "drift";
        config.nodes = {{"a", Policy::abort}, {"b", Policy::abort}}; // b does not come
        config.end = 60 * ms;
        RouterConfig router_config;
        router_config.address = "ipc://@fledge-struct-node-stop-" + std::to_string(getpid());
        router_config.sharing = sharing;
        zmq::context_t context;
        Router router(context, config, router_config);
        std::atomic<bool> there = false;
        auto run = std::async(std::launch::async, [&] {
            return router.run([&] {
                there = std::string_view(router.controller().state(0)) == "joining";
                return true;
            });
        });
        StructNode node({"drift", "a", router.address()}, {10 * ms, 0});
        EXPECT_EQ(stopped(node, [&] { return there.load(); }), "the program ended it");
        EXPECT_EQ(run.get(), "a: it failed: the program ended it");
    }
}

TEST(StructNode, ARateThatMakesNoSenseIsRefusedAtOnce)
{
    for (const Rate rate : {Rate{0, 0}, {-1, 0}, {10, -1}, {longest_time + 1, 0}, {1, longest_time + 1}}) {
        EXPECT_THROW(StructNode({"drift", "a", "ipc://@x"}, rate), std::invalid_argument);
        StructNode node({"drift", "a", "ipc://@x"}, {10, 0});
        EXPECT_THROW(node.also_step(rate), std::invalid_argument);
    }
    EXPECT_NO_THROW(StructNode({"drift", "a", "ipc://@x"}, {longest_time, longest_time}));
}

TEST(Outbox, OnlyAMessageThatHasChangedIsSent)
{
    Position position{1, 2};
    const auto bytes = std::as_bytes(std::span(&position, 1));
    Outbox outbox;
    outbox.add(3, bytes);
    std::vector<Record> records;
    outbox.collect(10, records);
    EXPECT_TRUE(records.empty());
    position.x = 3;
    outbox.collect(20, records);
    outbox.collect(30, records);
    ASSERT_EQ(records.size(), 1u);
    EXPECT_EQ(records[0].t, 20);
    EXPECT_EQ(records[0].count, 1u);
}

TEST(StructNode, ADefinitionThatDoesNotFitTheStructIsRefused)
{
    StructNode node({"drift", "a", "ipc://@x"}, {1, 0});
    Position position{};
    double x = 0;
    EXPECT_NO_THROW(node.read("/p", Latency::same_instant, position, position_schema));
    EXPECT_THROW(node.read("/x", Latency::same_instant, x, position_schema), SchemaError);
    EXPECT_THROW(node.write("/x", x, position_schema), SchemaError);
}

} // namespace struct_node_test
} // namespace fledge::cosim
