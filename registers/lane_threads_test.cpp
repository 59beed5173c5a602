// SPDX-License-Identifier: Apache-2.0
// Lanes between two threads at full speed. threads_test.py runs it under the thread sanitizer too.
#include "registers/lane.h"

#include <algorithm>
#include <atomic>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "registers/testing/board.h"

namespace lane_threads_test {

using namespace fledge::registers::testing;

// A writer and a reader side by side: whatever is read is whole, in order, and nothing is both
// lost and unaccounted for.
void race(std::uint32_t flags, std::uint32_t capacity, std::uint32_t depth)
{
    constexpr std::uint32_t N = 20000;
    Shape shape{REGISTER_PACKET, flags, capacity, depth};
    shape.interrupt = 0;
    Bench bench({shape}, true);
    std::atomic<bool> ended = false;
    std::uint32_t refused = 0;
    std::thread writer([&] {
        std::vector<std::uint32_t> packet(capacity / 4);
        for (std::uint32_t i = 1; i <= N; i++) {
            std::fill(packet.begin(), packet.end(), i);
            refused += register_put(bench.window(), bench.lane(), packet.data(), capacity, 0) == REGISTER_FULL;
        }
        ended = true;
    });
    std::vector<std::uint32_t> packet(capacity / 4);
    std::uint32_t last = 0, taken = 0, handled = 0;
    for (bool end = false; !end;) {
        end = ended; // and once more after the end
        handled += register_handle(bench.window(), 0);
        RegisterInfo info;
        RegisterStatus status;
        do {
            status = register_take(bench.window(), bench.lane(), packet.data(), capacity, &info);
            if (status == REGISTER_OK) {
                taken++;
                EXPECT_GT(packet[0], last);
                last = packet[0];
                EXPECT_EQ(std::count(packet.begin(), packet.end(), last), static_cast<std::ptrdiff_t>(packet.size()));
            }
        } while (status == REGISTER_OK || status == REGISTER_BUSY);
    }
    writer.join();
    EXPECT_EQ(handled, N - refused);
    if (flags & QUEUED) {
        EXPECT_EQ(taken + register_lost(bench.window(), bench.lane()), N);
    }
    if (refused == 0) {
        EXPECT_EQ(last, N);
    }
}

TEST(LaneThreads, TheLastPacketIsNeverTorn)
{
    race(0, 256, 1);
}
TEST(LaneThreads, AQueueThatRefusesLosesNothingUncounted)
{
    race(QUEUED, 64, 8);
}
TEST(LaneThreads, AQueueThatOverwritesLosesNothingUncounted)
{
    race(QUEUED | OVERWRITE, 64, 8);
}

} // namespace lane_threads_test
