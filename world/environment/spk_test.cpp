// SPDX-License-Identifier: Apache-2.0
#include "world/environment/spk.h"

#include "sim/error.h"
#include "world/environment/testing/files.h"
#include "world/environment/testing/kernel.h"

#include <limits>

namespace fledge::world {
namespace spk_test {

using ::testing::HasSubstr;
using testing::made_kernel;
using testing::MadeSegment;
using testing::real_file;
using testing::TemporaryFile;
using testing::turned_kernel;
using testing::uniform_motion;

const char *const kernels[] = {"de430-2015-03-02.bsp", "de441-1969.bsp", "jup310-excerpt.bsp"};

std::string error_of_kernel(const std::string &bytes)
{
    const TemporaryFile file("a.bsp", bytes);
    return error_of([&] { read_spk(file.path()); });
}

/// One segment of 3 records of 2 coefficients.
MadeSegment segment()
{
    MadeSegment s{301, 399, 0.0, 30.0, {}};
    for (int i = 0; i < 3; i++) {
        s.words.insert(s.words.end(), {5.0 + 10.0 * i, 5.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0});
    }
    s.words.insert(s.words.end(), {0.0, 10.0, 8.0, 3.0});
    return s;
}

TEST(Spk, ReadsAKernelOfOurOwn)
{
    const TemporaryFile file("a.bsp", made_kernel({segment()}));
    const SegmentFile read = read_spk(file.path());
    ASSERT_EQ(read.segments.size(), 1u);
    const ChebyshevSegment &s = read.segments[0];
    EXPECT_EQ(s.target, 301);
    EXPECT_EQ(s.center, 399);
    EXPECT_EQ(s.count, 3u);
    EXPECT_EQ(s.coefficients, 2);
    EXPECT_FALSE(s.has_velocity);
    EXPECT_EQ(s.records[8], 15.0);
}

TEST(Spk, BothByteOrdersAreTheSameToTheBit)
{
    for (const char *name : kernels) {
        const std::string path = real_file(name);
        SKIP_WITHOUT(path);
        const std::string bytes = read_whole(path);
        const std::string turned = turned_kernel(bytes);
        ASSERT_NE(bytes, turned);
        const TemporaryFile file("turned.bsp", turned);
        const SegmentFile a = read_spk(path), b = read_spk(file.path());
        ASSERT_EQ(a.segments.size(), b.segments.size());
        for (std::size_t i = 0; i < a.segments.size(); i++) {
            const ChebyshevSegment &x = a.segments[i], &y = b.segments[i];
            EXPECT_EQ(std::tie(x.target, x.center, x.first, x.last, x.start, x.length, x.count),
                      std::tie(y.target, y.center, y.first, y.last, y.start, y.length, y.count));
            ASSERT_EQ(x.record_words, y.record_words);
            EXPECT_EQ(std::memcmp(x.records, y.records, 8 * x.count * x.record_words), 0);
        }
    }
}

TEST(Spk, EveryCutOfARealKernelIsRefused)
{
    for (const char *name : kernels) {
        const std::string path = real_file(name);
        SKIP_WITHOUT(path);
        const std::string bytes = read_whole(path);
        for (std::size_t size = 0; size + 8 <= bytes.size(); size += 8 * 97) {
            const std::string error = error_of_kernel(bytes.substr(0, size));
            EXPECT_TRUE(error.find("cut short") != error.npos || error.find("is empty") != error.npos ||
                        error.find("is no SPICE SPK kernel") != error.npos)
                << name << " cut to " << size << ": " << error;
        }
    }
}

TEST(Spk, ForeignFilesAreNamed)
{
    EXPECT_THROW(read_spk("/nowhere/a.bsp"), sim::SetupError);
    EXPECT_THAT(error_of([] { read_spk("/nowhere/a.bsp"); }), HasSubstr("/nowhere/a.bsp: cannot be opened"));
    EXPECT_THAT(error_of([] { read_spk(::testing::TempDir()); }), HasSubstr("is empty or no file"));
    EXPECT_THAT(error_of_kernel(""), HasSubstr("is empty"));
    EXPECT_THAT(error_of_kernel(std::string(2000, 'x')), HasSubstr("is no SPICE SPK kernel"));
    EXPECT_THAT(error_of_kernel("DAFETF NAIF DAF ENCODED TRANSFER FILE\n"), HasSubstr("transfer file (.xsp)"));
    std::string bytes = made_kernel({segment()});
    EXPECT_THAT(error_of_kernel("DAF/CK  " + bytes.substr(8)),
                HasSubstr("is a kernel of kind \"DAF/CK  \"; expected \"DAF/SPK \""));
    std::memcpy(bytes.data() + 699, "FTPSTR:\n:\n:\n", 12);
    EXPECT_THAT(error_of_kernel(bytes), HasSubstr("damaged by a transfer as text"));
}

TEST(Spk, OtherTypesAndFramesAreNamedWithWhatIsRead)
{
    MadeSegment s = segment();
    s.type = 13;
    EXPECT_THAT(error_of_kernel(made_kernel({segment(), s})),
                HasSubstr("segment 2, MOON (301) relative to EARTH (399), is of type 13; types 2 and 3"));
    s.type = 2;
    s.frame = 17;
    EXPECT_THAT(error_of_kernel(made_kernel({s})), HasSubstr("frame 17; frame 1 (J2000) is read"));
}

TEST(Spk, DamagedSummariesAndSegmentsAreRefused)
{
    const std::string good = made_kernel({segment()});
    EXPECT_EQ(error_of_kernel(good), "");
    // Each of these, written at its place, makes another rule speak.
    const auto broken = [&](std::size_t at, auto value) {
        std::string bytes = good;
        std::memcpy(bytes.data() + at, &value, sizeof value);
        return error_of_kernel(bytes);
    };
    constexpr std::size_t summaries = 1024, summary = summaries + 24, data = 3 * 1024;
    constexpr std::size_t tail = data + 8 * 24;
    const double nan = std::nan("");
    EXPECT_THAT(broken(8, std::int32_t{3}), HasSubstr("summaries of 3 doubles and 6 integers"));
    EXPECT_THAT(broken(76, std::int32_t{0}), HasSubstr("first summary record is 0"));
    EXPECT_THAT(broken(76, std::int32_t{99}), HasSubstr("summary record 99 is beyond its end"));
    EXPECT_THAT(broken(88, 'x'), HasSubstr("marked neither LTL-IEEE nor BIG-IEEE"));
    EXPECT_THAT(broken(summaries, 2.0), HasSubstr("was met before"));
    EXPECT_THAT(broken(summaries, 0.5), HasSubstr("the next summary record is 0.5"));
    EXPECT_THAT(broken(summaries + 16, 26.0), HasSubstr("26 summaries"));
    EXPECT_THAT(broken(summaries + 16, nan), HasSubstr("the number of summaries is nan"));
    EXPECT_THAT(broken(summaries + 16, 0.0), HasSubstr("holds no segments"));
    EXPECT_THAT(broken(summary, nan), HasSubstr("it holds from nan s"));
    EXPECT_THAT(broken(summary, 31.0), HasSubstr("it holds from 31 s to 30 s"));
    EXPECT_THAT(broken(summary + 16, std::int32_t{399}), HasSubstr("relative to itself"));
    EXPECT_THAT(broken(summary + 32, std::int32_t{0}), HasSubstr("the words 0 to"));
    EXPECT_THAT(broken(summary + 36, std::int32_t{4000}), HasSubstr("to 4000; the file has"));
    EXPECT_THAT(broken(summary + 8, 31.0), HasSubstr("not the span in its summary"));
    EXPECT_THAT(broken(tail, 1.0), HasSubstr("not the span in its summary"));
    EXPECT_THAT(broken(tail + 8, -10.0), HasSubstr("not the span in its summary"));
    EXPECT_THAT(broken(tail + 16, 9.0), HasSubstr("24 words for 3 records of 9"));
    EXPECT_THAT(broken(tail + 16, 0.0), HasSubstr("24 words for 3 records of 0"));
    EXPECT_THAT(broken(tail + 16, 1e300), HasSubstr("the length of a record is 1e+300"));
    EXPECT_THAT(broken(tail + 24, 2.0), HasSubstr("24 words for 2 records of 8"));
    EXPECT_THAT(broken(tail + 24, 0.0), HasSubstr("24 words for 0 records of 8"));
    EXPECT_THAT(broken(data + 8 * 8, 16.0), HasSubstr("record 2 is not for its interval"));
    EXPECT_THAT(broken(data + 8 * 17, nan), HasSubstr("record 3 is not for its interval"));
    for (const double value : {nan, std::numeric_limits<double>::infinity(), -1e300}) {
        EXPECT_THAT(broken(data + 8 * 10, value), HasSubstr("record 2 holds a coefficient that is no distance"));
    }
}

} // namespace spk_test
} // namespace fledge::world
