// SPDX-License-Identifier: Apache-2.0
#include "emulator/devices/apbuart.h"

#include <gtest/gtest.h>

#include "emulator/testing/fake_host.h"

namespace fledge::emulator {
namespace apbuart_test {

using testing::FakeHost;
using Lines = std::vector<std::uint32_t>;

struct Bench {
    explicit Bench(bool timed) : uart("uart", host, {.interrupt = 3, .baud = timed})
    {
        uart.transmit = [this](std::uint8_t byte) { sent += static_cast<char>(byte); };
    }
    void send(std::string_view text)
    {
        for (const char c : text) {
            uart.write(0x00, static_cast<std::uint8_t>(c));
        }
    }
    FakeHost host;
    Apbuart uart;
    std::string sent;
};

TEST(Apbuart, bytes_leave_at_once)
{
    Bench b(false);
    b.send("hello");
    EXPECT_EQ(b.sent, "hello");
    EXPECT_EQ(b.uart.read(0x04) & 0x6, 0x6u) << "empty";
    EXPECT_EQ(b.uart.next_event(), never);
}

TEST(Apbuart, a_byte_takes_the_time_of_ten_bits)
{
    Bench b(true);
    b.uart.write(0x0C, 9); // 80 cycles a bit
    b.send("abc");
    EXPECT_EQ(b.uart.read(0x04) >> 20 & 0x3F, 2u) << "one is in the shift register";
    b.host.run(b.uart, 799);
    EXPECT_EQ(b.sent, "");
    b.host.run(b.uart, 800);
    EXPECT_EQ(b.sent, "a");
    b.host.run(b.uart, 2400);
    EXPECT_EQ(b.sent, "abc");
    EXPECT_EQ(b.uart.read(0x04) & 0x6, 0x6u);
}

TEST(Apbuart, a_full_fifo_loses_what_comes)
{
    Bench b(true);
    b.send(std::string(32, 'x'));
    EXPECT_EQ(b.uart.read(0x04) & 1u << 9, 1u << 9);
    b.send("y");
    b.host.run(b.uart, 1'000'000);
    EXPECT_EQ(b.sent, std::string(32, 'x'));
}

TEST(Apbuart, a_byte_that_comes_interrupts_and_is_read_once)
{
    Bench b(false);
    b.uart.write(0x08, 1 | 4);
    const std::uint8_t bytes[] = {0x41, 0x42};
    EXPECT_EQ(b.uart.receive(bytes), 2u);
    EXPECT_EQ(b.host.take(), Lines{3});
    EXPECT_EQ(b.uart.read(0x04) & (1 | 1u << 8 | 1u << 10), 1u) << "neither half full nor full";
    EXPECT_EQ(b.uart.read(0x00), 0x41u);
    EXPECT_EQ(b.uart.read(0x00), 0x42u);
    EXPECT_EQ(b.uart.read(0x04) & 1, 0u);
    const std::vector<std::uint8_t> many(32);
    b.uart.receive(std::span(many).first(16));
    EXPECT_EQ(b.uart.read(0x04) & (1 | 1u << 8 | 1u << 10), 1u | 1u << 8);
    b.uart.receive(std::span(many).first(16));
    EXPECT_EQ(b.uart.read(0x04) & (1 | 1u << 8 | 1u << 10), 1u | 1u << 8 | 1u << 10);
    EXPECT_EQ(b.uart.read(0x04) >> 26, 32u);
    b.uart.write(0x08, 0);
    EXPECT_EQ(b.uart.receive(bytes), 0u) << "the receiver is off";
}

TEST(Apbuart, loops_back_and_interrupts_when_a_byte_has_left)
{
    Bench b(false);
    b.uart.write(0x08, 1 | 2 | 8 | 1u << 7);
    b.send("z");
    EXPECT_EQ(b.sent, "");
    EXPECT_EQ(b.uart.read(0x00), std::uint32_t{'z'});
    EXPECT_EQ(b.host.take(), Lines{3});
    b.uart.reset();
    b.send("z");
    EXPECT_EQ(b.sent, "z");
}

TEST(Apbuart, a_transmitter_that_is_off_keeps_the_bytes)
{
    for (const bool timed : {false, true}) {
        Bench b(timed);
        b.uart.write(0x08, 1);
        b.send(std::string(40, 'a'));
        EXPECT_EQ(b.uart.read(0x04) >> 20 & 63, 32u);
        EXPECT_EQ(b.uart.read(0x04) & 0x206, 0x202u) << "full; the shift register is empty, the FIFO is not";
        EXPECT_EQ(b.uart.next_event(), never);
        b.uart.write(0x08, 2);
        b.host.run(b.uart, 1'000'000);
        EXPECT_EQ(b.sent, std::string(32, 'a'));
        EXPECT_EQ(b.uart.read(0x04) & 6, 6u);
    }
}

} // namespace apbuart_test
} // namespace fledge::emulator
