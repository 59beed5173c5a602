// SPDX-License-Identifier: Apache-2.0
// Controllers and nodes on real sockets, with nodes that count. tests/cosim_identity_test.cpp
// flies the mission this way.
#include "cosim/node/simulation_node.h"
#include "cosim/protocol/testing/patience.h"
#include "cosim/router/router.h"
#include "cosim/router/testing/nodes.h"
#include "tests/error_of.h"

#include <gtest/gtest.h>

#include <atomic>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <functional>
#include <future>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>

namespace fledge::cosim {
namespace network_test {

using namespace std::chrono_literals;

using testing_nodes::Counter;
using testing_nodes::in_thread;
using testing_nodes::serve;

ControllerConfig two_nodes(Ns end)
{
    return testing_nodes::config_of({{"a", Policy::abort}, {"b", Policy::abort}}, end);
}

RouterConfig listening(const std::string &transport)
{
    static std::atomic<int> count{0};
    const std::string name = "fledge-test-" + std::to_string(getpid()) + "-" + std::to_string(count++);
    RouterConfig config;
    config.sharing = transport == "shm" ? Sharing::required : Sharing::forbidden;
    config.address = transport == "tcp"      ? "tcp://127.0.0.1:*"
                     : transport != "inproc" ? "ipc://@" + name
                                             : "inproc://" + name;
    return config;
}

class Transport : public testing::TestWithParam<const char *> {};

TEST_P(Transport, TwoNodesCountTogether)
{
    // a sees the previous message of b, and b sees that of a at once: each step adds one.
    zmq::context_t context;
    Router router(context, two_nodes(1000), listening(GetParam()));
    Counter a("/b/n", "/a/n", Latency::next_instant), b("/a/n", "/b/n", Latency::same_instant);
    auto serve_a = in_thread([&] { return serve(context, router.address(), "a", a); });
    auto serve_b = in_thread([&] { return serve(context, router.address(), "b", b); });
    EXPECT_EQ(router.run(), "");
    EXPECT_EQ(serve_a.get(), "");
    EXPECT_EQ(serve_b.get(), "");
    EXPECT_EQ(a.received, 200u);
    EXPECT_EQ(b.received, 201u);
    EXPECT_EQ(a.reason, "");
    EXPECT_EQ(a.initialized.end, 1000);
    EXPECT_EQ(router.times(0).ticks, 101u);
    EXPECT_GT(router.times(0).transport, 0);
}

TEST_P(Transport, SignalsInterruptNoFrame)
{
    // A handler runs, and the call that it interrupted is made again.
    static std::atomic<unsigned> handled{0};
    struct sigaction handler {
    }, before{};
    handler.sa_handler = [](int) { handled++; };
    sigaction(SIGUSR1, &handler, &before);
    zmq::context_t context;
    Router router(context, two_nodes(20'000), listening(GetParam()));
    Counter a("/b/n", "/a/n", Latency::next_instant), b("/a/n", "/b/n", Latency::same_instant);
    std::atomic<bool> over{false};
    std::mutex mutex; // a thread that has ended takes no signal
    std::vector<pthread_t> threads{pthread_self()};
    const auto serve_signalled = [&](const char *name, Node &node) {
        (mutex.lock(), threads.push_back(pthread_self()), mutex.unlock());
        std::string reason = serve(context, router.address(), name, node);
        const std::lock_guard lock(mutex);
        std::erase(threads, pthread_self());
        return reason;
    };
    auto serve_a = in_thread([&] { return serve_signalled("a", a); });
    auto serve_b = in_thread([&] { return serve_signalled("b", b); });
    auto signals = in_thread([&] {
        while (!over) {
            {
                const std::lock_guard lock(mutex);
                for (const pthread_t thread : threads) {
                    pthread_kill(thread, SIGUSR1);
                }
            }
            std::this_thread::sleep_for(20us);
        }
        return 0;
    });
    std::string reason;
    try {
        reason = router.run();
    } catch (const std::exception &error) {
        reason = error.what();
    }
    EXPECT_EQ(serve_a.get(), "");
    EXPECT_EQ(serve_b.get(), "");
    over = true;
    signals.get();
    sigaction(SIGUSR1, &before, nullptr);
    EXPECT_EQ(reason, "");
    EXPECT_EQ(b.received, 4001u);
    EXPECT_GT(handled, 0u);
}

TEST_P(Transport, AnErrorInANodeReachesTheUser)
{
    struct Pole : Counter {
        using Counter::Counter;
        void before_step(Ns t) override
        {
            if (t == 500) {
                throw std::runtime_error("a pole");
            }
        }
    };
    zmq::context_t context;
    Router router(context, two_nodes(1000), listening(GetParam()));
    Counter a("/b/n", "/a/n", Latency::next_instant);
    Pole b("/a/n", "/b/n", Latency::same_instant);
    auto serve_a = in_thread([&] { return serve(context, router.address(), "a", a); });
    auto serve_b = in_thread([&] { return serve(context, router.address(), "b", b); });
    EXPECT_EQ(router.run(), "b: it failed: a pole (it had reached 0.00000049 s)");
    EXPECT_EQ(serve_a.get(), "b: it failed: a pole (it had reached 0.00000049 s)");
    EXPECT_EQ(serve_b.get(), "threw: a pole");
}

TEST_P(Transport, ANodeMayLiveInTheControllersProgram)
{
    zmq::context_t context;
    Router router(context, two_nodes(1000), listening(GetParam()));
    Counter a("/b/n", "/a/n", Latency::next_instant), b("/a/n", "/b/n", Latency::same_instant);
    router.host("a", a);
    EXPECT_THROW(router.host("a", b), LinkError);
    EXPECT_THROW(router.host("c", b), LinkError);
    auto serve_b = in_thread([&] { return serve(context, router.address(), "b", b); });
    EXPECT_EQ(router.run(), "");
    EXPECT_EQ(serve_b.get(), "");
    EXPECT_EQ(a.received, 200u);
    EXPECT_EQ(b.received, 201u);
    EXPECT_EQ(a.reason, "");
    EXPECT_EQ(router.times(0).ticks, 101u);
}

TEST(Router, ItMayHostAllNodes)
{
    zmq::context_t context;
    Router router(context, two_nodes(1'000'000), listening("inproc"));
    Counter a("/b/n", "/a/n", Latency::next_exchange), b("/a/n", "/b/n", Latency::next_exchange);
    router.host("a", a);
    router.host("b", b);
    EXPECT_EQ(router.run(), "");
    EXPECT_EQ(a.received, 100'000u);
    EXPECT_EQ(b.received, 100'000u);
}

INSTANTIATE_TEST_SUITE_P(All, Transport, testing::Values("tcp", "ipc", "inproc", "shm"));

/// A program that greets and then sends the frames of the test.
struct Rogue {
    Rogue(zmq::context_t &context, const std::string &address, const Bytes &greeting)
        : greetings(context, zmq::socket_type::dealer)
    {
        greetings.set(zmq::sockopt::linger, 1000);
        greetings.set(zmq::sockopt::rcvtimeo, 10'000);
        greetings.connect(address);
        greetings.send(zmq::buffer(greeting), zmq::send_flags::none);
    }

    Message answer()
    {
        zmq::message_t message;
        if (!greetings.recv(message)) {
            return Failed{"nothing came"};
        }
        return decode({message.data<std::byte>(), message.size()}).message;
    }

    zmq::socket_t greetings;
};

Bytes hello_of(const std::string &node)
{
    return encode({1, Hello{1, 1, "test", node}});
}

TEST(Router, AnInvalidGreetingIsRefusedAndTheRunGoesOn)
{
    zmq::context_t context;
    Router router(context, two_nodes(1000), listening("tcp"));
    auto run = in_thread([&] { return router.run(); });
    Bytes garbage(100, std::byte{0x5a});
    EXPECT_EQ(std::get<Refused>(Rogue(context, router.address(), garbage).answer()).reason,
              "this is no frame of a co-simulation");
    EXPECT_EQ(std::get<Refused>(Rogue(context, router.address(), encode({1, Ready{}})).answer()).reason,
              "expected Hello, found Ready");
    EXPECT_EQ(std::get<Refused>(Rogue(context, router.address(), hello_of("c")).answer()).reason,
              "test has no node c; it has a and b");
    Counter a("/b/n", "/a/n", Latency::next_instant), b("/a/n", "/b/n", Latency::same_instant);
    auto serve_a = in_thread([&] { return serve(context, router.address(), "a", a); });
    auto serve_b = in_thread([&] { return serve(context, router.address(), "b", b); });
    EXPECT_EQ(run.get(), "");
    EXPECT_EQ(serve_a.get() + serve_b.get(), "");
}

TEST(Router, ADeadHangingOrInvalidNodeEndsTheRunWithItsName)
{
    const auto outcome = [](const auto &mischief) {
        zmq::context_t context;
        RouterConfig config = listening("ipc");
        config.reply = 500ms;
        Router router(context, two_nodes(1000), config);
        Counter a("/b/n", "/a/n", Latency::next_instant);
        auto serve_a = in_thread([&] { return serve(context, router.address(), "a", a); });
        auto run = in_thread([&] { return router.run(); });
        {
            zmq::context_t other;
            Rogue rogue(other, router.address(), hello_of("b"));
            const auto welcome = std::get<Welcome>(rogue.answer());
            Link link(other, {});
            link.socket().connect(welcome.address);
            link.send({1, Hello{1, 1, "test", "b"}});
            EXPECT_TRUE(std::holds_alternative<Initialize>(link.wait(patience).message));
            link.send({1, Initialized{{{10, 0}}}});
            EXPECT_TRUE(std::holds_alternative<ProvideDesired>(link.wait(patience).message));
            mischief(link, other, welcome.address);
            run.wait();
        }
        return run.get();
    };
    EXPECT_EQ(outcome([](Link &, zmq::context_t &, const std::string &) {}), "b: it did not answer within 0.5 s");
    EXPECT_EQ(outcome([](Link &link, zmq::context_t &, const std::string &) {
                  link.send({7, Ready{}});
              }),
              "b: it sent Ready 7; expected Desired 2");
    EXPECT_EQ(outcome([](Link &link, zmq::context_t &, const std::string &) { link.socket().close(); }),
              "b: its connection is gone");
}

TEST(Router, ImpossibleConfigurationsAreRefusedAtOnce)
{
    zmq::context_t context;
    const auto refusal = [&](const std::string &address) -> std::string {
        return error_of<LinkError>([&] {
            RouterConfig config;
            config.address = address;
            Router router(context, two_nodes(1000), config);
        });
    };
    Router first(context, two_nodes(1000), listening("tcp"));
    EXPECT_EQ(refusal(first.address()),
              "cannot listen at " + first.address() + ": Address already in use; is another controller running?");
    EXPECT_TRUE(refusal("tcp://*:*").starts_with("tcp://*:* can be reached from other machines"));
    EXPECT_TRUE(refusal("nonsense").starts_with("nonsense can be reached"));
    for (const char *address : {"tcp://127.0.0.1:7", "tcp://127.9.9.9:*", "tcp://localhost:7", "tcp://[::1]:7",
                                "tcp://::1:7", "tcp://[::ffff:127.0.0.1]:7", "ipc://@x", "inproc://x"}) {
        EXPECT_TRUE(is_local(address)) << address;
    }
    for (const char *address : {"tcp://10.0.0.1:7", "tcp://127.example.org:7", "tcp://127.0.0.1:0;10.0.0.1:7",
                                "tcp://[::]:7", "tcp://[fe80::1]:7", "tcp://[::ffff:10.0.0.1]:7",
                                "tcp://localhost.example.org:7", "tcp://", "tcp://127", "udp://127.0.0.1:7", ""}) {
        EXPECT_FALSE(is_local(address)) << address;
    }
}

TEST(Router, AnAddressOfThisMachineMayBeOfIpv6OrItsName)
{
    zmq::context_t context;
    for (const char *address : {"tcp://[::1]:*", "tcp://[::ffff:127.0.0.1]:*", "tcp://localhost:*"}) {
        RouterConfig config = listening("tcp");
        config.address = address;
        config.sharing = Sharing::forbidden;
        Router router(context, two_nodes(1000), config);
        Counter a("/b/n", "/a/n", Latency::next_instant), b("/a/n", "/b/n", Latency::same_instant);
        auto serve_a = in_thread([&] { return serve(context, router.address(), "a", a); });
        auto serve_b = in_thread([&] { return serve(context, router.address(), "b", b); });
        EXPECT_EQ(router.run(), "") << address;
        EXPECT_EQ(serve_a.get() + serve_b.get(), "") << address;
    }
}

TEST(Router, MissingNodesAreNamed)
{
    zmq::context_t context;
    RouterConfig config = listening("tcp");
    config.join = 300ms;
    Router router(context, two_nodes(1000), config);
    Counter a("/b/n", "/a/n", Latency::next_instant);
    auto serve_a = in_thread([&] { return serve(context, router.address(), "a", a); });
    EXPECT_EQ(router.run(), "b did not come within 0.3 s");
    EXPECT_EQ(serve_a.get(), "b did not come within 0.3 s");
}

TEST(Delegate, WithoutAControllerItGivesUp)
{
    zmq::context_t context;
    Counter a("/b/n", "/a/n", Latency::next_instant);
    EXPECT_EQ(serve(context, "ipc://@fledge-unused", "a", a, "", 100ms),
              "threw: no controller answers at ipc://@fledge-unused");
}

TEST(Delegate, ItEndsWhenItsControllerIsGone)
{
    zmq::context_t context;
    Counter a("/b/n", "/a/n", Latency::next_instant);
    zmq::context_t other;
    zmq::socket_t greetings(other, zmq::socket_type::router);
    const std::string address = listening("ipc").address;
    greetings.bind(address);
    auto serve_a = in_thread([&] { return serve(context, address, "a", a); });
    zmq::message_t peer, hello;
    EXPECT_TRUE(greetings.recv(peer) && greetings.recv(hello));
    {
        Link link(other, {}, Link::End::controller);
        const std::string own = link.bind(address + "-1");
        greetings.send(peer, zmq::send_flags::sndmore);
        greetings.send(zmq::buffer(encode({1, Welcome{own}})), zmq::send_flags::none);
        EXPECT_TRUE(std::holds_alternative<Hello>(link.wait(patience).message));
    }
    EXPECT_EQ(serve_a.get(), "threw: the controller is gone");
}

/// Another process that runs this function; the end of the test kills it at the latest.
class Program {
public:
    explicit Program(const std::function<void()> &work) : pid_(fork())
    {
        if (pid_ == 0) {
            work();
            _exit(0);
        }
    }
    ~Program()
    {
        kill();
        waitpid(pid_, nullptr, 0);
    }
    void kill() const { ::kill(pid_, SIGKILL); }

private:
    pid_t pid_;
};

TEST(SharedMemory, ASleepingNodeNoticesThatTheControllerWasKilled)
{
    const RouterConfig config = listening("shm");
    const Program controller([&] {
        zmq::context_t context;
        Router(context, two_nodes(1000), config).run();
    });
    struct Killer : Counter {
        using Counter::Counter;
        std::vector<Publication> match(const std::vector<Channel> &channels) override
        {
            killed = in_thread([this] {
                std::this_thread::sleep_for(100ms); // by then it waits for Start, which never comes
                victim->kill();
                dead = true;
            });
            return Counter::match(channels);
        }
        const Program *victim = nullptr;
        std::atomic<bool> dead = false;
        std::future<void> killed;
    };
    zmq::context_t context;
    Killer a("/b/n", "/a/n", Latency::next_instant);
    a.victim = &controller;
    struct Hanging : Counter {
        using Counter::Counter;
        std::vector<Publication> match(const std::vector<Channel> &channels) override
        {
            while (!*dead) {
                std::this_thread::sleep_for(1ms);
            }
            return Counter::match(channels);
        }
        const std::atomic<bool> *dead = nullptr;
    } b("/a/n", "/b/n", Latency::same_instant);
    b.dead = &a.dead;
    auto serve_b = in_thread([&] { return serve(context, config.address, "b", b); });
    EXPECT_EQ(serve(context, config.address, "a", a), "threw: the controller is gone");
    EXPECT_EQ(serve_b.get(), "threw: the controller is gone");
}

TEST(SharedMemory, TheControllerNoticesThatANodeWasKilled)
{
    struct Suicide : Counter {
        using Counter::Counter;
        void before_step(Ns t) override
        {
            if (t == 500) {
                raise(SIGKILL);
            }
        }
    };
    const RouterConfig config = listening("shm");
    const Program node([&] {
        zmq::context_t context;
        Suicide b("/a/n", "/b/n", Latency::same_instant);
        serve(context, config.address, "b", b);
    });
    zmq::context_t context;
    Router router(context, two_nodes(1000), config);
    Counter a("/b/n", "/a/n", Latency::next_instant);
    router.host("a", a);
    EXPECT_EQ(router.run(), "b: its connection is gone (it had reached 0.00000049 s)");
}

TEST(SharedMemory, ANodeThatWritesNonsenseIntoItIsShutOut)
{
    struct Scribbler : Counter {
        using Counter::Counter;
        void before_step(Ns t) override
        {
            if (t != 500) {
                return;
            }
            std::ifstream maps("/proc/self/maps");
            for (std::string line; std::getline(maps, line);) {
                std::uintptr_t from = 0, to = 0;
                if (line.find("/memfd:fledge") != line.npos && std::sscanf(line.c_str(), "%zx-%zx", &from, &to) == 2) {
                    std::memset(reinterpret_cast<void *>(from), 0x5a, to - from);
                }
            }
        }
    };
    const RouterConfig config = listening("shm");
    const Program node([&] {
        zmq::context_t context;
        Scribbler b("/a/n", "/b/n", Latency::same_instant);
        serve(context, config.address, "b", b);
        pause(); // it stays connected
    });
    zmq::context_t context;
    Router router(context, two_nodes(1000), config);
    Counter a("/b/n", "/a/n", Latency::next_instant);
    router.host("a", a);
    EXPECT_TRUE(router.run().starts_with("b: it sent no frame: the shared memory counts "));
    EXPECT_EQ(a.received, 100u); // all messages before
}

TEST(SharedMemory, ItIsUsedWhereBothSidesHaveIt)
{
    const auto reason = [](Sharing controllers, Sharing nodes) {
        zmq::context_t context;
        RouterConfig config = listening("ipc");
        config.sharing = controllers;
        Router router(context, two_nodes(1000), config);
        Counter a("/b/n", "/a/n", Latency::next_instant), b("/a/n", "/b/n", Latency::same_instant);
        router.host("a", a);
        auto serve_b = in_thread([&]() -> std::string {
            try {
                MemberConfig own;
                own.simulation = "test";
                own.node = "b";
                own.address = router.address();
                own.sharing = nodes;
                return Delegate(context, own).serve(b);
            } catch (const std::exception &error) {
                return error.what();
            }
        });
        const std::string routers = router.run();
        const std::string delegates = serve_b.get();
        return delegates.starts_with("no shared memory") ? delegates : routers;
    };
    using enum Sharing;
    for (const auto &[controllers, nodes] : {std::pair{allowed, allowed},
                                             {allowed, forbidden},
                                             {allowed, required},
                                             {forbidden, allowed},
                                             {forbidden, forbidden},
                                             {required, allowed},
                                             {required, required}}) {
        EXPECT_EQ(reason(controllers, nodes), "");
    }
    EXPECT_EQ(reason(required, forbidden),
              "b: it does not take shared memory, which this run requires: it may be a node that cannot, or on "
              "another machine");
}

TEST(Delegate, ItEndsWhenItsContextCloses)
{
    for (const char *transport : {"ipc", "shm"}) {
        zmq::context_t context, other;
        Router router(context, two_nodes(1000), listening(transport));
        Counter a("/b/n", "/a/n", Latency::next_instant);
        auto serve_a = in_thread([&] { return serve(other, router.address(), "a", a); });
        bool there = false; // then it waits for the next frame, without a timeout
        const std::string reason = router.run([&] {
            there = router.controller().absent().size() == 1 && !router.controller().waiting_for(0);
            if (there) {
                std::this_thread::sleep_for(50ms);
                other.shutdown();
                EXPECT_TRUE(serve_a.get().starts_with("threw: ")) << transport;
            }
            return !there;
        });
        EXPECT_TRUE(there) << reason;
    }
}

TEST(Delegate, ItEndsWhenTheControllersProgramLeavesTheRun)
{
    for (const char *transport : {"tcp", "inproc"}) {
        zmq::context_t context;
        Counter a("/b/n", "/a/n", Latency::next_instant);
        std::future<std::string> serve_a;
        try {
            Router router(context, two_nodes(1000), listening(transport));
            serve_a = in_thread([&context, &a, address = router.address()] { return serve(context, address, "a", a); });
            router.run([&]() -> bool {
                if (router.controller().absent().size() == 1 && !router.controller().waiting_for(0)) {
                    throw std::runtime_error("an error of the user's");
                }
                return true;
            });
        } catch (const std::runtime_error &) {
        }
        EXPECT_EQ(serve_a.get(), "the controller was ended");
    }
}

} // namespace network_test
} // namespace fledge::cosim
