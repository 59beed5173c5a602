// SPDX-License-Identifier: Apache-2.0
// Space packets as Wireshark reads them: a decoder that is not ours.
#include "ccsds/space_packet.h"
#include "ccsds/testing/bits.h"
#include "ccsds/testing/tshark.h"

#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <sstream>
#include <string>
#include <vector>

namespace tshark_test {

using namespace ccsds::testing;

/// What tshark prints of a capture, a line for each packet.
std::vector<std::string> dissected(const std::string &path)
{
    std::string fields = "-T fields -E separator=,";
    for (const char *field :
         {"ccsds.version", "ccsds.type", "ccsds.secheader", "ccsds.apid", "ccsds.seqflag", "ccsds.seqnum",
          "ccsds.length", "ccsds.user_data", "_ws.malformed", "ccsds.length.error"}) {
        fields += std::string(" -e ") + field;
    }
    const std::string text = tshark(path, fields);
    std::istringstream lines(text);
    std::vector<std::string> found;
    for (std::string line; std::getline(lines, line);) {
        found.push_back(line);
    }
    return found;
}

TEST(SpacePacket, tshark_reads_the_same_fields)
{
    if (std::system("command -v tshark > /dev/null") != 0) {
        GTEST_SKIP() << "not installed: tshark";
    }
    // Wireshark looks for the secondary header of the Space Station in each packet, and for a check that it may
    // announce: 12 bytes.
    constexpr std::size_t least = 18;
    std::mt19937 random(1);
    std::vector<Bytes> packets;
    std::vector<std::string> expected;
    const auto add = [&](const SpacePacket &head, const Bytes &packet) {
        std::ostringstream line;
        line << "0," << +head.command << ',' << +head.secondary << ',' << head.application << ',' << +head.part << ','
             << head.count << ',' << head.size - 7 << ',';
        for (std::size_t i = 6; head.secondary == 0 && i < packet.size(); i++) {
            char digits[3];
            std::snprintf(digits, sizeof digits, "%02x", packet[i]);
            line << digits;
        }
        packets.push_back(packet);
        expected.push_back(line.str());
    };
    for (int i = 0; i < 1500; i++) {
        const auto secondary = static_cast<std::uint8_t>(random() % 2);
        SpacePacket head{static_cast<std::uint32_t>(least + random() % (i % 100 == 0 ? 60000 : 200)),
                         static_cast<std::uint16_t>(1 + random() % 2044), // without those of AMP, CFDP, idle
                         static_cast<std::uint16_t>(random() % SPACE_PACKET_COUNTS),
                         static_cast<std::uint8_t>(random() % 2),
                         secondary,
                         static_cast<std::uint8_t>(random() % 4)};
        Bytes packet = any_bytes(random, head.size);
        space_packet_write(&head, packet.data());
        add(head, packet);
    }
    for (std::size_t n = least; n < 60; n++) {
        Bytes packet(n);
        space_packet_idle(packet.data(), n);
        add({static_cast<std::uint32_t>(n), SPACE_PACKET_IDLE, 0, 0, 0, SPACE_PACKET_WHOLE}, packet);
    }
    for (const std::size_t n : {12, 99, 100, 112, 1234}) { // in parts; the count wraps
        const Bytes data = any_bytes(random, n);
        PacketSplitter splitter{{0, 77, 16380, 1, 0, SPACE_PACKET_WHOLE}, data.data(), data.size(), 100};
        const std::size_t parts = (n + 99) / 100;
        Bytes packet(106);
        for (std::size_t i = 0; const std::size_t size = packet_split(&splitter, packet.data()); i++) {
            const int part = (i == 0 ? SPACE_PACKET_FIRST : 0) | (i + 1 == parts ? SPACE_PACKET_LAST : 0);
            add({static_cast<std::uint32_t>(size), 77, static_cast<std::uint16_t>((16380 + i) % 16384), 1, 0,
                 static_cast<std::uint8_t>(part)},
                Bytes(packet.begin(), packet.begin() + static_cast<std::ptrdiff_t>(size)));
        }
    }
    const std::string path = ::testing::TempDir() + "/fledge_packets.pcap";
    write_capture(path, packets);
    const std::vector<std::string> found = dissected(path);
    ASSERT_EQ(found.size(), expected.size());
    for (std::size_t i = 0; i < found.size(); i++) {
        // Behind the fields of ours: of the Space Station's secondary header what it calls data; then neither malformed
        // nor too long.
        const std::string data = (packets[i][0] & 8) != 0 ? found[i].substr(expected[i].size()) : ",,";
        ASSERT_EQ(found[i], expected[i] + data) << i;
        ASSERT_TRUE(data.ends_with(",,")) << i << ": " << found[i];
    }
}

} // namespace tshark_test
