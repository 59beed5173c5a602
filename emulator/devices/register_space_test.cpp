// SPDX-License-Identifier: Apache-2.0
#include "emulator/devices/register_space.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "emulator/error.h"
#include "emulator/testing/fake_host.h"
#include "emulator/testing/register_boards.h"
#include "tests/error_of.h"

namespace fledge::emulator {
namespace register_space_test {

using namespace testing;
using Lines = std::vector<std::uint32_t>;

struct Bench {
    explicit Bench(RegisterSpace::Settings settings) : space("registers", host, std::move(settings))
    {
        space.make(boards);
    }
    const RegisterWindow *window(std::size_t i) { return &space.windows()[i]; }
    FakeHost host;
    RegisterSpace space;
};

TEST(RegisterSpace, boards_lie_at_the_distances_of_their_bases)
{
    Bench b({.size = 0x1000, .tick = 10});
    register_store(b.window(1), 32, 0x01020304);
    EXPECT_EQ(b.space.read(other_board_at + 32), 0x01020304u);
    b.space.write(other_board_at + 36, 0x05060708);
    EXPECT_EQ(register_load(b.window(1), 36), 0x05060708u);
    EXPECT_EQ(b.space.read(108), 0u) << "between the boards";
    EXPECT_EQ(b.space.clock(), b.window(0));
}

TEST(RegisterSpace, a_board_of_the_other_byte_order_keeps_its_bytes)
{
    Bench b({.size = 0x1000, .tick = 10});
    RegisterBoard little = other_board;
    little.big_endian = 0;
    const RegisterBoard *both[] = {&clock_board, &little};
    b.space.make(both);
    register_store(b.window(1), 32, 0x01020304);
    EXPECT_EQ(b.space.read(other_board_at + 32), 0x04030201u) << "the program swaps by itself";
}

TEST(RegisterSpace, a_tick_is_shown_when_its_time_comes)
{
    Bench b({.size = 0x1000, .tick = 10});
    register_clock_start(b.window(0), {7, 1});
    EXPECT_EQ(b.space.read(REGISTER_CLOCK_TICK), 0u);
    b.space.announce();
    b.space.tick();
    EXPECT_EQ(b.space.read(REGISTER_CLOCK_TICK), 1u);
    EXPECT_EQ(b.host.take(), Lines{10});
    unsigned answers = 0;
    b.space.done = [&] { answers++; };
    b.space.write(REGISTER_CLOCK_DONE, 1);
    EXPECT_EQ(answers, 1u);
    EXPECT_TRUE(register_clock_is_done(b.window(0)));
}

TEST(RegisterSpace, bits_of_a_register_stick_for_the_program_and_for_what_it_writes)
{
    Bench b({.size = 0x1000, .tick = 10});
    register_store(b.window(1), 32, 0xFF00);
    b.space.stick(other_board_at + 32, 1, 0x100);
    EXPECT_EQ(b.space.read(other_board_at + 32), 0xFE01u);
    b.space.write(other_board_at + 32, 0x300);
    EXPECT_EQ(register_load(b.window(1), 32), 0x201u);
    b.space.write(other_board_at + 36, 0x300);
    EXPECT_EQ(register_load(b.window(1), 36), 0x300u) << "the next one works";
    b.space.reset();
    EXPECT_EQ(b.space.read(other_board_at + 32), 0x201u) << "a reset mends nothing";
    const std::vector<std::byte> kept(b.space.state().begin(), b.space.state().end());
    b.space.stick(other_board_at + 32, 0, 0);
    b.space.write(other_board_at + 32, 0x300);
    EXPECT_EQ(b.space.read(other_board_at + 32), 0x300u);
    std::ranges::copy(kept, b.space.state().begin());
    EXPECT_EQ(b.space.read(other_board_at + 32), 0x201u) << "a snapshot has the fault";
}

TEST(RegisterSpace, lines_of_the_outside_interrupt_or_reset)
{
    Bench b({.size = 0x1000, .tick = 10, .interrupt = 11, .lines = {{"other", 1, 12}, {"clock", 3, 0}}});
    register_raise(b.window(0), 2);
    register_raise(b.window(1), 1);
    register_raise(b.window(1), 1);
    register_raise(b.window(0), 0);
    b.space.announce();
    EXPECT_EQ(b.host.take(), (Lines{11, 12})) << "a tick has an interrupt of its own";
    b.space.announce();
    EXPECT_EQ(b.host.take(), Lines{});
    register_raise(b.window(0), 3);
    b.space.announce();
    EXPECT_EQ(b.host.resets, 1u);
}

TEST(RegisterSpace, a_board_may_have_an_interrupt_of_its_own)
{
    Bench b({.size = 0x1000, .tick = 10, .interrupt = 11, .lines = {{"other", 1, 12}}});
    RegisterBoard clock = clock_board, other = other_board;
    clock.base = 0xA0001000;
    other.base = 0xA0000F00;
    clock.level = 13;
    other.level = 14;
    const RegisterBoard *both[] = {&clock, &other};
    b.space.make(both);
    register_store(b.window(0), 36, 0x01020304);
    EXPECT_EQ(b.space.read(0x100 + 36), 0x01020304u) << "the lowest base is that of the space";
    register_raise(b.window(0), 0);
    register_raise(b.window(0), 1);
    register_raise(b.window(1), 0);
    register_raise(b.window(1), 1);
    b.space.announce();
    EXPECT_EQ(b.host.take(), (Lines{13, 14, 12})) << "but for a tick, and what the machine's file lists";
}

TEST(RegisterSpace, lines_that_flight_raises_do_not_interrupt_it)
{
    Bench b({.size = 0x1000, .tick = 10, .interrupt = 11});
    b.space.write(other_board_at, 1);
    b.space.write(REGISTER_CLOCK_DONE, 0);
    register_raise(b.window(1), 1);
    b.space.announce();
    EXPECT_EQ(b.host.take(), Lines{11});
}

TEST(RegisterSpace, a_copy_of_its_state_has_the_boards_and_what_was_seen)
{
    Bench b({.size = 0x1000, .tick = 10, .interrupt = 11});
    register_raise(b.window(1), 0);
    const auto state = b.space.state();
    const std::vector<std::byte> copy(state.begin(), state.end());
    b.space.announce();
    EXPECT_EQ(b.host.take(), Lines{11});
    register_store(b.window(1), 32, 5);
    std::ranges::copy(copy, b.space.state().begin());
    EXPECT_EQ(register_load(b.window(1), 32), 0u);
    b.space.announce();
    EXPECT_EQ(b.host.take(), Lines{11});
}

TEST(RegisterSpace, mistakes_are_refused)
{
    FakeHost host;
    RegisterSpace small("registers", host, {.size = 128, .tick = 10});
    RegisterSpace wrong("registers", host, {.size = 0x1000, .tick = 10, .lines = {{"other", 2, 12}}});
    const auto what = [](RegisterSpace &space) -> std::string { return error_of<Error>([&] { space.make(boards); }); };
    EXPECT_EQ(what(small), "the board `other` ends 192 bytes behind the lowest base; the register space has 128");
    EXPECT_EQ(what(wrong), "the register space has no line 2 of a board `other`; it has: clock with 4 lines, other "
                           "with 2 lines");
}

} // namespace register_space_test
} // namespace fledge::emulator
