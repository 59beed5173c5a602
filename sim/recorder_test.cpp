// SPDX-License-Identifier: Apache-2.0
#include "sim/recorder.h"

#include "sim/testing/toys.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdio>
#include <cstring>
#include <fstream>
#include <iterator>
#include <map>

namespace recorder_test {

using namespace fledge::sim;
using namespace fledge::sim::toys;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST(Recorder, TakesSamplesOnItsGridAndForgetsThemOnReset)
{
    Loop loop;
    auto log = loop.sim.recorder().record(loop.tank, *find_field(loop.tank->type(), "level"), 250 * ms);
    loop.sim.run_until(1000 * ms);
    // 250 and 750 ms are no instants: the sample comes with the next one. Recording adds none.
    EXPECT_THAT(log->times, ElementsAre(0, 300 * ms, 500 * ms, 800 * ms, 1000 * ms));
    Number sample;
    std::memcpy(&sample, log->bytes.data() + 2 * sizeof sample, sizeof sample);
    EXPECT_NEAR(sample.x, 6.0, 1e-12);
    EXPECT_EQ(log->topic(), "/world/tank/level");
    const auto half = loop.sim.snapshot();
    loop.sim.run_until(2000 * ms);
    loop.sim.restore(half);
    EXPECT_EQ(log->times.size(), 5u);
    loop.sim.run_until(1500 * ms);
    EXPECT_EQ(log->times.back(), 1500 * ms);
    loop.sim.reset();
    EXPECT_TRUE(log->times.empty());
    loop.sim.run_until(0);
    EXPECT_THAT(log->times, ElementsAre(0));
}

TEST(Recorder, ReservesMemoryForALongRunButNotForSomeModesOfIt)
{
    constexpr Ns century = 3'155'760'000'000 * ms;
    for (const bool only : {false, true}) {
        Loop loop;
        loop.sim.recorder().record(loop.tank, *find_field(loop.tank->type(), "level"), 0, true,
                                   only ? [] { return false; } : std::function<bool()>());
        if (only) {
            loop.sim.recorder().reserve(0, century, 1);
        } else {
            EXPECT_THROW(loop.sim.recorder().reserve(0, century, 1), SetupError);
        }
    }
}

/// Keeps the times at which it looked, and ends the run at one of them.
struct Looker : Watcher {
    void take(Ns t) override
    {
        times.push_back(t);
        stop = t == last;
    }
    void rewind(Ns now) override { went.push_back(now); }

    std::vector<Ns> times, went;
    Ns last = -1;
};

TEST(Recorder, AWatcherLooksOnItsGridAndMayEndTheRun)
{
    Loop loop;
    auto looker = std::make_shared<Looker>();
    looker->every = 250 * ms;
    looker->last = 500 * ms;
    loop.sim.recorder().watch(looker);
    EXPECT_FALSE(loop.sim.run_until(1000 * ms));
    EXPECT_EQ(loop.sim.time(), 500 * ms);
    const auto half = loop.sim.snapshot();
    EXPECT_TRUE(loop.sim.run_until(1000 * ms)); // it goes on
    EXPECT_THAT(looker->times, ElementsAre(0, 300 * ms, 500 * ms, 800 * ms, 1000 * ms));
    loop.sim.restore(half);
    loop.sim.reset();
    EXPECT_THAT(looker->went, ElementsAre(-1, 500 * ms, -1));
    EXPECT_TRUE(loop.sim.clone()->run_until(1000 * ms)); // which has no watcher
    EXPECT_EQ(looker->times.size(), 5u);
}

TEST(Recorder, AnArchiveHasChunksAndTheirIndex)
{
    Loop loop;
    loop.sim.recorder().record(loop.tank, *find_field(loop.tank->type(), "level"), 0);
    const std::string path = ::testing::TempDir() + "chunks.mcap";
    loop.sim.recorder().open_archive(path, {});
    loop.sim.run_until(1000 * ms);
    loop.sim.recorder().close_archive();
    std::ifstream file(path, std::ios::binary);
    const std::string bytes(std::istreambuf_iterator<char>(file), {});
    std::remove(path.c_str());
    std::map<int, int> records; // opcode -> how many, outside of chunks
    for (std::size_t at = 8; at + 9 + 8 <= bytes.size();) {
        std::uint64_t size;
        std::memcpy(&size, bytes.data() + at + 1, sizeof size);
        records[bytes[at]]++;
        at += 9 + size;
    }
    constexpr int message = 5, chunk = 6, message_index = 7, chunk_index = 8;
    EXPECT_EQ(records[message], 0);
    EXPECT_EQ(records[chunk], 1);
    EXPECT_EQ(records[message_index], 1) << "of the one channel";
    EXPECT_EQ(records[chunk_index], 1);
}

TEST(Recorder, SaysWhenTheDiskIsFullAndKeepsWhatIsReadable)
{
    Loop loop;
    for (const char *name : {"number", "product"}) {
        loop.sim.recorder().record(loop.control, *find_field(loop.control->type(), name), 0);
    }
    EXPECT_THAT(error_of([&] { loop.sim.recorder().open_archive("/nowhere/at/all.mcap", {}); }),
                HasSubstr("cannot write /nowhere/at/all.mcap: No such file or directory"));
    loop.sim.run_until(1000 * ms); // not the worse for it
    Loop second;
    const std::string path = ::testing::TempDir() + "one_at_a_time.mcap";
    loop.sim.recorder().open_archive(path, {});
    EXPECT_THAT(error_of([&] { second.sim.recorder().open_archive(path, {}); }),
                HasSubstr("cannot write " + path + ": another run writes " + path + ".part now"));
    EXPECT_THAT(error_of([&] { second.sim.recorder().archive_metadata("more", {}); }), HasSubstr("no archive is open"));
    loop.sim.recorder().archive_metadata("more", {{"key", "value"}});
    loop.sim.recorder().close_archive();
    std::remove(path.c_str());
}

} // namespace recorder_test
