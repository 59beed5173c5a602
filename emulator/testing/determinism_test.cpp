// SPDX-License-Identifier: Apache-2.0
#include "emulator/testing/determinism.h"

#include <gtest/gtest.h>

namespace fledge::emulator::testing {
namespace determinism_test {

TEST(Determinism, EnginesAndSlicesGiveTheSameTimesOfInterrupts)
{
    for (std::uint64_t seed = 1; seed <= 6; ++seed)
        EXPECT_EQ(compare_times(seed), "") << "seed " << seed;
}

TEST(Determinism, ASnapshotFromAnywhereContinuesTheSameOnAnyEngine)
{
    for (std::uint64_t seed = 11; seed <= 13; ++seed)
        EXPECT_EQ(compare_snapshots(seed, 4), "") << "seed " << seed;
}

} // namespace determinism_test
} // namespace fledge::emulator::testing
