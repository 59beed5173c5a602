// SPDX-License-Identifier: Apache-2.0
// Many programs around one controller: it raises its limit of open files for them, or says what the system allows.
// Forty programs by default; all that this machine bears:
//
//     FLEDGE_SCALE_PROGRAMS=500 cosim_scale_test        also FLEDGE_SCALE_TRANSPORT=shm, tcp; prints the time to start
#include "cosim/protocol/testing/patience.h"
#include "cosim/router/testing/nodes.h"

#include <gtest/gtest.h>

#include <array>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>

namespace fledge::cosim {
namespace scale_test {

using namespace testing_nodes;
using Clock = std::chrono::steady_clock;

std::string setting(const char *name, const char *otherwise)
{
    const char *value = std::getenv(name);
    return value ? value : otherwise;
}

rlimit files()
{
    rlimit limit{};
    EXPECT_EQ(getrlimit(RLIMIT_NOFILE, &limit), 0);
    return limit;
}

/// Run a function in a new program, before this one has threads, and return the id of its process.
template <class Work> pid_t start(Work work)
{
    const pid_t pid = fork();
    if (pid == 0) {
        prctl(PR_SET_PDEATHSIG, SIGKILL);
        std::string why;
        try {
            why = work();
        } catch (const std::exception &error) {
            why = error.what();
        }
        if (!why.empty()) {
            std::fprintf(stderr, "a program: %s\n", why.c_str());
        }
        _exit(why.empty() ? 0 : 1);
    }
    return pid;
}

int ended(pid_t pid)
{
    int status = -1;
    waitpid(pid, &status, 0);
    return status;
}

TEST(Scale, AControllerTakesAsManyProgramsAsTheSystemAllows)
{
    const std::size_t n = std::stoul(setting("FLEDGE_SCALE_PROGRAMS", "40"));
    const std::string transport = setting("FLEDGE_SCALE_TRANSPORT", "shm");
    const rlimit before = files();
    const rlimit few{64, before.rlim_max}; // enough for a node, and too few for the controller of forty
    ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &few), 0);
    const auto begun = Clock::now();
    std::array<int, 2> go{};
    ASSERT_EQ(pipe(go.data()), 0);
    std::vector<NodeConfig> nodes;
    std::vector<pid_t> pids;
    std::mt19937 random(7);
    for (std::size_t i = 0; i < n; i++) {
        nodes.push_back({std::to_string(i), Policy::abort});
        const std::chrono::milliseconds delay{random() % 50}; // they come in any order
        pids.push_back(start([&] {
            close(go[1]);
            std::array<char, 200> address{};
            if (read(go[0], address.data(), address.size()) != static_cast<ssize_t>(address.size())) {
                return std::string("no address came");
            }
            std::this_thread::sleep_for(delay);
            Counter node("/" + std::to_string((i + 1) % n) + "/count", "/" + std::to_string(i) + "/count",
                         Latency::next_exchange);
            zmq::context_t context;
            std::string why = serve(context, address.data(), std::to_string(i), node, "", patience);
            // At the k-th instant it sees what its neighbour wrote at the one before: k.
            return why.empty() && node.received != 9 ? "it heard " + std::to_string(node.received) : why;
        }));
    }
    RouterConfig config;
    config.address = transport == "tcp" ? "tcp://127.0.0.1:*" : "ipc://@fledge-scale-" + std::to_string(getpid());
    config.sharing = transport == "shm" ? Sharing::required : Sharing::forbidden;
    {
        zmq::context_t context;
        Router router(context, config_of(nodes, 90), config);
        EXPECT_GT(files().rlim_cur, few.rlim_cur);
        EXPECT_EQ(files().rlim_max, before.rlim_max);
        std::array<char, 200> address{};
        std::copy(router.address().begin(), router.address().end(), address.begin());
        for (std::size_t i = 0; i < n; i++) { // a record for each program, in any order
            ASSERT_EQ(write(go[1], address.data(), address.size()), static_cast<ssize_t>(address.size()));
        }
        bool started = false;
        EXPECT_EQ(router.run([&] {
            if (!std::exchange(started, started || router.controller().running()) && started) {
                std::printf("%zu programs were there after %.2f s\n", n,
                            std::chrono::duration<double>(Clock::now() - begun).count());
            }
            return true;
        }),
                  "");
        std::printf("%zu programs were at the end after %.2f s\n", n,
                    std::chrono::duration<double>(Clock::now() - begun).count());
    }
    close(go[0]);
    close(go[1]);
    for (const pid_t pid : pids) {
        EXPECT_EQ(ended(pid), 0);
    }
    setrlimit(RLIMIT_NOFILE, &before);
}

TEST(Scale, TooFewFilesAreAnErrorBeforeTheRun)
{
    EXPECT_EQ(ended(start([]() -> std::string {
                  const rlimit few{64, 64};
                  setrlimit(RLIMIT_NOFILE, &few);
                  std::vector<NodeConfig> nodes(500);
                  for (std::size_t i = 0; i < nodes.size(); i++) {
                      nodes[i].name = std::to_string(i);
                  }
                  RouterConfig config;
                  config.address = "ipc://@fledge-scale-few-" + std::to_string(getpid());
                  zmq::context_t context;
                  try {
                      Router router(context, config_of(nodes, 90), config);
                  } catch (const LinkError &error) {
                      const std::string expected = "500 nodes need 4100 open files in the controller's program; this "
                                                   "system allows it 64 (ulimit -Hn; ";
                      return std::string(error.what()).starts_with(expected) ? "" : error.what();
                  }
                  return "the controller accepts 500 nodes";
              })),
              0);
}

} // namespace scale_test
} // namespace fledge::cosim
