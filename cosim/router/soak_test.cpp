// SPDX-License-Identifier: Apache-2.0
// Many ticks: every message arrives in order and unchanged, and the memory of the programs does not grow. The same
// holds while SIGKILL ends one node in each cycle, which another program replaces, and SIGSTOP stops the other one for
// a while. Some ten thousand ticks over shared memory by default; for a night:
//
//     FLEDGE_SOAK_TICKS=10000000 FLEDGE_SOAK_CYCLES=500 cosim_soak_test
//     FLEDGE_SOAK_TICKS=3000000 FLEDGE_SOAK_CYCLES=500 FLEDGE_SOAK_TRANSPORT=tcp cosim_soak_test     also ipc
#include "cosim/router/router.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <random>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>

#ifdef __SANITIZE_ADDRESS__
constexpr bool grows = true; // the sanitizer delays the reuse of freed memory
#else
constexpr bool grows = false;
#endif

namespace fledge::cosim {
namespace soak_test {

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

    Initialized initialize(const Initialize &request) override
    {
        if (!request.snapshot.empty()) {
            now_ = request.start;
            std::memcpy(sent_.data(), request.snapshot.data(), sizeof sent_);
            std::memcpy(received_.data(), request.snapshot.data() + sizeof sent_, sizeof received_);
        }
        return {{{period, 0}}, false, true};
    }
    std::vector<Subscription> desired() override
    {
        return {{topic(other_, "small"), Latency::next_exchange, false, small_},
                {topic(other_, "large"), Latency::next_exchange, false, large_}};
    }
    std::vector<Publication> match(const std::vector<Channel> &channels) override
    {
        std::vector<Publication> publications;
        for (const Channel &channel : channels) {
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
    Bytes save() override
    {
        Bytes bytes(sizeof sent_ + sizeof received_);
        std::memcpy(bytes.data(), sent_.data(), sizeof sent_);
        std::memcpy(bytes.data() + sizeof sent_, received_.data(), sizeof received_);
        return bytes;
    }
    Tock tick(const Tick &tick) override
    {
        for (const Record &record : tick.records) {
            const bool is_large = record.channel == in_[true];
            const std::uint32_t number = received_[is_large]++;
            const Bytes expected = content(2 * other_ + is_large, number, is_large ? large : small);
            if (record.count != ++came_[is_large] || record.payload != make_payload(expected)) {
                throw std::runtime_error("message " + std::to_string(number) + " is not what was sent");
            }
        }
        Tock tock{tick.until, 0, {}, false};
        while (now_ < tick.until) { // several instants, where ticks are repeated
            now_ += period;
            tock.records.push_back({out_[false], ++went_[false], now_, message(false, ++sent_[false])});
            if (sent_[false] % seldom == 0) {
                tock.records.push_back({out_[true], ++went_[true], now_, message(true, ++sent_[true])});
            }
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
    Ns now_ = -period; ///< the last instant
    std::array<std::uint32_t, 2> out_{}, in_{};
    std::array<std::uint32_t, 2> sent_{}, received_{}; ///< messages in the run
    std::array<std::uint32_t, 2> went_{}, came_{};     ///< and since this program began
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

using Address = std::array<char, 200>;

/// Programs that are nodes, in a program of their own: it has no threads, so it may fork at any time.
class Nursery {
public:
    explicit Nursery(const std::string &name)
        : shared_(static_cast<Shared *>(
              mmap(nullptr, sizeof(Shared), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0)))
    {
        new (shared_) Shared{};
        if (pipe(orders_.data()) != 0 || (pid_ = fork()) < 0) {
            throw std::runtime_error("no program for " + name);
        }
        if (pid_ == 0) {
            prctl(PR_SET_PDEATHSIG, SIGKILL);
            ::close(orders_[1]);
            _exit(work());
        }
        ::close(orders_[0]);
    }
    /// Start the nodes, which greet at this address.
    void begin(const std::string &address)
    {
        Address text{};
        std::copy(address.begin(), address.end(), text.begin());
        EXPECT_EQ(write(orders_[1], text.data(), text.size()), static_cast<ssize_t>(text.size()));
    }
    /// Kill a node, and start another in its place; stop the other one for 0.2 s.
    void disturb(unsigned char victim) { EXPECT_EQ(write(orders_[1], &victim, 1), 1); }
    /// Wait for the end of the nodes. Returns 0 if it was a good one.
    int end()
    {
        ::close(orders_[1]);
        int status = -1;
        waitpid(pid_, &status, 0);
        return status;
    }
    pid_t node(std::size_t i) const { return shared_->pids[i]; }

private:
    struct Shared {
        std::array<std::atomic<pid_t>, 2> pids;
    };

    int work()
    {
        if (read(orders_[0], address_.data(), address_.size()) != static_cast<ssize_t>(address_.size())) {
            return 1;
        }
        start(0);
        start(1);
        unsigned char victim = 0;
        while (read(orders_[0], &victim, 1) == 1) {
            const pid_t killed = node(victim), stopped = node(1 - victim);
            if (killed <= 0 || stopped <= 0) {
                return 1; // no program could be started
            }
            kill(killed, SIGKILL);
            kill(stopped, SIGSTOP);
            waitpid(killed, nullptr, 0);
            start(victim);
            std::this_thread::sleep_for(200ms);
            kill(stopped, SIGCONT);
        }
        bool good = true;
        for (const std::size_t i : {0, 1}) {
            int status = -1;
            waitpid(node(i), &status, 0);
            good = good && status == 0;
        }
        return good ? 0 : 1;
    }
    void start(std::uint32_t self)
    {
        const pid_t pid = fork();
        if (pid != 0) {
            shared_->pids[self] = pid; // the new program itself has 0 here
            return;
        }
        prctl(PR_SET_PDEATHSIG, SIGKILL);
        try {
            Soaked node(self, 1 - self);
            zmq::context_t context;
            MemberConfig config;
            config.simulation = "soak";
            config.node = std::to_string(self);
            config.address = address_.data();
            Delegate(context, config).serve(node);
            _exit(0);
        } catch (const std::exception &error) {
            std::fprintf(stderr, "node %u: %s\n", self, error.what());
            _exit(1);
        }
    }

    Shared *shared_;
    std::array<int, 2> orders_{};
    pid_t pid_ = -1;
    Address address_{};
};

void soak(std::uint64_t ticks, unsigned cycles)
{
    const std::string transport = setting("FLEDGE_SOAK_TRANSPORT", "shm");
    const std::string name = "fledge-soak-" + std::to_string(getpid()) + "-" + std::to_string(cycles);
    Nursery nursery(name); // before this program starts a thread
    ControllerConfig config;
    config.simulation = "soak";
    config.nodes.resize(2);
    for (const std::size_t i : {0, 1}) {
        config.nodes[i].name = std::to_string(i);
        config.nodes[i].on_loss = cycles ? Policy::restart : Policy::abort;
        config.nodes[i].save_every = 2000 * period;
    }
    config.end = static_cast<Ns>(ticks / 2 - 1) * period;
    config.batch = 1; // each instant has its tick
    RouterConfig router_config;
    router_config.address = transport == "tcp" ? "tcp://127.0.0.1:*" : "ipc://@" + name;
    router_config.sharing = transport == "shm" ? Sharing::required : Sharing::forbidden;
    unsigned done = 0, back = 0;
    router_config.report = [&](const std::string &text) { back += text.find(" is back at ") != text.npos; };
    // The peak memory of each program in the second fifth of the run, and after it.
    std::array<std::size_t, 3> before{}, after{};
    const auto begun = std::chrono::steady_clock::now();
    {
        zmq::context_t context;
        Router router(context, config, router_config);
        nursery.begin(router.address());
        EXPECT_EQ(router.run([&] {
            const double part = static_cast<double>(router.controller().reached(0)) / static_cast<double>(config.end);
            for (std::size_t i = 0; i < before.size(); i++) {
                std::size_t &most = part < 0.4 ? before[i] : after[i];
                most = part < 0.2 ? most : std::max(most, resident(i ? nursery.node(i - 1) : getpid()));
            }
            // The next cycle begins when the nodes of the last one are back, and have got further.
            if (done < cycles && done == back && part > (done + 0.5) / cycles) {
                nursery.disturb(done++ % 2);
            }
            return true;
        }),
                  "");
        EXPECT_EQ(done, cycles);
        EXPECT_EQ(back, cycles);
        const std::uint64_t granted = router.times(0).ticks + router.times(1).ticks;
        if (cycles) {
            EXPECT_GE(granted, ticks / 2 * 2); // some were repeated
        } else {
            EXPECT_EQ(granted, ticks / 2 * 2);
        }
    }
    EXPECT_EQ(nursery.end(), 0);
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begun;
    std::printf("%llu ticks over %s in %.0f s, with %u kills and stops\n", static_cast<unsigned long long>(ticks),
                transport.c_str(), took.count(), done);
    for (std::size_t i = 0; i < before.size(); i++) {
        std::printf("%s: %zu kB, then at most %zu kB\n", i ? "a node" : "the controller", before[i] / 1024,
                    after[i] / 1024);
        if (!grows && before[i] && after[i]) {
            // A program that takes another's place gets the whole log at once.
            EXPECT_LE(after[i], before[i] + (cycles ? 4096 : 512) * 1024);
        }
    }
}

const std::uint64_t ticks_wanted = std::stoull(setting("FLEDGE_SOAK_TICKS", "0"));

TEST(Soak, ManyTicksArriveWithoutMemoryGrowth)
{
    soak(ticks_wanted ? ticks_wanted
         : grows      ? 20'000
                      : 50'000,
         static_cast<unsigned>(std::stoul(setting("FLEDGE_SOAK_CYCLES", "0"))));
}

TEST(Soak, ManyTicksArriveAlthoughNodesAreKilledAndStopped)
{
    if (ticks_wanted) {
        GTEST_SKIP() << "FLEDGE_SOAK_TICKS asks for the other one alone";
    }
    soak(grows ? 60'000 : 100'000, 3);
}

} // namespace soak_test
} // namespace fledge::cosim
