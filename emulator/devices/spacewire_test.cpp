// SPDX-License-Identifier: Apache-2.0
#include "emulator/devices/spacewire.h"

#include <gtest/gtest.h>

#include <numeric>

namespace fledge::emulator {
namespace spacewire_test {

constexpr std::uint32_t base = 0x40000000, table = base + 0x400, data = base + 0x1000;
constexpr std::uint32_t run = 2, transmitter = 1, sent = 1 << 5, error = 1 << 7;
constexpr std::uint32_t enabled = 1 << 12, wraps = 1 << 13;
using Bytes = std::vector<std::uint8_t>;

struct Bench {
    Bench()
    {
        bus.add_memory(base, 16 * page_size, true, true);
        link.transmit = [this](std::span<const std::uint8_t> packet) {
            packets.emplace_back(packet.begin(), packet.end());
        };
        for (std::uint32_t k = 0; k < 256; k++) {
            bus.write(data + k, 1, k);
        }
        link.write(0x28, table);
        link.write(0x00, run);
    }
    void describe(std::uint32_t k, std::uint32_t flags, std::uint32_t header, std::uint32_t size, std::uint32_t at)
    {
        const std::uint32_t words[] = {flags, header, size, at};
        for (std::uint32_t i = 0; i < 4; i++) {
            bus.write(table + 16 * k + 4 * i, 4, words[i]);
        }
    }
    std::uint32_t flags(std::uint32_t k)
    {
        std::uint64_t word = 0;
        bus.read(table + 16 * k, 4, word);
        return static_cast<std::uint32_t>(word);
    }
    static Bytes counted(std::uint8_t from, std::size_t n)
    {
        Bytes bytes(n);
        std::iota(bytes.begin(), bytes.end(), from);
        return bytes;
    }
    SystemBus bus;
    SpaceWire link{"link", bus};
    std::vector<Bytes> packets;
};

TEST(SpaceWire, sends_the_packets_of_enabled_descriptors_in_their_order)
{
    Bench b;
    b.describe(0, enabled | 3, data + 0x40, 21, data + 5); // a header, and data that are not aligned
    b.describe(1, enabled, 0, 0, 0);
    b.describe(2, enabled | wraps, 0, 64, data);
    b.link.write(0x20, transmitter);
    Bytes first = Bench::counted(0x40, 3);
    const Bytes rest = Bench::counted(5, 21);
    first.insert(first.end(), rest.begin(), rest.end());
    EXPECT_EQ(b.packets, (std::vector<Bytes>{first, {}, Bench::counted(0, 64)}));
    EXPECT_EQ(b.flags(0), 3u) << "it is the program's again";
    EXPECT_EQ(b.flags(2), wraps);
    EXPECT_EQ(b.link.read(0x20), sent) << "it met the first descriptor again, and stopped";
    EXPECT_EQ(b.link.read(0x28), table);
    b.link.write(0x20, sent);
    EXPECT_EQ(b.link.read(0x20), 0u);
}

TEST(SpaceWire, the_table_has_64_descriptors)
{
    Bench b;
    for (std::uint32_t k = 0; k < 64; k++) {
        b.describe(k, enabled, 0, 1, data + k);
    }
    b.link.write(0x20, transmitter);
    ASSERT_EQ(b.packets.size(), 64u);
    EXPECT_EQ(b.packets.back(), Bytes{63});
    EXPECT_EQ(b.link.read(0x28), table);
}

TEST(SpaceWire, packets_wait_for_the_link)
{
    Bench b;
    b.link.reset();
    b.link.write(0x28, table);
    b.describe(0, enabled | wraps, 0, 1, data);
    b.link.write(0x20, transmitter);
    EXPECT_EQ(b.link.read(0x04), 0u);
    b.link.write(0x00, run | 1);
    EXPECT_TRUE(b.packets.empty()) << "the link is disabled";
    b.link.write(0x00, run);
    EXPECT_EQ(b.link.read(0x04) >> 21, 5u);
    EXPECT_EQ(b.packets.size(), 1u);
}

TEST(SpaceWire, memory_gives_what_the_processor_would_read)
{
    Bench b;
    b.bus.flip(data + 8, {1u << 31, 0});
    b.describe(0, enabled | wraps, 0, 16, data);
    b.link.write(0x20, transmitter);
    EXPECT_EQ(b.packets, std::vector<Bytes>{Bench::counted(0, 16)}) << "EDAC corrects one bit";
    b.bus.flip(data + 8, {1u << 30, 0});
    b.describe(0, enabled | wraps, 0, 16, data);
    b.link.write(0x20, transmitter);
    EXPECT_EQ(b.packets.size(), 1u) << "not two";
    EXPECT_EQ(b.link.read(0x20), sent | error);
    EXPECT_EQ(b.flags(0), enabled | wraps);
}

TEST(SpaceWire, what_is_not_there_is_an_error_of_the_bus)
{
    Bench b;
    b.describe(0, enabled, 0, 4, 0x20000000);
    b.link.write(0x20, transmitter);
    EXPECT_EQ(b.link.read(0x20), error);
    b.link.write(0x20, error);
    b.link.write(0x28, 0x20000000);
    b.link.write(0x20, transmitter);
    EXPECT_EQ(b.link.read(0x20), error);
    EXPECT_TRUE(b.packets.empty());
}

} // namespace spacewire_test
} // namespace fledge::emulator
