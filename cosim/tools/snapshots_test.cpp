// SPDX-License-Identifier: Apache-2.0
#include "cosim/tools/snapshots.h"
#include "sim/error.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <set>
#include <unistd.h>

namespace fledge::cosim {
namespace snapshots_test {

namespace files = std::filesystem;

Bytes bytes_of(const std::string &text)
{
    const auto bytes = std::as_bytes(std::span(text));
    return {bytes.begin(), bytes.end()};
}

class Snapshots : public testing::Test {
protected:
    Snapshots() : folder(testing::TempDir() + "snapshots-" + std::to_string(getpid()) + "/x") {}
    ~Snapshots() override { files::remove_all(files::path(folder).parent_path()); }

    std::string path(Ns t) const { return folder + "/" + std::to_string(t) + ".snapshots"; }
    std::set<Ns> times() const
    {
        std::set<Ns> all;
        for (const auto &entry : files::directory_iterator(folder)) {
            all.insert(std::stoll(entry.path().stem()));
        }
        return all;
    }
    std::string fault(const std::string &content) const
    {
        std::ofstream(path(1), std::ios::binary) << content;
        try {
            read_past(path(1));
            return "";
        } catch (const sim::RunError &error) {
            EXPECT_EQ(std::string(error.what()).substr(0, path(1).size() + 2), path(1) + ": ");
            return std::string(error.what()).substr(path(1).size() + 2);
        }
    }

    std::string folder;
};

TEST_F(Snapshots, AFileHasThemAgain)
{
    SnapshotFolder kept(folder);
    kept.kept(60, {{"world", 55, bytes_of("a\nb")}, {"the flight computer", 60, {}}});
    EXPECT_EQ(times(), (std::set<Ns>{60})) << "nothing else stays behind";
    const Past past = read_past(path(60));
    ASSERT_EQ(past.snapshots.size(), 2u);
    EXPECT_EQ(past.snapshots[0].node, "world");
    EXPECT_EQ(past.snapshots[0].reached, 55);
    EXPECT_EQ(past.snapshots[0].bytes, Payload(bytes_of("a\nb")));
    EXPECT_EQ(past.snapshots[1].node, "the flight computer");
    EXPECT_EQ(past.until, -1);
}

TEST_F(Snapshots, EveryFlippedByteAndEveryCutIsSeen)
{
    SnapshotFolder kept(folder);
    kept.kept(60, {{"world", 55, bytes_of("abc")}});
    std::ifstream file(path(60), std::ios::binary);
    const std::string whole{std::istreambuf_iterator<char>(file), {}};
    EXPECT_EQ(fault(whole), "");
    for (std::size_t n = 0; n + 1 < whole.size(); n++) {
        EXPECT_NE(fault(whole.substr(0, n)), "") << n;
    }
    const std::size_t data = whole.find("abc");
    for (std::size_t n = data; n < data + 3; n++) {
        auto other = whole;
        other[n] = static_cast<char>(other[n] ^ 1);
        EXPECT_EQ(fault(other).substr(0, 35), "the snapshot of world is damaged: i") << n;
    }
}

TEST_F(Snapshots, ThePastHasTopicsToo)
{
    SnapshotFolder make(folder);
    const std::int64_t times[] = {10, 30};
    std::string content = "fledge snapshots 1\nuntil 42\ntopic 2 2 /a b\n____xx";
    content.append(reinterpret_cast<const char *>(times), sizeof times);
    content += "hiyoend\n";
    ASSERT_EQ(fault(content), "");
    const Past past = read_past(path(1));
    EXPECT_EQ(past.until, 42);
    ASSERT_EQ(past.topics.size(), 1u);
    EXPECT_EQ(past.topics[0].name, "/a b");
    EXPECT_EQ(past.topics[0].initial, Payload(bytes_of("____xx")));
    ASSERT_EQ(past.topics[0].messages.size(), 2u);
    EXPECT_EQ(past.topics[0].messages[1].first, 30);
    EXPECT_EQ(past.topics[0].messages[1].second, make_payload(bytes_of("yo")));
    EXPECT_EQ(fault("fledge snapshots 1\ntopic 9999999 9999999 /a\n"), "it is cut off");
    EXPECT_NE(fault("fledge snapshots 1\ntopic x\n"), "");
    EXPECT_NE(fault("fledge snapshots 1\nmoon\n"), "");
}

TEST_F(Snapshots, OldOnesAreThinnedWithinTheirBounds)
{
    SnapshotFolder kept(folder, 20);
    for (Ns t = 60; t <= 60'000; t += 60) {
        kept.kept(t, {{"world", t, bytes_of("abc")}});
        ASSERT_LE(times().size(), 20u);
    }
    const auto all = times();
    EXPECT_EQ(*all.begin(), 60);
    EXPECT_TRUE(all.contains(60'000) && all.contains(59'940)) << "the newest are all there";
    for (auto it = std::next(all.begin()); it != all.end(); ++it) {
        EXPECT_LE(*it - *std::prev(it), 600 + (60'000 - *it) * 2) << "the gaps grow with the age";
    }
    SnapshotFolder small(folder, 20, 2000);
    small.kept(60'060, {{"world", 60'060, Bytes(1000)}});
    std::uintmax_t bytes = 0;
    for (const Ns t : times()) {
        bytes += files::file_size(path(t));
    }
    EXPECT_LE(bytes, 2000u);
    EXPECT_TRUE(times().contains(60'060));
}

TEST_F(Snapshots, WhatIsNotWholeHasNoName)
{
    SnapshotFolder kept(folder);
    files::create_directories(path(60) + ".part"); // so that no file can be written
    EXPECT_THROW(kept.kept(60, {{"world", 60, {}}}), sim::RunError);
    EXPECT_FALSE(files::exists(path(60)));
}

} // namespace snapshots_test
} // namespace fledge::cosim
