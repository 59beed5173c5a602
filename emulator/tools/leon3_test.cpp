// SPDX-License-Identifier: Apache-2.0
// The program fledge_leon3 from outside. Flights of whole missions on it are those of python/fledge/targets.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <sys/wait.h>
#include <unistd.h>

#include "emulator/testing/board.h"
#include "emulator/testing/program.h"

namespace fledge::emulator {
namespace {

using namespace testing;
using ::testing::HasSubstr;

class Leon3 : public ::testing::Test {
protected:
    std::filesystem::path folder = std::filesystem::path(::testing::TempDir()) / ("leon3_" + std::to_string(getpid()));

    Leon3()
    {
        std::filesystem::create_directories(folder);
        write("board.toml", board_text);
    }
    ~Leon3() override { std::filesystem::remove_all(folder); }

    void write(const std::string &name, std::string_view text) { std::ofstream(folder / name) << text; }
    void write(const std::string &name, const std::vector<std::byte> &bytes)
    {
        write(name, {reinterpret_cast<const char *>(bytes.data()), bytes.size()});
    }
    std::string read(const std::string &name)
    {
        std::ifstream file(folder / name);
        return {std::istreambuf_iterator<char>(file), {}};
    }

    /// Runs the program in the folder; returns its exit code, and both of its outputs.
    std::pair<int, std::string> run(const std::string &arguments)
    {
        const std::string command = "cd " + folder.string() + " && " FLEDGE_LEON3 " " + arguments + " 2>&1";
        std::FILE *pipe = popen(command.c_str(), "r");
        std::string text;
        for (int c; (c = std::fgetc(pipe)) != EOF;) {
            text += static_cast<char>(c);
        }
        const int status = pclose(pipe);
        return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, text};
    }

    /// Sends OK, and ends with a status.
    static Words hello(std::int32_t status)
    {
        return store(0x80000100, 'O') + store(0x80000100, 'K') +
               Words{wr_psr(0, 0xC6), nop, nop, nop, mov(o(0), status), trap_always(0), nop};
    }
};

TEST_F(Leon3, a_program_runs_to_its_end)
{
    write("hello.elf", program_file(hello(3)));
    for (const char *engine : {"interpreter", "threaded", "translator"}) {
        const auto [status, text] = run(std::string("board.toml hello.elf --engine ") + engine);
        EXPECT_EQ(status, 3);
        EXPECT_EQ(text, "OK");
    }
    EXPECT_THAT(run("board.toml hello.elf --figures --timing plain").second, HasSubstr("instructions 22\ncycles 23\n"));
    EXPECT_EQ(run("board.toml hello.elf --console c.txt").second, "");
    EXPECT_EQ(read("c.txt"), "OK");
}

TEST_F(Leon3, an_error_is_reported)
{
    write("wrong.elf", program_file({wr_psr(0, 0xC6), nop, nop, nop, 0}));
    const auto [status, text] = run("board.toml wrong.elf");
    EXPECT_EQ(status, 1);
    EXPECT_THAT(text, HasSubstr("the processor is in its error mode, at 0x4000102c main+0x2c\n"
                                "  illegal_instruction (0x02) while traps are disabled"));
    EXPECT_THAT(text, HasSubstr("backtrace\n    #0  0x4000102c main+0x2c"));
}

TEST_F(Leon3, a_program_that_sleeps_for_ever_is_reported)
{
    write("sleeps.elf", program_file({power_down, nop, ba(0), nop}));
    const auto [status, text] = run("board.toml sleeps.elf");
    EXPECT_EQ(status, 1);
    EXPECT_THAT(text,
                HasSubstr("for an hour no interrupt has come: the processor waits for an interrupt, at 0x40001020"));
}

TEST_F(Leon3, time_may_be_limited)
{
    write("endless.elf", program_file({ba(0), nop}));
    const auto [status, text] = run("board.toml endless.elf --for 0.5 --figures");
    EXPECT_EQ(status, 0);
    EXPECT_THAT(text, HasSubstr("cycles 500000\nresets 0\nwatchdog 0\n"));
}

TEST_F(Leon3, mistakes_are_explained)
{
    write("hello.elf", program_file(hello(0)));
    write("text.elf", "no program");
    write("wrong.toml", "name = 1");
    EXPECT_EQ(run("board.toml text.elf"), std::pair(1, std::string("fledge_leon3: text.elf: is not an ELF file\n")));
    EXPECT_THAT(run("wrong.toml hello.elf").second, HasSubstr("fledge_leon3: wrong.toml:1: "));
    EXPECT_THAT(run("none.toml hello.elf").second, HasSubstr("none.toml: cannot be read"));
    EXPECT_THAT(run("board.toml hello.elf --record r.mcap").second,
                HasSubstr("--record needs a second device of the kind `apbuart`"));
    EXPECT_EQ(run("board.toml").first, 2);
    EXPECT_EQ(run("board.toml hello.elf --engine fast").first, 2);
    EXPECT_EQ(run("board.toml hello.elf --tables t.so").first, 2) << "it needs --registers";
    EXPECT_THAT(run("board.toml hello.elf --tables none.so --registers r").second, HasSubstr("--tables none.so: "));
    EXPECT_EQ(run("--help").first, 0);
}

} // namespace
} // namespace fledge::emulator
