// SPDX-License-Identifier: Apache-2.0
#include "emulator/machine.h"

#include <gtest/gtest.h>

#include "emulator/board.h"

namespace fledge::emulator {
namespace {

constexpr const char *text = R"(
name = "test"
clock = 1_000_000
[ram]
base = 0x40000000
size = 0x10000
[[device]]
kind = "irqmp"
address = 0x80000200
)";

TEST(Machine, a_loop_runs_until_its_time)
{
    Machine machine(BoardDescription::parse(text, "test.toml"), EngineKind::interpreter);
    const std::array<std::uint8_t, 8> loop{0x10, 0x80, 0x00, 0x00, 0x01, 0x00, 0x00, 0x00}; // ba .; nop
    ASSERT_TRUE(machine.poke(0x40000000, std::as_bytes(std::span(loop))));
    EXPECT_EQ(machine.run_until(1000), StopReason::time);
    EXPECT_EQ(machine.now(), 1000);
    EXPECT_EQ(machine.instructions(), 1u);
}

} // namespace
} // namespace fledge::emulator
