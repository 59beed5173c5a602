// SPDX-License-Identifier: Apache-2.0
// Observers and asynchronous programs, on real sockets around a real run.
#include "cosim/node/observer.h"
#include "cosim/protocol/testing/patience.h"
#include "cosim/router/testing/nodes.h"
#include "tests/error_of.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <condition_variable>
#include <cstring>
#include <future>
#include <random>

namespace fledge::cosim {
namespace broker_test {

using namespace std::chrono_literals;
using namespace testing_nodes;

/// Waits in its second step until the test lets it go on.
class Held final : public Counter {
public:
    using Counter::Counter;
    void before_step(Ns t) override
    {
        while (t == 10 && !go) {
            std::this_thread::sleep_for(1ms);
        }
    }
    std::atomic<bool> go = false;
};

TEST(ByteRing, EntriesPassBetweenTwoThreadsCompleteAndInOrder)
{
    ByteRing ring(4096);
    EXPECT_EQ(ring.claim(ring.largest() + 1), nullptr);
    EXPECT_FALSE(ring.front().data());
    constexpr int n = 200'000;
    std::thread writer([&] {
        std::mt19937 random(1);
        for (int i = 0; i < n;) {
            const std::size_t size = random() % (i % 100 ? 60 : ring.largest() + 1);
            std::byte *at = nullptr;
            while (!(at = ring.claim(size))) {
                std::this_thread::yield();
            }
            std::memset(at, i & 0xff, size);
            ring.commit();
            i++;
        }
    });
    std::mt19937 random(1);
    int wrong = 0;
    for (int i = 0; i < n; i++) {
        const std::size_t size = random() % (i % 100 ? 60 : ring.largest() + 1);
        std::span<const std::byte> entry;
        while (!(entry = ring.front()).data()) {
            std::this_thread::yield();
        }
        const auto byte = static_cast<std::byte>(i & 0xff);
        wrong += entry.size() != size || (size && (entry.front() != byte || entry.back() != byte));
        ring.pop();
    }
    writer.join();
    EXPECT_EQ(wrong, 0);
    EXPECT_FALSE(ring.front().data());
}

Bytes published_by(const std::string &node, const Payload &payload)
{
    Frame frame{0, Published{}};
    std::get<Published>(frame.message).node = node;
    std::get<Published>(frame.message).record.payload = payload;
    return encode(frame);
}

/// A run of a and b, which count together, up to the horizon that the test sets.
class Watched : public Reports {
public:
    explicit Watched(const std::string &transport, Ns end = 1000, const std::string &keys = "",
                     std::vector<std::string> more_wants = {})
        : router(context, configured(end), router_config(transport, keys)),
          a("/b/n", "/a/n", Latency::next_instant, this), b("/a/n", "/b/n", Latency::same_instant, this)
    {
        a.more_wants = std::move(more_wants);
        run = in_thread([this] { return router.run([this] { return !stop; }); });
        serve_a = in_thread([this, keys] { return serve(nodes, router.address(), "a", a, keys); });
        serve_b = in_thread([this, keys] { return serve(nodes, router.address(), "b", b, keys); });
    }
    ~Watched()
    {
        stop = true;
        let(for_ever);
        for (auto *future : {&run, &serve_a, &serve_b}) {
            if (future->valid()) {
                future->wait();
            }
        }
    }

    static ControllerConfig configured(Ns end)
    {
        ControllerConfig config = config_of({{"a", Policy::abort}, {"b", Policy::abort}}, end);
        config.asynchronous = {{"ground", {}}};
        config.batch = 1;
        return config;
    }
    RouterConfig router_config(const std::string &transport, const std::string &keys)
    {
        static std::atomic<int> count{0};
        const std::string name = "fledge-broker-" + std::to_string(getpid()) + "-" + std::to_string(count++);
        RouterConfig config;
        config.broker = true;
        config.keys = keys;
        config.address = transport == "tcp" ? "tcp://127.0.0.1:*" : "ipc://@" + name;
        config.report = [this](const std::string &text) {
            const std::lock_guard lock(mutex);
            reports += text + "\n";
        };
        return config;
    }

    /// Let the nodes step up to and including t.
    void let(Ns t)
    {
        const std::lock_guard lock(mutex);
        limit = std::max(limit, t);
        moved.notify_all();
    }

    MemberConfig observer(const std::string &name, const std::string &keys = "") const
    {
        MemberConfig config;
        config.simulation = "test";
        config.node = name;
        config.address = router.address();
        config.connect_timeout = patience;
        config.keys = keys;
        return config;
    }

    /// The counter of the other tests, which waits, and may read more.
    struct Waiting : Counter {
        Waiting(std::string reads, std::string writes, Latency latency, Watched *its_owner)
            : Counter(std::move(reads), std::move(writes), latency), owner(its_owner)
        {
        }
        std::vector<Subscription> desired() override
        {
            auto subscriptions = Counter::desired();
            for (const std::string &topic : more_wants) {
                subscriptions.push_back({topic, Latency::same_instant, false, make_schema("Word", word_text)});
            }
            return subscriptions;
        }
        void start(const std::vector<Channel> &channels) override
        {
            Counter::start(channels);
            for (const Channel &channel : channels) {
                topics[channel.channel] = channel.topic;
            }
        }
        Tock tick(const Tick &tick) override
        {
            Tick mine{tick.until, {}};
            for (const Record &record : tick.records) {
                if (topics[record.channel].starts_with("/ground/")) {
                    commands.push_back({record.t, word_of(record.payload)});
                } else {
                    mine.records.push_back(record);
                }
            }
            return Counter::tick(mine);
        }
        void before_step(Ns t) override
        {
            std::unique_lock lock(owner->mutex);
            owner->moved.wait(lock, [&] { return owner->limit >= t; });
        }

        Watched *owner;
        std::vector<std::string> more_wants;
        std::map<std::uint32_t, std::string> topics;
        std::vector<std::pair<Ns, std::uint64_t>> commands; ///< and when they were seen
    };

    zmq::context_t context, nodes;
    std::condition_variable moved;
    Ns limit = -1;
    std::atomic<bool> stop{false};
    Router router;
    Waiting a, b;
    std::future<std::string> run, serve_a, serve_b;
};

class Broadcast : public testing::TestWithParam<const char *> {};

TEST_P(Broadcast, AnObserverFromTheBeginningSeesAllMessagesInOrder)
{
    Watched run(GetParam());
    zmq::context_t context;
    Observer observer(context, run.observer("viewer"));
    EXPECT_EQ(observer.topics().size(), 2u);
    EXPECT_EQ(observer.schema("/a/n"), make_schema("Word", word_text));
    EXPECT_THROW(observer.schema("/c/n"), LinkError);
    observer.subscribe("/a/");
    auto first = observer.next(patience);
    ASSERT_TRUE(first);
    EXPECT_EQ(first->count, 0u); // the initial value, before any step
    EXPECT_EQ(first->t, -1);
    run.let(for_ever);
    for (std::uint32_t k = 1; k <= 101; k++) {
        const auto seen = observer.next(patience);
        ASSERT_TRUE(seen) << k;
        EXPECT_EQ(seen->topic, "/a/n");
        EXPECT_EQ(seen->node, "a");
        EXPECT_EQ(seen->count, k);
        EXPECT_EQ(seen->t, 10 * (k - 1));
        EXPECT_EQ(word_of(seen->payload), 2 * k - 1);
        EXPECT_EQ(seen->missed, 0u);
    }
    EXPECT_FALSE(observer.next(patience));
    EXPECT_TRUE(observer.over());
    EXPECT_EQ(observer.reason(), "");
    EXPECT_EQ(observer.missed(), 0u);
    EXPECT_EQ(run.run.get(), "");
}

TEST_P(Broadcast, ALateObserverGetsTheLastMessageOfEachTopicAtOnce)
{
    Watched run(GetParam());
    zmq::context_t context;
    run.let(500);
    Observer first(context, run.observer("viewer"));
    first.subscribe("");
    while (true) {
        const auto seen = first.next(patience);
        ASSERT_TRUE(seen);
        if (seen->topic == "/b/n" && seen->t == 500) {
            break;
        }
    }
    Observer late(context, run.observer("another"));
    late.subscribe("/");
    std::map<std::string, Observed> got;
    for (int i = 0; i < 2; i++) {
        const auto seen = late.next(patience);
        ASSERT_TRUE(seen);
        got[seen->topic] = *seen;
    }
    EXPECT_EQ(got.at("/a/n").t, 500);
    EXPECT_EQ(got.at("/a/n").count, 51u);
    EXPECT_EQ(got.at("/a/n").missed, 0u); // earlier messages do not count as missed
    EXPECT_EQ(got.at("/b/n").t, 500);
    // The first observer does not get the message again, and sees no gap.
    run.let(510);
    for (const char *topic : {"/a/n", "/b/n"}) {
        const auto seen = first.next(patience);
        ASSERT_TRUE(seen);
        EXPECT_EQ(seen->topic, topic);
        EXPECT_EQ(seen->count, 52u);
    }
    EXPECT_EQ(first.missed(), 0u);
    // An observer that comes after the end is refused.
    run.let(for_ever);
    EXPECT_EQ(run.run.get(), "");
}

INSTANTIATE_TEST_SUITE_P(All, Broadcast, testing::Values("tcp", "ipc"));

TEST(Broker, AnEarlyObserverWaitsForTheMatching)
{
    zmq::context_t context, other;
    RouterConfig config;
    config.broker = true;
    config.address = "tcp://127.0.0.1:*";
    auto run_config = config_of({{"a", Policy::abort}}, 1000);
    run_config.watched = {"/a/n"};
    Router router(context, run_config, config);
    auto run = in_thread([&] { return router.run(); });
    MemberConfig observer;
    observer.simulation = "test";
    observer.node = "viewer";
    observer.address = router.address();
    observer.connect_timeout = 300ms;
    EXPECT_THROW(Observer(other, observer), LinkError);
    observer.connect_timeout = patience;
    auto watch = in_thread([&] {
        Observer viewer(other, observer);
        return viewer.topics().count("/a/n");
    });
    std::this_thread::sleep_for(200ms); // by then it waits
    Held a("", "/a/n", Latency::same_instant);
    auto serve_a = in_thread([&] { return serve(other, router.address(), "a", a); });
    EXPECT_EQ(watch.get(), 1u);
    a.go = true;
    EXPECT_EQ(serve_a.get(), "");
    EXPECT_EQ(run.get(), "");
}

TEST(Broker, NodesAndObserversSeeAsynchronousMessages)
{
    Watched run("tcp", 1000, "", {"/ground/command"});
    zmq::context_t context;
    Observer ground(context, run.observer("ground"));
    Observer viewer(context, run.observer("viewer"));
    viewer.subscribe("/ground/");
    ASSERT_TRUE(viewer.next(patience)); // the initial value
    for (std::uint64_t x = 1; x <= 20; x++) {
        ground.write("/ground/command", word(100 + x));
    }
    std::vector<std::pair<Ns, std::uint64_t>> seen_by_reader;
    for (std::uint32_t k = 1; k <= 20; k++) {
        const auto seen = viewer.next(patience);
        ASSERT_TRUE(seen);
        EXPECT_EQ(seen->node, "ground");
        EXPECT_EQ(seen->count, k);
        seen_by_reader.emplace_back(seen->t, word_of(seen->payload));
    }
    EXPECT_THROW(ground.write("/ground/other", word(1)), LinkError);
    EXPECT_THROW(ground.write("/ground/command", Bytes(7)), LinkError);
    ground.write("/a/n", word(1)); // that the controller refuses
    viewer.write("/ground/command", word(1));
    EXPECT_TRUE(run.reported("ground writes /a/n: /a/n is not written by ground"));
    EXPECT_TRUE(run.reported("viewer writes /ground/command: /ground/command is not written by viewer"));
    run.let(for_ever);
    EXPECT_EQ(run.run.get(), "");
    run.serve_a.wait();
    auto &commands = run.a.commands;
    ASSERT_EQ(commands.size(), 21u);
    EXPECT_EQ(commands[0].second, 0u); // the initial value
    commands.erase(commands.begin());
    EXPECT_EQ(commands, seen_by_reader); // a reader of the same instant sees it at the time of writing
    for (std::size_t k = 1; k < commands.size(); k++) {
        EXPECT_EQ(commands[k].first - commands[k - 1].first, k == 1 ? commands[1].first - commands[0].first : 10);
    }
    EXPECT_EQ(run.router.broker()->counts().received, 22u);
    EXPECT_EQ(run.router.broker()->counts().refused, 2u);
}

TEST(Broker, InvalidMessagesAreCountedAndHarmless)
{
    Watched run("tcp", 1000, "", {"/ground/command"});
    run.let(0);
    zmq::context_t context;
    Observer ground(context, run.observer("ground"));
    const auto send = [&](zmq::socket_t &socket, std::vector<std::string> parts) {
        for (std::size_t i = 0; i < parts.size(); i++) {
            socket.send(zmq::buffer(parts[i]), i + 1 < parts.size() ? zmq::send_flags::sndmore : zmq::send_flags::none);
        }
    };
    zmq::socket_t front(context, zmq::socket_type::xpub), back(context, zmq::socket_type::xsub);
    for (zmq::socket_t *socket : {&front, &back}) {
        socket->set(zmq::sockopt::linger, 1000);
        socket->set(zmq::sockopt::rcvtimeo, 20'000);
    }
    front.connect(run.router.broker()->frontend());
    back.connect(run.router.broker()->backend());
    zmq::message_t subscription;
    ASSERT_TRUE(front.recv(subscription));
    std::mt19937 random(3);
    const auto bytes = [&](std::size_t n) {
        std::string text(n, 0);
        std::generate(text.begin(), text.end(), [&] { return static_cast<char>(random()); });
        return text;
    };
    const Bytes good = published_by("ground", word(7));
    const std::string frame(reinterpret_cast<const char *>(good.data()), good.size());
    std::uint64_t sent = 0;
    for (int i = 0; i < 200; i++) {
        std::string damaged = frame;
        damaged[random() % damaged.size()] ^= static_cast<char>(1 + random() % 255);
        for (auto &parts : {std::vector<std::string>{bytes(random() % 100)},
                            {"/ground/command", damaged},
                            {"/ground/command", frame, "more"},
                            {bytes(300), frame},
                            {"/ground/command", bytes(random() % 5000)}}) {
            send(front, parts);
            sent++;
        }
        send(back, {bytes(1 + random() % 50)});
        std::this_thread::sleep_for(1ms);
    }
    send(back, {std::string(1, 1) + std::string(100'000, 'x')}); // a subscription that is too long
    ground.write("/ground/command", word(42));                   // the valid message still arrives
    Observer viewer(context, run.observer("viewer"));
    viewer.subscribe("/ground/command");
    for (std::uint64_t x = 0; x != 42;) {
        const auto seen = viewer.next(patience);
        ASSERT_TRUE(seen);
        x = word_of(seen->payload);
    }
    while (run.router.broker()->counts().refused < sent) {
        std::this_thread::sleep_for(10ms);
    }
    run.let(for_ever);
    EXPECT_EQ(run.run.get(), "");
}

TEST(Broker, ASlowObserverSeesTheGapByTheCountAndSlowsNoNode)
{
    // One observer never reads: the run ends regularly, with far more messages than its queue holds.
    zmq::context_t context, other;
    RouterConfig config;
    config.broker = true;
    config.address = "tcp://127.0.0.1:*";
    auto run_config = config_of({{"a", Policy::abort}}, 1'000'000);
    run_config.watched = {"/a/n"};
    Router router(context, run_config, config);
    Held a("", "/a/n", Latency::same_instant);
    auto run = in_thread([&] { return router.run(); });
    auto serve_a = in_thread([&] { return serve(context, router.address(), "a", a); });
    MemberConfig slow;
    slow.simulation = "test";
    slow.node = "slow";
    slow.address = router.address();
    slow.waiting = 10;
    Observer observer(other, slow);
    observer.subscribe("/a/n");
    EXPECT_TRUE(observer.next(patience));
    a.go = true;
    EXPECT_EQ(run.get(), "");
    EXPECT_EQ(serve_a.get(), "");
    std::uint64_t seen = 0, missed = 0;
    std::uint32_t last = 0;
    for (; const auto message = observer.next(patience); seen++) {
        EXPECT_EQ(message->count, last + message->missed + 1);
        last = message->count;
        missed += message->missed;
    }
    EXPECT_TRUE(observer.over()); // after all messages before
    EXPECT_EQ(observer.missed(), missed);
    EXPECT_EQ(seen + missed, last);
    EXPECT_EQ(router.broker()->counts().published, 100'001u);
    EXPECT_GT(missed + (100'001 - last), 0u);
    EXPECT_GT(seen, 0u);
}

TEST(Broker, TheNewestMessageOfEachTopicSurvivesAFullRing)
{
    // Without a run: the test writes records faster than the ring has room.
    zmq::context_t context;
    BrokerConfig config;
    config.frontend = "inproc://broker-front";
    config.backend = "inproc://broker-back";
    config.room = 4096;
    Broker broker(context, config);
    zmq::socket_t seen(context, zmq::socket_type::sub);
    seen.set(zmq::sockopt::rcvhwm, 0);
    seen.set(zmq::sockopt::rcvtimeo, 20'000);
    seen.set(zmq::sockopt::subscribe, "");
    seen.connect("inproc://broker-back");
    Exchange exchange;
    exchange.topics = {{"/a", {}, "n", word(0)}, {"/b", {}, "n", word(0)}};
    broker.began(exchange);
    constexpr std::uint32_t n = 50'000;
    broker.wrote("n", {{1, 1, 0, word(77)}}); // written once: it must not get lost among the others
    for (std::uint32_t k = 1; k <= n; k++) {
        broker.wrote("n", {{0, k, k, word(k)}});
    }
    broker.wrote("n", {{0, n + 1, n + 1, Bytes(5000)}}); // too large for the ring
    broker.ended("over");
    std::uint32_t last = 0, gaps = 0;
    bool rare = false, over = false;
    while (!over) {
        broker.send_late();
        zmq::message_t topic, bytes;
        ASSERT_TRUE(seen.recv(topic) && seen.recv(bytes));
        const Message message = decode({bytes.data<std::byte>(), bytes.size()}).message;
        if (const auto *finish = std::get_if<Finish>(&message)) {
            EXPECT_EQ(finish->reason, "over");
            over = true;
            continue;
        }
        const auto &published = std::get<Published>(message);
        EXPECT_EQ(published.node, "n");
        if (topic.to_string_view() == "/b") {
            rare = rare || word_of(published.record.payload) == 77;
        } else if (published.record.count) {
            EXPECT_GT(published.record.count, last);
            EXPECT_EQ(word_of(published.record.payload), published.record.count);
            gaps += published.record.count - last - 1;
            last = published.record.count;
        }
    }
    EXPECT_TRUE(rare);
    EXPECT_EQ(last, n);
    EXPECT_EQ(broker.counts().dropped, gaps + 1);
}

/// A broker whose complete observers hear /a, with room for few messages, and one of these observers; with `more`, also
/// one that takes nothing.
struct Narrow {
    explicit Narrow(std::chrono::milliseconds patience, bool more = false,
                    std::chrono::milliseconds last_patience = cosim::patience)
    {
        BrokerConfig config;
        config.frontend = "inproc://broker-front";
        config.backend = "inproc://broker-back";
        config.complete = "inproc://broker-complete";
        config.observers = {{"ground", 1}};
        if (more) {
            config.observers["deaf"] = 1;
        }
        config.complete_topics = {"/a"};
        config.patience = patience;
        config.last_patience = last_patience;
        config.room = 4096;
        config.waiting = 10;
        broker.emplace(context, config);
        subscribe(seen, "ground");
        if (more) {
            subscribe(deaf, "deaf");
        }
        Exchange exchange;
        exchange.topics = {{"/a", {}, "n", word(0)}, {"/b", {}, "n", word(0)}};
        broker->began(exchange);
        for (std::uint32_t k = 1; k <= n; k++) {
            broker->wrote("n", {{0, k, k, word(k)}, {1, k, k, word(k)}});
        }
        broker->ended("over");
    }

    void subscribe(zmq::socket_t &socket, const std::string &program)
    {
        socket.set(zmq::sockopt::rcvhwm, 10);
        socket.set(zmq::sockopt::rcvtimeo, static_cast<int>(std::chrono::milliseconds(cosim::patience).count()));
        socket.connect(broker->backend(program));
        for (const char *topic : {"/", "finish", "ready"}) {
            socket.set(zmq::sockopt::subscribe, topic);
        }
        while (!broker->came(program)) {
            std::this_thread::sleep_for(1ms);
        }
    }

    /// Take all until the end, or what is there.
    void take(zmq::recv_flags flags = zmq::recv_flags::none, bool send_late = true)
    {
        for (zmq::message_t topic, bytes; seen.recv(topic, flags);) {
            ASSERT_TRUE(seen.recv(bytes));
            if (send_late) {
                broker->send_late();
            }
            const Message message = decode({bytes.data<std::byte>(), bytes.size()}).message;
            if (std::holds_alternative<Finish>(message)) {
                return seen.set(zmq::sockopt::unsubscribe, "finish");
            }
            const Record &record = std::get<Published>(message).record;
            EXPECT_EQ(word_of(record.payload), record.count);
            counts[topic.to_string()].push_back(record.count);
        }
        ASSERT_EQ(flags, zmq::recv_flags::dontwait) << "the end is missing";
    }

    void expect_all()
    {
        const auto &numbers = counts["/a"];
        ASSERT_EQ(numbers.size(), n + 1); // with the initial value
        for (std::uint32_t k = 0; k <= n; k++) {
            EXPECT_EQ(numbers[k], k);
        }
    }

    static constexpr std::uint32_t n = 20'000;
    zmq::context_t context;
    std::optional<Broker> broker;
    zmq::socket_t seen{context, zmq::socket_type::sub}, deaf{context, zmq::socket_type::sub};
    std::map<std::string, std::vector<std::uint32_t>> counts; ///< of messages, by topic
};

TEST(Broker, ACompleteObserverMissesNothingHoweverSlowItIs)
{
    Narrow narrow(patience);
    std::this_thread::sleep_for(100ms);
    EXPECT_TRUE(narrow.broker->holds());
    narrow.take();
    narrow.expect_all();
    EXPECT_EQ(narrow.counts["/b"].back(), narrow.n) << "of other topics, the newest one";
    EXPECT_LT(narrow.counts["/b"].size(), narrow.n / 2);
    EXPECT_EQ(narrow.broker->counts().dropped, 0u);
    EXPECT_FALSE(narrow.broker->holds());
}

TEST(Broker, NothingWaitsForACompleteObserverThatTakesNothing)
{
    Narrow narrow(100ms);
    for (; narrow.broker->holds(); narrow.broker->send_late()) {
        std::this_thread::sleep_for(1ms);
    }
    narrow.take();
    const auto &numbers = narrow.counts["/a"];
    EXPECT_TRUE(std::is_sorted(numbers.begin(), numbers.end()));
    EXPECT_LT(numbers.size(), narrow.n);
    EXPECT_GT(numbers.size(), 10u);
    EXPECT_THAT(narrow.broker->take_reports(),
                testing::ElementsAre(testing::HasSubstr(
                    "has taken no message of /a for 100 ms; the run goes on, and it misses messages")));
}

TEST(Broker, ADeafCompleteObserverCostsTheOthersNothing)
{
    Narrow narrow(2s, true);
    std::vector<std::string> reports;
    for (; reports.empty(); reports = narrow.broker->take_reports()) {
        narrow.take(zmq::recv_flags::dontwait);
        narrow.broker->send_late();
        std::this_thread::sleep_for(1ms);
    }
    EXPECT_THAT(reports, testing::ElementsAre(testing::HasSubstr("of deaf, has taken no message of /a for 2000 ms")));
    std::this_thread::sleep_for(100ms); // the queue of the other one becomes full
    EXPECT_TRUE(narrow.broker->holds());
    narrow.take();
    narrow.expect_all();
    EXPECT_THAT(narrow.broker->take_reports(), testing::Each(testing::HasSubstr("of deaf,")));
    narrow.deaf.close(); // the end does not wait for one that is gone
}

TEST(Broker, WithPatienceForEverTheEndWaitsForAReaderButNotForADeafObserver)
{
    for (const bool deaf : {false, true}) {
        Narrow narrow(0ms, false, deaf ? 200ms : patience);
        auto end = in_thread([&] {
            narrow.broker.reset();
            return 0;
        });
        if (!deaf) {
            narrow.take(zmq::recv_flags::none, false);
            narrow.expect_all();
        }
        EXPECT_EQ(end.wait_for(patience), std::future_status::ready);
    }
}

/// A run of one node, for which one complete observer is awaited; with `more`, also one of another program, until it is
/// `gone`.
struct Awaited {
    explicit Awaited(std::chrono::milliseconds join = patience, bool more = false)
    {
        RouterConfig config;
        config.broker = true;
        config.address = "ipc://@fledge-broker-awaited-" + std::to_string(getpid());
        config.join = join;
        auto run_config = config_of({{"a", Policy::abort}}, 100'000);
        run_config.watched = {"/a/n"};
        run_config.asynchronous = {{"ground", {}, 1}};
        if (more) {
            run_config.asynchronous.push_back({"other", {}, 1});
        }
        config.report = [this](const std::string &text) { reports += text; };
        router.emplace(context, run_config, config);
        run = in_thread([&] {
            return router->run([&] {
                if (gone) {
                    router->go_without("other");
                    lifted = true;
                }
                return true;
            });
        });
        node = in_thread([&] { return serve(context, router->address(), "a", a); });
    }
    ~Awaited()
    {
        EXPECT_EQ(run.get(), "");
        EXPECT_EQ(node.get(), "");
    }
    MemberConfig member() const
    {
        MemberConfig config;
        config.simulation = "test";
        config.node = "ground";
        config.address = router->address();
        config.waiting = 10;
        return config;
    }

    zmq::context_t context, other;
    std::atomic<bool> gone = false, lifted = false;
    std::string reports;
    std::optional<Router> router;
    Counter a{"", "/a/n", Latency::same_instant};
    std::future<std::string> run, node;
};

TEST(Broker, ARunWaitsForACompleteObserverAtItsBeginningAndWhileItIsSlow)
{
    Awaited awaited;
    Observer ground(awaited.other, awaited.member());
    std::this_thread::sleep_for(100ms);
    ground.subscribe("/a/n");
    std::uint32_t next = 0;
    for (; const auto message = ground.next(patience); next++) {
        ASSERT_EQ(message->count, next);
        if (next % 2000 == 0) {
            std::this_thread::sleep_for(20ms);
        }
    }
    EXPECT_TRUE(ground.over());
    EXPECT_EQ(next, 10'001u + 1) << "of each step, and the initial value";
}

TEST(Broker, ARunGoesOnWithoutACompleteObserverThatIsGoneOrDoesNotCome)
{
    {
        Awaited awaited;
        Observer ground(awaited.other, awaited.member());
        ground.subscribe("/a/n");
        EXPECT_TRUE(ground.next(patience));
    }
    Awaited awaited(5000ms);
    awaited.run.wait();
    EXPECT_EQ(awaited.reports, "the run goes on without ground, which did not come within 5 s");
}

TEST(Broker, ARunThatGoesOnWithoutOneProgramStillWaitsForTheOthers)
{
    for (const bool came : {false, true}) {
        Awaited awaited(patience, true);
        if (came) {
            MemberConfig member = awaited.member();
            member.node = "other";
            Observer other(awaited.other, member);
            other.subscribe("/a/n");
            while (!awaited.router->broker()->came("other")) {
                std::this_thread::sleep_for(1ms);
            }
        }
        awaited.gone = true;
        while (!awaited.lifted) {
            std::this_thread::sleep_for(1ms);
        }
        std::this_thread::sleep_for(300ms); // in which a run that did not wait would end
        Observer ground(awaited.other, awaited.member());
        ground.subscribe("/a/n");
        std::uint32_t next = 0;
        for (; const auto message = ground.next(patience); next++) {
            ASSERT_EQ(message->count, next);
        }
        EXPECT_EQ(next, 10'001u + 1);
        EXPECT_EQ(awaited.reports, "");
    }
}

TEST(Broker, OfThePastOfARunObserversSeeTheLastMessages)
{
    zmq::context_t context;
    BrokerConfig config;
    config.frontend = "inproc://past-front";
    config.backend = "inproc://past-back";
    config.after = 100;
    Broker broker(context, config);
    zmq::socket_t seen(context, zmq::socket_type::sub);
    seen.set(zmq::sockopt::rcvtimeo, 20'000);
    seen.set(zmq::sockopt::subscribe, "");
    seen.connect("inproc://past-back");
    Exchange exchange;
    exchange.topics = {{"/a", {}, "n", {}}, {"/b", {}, "n", {}}};
    broker.began(exchange);
    broker.wrote("n", {{0, 1, 50, word(1)}, {1, 1, 60, word(2)}, {0, 2, 90, word(3)}, {0, 3, 100, word(4)}});
    broker.settled(99);
    broker.wrote("n", {{0, 4, 110, word(5)}}); // the node is ahead of the others
    broker.settled(100);
    broker.wrote("n", {{1, 2, 120, word(6)}});
    broker.ended("");
    std::string found;
    while (!found.ends_with("over")) {
        broker.send_late();
        zmq::message_t topic, bytes;
        ASSERT_TRUE(seen.recv(topic) && seen.recv(bytes));
        const Message message = decode({bytes.data<std::byte>(), bytes.size()}).message;
        if (const auto *published = std::get_if<Published>(&message)) {
            found += topic.to_string() + " " + std::to_string(published->record.t) + ", ";
        } else {
            found += "over";
        }
    }
    EXPECT_EQ(found, "/a 100, /a 110, /b 60, /b 120, over");
}

TEST(Broker, OnlyAllowedKeysObserveOrWrite)
{
    Keys keys;
    keys.allow("a", "a");
    keys.allow("b", "b");
    keys.allow("ground", "ground");
    keys.allow("viewer", "viewer");
    keys.make("stranger");
    Watched run("tcp", 1000, keys.folder(), {"/ground/command"});
    zmq::context_t context;
    Observer ground(context, run.observer("ground", keys.of("ground")));
    ground.write("/ground/command", word(5));
    Observer viewer(context, run.observer("viewer", keys.of("viewer")));
    viewer.subscribe("/ground/");
    for (std::uint64_t x = 0; x != 5;) {
        const auto seen = viewer.next(patience);
        ASSERT_TRUE(seen);
        x = word_of(seen->payload);
    }
    // A program uses another name than that of its key, in its greeting and in its messages.
    EXPECT_THROW(Observer(context, run.observer("ground", keys.of("viewer"))), LinkError);
    EXPECT_THROW(Observer(context, run.observer("ground", keys.of("stranger"))), LinkError);
    zmq::socket_t front(context, zmq::socket_type::xpub);
    front.set(zmq::sockopt::linger, 1000);
    front.set(zmq::sockopt::rcvtimeo, 20'000);
    use_keys(front, read_client_keys(keys.of("viewer"), "viewer"));
    front.connect(run.router.broker()->frontend());
    zmq::message_t subscription;
    ASSERT_TRUE(front.recv(subscription));
    front.send(zmq::str_buffer("/ground/command"), zmq::send_flags::sndmore);
    front.send(zmq::buffer(published_by("ground", word(6))), zmq::send_flags::none);
    EXPECT_TRUE(run.reported("the key viewer is not allowed to speak as ground"));
    // Without a key or with an unknown one, an observer gets nothing from the backend.
    zmq::context_t others;
    zmq::socket_t bare(others, zmq::socket_type::sub), stranger(others, zmq::socket_type::sub);
    for (zmq::socket_t *socket : {&bare, &stranger}) {
        socket->set(zmq::sockopt::linger, 0);
        socket->set(zmq::sockopt::rcvtimeo, 500);
        socket->set(zmq::sockopt::subscribe, "");
    }
    use_keys(stranger, read_client_keys(keys.of("stranger"), "stranger"));
    Handshake refused(others, stranger, true, false);
    bare.connect(run.router.broker()->backend());
    stranger.connect(run.router.broker()->backend());
    zmq::message_t message;
    EXPECT_FALSE(bare.recv(message));
    EXPECT_THROW(refused.receive(message, 500ms, "the broker", "stranger"), LinkError);
    run.let(for_ever);
    EXPECT_EQ(run.run.get(), "");
}

TEST(Broker, ImpossibleConfigurationsAreRefused)
{
    zmq::context_t context;
    RouterConfig config;
    config.address = "tcp://127.0.0.1:*";
    auto run = config_of({{"a", Policy::abort}}, 10);
    const auto refusal = [&]() -> std::string {
        return error_of<LinkError>([&] { Router router(context, run, config); });
    };
    run.asynchronous = {{"ground", {}}};
    EXPECT_EQ(refusal(), "asynchronous programs, such as ground, need a broker, and this controller has none");
    config.broker = true;
    config.backend = "tcp://0.0.0.0:*";
    EXPECT_TRUE(refusal().starts_with("tcp://0.0.0.0:* can be reached from other machines, which needs keys"));
    config.backend = "";
    config.frontend = "tcp://127.0.0.1:x";
    EXPECT_TRUE(refusal().starts_with("cannot listen at tcp://127.0.0.1:x for what asynchronous programs publish: "));
    config.frontend = "";
    EXPECT_EQ(refusal(), "");
    // An observer of a run without a broker is refused.
    config.broker = false;
    run.asynchronous.clear();
    Router router(context, run, config);
    std::atomic<bool> stop{false};
    auto done = in_thread([&] { return router.run([&] { return !stop; }); });
    MemberConfig observer;
    observer.simulation = "test";
    observer.node = "viewer";
    observer.address = router.address();
    try {
        Observer viewer(context, observer);
        ADD_FAILURE();
    } catch (const LinkError &error) {
        EXPECT_EQ(std::string(error.what()),
                  "the controller refuses viewer: this controller has no broker, so there can be no observers");
    }
    stop = true;
}

TEST(Broker, AnObserverWhoseQueueIsFullOutlivesTheRun)
{
    // libzmq ends a program whose heartbeat comes due between the loss of a connection and the reading of a full queue.
    zmq::context_t context, elsewhere;
    Held a("/b/n", "/a/n", Latency::next_instant);
    Counter b("/a/n", "/b/n", Latency::same_instant);
    std::unique_ptr<Observer> observer;
    {
        RouterConfig config;
        config.address = "ipc://@fledge-broker-full-" + std::to_string(getpid());
        config.broker = true;
        Router router(context, config_of({{"a", Policy::abort}, {"b", Policy::abort}}, 20'000), config);
        router.host("b", b);
        auto node = in_thread([&] { return serve(elsewhere, router.address(), "a", a); });
        auto observing = in_thread([&] {
            MemberConfig member;
            member.simulation = "test";
            member.node = "observer";
            member.address = router.address();
            member.waiting = 10;
            observer = std::make_unique<Observer>(elsewhere, member);
            observer->subscribe("");
            const bool any = observer->next(patience).has_value();
            a.go = true;
            return any;
        });
        EXPECT_EQ(router.run(), "");
        EXPECT_TRUE(observing.get());
        EXPECT_EQ(node.get(), "");
    }
    std::this_thread::sleep_for(1500ms);
    try {
        while (observer->next(0ms)) {
        }
    } catch (const LinkError &error) {
        EXPECT_STREQ(error.what(), "the controller is gone");
    }
}

} // namespace broker_test
} // namespace fledge::cosim
