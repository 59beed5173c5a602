// SPDX-License-Identifier: Apache-2.0
#include "emulator/testing/fuzz.h"

#include <gtest/gtest.h>

namespace fledge::emulator::testing {
namespace emulator_fuzz_test {

TEST(Fuzz, WordsHaveTheNamesThatCapstoneGivesThem)
{
    for (std::uint64_t seed = 1; seed <= 10; ++seed)
        EXPECT_EQ(fuzz_decoder(seed), "") << "seed " << seed;
}

TEST(Fuzz, AnyStateAndMemoryGoesTheSameWayOnAllEngines)
{
    for (std::uint64_t seed = 1; seed <= 60; ++seed)
        EXPECT_EQ(fuzz_processor(seed), "") << "seed " << seed;
}

TEST(Fuzz, DamagedFilesAreRefusedOrRun)
{
    for (std::uint64_t seed = 1; seed <= 200; ++seed)
        EXPECT_EQ(fuzz_files(seed), "") << "seed " << seed;
}

} // namespace emulator_fuzz_test
} // namespace fledge::emulator::testing
