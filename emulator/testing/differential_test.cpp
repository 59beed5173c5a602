// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "emulator/testing/differential.h"
#include "emulator/testing/qemu.h"

namespace fledge::emulator::testing {
namespace differential_test {

TEST(Differential, EnginesAgreeWithOneAnotherAndWithQemu)
{
    const std::string without = without_qemu();
    for (std::uint64_t seed = 1; seed <= 3; ++seed)
        EXPECT_EQ(compare_seed(seed, 300, without.empty()), "") << "seed " << seed;
    if (!without.empty())
        GTEST_SKIP() << without;
}

TEST(Differential, ASeedAlwaysMakesTheSameProgram)
{
    EXPECT_EQ(make_stream({.seed = 5, .blocks = 20}).image, make_stream({.seed = 5, .blocks = 20}).image);
    EXPECT_NE(make_stream({.seed = 5, .blocks = 20}).image, make_stream({.seed = 6, .blocks = 20}).image);
}

// The comparison must see the smallest difference.
TEST(Differential, OneBitIsNoticed)
{
    const Stream stream = make_stream({.seed = 5, .blocks = 20});
    std::vector<std::uint8_t> other = stream.image;
    other[blocks_base - ram_base + 7 * sizeof(Block) + offsetof(Block, left) + offsetof(Record, fsr) + 3] ^= 1;
    EXPECT_EQ(compare(stream, stream.image, stream.image), "");
    EXPECT_THAT(compare(stream, stream.image, other), ::testing::HasSubstr("fsr is 00000001, expected 00000000"));
    EXPECT_THAT(compare(stream, stream.image, other), ::testing::HasSubstr("block 7 "));
}

} // namespace differential_test
} // namespace fledge::emulator::testing
