// SPDX-License-Identifier: Apache-2.0
#include "emulator/bus/system_bus.h"

#include <gtest/gtest.h>

#include <array>

namespace fledge::emulator {
namespace system_bus_test {

constexpr std::uint32_t ram = 0x40000000, ram_size = 8 * page_size, rom = 0, rom_size = 2 * page_size;

struct Words : Device {
    Words(bool plain_memory) : Device("words"), memory(plain_memory) {}
    Identity identity() const override { return {}; }
    std::uint32_t read(std::uint32_t offset) override { return words[offset / 4]; }
    void write(std::uint32_t offset, std::uint32_t value) override { words[offset / 4] = value; }
    bool is_memory() const override { return memory; }
    void reset() override {}
    std::span<std::byte> state() override { return {}; }
    bool memory;
    std::array<std::uint32_t, 4> words{};
};

struct Bench {
    explicit Bench(bool edac = true)
    {
        bus.add_memory(ram, ram_size, true, edac);
        bus.add_memory(rom, rom_size, false, false);
        bus.add_device(0x80000000, 16, apb);
        bus.add_device(0xA0000000, 16, space);
        bus.code_changed = [this](std::uint32_t address, std::uint32_t size) { code.emplace_back(address, size); };
        bus.error = [this](const BusError &e) { errors.push_back(e); };
    }
    std::uint64_t read(std::uint32_t address, unsigned size, Access expected = Access::done)
    {
        std::uint64_t value = 0;
        EXPECT_EQ(bus.read(address, size, value), expected);
        return value;
    }
    Words apb{false}, space{true};
    SystemBus bus;
    std::vector<std::pair<std::uint32_t, std::uint32_t>> code;
    std::vector<BusError> errors;
};

TEST(SystemBus, memory_is_big_endian)
{
    Bench b;
    EXPECT_EQ(b.bus.write(ram + 8, 8, 0x0123456789ABCDEF), Access::done);
    EXPECT_EQ(b.read(ram + 8, 4), 0x01234567u);
    EXPECT_EQ(b.read(ram + 12, 2), 0x89ABu);
    EXPECT_EQ(b.read(ram + 15, 1), 0xEFu);
    EXPECT_EQ(b.read(ram + 8, 8), 0x0123456789ABCDEFu);
    EXPECT_EQ(b.bus.memory(ram + 8, 1)[0], std::byte{0x01});
}

TEST(SystemBus, rom_is_read_only_and_nothing_is_elsewhere)
{
    Bench b;
    const std::array<std::byte, 4> word{std::byte{1}, std::byte{2}, std::byte{3}, std::byte{4}};
    EXPECT_TRUE(b.bus.poke(rom + 4, word));
    EXPECT_EQ(b.read(rom + 4, 4), 0x01020304u);
    EXPECT_EQ(b.bus.write(rom + 4, 4, 0), Access::fault);
    EXPECT_EQ(b.read(rom + 4, 4), 0x01020304u);
    b.read(0x90000000, 4, Access::fault);
    std::uint32_t instruction;
    EXPECT_EQ(b.bus.fetch(0x80000000, instruction), Access::fault) << "a device has no instructions";
    ASSERT_EQ(b.errors.size(), 3u);
    EXPECT_EQ(b.errors[0].address, rom + 4);
    EXPECT_TRUE(b.errors[0].write);
    EXPECT_FALSE(b.bus.poke(ram + ram_size - 2, word));
}

TEST(SystemBus, a_bridge_answers_where_no_device_is)
{
    Bench b;
    b.bus.add_bridge(0x80000000, 0x100000);
    b.apb.words[0] = 7;
    EXPECT_EQ(b.read(0x80000000, 4), 7u);
    EXPECT_EQ(b.read(0x80000500, 8), 0u);
    EXPECT_EQ(b.bus.write(0x800FFFFC, 4, 1), Access::done);
    b.read(0x80100000, 4, Access::fault);
    EXPECT_EQ(b.bus.write(0x7FFFFFFC, 4, 1), Access::fault);
    EXPECT_EQ(b.errors.size(), 2u);
}

TEST(SystemBus, bytes_of_devices)
{
    Bench b;
    b.bus.write(0x80000004, 4, 0x01020304);
    EXPECT_EQ(b.read(0x80000005, 1), 0x02u);
    EXPECT_EQ(b.read(0x80000006, 2), 0x0304u);
    b.bus.write(0x80000004, 1, 0x55);
    EXPECT_EQ(b.apb.words[1], 0x55555555u) << "the byte is on all lanes";
    b.bus.write(0xA0000008, 8, 0x1111111122222222);
    b.bus.write(0xA000000A, 2, 0xABCD);
    EXPECT_EQ(b.space.words[2], 0x1111ABCDu);
    EXPECT_EQ(b.read(0xA0000008, 8), 0x1111ABCD22222222u);
}

TEST(SystemBus, a_debugger_sees_memory_and_devices_that_are_memory)
{
    Bench b;
    std::array<std::byte, 4> bytes{};
    b.bus.write(ram + 4, 4, 0x01020304);
    EXPECT_TRUE(b.bus.peek(ram + 5, std::span(bytes).first(2)));
    EXPECT_EQ(bytes[1], std::byte{3});
    b.space.words[1] = 0x05060708;
    b.space.words[2] = 0x090A0B0C;
    EXPECT_TRUE(b.bus.peek(0xA0000006, bytes));
    EXPECT_EQ(bytes, (std::array{std::byte{7}, std::byte{8}, std::byte{9}, std::byte{10}}));
    EXPECT_FALSE(b.bus.peek(0x80000000, bytes)) << "a read there may have effects";
    EXPECT_FALSE(b.bus.peek(ram + ram_size - 2, bytes));
    EXPECT_TRUE(b.errors.empty());
}

TEST(SystemBus, writes_to_code_are_noticed)
{
    Bench b;
    b.bus.mark_code(ram + page_size + 20);
    b.bus.write(ram + page_size + 8, 8, 1);
    b.bus.write(ram + page_size + 24, 4, 1);
    b.bus.write(ram, 4, 1);
    EXPECT_TRUE(b.code.empty()) << "beside code, and where none is";
    b.bus.write(ram + page_size + 16, 8, 1);
    ASSERT_EQ(b.code.size(), 1u);
    EXPECT_EQ(b.code[0], std::pair(ram + page_size + 16, 8u));
    b.bus.write(ram + page_size + 23, 1, 1);
    ASSERT_EQ(b.code.size(), 1u) << "it is forgotten already";
    b.bus.mark_code(ram + page_size + 20);
    std::vector<std::byte> bytes(2 * page_size);
    b.bus.poke(ram + 8, bytes);
    ASSERT_EQ(b.code.size(), 2u) << "one page of three has code";
    EXPECT_EQ(b.code[1], std::pair(ram + page_size, page_size));
    b.bus.forget_code();
    b.bus.write(ram + page_size, 4, 1);
    EXPECT_EQ(b.code.size(), 2u);
}

TEST(SystemBus, pages_that_changed_are_listed_once)
{
    Bench b;
    b.bus.write(ram + 4, 4, 1);
    b.bus.write(ram + 8, 4, 1);
    b.bus.write(ram + 3 * page_size, 1, 1);
    EXPECT_EQ(b.bus.changed(), (std::vector<std::uint32_t>{0, 3}));
    b.bus.all_unchanged();
    EXPECT_TRUE(b.bus.changed().empty());
    b.bus.write(ram + 4, 4, 1);
    EXPECT_EQ(b.bus.changed(), std::vector<std::uint32_t>{0});
    const std::array<std::byte, 1> byte{};
    b.bus.poke(rom + page_size, byte);
    EXPECT_EQ(b.bus.changed().back(), 9u) << "ROM is behind RAM";
    EXPECT_EQ(b.bus.page_address(9), rom + page_size);
}

TEST(SystemBus, watched_accesses_stop)
{
    Bench b;
    b.bus.watch(ram + 100, 4, true, true, true);
    b.bus.watch(ram + 200, 4, false, true, true);
    EXPECT_EQ(b.bus.write(ram + 96, 4, 1), Access::done);
    EXPECT_EQ(b.bus.write(ram + 96, 8, 1), Access::watched);
    b.read(ram + 103, 1, Access::watched);
    b.read(ram + 200, 4, Access::done);
    EXPECT_EQ(b.bus.write(ram + 200, 4, 7), Access::watched);
    EXPECT_EQ(b.read(ram + 200, 4), 7u);
    b.bus.watch(ram + 100, 4, true, true, false);
    EXPECT_EQ(b.bus.write(ram + 100, 4, 1), Access::done);
    EXPECT_EQ(b.bus.write(ram + 200, 4, 1), Access::watched);
}

TEST(SystemBus, without_edac_a_flip_stays)
{
    Bench b(false);
    b.bus.write(ram + 4, 4, 8);
    b.bus.flip(ram + 4, {9, 0});
    EXPECT_EQ(b.read(ram + 4, 4), 1u);
    EXPECT_TRUE(b.errors.empty());
    b.bus.mark_code(ram + 4);
    b.bus.flip(ram + 4, {1, 0});
    EXPECT_EQ(b.code.size(), 1u) << "code may have changed";
}

TEST(SystemBus, edac_corrects_a_bit_in_each_read)
{
    Bench b;
    b.bus.write(ram + 8, 8, 0x0102030405060708);
    b.bus.flip(ram + 8, {0x80000000, 0});
    b.bus.flip(ram + 12, {0, 1});
    EXPECT_EQ(b.read(ram + 8, 8), 0x0102030405060708u);
    EXPECT_EQ(b.errors.size(), 2u);
    EXPECT_EQ(b.read(ram + 8, 1), 0x01u);
    EXPECT_EQ(b.read(ram + 10, 2), 0x0304u);
    EXPECT_EQ(b.errors.size(), 4u);
    EXPECT_TRUE(b.errors.back().corrected);
    EXPECT_EQ(b.errors.back().address, ram + 8);
    EXPECT_EQ(b.bus.memory(ram + 8, 1)[0], std::byte{0x81}) << "memory is as it is";
    b.bus.write(ram + 8, 8, 1);
    EXPECT_TRUE(b.bus.flips().empty());
    EXPECT_EQ(b.bus.ram().flags[0] & page_faulty, 0);
}

TEST(SystemBus, edac_detects_two_bits)
{
    Bench b;
    b.bus.flip(ram + 8, {3, 0});
    b.read(ram + 8, 4, Access::fault);
    EXPECT_FALSE(b.errors.back().corrected);
    EXPECT_EQ(b.bus.write(ram + 9, 1, 0), Access::fault) << "the other bytes of the word are unknown";
    EXPECT_EQ(b.bus.write(ram + 8, 4, 5), Access::done);
    EXPECT_EQ(b.read(ram + 8, 4), 5u);
}

TEST(SystemBus, a_byte_written_beside_a_flip_corrects_the_word)
{
    Bench b;
    b.bus.write(ram + 8, 4, 0x01020304);
    b.bus.flip(ram + 8, {1, 0});
    EXPECT_EQ(b.bus.write(ram + 8, 1, 0xFF), Access::done);
    EXPECT_EQ(b.read(ram + 8, 4), 0xFF020304u);
    EXPECT_TRUE(b.bus.flips().empty());
}

TEST(SystemBus, a_fetch_corrects_memory_once)
{
    Bench b;
    b.bus.write(ram + 8, 4, 0x01000000);
    b.bus.flip(ram + 8, {4, 0});
    std::uint32_t word;
    EXPECT_EQ(b.bus.fetch(ram + 8, word), Access::done);
    EXPECT_EQ(word, 0x01000000u);
    EXPECT_EQ(b.bus.fetch(ram + 8, word), Access::done);
    EXPECT_EQ(b.errors.size(), 1u);
    b.bus.flip(ram + 8, {6, 0});
    EXPECT_EQ(b.bus.fetch(ram + 8, word), Access::fault);
}

TEST(SystemBus, one_read_is_flipped_on_its_way)
{
    Bench b;
    b.bus.write(ram + 16, 8, 0);
    b.bus.flip_next_read(1u << 24);
    EXPECT_NE(b.bus.ram().flags[5] & page_slow_read, 0);
    EXPECT_EQ(b.read(ram + 16, 1), 1u);
    EXPECT_EQ(b.read(ram + 16, 1), 0u);
    EXPECT_EQ(b.bus.ram().flags[5] & page_slow_read, 0);
    b.bus.flip_next_read(2);
    EXPECT_EQ(b.read(ram + 16, 8), std::uint64_t{2} << 32);
    EXPECT_EQ(b.read(ram + 16, 8), 0u);
}

TEST(SystemBus, one_read_fails)
{
    Bench b;
    b.bus.write(ram + 16, 4, 7);
    b.bus.fail_next_read();
    b.read(ram + 16, 4, Access::fault);
    ASSERT_EQ(b.errors.size(), 1u);
    EXPECT_EQ(b.errors[0].address, ram + 16);
    EXPECT_EQ(b.read(ram + 16, 4), 7u);
    b.bus.fail_next_read();
    b.bus.set_flips({});
    EXPECT_EQ(b.read(ram + 16, 4), 7u) << "not after a snapshot was restored";
}

} // namespace system_bus_test
} // namespace fledge::emulator
