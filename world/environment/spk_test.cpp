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
    const EphemerisSegment &s = read.segments[0];
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
            const EphemerisSegment &x = a.segments[i], &y = b.segments[i];
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
    s.type = 15;
    EXPECT_THAT(
        error_of_kernel(made_kernel({segment(), s})),
        HasSubstr("segment 2, MOON (301) relative to EARTH (399), is of type 15 (precessing conics); types 1, 2"));
    s.type = 19;
    EXPECT_THAT(
        error_of_kernel(made_kernel({s})),
        HasSubstr("is of type 19 (piecewise interpolation); types 1, 2, 3, 5, 8, 9, 12, 13, 18 and 21 are read: "
                  "NAIF's mkspk writes states as 13"));
    s.type = 2;
    s.frame = 22;
    EXPECT_THAT(error_of_kernel(made_kernel({s})),
                HasSubstr("frame 22; the frames that do not turn are read, 1 (J2000) to 21 (DE-143)"));
}

/// A good segment of a type, and a place in its words, from the end if negative, whose change makes a rule speak.
struct Damage {
    int type;
    int at;
    double value;
    const char *error;
};

/// Four states 10 s apart, or two records of differences, and what their type has behind them.
MadeSegment states(int type)
{
    MadeSegment s{301, 399, 0.0, 30.0, {}, type};
    const auto add = [&](const std::vector<double> &words) {
        s.words.insert(s.words.end(), words.begin(), words.end());
    };
    if (type == 1 || type == 21) {
        add(std::vector<double>(142, 1.0));
        s.words[0] = 0.0;
        add({15.0, 30.0});
        add(type == 1 ? std::vector<double>{2} : std::vector<double>{15, 2});
        return s;
    }
    for (int i = 0; i < 4; i++) {
        add({7000.0, i * 75.0, 0.0, 0.0, 7.5, 0.0});
    }
    if (type == 8 || type == 12) {
        add({0.0, 10.0, 3.0, 4.0});
        return s;
    }
    add({0.0, 10.0, 20.0, 30.0});
    add(type == 5    ? std::vector<double>{4e5, 4}
        : type == 18 ? std::vector<double>{1, 4, 4}
                     : std::vector<double>{3, 4});
    return s;
}

TEST(Spk, DamagedStatesAndDifferencesAreRefused)
{
    const double nan = std::nan("");
    for (const Damage &d : std::vector<Damage>{{1, 0, 0.0, ""},
                                               {5, 0, 7000.0, ""},
                                               {8, 0, 1.0, ""},
                                               {9, 0, 1.0, ""},
                                               {12, 0, 1.0, ""},
                                               {13, 0, 1.0, ""},
                                               {18, 0, 1.0, ""},
                                               {21, 0, 0.0, ""},
                                               {9, -1, 3.0, "28 words for 3 records of 7"},
                                               {9, -1, 0.0, "28 words for 0 records of 7"},
                                               {9, -1, 1e300, "the number of records is 1e+300"},
                                               {9, 5, nan, "record 1 holds a number that is no"},
                                               {9, -4, 10.0, "the time of record 2 is not before"},
                                               {9, -4, nan, "the time of record 2 is not before"},
                                               {9, -3, 29.0, "from 0 s to 29 s, which is not the span"},
                                               {9, -6, 1.0, "from 1 s to 30 s"},
                                               {9, -2, 28.0, "through 29 records"},
                                               {9, -2, 0.0, "through 1 records"},
                                               {13, -2, 14.0, "through 15 records"},
                                               {8, -3, 0.0, "is not the span"},
                                               {8, -3, 9.0, "from 0 s to 27 s"},
                                               {5, -2, 0.0, "gravitational parameter is 0 km^3"},
                                               {5, 0, 0.0, "record 1 is at the centre of its conic"},
                                               {18, -3, 3.0, "type 18, subtype 3; subtypes 0 to 2"},
                                               {18, -2, 3.0, "expected 2 to 28"},
                                               {1, 70, 16.0, "record 1 has no sound orders"},
                                               {1, 69, 0.5, "record 1 has no sound orders"},
                                               {21, -2, 26.0, "26 terms of differences"},
                                               {21, -2, 14.0, "144 words for 2 records of 68"}}) {
        MadeSegment s = states(d.type);
        s.words[d.at < 0 ? s.words.size() - static_cast<std::size_t>(-d.at) : static_cast<std::size_t>(d.at)] = d.value;
        const std::string error = error_of_kernel(made_kernel({s}));
        if (*d.error) {
            EXPECT_THAT(error, HasSubstr(d.error)) << d.type;
        } else {
            EXPECT_EQ(error, "") << d.type;
        }
    }
    MadeSegment s = states(1);
    s.words[70] = 3.0;
    s.words[2] = 0.0; // a step by which they divide
    EXPECT_THAT(error_of_kernel(made_kernel({s})), HasSubstr("record 1 has no sound orders and steps"));
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
