// SPDX-License-Identifier: Apache-2.0
#include "ground/database/testing/database.h"
#include "ground/packets/history.h"
#include "ground/packets/packet_archive.h"
#include "ground/packets/packet_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <limits>
#include <numeric>
#include <random>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>

namespace {

std::atomic<int> syncs{0}, sync_error{0};
std::atomic<long> synced{0}; ///< [bytes] of the file

} // namespace

/// Replaces the C library's function, and calls it.
extern "C" int fdatasync(int fd)
{
    struct stat about {};
    fstat(fd, &about);
    if (const int error = sync_error.exchange(0)) {
        errno = error;
        return -1;
    }
    const auto done = static_cast<int>(syscall(SYS_fdatasync, fd));
    synced = about.st_size;
    syncs++;
    return done;
}

namespace fledge::ground {

namespace archive_test {

namespace fs = std::filesystem;
using namespace testing;
using ::testing::HasSubstr;

constexpr std::int64_t second = 1'000'000'000, utc = 1'790'000'000 * second;
constexpr Id power = 1, thermal = 2; ///< of containers

/// A header with an identifier; container 1 has a count and an array of two, container 2 a temperature.
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
        for (const auto &entry : fs::directory_iterator(folder + "/craft")) {
            if (entry.path().filename() != "lock") {
                all.push_back(entry.path().filename());
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
        const auto packets = all();
        ASSERT_EQ(packets.size(), 250u + 25 + 1);
        EXPECT_EQ(packets[1].container, "/S/Thermal");
        EXPECT_EQ(packets[2].t, second);
        EXPECT_EQ(packets[2].received, utc + second);
        EXPECT_EQ(packets[2].bytes, power_packet(1));
        EXPECT_EQ(packets.back().container, "");
        History past = history(db);
        const auto sessions = past.sessions();
        ASSERT_EQ(sessions.size(), 1u);
        EXPECT_EQ(sessions[0].packets, packets.size());
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
        const auto series = past.series({"cell[1]"}, {}, points)[0];
        ASSERT_LE(series.t.size(), points);
        std::size_t from = 0;
        for (std::size_t k = 0; k < series.t.size(); k++) {
            const auto to = static_cast<std::size_t>(series.t[k] / second);
            double low = 1e9, high = -1e9;
            for (; from <= to; from++) {
                low = std::min(low, double(from % 200)), high = std::max(high, double(from % 200));
            }
            EXPECT_EQ(series.low[k], low);
            EXPECT_EQ(series.high[k], high);
            EXPECT_EQ(series.value[k], double(to % 200));
        }
        EXPECT_EQ(from, 250u);
    }
    // Rows have the newest value of each input, also from before the query.
    const auto rows = past.rows({"temperature", "count"}, {5 * second, 12 * second}).values;
    ASSERT_EQ(rows.size(), 9u * 3); // at 10 s, the count comes before the temperature
    for (std::size_t i = 0; i < 9; i++) {
        const int t = 5 + static_cast<int>(i) - (i > 5);
        EXPECT_EQ(std::bit_cast<std::int64_t>(rows[3 * i]), t * second);
        EXPECT_EQ(rows[3 * i + 1], i > 5 ? -5 : -10);
        EXPECT_EQ(rows[3 * i + 2], t);
    }
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

TEST_F(Archive, ALongQueryIsRefusedWithItsSize)
{
    PacketArchive archive(folder, "craft", db, 100 * second);
    fill(archive, 0, 1000);
    History past = history(db);
    past.most_decoded = 500;
    EXPECT_EQ(past.series({"count"}, {100 * second, 599 * second}, 10)[0].t.size(), 10u);
    EXPECT_EQ(past.series({"temperature"}, {}, 0)[0].t.size(), 100u); // in rare packets
    try {
        past.series({"count"}, {}, 10);
        FAIL();
    } catch (const Refusal &refusal) {
        EXPECT_THAT(refusal.what(), HasSubstr("would decode 1000 packets, of 0.0115 days; the most is 500: ask for"));
    }
}

TEST_F(Archive, AQueryOfTooManyValuesIsRefused)
{
    PacketArchive archive(folder, "craft", db, 100 * second);
    fill(archive, 0, 1000);
    History past = history(db);
    const auto refusal = [&](std::size_t points, bool exact) {
        try {
            past.series({"count", "temperature"}, {}, points, nullptr, exact);
        } catch (const Refusal &refused) {
            return std::string(refused.what());
        }
        return std::string();
    };
    past.most_values = past.most_seen = 1100;
    EXPECT_EQ(refusal(0, true), "");
    past.most_values = 1099;
    EXPECT_THAT(refusal(0, true), HasSubstr("would give more than 1099 values: ask for a shorter time"));
    EXPECT_EQ(refusal(10, true), "");
    past.most_seen = 1099;
    EXPECT_THAT(refusal(10, false), HasSubstr("would read more than 1099 values"));
    EXPECT_EQ(past.packets({}, "", 10, true, 1).size(), 1u);
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

/// A program that archives until it is killed; returns how many packets it said to be saved. `limits` runs in it first.
template <class Work> int in_a_child(const Work &work, int kill_after_us)
{
    int ends[2];
    EXPECT_EQ(pipe(ends), 0);
    const pid_t child = fork();
    if (child == 0) {
        ::close(ends[0]);
        work([&](int saved) {
            if (write(ends[1], &saved, sizeof saved) != sizeof saved) {
                _exit(1);
            }
        });
        _exit(0);
    }
    ::close(ends[1]);
    if (kill_after_us > 0) {
        usleep(static_cast<useconds_t>(kill_after_us));
        kill(child, SIGKILL);
    }
    int saved = 0, last = 0;
    while (read(ends[0], &saved, sizeof saved) == sizeof saved) {
        last = saved;
    }
    ::close(ends[0]);
    int status = 0;
    waitpid(child, &status, 0);
    EXPECT_TRUE(kill_after_us > 0 || (WIFEXITED(status) && WEXITSTATUS(status) == 0));
    return last;
}

TEST_F(Archive, AFileOfWhichNothingWasSavedIsNotMissed)
{
    in_a_child(
        [&](const auto &) {
            PacketArchive archive(folder, "craft", db, second);
            fill(archive, 0, 1);
            _exit(0);
        },
        0);
    const std::string name = folder + "/craft/000001-0.mcap.part";
    std::ifstream in(name, std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(in), {}};
    const std::size_t at = PacketFile(name).chunks.at(0).at, head = 49;
    std::vector<std::string> left; // files of programs that were killed while they began the file or saved first
    for (std::size_t n = 0; n <= at; n++) {
        left.push_back(bytes.substr(0, n));
    }
    for (std::size_t n = 1; n <= bytes.size() - at - head; n++) { // the head of a chunk goes last
        left.push_back(bytes.substr(0, at) + std::string(head, '\0') + bytes.substr(at + head, n));
    }
    for (const std::string &path : left) {
        std::ofstream(name, std::ios::binary) << path;
        for (const auto &session : history(db).sessions()) {
            EXPECT_TRUE(session.gaps.empty()) << session.gaps[0].why;
            EXPECT_EQ(session.packets, 0u);
        }
        PacketArchive(folder, "craft", db, second);
        EXPECT_TRUE(files().empty()) << files()[0] << " of " << path.size() << " bytes, " << at;
        fs::remove(name);
    }
}

TEST_F(Archive, SavedPacketsOutliveAnyKill)
{
    std::mt19937 random(7);
    std::vector<std::uint32_t> saved; // of each session
    for (int run = 0; run < 12; run++) {
        const int n = in_a_child(
            [&](const auto &tell) {
                PacketArchive archive(folder, "craft", db, 10 * second);
                for (int i = 0;; i++) {
                    put(archive, i * second / 100, power_packet(static_cast<std::uint32_t>(i)), power);
                    if (i % 7 == 6) {
                        archive.save();
                        tell(i + 1);
                    }
                }
            },
            2000 + static_cast<int>(random() % 60000));
        if (n != 0 || !all().empty()) {
            saved.push_back(static_cast<std::uint32_t>(n));
        }
    }
    // First as the killed program left it, then completed by the next writer.
    for (const bool recovered : {false, true}) {
        std::unique_ptr<PacketArchive> next;
        if (recovered) {
            next = std::make_unique<PacketArchive>(folder, "craft", db, 10 * second);
            for (const std::string &name : files()) {
                EXPECT_TRUE(name.ends_with(".mcap")) << name;
            }
        }
        History past = history(db);
        std::uint64_t total = 0;
        for (const auto &session : past.sessions()) {
            const auto packets = all(session.number);
            EXPECT_EQ(session.ended, "killed");
            EXPECT_EQ(session.packets, packets.size());
            EXPECT_TRUE(session.gaps.empty()) << session.gaps[0].why;
            for (std::size_t i = 0; i < packets.size(); i++) {
                ASSERT_EQ(packets[i].bytes, power_packet(static_cast<std::uint32_t>(i)));
            }
            total += packets.size();
        }
        EXPECT_GE(total, std::accumulate(saved.begin(), saved.end(), std::uint64_t{0}));
        EXPECT_GT(total, 0u);
    }
}

TEST_F(Archive, AReaderSeesWhatIsSavedWhileTheWriterWrites)
{
    std::atomic<std::uint32_t> saved = 0;
    std::jthread writer([&] {
        PacketArchive archive(folder, "craft", db, 5 * second);
        for (std::uint32_t i = 0; i < 20'000; i++) {
            Bytes packet = power_packet(i);
            packet.resize(100);
            put(archive, i * second / 1000, packet, power);
            if (i % 10 == 9) {
                archive.save();
                saved = i + 1;
            }
        }
    });
    History past = history(db);
    for (std::uint32_t before = 0; before < 20'000;) {
        before = saved;
        const auto packets = past.packets({}, "", 1'000'000, false);
        EXPECT_GE(packets.size(), before);
        for (std::uint32_t i = 0; i < packets.size(); i++) {
            ASSERT_EQ(packets[i].bytes[3] << 8 | packets[i].bytes[4], i & 0xFFFF);
        }
    }
    writer.join();
    const auto sessions = past.sessions();
    ASSERT_EQ(sessions.size(), 1u);
    EXPECT_EQ(sessions[0].packets, 20'000u);
    EXPECT_TRUE(sessions[0].gaps.empty()) << sessions[0].gaps[0].why;
}

void limit_files(rlim_t bytes)
{
    rlimit limit{};
    getrlimit(RLIMIT_FSIZE, &limit);
    limit.rlim_cur = bytes;
    setrlimit(RLIMIT_FSIZE, &limit);
    std::signal(SIGXFSZ, SIG_IGN);
}

TEST_F(Archive, AFileThatTakesNoMoreIsFollowedByANewOneAndNothingIsLost)
{
    in_a_child(
        [&](const auto &tell) {
            limit_files(20'000);
            PacketArchive archive(folder, "craft", db, 1000 * second);
            for (std::uint32_t i = 0; i < 5000; i++) {
                put(archive, i * second / 100, power_packet(i), power);
                if (i % 10 == 9) {
                    archive.save(); // a Refusal would end the child
                }
            }
            tell(1);
        },
        0);
    const auto packets = all();
    ASSERT_EQ(packets.size(), 5000u);
    for (std::uint32_t i = 0; i < 5000; i++) {
        ASSERT_EQ(packets[i].bytes, power_packet(i));
    }
    EXPECT_GT(files().size(), 10u);
    { // the next writer has room to complete them
        PacketArchive archive(folder, "craft", db, 1000 * second);
    }
    EXPECT_THAT(files(), ::testing::Each(::testing::EndsWith(".mcap")));
    EXPECT_EQ(all().size(), 5000u);
}

TEST_F(Archive, AFullDiskIsReportedAndPacketsThatMemoryCannotHoldBecomeAGap)
{
    // 1118 packets of 60 kB are kept in memory while the disk is full.
    constexpr std::uint32_t n = 1450, full = 50, room = 1400;
    const int not_kept = in_a_child(
        [&](const auto &tell) {
            PacketArchive archive(folder, "craft", db, 1000 * second);
            std::uint32_t refused = 0;
            for (std::uint32_t i = 0; i < n; i++) {
                if (i == full || i == room) {
                    limit_files(i == full ? 0 : RLIM_INFINITY);
                }
                Bytes packet = power_packet(i);
                packet.resize(60'000);
                put(archive, i * second / 100, packet, power);
                if (i == room + 1) {
                    sleep(1); // the archive tries once in a second
                }
                try {
                    archive.save();
                    EXPECT_EQ(archive.problem(), "");
                } catch (const Refusal &refusal) {
                    refused++;
                    if (refusal.what() != archive.problem() || archive.problem().empty()) {
                        _exit(2);
                    }
                }
            }
            if (refused < room - full || refused > room - full + 2) {
                _exit(3);
            }
            tell(static_cast<int>(archive.lost()));
        },
        0);
    const auto packets = all();
    History past = history(db);
    const auto sessions = past.sessions();
    ASSERT_EQ(sessions.size(), 1u);
    ASSERT_EQ(sessions[0].gaps.size(), 1u);
    const Missing &gap = sessions[0].gaps[0];
    EXPECT_THAT(gap.why, HasSubstr("limit on its size"));
    std::uint32_t lost = 0, next = 0;
    for (const auto &packet : packets) {
        const std::uint32_t i = std::uint32_t(packet.bytes[3]) << 8 | packet.bytes[4];
        for (; next < i; next++, lost++) {
            EXPECT_GE(next * second / 100, gap.from);
            EXPECT_LE(next * second / 100, gap.to);
        }
        EXPECT_EQ(i, next++);
    }
    EXPECT_GT(lost, 0u);
    EXPECT_EQ(static_cast<int>(lost), not_kept);
    EXPECT_EQ(packets.size() + lost, n);
    EXPECT_THAT(gap.why, HasSubstr("; " + std::to_string(lost) + " packets"));
}

TEST_F(Archive, ADamagedFileNamesWhatIsMissingAndTheRestIsRead)
{
    {
        PacketArchive archive(folder, "craft", db, 1'000'000 * second);
        for (std::uint32_t i = 0; i < 9000; i++) {
            Bytes packet = power_packet(i);
            packet.resize(100);
            put(archive, i * second, packet, power);
        }
    }
    const std::string name = folder + "/craft/000001-0.mcap";
    std::ifstream in(name, std::ios::binary);
    const std::string whole{std::istreambuf_iterator<char>(in), {}};
    ASSERT_EQ(all().size(), 9000u);
    std::mt19937 random(3);
    const auto check = [&](const std::string &bytes, const std::string &what) {
        std::ofstream(name, std::ios::binary) << bytes;
        History past = history(db);
        const auto packets = past.packets({}, "", 1'000'000, false);
        std::uint32_t before = 0;
        for (std::size_t i = 0; i < packets.size(); i++) { // in order, and none that was not put
            const std::uint32_t count = std::uint32_t(packets[i].bytes[3]) << 8 | packets[i].bytes[4];
            ASSERT_TRUE(i == 0 || count > before) << what;
            ASSERT_EQ(packets[i].t, count * second) << what;
            before = count;
        }
        const auto sessions = past.sessions();
        EXPECT_TRUE(packets.size() == 9000 || sessions.empty() || !sessions[0].gaps.empty() ||
                    sessions[0].packets < 9000)
            << what;
        past.series({"count"}, {}, 100);
    };
    for (int i = 0; i < 60; i++) {
        std::string bytes = whole;
        const std::size_t at = random() % bytes.size();
        bytes[at] = static_cast<char>(bytes[at] ^ (1 << random() % 8));
        check(bytes, "a bit of byte " + std::to_string(at));
        const std::size_t from_end = bytes.size() - 1 - random() % 2000; // the index
        bytes = whole;
        bytes[from_end] = static_cast<char>(random());
        check(bytes, "byte " + std::to_string(from_end));
        check(whole.substr(0, random() % whole.size()), "cut");
    }
    // Only the damaged chunk in the middle is skipped.
    std::string bytes = whole;
    const Bytes packet = power_packet(4500);
    const std::size_t in_it = bytes.find(std::string(packet.begin(), packet.end())) + 50;
    bytes[in_it] = static_cast<char>(bytes[in_it] ^ 1);
    std::ofstream(name, std::ios::binary) << bytes;
    History past = history(db);
    const auto packets = past.packets({}, "", 1'000'000, false);
    EXPECT_GT(packets.size(), 5000u);
    EXPECT_LT(packets.size(), 9000u);
    const auto gap = past.sessions().at(0).gaps.at(0);
    EXPECT_THAT(gap.why, HasSubstr("000001-0.mcap is damaged at byte "));
    EXPECT_THAT(gap.why, HasSubstr("checksum"));
    EXPECT_EQ(gap.to - gap.from, std::int64_t(9000 - packets.size() - 1) * second);
}

TEST_F(Archive, AValueThatDependsOnAnEarlierPacketIsThatOfLiveTelemetry)
{
    // `range`, which other packets have, chooses the calibrator of `level`.
    const Database both = read_xtce_text(
        file(integer("u8", 8) +
                 "<FloatParameterType name='scaled'><IntegerDataEncoding sizeInBits='8'><ContextCalibratorList>"
                 "<ContextCalibrator><ContextMatch><Comparison parameterRef='range' "
                 "value='2'/></ContextMatch><Calibrator>"
                 "<PolynomialCalibrator><Term coefficient='10' exponent='1'/></PolynomialCalibrator></Calibrator>"
                 "</ContextCalibrator></ContextCalibratorList></IntegerDataEncoding></FloatParameterType>",
             "id:u8 range:u8 level:scaled other:u8",
             container("Header", "id") + container("Range", "range", extends("Header", "id", "1")) +
                 container("Level", "level", extends("Header", "id", "2")) +
                 container("Other", "other", extends("Header", "id", "3"))),
        "s.xml");
    PacketArchive archive(folder, "craft", both, 10 * second);
    Decoder live(both);
    std::vector<double> expected;
    for (int i = 0; i < 100; i++) {
        const bool range = i % 30 == 5;
        const Bytes packet = range ? Bytes{1, std::uint8_t(i % 60 == 5 ? 2 : 1)} : Bytes{std::uint8_t(2 + i % 2), 7};
        const Decoded &done = live.decode(packet);
        put(archive, i * second, packet, done.container);
        expected.push_back(!range && i % 2 == 0 ? std::bit_cast<double>(done.values[1]) : -1);
    }
    archive.save();
    History past = history(both);
    for (int from = 0; from < 95; from++) {
        const auto series = past.series({"level"}, {from * second, (from + 3) * second}, 0)[0];
        ASSERT_GT(series.t.size(), 0u);
        for (std::size_t i = 0; i < series.t.size(); i++) {
            EXPECT_EQ(series.value[i], expected[std::size_t(series.t[i] / second)]) << from;
        }
    }
}

TEST_F(Archive, ADatabaseThatChangesReadsWhatIsOld)
{
    {
        PacketArchive archive(folder, "craft", db, 100 * second);
        fill(archive, 0, 50);
        put(archive, 50 * second, {3, 0, 0, 0, 77}, no_id);
    }
    // A container that is new in the database decodes packets that were undecoded.
    const Database later = read_xtce_text(xml(container("Later", "count", extends("Header", "id", "3"))), "s.xml");
    EXPECT_NE(later.hash, db.hash);
    History past = history(later), before = history(db);
    const auto now = past.series({"count"}, {}, 0)[0], then = before.series({"count"}, {}, 0)[0];
    ASSERT_EQ(now.value.size(), 51u);
    EXPECT_EQ(now.value.back(), 77);
    EXPECT_EQ(then.value.size(), 50u);
}

TEST_F(Archive, SavedPacketsAreOnTheDiskSoonAfterAndAFailureIsReportedOnce)
{
    constexpr auto within = std::chrono::milliseconds(30);
    PacketArchive archive(folder, "craft", db, 3600 * second, within);
    const auto part = [&] {
        for (const auto &entry : fs::directory_iterator(folder + "/craft")) {
            if (entry.path().extension() == ".part") {
                return static_cast<long>(fs::file_size(entry.path()));
            }
        }
        return 0L;
    };
    std::uint32_t count = 0;
    const auto save = [&] {
        const Bytes packet = power_packet(++count);
        archive.put({count * second, utc, packet}, power);
        archive.save();
    };
    const auto until = [&](const auto &holds) {
        const auto end = std::chrono::steady_clock::now() + std::chrono::minutes(1);
        while (!holds()) {
            ASSERT_LT(std::chrono::steady_clock::now(), end);
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
        }
    };
    const int before = syncs;
    const auto begin = std::chrono::steady_clock::now();
    for (int i = 0; i < 2000; i++) {
        save();
    }
    const long size = part();
    until([&] { return synced >= size; }); // without another save
    EXPECT_LE(syncs - before, (std::chrono::steady_clock::now() - begin) / within + 1);
    sync_error = EIO;
    save();
    until([&] { return sync_error == 0; });
    std::string failure;
    until([&] {
        try {
            save();
        } catch (const Refusal &refusal) {
            failure = refusal.what();
        }
        return !failure.empty();
    });
    EXPECT_THAT(failure, HasSubstr("may not be on the disk"));
    save();
    archive.close();
    EXPECT_EQ(History(folder, "craft", db, "").series({"count"}, {}, 0)[0].t.size(), count);
}

} // namespace archive_test

} // namespace fledge::ground
