// SPDX-License-Identifier: Apache-2.0
// Files of indices: values of CelesTrak's file of 2020-02-22, GFZ's and those of SET's release of 2018-10-15, as these
// publish them; means and lags counted anew; and what is refused.
#include "world/environment/air/space_weather.h"

#include "world/environment/testing/files.h"

#include <cmath>
#include <cstdio>
#include <memory>

namespace fledge::world {
namespace space_weather_test {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::TemporaryFile;

const TimeSystem times;

SpaceWeather read(const std::vector<std::pair<std::string, std::string>> &files)
{
    std::vector<std::unique_ptr<TemporaryFile>> kept;
    std::vector<std::string> paths;
    for (const auto &[name, text] : files) {
        kept.push_back(std::make_unique<TemporaryFile>(name, text));
        paths.push_back(kept.back()->path());
    }
    return SpaceWeather(paths, times);
}

std::string refused(const std::string &text)
{
    return error_of([&] { read({{"indices", text}}); });
}

// --- CelesTrak -------------------------------------------------------------------------------------

const std::string october_1957[] = {"1957 10 07 1700 25 10 20 17 17 17  7 20 13 120   4   7   6   6   6   3   7   5   "
                                    "6 0.2 1 234 253.0 0 268.4 234.2 254.3 269.9 234.6\n",
                                    "1957 10 08 1700 26 17  0 10  7  3  3  3  3  47   6   0   4   3   2   2   2   2   "
                                    "3 0.0 0 244 261.0 0 268.2 234.7 262.6 269.8 235.2\n",
                                    "1957 10 09 1700 27  3 17 23 17 23 23 20 23 150   2   6   9   6   9   9   7   9   "
                                    "7 0.4 2 267 275.0 0 268.3 235.2 276.6 270.0 235.7\n",
                                    "1957 10 10 1701  1 30 40 40 30 23 30 37 27 257  15  27  27  15   9  15  22  12  "
                                    "18 1.0 5 264 275.0 0 268.2 235.6 276.6 269.8 236.1\n",
                                    "1957 10 11 1701  2 33 43 33 43 37 30 23 23 267  18  32  18  32  22  15   9   9  "
                                    "19 1.0 5 232 278.0 0 267.8 236.1 279.7 269.5 236.7\n"};

std::string celestrak(const std::string &days, const std::string &months = "")
{
    return "DATATYPE CssiSpaceWeather\nVERSION 1.2\n# a remark\nNUM_OBSERVED_POINTS 5\nBEGIN OBSERVED\n" + days +
           "END OBSERVED\n\nNUM_MONTHLY_PREDICTED_POINTS 2\nBEGIN MONTHLY_PREDICTED\n" + months +
           "END MONTHLY_PREDICTED\n";
}

std::string october(const std::string &instead = "", std::size_t of = 9)
{
    std::string days;
    for (std::size_t i = 0; i < 5; i++) {
        days += i == of ? instead : october_1957[i];
    }
    return celestrak(days);
}

constexpr double october_10 = 36'121.0; // MJD

TEST(SpaceWeather, reads_celestraks_columns)
{
    const SpaceWeather weather = read({{"SW-All.txt", october()}});
    const SolarActivity a = weather.at(october_10 + (3.0 + 14.0 / 60.0) / 24.0, AirLaw::nrlmsise00);
    EXPECT_EQ(a.F107, 276.6);
    EXPECT_EQ(a.F107_average, 269.8);
    const double ap[] = {18, 27, 15, 9, 7, 5.625, 3.625}; // the test values of Orekit at this instant
    for (std::size_t i = 0; i < 7; i++) {
        EXPECT_DOUBLE_EQ(a.ap[i], ap[i]) << i;
    }
    // DTM2000: from 0 to 3 h, and back to 3 h of the day before: 30, 23, 20, 23, 23, 17, 23, 17 of tenths, in thirds.
    EXPECT_DOUBLE_EQ(a.kp_before, 3.0);
    EXPECT_DOUBLE_EQ(a.kp_average, (9 + 7 + 6 + 7 + 7 + 5 + 7 + 5) / 24.0);
    // MET: at 20:32 of the day before, and exactly at the border of 3 h.
    EXPECT_EQ(a.ap_before, 7.0);
    EXPECT_EQ(weather.at(october_10 + 12.7001 / 24.0, AirLaw::met).ap_before, 27.0);
    EXPECT_EQ(weather.at(october_10 + 12.6999 / 24.0, AirLaw::met).ap_before, 27.0);
    EXPECT_EQ(weather.at(october_10 + 15.71 / 24.0, AirLaw::met).ap_before, 15.0);
    EXPECT_EQ(weather.at(october_10 + 15.69 / 24.0, AirLaw::met).ap_before, 27.0);
}

TEST(SpaceWeather, reads_the_storm_of_october_2003)
{
    const SpaceWeather weather =
        read({{"SW-All.txt", celestrak("2003 10 27 2323 25 37 33 33 20 20 23 13 10 190  22  18  18   7   7   9   5   4 "
                                       " 11 0.6 3 133 254.0 0 138.9 123.4 257.2 140.7 122.3\n"
                                       "2003 10 28 2323 26 30 47 37 47 27 40 33 40 300  15  39  22  39  12  27  18  27 "
                                       " 25 1.2 6 165 270.9 0 138.7 125.0 274.4 140.5 124.1\n"
                                       "2003 10 29 2323 27 47 40 90 80 77 77 87 87 583  39  27 400 207 179 179 300 300 "
                                       "204 2.1 9 167 275.4 0 138.5 126.8 279.1 140.3 125.9\n")}});
    const SolarActivity a = weather.at(times.epoch("2003-10-29T23:00:00"), AirLaw::nrlmsise00);
    const double ap[] = {204, 300, 300, 179, 179, 94.625, 17.5}; // five test values of Orekit; two counted by hand
    for (std::size_t i = 0; i < 7; i++) {
        EXPECT_DOUBLE_EQ(a.ap[i], ap[i]) << i;
    }
    EXPECT_EQ(a.F107, 274.4);
    EXPECT_EQ(a.F107_average, 140.3);
    EXPECT_NEAR(weather.at(times.epoch("2003-10-29T11:59:00"), AirLaw::dtm2000).kp_before, 9.0, 1e-12);
    EXPECT_NEAR(weather.at(times.epoch("2003-10-29T13:00:00"), AirLaw::dtm2000).kp_before, 8.0, 1e-12);
}

TEST(SpaceWeather, reads_celestraks_table)
{
    const std::string head =
        "DATE,BSRN,ND,KP1,KP2,KP3,KP4,KP5,KP6,KP7,KP8,KP_SUM,AP1,AP2,AP3,AP4,AP5,AP6,AP7,AP8,AP_AVG,CP,C9,"
        "ISN,F10.7_OBS,F10.7_ADJ,F10.7_DATA_TYPE,F10.7_OBS_CENTER81,F10.7_OBS_LAST81,F10.7_ADJ_CENTER81,"
        "F10.7_ADJ_LAST81\n";
    const std::string first =
        "2000-01-01,2272,7,53,47,40,33,43,30,43,37,327,56,39,27,18,32,15,32,22,30,1.3,6,71,129.9,125.6,OBS,"
        "166.2,179.0,161.1,175.0\n";
    const std::string second =
        "2000-01-02,2272,8,27,30,30,20,10,20,20,10,167,12,15,15,7,4,7,7,4,9,0.6,3,80,134,129.6,INT,166,178.9,"
        "161.0,174.9\n";
    const std::string month = "2000-02-01,,,,,,,,,,,,,,,,,,,,8,,,,150.0,146.0,PRM,160.0,,,\n";
    const SpaceWeather weather = read({{"SW-All.csv", head + first + second + month}});
    const SolarActivity a = weather.at(51'545.95, AirLaw::dtm2000); // 2000-01-02
    EXPECT_EQ(a.F107, 129.9);
    EXPECT_EQ(a.F107_average, 166.0);
    EXPECT_EQ(a.ap[0], 9.0);
    EXPECT_DOUBLE_EQ(a.kp_average, (8 + 9 + 9 + 6 + 3 + 6 + 6 + 11) / 24.0);
    // The month's 15 days of 30 on: half of the way.
    const SolarActivity b = weather.at(51'545.0 + 15.0, AirLaw::dtm2000);
    EXPECT_NEAR(b.F107, 134.0 + (150.0 - 134.0) * 14.0 / 30.0, 1e-12);
    EXPECT_NEAR(b.F107_average, 163.0, 1e-12);
    EXPECT_NEAR(b.ap[0], 8.5, 1e-12);
    EXPECT_THAT(refused(head + first + "2000-01-02,1,2\n"),
                AllOf(HasSubstr(":3: "), HasSubstr("31 columns"), HasSubstr("found 3")));
    EXPECT_THAT(refused(head + second + first),
                AllOf(HasSubstr(":3: "), HasSubstr("expected 2000-01-03"), HasSubstr("found 2000-01-01")));
    EXPECT_THAT(refused("DATE,KP1\n2000-01-01,3\n"), AllOf(HasSubstr(":1: "), HasSubstr("no column AP1")));
    EXPECT_THAT(refused(head + month), AllOf(HasSubstr(":2: "), HasSubstr("month")));
}

TEST(SpaceWeather, is_linear_between_the_months)
{
    char month[160]; // with nothing in the columns of Kp and of each ap
    std::snprintf(month, sizeof month, "%-78s%4d%10s%6.1f%14s%6.1f%6.1f%6s\n", "1957 11 01", 11, "", 278.0, "", 279.7,
                  275.5, "");
    const SpaceWeather weather = read({{"SW-All.txt", october().substr(0, october().find("END MONTHLY")) + month}});
    const SolarActivity a = weather.at(october_10 + 8.0, AirLaw::nrlmsise00); // a third of the 21 days
    EXPECT_NEAR(a.F107_average, 269.5 + 6.0 / 3.0, 1e-12);
    EXPECT_NEAR(a.ap[0], 19.0 - 8.0 / 3.0, 1e-12);
    EXPECT_NEAR(weather.at(october_10 + 22.0, AirLaw::nrlmsise00).F107_average, 275.5, 1e-12);
}

TEST(SpaceWeather, says_where_a_file_is_damaged)
{
    const auto swapped = [](std::size_t day, const std::string &from, const std::string &to) {
        std::string line = october_1957[day];
        line.replace(line.find(from), from.size(), to);
        return refused(october(line, day));
    };
    EXPECT_THAT(swapped(2, "276.6", " 76,6"), AllOf(HasSubstr(":8: "), HasSubstr("F10.7"), HasSubstr("\"76,6\"")));
    EXPECT_THAT(swapped(2, "276.6", "2766."), AllOf(HasSubstr(":8: "), HasSubstr("2766"), HasSubstr("30 to 1000")));
    EXPECT_THAT(swapped(1, " 17  0 10", " 97  0 10"),
                AllOf(HasSubstr(":7: "), HasSubstr("Kp is 97"), HasSubstr("0 to 90")));
    EXPECT_THAT(swapped(1, "   6   0   4", " 606   0   4"), AllOf(HasSubstr(":7: "), HasSubstr("ap is 606")));
    EXPECT_THAT(swapped(3, " 10 10 ", " 10 12 "),
                AllOf(HasSubstr(":9: "), HasSubstr("expected 1957-10-10"), HasSubstr("found 1957-10-12")));
    EXPECT_THAT(swapped(3, " 10 10 ", " 10 32 "), AllOf(HasSubstr(":9: "), HasSubstr("date")));
    EXPECT_THAT(refused(october(october_1957[0], 1)), HasSubstr("expected 1957-10-08")); // twice
    EXPECT_THAT(refused(october(october_1957[1].substr(0, 60) + "\n", 1)),
                AllOf(HasSubstr(":7: "), HasSubstr("found 60")));
    EXPECT_THAT(refused(celestrak("")), HasSubstr("has no days"));
    EXPECT_THAT(refused("hello\n"), AllOf(HasSubstr("SW-All.csv"), HasSubstr("SOLFSMY")));
    EXPECT_THAT(refused(""), HasSubstr("SW-All.csv"));
    EXPECT_THAT(error_of([] { SpaceWeather({}, times); }), HasSubstr("SW-All.csv"));
    EXPECT_THAT(error_of([] { SpaceWeather({"/nowhere/SW-All.csv"}, times); }),
                HasSubstr("/nowhere/SW-All.csv: cannot be opened"));
}

// --- GFZ and NOAA ----------------------------------------------------------------------------------

/// Days of GFZ's form from 2024-01-01 on, F10.7 by the number of the day.
std::string gfz(int days, int gap = -1)
{
    std::string text = "# PURPOSE: a test\n#YYY MM DD  days ...\n";
    const int lengths[] = {31, 29, 31, 30, 31, 30, 31, 31, 30};
    int month = 1, day = 1;
    for (int i = 0; i < days; i++) {
        char line[240];
        std::snprintf(line, sizeof line,
                      "2024 %02d %02d %5d %7.1f 2599  1  2.667  2.667  2.333  2.000  3.667  7.667  8.667  8.667   12   "
                      "12    9    7 "
                      "  22  179  300  300   105 172    %5.1f    227.9 2\n",
                      month, day, 33'603 + i, 33'603.5 + i, i == gap ? -1.0 : 100.0 + i);
        text += line;
        if (++day > lengths[month - 1]) {
            day = 1;
            month++;
        }
    }
    return text;
}

constexpr double january_2024 = 60'310.0; // MJD of the first

TEST(SpaceWeather, takes_means_of_gfzs_days)
{
    const SpaceWeather weather = read({{"Kp_ap_Ap_SN_F107.txt", gfz(200, 60)}});
    EXPECT_EQ(weather.at(january_2024 + 100.5, AirLaw::nrlmsise00).F107, 199.0);
    // Days 60 to 140 without day 60: a mean of 61 to 140.
    EXPECT_NEAR(weather.at(january_2024 + 100.5, AirLaw::nrlmsise00).F107_average, 200.5, 1e-10);
    EXPECT_NEAR(weather.at(january_2024 + 110.5, AirLaw::dtm2000).F107_average, 210.0, 1e-10);
    EXPECT_NEAR(weather.at(january_2024 + 105.5, AirLaw::met).F107_average, (162.0 * 205.0 - 160.0) / 161.0, 1e-10);
    // At the ends half of the days are enough, one less is not.
    EXPECT_NEAR(weather.at(january_2024 + 199.5, AirLaw::dtm2000).F107_average, 279.0, 1e-10);
    EXPECT_TRUE(std::isnan(weather.at(january_2024 + 200.5, AirLaw::dtm2000).F107_average));
    EXPECT_TRUE(std::isnan(weather.at(january_2024 + 61.5, AirLaw::dtm2000).F107)); // of the day of the gap
    EXPECT_EQ(weather.at(january_2024 + 50.45, AirLaw::dtm2000).kp_before, 2.333);
    EXPECT_EQ(weather.at(january_2024 + 50.45, AirLaw::nrlmsise00).ap[1], 7.0);
}

TEST(SpaceWeather, refuses_damaged_days_of_gfz)
{
    std::string text = gfz(3);
    text.replace(text.find(" 33604 "), 7, " 33605 ");
    EXPECT_THAT(refused(text), AllOf(HasSubstr(":4: "), HasSubstr("33605 days after 1932-01-01")));
    text = gfz(3);
    EXPECT_THAT(refused(text.substr(0, text.size() - 20)), AllOf(HasSubstr(":5: "), HasSubstr("28 numbers")));
}

const std::string noaa =
    ":Product: 45 Day AP and F10.7cm Forecast\n:Issued: 2024 Jul 18 2119 UTC\n#\n45-DAY AP FORECAST\n"
    "19Jul24 012 20Jul24 008\n21Jul24 048 22Jul24 005\n45-DAY F10.7 CM FLUX FORECAST\n"
    "19Jul24 130 20Jul24 125\n21Jul24 125 22Jul24 122\nFORECASTER: AUTOMATED\n99999\n";

TEST(SpaceWeather, goes_on_with_a_forecast)
{
    const SpaceWeather weather = read({{"gfz", gfz(200)}, {"noaa", noaa}});    // to 2024-07-18
    const SolarActivity a = weather.at(january_2024 + 203.9, AirLaw::dtm2000); // 2024-07-22
    EXPECT_EQ(a.F107, 125.0);
    EXPECT_EQ(a.ap[0], 5.0);
    EXPECT_NEAR(a.kp_average, (7.0 * 4.0 / 3.0 + 5.0) / 8.0, 1e-12);
    EXPECT_TRUE(weather.covers(times.epoch("2024-07-17"), times.epoch("2024-07-22T20:00:00"), AirLaw::nrlmsise00));
    std::string later = noaa;
    later.replace(later.find("21Jul24"), 7, "23Jul24");
    EXPECT_THAT(refused(later),
                AllOf(HasSubstr(":6: "), HasSubstr("expected 2024-07-21"), HasSubstr("found 2024-07-23")));
    later.replace(later.find("23Jul24"), 7, "21Jly24");
    EXPECT_THAT(refused(later), AllOf(HasSubstr(":6: "), HasSubstr("\"21Jly24\"")));
}

// Of September 2026, as SWPC published them; the last day was not over.
const std::string dsd = ":Product: Daily Solar Data            DSD.txt\n:Issued: 0825 UT 22 Sep 2026\n#\n"
                        "2026 09 19   97     11       10      1    -999      *   1  0  0  0  0  0  0\n"
                        "2026 09 20  101     54       90      3    -999      *   2  0  0  4  1  0  0\n"
                        "2026 09 21  104     85      140      3    -999   B6.8   2  0  0  1  0  0  0\n";
const std::string dgd = ":Product: Daily Geomagnetic Data          DGD.txt\n:Issued: 1230 UT 22 Sep 2026\n#\n"
                        "2026 09 20     6  2 3 2 1 2 1 1 0     4  1 3 3 0 0 0 0 0     6   2.33  3.00  2.00  0.67  "
                        "1.00  0.33  0.33  1.00\n"
                        "2026 09 21     2  1 1 0 1 2 1 0 0     0  1 0 0 0 0 0 0 0     3   1.67  1.00  0.33  0.67  "
                        "0.67  0.33  0.00  1.33\n"
                        "2026 09 22    -1  1 0-1-1-1-1-1-1    -1  1 0-1-1-1-1-1-1     7   2.00  0.67 -1.00 -1.00 "
                        "-1.00 -1.00 -1.00 -1.00\n";
constexpr double september_20 = 61'303.0; // MJD

/// Days of SWPC's DSD from 2018-07-05 on, with F10.7 of 70 and more by the number of the day.
std::string quarter(int days)
{
    std::string text = ":Product: Daily Solar Data     quar_DSD.txt\n";
    const int begin[] = {5, 1, 1, 1}, end[] = {31, 31, 30, 31};
    int i = 0;
    for (int m = 0; m < 4; m++) {
        for (int day = begin[m]; day <= end[m] && i < days; day++) {
            char line[120];
            std::snprintf(line, sizeof line,
                          "2018 %02d %02d  %3d     11       10      1    -999   A6.8   0  0  0  0  0"
                          "  0  0\n",
                          7 + m, day, 70 + i++);
            text += line;
        }
    }
    return text;
}

TEST(SpaceWeather, reads_swpcs_days)
{
    const SpaceWeather weather = read({{"DSD.txt", dsd}, {"DGD.txt", dgd}});
    const SolarActivity a = weather.at(september_20 + 1.99, AirLaw::nrlmsise00);
    EXPECT_EQ(a.F107, 101.0);
    EXPECT_EQ(a.ap[0], 3.0);
    EXPECT_EQ(a.ap[1], 5.0); // 1.33 is one and a third
    EXPECT_EQ(a.ap[2], 0.0);
    EXPECT_EQ(a.ap[3], 2.0);
    EXPECT_EQ(weather.at(september_20 + 0.2, AirLaw::dtm2000).kp_before, 7.0 / 3.0);
    // The published A is the mean of the day's ap, rounded.
    for (const double day : {0.0, 1.0}) {
        double sum = 0.0;
        for (int k = 0; k < 8; k++) {
            sum += weather.at(september_20 + day + (k + 0.5) / 8.0, AirLaw::nrlmsise00).ap[1];
        }
        EXPECT_EQ(std::round(sum / 8.0), weather.at(september_20 + day + 0.5, AirLaw::nrlmsise00).ap[0]);
    }
    // Of a day that is not over: what is there, and no A.
    EXPECT_EQ(weather.at(september_20 + 2.2, AirLaw::nrlmsise00).ap[1], 3.0);
    EXPECT_TRUE(std::isnan(weather.at(september_20 + 2.3, AirLaw::nrlmsise00).ap[1]));
    EXPECT_TRUE(std::isnan(weather.at(september_20 + 2.2, AirLaw::nrlmsise00).ap[0]));
}

TEST(SpaceWeather, takes_means_of_swpcs_quarters)
{
    // K in whole numbers, as until 2021: as published, 7 to 9 October 2018, with F10.7 from 5 July on.
    const SpaceWeather weather =
        read({{"DGD.txt", ":Product: Daily Geomagnetic Data     quar_DGD.txt\n"
                          "2018 10 07    13  0 0 2 3 3 4 4 3    44  0 0 2 6 7 6 4 3    24  0 1 1 3 4 5 5 5\n"
                          "2018 10 08    16  4 4 3 3 3 3 1 2    53  3 5 6 6 7 5 2 1    21  4 4 4 3 4 3 2 2\n"
                          "2018 10 09    14  2 3 3 3 3 3 3 3    39  2 3 5 6 6 5 3 3    17  3 3 3 4 3 4 3 3\n"},
              {"DSD.txt", quarter(97)}}); // to 9 October
    const SolarActivity a = weather.at(times.epoch("2018-10-09T12:00:00"), AirLaw::dtm2000);
    EXPECT_EQ(a.F107, 70.0 + 95.0);
    EXPECT_NEAR(a.F107_average, 70.0 + 76.0, 1e-10); // of 30 August to 9 October
    EXPECT_EQ(a.ap[0], 17.0);
    EXPECT_EQ(a.kp_before, 4.0);
    EXPECT_TRUE(weather.covers(times.epoch("2018-10-08"), times.epoch("2018-10-09T23:59:00"), AirLaw::dtm2000));
    EXPECT_THAT(error_of([&] {
                    weather.require(times.epoch("2018-10-09"), times.epoch("2018-10-10T01:00:00"), AirLaw::dtm2000);
                }),
                AllOf(HasSubstr("mean F10.7 of 81 days (41 of them) at 2018-10-10T"), HasSubstr("to 2018-10-09")));
    EXPECT_THAT(error_of([&] {
                    read({{"DSD.txt", quarter(97)}})
                        .require(times.epoch("2018-10-08"), times.epoch("2018-10-09"), AirLaw::dtm2000);
                }),
                HasSubstr("Kp of the 24 h before"));
}

TEST(SpaceWeather, refuses_damaged_days_of_swpc)
{
    const auto swapped = [](std::string text, const std::string &from, const std::string &to) {
        text.replace(text.find(from), from.size(), to);
        return refused(text);
    };
    EXPECT_THAT(refused(dsd.substr(0, dsd.size() - 10)),
                AllOf(HasSubstr(":6: "), HasSubstr("DSD.txt: a date and 13"), HasSubstr("found 13 words")));
    EXPECT_THAT(swapped(dsd, "2026 09 20", "2026 09 22"),
                AllOf(HasSubstr(":5: "), HasSubstr("expected 2026-09-20"), HasSubstr("found 2026-09-22")));
    EXPECT_THAT(swapped(dsd, " 101 ", " 1o1 "), AllOf(HasSubstr(":5: "), HasSubstr("\"1o1\"")));
    EXPECT_EQ(swapped(dsd, " 101 ", "  -1 "), "");
    EXPECT_THAT(refused(dgd.substr(0, dgd.size() - 8)), AllOf(HasSubstr(":6: "), HasSubstr("found 29 words")));
    EXPECT_THAT(swapped(dgd, "  3.00", " 13.00"), AllOf(HasSubstr(":4: "), HasSubstr("K is 13")));
    EXPECT_THAT(refused(":Product: Daily Solar Data\n#\n"), HasSubstr("has no days"));
}

TEST(SpaceWeather, knows_kp_by_ap)
{
    EXPECT_EQ(kp_of_ap(0.0), 0.0);
    EXPECT_NEAR(kp_of_ap(15.0), 3.0, 1e-15);
    EXPECT_NEAR(kp_of_ap(27.0), 4.0, 1e-15);
    EXPECT_NEAR(kp_of_ap(48.0), 5.0, 1e-15);
    EXPECT_NEAR(kp_of_ap(80.0), 6.0, 1e-15);
    EXPECT_NEAR(kp_of_ap(132.0), 7.0, 1e-15);
    EXPECT_NEAR(kp_of_ap(207.0), 8.0, 1e-15);
    EXPECT_NEAR(kp_of_ap(350.0), 9.0 - 1.0 / 6.0, 1e-15);
    EXPECT_EQ(kp_of_ap(400.0), 9.0);
    EXPECT_TRUE(std::isnan(kp_of_ap(std::nan(""))));
}

// --- JB2008 ----------------------------------------------------------------------------------------

const std::string solfsmy = "# YYYY DDD   JulianDay  F10   F81c  S10   S81c  M10   M81c  Y10   Y81c  Ssrc\n"
                            "  2003 360   2453000.0 137.2 122.4 135.5 117.4 156.4 121.7 143.9 129.8  1B11\n"
                            "  2003 361   2453001.0 126.6 122.4 130.7 117.3 150.1 121.7 139.9 129.5  1B11\n"
                            "  2003 362   2453002.0 119.0 122.2 126.1 117.3 139.1 121.6 136.6 129.2  1B11\n"
                            "  2003 363   2453003.0 114.5 121.8 120.4 117.1 127.3 121.5 133.0 128.9  1B11\n"
                            "  2003 364   2453004.0 107.7 121.3 115.0 117.0 117.9 121.2 131.9 128.6  1B11\n"
                            "  2003 365   2453005.0 105.6 120.6 111.0 116.8 108.5 120.9 132.8 128.2  1B11\n";
const std::string dtc =
    "DTC 2003 365   38  85  85  85  60  60  60  85  85  85  50  50  50  38  38  38  60  60  60  85  85  85 135 135\n"
    "DTC 2004   1  135 124 124 124 115 115 115  94  94  94 105 105 105 115 115 115 105 105 105 135 135 135 105 105\n";

TEST(SpaceWeather, has_jb2008s_lags)
{
    const SpaceWeather weather = read({{"SOLFSMY.TXT", solfsmy}, {"DTCFILE.TXT", dtc}});
    const SolarActivity a = weather.at(times.epoch("2003-12-31T01:30:00"), AirLaw::jb2008); // day 365
    EXPECT_EQ(a.F10_jb, 107.7);
    EXPECT_EQ(a.F107_average, 121.3);
    EXPECT_EQ(a.S10, 115.0);
    EXPECT_EQ(a.S10_average, 117.0);
    EXPECT_EQ(a.M10, 127.3);
    EXPECT_EQ(a.M10_average, 121.5);
    EXPECT_EQ(a.Y10, 143.9);
    EXPECT_EQ(a.Y10_average, 129.8);
    EXPECT_EQ(a.storm_temperature, 85.0);
    EXPECT_NEAR(weather.at(times.epoch("2003-12-31T00:15:00"), AirLaw::jb2008).storm_temperature, 38.0 + 47.0 / 4.0,
                1e-6);
    EXPECT_NEAR(weather.at(times.epoch("2004-01-01T00:30:00"), AirLaw::jb2008).storm_temperature, 129.5, 1e-6);
    EXPECT_TRUE(weather.covers(times.epoch("2003-12-31"), times.epoch("2004-01-01T20:00:00"), AirLaw::jb2008));
    const auto from = [&](const char *date) {
        return error_of(
            [&] { weather.require(times.epoch(date), times.epoch("2004-01-01T20:00:00"), AirLaw::jb2008); });
    };
    EXPECT_EQ(from("2003-12-31"), "");
    EXPECT_THAT(from("2003-12-30T22:00:00"), AllOf(HasSubstr("DTCFILE.TXT"), HasSubstr("2003-12-30T22:00:00Z")));
    const SpaceWeather alone = read({{"SOLFSMY.TXT", solfsmy}});
    EXPECT_FALSE(alone.covers(times.epoch("2003-12-31"), times.epoch("2003-12-31"), AirLaw::jb2008));
    EXPECT_FALSE(weather.covers(times.epoch("2003-12-31"), times.epoch("2003-12-31"), AirLaw::met));
}

TEST(SpaceWeather, refuses_damaged_files_of_jb2008)
{
    const auto swapped = [](std::string text, const std::string &from, const std::string &to) {
        text.replace(text.find(from), from.size(), to);
        return refused(text);
    };
    EXPECT_THAT(swapped(solfsmy, "2453002.0", "2453012.0"),
                AllOf(HasSubstr(":4: "), HasSubstr("2453002"), HasSubstr("found 2453012.0")));
    EXPECT_THAT(swapped(solfsmy, "2003 361   2453001.0", "2003 366   2453006.0"),
                AllOf(HasSubstr(":3: "), HasSubstr("found 366")));
    EXPECT_THAT(swapped(solfsmy, "126.1", "12b.1"), AllOf(HasSubstr(":4: "), HasSubstr("S10"), HasSubstr("\"12b.1\"")));
    EXPECT_THAT(swapped(solfsmy, " 139.1", ""), AllOf(HasSubstr(":4: "), HasSubstr("found 11")));
    EXPECT_THAT(swapped(dtc, "2004   1", "2004   2"), AllOf(HasSubstr(":2: "), HasSubstr("expected 2004-01-01")));
    EXPECT_THAT(swapped(dtc, " 135 124", " 9999 124"), AllOf(HasSubstr(":2: "), HasSubstr("9999")));
}

// --- what a run needs ------------------------------------------------------------------------------

TEST(SpaceWeather, says_what_a_law_misses_and_what_to_do)
{
    const SpaceWeather weather = read({{"gfz", gfz(200)}});
    const auto missing = [&](const char *from, const char *to, AirLaw law) {
        return error_of([&] { weather.require(times.epoch(from), times.epoch(to), law); });
    };
    // ap of 57 h before: from the third hour on of the third day.
    EXPECT_EQ(missing("2024-01-03T09:00:00", "2024-07-18T23:59:00", AirLaw::nrlmsise00), "");
    EXPECT_THAT(missing("2024-01-03T08:59:00", "2024-01-04", AirLaw::nrlmsise00),
                AllOf(HasSubstr("gfz: NRLMSISE-00 needs the ap"), HasSubstr("57 h"), HasSubstr("2024-01-03T08:59:00Z"),
                      HasSubstr("from 2024-01-01 to 2024-07-18"), HasSubstr("give a file")));
    EXPECT_EQ(missing("2024-01-02T00:00:00", "2024-01-04", AirLaw::dtm2000), "");
    EXPECT_THAT(missing("2024-01-01T23:00:00", "2024-01-04", AirLaw::dtm2000),
                HasSubstr("DTM2000 needs the F10.7 of the day before"));
    EXPECT_THAT(missing("2024-07-18", "2024-08-04", AirLaw::dtm2000), HasSubstr("2024-07-19T00:00:00Z"));
    EXPECT_THAT(missing("2024-07-18", "2024-07-19T08:00:00", AirLaw::met), HasSubstr("mean F10.7"));
    EXPECT_THAT(missing("2024-07-18", "2024-07-19", AirLaw::jb2008), HasSubstr("DTCFILE.TXT"));
}

TEST(SpaceWeather, counts_a_leap_second_to_its_day)
{
    const SpaceWeather weather =
        read({{"SOLFSMY.TXT", "  2016 365   2457753.0 72.0 74.0 70.0 71.0 72.0 73.0 74.0 75.0  1B11\n"
                              "  2016 366   2457754.0 73.0 74.0 70.0 71.0 72.0 73.0 74.0 75.0  1B11\n"}});
    EXPECT_EQ(weather.at(times.epoch("2016-12-31T23:59:60.5"), AirLaw::jb2008).F10_jb, 72.0);
    EXPECT_EQ(weather.at(times.epoch("2017-01-01T00:00:00"), AirLaw::jb2008).F10_jb, 73.0);
}

TEST(SpaceWeather, has_nothing_far_away)
{
    const SpaceWeather weather = read({{"gfz", gfz(60)}});
    for (const double mjd : {-1e9, 0.0, 1e300, std::nan("")}) {
        EXPECT_TRUE(std::isnan(weather.at(mjd, AirLaw::nrlmsise00).F107)) << mjd;
    }
}

} // namespace space_weather_test
} // namespace fledge::world
