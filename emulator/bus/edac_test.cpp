// SPDX-License-Identifier: Apache-2.0
#include "emulator/bus/edac.h"

#include <gtest/gtest.h>

namespace fledge::emulator {
namespace edac_test {

EdacFlips flipped(unsigned bit)
{
    return bit < 32 ? EdacFlips{1u << bit, 0} : EdacFlips{0, 1u << (bit - 32)};
}

TEST(Edac, each_single_flip_is_corrected)
{
    for (unsigned bit = 0; bit < 39; bit++) {
        std::uint32_t data;
        EXPECT_EQ(edac_decode(flipped(bit), data), EdacResult::corrected) << bit;
        EXPECT_EQ(data, flipped(bit).data) << bit;
    }
}

TEST(Edac, each_pair_of_flips_is_detected)
{
    for (unsigned a = 0; a < 39; a++) {
        for (unsigned b = a + 1; b < 39; b++) {
            std::uint32_t data;
            const EdacFlips both{flipped(a).data | flipped(b).data, flipped(a).check | flipped(b).check};
            EXPECT_EQ(edac_decode(both, data), EdacResult::uncorrectable) << a << ", " << b;
            EXPECT_EQ(data, 0u);
        }
    }
}

TEST(Edac, a_whole_word_is_clean_and_three_flips_may_deceive)
{
    std::uint32_t data;
    EXPECT_EQ(edac_decode({}, data), EdacResult::clean);
    // The check bits of data bit 0: it looks as if that bit were flipped.
    EXPECT_EQ(edac_decode({0, 7}, data), EdacResult::corrected);
    EXPECT_EQ(data, 1u);
}

} // namespace edac_test
} // namespace fledge::emulator
