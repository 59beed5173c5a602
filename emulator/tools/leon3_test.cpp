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
namespace leon3_test {

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

TEST_F(Leon3, a_trap_without_a_handler_is_named)
{
    // The entry of data_access_exception halts, as those of BCC and RTEMS do.
    Words words = set(g(1), 0x60000000) + Words{nop, ld(g(2), g(1), 0), nop};
    Words table = trap_table();
    table[9 * 4] = trap_always(0);
    table.resize((code - base) / 4);
    auto file = make_elf(base, table + prologue() + words, {{"main", code, 100}});
    file[24 + 2] = static_cast<std::byte>(code >> 8 & 0xFF);
    write("wrong.elf", file);
    const auto [status, text] = run("board.toml wrong.elf");
    EXPECT_EQ(status, 1);
    EXPECT_THAT(text,
                HasSubstr("fledge_leon3: the program has no handler of data_access_exception (0x09), which came at "
                          "0x40001028 main+0x28\nthe processor is in its error mode"));
}

TEST_F(Leon3, a_program_with_a_single_vector_ends)
{
    // As BCC's: the code behind the vector halts at traps that it does not know, the end of the program among them.
    const auto ends = [this](const Words &last) {
        Words table = trap_table();
        table[0] = trap_always(0);
        table.resize((code - base) / 4);
        auto file =
            make_elf(base, table + prologue() + set(g(1), 1u << 13) + Words{with_register(2, 0x30, 17, g(1), 0)} + last,
                     {{"main", code, 100}});
        file[24 + 2] = static_cast<std::byte>(code >> 8 & 0xFF);
        write("vector.elf", file);
        return run("board.toml vector.elf");
    };
    EXPECT_EQ(ends({mov(o(0), 7), trap_always(0), nop}), std::pair(7, std::string()));
    EXPECT_THAT(ends({0}).second, HasSubstr("the program has no handler of illegal_instruction (0x02), which came at"));
}

TEST_F(Leon3, rtems_ends_with_the_status_of_exit)
{
    // As RTEMS does: the handler of `ta 0` halts behind the table, with the reason in %g1 to %g3.
    const auto ends = [this](std::int32_t source, std::int32_t status) {
        Words table = trap_table();
        table[0x80 * 4] = ba(static_cast<std::int32_t>((code - base) / 4) - 0x80 * 4);
        table[0x80 * 4 + 1] = nop;
        table.resize((code - base) / 4);
        auto file = make_elf(base,
                             table + Words{trap_always(0), nop} + prologue() +
                                 Words{mov(g(1), 1), mov(g(2), source), mov(g(3), status), trap_always(0), nop},
                             {{"main", code, 100}});
        file[24 + 2] = static_cast<std::byte>(code >> 8 & 0xFF);
        file[24 + 3] = std::byte{8};
        write("rtems.elf", file);
        return run("board.toml rtems.elf");
    };
    EXPECT_EQ(ends(5, 7), std::pair(7, std::string()));
    const auto [status, text] = ends(9, 0x40);
    EXPECT_EQ(status, 1);
    EXPECT_THAT(text, HasSubstr("RTEMS has stopped; the source is 9 (an exception), the code 0x40\n"));
}

/// Sends each byte that it receives, until that is a full stop.
const Words echo = set(g(1), 0x80000100) + Words{ld(g(2), g(1), 4),
                                                 with_number(2, 0x11, 0, g(2), 1),
                                                 branch(2, 1, false, -2),
                                                 nop,
                                                 ld(g(3), g(1), 0),
                                                 st(g(3), g(1), 0),
                                                 subcc(0, g(3), '.'),
                                                 branch(2, 9, false, -7),
                                                 nop,
                                                 wr_psr(0, 0xC6),
                                                 nop,
                                                 nop,
                                                 nop,
                                                 mov(o(0), 0),
                                                 trap_always(0),
                                                 nop};

TEST_F(Leon3, the_uart_receives_what_comes)
{
    write("echo.elf", program_file(echo));
    EXPECT_EQ(run("board.toml echo.elf --input - </dev/null --for 0.01"), std::pair(0, std::string()));
    const std::string many(5000, 'x'); // more than the UART holds
    write("in.txt", many + ".and no more");
    EXPECT_EQ(run("board.toml echo.elf --input - <in.txt"), std::pair(0, many + "."));
    EXPECT_THAT(run("board.toml echo.elf --input nowhere").second, HasSubstr("--input: expected [ADDRESS:]PORT"));
}

TEST_F(Leon3, a_client_talks_to_the_uart)
{
    write("echo.elf", program_file(echo));
    write("client.py", "import socket, subprocess, sys\n"
                       "board = subprocess.Popen(sys.argv[1:], stderr=subprocess.PIPE, text=True)\n"
                       "port = int(board.stderr.readline().split()[-1])\n"
                       "for said in b'ab', b'c.':\n"
                       "    with socket.create_connection(('127.0.0.1', port)) as s:\n"
                       "        s.sendall(said)\n"
                       "        assert s.recv(1) + s.recv(1) == said\n"
                       "sys.exit(board.wait())\n");
    std::FILE *pipe = popen(
        ("cd " + folder.string() + " && /usr/bin/python3 client.py " FLEDGE_LEON3 " board.toml echo.elf --input 0 2>&1")
            .c_str(),
        "r");
    std::string text;
    for (int c; (c = std::fgetc(pipe)) != EOF;) {
        text += static_cast<char>(c);
    }
    EXPECT_EQ(pclose(pipe), 0) << text;
    EXPECT_EQ(text, "abc.");
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
    EXPECT_THAT(run("board.toml text.elf").second, HasSubstr("fledge_leon3: text.elf: is not an ELF file, nor has it"));
    EXPECT_THAT(run("wrong.toml hello.elf").second, HasSubstr("fledge_leon3: wrong.toml:1: "));
    EXPECT_THAT(run("none.toml hello.elf").second, HasSubstr("none.toml: cannot be read"));
    EXPECT_THAT(run("board.toml hello.elf --record r.mcap").second,
                HasSubstr("--record needs a device of the kind `grspw2`, or a second one of `apbuart`"));
    EXPECT_EQ(run("board.toml").first, 2);
    EXPECT_EQ(run("board.toml hello.elf --engine fast").first, 2);
    EXPECT_EQ(run("board.toml hello.elf --tables t.so").first, 2) << "it needs --registers";
    EXPECT_THAT(run("board.toml hello.elf --tables none.so --registers r").second,
                HasSubstr("the tables of the mission, none.so: "));
    EXPECT_EQ(run("--help").first, 0);
}

} // namespace leon3_test
} // namespace fledge::emulator
