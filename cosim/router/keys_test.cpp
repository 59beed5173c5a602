// SPDX-License-Identifier: Apache-2.0
// Which programs the controller accepts, and the reports of both sides.
#include "cosim/protocol/testing/patience.h"
#include "cosim/router/testing/nodes.h"
#include "tests/error_of.h"

#include <gtest/gtest.h>

#include <future>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>

namespace fledge::cosim {
namespace keys_test {

using namespace std::chrono_literals;
using namespace testing_nodes;

/// A controller with keys, and what it reports.
struct Guarded : Reports {
    explicit Guarded(const std::string &keys, const std::string &address = "tcp://127.0.0.1:*")
        : router(context, config_of({{"a", Policy::abort}, {"b", Policy::abort}}, 1000), router_config(keys, address))
    {
        run = in_thread([this] {
            return router.run([this] {
                absent = router.controller().absent().size();
                return !stop;
            });
        });
    }
    ~Guarded() { end(); }

    std::string end()
    {
        stop = true;
        return run.valid() ? run.get() : "";
    }

    RouterConfig router_config(const std::string &keys, const std::string &address)
    {
        RouterConfig config;
        config.address = address;
        config.keys = keys;
        config.report = [this](const std::string &text) {
            const std::lock_guard lock(mutex);
            reports += text + "\n";
        };
        return config;
    }

    /// The outcome of a node with these keys, in a separate context, as in another program.
    std::string try_as(const std::string &node, const std::string &keys)
    {
        zmq::context_t other;
        Counter counter("/b/n", "/a/n", Latency::next_instant);
        return serve(other, router.address(), node, counter, keys, patience);
    }

    zmq::context_t context;
    std::atomic<bool> stop{false};
    std::atomic<std::size_t> absent{2}; ///< nodes
    Router router;
    std::future<std::string> run;
};

class Keyed : public testing::TestWithParam<const char *> {
protected:
    std::string address() const
    {
        static std::atomic<int> count{0};
        return std::string(GetParam()) == "tcp"
                   ? "tcp://127.0.0.1:*"
                   : "ipc://@fledge-keys-" + std::to_string(getpid()) + "-" + std::to_string(count++);
    }
};

TEST_P(Keyed, AProgramWithAnAllowedKeyTakesPart)
{
    Keys keys;
    keys.allow("a", "a");
    keys.allow("lab", "b c");
    std::filesystem::remove(keys.of("b"));
    Guarded guarded(keys.folder(), address());
    zmq::context_t context;
    Counter a("/b/n", "/a/n", Latency::next_instant), b("/a/n", "/b/n", Latency::same_instant);
    auto serve_a = in_thread([&] { return serve(context, guarded.router.address(), "a", a, keys.folder()); });
    auto serve_b = in_thread([&] { return serve(context, guarded.router.address(), "b", b, keys.of("lab")); });
    EXPECT_EQ(guarded.run.get(), "");
    EXPECT_EQ(serve_a.get() + serve_b.get(), "");
    EXPECT_EQ(b.received, 201u);
    EXPECT_EQ(guarded.reports, "");
}

TEST_P(Keyed, AProgramWithoutAnAllowedKeyIsReportedToItselfAndTheUser)
{
    Keys keys, others;
    keys.allow("a", "a");
    keys.allow("lab", "b c");
    const std::string stranger = keys.make("stranger").open;
    Guarded guarded(keys.folder(), address());
    const std::string at = "threw: the controller at " + guarded.router.address() + " does not let a in: ";
    EXPECT_EQ(guarded.try_as("a", keys.of("stranger")),
              at + "it does not know this key: ./fledge keys allow, where the controller runs, lets it in");
    EXPECT_TRUE(guarded.reported("its public key is not allowed here: " + stranger + "; ./fledge keys allow"));
    EXPECT_EQ(guarded.try_as("a", keys.of("lab")),
              "threw: the controller refuses a: its key lab is not allowed to speak as a");
    EXPECT_TRUE(guarded.reported("its key lab is not allowed to speak as a"));
    const std::string bare = guarded.try_as("a", "");
    EXPECT_TRUE(bare.starts_with(at) && bare.find("it asks for keys") != bare.npos) << bare;
    others.make("a"); // it holds another controller's public key
    EXPECT_EQ(guarded.try_as("a", others.of("a")),
              at + "what listens there breaks off when it sees these keys: controller.public here is not that of "
                   "this controller, or it uses no keys");
    EXPECT_EQ(guarded.absent, 2u); // no node has come
    EXPECT_EQ(guarded.end(), "the user ended it");
}

TEST_P(Keyed, AControllerWithoutKeysIsRecognized)
{
    Keys keys;
    keys.allow("a", "a");
    Guarded guarded("", address());
    // The side that notices first disconnects, so the other side may see only the lost connection.
    const std::string found = guarded.try_as("a", keys.of("a"));
    EXPECT_TRUE(found.starts_with("threw: the controller at " + guarded.router.address() + " does not let a in: ") &&
                found.find("it uses no keys") != found.npos)
        << found;
}

INSTANTIATE_TEST_SUITE_P(All, Keyed, testing::Values("tcp", "ipc"));

TEST(Authenticator, AKeyAllowedWhileTheControllerWaitsIsAccepted)
{
    Keys keys;
    keys.allow("a", "a");
    const std::string late = keys.make("late").open;
    Guarded guarded(keys.folder());
    EXPECT_NE(guarded.try_as("b", keys.of("late")).find("it does not know this key"), std::string::npos);
    Keys::write(keys.folder() / "allowed" / "late.public", late, "", "b");
    std::this_thread::sleep_for(250ms);
    auto late_b = in_thread([&] { return guarded.try_as("b", keys.of("late")); });
    while (guarded.absent == 2) {
        std::this_thread::sleep_for(10ms);
    }
    std::filesystem::remove(keys.folder() / "allowed" / "a.public");
    std::this_thread::sleep_for(250ms);
    EXPECT_NE(guarded.try_as("a", keys.of("a")).find("it does not know this key"), std::string::npos);
    EXPECT_EQ(guarded.end(), "the user ended it");
    EXPECT_EQ(late_b.get(), "the user ended it");
}

TEST(Authenticator, ANodesOwnSocketIsForItsKeyOnly)
{
    // The address of a's socket is of no use to an unknown program, nor to another node.
    Keys keys;
    keys.allow("a", "a");
    keys.allow("b", "b");
    Guarded guarded(keys.folder());
    zmq::context_t context;
    const ClientKeys right = read_client_keys(keys.folder(), "a");
    zmq::socket_t greetings(context, zmq::socket_type::dealer);
    greetings.set(zmq::sockopt::linger, 0);
    greetings.set(zmq::sockopt::rcvtimeo, 20'000);
    use_keys(greetings, right);
    greetings.connect(guarded.router.address());
    greetings.send(zmq::buffer(encode({1, Hello{1, 1, "test", "a"}})), zmq::send_flags::none);
    zmq::message_t reply;
    ASSERT_TRUE(greetings.recv(reply));
    const std::string own = std::get<Welcome>(decode({reply.data<std::byte>(), reply.size()}).message).address;
    Link wrong(context, {});
    use_keys(wrong.socket(), read_client_keys(keys.folder(), "b"));
    wrong.socket().connect(own);
    EXPECT_THROW(wrong.wait(patience), LinkError);
    EXPECT_TRUE(guarded.reported("was not let in as a, for which its key b is not allowed"));
    Link bare(context, {});
    bare.socket().connect(own);
    bare.send({1, Hello{1, 1, "test", "a"}});
    EXPECT_THROW(bare.wait(500ms), LinkError);
    // Nor do they prevent a from connecting.
    Link link(context, {});
    use_keys(link.socket(), right);
    link.socket().connect(own);
    link.send({1, Hello{1, 1, "test", "a"}});
    EXPECT_TRUE(std::holds_alternative<Initialize>(link.wait(patience).message));
}

/// Forwards bytes between two TCP sockets, and stores a copy.
class Relay {
public:
    explicit Relay(const std::string &to) : to_(static_cast<std::uint16_t>(std::stoi(to.substr(to.rfind(':') + 1))))
    {
        listening_ = socket(AF_INET, SOCK_STREAM, 0);
        sockaddr_in address = local(0);
        socklen_t size = sizeof address;
        bind(listening_, reinterpret_cast<sockaddr *>(&address), size);
        getsockname(listening_, reinterpret_cast<sockaddr *>(&address), &size);
        listen(listening_, 10);
        address_ = "tcp://127.0.0.1:" + std::to_string(ntohs(address.sin_port));
        thread_ = std::thread([this] { serve(); });
    }
    ~Relay() { end(); }

    const std::string &address() const { return address_; }

    std::string end()
    {
        stop_ = true;
        if (thread_.joinable()) {
            thread_.join();
            close(listening_);
        }
        return seen_;
    }

private:
    static sockaddr_in local(std::uint16_t port)
    {
        sockaddr_in address{};
        address.sin_family = AF_INET;
        address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
        address.sin_port = htons(port);
        return address;
    }

    void serve()
    {
        std::vector<pollfd> fds{{listening_, POLLIN, 0}};
        std::map<int, int> other;
        while (!stop_) {
            ::poll(fds.data(), fds.size(), 20);
            for (std::size_t i = fds.size(); i-- > 1;) {
                if (!fds[i].revents) {
                    continue;
                }
                char bytes[65536];
                const ssize_t n = recv(fds[i].fd, bytes, sizeof bytes, 0);
                if (n > 0) {
                    seen_.append(bytes, static_cast<std::size_t>(n));
                    (void)!send(other[fds[i].fd], bytes, static_cast<std::size_t>(n), MSG_NOSIGNAL);
                } else {
                    shutdown(other[fds[i].fd], SHUT_RDWR);
                    fds[i].fd = -fds[i].fd - 1; // polled no longer
                }
            }
            if (fds[0].revents) {
                const int in = accept(listening_, nullptr, nullptr), out = socket(AF_INET, SOCK_STREAM, 0);
                const sockaddr_in address = local(to_);
                if (connect(out, reinterpret_cast<const sockaddr *>(&address), sizeof address)) {
                    close(in);
                    close(out);
                    continue;
                }
                other[in] = out;
                other[out] = in;
                fds.push_back({in, POLLIN, 0});
                fds.push_back({out, POLLIN, 0});
            }
        }
        for (const auto &[fd, o] : other) {
            close(fd);
        }
    }

    std::uint16_t to_;
    int listening_;
    std::string address_, seen_;
    std::atomic<bool> stop_{false};
    std::thread thread_;
};

TEST(Authenticator, NothingIsReadableOnTheWire)
{
    // The name in the Hello represents any payload. Without keys the relay sees it, with keys it does not.
    const std::string name = "a-name-that-no-one-else-should-see";
    for (const bool keyed : {false, true}) {
        Keys keys;
        keys.allow("a", "*");
        Guarded guarded(keyed ? keys.folder().string() : "");
        Relay relay(guarded.router.address());
        zmq::context_t context;
        Counter counter("/b/n", "/a/n", Latency::next_instant);
        EXPECT_EQ(serve(context, relay.address(), name, counter, keyed ? keys.of("a") : "", patience),
                  "threw: the controller refuses " + name + ": test has no node " + name + "; it has a and b");
        guarded.end();
        const std::string seen = relay.end();
        EXPECT_GT(seen.size(), 200u);
        EXPECT_EQ(seen.find(name) == seen.npos, keyed);
        EXPECT_EQ(seen.find("it has a and b") == seen.npos, keyed);
    }
}

TEST(Router, OtherMachinesNeedKeys)
{
    zmq::context_t context;
    RouterConfig config;
    config.address = "tcp://0.0.0.0:*";
    const auto nodes = config_of({{"a", Policy::abort}}, 1);
    try {
        Router router(context, nodes, config);
        ADD_FAILURE() << "let in";
    } catch (const LinkError &error) {
        EXPECT_EQ(std::string(error.what()),
                  "tcp://0.0.0.0:* can be reached from other machines, which needs keys: ./fledge keys new "
                  "controller, and --keys; or listen at tcp://127.0.0.1");
    }
    config.unencrypted_beyond_machine = true;
    EXPECT_NO_THROW(Router(context, nodes, config));
    config.unencrypted_beyond_machine = false;
    Keys keys;
    config.keys = keys.folder();
    EXPECT_NO_THROW(Router(context, nodes, config));
}

TEST(Keys, AnInvalidFileIsReportedWithItsFault)
{
    Keys keys;
    const std::string folder = keys.folder();
    const auto client = [&](const std::string &place, const std::string &node) {
        return error_of<KeyError>([&] { read_client_keys(place, node); });
    };
    EXPECT_EQ(client(folder, "a"), folder + " holds no secret key; ./fledge keys new a makes a pair");
    EXPECT_EQ(client(folder + "/none", "a"), folder + "/none: there are no keys; ./fledge keys new a makes a pair");
    keys.make("lab1");
    EXPECT_EQ(client(folder, "a"), "");
    keys.make("lab2");
    EXPECT_EQ(client(folder, "a"), folder +
                                       " holds no a.secret but several others: lab1.secret, lab2.secret; say "
                                       "which by FLEDGE_KEYS=" +
                                       folder + "/lab1.secret");
    EXPECT_EQ(client(keys.of("lab2"), "a"), "");
    std::filesystem::permissions(keys.of("lab2"), std::filesystem::perms(0640));
    EXPECT_EQ(client(keys.of("lab2"), "a"),
              keys.of("lab2") + ": others may read this secret key; chmod 600 keeps it yours, and if they might "
                                "have, make a new one");
    std::filesystem::permissions(keys.of("lab2"), std::filesystem::perms(0600));
    Keys::write(keys.of("lab2"), keys.make("x").open, "    secret-key = \"short\"\n");
    EXPECT_EQ(client(keys.of("lab2"), "a"),
              keys.of("lab2") + ": line 6: a secret-key is 40 characters of Z85, as ./fledge keys writes it");
    Keys::write(keys.of("lab2"), keys.make("x1").open, "    secret-key = \"" + keys.make("x2").secret + "\"\n");
    EXPECT_EQ(client(keys.of("lab2"), "a"), keys.of("lab2") + ": its public key is not that of its secret key");
    const auto allowed = [&] { return error_of<KeyError>([&] { read_allowed_keys(folder); }); };
    EXPECT_EQ(allowed(), "");
    const std::string file = folder + "/allowed/y.public";
    Keys::write(file, keys.make("y").open, "");
    EXPECT_EQ(allowed(), file + R"(: it does not say for which nodes: nodes = "world flight")");
    Keys::write(file, keys.make("y1").open, "    secret-key = \"" + keys.make("y2").secret + "\"\n", "a");
    EXPECT_EQ(allowed(), file + ": a secret key in a file that goes to others; make a new pair with "
                                "./fledge keys new");
    Keys::write(file, "", "", "a");
    EXPECT_EQ(allowed(), file + ": line 6: a public-key is 40 characters of Z85, as ./fledge keys writes it");
    std::ofstream(file) << "nodes = \"a\"\n";
    EXPECT_EQ(allowed(), file + ": it holds no public-key");
}

} // namespace keys_test
} // namespace fledge::cosim
