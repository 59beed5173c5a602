// SPDX-License-Identifier: Apache-2.0
// Frames through shared memory: all arrive as they were sent, whatever their lengths and the turns of the
// two sides; and whatever a peer writes into the memory, the other side says so or goes on.
#include "cosim/transport/shared_channel.h"

#include "cosim/protocol/testing/patience.h"
#include "cosim/transport/link.h"
#include "tests/error_of.h"

#include <gtest/gtest.h>

#include <csignal>
#include <cstdio>
#include <cstring>
#include <fcntl.h>
#include <poll.h>
#include <random>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>

namespace fledge::cosim {
namespace shared_channel_test {

using namespace std::chrono_literals;

/// The frame's number decides its length and bytes.
Bytes frame_of(std::uint32_t number)
{
    std::mt19937 random(number);
    const std::size_t size = random() % 50 ? 1 + random() % 300 : 1 + random() % 100'000;
    Bytes bytes(size);
    for (std::byte &b : bytes) {
        b = static_cast<std::byte>(random());
    }
    return bytes;
}

struct Ends {
    explicit Ends(Limits limits = {}, std::chrono::nanoseconds spin = 0ns)
        : controller(wake_up, 3, spin, limits), node(controller.path(), controller.nonce(), limits)
    {
    }
    WakeUp wake_up;
    SharedChannel controller, node;
};

/// Sleep until the node has rung, as a controller does, in either way.
void sleep(WakeUp &wake_up, const SharedChannel &channel)
{
    static std::mt19937 random;
    const bool rests = random() % 2;
    wake_up.wake();
    wake_up.arm(rests ? WakeUp::rests : WakeUp::polls);
    pollfd fd{wake_up.fd(), POLLIN, 0};
    bool rang = false;
    if (!channel.pending() && rests) {
        wake_up.rest(patience);
    } else if (!channel.pending()) {
        rang = poll(&fd, 1, static_cast<int>(std::chrono::milliseconds(patience).count())) == 1;
    }
    wake_up.disarm(rang);
}

TEST(SharedChannel, FramesOfAnyLengthArriveInOrder)
{
    for (const auto spin : {0ns, 20'000ns}) {
        const auto start = std::chrono::steady_clock::now(); // a wake that is lost costs all of them
        Ends ends({}, spin);
        constexpr std::uint32_t n = 3000;
        // Each side sends all without waiting for the other, so both rings are full most of the time.
        std::thread node([&] {
            std::uint32_t sent = 0, got = 0;
            for (Bytes frame; got < n || sent < n || !ends.node.flush();) {
                if (sent < n && ends.node.flush()) {
                    ends.node.send(frame_of(sent++));
                } else if (ends.node.receive(frame)) {
                    ASSERT_EQ(frame, frame_of(got++ + n));
                } else if (sent == n || !ends.node.flush()) {
                    ends.node.wait(patience);
                }
            }
        });
        std::uint32_t sent = 0, got = 0;
        for (Bytes frame; got < n || sent < n || !ends.controller.flush();) {
            if (sent < n && ends.controller.flush()) {
                ends.controller.send(frame_of(n + sent++));
            } else if (ends.controller.receive(frame)) {
                ASSERT_EQ(frame, frame_of(got++));
            } else if (sent == n || !ends.controller.flush()) {
                sleep(ends.wake_up, ends.controller);
            }
        }
        ends.wake_up.wake();
        node.join();
        EXPECT_LT(std::chrono::steady_clock::now() - start, patience);
    }
}

TEST(SharedChannel, ASleepingProgramIsWokenByTheOther)
{
    WakeUp wake_up;
    SharedChannel channel(wake_up, 300, 0ns, {});
    const std::string path = channel.path();
    const pid_t child = fork();
    if (child == 0) {
        try {
            SharedChannel node(path, wake_up.nonce(), {});
            Bytes frame;
            for (int i = 0; i < 2000; i++) {
                while (!node.receive(frame)) {
                    node.wait(patience);
                }
                node.send(frame);
            }
            _exit(0);
        } catch (const std::exception &error) {
            std::fprintf(stderr, "%s\n", error.what());
            _exit(1);
        }
    }
    const auto start = std::chrono::steady_clock::now();
    Bytes frame;
    for (std::uint32_t i = 0; i < 2000; i++) {
        channel.send(frame_of(i));
        while (!channel.receive(frame)) {
            sleep(wake_up, channel);
        }
        ASSERT_EQ(frame, frame_of(i));
    }
    EXPECT_LT(std::chrono::steady_clock::now() - start, patience);
    int status = -1;
    waitpid(child, &status, 0);
    EXPECT_EQ(status, 0);
}

std::string refusal(const std::string &path, std::uint64_t nonce)
{
    return error_of<LinkError>([&] { SharedChannel(path, nonce, {}); });
}

TEST(SharedChannel, MemoryOfAnotherOwnerIsRefused)
{
    WakeUp wake_up;
    SharedChannel channel(wake_up, 300, 0ns, {});
    const std::string path = channel.path();
    EXPECT_EQ(refusal(path, channel.nonce()), "");
    EXPECT_EQ(refusal(path, channel.nonce() + 1), "no shared memory: " + path + " is another one");
    EXPECT_EQ(refusal("/dev/null", 1), "no shared memory: /dev/null is no shared memory");
    EXPECT_EQ(refusal(wake_up.pipe_path(), 1), "no shared memory: " + wake_up.pipe_path() + " is no shared memory");
    EXPECT_EQ(refusal(wake_up.memory_path(), wake_up.nonce()),
              "no shared memory: " + wake_up.memory_path() + " is no shared memory of this size");
    EXPECT_EQ(refusal("", 1), "no shared memory: : No such file or directory");

    // Of the same size, but not sealed: it could be taken away from under its readers.
    struct stat s {};
    ASSERT_EQ(stat(path.c_str(), &s), 0);
    const int fd = memfd_create("test", MFD_ALLOW_SEALING);
    ASSERT_EQ(ftruncate(fd, s.st_size), 0);
    EXPECT_EQ(refusal(path_of(fd), 0), "no shared memory: " + path_of(fd) + " may change its size");
    ASSERT_EQ(fcntl(fd, F_ADD_SEALS, F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL), 0);
    EXPECT_EQ(refusal(path_of(fd), 0), "no shared memory: " + path_of(fd) + " is another one");
    close(fd);

    channel.hide();
    EXPECT_EQ(channel.path(), "");
    EXPECT_NE(refusal(path, channel.nonce()), "");
}

TEST(SharedChannel, ALongerFrameThanTheLimitIsRefused)
{
    Ends ends(Limits{1000, 255, 1000, 100});
    EXPECT_THROW(ends.node.send(Bytes(1001)), ProtocolError);
    ends.node.send(Bytes(1000));
    Bytes frame;
    EXPECT_TRUE(ends.controller.receive(frame));

    WakeUp wake_up;
    SharedChannel controller(wake_up, 0, 0ns, Limits{1000, 255, 1000, 100});
    SharedChannel node(controller.path(), controller.nonce(), {});
    node.send(Bytes(1001));
    EXPECT_THROW(controller.receive(frame), ProtocolError);
}

TEST(SharedChannel, NonsenseInTheMemoryIsAProtocolError)
{
    std::mt19937_64 random(7);
    int errors = 0, frames = 0;
    for (int round = 0; round < 500; round++) {
        Ends ends;
        struct stat s {};
        ASSERT_EQ(stat(ends.controller.path().c_str(), &s), 0);
        SharedMemory hostile = SharedMemory::open(ends.controller.path(), static_cast<std::size_t>(s.st_size));
        const auto bytes = hostile.bytes();
        ends.node.send(frame_of(1));
        try {
            for (int i = 0; i < 20; i++) {
                // The counters stand before the rings: hit them more often than their share.
                const std::size_t size = random() % 4 ? 512 : bytes.size();
                const std::uint64_t value = random() >> random() % 64;
                std::memcpy(bytes.data() + random() % (size / 8) * 8, &value, 8);
                Bytes frame;
                while (ends.controller.receive(frame)) {
                    frames++;
                }
                ends.controller.pending();
                ends.controller.send(frame_of(static_cast<std::uint32_t>(i)));
            }
        } catch (const ProtocolError &) {
            errors++;
        }
    }
    EXPECT_GT(errors, 50);
    EXPECT_GT(frames, 100);
}

} // namespace shared_channel_test
} // namespace fledge::cosim
