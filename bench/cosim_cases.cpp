// SPDX-License-Identifier: Apache-2.0
// One measurement of a co-simulation per run; bench/cosim.py calls them in turn.
//
//     fledge_bench_cosim CASE TRANSPORT NODES ROUNDS      prints the median time of a round [ns]
#include "bench/cosim_cases.h"

#include "cosim/router/router.h"

#include <array>
#include <cstdio>
#include <cstring>
#include <memory>
#include <sys/mman.h>
#include <unistd.h>

namespace fledge::bench {
namespace {

using namespace cosim;

constexpr const char *block_text = "uint64[8] x  # x [-] 64 bytes\n";
constexpr Ns period = 1000;

/// A number that other programs see.
class SharedNumber {
public:
    SharedNumber()
        : at_(static_cast<double *>(
              mmap(nullptr, sizeof(double), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0)))
    {
        if (static_cast<void *>(at_) == MAP_FAILED) {
            throw std::runtime_error("no shared memory");
        }
    }
    ~SharedNumber() { munmap(at_, sizeof(double)); }
    SharedNumber(const SharedNumber &) = delete;
    SharedNumber &operator=(const SharedNumber &) = delete;
    double &operator*() { return *at_; }

private:
    double *at_;
};

/// Writes 64 bytes at each of its instants: the bytes that it read, with the first word incremented.
class Block final : public Node {
public:
    Block(std::string name, std::string reads, Latency latency, SharedNumber *median = nullptr)
        : name_(std::move(name)), reads_(std::move(reads)), latency_(latency), median_(median)
    {
    }

    Initialized initialize(const Initialize &) override { return {{{period, 0}}, false}; }
    std::vector<Subscription> desired() override { return {{topic(reads_), latency_, false, schema_}}; }
    std::vector<Publication> match(const std::vector<Channel> &channels) override
    {
        for (const Channel &channel : channels) {
            if (channel.topic == topic(name_)) {
                channel_ = channel.channel;
                return {{channel_, schema_, make_payload(std::as_bytes(std::span(block_)))}};
            }
        }
        throw std::runtime_error("no node reads " + name_);
    }
    void start(const std::vector<Channel> &) override {}

    Tock tick(const Tick &tick) override
    {
        watch_.lap();
        Tock tock{tick.until, 0, {}};
        auto record = tick.records.begin();
        for (; next_ <= tick.until; next_ += period) {
            for (; record != tick.records.end() && record->t <= next_; ++record) {
                if (record->count != ++received_ || record->payload.size() != 4 + sizeof block_) {
                    throw std::runtime_error("64 bytes are missing");
                }
                std::memcpy(block_.data(), record->payload.data() + 4, sizeof block_);
            }
            block_[0]++;
            tock.records.push_back({channel_, ++count_, next_, make_payload(std::as_bytes(std::span(block_)))});
        }
        return tock;
    }

    void finish(const std::string &) override
    {
        if (median_) {
            **median_ = watch_.median();
        }
    }

private:
    static std::string topic(const std::string &node) { return "/" + node + "/block"; }

    std::string name_, reads_;
    Latency latency_;
    SharedNumber *median_;
    Stopwatch watch_;
    Schema schema_ = make_schema("Block", block_text);
    std::array<std::uint64_t, 8> block_{};
    std::uint32_t channel_ = 0, count_ = 0, received_ = 0;
    Ns next_ = 0;
};

/// Writes 64 bytes that all nodes read, and reads 64 bytes of each node.
class Hub final : public Node {
public:
    Hub(std::uint64_t readers, SharedNumber &median) : readers_(readers), median_(median) {}

    Initialized initialize(const Initialize &) override { return {{{period, 0}}, false}; }
    std::vector<Subscription> desired() override
    {
        std::vector<Subscription> subscriptions;
        for (std::uint64_t i = 0; i < readers_; i++) {
            subscriptions.push_back({"/" + std::to_string(i) + "/block", Latency::next_instant, false, schema_});
        }
        return subscriptions;
    }
    std::vector<Publication> match(const std::vector<Channel> &channels) override
    {
        for (const Channel &channel : channels) {
            if (channel.topic == "/hub/block") {
                channel_ = channel.channel;
                return {{channel_, schema_, make_payload(std::as_bytes(std::span(block_)))}};
            }
        }
        throw std::runtime_error("no node reads the hub");
    }
    void start(const std::vector<Channel> &) override {}

    Tock tick(const Tick &tick) override
    {
        watch_.lap();
        if (tick.records.size() != readers_) {
            throw std::runtime_error("blocks are missing");
        }
        block_[0]++;
        return {tick.until, 0, {{channel_, ++count_, tick.until, make_payload(std::as_bytes(std::span(block_)))}}};
    }
    void finish(const std::string &) override { *median_ = watch_.median(); }

private:
    std::uint64_t readers_;
    SharedNumber &median_;
    Stopwatch watch_;
    Schema schema_ = make_schema("Block", block_text);
    std::array<std::uint64_t, 8> block_{};
    std::uint32_t channel_ = 0, count_ = 0;
};

RouterConfig listening(const std::string &transport)
{
    RouterConfig config;
    config.sharing = transport == "shm" ? Sharing::required : Sharing::forbidden;
    config.address = transport == "tcp" ? "tcp://127.0.0.1:*" : "ipc://@fledge-bench-" + std::to_string(getpid());
    return config;
}

/// A controller in this program, and other programs, each of which gets its address by a pipe.
class Run {
public:
    explicit Run(std::uint64_t rounds)
    {
        config_.simulation = "bench";
        config_.end = static_cast<Ns>(rounds - 1) * period;
        config_.batch = 1; // each instant has its tick
    }

    void program(const std::string &name, const std::function<std::unique_ptr<Node>()> &make)
    {
        config_.nodes.push_back({name, Policy::abort});
        std::array<int, 2> ends{};
        if (pipe(ends.data())) {
            throw std::runtime_error("no pipe");
        }
        children_.start([&] {
            std::array<char, 200> address{};
            if (read(ends[0], address.data(), address.size() - 1) <= 0) {
                throw std::runtime_error("no address came");
            }
            const auto node = make();
            zmq::context_t context;
            Delegate(context, {config_.simulation, name, address.data(), std::chrono::seconds(20), {}}).serve(*node);
        });
        close(ends[0]);
        addresses_.push_back(ends[1]);
    }

    void here(const std::string &name, Node &node)
    {
        config_.nodes.push_back({name, Policy::abort});
        hosted_.emplace_back(name, &node);
    }

    void fly(const std::string &transport)
    {
        zmq::context_t context;
        Router router(context, config_, listening(transport));
        for (const int pipe : addresses_) {
            if (write(pipe, router.address().data(), router.address().size()) < 0) {
                throw std::runtime_error("no address went");
            }
            close(pipe);
        }
        for (const auto &[name, node] : hosted_) {
            router.host(name, *node);
        }
        if (const std::string reason = router.run(); !reason.empty()) {
            throw std::runtime_error(reason);
        }
        children_.join();
    }

private:
    ControllerConfig config_;
    Children children_;
    std::vector<int> addresses_;
    std::vector<std::pair<std::string, Node *>> hosted_;
};

std::unique_ptr<Node> block(const std::string &name, const std::string &reads, Latency latency,
                            SharedNumber *median = nullptr)
{
    return std::make_unique<Block>(name, reads, latency, median);
}

/// A program, and its partner in the controller's program: 64 bytes there, 64 bytes back.
double one_tick(const std::string &transport, std::uint64_t rounds)
{
    SharedNumber median;
    Block here("here", "there", Latency::next_instant, &median);
    Run run(rounds);
    run.program("there", [] { return block("there", "here", Latency::same_instant); });
    run.here("here", here);
    run.fly(transport);
    return *median;
}

/// Two programs that step one after the other.
double pair(const std::string &transport, std::uint64_t rounds)
{
    SharedNumber median;
    Run run(rounds);
    run.program("world", [&] { return block("world", "flight", Latency::next_instant, &median); });
    run.program("flight", [] { return block("flight", "world", Latency::same_instant); });
    run.fly(transport);
    return *median;
}

/// k programs that step at once, and then their partner in the controller's program.
double hub(const std::string &transport, std::uint64_t k, std::uint64_t rounds)
{
    SharedNumber median;
    Hub here(k, median);
    Run run(rounds);
    run.here("hub", here);
    for (std::uint64_t i = 0; i < k; i++) {
        run.program(std::to_string(i), [i] { return block(std::to_string(i), "hub", Latency::same_instant); });
    }
    run.fly(transport);
    return *median;
}

double measure(const std::string &name, const std::string &transport, std::uint64_t k, std::uint64_t rounds)
{
    return name == "req_rep"   ? req_rep(transport, rounds)
           : name == "barrier" ? futex_barrier(k, rounds)
           : name == "tick"    ? one_tick(transport, rounds)
           : name == "pair"    ? pair(transport, rounds)
           : name == "hub"     ? hub(transport, k, rounds)
                               : throw std::invalid_argument("there is no case " + name);
}

} // namespace
} // namespace fledge::bench

int main(int argc, char **argv)
{
    try {
        if (argc != 5) {
            throw std::invalid_argument("usage: fledge_bench_cosim CASE TRANSPORT NODES ROUNDS");
        }
        std::printf("%.0f\n", fledge::bench::measure(argv[1], argv[2], std::stoul(argv[3]), std::stoul(argv[4])));
    } catch (const std::exception &error) {
        std::fprintf(stderr, "fledge_bench_cosim: %s\n", error.what());
        return 1;
    }
    return 0;
}
