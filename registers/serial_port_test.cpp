// SPDX-License-Identifier: Apache-2.0
// A serial port against a pseudo terminal: what passes, what is refused, and a device that vanishes.
#include "registers/serial_port.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <fcntl.h>
#include <filesystem>
#include <fstream>
#include <grp.h>
#include <optional>
#include <sched.h>
#include <string>
#include <sys/mount.h>
#include <sys/wait.h>
#include <tuple>
#include <unistd.h>
#include <vector>

#include <gtest/gtest.h>

#include "registers/outside.h"
#include "registers/testing/terminal.h"
#include "tests/error_of.h"

namespace serial_port_test {

using namespace fledge::registers;
using namespace std::chrono_literals;
using SerialPortTest = TerminalTest;

/// What the constructor says about a device.
std::string refusal(const std::string &path, std::uint32_t baud = 115200)
{
    return error_of<Error>([&] { const SerialPort port(path, baud); });
}

/// All bytes that come until there are n.
std::vector<std::byte> receive(SerialPort &port, std::size_t n)
{
    std::vector<std::byte> all(n);
    std::size_t got = 0;
    while (got < n && port.is_open()) {
        got += port.receive(std::span(all).subspan(got), 10s);
    }
    all.resize(got);
    return all;
}

TEST_F(SerialPortTest, EveryByteValuePassesAsItIsBothWays)
{
    SerialPort first;
    SerialPort second(first.path(), 115200);
    std::vector<std::byte> all(256);
    for (std::size_t i = 0; i < all.size(); i++) {
        all[i] = static_cast<std::byte>(i);
    }
    EXPECT_EQ(first.send(all), all.size());
    EXPECT_EQ(receive(second, all.size()), all);
    EXPECT_EQ(second.send(all), all.size());
    EXPECT_EQ(receive(first, all.size()), all);
}

TEST_F(SerialPortTest, WhatIsNoSerialDeviceIsRefusedWithTheReason)
{
    EXPECT_NE(refusal("/dev/no_such_device").find("there is no device /dev/no_such_device"), std::string::npos);
    EXPECT_NE(refusal("/dev/null").find("/dev/null is no serial device"), std::string::npos);
    EXPECT_NE(refusal("/").find("/ is a folder, no serial device; "), std::string::npos);
}

TEST_F(SerialPortTest, ADeviceThatAnotherProgramHoldsIsRefusedByItsName)
{
    std::array<int, 2> ready{}, end{};
    ASSERT_EQ(pipe(ready.data()), 0);
    ASSERT_EQ(pipe(end.data()), 0);
    const pid_t child = fork();
    if (child == 0) {
        close(end[1]);
        const SerialPort held;
        char byte = 1;
        const auto n = static_cast<ssize_t>(held.path().size());
        _exit(write(ready[1], held.path().data(), held.path().size()) == n && read(end[0], &byte, 1) == 0 ? 0 : 1);
    }
    std::string path(100, '\0'), name;
    path.resize(static_cast<std::size_t>(std::max<ssize_t>(read(ready[0], path.data(), path.size()), 0)));
    std::getline(std::ifstream("/proc/" + std::to_string(child) + "/comm"), name);
    EXPECT_EQ(refusal(path),
              path + " is held by " + name + " (process " + std::to_string(child) + "): end that program first");
    close(end[1]);
    int status = -1;
    waitpid(child, &status, 0);
    EXPECT_EQ(status, 0);

    const SerialPort mine;
    const std::optional<SerialPort> first(std::in_place, mine.path(), 9600U);
    EXPECT_NE(refusal(mine.path()).find("is held by "), std::string::npos);
}

TEST_F(SerialPortTest, ATerminalOfTheSameNumberInAnotherContainerHoldsNoDevice)
{
    const SerialPort mine;
    const std::optional<SerialPort> held(std::in_place, mine.path(), 9600U);
    const std::string number = mine.path().substr(mine.path().rfind('/') + 1);
    std::string pts = ::testing::TempDir() + "ptsXXXXXX";
    ASSERT_NE(mkdtemp(pts.data()), nullptr);
    std::array<int, 2> ready{}, end{};
    ASSERT_EQ(pipe(ready.data()), 0);
    ASSERT_EQ(pipe(end.data()), 0);
    const pid_t child = fork();
    if (child == 0) {
        for (int fd = STDERR_FILENO + 1; fd < 1024; fd++) { // among them the device, which would be held here, too
            if (fd != ready[1] && fd != end[0]) {
                close(fd);
            }
        }
        char opened = unshare(CLONE_NEWUSER | CLONE_NEWNS) == 0 &&
                      mount("devpts", pts.c_str(), "devpts", 0, "newinstance,ptmxmode=0666") == 0;
        for (int fd = -1; opened && fd < 0;) {
            opened = unlockpt(open((pts + "/ptmx").c_str(), O_RDWR | O_NOCTTY)) == 0;
            fd = open((pts + "/" + number).c_str(), O_RDWR | O_NOCTTY);
        }
        _exit(write(ready[1], &opened, 1) == 1 && read(end[0], &opened, 1) == 0 ? 0 : 1);
    }
    char opened = 0;
    ASSERT_EQ(read(ready[0], &opened, 1), 1);
    if (opened) {
        EXPECT_EQ(refusal(mine.path()), mine.path() + " is held by another program: end that program first");
    }
    close(end[1]);
    waitpid(child, nullptr, 0);
    rmdir(pts.c_str());
    if (!opened) {
        GTEST_SKIP() << "no other /dev/pts may be mounted here";
    }
}

TEST_F(SerialPortTest, WithoutTheRightToADeviceTheRemedyIsNamed)
{
    using std::filesystem::perms;
    if (getuid() != 0) {
        GTEST_SKIP() << "only root gives a device to another group";
    }
    constexpr gid_t dialout = 20;
    for (const auto &[mode, group, remedy] :
         {std::tuple{perms::group_read | perms::group_write, dialout, "sudo usermod -aG "},
          std::tuple{perms::group_read | perms::group_write, gid_t{0}, "sudo chmod a+rw "},
          std::tuple{perms::none, dialout, "sudo chmod a+rw "}}) {
        const SerialPort pty;
        std::array<int, 2> ends{};
        ASSERT_EQ(pipe(ends.data()), 0);
        ASSERT_EQ(chown(pty.path().c_str(), 0, group), 0);
        std::filesystem::permissions(pty.path(), mode);
        const pid_t child = fork();
        if (child == 0) {
            if (setgroups(0, nullptr) != 0 || setgid(65534) != 0 || setuid(65534) != 0) {
                _exit(1);
            }
            const std::string text = refusal(pty.path());
            _exit(write(ends[1], text.data(), text.size()) == static_cast<ssize_t>(text.size()) ? 0 : 1);
        }
        close(ends[1]);
        std::string text(1000, '\0');
        text.resize(static_cast<std::size_t>(std::max<ssize_t>(read(ends[0], text.data(), text.size()), 0)));
        close(ends[0]);
        waitpid(child, nullptr, 0);
        EXPECT_NE(text.find("you have no right to open " + pty.path() + ", which is of the group "), std::string::npos)
            << text;
        EXPECT_NE(text.find(remedy), std::string::npos) << text;
    }
}

TEST_F(SerialPortTest, ADeviceThatVanishesIsNoticedAndFoundAgain)
{
    const auto link = std::filesystem::temp_directory_path() / ("serial_port_" + std::to_string(getpid()));
    std::optional<SerialPort> board(std::in_place);
    std::filesystem::create_symlink(board->path(), link);
    SerialPort port(link, 115200);
    board.reset();
    std::array<std::byte, 16> room{};
    EXPECT_EQ(port.receive(room, 10s), 0U);
    EXPECT_FALSE(port.is_open());
    EXPECT_EQ(port.send(room), 0U);
    std::filesystem::remove(link);
    EXPECT_FALSE(port.reopen());
    board.emplace();
    std::filesystem::create_symlink(board->path(), link);
    EXPECT_TRUE(port.reopen());
    EXPECT_EQ(board->send(room), room.size());
    EXPECT_EQ(receive(port, room.size()).size(), room.size());
    std::filesystem::remove(link);
}

} // namespace serial_port_test
