// SPDX-License-Identifier: Apache-2.0
#include "ground/archive/history.h"
#include "ground/archive/packet_archive.h"
#include "ground/database/testing/database.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <random>
#include <sys/resource.h>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>

namespace fledge::ground {

namespace {

namespace fs = std::filesystem;
using namespace testing;
using ::testing::HasSubstr;

constexpr std::int64_t second = 1'000'000'000, utc = 1'790'000'000 * second;
constexpr Id power = 1, thermal = 2; ///< of containers

/// A header with an identifier; a container of 1 with a count and an array of two; one of 2 with a temperature.
std::string xml(const std::string &more = "")
{
    return file(integer("u8", 8) + integer("u32", 32) +
                    "<FloatParameterType name='line'><IntegerDataEncoding sizeInBits='16' encoding='twosComplement'>"
                    "<DefaultCalibrator><PolynomialCalibrator><Term coefficient='-10' exponent='0'/><Term "
                    "coefficient='0.5' exponent='1'/></PolynomialCalibrator></DefaultCalibrator></IntegerDataEncoding>"
                    "</FloatParameterType><StringParameterType name='word'><StringDataEncoding><SizeInBits><Fixed>"
                    "<FixedValue>8</FixedValue></Fixed></SizeInBits></StringDataEncoding></StringParameterType>"
                    "<ArrayParameterType name='pair' arrayTypeRef='u8'><DimensionList><Dimension><StartingIndex>"
                    "<FixedValue>0</FixedValue></StartingIndex><EndingIndex><FixedValue>1</FixedValue></EndingIndex>"
                    "</Dimension></DimensionList></ArrayParameterType>",
                "id:u8 count:u32 cell:pair temperature:line name:word",
                container("Header", "id") + container("Power", "count cell", extends("Header", "id", "1")) +
                    container("Thermal", "temperature name", extends("Header", "id", "2")) + more);
}

Bytes power_packet(std::uint32_t count)
{
    return {1, std::uint8_t(count >> 24), std::uint8_t(count >> 16), std::uint8_t(count >> 8), std::uint8_t(count),
            7, std::uint8_t(count % 200)};
}

class Archive : public ::testing::Test {
protected:
    void SetUp() override
    {
        std::string name = (fs::temp_directory_path() / "fledge_archive_XXXXXX").string();
        ASSERT_NE(mkdtemp(name.data()), nullptr);
        folder = name;
    }
    void TearDown() override { fs::remove_all(folder); }

    std::vector<std::string> files() const
    {
        std::vector<std::string> all;
        for (const auto &one : fs::directory_iterator(folder + "/craft")) {
            if (one.path().filename() != "lock") {
                all.push_back(one.path().filename());
            }
        }
        std::sort(all.begin(), all.end());
        return all;
    }
    History history(const Database &database) const { return {folder, "craft", database, ""}; }
    std::vector<History::Packet> all(std::int64_t session = -1) const
    {
        return history(db).packets({0, std::numeric_limits<std::int64_t>::max(), session}, "", 1'000'000, false);
    }

    std::string folder;
    const Database db = read_xtce_text(xml(), "s.xml");
};

void put(PacketSink &archive, std::int64_t t, const Bytes &packet, Id container)
{
    archive.put({t, utc + t % utc, packet}, container);
}

/// A packet of power each second from `from` on, a thermal one each tenth second, and a lost one.
void fill(PacketArchive &archive, int from, int to)
{
    for (int i = from; i < to; i++) {
        put(archive, i * second, power_packet(static_cast<std::uint32_t>(i)), power);
        if (i % 10 == 0) {
            put(archive, i * second, {2, std::uint8_t(i >> 8), std::uint8_t(i), 'x'}, thermal);
        }
        archive.save();
    }
}

TEST_F(Archive, EachPacketIsInTheFileOfItsPeriodAndComesBack)
{
    PacketArchive archive(folder, "craft", db, 100 * second);
    fill(archive, 0, 250);
    put(archive, 250 * second, {9, 9}, no_id);
    archive.save();
    EXPECT_EQ(files(),
              (std::vector<std::string>{"000001-0.mcap", "000001-100000000000.mcap", "000001-200000000000.mcap.part"}));
    for (const bool open : {true, false}) {
        const auto found = all();
        ASSERT_EQ(found.size(), 250u + 25 + 1);
        EXPECT_EQ(found[1].container, "/S/Thermal");
        EXPECT_EQ(found[2].t, second);
        EXPECT_EQ(found[2].received, utc + second);
        EXPECT_EQ(found[2].bytes, power_packet(1));
        EXPECT_EQ(found.back().container, "");
        History past = history(db);
        const auto sessions = past.sessions();
        ASSERT_EQ(sessions.size(), 1u);
        EXPECT_EQ(sessions[0].packets, found.size());
        EXPECT_EQ(sessions[0].first, 0);
        EXPECT_EQ(sessions[0].last, 250 * second);
        EXPECT_EQ(sessions[0].ended, open ? "" : "closed");
        EXPECT_TRUE(sessions[0].gaps.empty());
        if (open) {
            archive.close();
        }
    }
    EXPECT_EQ(files().back(), "000001-200000000000.mcap");
    History past = history(db);
    EXPECT_EQ(past.packets({}, "undecoded", 10, false).size(), 1u);
    EXPECT_EQ(past.packets({}, "Thermal", 100, false).size(), 25u);
    const auto newest = past.packets({0, 200 * second}, "/S/Power", 3, true);
    ASSERT_EQ(newest.size(), 3u);
    EXPECT_EQ(newest[0].bytes, power_packet(200));
    EXPECT_EQ(newest[2].bytes, power_packet(198));
}

TEST_F(Archive, SeriesAreTheValuesOfTheDecoder)
{
    PacketArchive archive(folder, "craft", db, 100 * second);
    fill(archive, 0, 250);
    History past = history(db);
    const auto all = past.series({"count", "/S/cell[1]", "temperature"}, {}, 0);
    ASSERT_EQ(all[0].t.size(), 250u);
    ASSERT_EQ(all[2].t.size(), 25u);
    for (std::size_t i = 0; i < 250; i++) {
        EXPECT_EQ(all[0].t[i], std::int64_t(i) * second);
        EXPECT_EQ(all[0].value[i], double(i));
        EXPECT_EQ(all[1].value[i], double(i % 200));
        if (i % 10 == 0) {
            EXPECT_EQ(all[2].value[i / 10], 0.5 * double(i) - 10);
        }
    }
    const auto part = past.series({"count"}, {95 * second, 105 * second}, 0);
    EXPECT_EQ(part[0].value.front(), 95);
    EXPECT_EQ(part[0].value.back(), 105);
    // Buckets have the extremes of their values and the last one.
    for (const std::size_t points : {1, 7, 50, 249, 1000}) {
        const auto made = past.series({"cell[1]"}, {}, points)[0];
        ASSERT_LE(made.t.size(), points);
        std::size_t from = 0;
        for (std::size_t k = 0; k < made.t.size(); k++) {
            const auto to = static_cast<std::size_t>(made.t[k] / second);
            double low = 1e9, high = -1e9;
            for (; from <= to; from++) {
                low = std::min(low, double(from % 200)), high = std::max(high, double(from % 200));
            }
            EXPECT_EQ(made.low[k], low);
            EXPECT_EQ(made.high[k], high);
            EXPECT_EQ(made.value[k], double(to % 200));
        }
        EXPECT_EQ(from, 250u);
    }
    // Rows begin when all inputs were seen, and hold what is older.
    const auto rows = past.rows({"temperature", "count"}, {5 * second, 12 * second});
    ASSERT_EQ(rows.size(), 3u * 3);
    EXPECT_EQ(std::bit_cast<std::int64_t>(rows[0]), 10 * second);
    EXPECT_EQ(rows[1], -5);
    EXPECT_EQ(rows[2], 10);
    EXPECT_EQ(rows[8], 12);
}

TEST_F(Archive, AQueryThatCannotBeAnsweredSaysWhy)
{
    const auto refusal = [&](const std::string &name) {
        History past = history(db);
        try {
            past.series({name}, {}, 10);
        } catch (const Refusal &refused) {
            return std::string(refused.what());
        }
        return std::string();
    };
    EXPECT_EQ(refusal("count"), ""); // of an archive that does not exist yet: nothing
    EXPECT_THAT(refusal("coun"), HasSubstr("no parameter coun"));
    EXPECT_THAT(refusal("name"), HasSubstr("name is no number but a text"));
    EXPECT_THAT(refusal("cell"), HasSubstr("several elements"));
    EXPECT_THAT(refusal("cell[x]"), HasSubstr("cell has no element [x]"));
    EXPECT_THAT(refusal("cell[1"), HasSubstr("cell has no element"));
    EXPECT_THAT(refusal("count.a"), HasSubstr("count has no member a"));
    EXPECT_THROW(PacketArchive(folder, "../x", db, second), Refusal);
    EXPECT_THROW(PacketArchive(folder, "craft", db, 0), Refusal);
}

TEST_F(Archive, AClockThatStepsBackBeginsASession)
{
    PacketArchive archive(folder, "craft", db, 100 * second);
    for (const std::int64_t t : {10 * second, 20 * second, 20 * second - 5, 30 * second, 12 * second, 13 * second}) {
        put(archive, t, power_packet(static_cast<std::uint32_t>(t / second)), power);
    }
    archive.save();
    History past = history(db);
    const auto sessions = past.sessions();
    ASSERT_EQ(sessions.size(), 2u);
    EXPECT_EQ(sessions[0].ended, "the clock stepped back");
    EXPECT_EQ(sessions[0].packets, 4u);
    EXPECT_EQ(sessions[1].first, 12 * second);
    EXPECT_EQ(sessions[1].ended, "");
    EXPECT_EQ(past.packets({0, 100 * second, 1}, "", 10, false)[2].t, 20 * second);
    EXPECT_EQ(all().size(), 2u); // of simulated time: the newest session
}

TEST_F(Archive, SessionsOfUtcFollowOneAnother)
{
    for (int run = 0; run < 3; run++) {
        PacketArchive archive(folder, "craft", db, 100 * second);
        for (int i = 0; i < 5; i++) {
            put(archive, utc + (run * 10 + i) * second, power_packet(static_cast<std::uint32_t>(run * 10 + i)), power);
        }
    }
    EXPECT_EQ(all().size(), 15u);
    History past = history(db);
    const auto sessions = past.sessions();
    ASSERT_EQ(sessions.size(), 3u);
    ASSERT_EQ(sessions[2].gaps.size(), 1u);
    EXPECT_EQ(sessions[2].gaps[0].from, utc + 14 * second);
    EXPECT_EQ(sessions[2].gaps[0].to, utc + 20 * second);
    EXPECT_THAT(sessions[2].gaps[0].why, HasSubstr("closed"));
    EXPECT_EQ(past.packets({0, std::numeric_limits<std::int64_t>::max(), 2}, "", 100, false).size(), 5u);
}

TEST_F(Archive, OneWriterAtATime)
{
    {
        PacketArchive archive(folder, "craft", db, second);
        try {
            PacketArchive other(folder, "craft", db, second);
            FAIL();
        } catch (const Refusal &refusal) {
            EXPECT_THAT(refusal.what(), HasSubstr("another program writes"));
        }
        PacketArchive other(folder, "other", db, second);
    }
    PacketArchive again(folder, "craft", db, second);
}

} // namespace

} // namespace fledge::ground
