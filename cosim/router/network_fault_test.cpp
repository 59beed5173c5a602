// SPDX-License-Identifier: Apache-2.0
// Nodes that join late, leave, die, hang and send nonsense, and the pace, on real sockets. fault_test.cpp of the
// controller has all cases, without sockets.
#include "cosim/protocol/testing/patience.h"
#include "cosim/router/testing/nodes.h"

#include <gtest/gtest.h>

#include <future>
#include <thread>

namespace fledge::cosim {
namespace network_fault_test {

using namespace std::chrono_literals;
using namespace testing_nodes;

/// It makes snapshots, and begins after Initialize::start.
class Saver : public Counter {
public:
    using Counter::Counter;

    Initialized initialize(const Initialize &m) override
    {
        Counter::initialize(m);
        next = m.start < 0 ? 0 : m.start / 10 * 10 + 10;
        if (m.snapshot.size() == 8) {
            received = word_of(make_payload(m.snapshot));
        }
        return {{{10, 0}}, false, true};
    }
    Bytes save() override
    {
        const auto bytes = std::as_bytes(std::span(&received, 1));
        return {bytes.begin(), bytes.end()};
    }
};

/// It leaves at an instant.
class Leaver : public Counter {
public:
    Leaver(Ns when, std::string reads, std::string writes)
        : Counter(std::move(reads), std::move(writes), Latency::same_instant), when_(when)
    {
    }
    Tock tick(const Tick &tick) override
    {
        const Ns last = std::min(tick.until, when_);
        Tock tock = Counter::tick({last, tick.records});
        tock.reached = last;
        tock.leaving = last == when_;
        return tock;
    }

private:
    Ns when_;
};

RouterConfig listening()
{
    static std::atomic<int> count{0};
    RouterConfig config;
    config.address = "ipc://@fledge-fault-" + std::to_string(getpid()) + "-" + std::to_string(count++);
    return config;
}

/// Act as a delegate until the tick that passes `t`, then call `mischief` with the link.
template <class Mischief>
void play(const std::string &address, const std::string &name, Node &node, Ns t, Mischief mischief)
{
    zmq::context_t context;
    zmq::socket_t greetings(context, zmq::socket_type::dealer);
    greetings.set(zmq::sockopt::linger, 1000);
    greetings.set(zmq::sockopt::rcvtimeo, static_cast<int>(std::chrono::milliseconds(patience).count()));
    greetings.connect(address);
    greetings.send(zmq::buffer(encode({1, Hello{1, 1, "test", name}})), zmq::send_flags::none);
    zmq::message_t message;
    ASSERT_TRUE(greetings.recv(message));
    const Frame reply = decode({message.data<std::byte>(), message.size()});
    ASSERT_TRUE(std::holds_alternative<Welcome>(reply.message)) << kind_name(reply.message);
    Link link(context, {});
    link.socket().connect(std::get<Welcome>(reply.message).address);
    link.send({1, Hello{1, 1, "test", name}});
    for (;;) {
        const Frame request = link.wait(patience);
        const auto *tick = std::get_if<Tick>(&request.message);
        if (tick && tick->until >= t) {
            return mischief(link, request);
        }
        link.send({request.number, answer(node, request.message)});
    }
}

struct Running {
    explicit Running(const ControllerConfig &controller, RouterConfig config = listening())
        : router(context, controller, with_reports(std::move(config)))
    {
        result = in_thread([this] { return router.run(); });
    }

    RouterConfig with_reports(RouterConfig config)
    {
        config.report = [this](const std::string &text) { reports += text + "\n"; };
        return config;
    }

    std::future<std::string> serve(const std::string &name, Node &node)
    {
        return in_thread([this, name, &node] { return testing_nodes::serve(context, router.address(), name, node); });
    }

    zmq::context_t context;
    std::string reports; ///< to be read when the run is over
    Router router;
    std::future<std::string> result;
};

TEST(Fault, ANodeComesLateAndOneLeaves)
{
    ControllerConfig config = config_of({{"a"}, {"b"}, {"c"}}, 1000);
    config.nodes[2].joins = Join::at_time;
    config.nodes[2].joins_after = 400;
    Running run(config);
    Counter a("", "/a/n", Latency::same_instant);
    Leaver b(700, "/a/n", "");
    Saver c("/a/n", "", Latency::same_instant);
    auto served_a = run.serve("a", a), served_b = run.serve("b", b), served_c = run.serve("c", c);
    EXPECT_EQ(run.result.get(), "");
    EXPECT_EQ(served_a.get() + served_b.get() + served_c.get(), "");
    EXPECT_EQ(b.all.back().first, 700);
    EXPECT_EQ(c.initialized.start, 400);
    EXPECT_EQ(c.all.front().first, 410);
    EXPECT_EQ(c.all.back().first, 1000);
    EXPECT_EQ(run.reports, "c joins after 0.0000004 s\nb leaves at 0.0000007 s; its messages keep their last values\n");
}

TEST(Fault, AMissingJoinerIsNamed)
{
    ControllerConfig config = config_of({{"a"}, {"c"}}, 1000);
    config.nodes[1].joins = Join::at_time;
    config.nodes[1].joins_after = 400;
    RouterConfig router = listening();
    router.join = 300ms;
    Running run(config, router);
    Counter a("", "/a/n", Latency::same_instant);
    auto served_a = run.serve("a", a);
    EXPECT_EQ(run.result.get(), "c did not come within 0.3 s");
    EXPECT_EQ(run.router.controller().reached(0), 400);
}

TEST(Fault, ANewProgramGoesOnFromASnapshotUnnoticed)
{
    const auto flown = [](bool die) {
        ControllerConfig config = config_of({{"a"}, {"b", Policy::restart}}, 2000);
        config.nodes[1].save_every = 300;
        Running run(config);
        Counter a("/b/n", "/a/n", Latency::next_instant);
        Saver b("/a/n", "/b/n", Latency::same_instant), again("/a/n", "/b/n", Latency::same_instant);
        auto served_a = run.serve("a", a);
        std::future<std::string> served_b;
        if (die) {
            play(run.router.address(), "b", b, 1500, [](Link &, const Frame &) {}); // its link is gone
            served_b = run.serve("b", again);
        } else {
            served_b = run.serve("b", b);
        }
        EXPECT_EQ(run.result.get(), "");
        EXPECT_EQ(served_a.get() + served_b.get(), "");
        if (die) {
            EXPECT_EQ(again.initialized.start, 1200);
            EXPECT_EQ(again.initialized.snapshot.size(), 8u);
            EXPECT_EQ(run.reports, "b: its connection is gone (it had reached 0.00000149 s); restarted, it goes on "
                                   "from 0.0000012 s\nb is back at 0.00000149 s\n");
        }
        return a.all;
    };
    const auto undisturbed = flown(false);
    EXPECT_EQ(undisturbed.size(), 201u);
    EXPECT_EQ(flown(true), undisturbed);
}

TEST(Fault, AnInvalidFrameInTheRunIsReportedAndThePolicyDecides)
{
    const auto reported = [](const auto &mischief, std::chrono::milliseconds reply_timeout = patience) {
        ControllerConfig config = config_of({{"a"}, {"b", Policy::hold}}, 1000);
        RouterConfig router = listening();
        router.replies = {patience, reply_timeout};
        router.limits.frame = 10'000;
        Running run(config, router);
        Counter a("/b/n", "/a/n", Latency::next_instant);
        auto served_a = run.serve("a", a);
        Counter b("/a/n", "/b/n", Latency::same_instant);
        play(run.router.address(), "b", b, 500, [&](Link &link, const Frame &request) {
            Frame reply{request.number, answer(b, request.message)};
            mischief(link, reply);
            run.result.wait();
        });
        EXPECT_EQ(run.result.get(), "");
        EXPECT_EQ(served_a.get(), "");
        EXPECT_EQ(a.next, 1010);
        return run.reports;
    };
    const std::string rest = " (it had reached 0.00000049 s); its messages keep their last values\n";
    const auto raw = [](Link &link, const Bytes &bytes) {
        link.socket().send(zmq::buffer(bytes), zmq::send_flags::none);
    };
    EXPECT_EQ(reported([](Link &, Frame &) {}, 1s), "b: it did not answer within 1 s" + rest); // it hangs
    EXPECT_EQ(reported([&](Link &link, Frame &) { raw(link, Bytes(50, std::byte{0x5a})); }),
              "b: it sent no frame: this is no frame of a co-simulation" + rest);
    EXPECT_EQ(reported([&](Link &link, Frame &reply) {
                  Bytes bytes = encode(reply);
                  bytes.back() ^= std::byte{1};
                  raw(link, bytes);
              }),
              "b: it sent no frame: the checksum of the body is wrong" + rest);
    EXPECT_EQ(reported([&](Link &link, Frame &) { raw(link, Bytes(20'000)); }), "b: its connection is gone" + rest);
    EXPECT_EQ(reported([](Link &link, Frame &reply) {
                  std::get<Tock>(reply.message).records[0].count++;
                  link.send(reply);
              }),
              "b: gap: message 52 of /b/n follows message 50" + rest);
    EXPECT_EQ(reported([](Link &link, Frame &reply) {
                  std::get<Tock>(reply.message).records[0].count--;
                  link.send(reply);
              }),
              "b: duplicate: message 50 of /b/n came before" + rest);
    EXPECT_EQ(reported([](Link &link, Frame &reply) {
                  std::get<Tock>(reply.message).records[0].t -= 10;
                  link.send(reply);
              }),
              "b: late: message 51 of /b/n was written at 0.00000049 s, which other nodes have passed" + rest);
}

TEST(Fault, ANodeThatWasGivenUpMayComeAgain)
{
    ControllerConfig config = config_of({{"a"}, {"b", Policy::hold}}, 1'000);
    config.nodes[1].rejoins = true;
    config.batch = 1; // so that the boundary is near
    Running run(config);
    struct Waiter : Counter {
        using Counter::Counter;
        void before_step(Ns t) override
        {
            if (t == 700) {
                greeted.get_future().wait();
            }
        }
        std::promise<void> greeted;
    } a("/b/n", "/a/n", Latency::next_instant);
    auto served_a = run.serve("a", a);
    Counter b("/a/n", "/b/n", Latency::same_instant);
    play(run.router.address(), "b", b, 500, [](Link &, const Frame &) {});
    // Another program greets while the run goes on without the lost node.
    zmq::socket_t greetings(run.context, zmq::socket_type::dealer);
    greetings.set(zmq::sockopt::rcvtimeo, static_cast<int>(std::chrono::milliseconds(patience).count()));
    greetings.connect(run.router.address());
    zmq::message_t message;
    Frame reply{1, Refused{}};
    while (!std::holds_alternative<Welcome>(reply.message)) {
        greetings.send(zmq::buffer(encode({1, Hello{1, 1, "test", "b"}})), zmq::send_flags::none);
        ASSERT_TRUE(greetings.recv(message)); // the controller may not have noticed the loss yet
        reply = decode({message.data<std::byte>(), message.size()});
        std::this_thread::sleep_for(1ms);
    }
    Link link(run.context, {});
    link.socket().connect(std::get<Welcome>(reply.message).address);
    link.send({1, Hello{1, 1, "test", "b"}});
    a.greeted.set_value();
    Saver again("/a/n", "/b/n", Latency::same_instant);
    for (bool over = false; !over;) {
        const Frame request = link.wait(patience);
        over = std::holds_alternative<Finish>(request.message);
        link.send({request.number, answer(again, request.message)});
    }
    EXPECT_EQ(run.result.get(), "");
    EXPECT_EQ(served_a.get(), "");
    ASSERT_EQ(run.router.controller().changes().size(), 2u);
    const Change joined = run.router.controller().changes()[1];
    EXPECT_EQ(joined.what, Change::joined);
    EXPECT_GE(joined.after, 490);
    EXPECT_EQ(again.initialized.start, joined.after);
    EXPECT_EQ(again.next, 1010);
}

TEST(Fault, ThePaceFollowsAbsoluteTimesAndCountsOverruns)
{
    struct Slow : Counter {
        using Counter::Counter;
        void before_step(Ns t) override
        {
            if (t == 500) {
                std::this_thread::sleep_for(60ms);
            }
        }
    };
    RouterConfig router = listening();
    router.pace = 1e-6; // 10 ns take 10 ms
    const auto begun = std::chrono::steady_clock::now();
    Running run(config_of({{"a"}, {"b"}}, 1000), router);
    Counter a("/b/n", "/a/n", Latency::next_instant);
    Slow b("/a/n", "/b/n", Latency::same_instant);
    auto served_a = run.serve("a", a), served_b = run.serve("b", b);
    EXPECT_EQ(run.result.get(), "");
    EXPECT_EQ(served_a.get() + served_b.get(), "");
    EXPECT_GE(std::chrono::steady_clock::now() - begun, 1s); // 1000 ns, caught up after the slow step
    EXPECT_EQ(b.received, 201u);
    const PaceReport *report = run.router.pace();
    ASSERT_TRUE(report);
    EXPECT_GE(report->overruns, 1u);
    EXPECT_GE(report->worst, 40'000'000);
}

TEST(Fault, ASteeredRunPausesGoesOnAndChangesItsPaceWithoutAnotherMessage)
{
    const auto fly = [](bool steered) {
        RouterConfig router = listening();
        router.pace = steered ? 1e-6 : 0; // 10 ns take 10 ms
        router.steered = steered;
        zmq::context_t context;
        Router run(context, config_of({{"a"}, {"b"}}, 2'000'000), router);
        Counter a("/b/n", "/a/n", Latency::next_instant), b("/a/n", "/b/n", Latency::same_instant);
        run.host("a", a);
        run.host("b", b);
        int paused = 0;
        EXPECT_EQ(run.run([&] {
            if (Pace *pace = run.steer(); pace && run.controller().running()) {
                if (pace->paused()) {
                    EXPECT_EQ(a.next, 510);
                    EXPECT_EQ(b.next, 510);
                    if (++paused == 3) { // as fast as possible
                        pace->set_speed(0);
                        pace->pause_after(for_ever);
                    }
                } else if (!paused) {
                    pace->pause_after(505);
                }
            }
            return true;
        }),
                  "");
        EXPECT_EQ(paused, steered ? 3 : 0);
        return std::pair(a.all, b.all);
    };
    EXPECT_EQ(fly(true), fly(false));
}

} // namespace network_fault_test
} // namespace fledge::cosim
