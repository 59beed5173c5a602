// SPDX-License-Identifier: Apache-2.0
#include "world/environment/timescale.h"

#include "sim/error.h"
#include "world/environment/testing/files.h"

#include <chrono>
#include <cmath>
#include <random>

namespace fledge::world {
namespace timescale_test {

using ::testing::HasSubstr;
using testing::real_file;
using testing::TemporaryFile;

constexpr std::int64_t second = 1'000'000'000;

TEST(TimeScale, J2000IsNoonOfTheFirstOfJanuary2000)
{
    const TimeSystem system;
    EXPECT_EQ(system.epoch("2000-01-01T12:00:00 TDB").ns, 0);
    EXPECT_EQ(system.tt(system.epoch("2000-01-01T12:00:00 TT")), 0);
    EXPECT_EQ(system.tai(system.epoch("2000-01-01T12:00:00 TAI")), 0);
    // 32 leap seconds then: noon UTC is 64.184 s later than noon TT.
    EXPECT_EQ(system.tt(system.epoch("2000-01-01T12:00:00")), 64'184'000'000);
}

TEST(TimeScale, UtcToTdbAddsItsTerms)
{
    const Epoch epoch = TimeSystem().epoch("2015-03-02T12:00:00");
    // 5539 days past J2000, 35 leap seconds, 32.184 s, and K sin E with the C library's sine.
    const double tt = 5539.0 * 86400.0 + 35.0 + 32.184;
    const double M = 6.239996 + 1.99096871e-7 * tt;
    const double expected = 1.657e-3 * std::sin(M + 1.671e-2 * std::sin(M));
    EXPECT_NEAR(static_cast<double>(epoch.ns - 478'569'667'184'000'000) * 1e-9, expected, 1e-9);
}

TEST(TimeScale, TdbIsWithinItsStatedErrorOfALongerSeries)
{
    // USNO Circular 179 (2005), Eq. 2.6: within 10 us from 1600 to 2200.
    const TimeSystem system;
    double worst = 0.0;
    for (int day = -10'000; day < 36'525; day += 7) {
        const std::int64_t tt = day * 86'400 * second;
        const double T = day / 36'525.0;
        const double series = 0.001657 * std::sin(628.3076 * T + 6.2401) + 0.000022 * std::sin(575.3385 * T + 4.2970) +
                              0.000014 * std::sin(1256.6152 * T + 6.1969) + 0.000005 * std::sin(606.9777 * T + 4.0212) +
                              0.000005 * std::sin(52.9691 * T + 0.4444) + 0.000002 * std::sin(21.3299 * T + 5.5431) +
                              0.000010 * T * std::sin(628.3076 * T + 4.2490);
        const double ours = static_cast<double>(system.from_tt(tt).ns - tt) * 1e-9;
        worst = std::max(worst, std::fabs(ours - series));
    }
    EXPECT_LT(worst, 50e-6);
    EXPECT_GT(worst, 5e-6); // a longer series it is
}

TEST(TimeScale, DatesAgreeWithTheStandardLibrary)
{
    using namespace std::chrono;
    const TimeSystem system;
    const auto j2000 = sys_days{January / 1 / 2000};
    for (sys_days day{January / 1 / 1709}; day < sys_days{January / 1 / 2292}; day += days{13}) {
        const year_month_day date{day};
        const CalendarTime time{int(date.year()), int(unsigned(date.month())), int(unsigned(date.day())), 12, 0, 0, 0};
        const Epoch epoch = system.epoch(time, TimeScale::tdb);
        ASSERT_EQ(epoch.ns, (day - j2000).count() * 86'400 * second);
        ASSERT_EQ(system.calendar(epoch, TimeScale::tdb), time);
    }
}

TEST(TimeScale, LeapSecondsPassOneByOne)
{
    const TimeSystem system;
    const Epoch before = system.epoch("2016-12-31T23:59:59");
    const Epoch leap = system.epoch("2016-12-31T23:59:60");
    const Epoch after = system.epoch("2017-01-01T00:00:00");
    EXPECT_NEAR(static_cast<double>(leap.ns - before.ns), 1e9, 1.0);
    EXPECT_NEAR(static_cast<double>(after.ns - leap.ns), 1e9, 1.0);
    EXPECT_EQ(system.text(leap), "2016-12-31T23:59:60Z");
    EXPECT_EQ(system.text({leap.ns + second - 1}), "2016-12-31T23:59:60.999999999Z");
    EXPECT_EQ(system.text(after), "2017-01-01T00:00:00Z");
    EXPECT_EQ(system.text(before), "2016-12-31T23:59:59Z");
    EXPECT_EQ(system.tai_minus_utc(leap), 36);
    EXPECT_EQ(system.tai_minus_utc(after), 37);
}

TEST(TimeScale, EveryScaleMakesTheRoundTrip)
{
    const TimeSystem system;
    std::mt19937_64 random(1);
    // 1972 to 2291, in ns of TDB.
    std::uniform_int_distribution<std::int64_t> any(-883'000'000 * second, 9'180'000'000 * second);
    for (int i = 0; i < 20'000; i++) {
        const Epoch epoch{any(random)};
        for (const TimeScale scale : {TimeScale::utc, TimeScale::tai, TimeScale::tt, TimeScale::tdb}) {
            ASSERT_EQ(system.epoch(system.calendar(epoch, scale), scale), epoch);
        }
        ASSERT_EQ(system.epoch(system.text(epoch)), epoch) << system.text(epoch);
        ASSERT_EQ(system.epoch(system.text(epoch, TimeScale::tai)), epoch);
        ASSERT_EQ(system.from_tt(system.tt(epoch)), epoch);
        ASSERT_EQ(system.from_tai(system.tai(epoch)), epoch);
    }
}

TEST(TimeScale, TdbStaysWithinTwoMillisecondsOfTt)
{
    const TimeSystem system;
    double least = 0.0, most = 0.0;
    for (int day = 0; day < 366; day++) {
        const std::int64_t tt = day * 86'400 * second;
        const double difference = static_cast<double>(system.from_tt(tt).ns - tt) * 1e-9;
        least = std::min(least, difference);
        most = std::max(most, difference);
    }
    EXPECT_NEAR(most, 1.657e-3, 1e-7);
    EXPECT_NEAR(least, -1.657e-3, 1e-7);
}

TEST(TimeScale, TextMayNameItsScaleAndLeaveOutTheClock)
{
    const TimeSystem system;
    const Epoch noon = system.epoch("2015-03-02T12:00:00");
    EXPECT_EQ(system.epoch("2015-03-02 12:00:00Z"), noon);
    EXPECT_EQ(system.epoch("2015-03-02T12:00 UTC"), noon);
    EXPECT_EQ(system.epoch("2015-03-02T12:00:35 TAI"), noon);
    EXPECT_EQ(system.epoch("2015-03-02T12:01:07.184 TT"), noon);
    EXPECT_EQ(system.epoch("2015-03-02T00:00:00.000000000"), system.epoch("2015-03-02"));
    EXPECT_EQ(system.epoch("2015-03-02 TDB"), system.epoch("2015-03-02T00:00:00 TDB"));
    EXPECT_EQ(system.text(noon, TimeScale::tt), "2015-03-02T12:01:07.184 TT");
}

TEST(TimeScale, GpsCountsFromItsBeginningWithoutLeapSeconds)
{
    const TimeSystem system;
    EXPECT_EQ(system.gps(system.epoch("1980-01-06")), 0);
    EXPECT_EQ(system.epoch("1980-01-06 GPS"), system.epoch("1980-01-06"));
    // The counter of weeks with 10 bits began anew there, 18 s ahead of UTC's midnight.
    EXPECT_EQ(system.gps(system.epoch("2019-04-06T23:59:42")), 2048 * 604'800'000'000'000);
    EXPECT_EQ(system.epoch("2019-04-07T00:00:00 GPS"), system.epoch("2019-04-06T23:59:42Z"));
    EXPECT_EQ(system.text(system.epoch("2019-04-06T23:59:42.5"), TimeScale::gps), "2019-04-07T00:00:00.5 GPS");
    EXPECT_EQ(system.gps(system.epoch("1979-12-30")), -604'801'000'000'000); // a leap second lies between
}

TEST(TimeScale, WhatIsNoTimeIsRefused)
{
    const TimeSystem system;
    const auto error = [&](const char *text) { return error_of([&] { system.epoch(text); }); };
    EXPECT_THROW(system.epoch("2015-02-29"), sim::SetupError);
    EXPECT_THAT(error("2015-02-29"), HasSubstr("day 29 is not within 1 to 28"));
    EXPECT_THAT(error("2016-13-01"), HasSubstr("month 13 is not within 1 to 12"));
    EXPECT_THAT(error("2016-01-01T24:00:00"), HasSubstr("hour 24"));
    EXPECT_THAT(error("1700-01-01 TDB"), HasSubstr("year 1700 is not within 1709 to 2291"));
    EXPECT_THAT(error("1969-07-20T20:17:40"), HasSubstr("give TAI, TT or TDB"));
    EXPECT_THAT(error("2015-06-29T23:59:60"), HasSubstr("second 60 exists only"));
    EXPECT_THAT(error("2015-06-30T22:59:60"), HasSubstr("second 60 exists only"));
    EXPECT_THAT(error("2015-06-30T23:59:60 TAI"), HasSubstr("second 60 exists only"));
    EXPECT_THAT(error("1971-12-31T23:59:60"), HasSubstr("before 1972-01-01"));
    for (const char *text :
         {"", "today", "2015-3-2", "2015-03-02T", "2015-03-02T12", "2015-03-02 UT1", "2015-03-02T12:00:00.",
          "2015-03-02T12:00:00.1234567890", "2015-03-02T12:00:00+01:00", "2015-03-02T12:00:00 tdb"}) {
        EXPECT_THAT(error(text), HasSubstr("expected a date as in 2015-03-02T12:00:00")) << text;
    }
    EXPECT_THROW(system.calendar(Epoch{-1'000'000'000 * second}, TimeScale::utc), sim::SetupError);
}

TEST(LeapSecondsKernel, NaifsAgreesWithWhatIsBuiltIn)
{
    const std::string path = real_file("naif0011.tls");
    SKIP_WITHOUT(path);
    const TimeSystem read = TimeSystem::read(path), built_in;
    for (int year = 1972; year < 2017; year++) {
        for (const int month : {1, 4, 7, 10}) {
            const CalendarTime time{year, month, 1, 0, 0, 0, 0};
            EXPECT_EQ(read.epoch(time, TimeScale::utc), built_in.epoch(time, TimeScale::utc));
        }
    }
    EXPECT_EQ(built_in.tai_minus_utc(built_in.epoch("2020-01-01")), 37);
}

TEST(LeapSecondsKernel, OneThatEndsBeforeAKnownLeapSecondIsRefusedFromThatOneOn)
{
    const TemporaryFile file("old.tls", "KPL/LSK\n\\begindata\nDELTET/DELTA_T_A = 32.184\nDELTET/K = 1.657D-3\n"
                                        "DELTET/EB = 1.671D-2\nDELTET/M = ( 6.239996D0 1.99096871D-7 )\n"
                                        "DELTET/DELTA_AT = ( 10, @1972-JAN-1 11, @1972-JUL-1 )\n\\begintext\n");
    const TimeSystem old = TimeSystem::read(file.path()), built_in;
    EXPECT_EQ(old.epoch("1972-12-31T23:59:59"), built_in.epoch("1972-12-31T23:59:59"));
    EXPECT_EQ(old.text(built_in.epoch("1972-12-31T23:59:59.999999999")), "1972-12-31T23:59:59.999999999Z");
    const std::string refused =
        file.path() + ": has no leap second before 1973-01-01: UTC from then on needs a newer file";
    const Epoch leap = built_in.epoch("1972-12-31T23:59:60");
    EXPECT_EQ(error_of([&] { old.epoch("1973-01-01"); }), refused);
    EXPECT_EQ(error_of([&] { old.text(leap); }), refused);
    EXPECT_EQ(error_of([&] { old.tai_minus_utc(built_in.epoch("2020-01-01")); }), refused);
    // What needs no UTC is as before.
    EXPECT_EQ(old.epoch("2020-01-01 TDB"), built_in.epoch("2020-01-01 TDB"));
    EXPECT_EQ(old.tai(leap), built_in.tai(leap));
}

TEST(LeapSecondsKernel, EachOfItsConstantsCounts)
{
    // TT = TAI + DELTA_T_A, TDB = TT + K sin(M + EB sin M), M = M0 + M1 t. At 1,000,000 s past J2000:
    struct {
        const char *EB, *M;
        double tdb_minus_tt;
    } const cases[] = {{"0", "( 1.0 0 )", 0.01 * std::sin(1.0)},
                       {"0.1", "( 1.0 0 )", 0.01 * std::sin(1.0 + 0.1 * std::sin(1.0))},
                       {"0", "( 0.5 1D-6 )", 0.01 * std::sin(1.5)}};
    for (const auto &[EB, M, tdb_minus_tt] : cases) {
        const TemporaryFile file("constants.tls", std::string("KPL/LSK\n\\begindata\nDELTET/DELTA_T_A = 33\n") +
                                                      "DELTET/K = 0.01\nDELTET/EB = " + EB + "\nDELTET/M = " + M +
                                                      "\nDELTET/DELTA_AT = ( 10, @1972-JAN-1 )\n\\begintext\n");
        const TimeSystem system = TimeSystem::read(file.path());
        const auto at = [&](const char *scale) { return system.epoch(std::string("2000-01-13T01:46:40 ") + scale).ns; };
        EXPECT_NEAR(static_cast<double>(at("TT") - at("TDB")), 1e9 * tdb_minus_tt, 2.0) << EB << M;
        EXPECT_NEAR(static_cast<double>(at("TAI") - at("TT")), 33e9, 1000.0);
    }
}

TEST(LeapSecondsKernel, WhatIsDamagedIsRefusedWithItsLine)
{
    const auto error = [](const std::string &table) {
        const TemporaryFile file("leap.tls", "KPL/LSK\n\\begindata\nDELTET/DELTA_T_A = 32.184\n"
                                             "DELTET/K = 1.657D-3\nDELTET/EB = 1.671D-2\n"
                                             "DELTET/M = ( 6.239996D0 1.99096871D-7 )\n" +
                                                 table + "\n\\begintext\n");
        return error_of([&] { TimeSystem::read(file.path()); });
    };
    const std::string begin = "DELTET/DELTA_AT = ( 10, @1972-JAN-1\n";
    EXPECT_EQ(error(begin + "11, @1972-JUL-1 )"), "");
    EXPECT_EQ(error(begin + "11, @1972-07-01 )"), "");
    EXPECT_THAT(error(begin + "11, @1972-JUX-1 )"), HasSubstr(":8: expected a date"));
    EXPECT_THAT(error(begin + "11, @1972-JUN-31 )"), HasSubstr(":8: expected a date"));
    EXPECT_THAT(error(begin + "11 )"), HasSubstr("the last is not whole"));
    EXPECT_THAT(error(begin + "13, @1972-JUL-1 )"), HasSubstr(":8: dates must ascend"));
    EXPECT_THAT(error(begin + "11, @1971-JUL-1 )"), HasSubstr(":8: dates must ascend"));
    EXPECT_THAT(error(begin + "10.5, @1972-JUL-1 )"), HasSubstr("expected a whole number"));
    EXPECT_THAT(error("OTHER = 1"), HasSubstr("expected a leap-seconds kernel"));
    EXPECT_THAT(error(begin + ")\nDELTET/K = 1.657D+300"),
                HasSubstr(":9: DELTET/K is 1.657e+300; expected at most 0.01"));
    EXPECT_THAT(error(begin + ")\nDELTET/M = ( 6.2, 2.0 )"), HasSubstr(":9: DELTET/M is 2; expected at most 1e-06"));
    EXPECT_THROW(TimeSystem::read("/nowhere/naif.tls"), sim::SetupError);
    EXPECT_THAT(error_of([] { TimeSystem::read("/nowhere/naif.tls"); }),
                HasSubstr("/nowhere/naif.tls: cannot be opened: No such file"));
}

} // namespace timescale_test
} // namespace fledge::world
