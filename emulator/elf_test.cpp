// SPDX-License-Identifier: Apache-2.0
#include "emulator/elf.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "emulator/testing/make_elf.h"
#include "tests/error_of.h"

namespace fledge::emulator {
namespace elf_test {

using ::testing::HasSubstr;
using testing::make_elf;

constexpr std::uint32_t base = 0x40000000;

std::vector<std::byte> example()
{
    return make_elf(base, {0x11111111, 0x22222222, 0x33333333, 0x44444444},
                    {{"first", base, 8}, {"label", base + 8, 0}, {"last", base + 12, 4}, {"end", base + 116, 0}}, 100);
}

std::string mistake(const std::vector<std::byte> &file)
{
    return error_of<Error>([&] { const Program program(file, "p.elf"); });
}

TEST(Elf, segments_and_symbols_are_read)
{
    const Program p(example(), "p.elf");
    EXPECT_EQ(p.entry(), base);
    ASSERT_EQ(p.segments().size(), 1u);
    EXPECT_EQ(p.segments()[0].bytes.size(), 16u);
    EXPECT_EQ(p.segments()[0].memory_size, 116u);
    EXPECT_EQ(p.segments()[0].bytes[4], std::byte{0x22});
    EXPECT_EQ(p.named("last")->address, base + 12);
    EXPECT_EQ(p.named("none"), nullptr);
    EXPECT_EQ(p.place(base + 4), "first+0x4");
    EXPECT_EQ(p.place(base + 8), "label");
    EXPECT_EQ(p.place(base + 12), "last");
    EXPECT_EQ(p.place(base + 16), "");
    EXPECT_EQ(p.place(base - 4), "");
    EXPECT_EQ(p.place(base + 200), "") << "beyond what is loaded, no label reaches";
}

TEST(Elf, a_section_without_bytes_is_not_loaded)
{
    auto file = example();
    const auto put = [&](std::size_t at, std::uint32_t value) {
        for (std::size_t i = 0; i < 4; i++) {
            file[at + i] = static_cast<std::byte>(value >> 8 * (3 - i));
        }
    };
    std::size_t section = 0;
    for (std::size_t i = 32; i < 36; i++) {
        section = section << 8 | std::to_integer<std::size_t>(file[i]);
    }
    put(section + 4, 8); // SHT_NOBITS
    put(section + 8, 2); // SHF_ALLOC
    put(section + 12, base + 4);
    put(section + 20, 8);
    const Program p(file, "p.elf");
    ASSERT_EQ(p.segments().size(), 2u);
    EXPECT_EQ(p.segments()[0].bytes.size(), 4u);
    EXPECT_EQ(p.segments()[0].memory_size, 12u);
    EXPECT_EQ(p.segments()[1].address, base + 12);
    EXPECT_EQ(p.segments()[1].bytes.at(0), std::byte{0x44});
    EXPECT_EQ(p.segments()[1].memory_size, 104u);
    EXPECT_EQ(p.place(base + 8), "label");

    put(section + 20, 12); // up to the end of the file's bytes: as zeros behind them
    EXPECT_EQ(Program(file, "p.elf").segments().size(), 1u);
}

TEST(Elf, s_records_are_read)
{
    const auto read = [](const std::string &text) { return Program(std::as_bytes(std::span(text)), "p.srec"); };
    const std::string text = "S00600004844521B\r\nS3094000001011223344FC\nS3094000001455667788E8\nS10500209ABC84\n";
    const Program p = read(text + "S70540000014A6\n");
    EXPECT_EQ(p.entry(), base + 0x14);
    ASSERT_EQ(p.segments().size(), 2u);
    EXPECT_EQ(p.segments()[0].address, base + 0x10);
    EXPECT_EQ(p.segments()[0].memory_size, 8u) << "records that follow one another are one segment";
    EXPECT_EQ(p.segments()[0].bytes[4], std::byte{0x55});
    EXPECT_EQ(p.segments()[1].address, 0x20u);
    EXPECT_EQ(read(text).entry(), base + 0x10) << "the first address, if no record names another";
    for (std::size_t at : {std::size_t{1}, text.find("55667788"), text.size() - 2}) {
        std::string damaged = text;
        damaged[at] = 'x';
        EXPECT_THROW((void)read(damaged), Error) << at;
    }
    EXPECT_THROW((void)read(text.substr(0, 30)), Error);
}

TEST(Elf, bytes_of_a_prom_are_read)
{
    const std::string text = "S0me bytes";
    const Program p(std::as_bytes(std::span(text)), "p.bin");
    EXPECT_EQ(p.entry(), 0u);
    EXPECT_EQ(p.segments().at(0).memory_size, 10u);
}

TEST(Elf, files_for_others_say_what_they_are)
{
    const auto changed = [](std::size_t at, int value) {
        auto file = example();
        file[at] = static_cast<std::byte>(value);
        return mistake(file);
    };
    EXPECT_THAT(changed(0, 'x'), HasSubstr("p.elf: is not an ELF file, nor has it S-records"));
    EXPECT_EQ(changed(19, 18),
              "p.elf: is for SPARC V8+, which needs a 64-bit processor; needed is a program for 32-bit SPARC (V8), "
              "big-endian");
    EXPECT_THAT(changed(4, 2), HasSubstr("is for machine 2; needed"));
    EXPECT_EQ(changed(17, 1), "p.elf: is not a linked program with fixed addresses (ET_EXEC)");
    EXPECT_EQ(changed(45, 0), "p.elf: has nothing to load");
    EXPECT_EQ(changed(52 + 6, 1), "p.elf: a segment is at bytes 340 to 356, but the file has " +
                                      std::to_string(example().size()) + ": it is truncated or damaged");
    EXPECT_THAT(changed(52 + 16, 1), HasSubstr("truncated or damaged"));
    EXPECT_EQ(changed(52 + 23, 8), "p.elf: a segment has more bytes in the file than in memory");
    EXPECT_EQ(changed(52 + 12, 0xFF), "");
    EXPECT_THROW(Program::read("/none"), Error);
}

TEST(Elf, x86_is_named)
{
    std::vector<std::byte> file = example();
    file[4] = std::byte{2};
    file[5] = std::byte{1};
    file[18] = std::byte{62};
    file[19] = std::byte{0};
    EXPECT_THAT(mistake(file), HasSubstr("is for x86-64; needed"));
}

TEST(Elf, every_truncated_file_is_refused)
{
    const auto file = example();
    for (std::size_t n = 0; n < file.size(); n++) {
        EXPECT_NE(mistake({file.begin(), file.begin() + static_cast<std::ptrdiff_t>(n)}), "") << n;
    }
}

TEST(Elf, damaged_files_are_refused_or_read)
{
    std::mt19937 random(1);
    unsigned refused = 0;
    for (int i = 0; i < 20'000; i++) {
        auto file = example();
        for (int n = 0; n < 3; n++) {
            file[random() % file.size()] = static_cast<std::byte>(random());
        }
        file.resize(random() % 8 == 0 ? random() % file.size() : file.size());
        refused += mistake(file) != "";
    }
    EXPECT_GT(refused, 1000u);
    EXPECT_LT(refused, 19'000u);
}

} // namespace elf_test
} // namespace fledge::emulator
