// SPDX-License-Identifier: Apache-2.0
#include "emulator/devices/irqmp.h"

#include <gtest/gtest.h>

namespace fledge::emulator {
namespace irqmp_test {

struct Bench {
    std::uint32_t shown = 0;
    Irqmp irqmp{"irqmp", [this](std::uint32_t level) { shown = level; }};
};

TEST(Irqmp, the_highest_line_that_is_not_masked_is_shown)
{
    Bench b;
    b.irqmp.write(0x40, 1u << 3 | 1u << 7);
    b.irqmp.raise(3);
    EXPECT_EQ(b.shown, 3u);
    b.irqmp.raise(9);
    EXPECT_EQ(b.shown, 3u) << "9 is masked";
    b.irqmp.raise(7);
    EXPECT_EQ(b.shown, 7u);
    EXPECT_EQ(b.irqmp.read(0x04), 1u << 3 | 1u << 7 | 1u << 9);
    b.irqmp.write(0x40, 0xFFFFFFFF);
    EXPECT_EQ(b.shown, 9u);
    EXPECT_EQ(b.irqmp.read(0x40), 0xFFFEu) << "there is no line 0";
}

TEST(Irqmp, an_acknowledged_line_is_not_pending)
{
    Bench b;
    b.irqmp.write(0x40, 0xFFFE);
    b.irqmp.raise(3);
    b.irqmp.raise(7);
    b.irqmp.acknowledge(7);
    EXPECT_EQ(b.shown, 3u);
    b.irqmp.write(0x0C, 1u << 3);
    EXPECT_EQ(b.shown, 0u);
    EXPECT_EQ(b.irqmp.read(0x04), 0u);
}

TEST(Irqmp, level_1_goes_first)
{
    Bench b;
    b.irqmp.write(0x00, 1u << 4);
    b.irqmp.write(0x40, 0xFFFE);
    b.irqmp.raise(4);
    b.irqmp.raise(12);
    EXPECT_EQ(b.shown, 4u);
    b.irqmp.acknowledge(4);
    EXPECT_EQ(b.shown, 12u);
}

TEST(Irqmp, a_forced_line_is_acknowledged_by_itself)
{
    Bench b;
    b.irqmp.write(0x40, 0xFFFE);
    b.irqmp.write(0x08, 1u << 5);
    b.irqmp.raise(5);
    EXPECT_EQ(b.shown, 5u);
    b.irqmp.acknowledge(5);
    EXPECT_EQ(b.irqmp.read(0x08), 0u);
    EXPECT_EQ(b.shown, 5u) << "the device's own request is left";
    b.irqmp.acknowledge(5);
    EXPECT_EQ(b.shown, 0u);
    b.irqmp.write(0x80, 1u << 6 | 1u << 9);
    b.irqmp.write(0x80, 1u << (16 + 9));
    EXPECT_EQ(b.irqmp.read(0x80), 1u << 6);
}

TEST(Irqmp, a_forced_line_that_is_masked_waits)
{
    Bench b;
    b.irqmp.write(0x08, 1u << 5);
    b.irqmp.write(0x80, 1u << 9);
    EXPECT_EQ(b.shown, 0u);
    b.irqmp.write(0x40, 1u << 5);
    EXPECT_EQ(b.shown, 5u);
}

TEST(Irqmp, a_stuck_line_comes_again_and_a_silent_one_never)
{
    Bench b;
    b.irqmp.write(0x40, 0xFFFE);
    b.irqmp.stick(1u << 8, 1u << 9);
    b.irqmp.raise(9);
    EXPECT_EQ(b.shown, 8u);
    b.irqmp.acknowledge(8);
    EXPECT_EQ(b.shown, 8u);
    b.irqmp.reset();
    EXPECT_EQ(b.shown, 0u) << "a reset masks it";
    b.irqmp.write(0x40, 0xFFFE);
    EXPECT_EQ(b.shown, 8u) << "but the fault stays";
    b.irqmp.stick(0, 0);
    EXPECT_EQ(b.shown, 0u);
}

} // namespace irqmp_test
} // namespace fledge::emulator
