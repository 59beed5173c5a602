// SPDX-License-Identifier: Apache-2.0
#include "emulator/devices/memory_controller.h"

#include <gtest/gtest.h>

#include "emulator/testing/fake_host.h"

namespace fledge::emulator {
namespace memory_controller_test {

using testing::FakeHost;
using Lines = std::vector<std::uint32_t>;

constexpr std::uint32_t base = 0x40000000, size = 16 * page_size;

struct WithMemory {
    WithMemory() { bus.add_memory(base, size, true, true); }
    SystemBus bus;
};

struct Bench : WithMemory {
    Bench()
    {
        bus.error = [this](const BusError &error) { status.note(error); };
    }
    std::uint32_t load(std::uint32_t address)
    {
        std::uint64_t value = 0xBAD;
        return bus.read(address, 4, value) == Access::fault ? 0xBAD : static_cast<std::uint32_t>(value);
    }
    FakeHost host;
    AhbStatus status{"ahbstat", host, 1};
    MemoryController controller{"ftmctrl", bus};
};

TEST(AhbStatus, holds_the_first_error_until_it_is_read)
{
    Bench b;
    EXPECT_EQ(b.bus.write(0x123, 1, 0), Access::fault);
    EXPECT_EQ(b.load(0x90000000), 0xBADu);
    EXPECT_EQ(b.status.read(0x0), 1u << 8 | 1u << 7);
    EXPECT_EQ(b.status.read(0x4), 0x123u);
    EXPECT_EQ(b.status.read(0xC), 2u);
    EXPECT_EQ(b.host.take(), Lines{1});
    b.status.write(0x0, 0);
    b.load(0x90000000);
    EXPECT_EQ(b.status.read(0x0), 1u << 8 | 2u);
    EXPECT_EQ(b.status.read(0x4), 0x90000000u);
    EXPECT_EQ(b.host.take(), Lines{1});
}

TEST(MemoryController, switches_the_edac)
{
    Bench b;
    b.bus.write(base + 8, 4, 0x12345678);
    b.bus.flip(base + 8, {1u << 31, 0});
    EXPECT_EQ(b.load(base + 8), 0x12345678u);
    EXPECT_EQ(b.status.read(0x8), 1u);
    EXPECT_EQ(b.controller.read(0x8), 1u << 27 | 1u << 9);
    b.controller.write(0x8, 0);
    EXPECT_EQ(b.load(base + 8), 0x92345678u);
    EXPECT_EQ(b.controller.read(0x8), 1u << 27);
    b.controller.reset();
    EXPECT_EQ(b.load(base + 8), 0x12345678u);
}

TEST(Scrubber, corrects_each_word_when_it_comes_there)
{
    Bench b;
    Scrubber scrubber("scrubber", b.host, b.bus, 10);
    b.bus.flip(base, {1, 0});
    b.bus.flip(base + 400, {4, 0});
    b.bus.flip(base + 800, {3, 0});
    EXPECT_EQ(scrubber.next_event(), 10u);
    b.host.run(scrubber, 10);
    EXPECT_EQ(b.bus.flips().size(), 2u);
    EXPECT_EQ(scrubber.next_event(), 10u + 100 * 10);
    b.host.run(scrubber, 1009);
    EXPECT_EQ(scrubber.read(0x10), 1u);
    EXPECT_EQ(scrubber.read(0x08), base + 400);
    b.host.run(scrubber, 1010);
    EXPECT_EQ(scrubber.read(0x10), 2u);
    b.host.run(scrubber, 2010);
    EXPECT_EQ(scrubber.read(0x14), 1u);
    EXPECT_EQ(b.bus.flips().size(), 1u) << "two bits stay";
    b.host.run(scrubber, 10 * (size / 4));
    EXPECT_EQ(scrubber.read(0x0C), 1u) << "a round";
    EXPECT_EQ(scrubber.read(0x08), base);
    b.bus.flip(base + 4, {2, 0});
    b.bus.set_flips({{base + 4, {2, 0}}});
    b.host.run(scrubber, 10 * (size / 4) + 20);
    EXPECT_EQ(scrubber.read(0x10), 3u);
    scrubber.write(0x10, 0);
    EXPECT_EQ(scrubber.read(0x10), 0u);
    scrubber.write(0x00, 0);
    EXPECT_EQ(scrubber.next_event(), never);
}

TEST(WriteProtection, refuses_writes_to_its_pages)
{
    Bench b;
    WriteProtection protection("protection", b.bus);
    protection.write(0x04, base + 2 * page_size + 8);
    protection.write(0x00, (base + page_size) | 1);
    EXPECT_EQ(protection.read(0x04), base + 2 * page_size) << "pages";
    EXPECT_EQ(b.bus.write(base + page_size - 4, 4, 1), Access::done);
    EXPECT_EQ(b.bus.write(base + page_size, 4, 1), Access::fault);
    EXPECT_EQ(b.bus.write(base + 3 * page_size - 1, 1, 1), Access::fault);
    EXPECT_EQ(b.bus.write(base + 3 * page_size, 4, 1), Access::done);
    EXPECT_EQ(b.load(base + page_size), 0u);
    EXPECT_EQ(b.status.read(0x4), base + page_size);
    protection.reset();
    EXPECT_EQ(b.bus.write(base + page_size, 4, 1), Access::done);
}

} // namespace memory_controller_test
} // namespace fledge::emulator
