// SPDX-License-Identifier: Apache-2.0
// Many ticks over shared memory: every message arrives in order and unchanged, and the memory of the programs does not
// grow. A hundred thousand ticks by default; for a night:
//
//     FLEDGE_SOAK_TICKS=10000000 cosim_soak_test        also FLEDGE_SOAK_TRANSPORT=ipc, tcp
#include "cosim/router/router.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <random>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#ifdef __SANITIZE_ADDRESS__
constexpr bool grows = true; // the sanitizer delays the reuse of freed memory
#else
constexpr bool grows = false;
#endif

namespace fledge::cosim {
namespace {

using namespace std::chrono_literals;

constexpr Ns period = 1000;
constexpr std::size_t small = 64, large = 40'000; ///< bytes; the large one exceeds the ring of a channel
constexpr std::uint32_t seldom = 500;             ///< instants from one large message to the next

/// The content of a message depends on its writer and its number.
Bytes content(std::uint32_t writer, std::uint32_t number, std::size_t size)
{
    std::mt19937_64 random(std::uint64_t{writer} << 32 | number);
    Bytes bytes(size);
    for (std::size_t i = 0; i < size; i += 8) {
        const std::uint64_t word = random();
        std::memcpy(bytes.data() + i, &word, 8);
    }
    return bytes;
}

/// Writes a small message at each instant and seldom a large one, and reads the same from its partner.
class Soaked final : public Node {
public:
    Soaked(std::uint32_t self, std::uint32_t other) : self_(self), other_(other) {}

    Initialized initialize(const Initialize &) override { return {{{period, 0}}, false}; }
    std::vector<Subscription> desired() override
    {
        return {{topic(other_, "small"), Latency::next_exchange, false, small_},
                {topic(other_, "large"), Latency::next_exchange, false, large_}};
    }
    std::vector<Publication> match(const std::vector<Channel> &asked) override
    {
        std::vector<Publication> publications;
        for (const Channel &channel : asked) {
            for (const bool is_large : {false, true}) {
                if (channel.topic == topic(self_, is_large ? "large" : "small")) {
                    out_[is_large] = channel.channel;
                    publications.push_back({channel.channel, is_large ? large_ : small_, message(is_large, 0)});
                }
            }
        }
        return publications;
    }
    void start(const std::vector<Channel> &wired) override
    {
        for (const Channel &channel : wired) {
            in_[channel.topic == topic(other_, "large")] = channel.channel;
        }
    }
    Tock tick(const Tick &tick) override
    {
        for (const Record &record : tick.records) {
            const bool is_large = record.channel == in_[true];
            const std::uint32_t number = heard_[is_large]++;
            const Bytes expected = content(2 * other_ + is_large, number, is_large ? large : small);
            if (record.count != number + 1 || record.payload != make_payload(expected)) {
                throw std::runtime_error("message " + std::to_string(number) + " is not what was sent");
            }
        }
        Tock tock{tick.until, 0, {}, false};
        tock.records.push_back({out_[false], ++said_[false], tick.until, message(false, said_[false])});
        if (said_[false] % seldom == 0) {
            tock.records.push_back({out_[true], ++said_[true], tick.until, message(true, said_[true])});
        }
        return tock;
    }

private:
    static std::string topic(std::uint32_t node, const char *name) { return "/" + std::to_string(node) + "/" + name; }
    static Schema schema(std::size_t size)
    {
        return make_schema("Words" + std::to_string(size),
                           "uint64[" + std::to_string(size / 8) + "] x  # x [-] words\n");
    }
    Payload message(bool is_large, std::uint32_t number) const
    {
        return make_payload(content(2 * self_ + is_large, number, is_large ? large : small));
    }

    std::uint32_t self_, other_;
    Schema small_ = schema(small), large_ = schema(large);
    std::array<std::uint32_t, 2> out_{}, in_{}, said_{}, heard_{};
};

/// [bytes]
std::size_t resident(pid_t pid)
{
    std::size_t size = 0, pages = 0;
    if (FILE *file = std::fopen(("/proc/" + std::to_string(pid) + "/statm").c_str(), "r")) {
        if (std::fscanf(file, "%zu %zu", &size, &pages) != 2) {
            pages = 0;
        }
        std::fclose(file);
    }
    return pages * static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
}

std::string setting(const char *name, const char *otherwise)
{
    const char *value = std::getenv(name);
    return value ? value : otherwise;
}

TEST(Soak, ManyTicksArriveWithoutMemoryGrowth)
{
    const std::uint64_t ticks = std::stoull(setting("FLEDGE_SOAK_TICKS", grows ? "20000" : "100000"));
    const std::string transport = setting("FLEDGE_SOAK_TRANSPORT", "shm");
    const std::string name = "fledge-soak-" + std::to_string(getpid());
    std::array<int, 2> go{};
    ASSERT_EQ(pipe(go.data()), 0);
    std::vector<pid_t> pids{getpid()};
    for (const std::uint32_t self : {0u, 1u}) {
        const pid_t pid = fork(); // before this program starts a thread
        if (pid == 0) {
            prctl(PR_SET_PDEATHSIG, SIGKILL);
            close(go[1]);
            std::array<char, 200> address{};
            try {
                if (read(go[0], address.data(), address.size()) != static_cast<ssize_t>(address.size())) {
                    throw std::runtime_error("no address came");
                }
                Soaked node(self, 1 - self);
                zmq::context_t context;
                MemberConfig config;
                config.simulation = "soak";
                config.node = std::to_string(self);
                config.address = address.data();
                Delegate(context, config).serve(node);
                _exit(0);
            } catch (const std::exception &error) {
                std::fprintf(stderr, "node %u: %s\n", self, error.what());
                _exit(1);
            }
        }
        pids.push_back(pid);
    }

    ControllerConfig config;
    config.simulation = "soak";
    config.nodes.resize(2);
    config.nodes[0].name = "0";
    config.nodes[1].name = "1";
    config.end = static_cast<Ns>(ticks / 2 - 1) * period;
    config.batch = 1; // each instant has its tick
    RouterConfig router_config;
    router_config.address = transport == "tcp" ? "tcp://127.0.0.1:*" : "ipc://@" + name;
    router_config.sharing = transport == "shm" ? Sharing::required : Sharing::forbidden;
    // The peak memory of each program in the second fifth of the run, and after it.
    std::array<std::size_t, 3> before{}, after{};
    {
        zmq::context_t context;
        Router router(context, config, router_config);
        std::array<char, 200> address{};
        std::copy(router.address().begin(), router.address().end(), address.begin());
        for (int i = 0; i < 2; i++) { // one for each node, in any order
            ASSERT_EQ(write(go[1], address.data(), address.size()), static_cast<ssize_t>(address.size()));
        }
        close(go[1]);
        EXPECT_EQ(router.run([&] {
            const double part = static_cast<double>(router.controller().reached(0)) / static_cast<double>(config.end);
            for (std::size_t i = 0; i < pids.size(); i++) {
                std::size_t &most = part < 0.4 ? before[i] : after[i];
                most = part < 0.2 ? most : std::max(most, resident(pids[i]));
            }
            return true;
        }),
                  "");
        EXPECT_EQ(router.times(0).ticks + router.times(1).ticks, ticks / 2 * 2);
    }
    close(go[0]);
    for (std::size_t i = 1; i < pids.size(); i++) {
        int status = -1;
        waitpid(pids[i], &status, 0);
        EXPECT_EQ(status, 0);
    }
    for (std::size_t i = 0; i < pids.size(); i++) {
        std::printf("%s: %zu kB, then at most %zu kB\n", i ? "a node" : "the controller", before[i] / 1024,
                    after[i] / 1024);
        if (!grows && before[i] && after[i]) {
            EXPECT_LE(after[i], before[i] + 512 * 1024);
        }
    }
}

} // namespace
} // namespace fledge::cosim
