// SPDX-License-Identifier: Apache-2.0
#include "emulator/board.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "emulator/machine.h"
#include "emulator/testing/board.h"
#include "tests/error_of.h"

namespace fledge::emulator {
namespace board_test {

using testing::board_text;
using ::testing::HasSubstr;

const std::string boards = std::string(FLEDGE_ROOT) + "/emulator/boards/";

std::string mistakes(const std::string &text)
{
    return error_of<Error>([&] { BoardDescription::parse(text, "b.toml"); });
}

std::string with(const std::string &from, const std::string &to)
{
    std::string text = board_text;
    const auto at = text.find(from);
    EXPECT_NE(at, text.npos) << from;
    return text.replace(at, from.size(), to);
}

TEST(Board, the_shipped_boards_are_whole)
{
    const BoardDescription flight = BoardDescription::read(boards + "leon3.toml");
    EXPECT_EQ(flight.clock, 80'000'000u);
    EXPECT_EQ(flight.ram.size, 8u << 20);
    EXPECT_EQ(flight.rom.size, 4u << 20);
    EXPECT_TRUE(flight.leon3_timing);
    const BoardDescription generic = BoardDescription::read(boards + "leon3_generic.toml");
    EXPECT_FALSE(generic.grfpu);
    EXPECT_NE(flight.hash, generic.hash);
    Machine a(flight, EngineKind::interpreter), b(generic, EngineKind::interpreter);
}

TEST(Board, the_hash_is_of_the_content)
{
    const auto hash = [](const std::string &text) { return BoardDescription::parse(text, "b.toml").hash; };
    EXPECT_EQ(hash(board_text), hash("# a comment\n" + board_text));
    EXPECT_NE(hash(board_text), hash(with("interrupt = 6", "interrupt = 7")));
}

TEST(Board, each_mistake_has_its_line_and_what_is_allowed)
{
    EXPECT_EQ(mistakes(with("clock = 1_000_000", "clok = 1")),
              "b.toml:2: unknown key `clok`; choose of: name, clock, timing, fpu, ram, rom, device\n"
              "b.toml:1: `clock` is missing: a whole number from 1000 to 4000000000");
    EXPECT_EQ(mistakes(with("clock = 1_000_000", "clock = \"fast\"")),
              "b.toml:2: `clock` must be a whole number from 1000 to 4000000000, found 'fast'");
    EXPECT_EQ(mistakes(with("size = 0x10000", "size = 0x10001")),
              "b.toml:5: `size` must be a multiple of 0x1000 from 0x1000 to 0xFFFFF000, found 0x10001");
    EXPECT_EQ(mistakes(with("kind = \"irqmp\"", "kind = \"irq\"")),
              "b.toml:11: `kind` must be one of: irqmp, gptimer, apbuart, ahbstat, ftmctrl, scrubber, protection, "
              "registers, dsu, grspw2, report, found 'irq'");
    EXPECT_THAT(mistakes(with("interrupt = 6", "interrupt = 14")),
                HasSubstr("3 timers from interrupt 14 on: the last interrupt is 15"));
    EXPECT_THAT(mistakes(with("interrupt = 3", "interrupt = 3\nbaud = 9600")),
                HasSubstr("unknown key `baud`; choose of: kind, name, address, wait, interrupt, timed"));
    EXPECT_THAT(mistakes("name = \n"), HasSubstr("b.toml:1: "));
    EXPECT_THAT(mistakes(""), HasSubstr("[ram] must be a table"));
    EXPECT_THAT(mistakes(with("[[device]]\nkind = \"irqmp\"\naddress = 0x80000200\n", "")),
                HasSubstr("a device of the kind `irqmp` is missing"));
    EXPECT_THAT(mistakes(with("tick = 10", "tick = 10\nlines = [{board = \"a\", line = 1, interrupt = 16}]")),
                HasSubstr("`interrupt` must be a whole number from 1 to 15, found 16"));
    EXPECT_THAT(mistakes(with("tick = 10", "tick = 10\nlines = [{board = \"a\", line = 1, interrupt = \"stop\"}]")),
                HasSubstr("or \"reset\""));
}

TEST(Board, keys_too_deep_are_one_line)
{
    for (const std::size_t n : {31u, 2'000u, 100'000u}) {
        std::string key = "a";
        for (std::size_t i = 0; i < n; i++) {
            key += i % 3 ? ".a" : " . \"b.c\"";
        }
        for (const std::string &text : {key + " = 1\n", "[" + key + "]\n", "x = {y = 1.5, " + key + " = 1}\n"}) {
            const std::string found = mistakes(board_text + text);
            EXPECT_EQ(found.find("a key has at most 32 parts") != std::string::npos, n > 31) << n << found;
            EXPECT_EQ(std::count(found.begin(), found.end(), '\n'), 0) << found;
        }
    }
    EXPECT_THAT(mistakes(with("name = \"", "# " + std::string(99, '.') + "\nname = \"" + std::string(99, '.'))),
                Not(HasSubstr("parts")));
}

TEST(Board, overlaps_are_named)
{
    EXPECT_EQ(mistakes(with("address = 0x80000300", "address = 0x80000200")),
              "b.toml:13: device `gptimer` at 0x80000200 to 0x800002FF overlaps device `irqmp` at 0x80000200 to "
              "0x800002FF");
    EXPECT_THAT(mistakes(with("address = 0xA0000000", "address = 0x40000000")),
                HasSubstr("device `registers` at 0x40000000 to 0x400FFFFF overlaps [ram] at 0x40000000 to 0x4000FFFF"));
    EXPECT_THAT(mistakes(with("base = 0x40000000", "base = 0xFFFF0000")), HasSubstr("overlaps the table of the AHB"));
    EXPECT_THAT(mistakes(board_text + "[[device]]\nkind = \"apbuart\"\naddress = 0x80000900\ninterrupt = 4\n"),
                HasSubstr("another device has the name `apbuart`; give this one a `name`"));
}

TEST(Board, lines_of_the_register_space)
{
    const BoardDescription b =
        BoardDescription::parse(with("tick = 10", "tick = 10\nlines = [{board = \"a\", line = 1, interrupt = 12}, "
                                                  "{board = \"b\", line = 0, interrupt = \"reset\"}]"),
                                "b.toml");
    const auto &lines = b.devices.back().registers.lines;
    ASSERT_EQ(lines.size(), 2u);
    EXPECT_EQ(lines[0].interrupt, 12u);
    EXPECT_EQ(lines[1].interrupt, 0u);
}

TEST(Board, damaged_files_are_refused_or_work)
{
    std::mt19937 random(1);
    for (int i = 0; i < 300; i++) {
        std::string text = board_text;
        for (int n = 0; n < 3; n++) {
            const std::size_t at = random() % text.size();
            switch (random() % 3) {
            case 0: text[at] = static_cast<char>(random() % 128); break;
            case 1: text.erase(at, random() % 20); break;
            default: text.insert(at, text.substr(random() % text.size(), random() % 20)); break;
            }
        }
        try {
            Machine machine(BoardDescription::parse(text, "b.toml"), EngineKind::interpreter);
        } catch (const Error &e) {
            EXPECT_THAT(e.what(), HasSubstr("b.toml:"));
        }
    }
}

} // namespace board_test
} // namespace fledge::emulator
