// SPDX-License-Identifier: Apache-2.0
#include "sim/archive_file.h"

#include "sim/testing/toys.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sys/resource.h>

#include <csignal>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>

namespace archive_file_test {

using namespace fledge::sim;
using namespace fledge::sim::toys;
using ::testing::HasSubstr;

TEST(ArchiveFile, TakesMessagesOfAnySizeAndSaysWhyItCannot)
{
    const std::string path = ::testing::TempDir() + "large.mcap";
    const std::vector<std::byte> image(5 << 20, std::byte{7});
    ArchiveFile file(path, 1);
    const auto channel = file.add_channel("/camera/image", "Image", "uint8[5242880] pixels\n");
    file.message(channel, 0, 1, image);
    file.message(channel, 1, 2, image);
    EXPECT_THAT(error_of([&] { file.message(channel, -1, 3, image); }),
                HasSubstr("cannot write " + path + ": bad argument; what was written before is in " + path + ".part"));
    EXPECT_GT(std::filesystem::file_size(path + ".part"), 2 * image.size());

    rlimit old{};
    getrlimit(RLIMIT_FSIZE, &old);
    const auto handler = std::signal(SIGXFSZ, SIG_IGN);
    const rlimit small{1 << 20, old.rlim_max};
    setrlimit(RLIMIT_FSIZE, &small);
    ArchiveFile limited(path, 1);
    const auto again = limited.add_channel("/camera/image", "Image", "uint8[5242880] pixels\n");
    const std::string why = error_of([&] { limited.message(again, 0, 1, image); });
    const rlimit none{0, old.rlim_max};
    setrlimit(RLIMIT_FSIZE, &none);
    const std::string at_once = error_of([] { ArchiveFile(::testing::TempDir() + "none.mcap", 1); });
    setrlimit(RLIMIT_FSIZE, &old);
    std::signal(SIGXFSZ, handler);
    EXPECT_THAT(at_once, HasSubstr("none.mcap: the file would exceed the limit on its size"));
    EXPECT_THAT(why, HasSubstr("cannot write " + path + ": the file would exceed the limit on its size"));
    std::remove((path + ".part").c_str());
}

TEST(ArchiveFile, AProgramGoesOnWithTheFileOfALostOneWheneverThatWasKilled)
{
    const std::string path = ::testing::TempDir() + "taken.mcap", part = path + ".part", lost = path + ".lost";
    const std::vector<std::byte> large(600'000, std::byte{7}), huge(3 << 20, std::byte{8});
    const auto begun = [&] {
        auto file = std::make_unique<ArchiveFile>(path, 2);
        file->add_channel("/small", "Small", "float64 x\n");
        file->add_channel("/image", "Image", "uint8[600000] pixels\n", {{"camera", "left"}});
        return file;
    };
    const auto write = [&](ArchiveFile &file, int from, int to) {
        for (int i = from; i < to; i++) {
            const double x = i;
            file.message(1, i, static_cast<std::uint32_t>(i), std::as_bytes(std::span(&x, 1)));
            if (i % 10 == 3) {
                file.message(2, i, 0, i % 20 == 3 ? large : huge); // in chunks, and in one of its own
            }
        }
    };
    const auto bytes_of = [](const std::string &name) {
        std::ifstream in(name, std::ios::binary);
        return std::string(std::istreambuf_iterator<char>(in), {});
    };
    const auto end = [](std::unique_ptr<ArchiveFile> file) {
        file->metadata("end", {{"outcome", "passed"}, {"", ""}});
        file->close();
    };
    const auto made = [&] {
        auto file = begun();
        file->metadata("run", {{"mission", "none"}});
        return file;
    };
    auto whole = made();
    write(*whole, 0, 100);
    end(std::move(whole));
    const std::string expected = bytes_of(path);

    for (const int snapshot : {0, 3, 4, 14, 27, 99}) {
        SCOPED_TRACE(snapshot);
        auto file = made();
        write(*file, 0, snapshot);
        const McapMark mark = file->save();
        write(*file, snapshot, std::min(snapshot + 20, 100)); // what the next program repeats
        file->save();
        const std::string there = bytes_of(part);
        file.reset();
        std::ofstream(part, std::ios::binary) << there; // as a kill leaves it

        McapMark other = mark;
        other.crc++;
        EXPECT_FALSE(ArchiveFile::lost(path, other));
        EXPECT_FALSE(ArchiveFile::lost(path, McapMark{}));
        EXPECT_EQ(bytes_of(part), there);
        for (int killed = 0; killed < 2; killed++) { // as it begins to take over
            EXPECT_TRUE(ArchiveFile::lost(path, mark));
            begun().reset();
        }
        EXPECT_TRUE(ArchiveFile::lost(path, mark));
        auto next = begun();
        next->take_over(mark);
        EXPECT_FALSE(std::filesystem::exists(lost));
        write(*next, snapshot, 100);
        end(std::move(next));
        EXPECT_EQ(bytes_of(path), expected);

        // A finished file has it, too, with metadata that came later.
        std::ofstream(part, std::ios::binary) << expected;
        EXPECT_TRUE(ArchiveFile::lost(path, mark));
        next = begun();
        next->take_over(mark);
        write(*next, snapshot, 100);
        end(std::move(next));
        EXPECT_EQ(bytes_of(path), expected);
    }

    auto file = made();
    write(*file, 0, 10);
    const McapMark mark = file->save();
    file.reset();
    EXPECT_TRUE(ArchiveFile::lost(path, mark));
    ArchiveFile fewer(path, 1);
    fewer.add_channel("/small", "Small", "float64 x\n");
    EXPECT_THAT(error_of([&] { fewer.take_over(mark); }), HasSubstr("taken.mcap"));
    EXPECT_TRUE(std::filesystem::exists(lost)) << "nothing is lost";
    std::remove(lost.c_str());
    std::remove(part.c_str());
}

} // namespace archive_file_test
