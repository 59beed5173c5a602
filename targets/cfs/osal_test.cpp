// SPDX-License-Identifier: Apache-2.0
// OSAL: semaphores and files, used by tasks at the same time.
#include "targets/cfs/testing/pocket.h"

#include <atomic>
#include <map>
#include <random>

namespace osal_test {

class Osal : public Pocket {};

std::atomic<int> inside, most, count;
osal_id_t mutex_id, binary, counting, done;
int shared; // guarded by the mutex only: the thread sanitizer watches

extern "C" void adder(void)
{
    for (int i = 0; i < 500; i++) {
        OS_MutSemTake(mutex_id);
        OS_MutSemTake(mutex_id); // its owner may take it again
        most = std::max(most.load(), ++inside);
        shared++;
        inside--;
        OS_MutSemGive(mutex_id);
        OS_MutSemGive(mutex_id);
    }
    OS_CountSemGive(done);
}

TEST_F(Osal, AMutexLetsInOneTask)
{
    shared = 0;
    inside = most = 0;
    ASSERT_EQ(OS_MutSemCreate(&mutex_id, "m", 0), 0);
    ASSERT_EQ(OS_CountSemCreate(&done, "done", 0, 0), 0);
    osal_id_t task;
    for (int i = 0; i < 4; i++) {
        ASSERT_EQ(OS_TaskCreate(&task, "adder", adder, nullptr, 16384, 50, 0), 0);
    }
    for (int i = 0; i < 4; i++) {
        ASSERT_EQ(OS_CountSemTimedWait(done, 60000), 0);
    }
    EXPECT_EQ(shared, 2000);
    EXPECT_EQ(most, 1);
    EXPECT_EQ(OS_MutSemGive(mutex_id), OS_SEM_FAILURE); // no task holds it
}

extern "C" void pong(void)
{
    for (int i = 0; i < 500 && OS_BinSemTake(binary) == 0; i++) {
        OS_CountSemGive(counting);
    }
}

TEST_F(Osal, TwoTasksTakeTurns)
{
    ASSERT_EQ(OS_BinSemCreate(&binary, "ping", OS_SEM_EMPTY, 0), 0);
    ASSERT_EQ(OS_CountSemCreate(&counting, "pong", 0, 0), 0);
    osal_id_t task;
    ASSERT_EQ(OS_TaskCreate(&task, "pong", pong, nullptr, 16384, 50, 0), 0);
    for (int i = 0; i < 500; i++) {
        ASSERT_EQ(OS_BinSemGive(binary), 0);
        ASSERT_EQ(OS_CountSemTimedWait(counting, 60000), 0);
    }
    EXPECT_EQ(OS_CountSemTimedWait(counting, 1), OS_SEM_TIMEOUT);
}

TEST_F(Osal, ABinarySemaphoreHoldsOne)
{
    ASSERT_EQ(OS_BinSemCreate(&binary, "b", OS_SEM_FULL, 0), 0);
    EXPECT_EQ(OS_BinSemGive(binary), 0);
    EXPECT_EQ(OS_BinSemTake(binary), 0);
    EXPECT_EQ(OS_BinSemTimedWait(binary, 0), OS_SEM_TIMEOUT);
    osal_id_t other;
    EXPECT_EQ(OS_BinSemCreate(&other, "b", 0, 0), OS_ERR_NAME_TAKEN);
    EXPECT_EQ(OS_BinSemCreate(&other, "c", 2, 0), OS_INVALID_SEM_VALUE);
    EXPECT_EQ(OS_CountSemTake(binary), OS_ERR_INVALID_ID); // it is of another kind
    EXPECT_EQ(OS_BinSemDelete(binary), 0);
    EXPECT_EQ(OS_BinSemGive(binary), OS_ERR_INVALID_ID);
    ASSERT_EQ(OS_BinSemCreate(&other, "b", OS_SEM_FULL, 0), 0);
    EXPECT_NE(other, binary);
    EXPECT_EQ(OS_BinSemTake(binary), OS_ERR_INVALID_ID);
}

extern "C" void waiter(void)
{
    OS_BinSemTake(binary);
    OS_CountSemGive(done);
}

TEST_F(Osal, AFlushLetsAllGoOn)
{
    ASSERT_EQ(OS_BinSemCreate(&binary, "b", OS_SEM_EMPTY, 0), 0);
    ASSERT_EQ(OS_CountSemCreate(&done, "done", 0, 0), 0);
    osal_id_t task;
    for (int i = 0; i < 3; i++) {
        ASSERT_EQ(OS_TaskCreate(&task, "waiter", waiter, nullptr, 16384, 50, 0), 0);
    }
    for (int passed = 0; passed < 3;) { // a task that begins to wait after a flush needs another one
        ASSERT_EQ(OS_BinSemFlush(binary), 0);
        passed += OS_CountSemTimedWait(done, 5) == 0;
    }
}

TEST_F(Osal, ADeletedTaskEndsWhereItWaits)
{
    ASSERT_EQ(OS_BinSemCreate(&binary, "b", OS_SEM_EMPTY, 0), 0);
    ASSERT_EQ(OS_CountSemCreate(&done, "done", 0, 0), 0);
    osal_id_t task;
    ASSERT_EQ(OS_TaskCreate(&task, "waiter", waiter, nullptr, 16384, 50, 0), 0);
    ASSERT_EQ(OS_TaskDelete(task), 0);
    while (OS_TaskDelete(task) == 0) { // until it is gone
        OS_TaskDelay(1);
    }
    ASSERT_EQ(OS_BinSemGive(binary), 0);
    EXPECT_EQ(OS_CountSemTimedWait(done, 5), OS_SEM_TIMEOUT);
}

TEST_F(Osal, FilesAreBelowTwoFolders)
{
    osal_id_t f;
    EXPECT_LT(OS_OpenCreate(&f, "/etc/passwd", OS_FILE_FLAG_NONE, OS_READ_ONLY), 0);
    EXPECT_LT(OS_OpenCreate(&f, "/cf/../secret", OS_FILE_FLAG_NONE, OS_READ_ONLY), 0);
    EXPECT_LT(OS_OpenCreate(&f, "/cf/absent", OS_FILE_FLAG_NONE, OS_READ_ONLY), 0);
    ASSERT_EQ(OS_OpenCreate(&f, "/ram/x", OS_FILE_FLAG_CREATE | OS_FILE_FLAG_TRUNCATE, OS_READ_WRITE), 0);
    EXPECT_EQ(OS_write(f, "abcdef", 6), 6);
    EXPECT_EQ(OS_lseek(f, 2, OS_SEEK_SET), 2);
    char text[8] = {};
    EXPECT_EQ(OS_read(f, text, sizeof text), 4);
    EXPECT_STREQ(text, "cdef");
    EXPECT_EQ(OS_read(f, text, sizeof text), 0);
    EXPECT_EQ(OS_close(f), 0);
    EXPECT_EQ(OS_close(f), OS_ERR_INVALID_ID);
#ifndef POCKET_BARE
    EXPECT_TRUE(std::filesystem::exists(folder / "ram/x"));
#endif
    EXPECT_EQ(OS_remove("/ram/x"), 0);
    EXPECT_EQ(OS_remove("/ram/x"), OS_ERROR);
}

// Four files, open for a while, at random: they hold what strings hold.
TEST_F(Osal, FilesHoldWhatAPlainModelDoes)
{
    const auto path = [](unsigned i) { return std::string("/ram/") + char('a' + i); };
    std::mt19937 random(1);
    std::map<unsigned, std::string> model;
    for (int round = 0; round < 400; round++) {
        const unsigned i = random() % 4, to = random() % 4;
        osal_id_t f;
        if (const unsigned choice = random() % 8; choice == 0) {
            EXPECT_EQ(OS_remove(path(i).c_str()) == 0, model.erase(i) == 1);
            continue;
        } else if (choice == 1 && i != to) {
            ASSERT_EQ(OS_rename(path(i).c_str(), path(to).c_str()) == 0, model.count(i) == 1);
            if (model.count(i) == 1) {
                model[to] = model[i];
                model.erase(i);
            }
            continue;
        }
        const int flags = int(random() % 4);
        const bool there = model.count(i) == 1 || (flags & OS_FILE_FLAG_CREATE) != 0;
        ASSERT_EQ(OS_OpenCreate(&f, path(i).c_str(), flags, OS_READ_WRITE) == 0, there) << round;
        if (!there) {
            continue;
        }
        std::string &content = model[i];
        content.resize((flags & OS_FILE_FLAG_TRUNCATE) != 0 ? 0 : content.size());
        for (std::size_t at = 0; random() % 6 != 0;) {
            char bytes[300];
            const std::size_t n = random() % sizeof bytes;
            if (const unsigned step = random() % 3; step == 0) {
                at = random() % 1000;
                ASSERT_EQ(OS_lseek(f, std::int32_t(at), OS_SEEK_SET), std::int32_t(at));
            } else if (step == 1) {
                std::memset(bytes, 'A' + round % 26, n);
                ASSERT_EQ(OS_write(f, bytes, n), std::int32_t(n));
                content.resize(n > 0 ? std::max(content.size(), at + n) : content.size());
                content.replace(n > 0 ? at : 0, n, bytes, n);
                at += n;
            } else {
                const std::string expected = at < content.size() ? content.substr(at, n) : "";
                ASSERT_EQ(OS_read(f, bytes, n), std::int32_t(expected.size()));
                ASSERT_EQ(std::string(bytes, expected.size()), expected) << round;
                at += expected.size();
            }
        }
        EXPECT_EQ(OS_close(f), 0);
    }
}

#ifndef POCKET_BARE // a board has no folders
TEST_F(Osal, FoldersHaveEntries)
{
    osal_id_t f;
    EXPECT_EQ(OS_mkdir("/ram/d", OS_READ_WRITE), 0);
    EXPECT_EQ(OS_mkdir("/ram/d", OS_READ_WRITE), OS_ERROR);
    EXPECT_EQ(OS_mkdir("/etc/d", OS_READ_WRITE), OS_ERROR);
    for (const char *name : {"/ram/d/one", "/ram/d/a name that is too long for an entry"}) {
        ASSERT_EQ(OS_OpenCreate(&f, name, OS_FILE_FLAG_CREATE, OS_READ_WRITE), 0);
        EXPECT_EQ(OS_close(f), 0);
    }
    EXPECT_EQ(OS_rename("/ram/d/one", "/ram/d/two"), 0);
    EXPECT_EQ(OS_rename("/ram/d/one", "/ram/d/two"), OS_ERROR);
    EXPECT_EQ(OS_rmdir("/ram/d"), OS_ERROR); // it is not empty
    osal_id_t d;
    EXPECT_EQ(OS_DirectoryOpen(&d, "/ram/d/two"), OS_ERROR);
    ASSERT_EQ(OS_DirectoryOpen(&d, "/ram/d"), 0);
    EXPECT_EQ(OS_close(d), OS_ERR_INVALID_ID); // it is of another kind
    std::vector<std::string> names;
    for (os_dirent_t entry; OS_DirectoryRead(d, &entry) == 0;) {
        names.emplace_back(OS_DIRENTRY_NAME(entry));
    }
    std::sort(names.begin(), names.end());
    EXPECT_EQ(names, (std::vector<std::string>{".", "..", "a name that is too ", "two"}));
    EXPECT_EQ(OS_DirectoryClose(d), 0);
    os_dirent_t entry;
    EXPECT_EQ(OS_DirectoryRead(d, &entry), OS_ERR_INVALID_ID);
}
#endif

} // namespace osal_test
