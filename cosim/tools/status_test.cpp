// SPDX-License-Identifier: Apache-2.0
// How the router measures a node's time, with nodes that sleep; and the lines of the status stream.
#include "cosim/protocol/testing/patience.h"
#include "cosim/tools/status.h"

#include <gtest/gtest.h>

#include <array>
#include <future>
#include <limits>
#include <sys/socket.h>
#include <thread>
#include <unistd.h>

namespace fledge::cosim {
namespace status_test {

using namespace std::chrono_literals;

/// Writes a word after a sleep, and reads the word of another node.
class Sleeper : public Node {
public:
    Sleeper(std::string reads, std::string writes, Latency latency, std::chrono::milliseconds nap)
        : reads_(std::move(reads)), writes_(std::move(writes)), latency_(latency), nap_(nap)
    {
    }

    Initialized initialize(const Initialize &m) override
    {
        next_ = m.start < 0 ? 0 : m.start + 10;
        return {{{10, 0}}, false};
    }
    std::vector<Subscription> desired() override { return {{reads_, latency_, false, schema_}}; }
    std::vector<Publication> match(const std::vector<Channel> &channels) override
    {
        for (const Channel &channel : channels) {
            if (channel.topic == writes_) {
                channel_ = channel.channel;
                return {{channel_, schema_, word()}};
            }
        }
        return {};
    }
    void start(const std::vector<Channel> &) override {}
    Tock tick(const Tick &tick) override
    {
        Tock tock;
        tock.reached = tick.until;
        for (; next_ <= tick.until; next_ += 10) {
            std::this_thread::sleep_for(nap_);
            if (next_ == quits_at) {
                throw std::runtime_error("enough");
            }
            tock.records.push_back({channel_, ++count_, next_, word()});
            steps++;
        }
        tock.compute_ns = claims;
        return tock;
    }

    int steps = 0;
    Ns claims = 0; ///< the time that it reports; 0: the measured one
    Ns quits_at = -1;

private:
    static Payload word()
    {
        const std::uint64_t x = 0;
        return make_payload(std::as_bytes(std::span(&x, 1)));
    }

    Schema schema_ = make_schema("Word", "uint64 x  # x [-] a word\n");
    std::string reads_, writes_;
    Latency latency_;
    std::chrono::milliseconds nap_;
    std::uint32_t channel_ = 0, count_ = 0;
    Ns next_ = 0;
};

struct Ends {
    Ends() { EXPECT_EQ(socketpair(AF_UNIX, SOCK_STREAM, 0, ends.data()), 0); }
    ~Ends()
    {
        close(ends[0]);
        close(ends[1]);
    }
    std::string read() const
    {
        std::string all;
        char text[4096];
        for (ssize_t n; (n = recv(ends[0], text, sizeof text, MSG_DONTWAIT)) > 0;) {
            all.append(text, static_cast<std::size_t>(n));
        }
        return all;
    }
    std::array<int, 2> ends{};
};

ControllerConfig two(Ns end)
{
    ControllerConfig config;
    config.simulation = "test";
    config.nodes = {{"slow", Policy::abort}, {"quick", Policy::abort}};
    config.end = end;
    return config;
}

TEST(Status, TimeIsSpentComputingOnTheWayOrWaiting)
{
    zmq::context_t context;
    const ControllerConfig config = two(190);
    RouterConfig at;
    at.address = "inproc://status";
    Router router(context, config, at);
    // In turns: while one sleeps, the other waits.
    Sleeper slow("/quick/n", "/slow/n", Latency::next_instant, 8ms);
    Sleeper quick("/slow/n", "/quick/n", Latency::same_instant, 2ms);
    const auto serve = [&](const char *name, Node &node) {
        return Delegate(context, {"test", name, router.address(), patience, {}}).serve(node);
    };
    const auto begun = std::chrono::steady_clock::now();
    auto a = std::async(std::launch::async, serve, "slow", std::ref(slow));
    auto b = std::async(std::launch::async, serve, "quick", std::ref(quick));
    EXPECT_EQ(router.run(), "");
    const Ns all = std::chrono::nanoseconds(std::chrono::steady_clock::now() - begun).count();
    a.get();
    b.get();

    const NodeTimes s = router.times(0), q = router.times(1);
    ASSERT_EQ(slow.steps, 20);
    ASSERT_EQ(quick.steps, 20);
    EXPECT_EQ(s.ticks, 20u);
    EXPECT_GE(s.compute, 20 * 8'000'000);
    EXPECT_GE(q.compute, 20 * 2'000'000);
    EXPECT_GE(s.wait, 19 * 2'000'000);
    EXPECT_GE(q.wait, 20 * 8'000'000);
    EXPECT_GT(s.transport, 0);
    EXPECT_GT(q.transport, 0);
    for (const NodeTimes &t : {s, q}) {
        EXPECT_EQ(t.pending, 0);
        EXPECT_LE(t.compute + t.transport + t.wait, all);
    }
}

TEST(Status, ANodeReportsNoMoreTimeThanHasPassed)
{
    for (const Ns claimed : {longest_time, std::numeric_limits<Ns>::max(), std::numeric_limits<Ns>::min(), Ns{-1}}) {
        zmq::context_t context;
        RouterConfig at;
        at.address = "inproc://status-claims";
        Router router(context, two(190), at);
        Sleeper slow("/quick/n", "/slow/n", Latency::next_instant, 0ms);
        Sleeper quick("/slow/n", "/quick/n", Latency::same_instant, 0ms);
        slow.claims = claimed;
        router.host("slow", slow); // without frames, so that nothing has checked the number before
        router.host("quick", quick);
        const auto begun = std::chrono::steady_clock::now();
        EXPECT_EQ(router.run(), "");
        const Ns all = std::chrono::nanoseconds(std::chrono::steady_clock::now() - begun).count();
        const NodeTimes times = router.times(0);
        EXPECT_EQ(times.ticks, 20u);
        for (const Ns part : {times.compute, times.transport, times.compute + times.transport + times.wait}) {
            EXPECT_GE(part, 0);
            EXPECT_LE(part, all);
        }
    }
}

/// A run of 20 instants at a pace: the number of its steps, its duration and its delays.
struct Paced {
    Paced(double speed, std::chrono::milliseconds nap)
    {
        zmq::context_t context;
        RouterConfig at;
        at.address = "inproc://pace";
        at.pace = speed;
        Router router(context, two(190), at);
        Sleeper a("/quick/n", "/slow/n", Latency::next_instant, nap);
        Sleeper b("/slow/n", "/quick/n", Latency::same_instant, nap);
        const auto begun = std::chrono::steady_clock::now();
        router.host("slow", a);
        router.host("quick", b);
        EXPECT_EQ(router.run(), "");
        took = std::chrono::steady_clock::now() - begun;
        steps = a.steps + b.steps;
        if (router.pace()) {
            report = *router.pace();
        }
    }
    int steps;
    std::chrono::nanoseconds took;
    PaceReport report;
};

TEST(Pace, InstantsBeginWhenTheirTimeHasCome)
{
    const Paced paced(1e-6, 0ms); // an instant each 10 ms
    EXPECT_EQ(paced.steps, 40);
    EXPECT_GE(paced.took, 190ms);
}

TEST(Pace, ASlowNodeIsLateAndLosesNoStep)
{
    const Paced paced(1e-5, 5ms); // an instant each 1 ms, which takes 10 ms
    EXPECT_EQ(paced.steps, 40);
    EXPECT_GE(paced.took, 200ms);
    EXPECT_GE(paced.report.overruns, 1u);
    EXPECT_GE(paced.report.worst, 8'000'000);
}

TEST(Pace, WithoutAPaceTheRunDoesNotWait)
{
    const Paced paced(0.0, 0ms);
    EXPECT_EQ(paced.steps, 40);
    EXPECT_EQ(paced.report.overruns, 0u);
}

TEST(Status, TheTimeToComeBackBeginsWithTheLoss)
{
    zmq::context_t context;
    ControllerConfig config = two(890);
    config.nodes[1].on_loss = Policy::restart;
    RouterConfig at;
    at.address = "inproc://status-away";
    at.join = 6s;
    Router router(context, config, at);
    Sleeper slow("/quick/n", "/slow/n", Latency::next_instant, 75ms);
    Sleeper first("/slow/n", "/quick/n", Latency::same_instant, 0ms), second = first;
    first.quits_at = 840; // later than `join` after the start
    const auto serve = [&](const char *name, Node &node) {
        return Delegate(context, {"test", name, router.address(), patience, {}, {}}).serve(node);
    };
    auto a = std::async(std::launch::async, serve, "slow", std::ref(slow));
    auto b = std::async(std::launch::async, [&] {
        EXPECT_THROW(serve("quick", first), std::runtime_error);
        while (true) {
            try {
                return serve("quick", second);
            } catch (const LinkError &) { // the first one has not been missed yet
                std::this_thread::sleep_for(10ms);
            }
        }
    });
    EXPECT_EQ(router.run(), "");
    EXPECT_EQ(a.get(), "");
    EXPECT_EQ(b.get(), "");
}

TEST(Status, TheStateIsWrittenAsLinesOfJson)
{
    zmq::context_t context;
    const ControllerConfig config = two(0);
    RouterConfig at;
    at.address = "inproc://status-lines";
    Router router(context, config, at);
    const Ends pair;
    StatusStream status(pair.ends[1]);
    status.listening(router.address());
    EXPECT_EQ(pair.read(), "{\"listening\":\"inproc://status-lines\"}\n");
    status.report("a \"quote\", a \\ and\na line");
    EXPECT_EQ(pair.read(), "{\"report\":\"a \\\"quote\\\", a \\\\ and\\u000aa line\"}\n");
    status.report("\x1b[2J\xff\xc2\x9b");
    EXPECT_EQ(pair.read(), "{\"report\":\"?[2J??\"}\n");
    status.progress(router, config);
    const std::string line = pair.read();
    EXPECT_TRUE(line.starts_with("{\"phase\":\"gathering\",\"wall\":")) << line;
    EXPECT_NE(line.find("{\"name\":\"quick\",\"state\":\"absent\",\"t\":-1,\"ticks\":0,\"compute\":0,\"transport\":0,"
                        "\"wait\":0,\"pending\":0}]}\n"),
              line.npos)
        << line;
    status.progress(router, config);
    EXPECT_EQ(pair.read(), "") << "not so often";
}

TEST(Status, TheReaderCanEndTheRun)
{
    Ends pair;
    StatusStream status(pair.ends[1]);
    EXPECT_EQ(status.read_line(), "");
    ASSERT_EQ(send(pair.ends[0], "stop mass did", 13, 0), 13);
    EXPECT_EQ(status.read_line(), "");
    ASSERT_EQ(send(pair.ends[0], " not start\npause\n", 17, 0), 17);
    EXPECT_EQ(status.read_line(), "stop mass did not start");
    EXPECT_EQ(status.read_line(), "pause");
    EXPECT_EQ(status.read_line(), "");
}

TEST(Status, TheEndOfTheReaderEndsTheRunAndASlowReaderDoesNotBlockIt)
{
    Ends pair;
    StatusStream status(pair.ends[1]);
    for (int i = 0; i < 10'000; i++) {
        status.report("a line without a reader, of many");
    }
    EXPECT_EQ(status.read_line(), "");
    close(std::exchange(pair.ends[0], -1));
    EXPECT_EQ(status.read_line(), "stop the program that started it is gone");
    status.report("without a reader");
}

TEST(Status, WithoutADescriptorItDoesNothing)
{
    StatusStream status(-1);
    status.listening("x");
    EXPECT_EQ(status.read_line(), "");
    EXPECT_THROW(StatusStream(999), LinkError);
}

} // namespace status_test
} // namespace fledge::cosim
