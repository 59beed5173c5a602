// SPDX-License-Identifier: Apache-2.0
// No name leads out of the folder of a store.
#include "ccsds/store/posix_store.h"
#include "ccsds/testing/bits.h"
#include "ccsds/testing/folder.h"

#include <gtest/gtest.h>

#include <fstream>
#include <iterator>

namespace posix_store_test {

using namespace ccsds::testing;

TEST(PosixStore, stays_in_its_folder)
{
    const Folder folder;
    std::filesystem::create_directories(folder.path / "root/inside");
    std::ofstream(folder.path / "secret") << "secret";
    std::ofstream(folder.path / "root/inside/file") << "file";
    std::filesystem::create_symlink("../secret", folder.path / "root/link");
    std::filesystem::create_directory_symlink("..", folder.path / "root/up");
    std::filesystem::create_directory_symlink("inside", folder.path / "root/there");
    PosixStore posix{};
    CfdpStore store{};
    EXPECT_EQ(posix_store_open(&posix, (folder.path / "none").c_str(), 100, &store), 0);
    ASSERT_EQ(posix_store_open(&posix, (folder.path / "root").c_str(), 100, &store), 1);
    for (const char *name : {"../secret", "inside/../../secret", "/etc/passwd", "link", "up/secret", "there/file",
                             "inside", "./inside/file", "inside//file", "", ".", "..", "inside/"}) {
        for (const CfdpOpen how : {CFDP_OPEN_READ, CFDP_OPEN_WRITE, CFDP_OPEN_NEW}) {
            EXPECT_EQ(store.open(store.user, name, how), CFDP_REFUSED) << name;
        }
        if (std::string(name) != "link" && std::string(name) != "inside") {
            EXPECT_EQ(store.rename(store.user, "inside/file", name), CFDP_REFUSED) << name;
            EXPECT_LT(store.remove(store.user, name), 0) << name;
            EXPECT_LT(store.make_directory(store.user, name), 0) << name;
        }
    }
    EXPECT_EQ(store.open(store.user, "none", CFDP_OPEN_READ), CFDP_ABSENT);
    EXPECT_EQ(store.remove(store.user, "none"), CFDP_ABSENT);
    EXPECT_EQ(store.remove_directory(store.user, "none"), CFDP_ABSENT);
    EXPECT_EQ(store.remove_directory(store.user, "inside"), CFDP_REFUSED); // it is not empty
    const int file = store.open(store.user, "inside/new", CFDP_OPEN_NEW);
    ASSERT_GE(file, 0);
    const Bytes data{1, 2, 3};
    Bytes back(3);
    EXPECT_EQ(store.write(store.user, file, 97, data.data(), 3), 0);
    EXPECT_EQ(store.write(store.user, file, 98, data.data(), 3), CFDP_FULL);
    EXPECT_EQ(store.write(store.user, file, UINT64_MAX, data.data(), 3), CFDP_FULL);
    EXPECT_EQ(store.read(store.user, file, 97, back.data(), 3), 0);
    EXPECT_EQ(back, data);
    EXPECT_EQ(store.read(store.user, file, 98, back.data(), 3), CFDP_BROKEN);
    EXPECT_EQ(store.size(store.user, file), 100);
    posix.room = 10000; // of which a write takes a block of the disk more
    EXPECT_EQ(store.write(store.user, file, 0, data.data(), 3), 0);
    EXPECT_EQ(store.write(store.user, file, 0, data.data(), 3), 0);
    EXPECT_EQ(posix.room, 10000u - 2 * 4099);
    EXPECT_EQ(store.write(store.user, file, 0, data.data(), 3), CFDP_FULL);
    EXPECT_EQ(store.open(store.user, "inside/more", CFDP_OPEN_NEW), CFDP_FULL);
    store.close(store.user, file);
    std::ifstream secret(folder.path / "secret");
    EXPECT_EQ(std::string(std::istreambuf_iterator<char>(secret), {}), "secret");
    posix_store_close(&posix);
}

} // namespace posix_store_test
