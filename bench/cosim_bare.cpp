// SPDX-License-Identifier: Apache-2.0
#include "bench/cosim_cases.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <climits>
#include <csignal>
#include <cstdio>
#include <linux/futex.h>
#include <stdexcept>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>
#include <zmq.hpp>

namespace fledge::bench {

// ---- programs and time

Children::~Children()
{
    for (const int pid : pids_) {
        kill(pid, SIGKILL);
        waitpid(pid, nullptr, 0);
    }
}

void Children::start(const std::function<void()> &work)
{
    const pid_t parent = getpid();
    const pid_t pid = fork();
    if (pid < 0) {
        throw std::runtime_error("no further program can be started");
    }
    if (pid == 0) {
        prctl(PR_SET_PDEATHSIG, SIGKILL);
        if (getppid() != parent) {
            _exit(1);
        }
        try {
            work();
            _exit(0);
        } catch (const std::exception &error) {
            std::fprintf(stderr, "%s\n", error.what());
            _exit(1);
        }
    }
    pids_.push_back(pid);
}

void Children::join()
{
    bool failed = false;
    while (!pids_.empty()) {
        int status = 0;
        waitpid(pids_.back(), &status, 0);
        failed = failed || status;
        pids_.pop_back();
    }
    if (failed) {
        throw std::runtime_error("a program failed");
    }
}

void Stopwatch::lap()
{
    if (laps_++ % group == 0) {
        const auto now = std::chrono::steady_clock::now();
        if (laps_ > 1) {
            groups_.push_back(std::chrono::duration<double, std::nano>(now - last_).count() / group);
        }
        last_ = now;
    }
}

double Stopwatch::median() const
{
    std::vector<double> later(groups_.begin() + static_cast<long>(groups_.size() / 10), groups_.end());
    if (later.empty()) {
        throw std::runtime_error("too few rounds to measure");
    }
    std::nth_element(later.begin(), later.begin() + static_cast<long>(later.size() / 2), later.end());
    return later[later.size() / 2];
}

// ---- without Fledge

double req_rep(const std::string &transport, std::uint64_t n)
{
    const std::string at =
        transport == "tcp" ? "tcp://127.0.0.1:*" : "ipc://@fledge-bench-bare-" + std::to_string(getpid());
    std::array<int, 2> address{};
    if (pipe(address.data())) {
        throw std::runtime_error("no pipe");
    }
    Children children;
    children.start([&] {
        zmq::context_t context;
        zmq::socket_t socket(context, zmq::socket_type::rep);
        std::array<char, 200> text{};
        if (read(address[0], text.data(), text.size() - 1) <= 0) {
            throw std::runtime_error("no address came");
        }
        socket.connect(text.data());
        zmq::message_t message;
        for (std::uint64_t i = 0; i < n; i++) {
            (void)socket.recv(message);
            socket.send(message, zmq::send_flags::none);
        }
    });
    zmq::context_t context;
    zmq::socket_t socket(context, zmq::socket_type::req);
    socket.bind(at);
    const std::string bound = socket.get(zmq::sockopt::last_endpoint);
    if (write(address[1], bound.c_str(), bound.size()) < 0) {
        throw std::runtime_error("no address went");
    }
    close(address[0]);
    close(address[1]);
    std::array<std::byte, 64> bytes{};
    zmq::message_t message;
    Stopwatch watch;
    for (std::uint64_t i = 0; i < n; i++) {
        watch.lap();
        socket.send(zmq::buffer(bytes), zmq::send_flags::none);
        (void)socket.recv(message);
    }
    children.join();
    return watch.median();
}

namespace {

void futex_wait(std::atomic<std::uint32_t> &word, std::uint32_t seen)
{
    syscall(SYS_futex, &word, FUTEX_WAIT, seen, nullptr, nullptr, 0);
}

void futex_wake(std::atomic<std::uint32_t> &word)
{
    syscall(SYS_futex, &word, FUTEX_WAKE, INT_MAX, nullptr, nullptr, 0);
}

struct alignas(64) Word {
    std::atomic<std::uint32_t> value{0};
};

struct Barrier {
    Word round, missing, done;
};

} // namespace

double futex_barrier(std::uint64_t k, std::uint64_t n)
{
    void *memory = mmap(nullptr, sizeof(Barrier), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (memory == MAP_FAILED) {
        throw std::runtime_error("no shared memory");
    }
    Barrier &barrier = *new (memory) Barrier;
    Children children;
    for (std::uint64_t i = 0; i < k; i++) {
        children.start([&] {
            for (std::uint32_t seen = 0; seen < n; seen++) {
                while (barrier.round.value == seen) {
                    futex_wait(barrier.round.value, seen);
                }
                if (barrier.missing.value.fetch_sub(1) == 1) {
                    barrier.done.value = seen + 1;
                    futex_wake(barrier.done.value);
                }
            }
        });
    }
    Stopwatch watch;
    for (std::uint32_t i = 0; i < n; i++) {
        watch.lap();
        barrier.missing.value = static_cast<std::uint32_t>(k);
        barrier.round.value = i + 1;
        futex_wake(barrier.round.value);
        while (barrier.done.value != i + 1) {
            futex_wait(barrier.done.value, i);
        }
    }
    children.join();
    munmap(memory, sizeof(Barrier));
    return watch.median();
}

} // namespace fledge::bench
