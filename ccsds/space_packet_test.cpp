// SPDX-License-Identifier: Apache-2.0
// Space packets against the bits of 133.0-B-2, written here bit by bit, and longer data through packets that are lost.
#include "ccsds/space_packet.h"
#include "ccsds/testing/bits.h"

#include <gtest/gtest.h>

#include <random>
#include <string>
#include <vector>

namespace {

using namespace ccsds::testing;

TEST(SpacePacket, has_the_bits_of_the_standard)
{
    std::mt19937 random(1);
    for (int i = 0; i < 10000; i++) {
        const auto any = [&](std::uint32_t n) { return static_cast<std::uint16_t>(random() % n); };
        const SpacePacket packet{static_cast<std::uint32_t>(7 + random() % 65536),
                                 any(2048),
                                 any(16384),
                                 static_cast<std::uint8_t>(any(2)),
                                 static_cast<std::uint8_t>(any(2)),
                                 static_cast<std::uint8_t>(any(4))};
        Bytes header(6);
        space_packet_write(&packet, header.data());
        ASSERT_EQ(bits(header, 6), "000" + bits(packet.command, 1) + bits(packet.secondary, 1) +
                                       bits(packet.application, 11) + bits(packet.part, 2) + bits(packet.count, 14) +
                                       bits(packet.size - 7, 16));
        SpacePacket read{};
        ASSERT_EQ(space_packet_read(&read, header.data(), 6), CCSDS_LENGTH);
        header.resize(packet.size);
        ASSERT_EQ(space_packet_read(&read, header.data(), header.size()), CCSDS_OK);
        ASSERT_EQ(
            std::tie(read.size, read.application, read.count, read.command, read.secondary, read.part),
            std::tie(packet.size, packet.application, packet.count, packet.command, packet.secondary, packet.part));
    }
}

TEST(SpacePacket, the_command_noop_of_an_app_of_cfs)
{
    const Bytes noop{0x18, 0xc0, 0xc0, 0x00, 0x00, 0x01, 0x00, 0xe6};
    SpacePacket read{};
    ASSERT_EQ(space_packet_read(&read, noop.data(), noop.size()), CCSDS_OK);
    EXPECT_EQ(read.size, 8u);
    EXPECT_EQ(read.application, 0xc0);
    EXPECT_TRUE(read.command && read.secondary && read.part == SPACE_PACKET_WHOLE);
}

TEST(SpacePacket, what_is_no_packet_is_refused)
{
    Bytes bytes(16);
    space_packet_idle(bytes.data(), bytes.size());
    SpacePacket read{};
    EXPECT_EQ(space_packet_read(&read, bytes.data(), 5), CCSDS_SHORT);
    EXPECT_EQ(space_packet_read(&read, bytes.data(), 15), CCSDS_LENGTH);
    EXPECT_EQ(space_packet_read(&read, bytes.data(), 16), CCSDS_OK);
    EXPECT_EQ(read.application, SPACE_PACKET_IDLE);
    bytes[0] |= 0x20;
    EXPECT_EQ(space_packet_read(&read, bytes.data(), 16), CCSDS_VERSION);
}

/// The packets of some data.
std::vector<Bytes> split(const Bytes &data, std::size_t room, std::uint16_t &count)
{
    PacketSplitter splitter{{0, 5, count, 0, 0, SPACE_PACKET_WHOLE}, data.data(), data.size(), room};
    std::vector<Bytes> found;
    Bytes packet(room + SPACE_PACKET_HEADER);
    while (const std::size_t n = packet_split(&splitter, packet.data())) {
        found.emplace_back(packet.begin(), packet.begin() + static_cast<std::ptrdiff_t>(n));
    }
    count = splitter.head.count;
    return found;
}

TEST(PacketJoiner, data_comes_out_as_it_was_or_not_at_all)
{
    std::mt19937 random(2);
    for (const bool lossy : {false, true}) {
        Bytes memory(5000);
        PacketJoiner joiner{};
        packet_joiner_begin(&joiner, 5, memory.data(), memory.size());
        std::uint16_t count = 16000; // it wraps
        std::uint32_t whole = 0, cut = 0, lost = 0;
        for (int i = 0; i < 3000; i++) {
            const Bytes data = any_bytes(random, 1 + random() % 4000);
            const std::vector<Bytes> packets = split(data, 1 + random() % 700, count);
            bool all = true, out = false;
            for (const Bytes &packet : packets) {
                if (lossy && random() % 10 == 0) {
                    all = false;
                    lost++;
                    continue;
                }
                out = packet_join(&joiner, packet.data(), packet.size()) != 0;
                if (out) {
                    ASSERT_TRUE(all);
                    ASSERT_EQ(Bytes(memory.begin(), memory.begin() + static_cast<std::ptrdiff_t>(joiner.parts.n)),
                              data);
                }
            }
            ASSERT_EQ(out, all);
            (all ? whole : cut)++;
        }
        EXPECT_GT(whole, 500u);
        EXPECT_EQ(cut > 0, lossy);
        EXPECT_EQ(joiner.parts.faults[CCSDS_GAP] > 0, lossy);
        EXPECT_LE(joiner.parts.faults[CCSDS_GAP], lost);
    }
}

TEST(PacketJoiner, what_does_not_belong_is_counted)
{
    Bytes memory(10);
    PacketJoiner joiner{};
    packet_joiner_begin(&joiner, 5, memory.data(), memory.size());
    std::uint16_t count = 0;
    const std::vector<Bytes> packets = split(Bytes(11, 1), 6, count);
    EXPECT_EQ(packet_join(&joiner, packets[1].data(), packets[1].size()), 0); // the last part, without a first
    EXPECT_EQ(joiner.parts.faults[CCSDS_STRAY], 1u);
    EXPECT_EQ(packet_join(&joiner, packets[0].data(), packets[0].size()), 0); // a count that goes back
    EXPECT_EQ(joiner.parts.faults[CCSDS_GAP], 1u);
    EXPECT_EQ(packet_join(&joiner, packets[1].data(), packets[1].size()), 0); // 11 bytes into 10
    EXPECT_EQ(joiner.parts.faults[CCSDS_ROOM], 1u);
    Bytes other = packets[0];
    other[1] = 6;
    EXPECT_EQ(packet_join(&joiner, other.data(), other.size()), 0);
    EXPECT_EQ(joiner.parts.faults[CCSDS_CHANNEL], 1u);
    EXPECT_EQ(packet_join(&joiner, packets[0].data(), packets[0].size() - 1), 0);
    EXPECT_EQ(joiner.parts.faults[CCSDS_LENGTH], 1u);
}

} // namespace
