// SPDX-License-Identifier: Apache-2.0
// Programs that do not belong to the run: stray bytes, second connections, programs that greet and do nothing, other
// users of the machine. And nodes that a debugger stops.
#include "cosim/router/testing/nodes.h"

#include "cosim/node/observer.h"
#include "cosim/protocol/testing/patience.h"
#include "cosim/transport/handshake.h"

#include <gtest/gtest.h>

#include <csignal>
#include <fcntl.h>
#include <functional>
#include <future>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <sys/wait.h>

namespace fledge::cosim {
namespace strangers_test {

using namespace std::chrono_literals;
using namespace testing_nodes;

RouterConfig listening(const std::string &transport)
{
    static std::atomic<int> count{0};
    RouterConfig config;
    config.sharing = transport == "shm" ? Sharing::required : Sharing::forbidden;
    config.address = transport == "tcp"
                         ? "tcp://127.0.0.1:*"
                         : "ipc://@fledge-strangers-" + std::to_string(getpid()) + "-" + std::to_string(count++);
    return config;
}

/// A controller of the nodes a and b. a lives in its program.
struct Running : Reports {
    explicit Running(RouterConfig config, ControllerConfig nodes = config_of({{"a"}, {"b"}}, 1000))
        : router(context, std::move(nodes), with_reports(std::move(config)))
    {
        router.host("a", a);
        result = in_thread([this] {
            return router.run([this] {
                lost = std::string_view(router.controller().state(1)) == "lost";
                return !stop;
            });
        });
    }
    ~Running() { stop = true; }

    RouterConfig with_reports(RouterConfig config)
    {
        config.report = [this](const std::string &text) {
            const std::lock_guard lock(mutex);
            reports += text + "\n";
        };
        return config;
    }

    /// The reason of the end. If the run does not end by itself, it is ended.
    std::string reason(std::chrono::seconds most = patience)
    {
        stop = result.wait_for(most) != std::future_status::ready;
        return stop ? "it goes on; " + result.get() : result.get();
    }

    zmq::context_t context;
    std::atomic<bool> stop{false}, lost{false}; ///< the end of the run is wanted; b is lost
    Counter a{"/b/n", "/a/n", Latency::next_instant};
    Router router;
    std::future<std::string> result;
};

/// The node b, which the test plays, so that it knows the address of the node's own socket.
struct Played {
    Played(const std::string &address, const std::string &keys = "")
    {
        greetings.set(zmq::sockopt::linger, 0);
        greetings.set(zmq::sockopt::rcvtimeo, static_cast<int>(std::chrono::milliseconds(patience).count()));
        if (!keys.empty()) {
            own = read_client_keys(keys, "b");
            use_keys(greetings, *own);
            use_keys(link.socket(), *own);
        }
        greetings.connect(address);
        greetings.send(zmq::buffer(encode({1, hello})), zmq::send_flags::none);
        zmq::message_t reply;
        if (!greetings.recv(reply)) {
            throw std::runtime_error("no answer");
        }
        const Frame frame = decode({reply.data<std::byte>(), reply.size()});
        if (const auto *refused = std::get_if<Refused>(&frame.message)) {
            throw std::runtime_error(refused->reason);
        }
        address_of_b = std::get<Welcome>(frame.message).address;
    }

    void connect()
    {
        link.socket().connect(address_of_b);
        link.send({1, hello});
    }

    /// Reply to all requests before the tick that passes t, and return that tick.
    Frame serve_until(Ns t)
    {
        for (;;) {
            Frame request = link.wait(patience);
            const auto *tick = std::get_if<Tick>(&request.message);
            if ((tick && tick->until >= t) || std::holds_alternative<Finish>(request.message)) {
                return request;
            }
            link.send({request.number, answer(node, request.message)});
        }
    }

    void serve_from(const Frame &request)
    {
        link.send({request.number, answer(node, request.message)});
        const Frame finish = serve_until(2000);
        link.send({finish.number, answer(node, finish.message)});
    }

    zmq::context_t context;
    zmq::socket_t greetings{context, zmq::socket_type::dealer};
    std::optional<ClientKeys> own;
    Hello hello{protocol_version, protocol_version, "test", "b"};
    Counter node{"/a/n", "/b/n", Latency::same_instant};
    Link link{context, {}};
    std::string address_of_b;
};

/// A connection without libzmq.
class Raw {
public:
    explicit Raw(const std::string &address)
    {
        sockaddr_storage to{};
        socklen_t size = 0;
        if (address.starts_with("tcp://")) {
            auto &in = reinterpret_cast<sockaddr_in &>(to);
            in.sin_family = AF_INET;
            in.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
            in.sin_port = htons(static_cast<std::uint16_t>(std::stoi(address.substr(address.rfind(':') + 1))));
            size = sizeof in;
        } else {
            auto &un = reinterpret_cast<sockaddr_un &>(to);
            const std::string name = address.substr(address.find('@') + 1);
            un.sun_family = AF_UNIX;
            name.copy(un.sun_path + 1, sizeof un.sun_path - 1);
            size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + name.size());
        }
        fd_ = socket(to.ss_family, SOCK_STREAM | SOCK_CLOEXEC, 0);
        if (::connect(fd_, reinterpret_cast<const sockaddr *>(&to), size)) {
            throw std::runtime_error(address + ": " + std::strerror(errno));
        }
    }
    ~Raw() { ::close(fd_); }
    Raw(const Raw &) = delete;
    Raw &operator=(const Raw &) = delete;

    void send(const std::string &bytes) const { (void)!::send(fd_, bytes.data(), bytes.size(), MSG_NOSIGNAL); }

    /// Whether the other side takes, or has sent, something within 100 ms.
    void wait() const
    {
        timeval most{0, 100'000};
        setsockopt(fd_, SOL_SOCKET, SO_RCVTIMEO, &most, sizeof most);
        char bytes[1000];
        while (::recv(fd_, bytes, sizeof bytes, 0) > 0) {
        }
    }

private:
    int fd_;
};

const std::string zmtp_greeting = std::string("\xff\0\0\0\0\0\0\0\1\x7f\3\1NULL", 16) + std::string(48, '\0');

const std::string stray_packets[] = {
    "",
    "\1",
    "GET / HTTP/1.1\r\nHost: localhost\r\n\r\n",
    std::string("\x16\3\1\0\x2e\1\0\0\x2a\3\3", 11) + std::string(38, 'r'), // the hello of TLS
    std::string(100, '\0'),
    std::string(100'000, '\xff'),
    zmtp_greeting,                                          // and no more
    zmtp_greeting + std::string("\4\x05\5READY\0\0\0", 10), // a wrong one
};

class Connections : public testing::TestWithParam<std::tuple<std::string, bool>> {
protected:
    Connections()
    {
        keys.allow("b", "a b");
        config = listening(std::get<0>(GetParam()));
        keyed = std::get<1>(GetParam());
        config.keys = keyed ? keys.folder().string() : "";
        config.reply = 0ms;
    }

    std::string of_b() const { return keyed ? keys.of("b") : ""; }

    Keys keys;
    RouterConfig config;
    bool keyed = false;
};

TEST_P(Connections, StrayBytesEndNoRun)
{
    config.broker = true;
    Running run(config);
    Played b(run.router.address(), of_b());
    const std::string addresses[] = {run.router.address(), b.address_of_b, run.router.broker()->frontend(),
                                     run.router.broker()->backend()};
    const auto stray = [&] {
        for (const std::string &packet : stray_packets) {
            for (const std::string &address : addresses) {
                const Raw raw(address);
                raw.send(packet);
                raw.wait();
            }
        }
    };
    stray();
    b.connect();
    const Frame half = b.serve_until(500);
    stray();
    b.serve_from(half);
    EXPECT_EQ(run.reason(), "");
    EXPECT_EQ(run.a.received, 200u);
}

TEST_P(Connections, ASecondConnectionHidesNoDeath)
{
    Running run(config);
    Played b(run.router.address(), of_b());
    const Raw silent(b.address_of_b);
    zmq::context_t context;
    std::vector<zmq::socket_t> others;
    const auto another = [&](zmq::socket_type type) {
        zmq::socket_t &socket = others.emplace_back(context, type);
        socket.set(zmq::sockopt::linger, 0);
        if (b.own) {
            use_keys(socket, *b.own);
        }
        zmq::socket_t events = monitor(context, socket);
        socket.connect(b.address_of_b);
        zmq::pollitem_t item{events.handle(), 0, ZMQ_POLLIN, 0};
        poll({&item, 1}, patience); // until it is connected
        zmq_socket_monitor(socket.handle(), nullptr, 0);
        (void)socket.send(zmq::str_buffer("no frame"), zmq::send_flags::dontwait);
        (void)socket.send(zmq::buffer(encode({1, Ready{}})), zmq::send_flags::dontwait);
    };
    another(zmq::socket_type::dealer); // before the node
    b.connect();
    Frame half = b.serve_until(500);
    another(zmq::socket_type::dealer); // and after it
    another(zmq::socket_type::pair);
    std::this_thread::sleep_for(200ms);
    others.front().close();
    b.link.send({half.number, answer(b.node, half.message)});
    b.serve_until(800);
    b.link.socket().close();
    EXPECT_TRUE(run.reason().starts_with("b: its connection is gone (it had reached "));
}

INSTANTIATE_TEST_SUITE_P(All, Connections,
                         testing::Combine(testing::Values(std::string("tcp"), "ipc"), testing::Values(false, true)));

TEST(Strangers, AProgramWaitsForThePlaceOfOneThatHasOnlyGreeted)
{
    RouterConfig config = listening("tcp");
    config.greet = 500ms;
    Running run(config);
    Played silent(run.router.address());
    Played b(run.router.address()); // as soon as the other one has lost the place
    b.connect();
    const Frame tick = b.serve_until(500);
    EXPECT_THROW(Played(run.router.address()), std::runtime_error); // a second program of the name is refused at once
    b.serve_from(tick);
    EXPECT_EQ(run.reason(), "");
    EXPECT_EQ(run.a.received, 200u);
}

TEST(Strangers, AProgramThatGreetsAndDoesNothingLosesTheName)
{
    for (const bool connects : {false, true}) {
        RouterConfig config = listening("ipc");
        config.greet = 300ms;
        Running run(config);
        Played silent(run.router.address());
        if (connects) {
            silent.connect();
        }
        EXPECT_TRUE(run.reported("b: it did not answer within 0.3 s of its greeting; another program may take its "
                                 "place"));
        Played b(run.router.address());
        b.connect();
        b.serve_from(b.serve_until(500));
        EXPECT_EQ(run.reason(), "");
        EXPECT_EQ(run.a.received, 200u);
    }
}

TEST(Strangers, AProgramThatGreetsAndHangsUpTakesNoPlace)
{
    for (const char *transport : {"tcp", "ipc"}) {
        RouterConfig config = listening(transport);
        config.reply = 0ms; // no limit of time helps
        Running run(config, config_of({{"a"}, {"b", Policy::restart}}, 1000));
        const std::string address = run.router.address();
        const auto come_and_go = [&] {
            for (int i = 0; i < 4; i++) { // more often than a node may be restarted without progress
                std::make_unique<Played>(address);
                std::make_unique<Played>(address)->connect();
                const auto liar = std::make_unique<Played>(address);
                liar->connect();
                liar->link.send({1, Tock{}}); // a reply to nothing, or to another request
                EXPECT_TRUE(
                    run.reported("b: it sent Tock 1; expected Initialized 1; another program may take its place"));
                const auto babbler = std::make_unique<Played>(address);
                babbler->connect();
                babbler->link.socket().send(zmq::str_buffer("garbage"), zmq::send_flags::none);
                EXPECT_TRUE(
                    run.reported("b: it sent no frame: this is no frame of a co-simulation; another program may"));
            }
        };
        come_and_go();
        EXPECT_TRUE(run.reported("b: its connection is gone; another program may take its place"));
        {
            const auto b = std::make_unique<Played>(address);
            b->connect();
            b->serve_until(500);
        }
        come_and_go();
        const auto b = std::make_unique<Played>(address);
        b->connect();
        b->serve_from(b->serve_until(800));
        EXPECT_EQ(run.reason(), "");
        EXPECT_EQ(run.a.received, 200u);
    }
}

TEST(Strangers, ASilentProgramDoesNotKeepTheNameOfALostNode)
{
    RouterConfig config = listening("ipc");
    config.greet = 2s; // in which a program that has greeted connects, however busy the machine
    Running run(config, config_of({{"a"}, {"b", Policy::restart}}, 1000));
    {
        Played b(run.router.address());
        b.connect();
        b.serve_until(500);
    }
    EXPECT_TRUE(run.reported("b: its connection is gone"));
    for (int i = 0; i < 5; i++) { // more often than a node may be restarted without progress
        Played silent(run.router.address());
        std::this_thread::sleep_for(200ms); // by then it is taken for the node
        while (!run.lost && run.result.wait_for(0s) != std::future_status::ready) {
            std::this_thread::sleep_for(10ms);
        }
    }
    Played b(run.router.address());
    b.connect();
    b.serve_from(b.serve_until(800));
    EXPECT_EQ(run.reason(), "");
    EXPECT_EQ(run.a.received, 200u);
}

TEST(Strangers, ATakenNameOfASocketEndsNoRun)
{
    RouterConfig config = listening("ipc");
    const std::string address = config.address;
    Running run(config);
    zmq::context_t context;
    std::vector<zmq::socket_t> takers;
    const auto take = [&](int from, int to) {
        for (int i = from; i <= to; i++) {
            takers.emplace_back(context, zmq::socket_type::pair).bind(address + "-" + std::to_string(i));
        }
    };
    take(1, 150);
    try {
        Played b(address);
        ADD_FAILURE() << "it took part at " << b.address_of_b;
    } catch (const std::runtime_error &error) {
        EXPECT_TRUE(std::string(error.what()).starts_with("cannot listen at " + address)) << error.what();
    }
    EXPECT_TRUE(run.reported("Address already in use; another program may take its place"));
    Played b(address);
    b.connect();
    b.serve_from(b.serve_until(500));
    EXPECT_EQ(run.reason(), "");
    EXPECT_EQ(run.a.received, 200u);
}

TEST(Strangers, WithoutALimitForRepliesAProgramMayBeSilentAfterItsGreeting)
{
    RouterConfig config = listening("ipc");
    config.greet = 100ms;
    config.reply = 0ms;
    Running run(config);
    Played b(run.router.address());
    std::this_thread::sleep_for(500ms);
    b.connect();
    b.serve_from(b.serve_until(500));
    EXPECT_EQ(run.reason(), "");
}

/// Another process that runs this function; its result is the exit code.
class Program {
public:
    explicit Program(const std::function<int()> &work) : pid_(fork())
    {
        if (pid_ == 0) {
            _exit(work());
        }
    }
    ~Program()
    {
        if (pid_ >= 0) {
            ::kill(pid_, SIGKILL);
            waitpid(pid_, nullptr, 0);
        }
    }
    Program(Program &&other) noexcept : pid_(std::exchange(other.pid_, -1)) {}
    Program &operator=(Program &&) = delete;

    /// Wait until it is stopped.
    void wait_for_stop() const { waitpid(pid_, nullptr, WUNTRACED); }
    void go_on() const { ::kill(pid_, SIGCONT); }
    int result()
    {
        int status = -1;
        waitpid(std::exchange(pid_, -1), &status, 0);
        return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
    }

private:
    pid_t pid_;
};

/// Where a controller listens that starts after its nodes.
RouterConfig listening_later(const std::string &transport)
{
    RouterConfig config = listening(transport);
    if (transport == "tcp") { // a port that is free now
        zmq::context_t context;
        zmq::socket_t probe(context, zmq::socket_type::pair);
        probe.bind(config.address);
        config.address = probe.get(zmq::sockopt::last_endpoint);
    }
    return config;
}

TEST(Stopped, ADebuggerMayStopANodeForLongerThanAnyConnectionIsChecked)
{
    struct Stopping : Counter {
        using Counter::Counter;
        void before_step(Ns t) override
        {
            if (t == 500) {
                raise(SIGSTOP);
            }
        }
    };
    const char *transports[] = {"tcp", "ipc", "shm"};
    std::vector<RouterConfig> configs;
    std::vector<Program> nodes; // before this program has threads
    for (const char *transport : transports) {
        RouterConfig &config = configs.emplace_back(listening_later(transport));
        config.reply = 0ms;
        nodes.emplace_back([&config] {
            zmq::context_t context;
            Stopping b("/a/n", "/b/n", Latency::same_instant);
            const std::string end = serve(context, config.address, "b", b);
            std::fputs(end.c_str(), stderr);
            return end.empty() ? 0 : 1;
        });
    }
    std::vector<std::unique_ptr<Running>> runs;
    for (const RouterConfig &config : configs) {
        runs.push_back(std::make_unique<Running>(config));
    }
    for (const Program &node : nodes) {
        node.wait_for_stop();
    }
    std::this_thread::sleep_for(8s); // a heartbeat of libzmq would miss an answer after 5 s
    for (std::size_t i = 0; i < nodes.size(); i++) {
        nodes[i].go_on();
        EXPECT_EQ(runs[i]->reason(), "") << transports[i];
        EXPECT_EQ(nodes[i].result(), 0) << transports[i];
        EXPECT_EQ(runs[i]->a.received, 200u) << transports[i];
    }
}

// ---- other users of the machine

constexpr uid_t other_uid = 65534;

/// What a program of another user sees of a run; each is a bit of its exit code.
enum Seen { greeted = 1, own_socket = 2, frontend = 4, backend = 8, memory = 16 };

/// Whether a socket completes its connection, rather than that the other side breaks it off.
bool connects(zmq::context_t &context, zmq::socket_type type, const std::string &address)
{
    zmq::socket_t socket(context, type);
    socket.set(zmq::sockopt::linger, 0);
    zmq::socket_t events = monitor(context, socket);
    socket.connect(address);
    std::uint16_t kind = 0;
    const auto over = [&] {
        return kind == ZMQ_EVENT_HANDSHAKE_SUCCEEDED || kind == ZMQ_EVENT_HANDSHAKE_FAILED_NO_DETAIL ||
               kind == ZMQ_EVENT_DISCONNECTED;
    };
    for (std::uint32_t value = 0; !over();) {
        if (!next_event(events, kind, value)) {
            std::this_thread::sleep_for(10ms);
        }
    }
    zmq_socket_monitor(socket.handle(), nullptr, 0);
    return kind == ZMQ_EVENT_HANDSHAKE_SUCCEEDED;
}

struct Addresses {
    char greetings[100], own[100], frontend[100], backend[100], memory[100];
};

class OtherUser : public testing::Test {
protected:
    void SetUp() override
    {
        if (geteuid() != 0) {
            GTEST_SKIP() << "only root can start programs of another user";
        }
        ASSERT_EQ(pipe(pipe_), 0);
    }
    void TearDown() override
    {
        for (const int fd : pipe_) {
            ::close(fd);
        }
    }

    /// Start a program of another user, before this one has threads.
    Program start(std::function<int(const Addresses &)> work)
    {
        return Program([this, work] {
            Addresses addresses;
            if (setgid(other_uid) || setuid(other_uid) ||
                read(pipe_[0], &addresses, sizeof addresses) != sizeof addresses) {
                return 100;
            }
            try {
                return work(addresses);
            } catch (const std::exception &error) {
                std::fprintf(stderr, "%s\n", error.what());
                return 101;
            }
        });
    }

    void tell(const Addresses &addresses) const
    {
        ASSERT_EQ(write(pipe_[1], &addresses, sizeof addresses), static_cast<ssize_t>(sizeof addresses));
    }

    int pipe_[2] = {-1, -1};
};

int look_around(const Addresses &at)
{
    zmq::context_t context;
    return (connects(context, zmq::socket_type::dealer, at.greetings) ? greeted : 0) |
           (connects(context, zmq::socket_type::dealer, at.own) ? own_socket : 0) |
           (connects(context, zmq::socket_type::xpub, at.frontend) ? frontend : 0) |
           (connects(context, zmq::socket_type::sub, at.backend) ? backend : 0) |
           (::open(at.memory, O_RDWR) >= 0 ? memory : 0);
}

TEST_F(OtherUser, ItTakesNoPartInARunOverIpcAndSharedMemory)
{
    for (const bool any_user : {false, true}) {
        Program other = start(look_around);
        RouterConfig config = listening("shm");
        config.broker = true;
        config.any_user = any_user;
        config.finish = 100ms;
        Running run(config);
        zmq::socket_t greetings(run.context, zmq::socket_type::dealer);
        greetings.set(zmq::sockopt::linger, 0);
        greetings.connect(run.router.address());
        greetings.send(zmq::buffer(encode({1, Hello{protocol_version, protocol_version, "test", "b"}})),
                       zmq::send_flags::none);
        zmq::message_t reply;
        ASSERT_TRUE(greetings.recv(reply));
        const auto welcome = std::get<Welcome>(decode({reply.data<std::byte>(), reply.size()}).message);
        Addresses addresses{};
        const auto put = [](char(&to)[100], const std::string &text) { text.copy(to, sizeof to - 1); };
        put(addresses.greetings, run.router.address());
        put(addresses.own, welcome.address);
        put(addresses.frontend, run.router.broker()->frontend());
        put(addresses.backend, run.router.broker()->backend());
        put(addresses.memory, welcome.shared);
        ASSERT_GE(::open(welcome.shared.c_str(), O_RDWR), 0); // this user can
        tell(addresses);
        EXPECT_EQ(other.result(), any_user ? greeted | own_socket | frontend | backend : 0);
    }
}

TEST_F(OtherUser, ItTakesPartWhereBothSidesAllowIt)
{
    Program other = start([](const Addresses &at) {
        zmq::context_t context;
        Counter b("/a/n", "/b/n", Latency::same_instant);
        const std::string refused = serve(context, at.greetings, "b", b);
        // If the controller is quick to break off, the node cannot ask whose the connection was.
        if (!refused.starts_with(std::string("threw: the controller at ") + at.greetings + " does not let b in: ") ||
            refused.find("another user") == std::string::npos) {
            std::fprintf(stderr, "%s\n", refused.c_str());
            return 1;
        }
        setenv("FLEDGE_ANY_USER", "1", true);
        return serve(context, at.greetings, "b", b).empty() ? 0 : 2;
    });
    RouterConfig config = listening("ipc");
    config.sharing = Sharing::allowed;
    config.any_user = true;
    Running run(config);
    Addresses addresses{};
    run.router.address().copy(addresses.greetings, sizeof addresses.greetings - 1);
    tell(addresses);
    EXPECT_EQ(other.result(), 0);
    EXPECT_EQ(run.reason(), "");
    EXPECT_EQ(run.a.received, 200u);
}

} // namespace strangers_test
} // namespace fledge::cosim
