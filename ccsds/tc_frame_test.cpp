// SPDX-License-Identifier: Apache-2.0
// Telecommand frames and CLCWs: their bits, what is refused, and data in segments.
#include "ccsds/tc_frame.h"
#include "ccsds/testing/bits.h"

#include <gtest/gtest.h>

#include <random>
#include <string>
#include <vector>

namespace tc_frame_test {

using namespace ccsds::testing;

TEST(TcFrame, has_the_bits_of_the_standard)
{
    std::mt19937 random(1);
    for (int i = 0; i < 5000; i++) {
        const TcChannel channel{static_cast<std::uint16_t>(random() % 1024), static_cast<std::uint8_t>(random() % 64),
                                static_cast<std::uint8_t>(random() % 2), static_cast<std::uint8_t>(random() % 2)};
        const Bytes data = any_bytes(random, 1 + random() % tc_room(&channel));
        TcFrame frame{};
        frame.data = data.data();
        frame.n = data.size();
        frame.type = static_cast<std::uint8_t>(random() % 2 != 0 ? TC_BD : TC_AD);
        frame.number = static_cast<std::uint8_t>(random());
        frame.part = static_cast<std::uint8_t>(channel.segments ? random() % 4 : unsigned{SPACE_PACKET_WHOLE});
        frame.map = static_cast<std::uint8_t>(channel.segments ? random() % 64 : 0);
        Bytes bytes(TC_FRAME_MAX + 9, 0x55); // with what fills a codeblock
        const std::size_t size = tc_frame_write(&channel, &frame, bytes.data());
        ASSERT_EQ(size, 5 + data.size() + channel.segments + 2u * channel.check);
        ASSERT_EQ(bits(bytes, 5), "00" + bits(frame.type == TC_BD, 1) + "000" + bits(channel.spacecraft, 10) +
                                      bits(channel.virtual_channel, 6) +
                                      bits(static_cast<std::uint32_t>(size - 1), 10) + bits(frame.number, 8));
        if (channel.segments) {
            ASSERT_EQ(bits(bytes[5], 8), bits(frame.part, 2) + bits(frame.map, 6));
        }
        TcFrame read{};
        ASSERT_EQ(tc_frame_read(&channel, bytes.data(), bytes.size(), &read), CCSDS_OK);
        ASSERT_EQ(Bytes(read.data, read.data + read.n), data);
        ASSERT_EQ(std::tie(read.size, read.type, read.number, read.part, read.map),
                  std::tie(size, frame.type, frame.number, frame.part, frame.map));
        if (channel.check) {
            bytes[random() % size] ^= static_cast<std::uint8_t>(1 << random() % 8);
            ASSERT_NE(tc_frame_read(&channel, bytes.data(), size, &read), CCSDS_OK);
        }
    }
}

TEST(TcFrame, commands_to_the_receiver_itself)
{
    const TcChannel channel{0x3FF, 1, 1, 0};
    Bytes bytes(20);
    TcFrame read{};
    ASSERT_EQ(tc_control_write(&channel, TC_UNLOCK, 0, bytes.data()), 6u);
    EXPECT_EQ(Bytes(bytes.begin(), bytes.begin() + 6), (Bytes{0x33, 0xFF, 0x04, 0x05, 0x00, 0x00}));
    ASSERT_EQ(tc_frame_read(&channel, bytes.data(), 6, &read), CCSDS_OK);
    EXPECT_TRUE(read.type == TC_BC && read.control == TC_UNLOCK);
    ASSERT_EQ(tc_control_write(&channel, TC_SET, 0xAB, bytes.data()), 8u);
    EXPECT_EQ(Bytes(bytes.begin(), bytes.begin() + 8), (Bytes{0x33, 0xFF, 0x04, 0x07, 0x00, 0x82, 0x00, 0xAB}));
    ASSERT_EQ(tc_frame_read(&channel, bytes.data(), 8, &read), CCSDS_OK);
    EXPECT_TRUE(read.type == TC_BC && read.control == TC_SET && read.value == 0xAB);
    bytes[5] = 0x81; // no such command
    EXPECT_EQ(tc_frame_read(&channel, bytes.data(), 8, &read), CCSDS_TYPE);
    bytes[5] = 0x82;
    bytes[0] &= 0xDF; // in sequence, which commands never are
    EXPECT_EQ(tc_frame_read(&channel, bytes.data(), 8, &read), CCSDS_TYPE);
}

TEST(TcFrame, what_is_no_frame_of_the_channel_is_refused)
{
    const TcChannel channel{0x123, 5, 0, 0};
    const Bytes data{1, 2, 3};
    TcFrame frame{}, read{};
    frame.data = data.data();
    frame.n = data.size();
    Bytes good(8);
    ASSERT_EQ(tc_frame_write(&channel, &frame, good.data()), 8u);
    EXPECT_EQ(tc_frame_read(&channel, good.data(), 4, &read), CCSDS_SHORT);
    EXPECT_EQ(tc_frame_read(&channel, good.data(), 7, &read), CCSDS_LENGTH);
    const TcChannel another{0x124, 5, 0, 0}, elsewhere{0x123, 6, 0, 0};
    EXPECT_EQ(tc_frame_read(&another, good.data(), 8, &read), CCSDS_SPACECRAFT);
    EXPECT_EQ(tc_frame_read(&elsewhere, good.data(), 8, &read), CCSDS_CHANNEL);
    for (const std::uint8_t flag : {0x80, 0x40, 0x08, 0x04}) { // the version, and bits that must be 0
        Bytes bad = good;
        bad[0] |= flag;
        EXPECT_EQ(tc_frame_read(&channel, bad.data(), 8, &read), CCSDS_VERSION);
    }
    Bytes empty = good;
    empty[3] = 4;
    EXPECT_EQ(tc_frame_read(&channel, empty.data(), 8, &read), CCSDS_LENGTH);
    const Bytes large(TC_FRAME_MAX);
    frame.data = large.data();
    for (const std::size_t n : {std::size_t{0}, tc_room(&channel) + 1}) {
        frame.n = n;
        EXPECT_EQ(tc_frame_write(&channel, &frame, empty.data()), 0u);
    }
}

TEST(TcFrame, any_bytes_are_read_or_refused)
{
    std::mt19937 random(2);
    std::uint32_t read = 0;
    for (int i = 0; i < 200000; i++) {
        const TcChannel channel{static_cast<std::uint16_t>(random() % 2), static_cast<std::uint8_t>(random() % 2),
                                static_cast<std::uint8_t>(random() % 2), static_cast<std::uint8_t>(random() % 8 == 0)};
        Bytes bytes(random() % 20);
        for (std::uint8_t &byte : bytes) {
            byte = static_cast<std::uint8_t>(random() % 3 != 0 ? 0 : random() % 32);
        }
        const Bytes exact(bytes); // of its own size, for the sanitizer
        TcFrame frame{};
        if (tc_frame_read(&channel, exact.data(), exact.size(), &frame) == CCSDS_OK) {
            read++;
            ASSERT_LE(frame.size, exact.size());
            if (frame.type != TC_BC) {
                ASSERT_GE(frame.data, exact.data());
                ASSERT_LE(frame.data + frame.n, exact.data() + frame.size);
            }
        }
    }
    EXPECT_GT(read, 300u);
}

TEST(TcJoiner, segments_become_one_unit)
{
    Bytes memory(10);
    PartJoiner joiner{memory.data(), memory.size(), 0, 0, {}};
    const Bytes data{1, 2, 3, 4};
    const auto take = [&](std::uint8_t part) {
        TcFrame frame{};
        frame.data = data.data();
        frame.n = data.size();
        frame.part = part;
        return tc_join(&joiner, &frame);
    };
    EXPECT_EQ(take(SPACE_PACKET_WHOLE), 1);
    EXPECT_EQ(joiner.n, 4u);
    EXPECT_EQ(take(SPACE_PACKET_FIRST), 0);
    EXPECT_EQ(take(SPACE_PACKET_LAST), 1);
    EXPECT_EQ(Bytes(memory.begin(), memory.begin() + 8), (Bytes{1, 2, 3, 4, 1, 2, 3, 4}));
    EXPECT_EQ(take(SPACE_PACKET_MIDDLE), 0);
    EXPECT_EQ(joiner.faults[CCSDS_STRAY], 1u);
    EXPECT_EQ(take(SPACE_PACKET_FIRST), 0);
    EXPECT_EQ(take(SPACE_PACKET_FIRST), 0);
    EXPECT_EQ(joiner.faults[CCSDS_GAP], 1u);
    EXPECT_EQ(take(SPACE_PACKET_MIDDLE), 0);
    EXPECT_EQ(take(SPACE_PACKET_MIDDLE), 0); // 12 bytes into 10
    EXPECT_EQ(joiner.faults[CCSDS_ROOM], 1u);
    EXPECT_EQ(take(SPACE_PACKET_LAST), 0);
    EXPECT_EQ(joiner.faults[CCSDS_STRAY], 2u);
}

TEST(Clcw, has_the_bits_of_the_standard)
{
    std::mt19937 random(3);
    for (int i = 0; i < 5000; i++) {
        const auto any = [&](std::uint32_t n) { return static_cast<std::uint8_t>(random() % n); };
        const Clcw clcw{any(64), any(2), any(2), any(2), any(2), any(2), any(4), any(256)};
        const std::uint32_t word = clcw_word(&clcw);
        ASSERT_EQ(bits(word, 32), "0"
                                  "00"
                                  "000"
                                  "01" +
                                      bits(clcw.virtual_channel, 6) + "00" + bits(clcw.no_rf, 1) +
                                      bits(clcw.no_bit_lock, 1) + bits(clcw.lockout, 1) + bits(clcw.wait, 1) +
                                      bits(clcw.retransmit, 1) + bits(clcw.bypasses, 2) + "0" + bits(clcw.next, 8));
        Clcw read{};
        ASSERT_TRUE(clcw_read(word, &read));
        ASSERT_EQ(clcw_word(&read), word);
        ASSERT_FALSE(clcw_read(word | 0x80000000u, &read));
        ASSERT_FALSE(clcw_read(word & ~0x01000000u, &read));
    }
}

} // namespace tc_frame_test
