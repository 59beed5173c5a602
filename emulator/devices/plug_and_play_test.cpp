// SPDX-License-Identifier: Apache-2.0
#include "emulator/devices/plug_and_play.h"

#include <gtest/gtest.h>

namespace fledge::emulator {
namespace plug_and_play_test {

TEST(PlugAndPlay, entries_have_the_words_of_the_bus)
{
    PlugAndPlay ahb("ahb"), apb("apb");
    ahb.add_master({{0x01, 0x003, 0}});
    ahb.add_slave({{0x01, 0x006, 0}, 0x80000000, 0x100000, 0});
    ahb.add_slave({{0xF1, 0x001, 0}, 0xA0000000, 0x280000, 10});
    apb.add_apb({{0x01, 0x00D, 3}, 0x80000200, 0x100, 0});
    apb.add_apb({{0x01, 0x011, 1}, 0x80000300, 0x100, 8});
    EXPECT_EQ(ahb.read(0x000), 0x01003000u);
    EXPECT_EQ(ahb.read(0x800), 0x01006000u);
    EXPECT_EQ(ahb.read(0x810), 0x8000FFF2u);
    EXPECT_EQ(ahb.read(0x820), 0xF100100Au);
    EXPECT_EQ(ahb.read(0x830), 0xA000FFC2u) << "2.5 MiB count as 4";
    EXPECT_EQ(ahb.read(0x840), 0u);
    EXPECT_EQ(apb.read(0x00), 0x0100D060u);
    EXPECT_EQ(apb.read(0x04), 0x0020FFF1u);
    EXPECT_EQ(apb.read(0x08), 0x01011028u);
    EXPECT_EQ(apb.read(0x0C), 0x0030FFF1u);
    apb.write(0x00, 0);
    EXPECT_EQ(apb.read(0x00), 0x0100D060u);
}

} // namespace plug_and_play_test
} // namespace fledge::emulator
