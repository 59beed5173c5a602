// SPDX-License-Identifier: Apache-2.0
#include "world/environment/harmonic_field.h"

#include "sim/error.h"
#include "world/environment/testing/files.h"

#include <cmath>
#include <limits>
#include <numbers>

namespace fledge::world {
namespace harmonic_field_test {

using ::testing::HasSubstr;
using testing::real_file;
using testing::TemporaryFile;

const std::string icgem_head = "A comment.\n\nproduct_type gravity_field\nmodelname TEST\n"
                               "earth_gravity_constant 0.3986004415E+15\nradius 0.6378136300D+07\n"
                               "max_degree 2\nerrors formal\n";
const std::string icgem_rows = "gfc 2 0 -0.48e-3 0.0 1e-10 0\ngfc 2 1 1d-10 2d-10\n"
                               "gfc 2 2 2.4e-6 -1.4e-6\n";

HarmonicField shadr(const std::string &text, double expected_mu = 0.0)
{
    const TemporaryFile file("a.tab", text);
    return read_gravity_field(file.path(), std::nullopt, expected_mu);
}

HarmonicField icgem(const std::string &text, std::optional<Epoch> epoch = std::nullopt)
{
    const TemporaryFile file("a.gfc", text);
    return read_gravity_field(file.path(), epoch);
}

/// Days past 2000-01-01, the noon of which is J2000.
Epoch day(double days)
{
    return {std::llround((days - 0.5) * 86400e9)};
}

const std::string icgem_rest = "gfc 2 1 0 0\ngfc 2 2 0 0\n";
constexpr double days_2005 = 1827.0, year = 365.25; // 2005-01-01; the Julian year

TEST(HarmonicField, RealFieldsHaveTheirKnownFlattening)
{
    const std::string earth = real_file("earth-ggm03s.shadr.csv");
    const std::string mars = real_file("mars-ggm2bc80.shadr.csv");
    SKIP_WITHOUT(earth);
    SKIP_WITHOUT(mars);
    const HarmonicField e = read_gravity_field(earth), m = read_gravity_field(mars);
    EXPECT_EQ(e.degree, 180);
    EXPECT_EQ(e.radius, 6378136.3);
    EXPECT_EQ(e.mu, 3.986004415e14);
    EXPECT_NEAR(e.J(2), 1.08263e-3, 1e-8);
    EXPECT_NEAR(e.J(3), -2.5327e-6, 1e-9);
    EXPECT_EQ(m.degree, 80);
    EXPECT_EQ(m.C[0], 1.0); // the file begins at degree 2
    EXPECT_NEAR(m.J(2), 1.9555e-3, 1e-7);
    EXPECT_EQ(m.S[HarmonicField::index(80, 80)], -5.3860308941804763e-08);
}

TEST(HarmonicField, ShadrInKilometresAndWithoutNormalisation)
{
    const std::string rows = "2 0 -3.0 0\n2 1 0 0\n2,2,0.5,0.25,0,0\n";
    const HarmonicField km = shadr("3397 42828.5 0 2 2 0 0 0\n" + rows);
    EXPECT_EQ(km.radius, 3.397e6);
    EXPECT_EQ(km.mu, 4.28285e13);
    // N_20 = sqrt(5), N_22 = sqrt(5/12).
    EXPECT_NEAR(km.C[HarmonicField::index(2, 0)], -3.0 / std::sqrt(5.0), 1e-15);
    EXPECT_NEAR(km.S[HarmonicField::index(2, 2)], 0.25 / std::sqrt(5.0 / 12.0), 1e-15);
    EXPECT_NEAR(km.J(2), 3.0, 1e-15);
    // Eros, in metres and in kilometres.
    EXPECT_EQ(shadr("16000 4.5e5 0 2 2 1\n" + rows, 4.463e5).radius, 16000.0);
    EXPECT_EQ(shadr("16 4.5e-4 0 2 2 1\n" + rows, 4.463e5).radius, 16000.0);
    EXPECT_EQ(shadr("3397000 4.28285e13 0 2 2 1\n" + rows).radius, 3.397e6);
}

TEST(HarmonicField, MuAndRadiusArePositiveAndFinite)
{
    constexpr double least = std::numeric_limits<double>::min(), most = std::numeric_limits<double>::max();
    constexpr double infinite = std::numeric_limits<double>::infinity(), nan = std::numeric_limits<double>::quiet_NaN();
    EXPECT_EQ(HarmonicField::zero(least, most, 0).C, std::vector<double>{1.0});
    EXPECT_EQ(HarmonicField::zero(most, least, 2).degree, 2);
    for (const double bad : {0.0, -1.0, infinite, nan}) {
        EXPECT_THROW(HarmonicField::zero(bad, 1.0, 2), sim::SetupError) << bad;
        EXPECT_THROW(HarmonicField::zero(1.0, bad, 2), sim::SetupError) << bad;
    }
    EXPECT_THROW(HarmonicField::zero(1.0, 1.0, -1), sim::SetupError);
    EXPECT_THROW(HarmonicField::zero(1.0, 1.0, 10'001), sim::SetupError);
}

TEST(HarmonicField, DamagedShadrIsRefusedWithItsLine)
{
    const auto error = [](const std::string &text) { return error_of([&] { shadr(text); }); };
    const std::string head = "3397 42828.5 0 2 2 1 0 0\n";
    EXPECT_THROW(shadr(""), sim::SetupError);
    EXPECT_THAT(error(""), HasSubstr(":1: expected the header of a SHADR file"));
    EXPECT_THAT(error("DAF/SPK x"), HasSubstr(":1: expected the header"));
    EXPECT_THAT(error("3397 -1 0 2 2 1\n"), HasSubstr(":1: expected the header"));
    EXPECT_THAT(error("3397 42828.5 0 2 3 1\n"), HasSubstr(":1: expected the header"));
    EXPECT_THAT(error("3397 42828.5 0 2 2 2\n"), HasSubstr("1: fully normalised, or 0"));
    EXPECT_THAT(error(head + "2 0 1 0\n2 1 1\n"), HasSubstr(":3: expected n, m, C, S, found 3"));
    EXPECT_THAT(error(head + "2 0 1 0\n2 1 1 x\n"), HasSubstr(":3: expected a number, found \"x\""));
    EXPECT_THAT(error(head + "2.5 0 1 0\n"), HasSubstr(":2: expected a number, found \"2.5\""));
    EXPECT_THAT(error(head + "3 0 1 0\n"), HasSubstr("degree 3, order 0; the header promises up to 2, 2"));
    EXPECT_THAT(error(head + "1 2 1 0\n"), HasSubstr("degree 1, order 2"));
    EXPECT_THAT(error(head + "2 0 1 0\n2 0 1 0\n"), HasSubstr(":3: degree 2, order 0 is given twice"));
    EXPECT_THAT(error(head + "2 0 1 0\n2 1 1 0\n"),
                HasSubstr("degree 2, order 2 is missing; the header promises all up to 2, 2. Is the "
                          "file cut short?"));
}

TEST(HarmonicField, AFileNeedsNoMoreThanTheDegreeThatIsWanted)
{
    // As Basilisk's GGM03S-J2-only.txt.
    const std::string head = "6378136.3, 3.986004415E+14, 7.29E-5, 180, 180, %, 0.0, 0.0\n";
    const std::string rows = "0, 0, 1, 0, 0, 0\n2, 0, -5E-04, 0, 4E-11, 0\n2, 1, 0, 0, 0, 0\n2, 2, 0, 0, 0, 0\n"
                             "3, 0, 7E-01, 0, 0, 0\n";
    const auto read = [&](int degree, char normalised) {
        std::string text = head + rows;
        text[text.find('%')] = normalised;
        const TemporaryFile file("j2.txt", text);
        return read_gravity_field(file.path(), std::nullopt, 0.0, degree);
    };
    const HarmonicField field = read(2, '1');
    EXPECT_EQ(field.degree, 2);
    EXPECT_EQ(field.C, (std::vector<double>{1, 0, 0, -5e-4, 0, 0}));
    EXPECT_DOUBLE_EQ(read(2, '0').C[3], -5e-4 / std::sqrt(5.0));
    EXPECT_EQ(read(0, '1').C, std::vector<double>{1});
    for (const int degree : {3, 180, 1000}) {
        EXPECT_THAT(error_of([&] { read(degree, '1'); }),
                    HasSubstr("degree 3, order 1 is missing; the header promises all up to 180, 180. Is the file cut "
                              "short? Up to degree 2 all is there: give degree=2"));
    }
    const TemporaryFile file("j2.gfc", icgem_head + "max_degree 3\nend_of_head\n" + icgem_rows + "gfct 3 0 1 0\n");
    EXPECT_EQ(read_gravity_field(file.path(), day(0), 0.0, 2).S[HarmonicField::index(2, 1)], 2e-10);
}

TEST(HarmonicField, ARefusalShowsLittleOfAFile)
{
    const std::string zeros = error_of([] { shadr("3397 42828.5 0 2 2 1\n" + std::string(10'000, '\0')); });
    EXPECT_THAT(zeros, HasSubstr(":2: expected n, m, C, S, found 1 values"));
    const std::string bytes =
        error_of([] { shadr("3397 42828.5 0 2 2 1\n2 0 " + std::string(10'000, '\xff') + " 0"); });
    EXPECT_THAT(bytes, HasSubstr(":2: expected a number, found \"\xe2\x9f\xa8\x46\x46\xe2\x9f\xa9"));
    EXPECT_THAT(bytes, HasSubstr(" ... "));
    EXPECT_LT(bytes.size(), 1500);
}

TEST(HarmonicField, EveryCutOfARealFieldIsRefused)
{
    const std::string path = real_file("mars-ggm2bc80.shadr.csv");
    SKIP_WITHOUT(path);
    const std::string text = read_whole(path);
    // The end of the last row is blank and holds what is not read.
    for (std::size_t size = 0; size < text.size() - 122; size += 40'009) {
        EXPECT_NE(error_of([&] { shadr(text.substr(0, size)); }), "") << size;
    }
}

TEST(HarmonicField, IcgemStatesItsTidesAndWhatVaries)
{
    HarmonicField field = icgem(icgem_head + "tide_system zero_tide\nend_of_head ======\n" + icgem_rows);
    EXPECT_EQ(field.name, "TEST");
    EXPECT_EQ(field.tide_system, "zero_tide");
    EXPECT_EQ(field.mu, 3.986004415e14);
    EXPECT_EQ(field.radius, 6378136.3);
    EXPECT_EQ(field.S[HarmonicField::index(2, 1)], 2e-10);

    field = icgem(icgem_head + "norm unnormalized\nend_of_head\n" + icgem_rows);
    EXPECT_NEAR(field.C[HarmonicField::index(2, 0)], -0.48e-3 / std::sqrt(5.0), 1e-18);
}

TEST(HarmonicField, ChangesOfIcgemAreThoseOfTheEpoch)
{
    const std::string rows = "gfct 2 0 -0.48e-3 2e-9 1e-13 0 20050101\ntrnd 2 0 1e-11 4e-12 0 0\n"
                             "acos 2 0 3e-11 5e-11 0 0 1.0\nasin 2 0 7e-11 1.1e-10 0 0 1.0\n"
                             "acos 2 0 1.3e-11 1.7e-11 0 0 0.5\nasin 2 0 1.9e-11 2.3e-11 0 0 0.5\n" +
                             icgem_rest;
    // After n + 1/4 of a year, the cosine of a year is 0 and its sine 1; of half a year, -1 and 0.
    for (const double years : {-3.75, 0.25, 8.25}) {
        const HarmonicField field = icgem(icgem_head + "end_of_head\n" + rows, day(days_2005 + years * year));
        const std::size_t i = HarmonicField::index(2, 0);
        EXPECT_NEAR(field.C[i], -0.48e-3 + 1e-11 * years + 7e-11 - 1.3e-11, 1e-18) << years;
        EXPECT_NEAR(field.S[i], 2e-9 + 4e-12 * years + 1.1e-10 - 1.7e-11, 1e-22) << years;
    }
    const HarmonicField raw = icgem(icgem_head + "norm unnormalized\nend_of_head\n" +
                                        "gfct 2 0 1e-3 0 20041001\ndot 2 0 1e-5 0\n" + icgem_rest,
                                    day(days_2005 - 92.0 + 2.0 * year));
    EXPECT_NEAR(raw.C[HarmonicField::index(2, 0)], 1.02e-3 / std::sqrt(5.0), 1e-17);
}

TEST(HarmonicField, IntervalsOfIcgemHoldFromTheirBeginningToTheirEnd)
{
    const std::string text = "the details of this comment\nradius of nothing\nbegin_of_head ===\nformat icgem2.0\n" +
                             icgem_head + "end_of_head\n" +
                             "gfct 2 0 1e-3 0 0 0 20030101.0000 20041226.0060\n"
                             "gfct 2 0 2e-3 0 0 0 20041226.0060 20500101.0000\n"
                             "trnd 2 0 1e-5 0 0 0 20041226.0060 20500101.0000\n"
                             "asin 2 0 1e-6 0 0 0 20041226.0060 20500101.0000 1.0\n" +
                             icgem_rest;
    const std::size_t i = HarmonicField::index(2, 0);
    const double begin = days_2005 - 6.0 + 1.0 / 24.0; // 2004-12-26T01:00
    EXPECT_EQ(icgem(text, day(begin - 0.001)).C[i], 1e-3);
    // The sine counts from 2004-01-01, 366 days before 2005.
    const double angle = 2.0 * std::numbers::pi * (begin + 10.0 - (days_2005 - 366.0)) / year;
    EXPECT_NEAR(icgem(text, day(begin + 10.0)).C[i], 2e-3 + 1e-5 * 10.0 / year + 1e-6 * std::sin(angle), 1e-15);
    EXPECT_NEAR(icgem(text, day(begin)).C[i], 2e-3 + 1e-6 * std::sin(angle - 2.0 * std::numbers::pi * 10.0 / year),
                1e-15);
    for (const double outside : {days_2005 - 731.1, days_2005 + 45.0 * year}) {
        EXPECT_THAT(error_of([&] { icgem(text, day(outside)); }),
                    HasSubstr("degree 2, order 0 is missing; the header promises all up to 2, 2. Does no interval of "
                              "it hold the epoch"));
    }
}

TEST(HarmonicField, DamagedChangesAreRefusedWithTheirLine)
{
    const std::string first = icgem_head + "end_of_head\n", second = icgem_head + "format icgem2.0\nend_of_head\n";
    const auto error = [](const std::string &text) { return error_of([&] { icgem(text, day(days_2005)); }); };
    EXPECT_THAT(error_of([&] { icgem(first + "gfct 2 0 1 0 20050101\n"); }),
                HasSubstr(":10: its coefficients change in time; say when they are to hold, as in epoch=\"2026"));
    EXPECT_THAT(error(first + "trnd 2 0 1 0\n"), HasSubstr(":10: expected gfct of degree 2, order 0"));
    EXPECT_THAT(error(first + "gfct 2 0 1 0\n"), HasSubstr(":10: the row ends before its dates or its period"));
    EXPECT_THAT(error(first + "gfct 2 0 1 0 20050101\nacos 2 0 1 0 0 1e-12\n"),
                HasSubstr(":11: expected a period > 0.001 y, found"));
    EXPECT_THAT(error(second + "gfct 2 0 1 0 20040101\n"), HasSubstr(":11: the row ends before"));
    EXPECT_THAT(error(second + "gfct 2 0 1 0 20040101 20060101\ngfct 2 0 1 0 20041231 20060101\n"),
                HasSubstr(":12: degree 2, order 0 is given twice"));
    EXPECT_THAT(error("format icgem3.0\n"), HasSubstr(":1: the value \"icgem3.0\" of format"));
    for (const char *date : {"2005", "20051301", "20050230", "20050101.0061", "20050101.2500", "20050101.5", "1e20"}) {
        EXPECT_THAT(error(first + "gfct 2 0 1 0 " + date + "\n"), HasSubstr(":10: expected a date yyyymmdd")) << date;
    }
}

TEST(HarmonicField, ItsFormIsFoundByWhatAFileHolds)
{
    const auto read = [](const std::string &text) {
        const TemporaryFile file("field", text);
        return read_gravity_field(file.path());
    };
    EXPECT_EQ(read(icgem_head + "end_of_head\n" + icgem_rows).name, "TEST");
    EXPECT_EQ(read("3397000\t4.28285D13\t0 0 0 1\n").mu, 4.28285e13);
    EXPECT_THAT(error_of([&] { read("\x1f\x8b\x08"); }), HasSubstr("is compressed; unpack it first"));
    EXPECT_THAT(error_of([&] { read("COMMENT   5\nC\nPOTFIELD 2 2  1 3.9E+14 6.4E+06 1.0\n"); }),
                HasSubstr(":1: expected the header of a SHADR file"));
    EXPECT_THAT(error_of([&] { read("4.28285e13 3397000 0 2 2 1\n"); }),
                HasSubstr(":1: a radius of 4.28285e+13 is none: SHADR has the radius first, then mu"));
}

TEST(HarmonicField, DamagedIcgemIsRefusedWithItsLine)
{
    const auto error = [](const std::string &text) { return error_of([&] { icgem(text); }); };
    EXPECT_EQ(error(icgem_head + "end_of_head\n" + icgem_rows), "");
    EXPECT_THAT(error(icgem_head + icgem_rows), HasSubstr("has no line end_of_head"));
    EXPECT_THAT(error("radius 1\nmax_degree 2\nend_of_head\n"), HasSubstr("lacks earth_gravity_constant"));
    EXPECT_THAT(error("radius x\n"), HasSubstr(":1: the value \"x\" of radius is not understood"));
    EXPECT_THAT(error("product_type topography\n"), HasSubstr(":1: expected product_type gravity_field"));
    EXPECT_THAT(error("norm half\n"), HasSubstr(":1: the value \"half\" of norm"));
    const std::string head = icgem_head + "end_of_head\n";
    EXPECT_THAT(error(head + "gfc 2 0 1 0\ngfc 2 1 1 0\n"), HasSubstr("degree 2, order 2 is missing"));
    EXPECT_THAT(error(head + "gfx 2 0 1 0\n"), HasSubstr(":10: expected gfc, gfct, trnd"));
    EXPECT_THAT(error(head + "gfc 2 0 1\n"), HasSubstr(":10: expected n, m, C, S, found 3 values"));
    EXPECT_THAT(error("earth_gravity_constant -1\nradius 1\nmax_degree 2\nend_of_head\n"),
                HasSubstr("a.gfc: gravity field: mu and the radius must be > 0"));
}

} // namespace harmonic_field_test
} // namespace fledge::world
