// SPDX-License-Identifier: Apache-2.0
// The C library's calendar, and the leap seconds of IERS Bulletin C as it prints them, are the second computation.
#include "ground/database/times.h"

#include "ground/database/encoder.h"
#include "ground/database/testing/database.h"

#include <ctime>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <random>
#include <regex>

namespace fledge::ground {

namespace times_test {

using namespace testing;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr std::int64_t second = 1'000'000'000;

std::int64_t utc(int year, int month, int day, int hour = 0, int minute = 0, int s = 0)
{
    std::tm date{};
    date.tm_year = year - 1900, date.tm_mon = month - 1, date.tm_mday = day;
    date.tm_hour = hour, date.tm_min = minute, date.tm_sec = s;
    return timegm(&date) * second;
}

TEST(Times, DatesAreThoseOfTheCalendar)
{
    std::mt19937_64 random(1);
    for (int i = 0; i < 20'000; i++) {
        const auto s = std::uniform_int_distribution<std::int64_t>(-9'000'000'000, 9'000'000'000)(random);
        const auto part = std::uniform_int_distribution<std::int64_t>(0, second - 1)(random);
        const std::time_t whole = s;
        char text[64];
        std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%S", gmtime(&whole));
        char digits[16];
        std::snprintf(digits, sizeof digits, ".%09d", static_cast<int>(part));
        const std::string date = text + std::string(digits);
        ASSERT_EQ(date_of(date), s * second + part) << date;
        const std::string shown = time_text(Kind::time, s * second + part);
        ASSERT_EQ(date_of(shown), s * second + part) << shown;
        ASSERT_EQ(shown.substr(0, 19), text);
    }
    EXPECT_EQ(time_text(Kind::time, 1'500'000'000), "1970-01-01T00:00:01.5Z");
    EXPECT_EQ(time_text(Kind::time, -1), "1969-12-31T23:59:59.999999999Z");
    EXPECT_EQ(date_of("2026-03-01"), utc(2026, 3, 1));
    EXPECT_EQ(date_of("2024-02-29 23:59:59.5Z"), utc(2024, 2, 29, 23, 59, 59) + second / 2);
    EXPECT_EQ(date_of("2026-03-01T12:00:00+01:30"), utc(2026, 3, 1, 10, 30));
    EXPECT_EQ(date_of("2026-03-01T12:00:00-01:00"), utc(2026, 3, 1, 13));
    EXPECT_EQ(date_of("2026-03-01T12:00:00.12345678999"), utc(2026, 3, 1, 12) + 123'456'789);
    for (const char *text : {"",
                             "2026",
                             "2026-3-1",
                             "2026-02-29",
                             "2026-13-01",
                             "2026-03-01T",
                             "2026-03-01T12",
                             "2026-03-01T12:00",
                             "2026-03-01T24:00:00",
                             "2026-03-01T12:60:00",
                             "2026-03-01T12:00:60",
                             "2026-03-01T12:00:00.",
                             "2016-12-30T23:59:60",
                             "2016-12-31T23:59:61",
                             "2016-12-31T12:00:60",
                             "1971-12-31T23:59:60",
                             "2026-03-01T12:00:00+1",
                             "2026-03-01T12:00:00X",
                             "2026-03-01T12:00:00+",
                             "1600-01-01",
                             "2300-01-01",
                             "12"}) {
        EXPECT_EQ(date_of(text), std::nullopt) << text;
    }
    for (const char *text : {"2016-12-31T23:59:60.5Z", "2016-12-31 23:59:60.5", "2017-01-01T00:59:60.5+01:00"}) {
        EXPECT_EQ(date_of(text), utc(2017, 1, 1) + second / 2) << text; // the numbers of the second behind it
        EXPECT_TRUE(is_leap_second(text));
    }
    EXPECT_FALSE(is_leap_second("2017-01-01T00:00:00.5Z"));
    EXPECT_EQ(epoch_of("2016-12-31T23:59:60")->ns, epoch_of("2016-12-31T23:59:59")->ns + second);
}

TEST(Times, DurationsHaveTheirUnits)
{
    EXPECT_EQ(duration_of("P1DT2H3M4.5S"), (((24 + 2) * 60 + 3) * 60 + 4) * second + second / 2);
    EXPECT_EQ(duration_of("-PT0.000000001S"), -1);
    EXPECT_EQ(duration_of("PT90M"), 5400 * second);
    EXPECT_EQ(duration_of("P2D"), 172'800 * second);
    EXPECT_EQ(duration_of("1.5 s"), second + second / 2);
    EXPECT_EQ(duration_of("-20ms"), -20'000'000);
    EXPECT_EQ(duration_of("+3 us"), 3000);
    EXPECT_EQ(duration_of("999999999999999999 ns"), 999'999'999'999'999'999);
    for (const char *text : {"", "P", "PT", "P1DT", "P1Y", "PT1S2M", "PT1M1M", "1", "1.5", "s", "1 m", "1 s s", "P1D1D",
                             "9223372036854775808 ns", "99999999999 s", "PT1", "--1 s", "P-1D"}) {
        EXPECT_EQ(duration_of(text), std::nullopt) << text;
    }
    EXPECT_EQ(time_text(Kind::duration, -1'500'000'000), "-1.5");
    EXPECT_EQ(time_text(Kind::duration, std::numeric_limits<std::int64_t>::min()), "-9223372036.854775808");
    EXPECT_EQ(time_text(Kind::duration, 86'400 * second), "86400");
}

TEST(Times, EpochsCountLeapSecondsAsTheirScaleDoes)
{
    const auto at = [](const char *epoch, std::int64_t ns) { // of a count
        const auto found = epoch_of(epoch);
        const Wide sum = Wide(found->ns) + ns;
        return static_cast<std::int64_t>(found->leap_seconds ? utc_of_tai(sum) : sum);
    };
    EXPECT_EQ(at("UNIX", 5), 5);
    EXPECT_EQ(at("POSIX", 5), 5);
    EXPECT_EQ(at("GPS", 0), utc(1980, 1, 6));
    EXPECT_EQ(at("GPS", 1'000'000'000 * second), utc(2011, 9, 14, 1, 46, 25)); // 15 leap seconds since 1980
    EXPECT_EQ(at("1980-01-06T00:00:00", 1'000'000'000 * second), utc(2011, 9, 14, 1, 46, 25));
    EXPECT_EQ(at("J2000", 0), utc(2000, 1, 1, 11, 58, 55) + 816'000'000);
    EXPECT_EQ(at("2000-01-01T12:00:00", 0), utc(2000, 1, 1, 12));
    EXPECT_EQ(at("2000-01-01T12:00:00Z", 800'000'000 * second), utc(2000, 1, 1, 12) + (800'000'000 - 5) * second);
    EXPECT_EQ(at("TAI", 1'861'920'037 * second), utc(2017, 1, 1));
    EXPECT_EQ(at("1958-01-01", 1'861'920'000 * second), utc(2017, 1, 1)); // a date before 1972 counts days
    EXPECT_EQ(at("1970-01-01T00:00:00", 5), 5);
    for (const char *text : {"", "Unix", "MISSION", "2000", "2200-01-02"}) {
        EXPECT_FALSE(epoch_of(text)) << text;
    }
    // Before, within and behind each leap second of the Bulletin.
    int by = 10;
    for (const auto &[year, month] : std::vector<std::pair<int, int>>{
             {1972, 7}, {1973, 1}, {1974, 1}, {1975, 1}, {1976, 1}, {1977, 1}, {1978, 1}, {1979, 1}, {1980, 1},
             {1981, 7}, {1982, 7}, {1983, 7}, {1985, 7}, {1988, 1}, {1990, 1}, {1991, 1}, {1992, 7}, {1993, 7},
             {1994, 7}, {1996, 1}, {1997, 7}, {1999, 1}, {2006, 1}, {2009, 1}, {2012, 7}, {2015, 7}, {2017, 1}}) {
        const std::int64_t midnight = utc(year, month, 1);
        EXPECT_EQ(utc_of_tai(midnight + by * second - 1), midnight - 1);
        EXPECT_EQ(utc_of_tai(midnight + by * second), midnight); // the leap second has the next one's numbers
        by++;
        EXPECT_EQ(utc_of_tai(midnight + by * second - 1), midnight + second - 1);
        EXPECT_EQ(utc_of_tai(midnight + by * second), midnight);
        EXPECT_EQ(tai_of_utc(midnight), midnight + by * second);
        EXPECT_EQ(tai_of_utc(midnight - 1), midnight - 1 + (by - 1) * second);
    }
    EXPECT_EQ(by, 37);
    EXPECT_EQ(utc_of_tai(0), -10 * second);
}

// --- types of a database

std::string time_type(const std::string &kind, const std::string &reference, const std::string &encoding,
                      const std::string &attributes = "")
{
    return "<" + kind + " name='t'><Encoding " + attributes + ">" + encoding + "</Encoding>" +
           (reference.empty() ? "" : "<ReferenceTime>" + reference + "</ReferenceTime>") + "</" + kind + ">";
}

const char *const u32 = "<IntegerDataEncoding sizeInBits='32'/>";
const char *const u64 = "<IntegerDataEncoding sizeInBits='64'/>";

std::string value(const std::string &type, const Bytes &packet)
{
    return decoded(file(type, "a:t", container("P", "a")), packet);
}

Bytes big_endian(std::uint64_t x, int n)
{
    Bytes all;
    for (int i = n; i-- > 0;) {
        all.push_back(static_cast<std::uint8_t>(x >> 8 * i));
    }
    return all;
}

TEST(Times, ACountOfFractionsOfASecondIsRightToANanosecond)
{
    // 2^-32 s: the product has 85 bits.
    const std::string cuc =
        time_type("AbsoluteTimeParameterType", "<Epoch>UNIX</Epoch>", u64, "scale='2.3283064365386963e-10'");
    std::mt19937_64 random(2);
    for (int i = 0; i < 200; i++) {
        const std::uint64_t raw = random() >> 1;
        const auto ns = static_cast<std::int64_t>((Wide(raw) * second + (Wide(1) << 31)) >> 32); // the nearest
        const std::string found = value(cuc, big_endian(raw, 8));
        EXPECT_LE(std::abs(std::stoll(found.substr(2)) - ns), 1) << found;
    }
}

TEST(Times, ATimeThatCountsFromAnotherHasItsEpochAndScale)
{
    // 2016-12-31T23:59:59 UTC and 2.5 s: a leap second lies between.
    const auto offset = [](const char *sort, const char *epoch) {
        return file("<AbsoluteTimeParameterType name='c'><Encoding><IntegerDataEncoding sizeInBits='32'/></Encoding>"
                    "<ReferenceTime>" +
                        std::string(epoch) + "</ReferenceTime></AbsoluteTimeParameterType>" +
                        time_type(sort, "<OffsetFrom parameterRef='a'/>", "<IntegerDataEncoding sizeInBits='8'/>",
                                  "scale='0.5'"),
                    "a:c b:t", container("P", "a b"));
    };
    Bytes packet = big_endian(1'167'264'016, 4); // s of GPS
    packet.push_back(5);
    const std::string base = "a=" + std::to_string(utc(2016, 12, 31, 23, 59, 59));
    EXPECT_EQ(decoded(offset("AbsoluteTimeParameterType", "<Epoch>GPS</Epoch>"), packet),
              base + " b=" + std::to_string(utc(2017, 1, 1) + second / 2));
    EXPECT_EQ(decoded(offset("RelativeTimeParameterType", "<Epoch>GPS</Epoch>"), packet), base + " b=2500000000");
    for (const int into : {1, 2}) { // the leap second, and the second behind it, which have the same numbers
        Bytes later = big_endian(1'167'264'016 + static_cast<std::uint64_t>(into), 4);
        later.push_back(5);
        EXPECT_EQ(decoded(offset("AbsoluteTimeParameterType", "<Epoch>GPS</Epoch>"), later),
                  "a=" + std::to_string(utc(2017, 1, 1)) +
                      " b=" + std::to_string(utc(2017, 1, 1) + into * second + second / 2));
    }
    const Database db = read_xtce_text(offset("AbsoluteTimeParameterType", "<Epoch>GPS</Epoch>"), "s.xml");
    EXPECT_TRUE(db.notes.empty());
    // without a known epoch both are durations, and a note says so
    const std::string unknown =
        std::regex_replace(offset("AbsoluteTimeParameterType", ""), std::regex("<ReferenceTime></ReferenceTime>"), "");
    EXPECT_EQ(decoded(unknown, packet), "a=1167264016000000000 b=1167264018500000000");
    EXPECT_THAT(read_xtce_text(unknown, "s.xml").notes,
                ElementsAre(HasSubstr("the times of c have no epoch"), HasSubstr("the times of t have no epoch")));
}

TEST(Times, ConditionsCompareTimesWithDates)
{
    const std::string types = time_type("AbsoluteTimeParameterType", "<Epoch>GPS</Epoch>", u32) + integer("u8", 8);
    const std::string xml =
        file(types, "a:t x:u8",
             container("P", "a", "", "abstract='true'") +
                 container("Q", "x",
                           "<BaseContainer containerRef='P'><RestrictionCriteria><Comparison parameterRef='a' "
                           "comparisonOperator='>=' value='2011-09-14T01:46:25Z'/></RestrictionCriteria>"
                           "</BaseContainer>"));
    Bytes packet = big_endian(1'000'000'000, 4); // s of GPS, of which 15 are leap seconds
    packet.push_back(7);
    EXPECT_EQ(decoded(xml, packet), "a=" + std::to_string(utc(2011, 9, 14, 1, 46, 25)) + " x=7");
    packet = big_endian(999'999'999, 4);
    packet.push_back(7);
    EXPECT_THAT(decoded(xml, packet), HasSubstr("needs a >= 2011-09-14T01:46:25Z (found 2011-09-14T01:46:24Z)"));
}

TEST(Times, ACommandHasItsTimesByTheSameEpoch)
{
    const auto argument = [](const std::string &name, const std::string &type) {
        return std::regex_replace(std::regex_replace(type, std::regex("Parameter"), "Argument"), std::regex("'t'"),
                                  "'" + name + "'");
    };
    std::string types, arguments, entries;
    for (const auto &[name, kind, reference, encoding, attributes] :
         std::vector<std::tuple<std::string, std::string, std::string, std::string, std::string>>{
             {"gps", "Absolute", "<Epoch>GPS</Epoch>", u32, ""},
             {"unix", "Absolute", "<Epoch>UNIX</Epoch>", u64, "units='picoSeconds' scale='1e6' offset='-5e12'"},
             {"cuc", "Absolute", "<Epoch>TAI</Epoch>", u64, "scale='2.3283064365386963e-10'"},
             {"real", "Absolute", "<Epoch>2000-01-01T12:00:00</Epoch>", "<FloatDataEncoding sizeInBits='64'/>", ""},
             {"text", "Absolute", "<Epoch>2020-01-01</Epoch>",
              "<StringDataEncoding><SizeInBits><Fixed><FixedValue>48</FixedValue></Fixed></SizeInBits>"
              "</StringDataEncoding>",
              "scale='0.5'"},
             {"wait", "Relative", "", u32, "scale='0.001'"},
             {"days", "Relative", "", "<IntegerDataEncoding/>", "units='days'"}}) {
        types += argument(name, time_type(kind + "TimeParameterType", reference, encoding, attributes));
        arguments += "<Argument name='" + name + "' argumentTypeRef='" + name + "'" +
                     (name == "days" ? " initialValue='P3DT12H'" : "") + "/>";
        entries += "<ArgumentRefEntry argumentRef='" + name + "'/>";
    }
    const Database db =
        read_xtce_text("<SpaceSystem name='S'><CommandMetaData><ArgumentTypeSet>" + types +
                           "</ArgumentTypeSet><MetaCommandSet><MetaCommand name='C'><ArgumentList>" + arguments +
                           "</ArgumentList><CommandContainer name='CC'><EntryList>" + entries +
                           "</EntryList></CommandContainer></MetaCommand></MetaCommandSet>"
                           "</CommandMetaData></SpaceSystem>",
                       "s.xml");
    const auto text = [](const std::string &words) {
        Given given;
        given.kind = Given::Kind::text;
        given.text = words;
        return given;
    };
    std::map<std::string, Given> given;
    for (const char *name : {"gps", "unix", "cuc", "real", "text"}) {
        given[name] = text("2024-05-06T07:08:09.25Z");
    }
    given["wait"] = text("1.5 s");
    const auto bytes = [&] { return encode(db, db.command("C"), given); };
    const auto all = [](const std::vector<Bytes> &parts) {
        Bytes joined;
        for (const Bytes &part : parts) {
            joined.insert(joined.end(), part.begin(), part.end());
        }
        return joined;
    };
    const std::int64_t s = utc(2024, 5, 6, 7, 8, 9) / second;
    const auto since = [&](const std::int64_t from) { return static_cast<std::uint64_t>(s - from / second); };
    given["gps"] = text("2024-05-06T07:08:09Z");
    const double years = double(since(utc(2000, 1, 1, 12))) + 5 + 0.25; // and five leap seconds
    given["text"] = text("2020-01-02T00:00:00");
    EXPECT_EQ(bytes(), all({big_endian(since(utc(1980, 1, 6)) + 18, 4),
                            big_endian(1'000'000 * s + 250'000 + 5'000'000, 8),
                            big_endian((since(utc(1958, 1, 1)) + 37) << 32 | 0x40000000, 8),
                            big_endian(std::bit_cast<std::uint64_t>(years), 8),
                            {'1', '7', '2', '8', '0', '0'},
                            big_endian(1500, 4),
                            {4}}));
}

TEST(Times, ANumberOfTheDatabaseIsInSecondsAndOneOfAUserInNanoseconds)
{
    std::string text =
        "<SpaceSystem name='S'><TelemetryMetaData><ParameterTypeSet>@TYPE</ParameterTypeSet><ParameterSet>"
        "<Parameter name='d' parameterTypeRef='t'/></ParameterSet><ContainerSet><SequenceContainer "
        "name='H'><EntryList><ParameterRefEntry parameterRef='d'/></EntryList></SequenceContainer>"
        "</ContainerSet></TelemetryMetaData><CommandMetaData><ArgumentTypeSet>@ARGUMENT</ArgumentTypeSet>"
        "<MetaCommandSet><MetaCommand name='C'><ArgumentList><Argument name='a' argumentTypeRef='t' "
        "initialValue='1.5'/></ArgumentList><CommandContainer name='CC'><EntryList><ArgumentRefEntry "
        "argumentRef='a'/></EntryList><BaseContainer containerRef='H'><RestrictionCriteria><Comparison "
        "parameterRef='d' value='5'/></RestrictionCriteria></BaseContainer></CommandContainer>"
        "</MetaCommand></MetaCommandSet></CommandMetaData></SpaceSystem>";
    const std::string type = time_type("RelativeTimeParameterType", "", u32, "scale='0.5'");
    text.replace(text.find("@TYPE"), 5, type);
    text.replace(text.find("@ARGUMENT"), 9, std::regex_replace(type, std::regex("Parameter"), "Argument"));
    const Database db = read_xtce_text(text, "s.xml");
    const auto refusal = [&](const Given &given) -> std::string {
        try {
            encode(db, db.command("C"), {{"a", given}});
        } catch (const Refusal &reason) {
            return reason.what();
        }
        return "";
    };
    EXPECT_EQ(encode(db, db.command("C"), {}), (Bytes{0, 0, 0, 10, 0, 0, 0, 3}));
    Given given;
    given.integer = 2 * second;
    EXPECT_EQ(encode(db, db.command("C"), {{"a", given}}), (Bytes{0, 0, 0, 10, 0, 0, 0, 4}));
    given.kind = Given::Kind::text;
    given.text = "2000000000";
    EXPECT_EQ(encode(db, db.command("C"), {{"a", given}}), (Bytes{0, 0, 0, 10, 0, 0, 0, 4}));
    for (const char *words : {"1.5", "0x10", "1e9"}) { // a unit is missing, or a whole number
        given.text = words;
        EXPECT_THAT(refusal(given), HasSubstr("a must be a duration")) << words;
    }
    given.kind = Given::Kind::real;
    given.real = 1.5;
    EXPECT_EQ(refusal(given), "a must be whole ns; found 1.5");
}

TEST(Times, ATimeThatIsTextMayBeADate)
{
    const std::string xml =
        time_type("AbsoluteTimeParameterType", "<Epoch>GPS</Epoch>",
                  "<StringDataEncoding><SizeInBits><Fixed><FixedValue>160</FixedValue></Fixed></SizeInBits>"
                  "</StringDataEncoding>");
    const std::string words = "2026-03-01T12:00:00Z";
    EXPECT_EQ(value(xml, Bytes(words.begin(), words.end())), "a=" + std::to_string(utc(2026, 3, 1, 12)));
    const std::string digits = "00000000001000000000", none = "2026-03-01T25:00:00Z";
    EXPECT_EQ(value(xml, Bytes(digits.begin(), digits.end())), "a=" + std::to_string(utc(2011, 9, 14, 1, 46, 25)));
    EXPECT_EQ(value(xml, Bytes(none.begin(), none.end())), "a=malformed");
}

TEST(Times, ATimeBeyondAllNumbersIsNone)
{
    const std::string far = time_type("AbsoluteTimeParameterType", "<Epoch>GPS</Epoch>", u64, "scale='9e9'");
    EXPECT_EQ(value(far, Bytes(8, 0xFF)), "a=none");
}

TEST(Times, ATypeThatCountsFromMembersOfOtherEpochsIsRefused)
{
    const auto aggregate = [](const std::string &name, const std::string &from) {
        return "<AggregateParameterType name='" + name + "'><MemberList><Member name='c' typeRef='" + from +
               "'/><Member name='m' typeRef='t'/></MemberList></AggregateParameterType>";
    };
    const auto named = [](const std::string &name, const std::string &epoch) {
        return std::regex_replace(time_type("AbsoluteTimeParameterType", "<Epoch>" + epoch + "</Epoch>", u32),
                                  std::regex("'t'"), "'" + name + "'");
    };
    const auto read = [&](const std::string &second_epoch) {
        return read_xtce_text(file(named("gps", "GPS") + named("other", second_epoch) +
                                       time_type("AbsoluteTimeParameterType", "<OffsetFrom parameterRef='c'/>", u32) +
                                       aggregate("first", "gps") + aggregate("second", "other"),
                                   "a:first b:second", container("P", "a b")),
                              "s.xml");
    };
    EXPECT_NO_THROW(read("GPS"));
    EXPECT_THAT([&] { read("UNIX"); },
                ThrowsMessage<Refusal>(HasSubstr("count from c, which has another epoch in second")));
}

TEST(Times, AnEpochThatIsNoneIsRefused)
{
    try {
        read_xtce_text(
            file(time_type("AbsoluteTimeParameterType", "<Epoch>launch</Epoch>", u32), "a:t", container("P", "a")),
            "s.xml");
        FAIL();
    } catch (const Refusal &refusal) {
        EXPECT_THAT(refusal.what(), HasSubstr("s.xml:"));
        EXPECT_THAT(refusal.what(), HasSubstr("an epoch is TAI, GPS, J2000, UNIX, POSIX or a date"));
        EXPECT_THAT(refusal.what(), HasSubstr("found 'launch'"));
    }
}

} // namespace times_test

} // namespace fledge::ground
