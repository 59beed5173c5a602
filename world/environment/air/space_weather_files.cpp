// SPDX-License-Identifier: Apache-2.0
#include "world/environment/air/space_weather_files.h"

#include "sim/text.h"
#include "world/environment/text_input.h"

#include <algorithm>
#include <cmath>

namespace fledge::world {

namespace {

using Day = SpaceWeather::Day;
using Jb2008Day = SpaceWeather::Jb2008Day;

/// A line of a file, and what may stand in it.
struct IndexLine {
    const std::string &path;
    std::size_t number = 0;
    std::string_view text;

    [[noreturn]] void refuse(const std::string &what) const { refuse_line(path, number, what); }

    int integer(std::string_view word, const char *what) const
    {
        const auto value = parse_integer(word);
        if (!value) {
            refuse("expected " + std::string(what) + ", a whole number; found \"" + std::string(word) + "\"");
        }
        return *value;
    }

    /// Unknown where there is nothing, or the number that says so.
    double within(std::string_view word, const char *what, double low, double high, double nothing) const
    {
        if (word.empty()) {
            return SpaceWeather::unknown;
        }
        const auto value = parse_number(word);
        if (!value) {
            refuse("expected " + std::string(what) + "; found \"" + std::string(word) + "\"");
        }
        if (*value == nothing) {
            return SpaceWeather::unknown;
        }
        if (!(*value >= low && *value <= high)) {
            refuse(std::string(what) + " is " + sim::format_number(*value) + "; expected " + sim::format_number(low) +
                   " to " + sim::format_number(high));
        }
        return *value;
    }

    double flux(std::string_view word, const char *what, double nothing = 0.0) const
    {
        return within(word, what, 30.0, 1000.0, nothing);
    }
    double ap(std::string_view word) const { return within(word, "ap", 0.0, 400.0, -1.0); }

    int date(int year, int month, int day) const
    {
        const auto mjd = mjd_of(year, month, day);
        if (!mjd || year < 1900) {
            refuse("expected a date; found " + std::string(text.substr(0, 12)));
        }
        return *mjd;
    }

    int day_of_year(std::string_view year, std::string_view day) const
    {
        const int y = integer(year, "a year"), first = date(y, 1, 1), count = integer(day, "a day of the year");
        if (count < 1 || first + count > date(y + 1, 1, 1)) {
            refuse("expected a day of the year " + std::to_string(y) + "; found " + std::to_string(count));
        }
        return first + count - 1;
    }

    /// Throws unless the day is the one after the last.
    template <class D> void follows(int mjd, const SpaceWeather::Series<D> &series) const
    {
        if (!series.days.empty() && mjd != series.end()) {
            refuse("expected " + date_text(series.end()) + ", the day after the one before; found " + date_text(mjd));
        }
    }
};

/// Without the blanks around it; empty beyond the end.
std::string_view column(std::string_view text, std::size_t begin, std::size_t width)
{
    text = begin < text.size() ? text.substr(begin, width) : std::string_view{};
    const std::size_t first = text.find_first_not_of(' ');
    return first == text.npos ? std::string_view{} : text.substr(first, text.find_last_not_of(' ') + 1 - first);
}

/// CelesTrak writes ten times Kp without the rest of its thirds.
double in_thirds(double tenfold)
{
    return std::round(0.3 * tenfold) / 3.0;
}

/// A day of a month's prediction: those since the last day are between the two.
void add_month(const IndexLine &line, int mjd, const Day &day, SpaceWeather::Series<Day> &series)
{
    const int from = series.end() - 1, gap = mjd - from;
    if (series.days.empty() || gap < 1 || gap > 62) {
        line.refuse("expected the next month after " + (series.days.empty() ? "days" : date_text(from)) + "; found " +
                    date_text(mjd));
    }
    const Day last = series.days.back();
    for (int i = 1; i <= gap; i++) {
        const auto between = [&](double Day::*index) { return last.*index + i * (day.*index - last.*index) / gap; };
        Day &filled = series.make(from + i);
        filled.F107 = between(&Day::F107);
        filled.mean_81 = between(&Day::mean_81);
        filled.set_ap(between(&Day::Ap));
    }
}

void read_celestrak_text(const std::vector<IndexLine> &lines, SpaceWeather::Activity &all)
{
    bool inside = false, by_month = false;
    for (const IndexLine &line : lines) {
        const std::string_view text = line.text;
        if (text.starts_with("BEGIN ") || text.starts_with("END ")) {
            inside = text.starts_with("BEGIN ");
            by_month = text.starts_with("BEGIN MONTHLY");
            continue;
        }
        if (!inside || text.empty()) {
            continue;
        }
        if (text.size() < 124 || text.size() > 132) {
            line.refuse("expected a day of 130 columns; found " + std::to_string(text.size()));
        }
        const int mjd =
            line.date(line.integer(column(text, 0, 4), "a year"), line.integer(column(text, 4, 3), "a month"),
                      line.integer(column(text, 7, 3), "a day"));
        if (by_month && mjd < all.indices.end()) {
            continue; // the days have said it
        }
        Day day;
        for (std::size_t k = 0; k < 8; k++) {
            day.kp[k] = in_thirds(line.within(column(text, 18 + 3 * k, 3), "ten times Kp", 0.0, 90.0, -1.0));
            day.ap[k] = line.ap(column(text, 46 + 4 * k, 4));
        }
        day.Ap = line.ap(column(text, 78, 4));
        day.F107 = line.flux(column(text, 112, 6), "the observed F10.7");
        day.mean_81 = line.flux(column(text, 118, 6), "its centred mean of 81 days");
        if (by_month) {
            add_month(line, mjd, day, all.indices);
        } else {
            line.follows(mjd, all.indices);
            all.indices.make(mjd) = day;
        }
    }
}

std::vector<std::string_view> cells_of(std::string_view text)
{
    std::vector<std::string_view> cells;
    for (std::size_t begin = 0; begin <= text.size();) {
        const std::size_t end = std::min(text.find(',', begin), text.size());
        cells.push_back(column(text, begin, end - begin));
        begin = end + 1;
    }
    return cells;
}

void read_celestrak_csv(const std::vector<IndexLine> &lines, SpaceWeather::Activity &all)
{
    const std::vector<std::string_view> names = cells_of(lines.front().text);
    const auto place = [&](const std::string &name) {
        const auto found = std::find(names.begin(), names.end(), name);
        if (found == names.end()) {
            lines.front().refuse("has no column " + name);
        }
        return static_cast<std::size_t>(found - names.begin());
    };
    std::size_t kp[8], ap[8];
    for (std::size_t k = 0; k < 8; k++) {
        kp[k] = place("KP" + std::to_string(k + 1));
        ap[k] = place("AP" + std::to_string(k + 1));
    }
    const std::size_t Ap = place("AP_AVG"), F107 = place("F10.7_OBS"), mean = place("F10.7_OBS_CENTER81"),
                      kind = place("F10.7_DATA_TYPE");
    for (std::size_t i = 1; i < lines.size(); i++) {
        const IndexLine &line = lines[i];
        const std::vector<std::string_view> cells = cells_of(line.text);
        if (cells.size() != names.size()) {
            line.refuse("expected " + std::to_string(names.size()) + " columns, as in the first line; found " +
                        std::to_string(cells.size()));
        }
        const int mjd =
            line.date(line.integer(column(cells[0], 0, 4), "a year"), line.integer(column(cells[0], 5, 2), "a month"),
                      line.integer(column(cells[0], 8, 3), "a day"));
        Day day;
        for (std::size_t k = 0; k < 8; k++) {
            day.kp[k] = in_thirds(line.within(cells[kp[k]], "ten times Kp", 0.0, 90.0, -1.0));
            day.ap[k] = line.ap(cells[ap[k]]);
        }
        day.Ap = line.ap(cells[Ap]);
        day.F107 = line.flux(cells[F107], "F10.7_OBS");
        day.mean_81 = line.flux(cells[mean], "F10.7_OBS_CENTER81");
        if (cells[kind] == "PRM") {
            add_month(line, mjd, day, all.indices);
        } else {
            line.follows(mjd, all.indices);
            all.indices.make(mjd) = day;
        }
    }
}

/// year month day, days since 1932 and to noon, Bartels' rotation and its day, 8 Kp, 8 ap, Ap, sunspots, F10.7 observed
/// and adjusted, whether definite
void read_gfz(const std::vector<IndexLine> &lines, SpaceWeather::Activity &all)
{
    constexpr int mjd_1932 = 26'707;
    for (const IndexLine &line : lines) {
        const std::vector<std::string_view> words = words_of(line.text);
        if (words.empty()) {
            continue;
        }
        if (words.size() != 28) {
            line.refuse("expected a day of GFZ's Kp_ap_Ap_SN_F107: 28 numbers; found " + std::to_string(words.size()));
        }
        const int mjd = line.date(line.integer(words[0], "a year"), line.integer(words[1], "a month"),
                                  line.integer(words[2], "a day"));
        if (line.integer(words[3], "days since 1932") != mjd - mjd_1932) {
            line.refuse("the date is not " + std::string(words[3]) + " days after 1932-01-01");
        }
        line.follows(mjd, all.indices);
        Day &day = all.indices.make(mjd);
        for (std::size_t k = 0; k < 8; k++) {
            day.kp[k] = line.within(words[7 + k], "Kp", 0.0, 9.0, -1.0);
            day.ap[k] = line.ap(words[15 + k]);
        }
        day.Ap = line.ap(words[23]);
        day.F107 = line.flux(words[25], "the observed F10.7", -1.0);
    }
}

/// "02Mar13"
int noaa_date(const IndexLine &line, std::string_view word)
{
    constexpr std::string_view names = "JanFebMarAprMayJunJulAugSepOctNovDec";
    const std::size_t month = word.size() == 7 ? names.find(word.substr(2, 3)) : names.npos;
    if (month == names.npos || month % 3) {
        line.refuse("expected a date as 02Mar13; found \"" + std::string(word) + "\"");
    }
    return line.date(2000 + line.integer(word.substr(5, 2), "a year"), static_cast<int>(month / 3) + 1,
                     line.integer(word.substr(0, 2), "a day"));
}

void read_noaa(const std::vector<IndexLine> &lines, SpaceWeather::Activity &all)
{
    enum { before, ap, flux } part = before;
    int next = 0;
    for (const IndexLine &line : lines) {
        if (line.text.starts_with("45-DAY ")) {
            part = line.text.starts_with("45-DAY AP") ? ap : flux;
            next = 0;
            continue;
        }
        const std::vector<std::string_view> words = words_of(line.text);
        if (part == before || words.empty() || line.text.starts_with(":")) {
            continue;
        }
        if (line.text.starts_with("FORECASTER")) {
            break;
        }
        if (words.size() % 2) {
            line.refuse("expected dates and values in turn; found " + std::to_string(words.size()) + " words");
        }
        for (std::size_t i = 0; i < words.size(); i += 2) {
            const int mjd = noaa_date(line, words[i]);
            if (next && mjd != next) {
                line.refuse("expected " + date_text(next) + "; found " + date_text(mjd));
            }
            next = mjd + 1;
            if (part == flux && !all.indices.find(mjd)) {
                line.refuse("has F10.7 of " + date_text(mjd) + ", but no ap above");
            }
            Day &day = all.indices.make(mjd);
            if (part == ap) {
                day.set_ap(line.ap(words[i + 1]));
            } else {
                day.F107 = line.flux(words[i + 1], "F10.7");
            }
        }
    }
}

/// The days of a daily file of NOAA's SWPC: line, MJD and words from the date on.
template <typename Read>
void read_swpc(const std::vector<IndexLine> &lines, const char *form, std::size_t size, SpaceWeather::Activity &all,
               Read read)
{
    for (const IndexLine &line : lines) {
        std::string spaced; // values that are not there run together: "1-1-1"
        for (const char c : line.text) {
            spaced += c == '-' ? " -" : std::string(1, c);
        }
        const std::vector<std::string_view> words = words_of(spaced);
        if (words.empty() || line.text.starts_with(":")) {
            continue;
        }
        if (words.size() != size) {
            line.refuse("expected a day of NOAA's " + std::string(form) + ": a date and " + std::to_string(size - 3) +
                        " values; found " + std::to_string(words.size()) + " words");
        }
        const int mjd = line.date(line.integer(words[0], "a year"), line.integer(words[1], "a month"),
                                  line.integer(words[2], "a day"));
        line.follows(mjd, all.indices);
        read(line, words, all.indices.make(mjd));
    }
}

/// DSD: F10.7, then sunspots, the mean field, X-rays and flares.
void read_dsd(const std::vector<IndexLine> &lines, SpaceWeather::Activity &all)
{
    read_swpc(lines, "DSD.txt", 16, all, [](const IndexLine &line, const auto &words, Day &day) {
        day.F107 = line.flux(words[3], "F10.7", -1.0);
    });
}

/// DGD: A and eight K of Fredericksburg, of College, and as estimated of the planet, in whole numbers or hundredths.
void read_dgd(const std::vector<IndexLine> &lines, SpaceWeather::Activity &all)
{
    read_swpc(lines, "DGD.txt", 30, all, [](const IndexLine &line, const auto &words, Day &day) {
        bool whole = true;
        for (std::size_t k = 0; k < 8; k++) {
            day.kp[k] = std::round(3.0 * line.within(words[22 + k], "K", 0.0, 9.0, -1.0)) / 3.0;
            day.ap[k] = ap_of_kp(day.kp[k]);
            whole = whole && !std::isnan(day.kp[k]);
        }
        const double A = line.ap(words[21]);
        day.Ap = whole ? A : SpaceWeather::unknown; // before the day's end it is that of the hours so far
    });
}

/// SOLFSMY: year, day of it, Julian date, then day's value and mean of F10, S10, M10 and Y10, and where they come from.
void read_solfsmy(const std::vector<IndexLine> &lines, SpaceWeather::Activity &all)
{
    constexpr double julian = 2'400'001.0; // Julian date of MJD 0, 12 h
    for (const IndexLine &line : lines) {
        const std::vector<std::string_view> words = words_of(line.text);
        if (words.empty()) {
            continue;
        }
        if (words.size() != 12) {
            line.refuse("expected a day of SOLFSMY: 11 numbers and a word; found " + std::to_string(words.size()));
        }
        const int mjd = line.day_of_year(words[0], words[1]);
        if (parse_number(words[2]) != mjd + julian) {
            line.refuse("expected the Julian date " + sim::format_number(mjd + julian) + " of " + date_text(mjd) +
                        "; found " + std::string(words[2]));
        }
        line.follows(mjd, all.jb2008);
        Jb2008Day &day = all.jb2008.make(mjd);
        const char *names[] = {"F10", "S10", "M10", "Y10"};
        Jb2008Day::Flux *fluxes[] = {&day.F10, &day.S10, &day.M10, &day.Y10};
        for (std::size_t i = 0; i < 4; i++) {
            fluxes[i]->of_day = line.flux(words[3 + 2 * i], names[i]);
            fluxes[i]->mean = line.flux(words[4 + 2 * i], names[i]);
        }
    }
}

/// "DTC", year, day of it, and a temperature for each hour.
void read_dtc(const std::vector<IndexLine> &lines, SpaceWeather::Activity &all)
{
    for (const IndexLine &line : lines) {
        const std::vector<std::string_view> words = words_of(line.text);
        if (words.empty()) {
            continue;
        }
        if (words.size() != 27 || words[0] != "DTC") {
            line.refuse("expected a day of DTCFILE: DTC, year, day and 24 temperatures; found " +
                        std::to_string(words.size()) + " words");
        }
        const int mjd = line.day_of_year(words[1], words[2]);
        line.follows(mjd, all.jb2008);
        Jb2008Day &day = all.jb2008.make(mjd);
        for (std::size_t k = 0; k < 24; k++) {
            day.storm[k] = line.within(words[3 + k], "DTC [K]", 0.0, 2000.0, -1.0);
        }
    }
}

} // namespace

SpaceWeather::Activity read_activity(const std::string &path)
{
    const std::string whole = read_whole(path);
    std::vector<IndexLine> lines;
    bool noaa = false, celestrak = false, dsd = false, dgd = false;
    std::size_t number = 0;
    for (const std::string_view text : lines_of(whole)) {
        number++;
        celestrak = celestrak || text.starts_with("BEGIN OBSERVED");
        noaa = noaa || text.starts_with("45-DAY AP");
        dsd = dsd || text.starts_with(":Product: Daily Solar Data");
        dgd = dgd || text.starts_with(":Product: Daily Geomagnetic Data");
        if (!text.starts_with("#")) {
            lines.push_back({path, number, text});
        }
    }
    const std::size_t first = lines.empty() ? 0 : words_of(lines.front().text).size();
    SpaceWeather::Activity all;
    if (celestrak) {
        read_celestrak_text(lines, all);
    } else if (noaa) {
        read_noaa(lines, all);
    } else if (dsd || dgd) {
        (dsd ? read_dsd : read_dgd)(lines, all);
    } else if (!lines.empty() && lines.front().text.starts_with("DATE,")) {
        read_celestrak_csv(lines, all);
    } else if (!lines.empty() && lines.front().text.starts_with("DTC ")) {
        read_dtc(lines, all);
    } else if (first == 28) {
        read_gfz(lines, all);
    } else if (first == 12) {
        read_solfsmy(lines, all);
    } else {
        refuse_file(path,
                    "expected a file of indices: CelesTrak's SW-All.csv or .txt, GFZ's Kp_ap_Ap_SN_F107..., NOAA's "
                    "45-day-ap-forecast.txt, DSD.txt and DGD.txt, or JB2008's SOLFSMY.TXT and DTCFILE.TXT; its first "
                    "line is none of them");
    }
    if (all.indices.days.empty() && all.jb2008.days.empty()) {
        refuse_file(path, "has no days");
    }
    return all;
}

} // namespace fledge::world
