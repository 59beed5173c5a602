// SPDX-License-Identifier: Apache-2.0
// Telemetry frames: their bits, random packets through lost and damaged frames, and real frames of Suomi NPP.
#include "ccsds/sync.h"
#include "ccsds/testing/bits.h"
#include "ccsds/tm_frame.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <iterator>
#include <map>
#include <random>
#include <regex>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace tm_frame_test {

using namespace ccsds::testing;

/// The check of 132.0-B-3 bit by bit.
std::uint16_t slow_crc(const Bytes &bytes)
{
    unsigned crc = 0xFFFF;
    for (const std::uint8_t byte : bytes) {
        for (int bit = 7; bit >= 0; bit--) {
            const bool out = ((crc >> 15 ^ byte >> bit) & 1u) != 0;
            crc = (crc << 1 & 0xFFFF) ^ (out ? 0x1021 : 0);
        }
    }
    return static_cast<std::uint16_t>(crc);
}

TEST(Crc, is_that_of_the_standard)
{
    const Bytes digits{'1', '2', '3', '4', '5', '6', '7', '8', '9'};
    EXPECT_EQ(ccsds_crc16(digits.data(), digits.size()), 0x29B1); // the check value of CRC-16/IBM-3740
    std::mt19937 random(1);
    for (std::size_t n = 0; n < 300; n++) {
        Bytes bytes = any_bytes(random, n);
        const std::uint16_t crc = ccsds_crc16(bytes.data(), n);
        ASSERT_EQ(crc, slow_crc(bytes));
        bytes.push_back(static_cast<std::uint8_t>(crc >> 8));
        bytes.push_back(static_cast<std::uint8_t>(crc));
        ASSERT_EQ(ccsds_crc16(bytes.data(), bytes.size()), 0);
    }
}

void keep(void *user, const std::uint8_t *bytes, std::size_t n)
{
    static_cast<std::vector<Bytes> *>(user)->emplace_back(bytes, bytes + n);
}

Bytes packet_of(std::mt19937 &random, std::uint16_t application, std::uint16_t count, std::size_t n)
{
    Bytes packet = any_bytes(random, n);
    const SpacePacket head{static_cast<std::uint32_t>(n), application, count, 0, 0, SPACE_PACKET_WHOLE};
    space_packet_write(&head, packet.data());
    return packet;
}

TEST(TmFrame, has_the_bits_of_the_standard)
{
    std::mt19937 random(2);
    const TmChannel channel{0x2A5, 64, 1, 1};
    std::vector<Bytes> frames;
    TmSender sender{};
    ASSERT_TRUE(tm_sender_begin(&sender, &channel, keep, &frames));
    sender.control = 0x01040007;
    Bytes memory(64);
    TmVirtual vc{};
    tm_virtual_begin(&vc, 3, memory.data());
    const Bytes packet = packet_of(random, 9, 0, 70); // 52 bytes of packets in a frame: it spans two
    tm_send(&sender, &vc, packet.data(), packet.size());
    tm_send(&sender, &vc, packet.data(), packet.size());
    tm_flush(&sender, &vc);
    tm_idle(&sender, &vc);
    ASSERT_EQ(frames.size(), 4u);
    const std::uint16_t firsts[] = {0, 18, 36, 0x7FE}; // where the first packet begins: the second, the idle one, none
    for (std::uint8_t i = 0; i < 4; i++) {
        const Bytes &frame = frames[i];
        ASSERT_EQ(frame.size(), 64u);
        EXPECT_EQ(Bytes(frame.begin(), frame.begin() + 6),
                  (Bytes{0x2A, 0x57, i, i, static_cast<std::uint8_t>(0x18 | firsts[i] >> 8),
                         static_cast<std::uint8_t>(firsts[i])}));
        EXPECT_EQ(Bytes(frame.begin() + 58, frame.begin() + 62), (Bytes{0x01, 0x04, 0x00, 0x07}));
        EXPECT_EQ(slow_crc(frame), 0);
    }
    EXPECT_TRUE(std::equal(packet.begin(), packet.begin() + 52, frames[0].begin() + 6));
    EXPECT_TRUE(std::equal(packet.begin() + 52, packet.end(), frames[1].begin() + 6));
}

TEST(TmFrame, what_is_no_frame_of_the_channel_is_refused)
{
    const TmChannel channel{0x2A5, 64, 0, 1};
    std::vector<Bytes> frames;
    TmSender sender{};
    ASSERT_TRUE(tm_sender_begin(&sender, &channel, keep, &frames));
    Bytes memory(64);
    TmVirtual vc{};
    tm_virtual_begin(&vc, 0, memory.data());
    tm_idle(&sender, &vc);
    TmFrame frame{};
    const auto read = [&](Bytes bytes, const TmChannel &as) {
        if (bytes.size() == 64 && as.check) { // with a check that holds
            const std::uint16_t crc = ccsds_crc16(bytes.data(), 62);
            bytes[62] = static_cast<std::uint8_t>(crc >> 8);
            bytes[63] = static_cast<std::uint8_t>(crc);
        }
        return tm_frame_read(&as, bytes.data(), bytes.size(), &frame);
    };
    const Bytes good = frames[0];
    EXPECT_EQ(read(good, channel), CCSDS_OK);
    EXPECT_EQ(read(Bytes(good.begin(), good.end() - 1), channel), CCSDS_LENGTH);
    EXPECT_EQ(read(Bytes(12), {0, 12, 0, 0}), CCSDS_LENGTH); // a header and what may be behind it, without data
    EXPECT_EQ(aos_frame_read(good.data(), good.size(), 0, 0, 0, &frame), CCSDS_VERSION);
    EXPECT_EQ(read(good, {0x2A4, 64, 0, 1}), CCSDS_SPACECRAFT);
    Bytes bad = good;
    bad[0] |= 0x40;
    EXPECT_EQ(read(bad, channel), CCSDS_VERSION);
    bad = good;
    bad[4] |= 0x40; // the data of a virtual channel's own
    EXPECT_EQ(read(bad, channel), CCSDS_TYPE);
    bad = good;
    bad[4] |= 0x80; // a secondary header that is as long as the frame
    bad[6] = 0x3F;
    EXPECT_EQ(read(bad, channel), CCSDS_LENGTH);
    bad[6] = 3;
    EXPECT_EQ(read(bad, channel), CCSDS_OK);
    EXPECT_EQ(frame.n, 64u - 6 - 4 - 2);
    bad = good;
    bad[20] ^= 1;
    EXPECT_EQ(tm_frame_read(&channel, bad.data(), bad.size(), &frame), CCSDS_CRC);
    for (const TmChannel &impossible : {TmChannel{1024, 64, 1, 1}, TmChannel{1, 18, 1, 1}, TmChannel{1, 2049, 1, 1}}) {
        EXPECT_FALSE(tm_sender_begin(&sender, &impossible, keep, nullptr));
    }
}

/// Packets of several virtual channels through frames, some of which do not arrive.
void exchange(std::mt19937 &random, unsigned loss, bool damage)
{
    const TmChannel channel{77, static_cast<std::uint16_t>(30 + random() % 900),
                            static_cast<std::uint8_t>(random() % 2), 1};
    std::vector<Bytes> frames;
    TmSender sender{};
    ASSERT_TRUE(tm_sender_begin(&sender, &channel, keep, &frames));
    struct Channel {
        TmVirtual sending{};
        TmReceiver receiving{};
        Bytes frame, memory = Bytes(5000);
        std::vector<Bytes> sent, received;
        std::vector<std::pair<std::size_t, std::size_t>> span; // of each packet: its first and last frame
    };
    std::vector<Channel> channels(1 + random() % 4);
    for (std::size_t i = 0; i < channels.size(); i++) {
        channels[i].frame.resize(channel.size);
        tm_virtual_begin(&channels[i].sending, static_cast<std::uint8_t>(i), channels[i].frame.data());
        tm_receiver_begin(&channels[i].receiving, 256, channels[i].memory.data(), channels[i].memory.size(), keep,
                          &channels[i].received);
    }
    std::map<std::size_t, std::vector<std::size_t>> of; // virtual channel -> its frames, by their places
    const auto note = [&](std::size_t from) {
        for (std::size_t k = from; k < frames.size(); k++) {
            of[frames[k][1] >> 1 & 7].push_back(k);
        }
    };
    for (int i = 0; i < 200; i++) {
        const std::size_t which = random() % channels.size(), before = frames.size();
        Channel &vc = channels[which];
        switch (random() % 8) {
        case 0: tm_flush(&sender, &vc.sending); break;
        case 1: tm_idle(&sender, &vc.sending); break;
        default: {
            const Bytes packet =
                packet_of(random, static_cast<std::uint16_t>(which + 1), static_cast<std::uint16_t>(vc.sent.size()),
                          7 + random() % (i % 9 ? 200 : 4000));
            const std::size_t first = of[which].size();
            tm_send(&sender, &vc.sending, packet.data(), packet.size());
            note(before);
            vc.sent.push_back(packet);
            vc.span.emplace_back(first, of[which].size() - (vc.sending.n == 0 ? 1 : 0));
            continue;
        }
        }
        note(before);
    }
    for (Channel &vc : channels) {
        const std::size_t before = frames.size();
        tm_flush(&sender, &vc.sending);
        tm_flush(&sender, &vc.sending); // the idle packet may have gone on
        note(before);
    }
    std::set<std::size_t> gone;
    std::uint32_t refused = 0;
    for (std::size_t k = 0; k < frames.size(); k++) {
        if (random() % 100 < loss) {
            gone.insert(k);
            if (!damage) {
                continue;
            }
            frames[k][random() % frames[k].size()] ^= static_cast<std::uint8_t>(1 << random() % 8);
        }
        TmFrame frame{};
        if (tm_frame_read(&channel, frames[k].data(), frames[k].size(), &frame) != CCSDS_OK) {
            refused++;
            continue;
        }
        ASSERT_EQ(frame.master_count, k & 0xFF);
        tm_receive(&channels[frame.virtual_channel].receiving, &frame);
    }
    EXPECT_EQ(refused, damage ? gone.size() : 0u);
    for (std::size_t i = 0; i < channels.size(); i++) {
        Channel &vc = channels[i];
        std::vector<Bytes> expected;
        for (std::size_t k = 0; k < vc.sent.size(); k++) {
            bool whole = true;
            for (std::size_t f = vc.span[k].first; f <= vc.span[k].second && f < of[i].size(); f++) {
                whole = whole && gone.count(of[i][f]) == 0;
            }
            if (whole) {
                expected.push_back(vc.sent[k]);
            }
        }
        ASSERT_EQ(vc.received.size(), expected.size());
        ASSERT_EQ(vc.received, expected);
        EXPECT_EQ(vc.receiving.zone.faults[CCSDS_LENGTH], 0u);
        EXPECT_EQ(vc.receiving.zone.faults[CCSDS_VERSION], 0u);
    }
}

TEST(TmFrame, packets_arrive_in_order_but_for_those_that_lost_a_frame)
{
    std::mt19937 random(3);
    for (int i = 0; i < 150; i++) {
        SCOPED_TRACE(i);
        exchange(random, static_cast<unsigned>(i % 3 * 10), i % 2 == 0);
        ASSERT_FALSE(HasFatalFailure());
    }
}

/// What was sent, and the frames of one virtual channel that carry it: of TM, or of AOS with the same zones.
std::pair<std::vector<Bytes>, std::vector<Bytes>> sent_in_frames(std::mt19937 &random, const TmChannel &channel,
                                                                 bool aos, unsigned packets)
{
    std::vector<Bytes> sent, frames;
    TmSender sender{};
    EXPECT_TRUE(tm_sender_begin(&sender, &channel, keep, &frames));
    Bytes memory(channel.size);
    TmVirtual vc{};
    tm_virtual_begin(&vc, 3, memory.data());
    for (unsigned k = 0; k < packets; k++) {
        sent.push_back(packet_of(random, 1, static_cast<std::uint16_t>(k), 7 + random() % 200));
        tm_send(&sender, &vc, sent.back().data(), sent.back().size());
    }
    tm_flush(&sender, &vc);
    for (std::uint32_t k = 0; aos && k < frames.size(); k++) {
        Bytes &frame = frames[k];
        const Bytes head{0x40,
                         static_cast<std::uint8_t>(channel.spacecraft << 6 | 3),
                         0,
                         static_cast<std::uint8_t>(k >> 8),
                         static_cast<std::uint8_t>(k),
                         0};
        frame.insert(frame.begin(), 2, 0); // the pointer stays in front of the zone
        std::copy(head.begin(), head.end(), frame.begin());
        if (channel.check) {
            ccsds_put16(&frame[frame.size() - 2], slow_crc({frame.begin(), frame.end() - 2}));
        }
    }
    return {sent, frames};
}

/// Each of the last 16 frames may come again at any time: no packet is lost, none comes twice, and no frame is missing.
TEST(TmReceiver, a_repeated_frame_is_passed_over)
{
    std::mt19937 random(6);
    for (unsigned i = 0; i < 40; i++) {
        SCOPED_TRACE(i);
        const bool aos = i % 2 != 0;
        const TmChannel channel{1, static_cast<std::uint16_t>(40 + random() % 100), 0,
                                static_cast<std::uint8_t>(i / 2 % 2)};
        const auto [sent, frames] = sent_in_frames(random, channel, aos, 500);
        ASSERT_GT(frames.size(), 256u); // the counts of TM wrap
        std::vector<Bytes> received;
        Bytes memory(300);
        TmReceiver receiver{};
        tm_receiver_begin(&receiver, aos ? 1u << 24 : 256, memory.data(), memory.size(), keep, &received);
        const auto take = [&](const Bytes &bytes) {
            TmFrame frame{};
            ASSERT_EQ(aos ? aos_frame_read(bytes.data(), bytes.size(), 0, 0, channel.check, &frame)
                          : tm_frame_read(&channel, bytes.data(), bytes.size(), &frame),
                      CCSDS_OK);
            ASSERT_EQ(frame.check, slow_crc({bytes.begin(), bytes.end() - 2 * channel.check}));
            tm_receive(&receiver, &frame);
        };
        std::uint32_t repeated = 0;
        for (std::size_t k = 0; k < frames.size(); k++) {
            take(frames[k]);
            for (std::size_t n = random() % 3; n != 0; n--) {
                take(frames[k - random() % std::min<std::size_t>(k + 1, TM_RECALLED)]);
                repeated++;
            }
        }
        EXPECT_EQ(received, sent);
        EXPECT_EQ(receiver.frames, frames.size());
        EXPECT_EQ(receiver.repeated, repeated);
        EXPECT_EQ(receiver.missing, 0u);
    }
}

/// A frame of the same count with other bytes comes after all other counts went missing.
TEST(TmReceiver, the_count_alone_makes_no_repetition)
{
    std::mt19937 random(7);
    const TmChannel channel{1, 60, 0, 1};
    const auto [sent, frames] = sent_in_frames(random, channel, false, 300);
    std::vector<Bytes> received;
    Bytes memory(300);
    TmReceiver receiver{};
    tm_receiver_begin(&receiver, 256, memory.data(), memory.size(), keep, &received);
    for (const std::size_t k : {0, 256, 257}) {
        TmFrame frame{};
        ASSERT_EQ(tm_frame_read(&channel, frames[k].data(), frames[k].size(), &frame), CCSDS_OK);
        tm_receive(&receiver, &frame);
    }
    EXPECT_EQ(receiver.repeated, 0u);
    EXPECT_EQ(receiver.missing, 255u);
    EXPECT_EQ(receiver.frames, 3u);
}

TEST(PacketZone, packets_that_are_too_long_or_end_elsewhere_are_counted)
{
    std::mt19937 random(4);
    std::vector<Bytes> found;
    Bytes memory(50);
    PacketZone zone{};
    packet_zone_begin(&zone, memory.data(), memory.size(), keep, &found);
    const Bytes large = packet_of(random, 1, 0, 90), small = packet_of(random, 1, 1, 20);
    Bytes all = large;
    all.insert(all.end(), small.begin(), small.end());
    packet_zone_take(&zone, all.data(), 60, 0); // 90 bytes into 50: the packet behind it is found
    packet_zone_take(&zone, all.data() + 60, 50, 30);
    EXPECT_EQ(found, std::vector<Bytes>{small});
    EXPECT_EQ(zone.faults[CCSDS_ROOM], 1u);
    found.clear();
    packet_zone_take(&zone, all.data(), 60, 0); // its rest and the packet behind it, where no packet should begin
    packet_zone_take(&zone, all.data() + 60, 50, PACKET_ZONE_NONE);
    EXPECT_EQ(found, std::vector<Bytes>{small});
    found.clear();
    packet_zone_take(&zone, small.data(), 10, 0);
    packet_zone_take(&zone, all.data() + 90, 20, 0); // the pointer says that the packet before has ended
    EXPECT_EQ(found, std::vector<Bytes>{small});
    EXPECT_EQ(zone.faults[CCSDS_LENGTH], 1u);
    Bytes other = small;
    other[0] = 0x3F;
    packet_zone_take(&zone, other.data(), other.size(), 0);
    EXPECT_EQ(zone.faults[CCSDS_VERSION], 1u);
    packet_zone_take(&zone, other.data(), other.size(), PACKET_ZONE_NONE);
    packet_zone_take(&zone, other.data(), other.size(), 20);
    EXPECT_EQ(zone.faults[CCSDS_STRAY], 2u);
}

TEST(PacketZone, memory_without_room_for_a_header_is_refused)
{
    std::mt19937 random(4);
    const Bytes packet = packet_of(random, 1, 0, 20);
    for (std::size_t room = 0; room < 10; room++) {
        std::vector<Bytes> found;
        Bytes memory(16, 0xA5);
        PacketZone zone{};
        const int good = packet_zone_begin(&zone, memory.data(), room, keep, &found);
        EXPECT_EQ(good, room >= 8 ? 1 : 0) << room;
        packet_zone_take(&zone, packet.data(), packet.size(), 0); // whole: it needs no memory
        const std::array<std::uint8_t, 8> header{0xFF, 0, 0, 0, 0, 0, 0, 30};
        packet_zone_take(&zone, header.data(), header.size(), 0); // spans zones, and is longer than the memory
        EXPECT_EQ(found.size(), good ? 1u : 0u) << room;
        EXPECT_EQ(zone.faults[CCSDS_ROOM], good ? 1u : 2u) << room;
        EXPECT_EQ(Bytes(memory.begin() + static_cast<std::ptrdiff_t>(room), memory.end()), Bytes(16 - room, 0xA5));
        TmReceiver receiver{};
        EXPECT_EQ(tm_receiver_begin(&receiver, 256, memory.data(), room, keep, &found), good);
    }
}

/// An encapsulation packet as 133.1-B-3, 4.1.2 draws it: its protocol, the size of its header, its data.
Bytes encapsulation(unsigned protocol, std::size_t header, const Bytes &data)
{
    const std::size_t n = header + data.size();
    Bytes packet{static_cast<std::uint8_t>(0b111 << 5 | protocol << 2 | (header == 8 ? 3 : header / 2))};
    if (header == 2) {
        packet.push_back(static_cast<std::uint8_t>(n));
    } else if (header > 2) {
        packet.push_back(0xA5); // the user's, and the extension of the protocol
        if (header == 8) {
            packet.insert(packet.end(), {0, 0, 0, 0}); // the standard's, and the upper half of the length
        }
        packet.insert(packet.end(), {static_cast<std::uint8_t>(n >> 8), static_cast<std::uint8_t>(n)});
    }
    packet.insert(packet.end(), data.begin(), data.end());
    return packet;
}

TEST(PacketZone, encapsulation_packets_stand_between_space_packets)
{
    std::mt19937 random(6);
    for (int i = 0; i < 300; i++) {
        Bytes stream, memory(3000);
        std::vector<Bytes> spaces, others, found, foreign;
        std::vector<std::size_t> begins;
        std::uint32_t idle = 0;
        for (int k = 0; k < 30; k++) {
            const std::size_t header = std::size_t{1} << random() % 4;
            const Bytes data = any_bytes(random, header == 1 ? 0 : random() % (header == 2 ? 200 : 2000));
            const unsigned protocol = header == 1 ? 0 : random() % 8;
            const bool space = random() % 2 != 0;
            const Bytes packet =
                space ? packet_of(random, static_cast<std::uint16_t>(random() % 5 ? 5 : SPACE_PACKET_IDLE), 0,
                                  7 + random() % 100)
                      : encapsulation(protocol, header, data);
            const bool fills = space ? (packet[0] & 7) == 7 && packet[1] == 0xFF : protocol == 0;
            idle += fills;
            if (!fills) {
                (space ? spaces : others).push_back(packet);
            }
            begins.push_back(stream.size());
            stream.insert(stream.end(), packet.begin(), packet.end());
        }
        struct Sinks {
            std::vector<Bytes> *found, *foreign;
        } sinks{&found, &foreign};
        PacketZone zone{};
        packet_zone_begin(
            &zone, memory.data(), memory.size(),
            [](void *user, const std::uint8_t *bytes, std::size_t n) {
                static_cast<Sinks *>(user)->found->emplace_back(bytes, bytes + n);
            },
            &sinks);
        zone.encapsulation = [](void *user, const std::uint8_t *bytes, std::size_t n) {
            static_cast<Sinks *>(user)->foreign->emplace_back(bytes, bytes + n);
        };
        if (i % 3 == 0) {
            zone.encapsulation = nullptr; // they are counted alone
        }
        const std::size_t size = 5 + random() % 500;
        for (std::size_t at = 0; at < stream.size(); at += size) {
            const auto next = std::lower_bound(begins.begin(), begins.end(), at);
            const std::size_t n = std::min(size, stream.size() - at);
            packet_zone_take(&zone, &stream[at], n,
                             next != begins.end() && *next < at + n ? static_cast<std::uint32_t>(*next - at)
                                                                    : static_cast<std::uint32_t>(PACKET_ZONE_NONE));
        }
        ASSERT_EQ(found, spaces);
        ASSERT_EQ(foreign, i % 3 == 0 ? std::vector<Bytes>() : others);
        ASSERT_EQ(zone.encapsulated, others.size());
        ASSERT_EQ(zone.idle, idle);
        for (const std::uint32_t n : zone.faults) {
            ASSERT_EQ(n, 0u);
        }
    }
    for (const Bytes &wrong : {Bytes{0xE4}, Bytes{0xE9, 1}, Bytes{0xEA, 0, 0, 3}}) { // shorter than their headers
        std::vector<Bytes> found;
        Bytes memory(50), zones = wrong;
        PacketZone zone{};
        packet_zone_begin(&zone, memory.data(), memory.size(), keep, &found);
        zones.insert(zones.end(), 20, 0);
        packet_zone_take(&zone, zones.data(), zones.size(), 0);
        EXPECT_EQ(zone.faults[CCSDS_LENGTH], 1u);
        const Bytes good = packet_of(random, 1, 0, 20);
        packet_zone_take(&zone, good.data(), good.size(), 0);
        EXPECT_EQ(found, std::vector<Bytes>{good});
    }
}

/// Whatever comes, readers stay within their memory and find the frames that follow.
TEST(Readers, any_bytes_are_taken)
{
    std::mt19937 random(5);
    const TmChannel channel{1, 40, 0, 0};
    std::vector<Bytes> packets;
    Bytes memory(64), block(64);
    TmReceiver receiver{};
    tm_receiver_begin(&receiver, 256, memory.data(), memory.size(), keep, &packets);
    CltuReader cltus{};
    cltu_begin(
        &cltus, block.data(), block.size(), [](void *, std::uint8_t *, std::size_t) {}, nullptr);
    for (int i = 0; i < 100000; i++) {
        Bytes bytes(40);
        for (std::uint8_t &byte : bytes) {
            byte = static_cast<std::uint8_t>(random() % 4 != 0 ? 0 : random());
        }
        const Bytes start{0xEB, 0x90};
        cltu_take(&cltus, random() % 3 != 0 ? bytes.data() : start.data(), 2);
        cltu_take(&cltus, bytes.data(), bytes.size());
        ccsds_put16(bytes.data(), 1u << 4);
        bytes[4] &= 0xBF;
        TmFrame frame{};
        if (tm_frame_read(&channel, bytes.data(), bytes.size(), &frame) == CCSDS_OK) {
            frame.first = random() % 2 != 0 ? random() % 64 : frame.first;
            tm_receive(&receiver, &frame);
        }
    }
    EXPECT_GT(packets.size(), 1000u);
    EXPECT_GT(receiver.zone.faults[CCSDS_ROOM], 100u);
    const std::size_t before = packets.size();
    Bytes good(40);
    space_packet_idle(good.data() + 6, 34);
    good[6] = 0; // of application 0x0FF
    ccsds_put16(good.data(), 1u << 4);
    TmFrame frame{};
    ASSERT_EQ(tm_frame_read(&channel, good.data(), good.size(), &frame), CCSDS_OK);
    frame.count = receiver.count;
    tm_receive(&receiver, &frame);
    EXPECT_EQ(packets.size(), before + 1);
}

/// Suomi NPP: frames of AOS behind markers, randomised, with 128 bytes of Reed-Solomon code that are not looked at.
TEST(AosFrame, real_frames_give_the_packets_of_the_published_list)
{
    const std::string path = real_file("ccsds/snpp_synchronized_cadus");
    std::ifstream file(path + ".dat", std::ios::binary);
    if (!file) {
        GTEST_SKIP() << "not here: " << path << ".dat";
    }
    const Bytes stream((std::istreambuf_iterator<char>(file)), {});
    struct Receiver {
        std::map<unsigned, TmReceiver> channels;
        std::map<unsigned, Bytes> memory;
        std::map<unsigned, std::vector<Bytes>> packets;
        unsigned frames = 0;
    } receiver;
    Bytes memory(1020);
    SyncReader reader{};
    sync_begin(
        &reader, memory.data(), memory.size(), 0,
        [](void *user, std::uint8_t *bytes, std::size_t n) {
            Receiver &all = *static_cast<Receiver *>(user);
            sync_randomise_tm(bytes, n);
            TmFrame frame{};
            ASSERT_EQ(aos_frame_read(bytes, n - 128, 0, 0, 0, &frame), CCSDS_OK);
            EXPECT_EQ(frame.spacecraft, 157);
            const unsigned channel = frame.virtual_channel;
            all.frames++;
            if (all.memory.count(channel) == 0) {
                all.memory[channel].resize(70000);
                tm_receiver_begin(&all.channels[channel], 1u << 24, all.memory[channel].data(), 70000, keep,
                                  &all.packets[channel]);
            }
            tm_receive(&all.channels[channel], &frame);
        },
        &receiver);
    sync_take(&reader, stream.data(), stream.size());
    EXPECT_EQ(receiver.frames, 65u);
    EXPECT_EQ(reader.lost, 0u);
    // The list beside the data: apid, seqid and size of each packet, by another program.
    using Entry = std::array<unsigned long, 3>;
    std::ifstream published(path + ".txt");
    std::vector<Entry> listed, found;
    const std::regex line("apid=(\\d+) seqid=(\\d+) .*size=(\\d+)");
    for (std::string text; std::getline(published, text);) {
        if (std::smatch match; std::regex_search(text, match, line)) {
            listed.push_back({std::stoul(match[1]), std::stoul(match[2]), std::stoul(match[3])});
        }
    }
    ASSERT_EQ(receiver.channels.size(), 1u);
    const TmReceiver &channel = receiver.channels[16];
    EXPECT_EQ(channel.missing, 1u);
    EXPECT_EQ(channel.zone.faults[CCSDS_LENGTH], 0u);
    for (const Bytes &bytes : receiver.packets[16]) {
        SpacePacket packet{};
        ASSERT_EQ(space_packet_read(&packet, bytes.data(), bytes.size()), CCSDS_OK);
        found.push_back({packet.application, packet.count, packet.size});
    }
    EXPECT_EQ(found, listed);
}

} // namespace tm_frame_test
