// SPDX-License-Identifier: Apache-2.0
// Two processes on one file: lock-step, patterned packets at full speed, and kill -9 on either.
#include "registers/shared_file.h"

#include <cerrno>
#include <chrono>
#include <csignal>
#include <fcntl.h>
#include <filesystem>
#include <functional>
#include <set>
#include <string>
#include <sys/wait.h>
#include <unistd.h>
#include <vector>

#include <gtest/gtest.h>

#include "registers/clock.h"
#include "registers/testing/board.h"

namespace shared_file_test {

using namespace fledge::registers::testing;

constexpr std::int64_t SECOND = 1'000'000'000;
constexpr std::int64_t LONG = 20 * SECOND; // on a busy machine

// Runs in a process of its own; its result is the exit code.
pid_t in_a_process(const std::function<int()> &run)
{
    const pid_t pid = fork();
    if (pid == 0) {
        _exit(run());
    }
    return pid;
}

int exit_code_of(pid_t pid)
{
    int status = 0;
    waitpid(pid, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

class SharedFile : public ::testing::Test {
protected:
    SharedFile()
        : bench_({{REGISTER_PACKET, PLAIN, 64, 4, false, 1, 0},
                  {REGISTER_PACKET, QUEUED | REGISTER_FROM_FLIGHT, 64, 8, true, 1, 1}},
                 true)
    {
        folder_ = std::filesystem::temp_directory_path() / ("registers_test_" + std::to_string(getpid()));
        std::filesystem::create_directory(folder_);
        path_ = (folder_ / "board").string();
    }
    ~SharedFile() override
    {
        EXPECT_TRUE(std::filesystem::is_empty(folder_)); // nothing is ever left over
        std::filesystem::remove_all(folder_);
    }

    RegisterFileStatus create(const char *path) { return register_file_create(&file_, path, boards_, 1, &window_); }

    // As the creator writes the file in its own time, the other one tries until it is there.
    static RegisterFileStatus attach(const std::string &path, const RegisterBoard *const *boards, RegisterFile *file,
                                     RegisterWindow *window)
    {
        RegisterFileStatus status = REGISTER_FILE_NOT_YET;
        for (int i = 0; i < 20000 && status == REGISTER_FILE_NOT_YET; i++) {
            status = register_file_attach(file, path.c_str(), boards, 1, window);
            usleep(status == REGISTER_FILE_NOT_YET ? 1000 : 0);
        }
        return status;
    }

    // The result of a wait once every ring of the other side was seen.
    RegisterFileStatus end_of_ringing()
    {
        RegisterFileStatus status;
        do {
            status = register_file_wait(&file_, LONG);
        } while (status == REGISTER_FILE_RANG);
        return status;
    }

    Bench bench_;
    const RegisterBoard *board_ = &bench_.board();
    const RegisterBoard *boards_[1] = {board_};
    RegisterFile file_{};
    RegisterWindow window_{};
    std::filesystem::path folder_;
    std::string path_;
};

// Flight of the tests: answers each tick with the packet of that tick, upside down.
int fly(const std::string &path, const RegisterBoard *const *boards)
{
    RegisterFile file;
    RegisterWindow w;
    RegisterFileStatus status = REGISTER_FILE_NOT_YET;
    for (int i = 0; i < 20000 && status == REGISTER_FILE_NOT_YET; i++) {
        status = register_file_attach(&file, path.c_str(), boards, 1, &w);
        usleep(status == REGISTER_FILE_NOT_YET ? 1000 : 0);
    }
    if (status != REGISTER_FILE_OK) {
        return 10 + status;
    }
    for (;;) {
        Tick tick;
        if (register_clock_due(&w, &tick)) {
            std::int64_t packet[8];
            RegisterInfo info;
            if (register_take(&w, &boards[0]->lanes[0], packet, 64, &info) != REGISTER_OK || packet[7] != tick.t) {
                return 2;
            }
            for (std::int64_t &v : packet) {
                v = ~tick.t;
            }
            register_put(&w, &boards[0]->lanes[1], packet, 64, 5);
            register_clock_finish(&w);
            continue;
        }
        if (register_clock_stopped(&w)) {
            break;
        }
        if (register_file_wait(&file, LONG) != REGISTER_FILE_RANG) {
            return 3;
        }
    }
    register_file_close(&file);
    return 0;
}

bool exchange(RegisterFile *file, const RegisterWindow *w, std::int64_t t)
{
    const std::int64_t packet[8] = {t, t, t, t, t, t, t, t};
    register_put(w, &w->board->lanes[0], packet, 64, 0);
    register_clock_start(w, {t, 1});
    while (!register_clock_is_done(w)) {
        if (register_file_wait(file, LONG) != REGISTER_FILE_RANG) {
            return false;
        }
    }
    std::int64_t answer[8];
    RegisterInfo info;
    return register_take(w, &w->board->lanes[1], answer, 64, &info) == REGISTER_OK && answer[0] == ~t &&
           answer[7] == ~t && info.tag == 5;
}

TEST_F(SharedFile, TwoProcessesGoInStep)
{
    ASSERT_EQ(create(path_.c_str()), REGISTER_FILE_OK);
    const pid_t child = in_a_process([&] { return fly(path_, boards_); });
    auto quickest = std::chrono::steady_clock::duration::max(); // on a busy machine, others take long
    for (std::int64_t t = 1; t <= 500;) {
        const auto start = std::chrono::steady_clock::now();
        for (int i = 0; i < 50; i++, t++) {
            ASSERT_TRUE(exchange(&file_, &window_, t)) << t;
        }
        quickest = std::min(quickest, std::chrono::steady_clock::now() - start);
    }
    // Without the wake-up, each side would sleep until its next look: 100 times 50 ms.
    EXPECT_LT(quickest, std::chrono::milliseconds(2500));
    EXPECT_EQ(register_handle(&window_, 1), 500u);
    EXPECT_FALSE(std::filesystem::exists(path_)); // once both have it, it has no name
    register_clock_stop(&window_);
    EXPECT_EQ(exit_code_of(child), 0);
    EXPECT_EQ(end_of_ringing(), REGISTER_FILE_GONE);
    register_file_close(&file_);
}

TEST_F(SharedFile, WithoutANameAChildAttachesToTheDescriptor)
{
    ASSERT_EQ(create(nullptr), REGISTER_FILE_OK);
    const std::string path = "/dev/fd/" + std::to_string(file_.fd);
    const pid_t child = in_a_process([&] {
        const int failed = fly(path, boards_);
        return failed ? failed : fcntl(file_.fd, F_GETFD) != -1; // the creator's: closed
    });
    EXPECT_TRUE(exchange(&file_, &window_, 77));
    register_clock_stop(&window_);
    EXPECT_EQ(exit_code_of(child), 0);
    register_file_close(&file_);
}

TEST_F(SharedFile, PacketsAtFullSpeedAreWholeAndCounted)
{
    constexpr std::uint64_t N = 20000;
    ASSERT_EQ(create(path_.c_str()), REGISTER_FILE_OK);
    const pid_t child = in_a_process([&] {
        RegisterFile file;
        RegisterWindow w;
        if (attach(path_, boards_, &file, &w) != REGISTER_FILE_OK) {
            return 1;
        }
        for (std::uint64_t i = 1; i <= N; i++) {
            const std::uint64_t packet[8] = {i, i, i, i, i, i, i, i};
            register_put(&w, &board_->lanes[0], packet, 64, 0);
            register_put(&w, &board_->lanes[1], packet, 64, 0);
        }
        return 0;
    });
    std::uint64_t last[2] = {}, taken = 0;
    for (bool gone = false; !gone;) {
        gone = register_file_wait(&file_, SECOND / 1000) == REGISTER_FILE_GONE;
        for (std::size_t k : {0, 1}) {
            std::uint64_t packet[8];
            RegisterInfo info;
            while (register_take(&window_, &board_->lanes[k], packet, 64, &info) == REGISTER_OK) {
                taken += k;
                ASSERT_GT(packet[0], last[k]);
                last[k] = packet[0];
                for (std::uint64_t v : packet) {
                    ASSERT_EQ(v, last[k]);
                }
            }
        }
    }
    EXPECT_EQ(exit_code_of(child), 0);
    EXPECT_EQ(last[0], N);
    EXPECT_EQ(taken + register_lost(&window_, &board_->lanes[1]), N);
    EXPECT_EQ(register_interrupts(&window_, 0), N);
    register_file_close(&file_);
}

TEST_F(SharedFile, ADeadFlightIsSeenAndLeavesNothing)
{
    ASSERT_EQ(create(path_.c_str()), REGISTER_FILE_OK);
    const pid_t child = in_a_process([&] { return fly(path_, boards_); });
    ASSERT_TRUE(exchange(&file_, &window_, 1));
    EXPECT_TRUE(register_file_peer_lives(&file_));
    kill(child, SIGKILL);
    EXPECT_EQ(exit_code_of(child), -SIGKILL);
    EXPECT_FALSE(register_file_peer_lives(&file_));
    EXPECT_EQ(end_of_ringing(), REGISTER_FILE_GONE);
    EXPECT_FALSE(std::filesystem::exists(path_));
    register_file_close(&file_);
}

TEST_F(SharedFile, ADeadCreatorIsSeenAndLeavesNothing)
{
    const pid_t child = in_a_process([&] {
        if (create(path_.c_str()) != REGISTER_FILE_OK) {
            return 1;
        }
        pause();
        return 0;
    });
    RegisterFile file;
    RegisterWindow w;
    ASSERT_EQ(attach(path_, boards_, &file, &w), REGISTER_FILE_OK);
    EXPECT_FALSE(std::filesystem::exists(path_));
    EXPECT_EQ(register_file_wait(&file, SECOND / 1000), REGISTER_FILE_TIMEOUT);
    kill(child, SIGKILL);
    EXPECT_EQ(exit_code_of(child), -SIGKILL);
    EXPECT_EQ(register_file_wait(&file, LONG), REGISTER_FILE_GONE);
    register_file_close(&file);
}

TEST_F(SharedFile, AFileOfADeadCreatorIsTakenOverAndOfALivingOneRefused)
{
    int ready[2];
    ASSERT_EQ(pipe(ready), 0);
    const pid_t child = in_a_process([&] {
        const bool made = create(path_.c_str()) == REGISTER_FILE_OK;
        if (write(ready[1], "x", 1) == 1 && made) {
            pause();
        }
        return 1;
    });
    char byte;
    ASSERT_EQ(read(ready[0], &byte, 1), 1);
    EXPECT_EQ(create(path_.c_str()), REGISTER_FILE_IN_USE);
    kill(child, SIGKILL);
    EXPECT_EQ(exit_code_of(child), -SIGKILL);
    EXPECT_TRUE(std::filesystem::exists(path_));
    RegisterFile file;
    RegisterWindow w;
    EXPECT_EQ(register_file_attach(&file, path_.c_str(), boards_, 1, &w), REGISTER_FILE_NOT_YET);
    EXPECT_EQ(create(path_.c_str()), REGISTER_FILE_OK);
    register_file_close(&file_); // no peer attached: close removes the name too
    close(ready[0]);
    close(ready[1]);
}

TEST(SharedFileStatus, EachHasWordsOfItsOwn)
{
    std::set<std::string> words;
    for (int status = REGISTER_FILE_OK; status <= REGISTER_FILE_FAILED; status++) {
        const char *text = register_file_status_text(static_cast<RegisterFileStatus>(status));
        ASSERT_NE(text, nullptr);
        EXPECT_STRNE(text, "unknown");
        EXPECT_TRUE(words.insert(text).second) << text;
    }
}

TEST_F(SharedFile, ARefusedNameClosesNoDescriptor)
{
    const int least = open("/dev/null", O_RDONLY); // the lowest free descriptor
    ASSERT_GE(least, 0);
    close(least);
    EXPECT_EQ(create(std::string(sizeof file_.path, 'x').c_str()), REGISTER_FILE_FAILED);
    EXPECT_EQ(file_.error, ENAMETOOLONG);
    EXPECT_EQ(create((folder_ / "none" / "board").c_str()), REGISTER_FILE_FAILED);
    EXPECT_EQ(file_.error, ENOENT);
    register_file_close(&file_);
    const int next = open("/dev/null", O_RDONLY);
    EXPECT_EQ(next, least);
    close(next);
}

TEST_F(SharedFile, OtherBoardsAndASecondPeerAreRefused)
{
    RegisterFile file, second;
    RegisterWindow w;
    EXPECT_EQ(register_file_attach(&file, path_.c_str(), boards_, 1, &w), REGISTER_FILE_NOT_YET);
    ASSERT_EQ(create(path_.c_str()), REGISTER_FILE_OK);
    RegisterBoard other = *board_;
    const RegisterBoard *others[1] = {&other};
    other.hash++;
    EXPECT_EQ(register_file_attach(&file, path_.c_str(), others, 1, &w), REGISTER_FILE_OTHER);
    other = *board_;
    other.size += 64;
    EXPECT_EQ(register_file_attach(&file, path_.c_str(), others, 1, &w), REGISTER_FILE_OTHER);
    const std::string link = path_ + "_2";
    std::filesystem::create_hard_link(path_, link);
    EXPECT_EQ(register_file_attach(&file, path_.c_str(), boards_, 1, &w), REGISTER_FILE_OK);
    EXPECT_EQ(register_file_attach(&second, link.c_str(), boards_, 1, &w), REGISTER_FILE_IN_USE);
    std::filesystem::remove(link);
    register_file_close(&file);
    register_file_close(&file_);
    EXPECT_EQ(create((folder_ / std::string(300, 'x')).c_str()), REGISTER_FILE_FAILED);
    EXPECT_EQ(file_.error, ENAMETOOLONG);
}

} // namespace shared_file_test
