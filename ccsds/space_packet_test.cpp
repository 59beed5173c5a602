// SPDX-License-Identifier: Apache-2.0
// Space packets against the bits of 133.0-B-2, written here bit by bit, and longer data through packets that are lost.
#include "ccsds/space_packet.h"
#include "ccsds/testing/bits.h"
#include "ccsds/time_code.h"

#include <gtest/gtest.h>

#include <random>
#include <string>
#include <vector>

namespace space_packet_test {

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
    std::uint32_t size = 1;
    EXPECT_EQ(packet_size(bytes.data(), 0, &size), CCSDS_SHORT);
    EXPECT_EQ(size, 0u);
    EXPECT_EQ(space_packet_read(&read, bytes.data(), 5), CCSDS_SHORT);
    EXPECT_EQ(space_packet_read(&read, bytes.data(), 15), CCSDS_LENGTH);
    EXPECT_EQ(space_packet_read(&read, bytes.data(), 16), CCSDS_OK);
    EXPECT_EQ(read.application, SPACE_PACKET_IDLE);
    bytes[0] |= 0x20;
    EXPECT_EQ(space_packet_read(&read, bytes.data(), 16), CCSDS_VERSION);
}

TEST(Pus, headers_have_the_bits_of_the_standard)
{
    std::mt19937 random(4);
    for (int i = 0; i < 5000; i++) {
        const bool command = i % 2 != 0;
        const auto any = [&](std::uint32_t n) { return static_cast<std::uint16_t>(random() % n); };
        const PusHeader header{static_cast<std::uint8_t>(any(16)), static_cast<std::uint8_t>(any(256)),
                               static_cast<std::uint8_t>(any(256)),
                               static_cast<std::uint16_t>(command ? 0u : any(65536)), any(65536)};
        Bytes bytes(PUS_TELEMETRY);
        const std::size_t n = pus_write(&header, command, bytes.data());
        ASSERT_EQ(bits(bytes, n), "0010" + bits(header.flags, 4) + bits(header.service, 8) + bits(header.subtype, 8) +
                                      (command ? "" : bits(header.count, 16)) + bits(header.peer, 16));
        PusHeader read{};
        ASSERT_EQ(pus_read(&read, command, bytes.data(), n), CCSDS_OK);
        ASSERT_EQ(std::tie(read.flags, read.service, read.subtype, read.count, read.peer),
                  std::tie(header.flags, header.service, header.subtype, header.count, header.peer));
        ASSERT_EQ(pus_read(&read, command, bytes.data(), n - 1), CCSDS_SHORT);
        bytes[0] ^= 0x30; // PUS-A
        ASSERT_EQ(pus_read(&read, command, bytes.data(), n), CCSDS_VERSION);
    }
}

TEST(Pus, pings_of_another_implementation)
{
    for (const std::string text : {"1801c00000062f11010000161d", "0801c00000082011020000000086d7"}) {
        const Bytes ping = from_hex(text);
        SpacePacket packet{};
        PusHeader header{};
        ASSERT_EQ(space_packet_read(&packet, ping.data(), ping.size()), CCSDS_OK);
        ASSERT_TRUE(packet.secondary);
        ASSERT_EQ(pus_read(&header, packet.command, &ping[6], ping.size() - 6), CCSDS_OK);
        EXPECT_EQ(header.flags, packet.command ? 15 : 0);
        EXPECT_EQ(header.service, 17);
        EXPECT_EQ(header.subtype, packet.command ? 1 : 2);
        EXPECT_EQ(ccsds_crc16(ping.data(), ping.size()), 0);
    }
}

TEST(TimeCode, numbers_that_are_known)
{
    constexpr std::int64_t s = 1000000000;
    // The first packet of a file of JPSS-1, whose published list has day 23109, 7 ms and 137 us.
    const Bytes jpss = from_hex("5a45000000070089");
    const std::int64_t t = 23109 * 86400 * s + 7137000;
    EXPECT_EQ(time_cds_read(jpss.data()), t);
    Bytes bytes(8);
    time_cds_write(t, bytes.data());
    EXPECT_EQ(bytes, jpss);
    const Bytes cuc = from_hex("7f8001e2408000");
    EXPECT_EQ(time_cuc_read(cuc.data(), 4, 3), 0x7F8001E2 * s + 251953125); // 0x408000 / 2^24 = 129 / 512
    EXPECT_EQ(time_cuc_read(cuc.data(), 4, 0), 0x7F8001E2 * s);
    EXPECT_EQ(time_cuc_read(cuc.data(), 1, 1), 0x7F * s + s / 2);
}

TEST(TimeCode, what_is_read_is_written_again)
{
    std::mt19937 random(5);
    for (int i = 0; i < 20000; i++) {
        const std::uint32_t coarse = 1 + random() % 4, fine = random() % 4;
        const Bytes cuc = any_bytes(random, coarse + fine);
        Bytes again(coarse + fine);
        time_cuc_write(time_cuc_read(cuc.data(), coarse, fine), again.data(), coarse, fine);
        ASSERT_EQ(again, cuc);
        const std::int64_t t = static_cast<std::int64_t>(random()) * 1318000 + random() % 1000000;
        Bytes cds(TIME_CDS);
        time_cds_write(t, cds.data());
        ASSERT_EQ(time_cds_read(cds.data()), t / 1000 * 1000);
    }
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

/// The last packet may come again: the data stays whole, and comes out once.
TEST(PacketJoiner, a_repeated_packet_is_passed_over)
{
    std::mt19937 random(3);
    Bytes memory(5000);
    PacketJoiner joiner{};
    packet_joiner_begin(&joiner, 5, memory.data(), memory.size());
    std::uint16_t count = 16000; // it wraps
    std::uint32_t repeated = 0;
    for (int i = 0; i < 300; i++) {
        const Bytes data = any_bytes(random, 1 + random() % 4000);
        std::uint32_t out = 0;
        for (const Bytes &packet : split(data, 1 + random() % 700, count)) {
            for (std::uint32_t n = 1 + random() % 3; n != 0; n--) {
                out += packet_join(&joiner, packet.data(), packet.size()) != 0;
                repeated += n > 1;
            }
        }
        ASSERT_EQ(out, 1u);
        ASSERT_EQ(Bytes(memory.begin(), memory.begin() + static_cast<std::ptrdiff_t>(joiner.parts.n)), data);
    }
    EXPECT_EQ(joiner.parts.faults[CCSDS_REPLAY], repeated);
    EXPECT_EQ(joiner.parts.faults[CCSDS_GAP], 0u);
    // The same count with other bytes is a gap.
    const std::vector<Bytes> packets = split(Bytes(2, 1), 1, count);
    Bytes other = packets[0];
    other.back() ^= 1u;
    EXPECT_EQ(packet_join(&joiner, packets[0].data(), packets[0].size()), 0);
    EXPECT_EQ(packet_join(&joiner, other.data(), other.size()), 0);
    EXPECT_EQ(joiner.parts.faults[CCSDS_GAP], 1u);
    EXPECT_EQ(joiner.parts.faults[CCSDS_REPLAY], repeated);
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

} // namespace space_packet_test
