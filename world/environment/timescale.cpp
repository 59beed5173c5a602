// SPDX-License-Identifier: Apache-2.0
#include "world/environment/timescale.h"

#include "flight/math/elementary.h"
#include "sim/error.h"
#include "sim/text.h"
#include "world/environment/text_input.h"
#include "world/environment/text_kernel.h"

#include <array>
#include <chrono>
#include <cmath>

namespace fledge::world {

namespace {

using namespace std::chrono;

constexpr std::int64_t second = 1'000'000'000; // [ns]
constexpr std::int64_t day_seconds = 86'400;
constexpr std::int64_t noon = 43'200; // [s] J2000 lies at noon, days begin at midnight
constexpr std::int64_t tai_minus_gps = 19 * second;
constexpr std::int64_t gps_days = 7300; // from 1980-01-06 to 2000-01-01
constexpr int first_year = 1709, last_year = 2291;
constexpr std::array<std::string_view, 12> months = {"JAN", "FEB", "MAR", "APR", "MAY", "JUN",
                                                     "JUL", "AUG", "SEP", "OCT", "NOV", "DEC"};

/// Days past 2000-01-01.
std::int64_t day_number(year_month_day date)
{
    return (sys_days{date} - sys_days{2000y / 1 / 1}).count();
}

year_month_day date_of(std::int64_t day)
{
    return sys_days{2000y / 1 / 1} + days{day};
}

year_month_day date_of(const CalendarTime &time)
{
    return year{time.year} / time.month / time.day;
}

std::string two(std::int64_t n)
{
    return (n < 10 ? "0" : "") + std::to_string(n);
}

/// "2015-03-02"
std::string format_date(year_month_day date)
{
    const int year{date.year()};
    std::string digits = std::to_string(std::abs(year));
    digits.insert(0, digits.size() < 4 ? 4 - digits.size() : 0, '0');
    return (year < 0 ? "-" : "") + digits + "-" + two(unsigned{date.month()}) + "-" + two(unsigned{date.day()});
}

/// "2015-03-02T12:00:00"
std::string format_time(const CalendarTime &time)
{
    return format_date(date_of(time)) + "T" + two(time.hour) + ":" + two(time.minute) + ":" + two(time.second);
}

/// What a clock shows so many seconds after 2000-01-01T12:00:00.
CalendarTime calendar_time(std::int64_t since_noon)
{
    const seconds since_midnight{since_noon + noon};
    const days day = floor<days>(since_midnight);
    const year_month_day date = date_of(day.count());
    const hh_mm_ss clock{since_midnight - day};
    return {.year = int{date.year()},
            .month = static_cast<int>(unsigned{date.month()}),
            .day = static_cast<int>(unsigned{date.day()}),
            .hour = static_cast<int>(clock.hours().count()),
            .minute = static_cast<int>(clock.minutes().count()),
            .second = static_cast<int>(clock.seconds().count())};
}

std::string_view name_of(TimeScale scale)
{
    constexpr std::string_view names[] = {"UTC", "TAI", "TT", "TDB", "GPS"};
    return names[static_cast<int>(scale)];
}

/// Reads what is expected, from left to right.
class Scanner {
public:
    explicit Scanner(std::string_view text) : rest_(text) {}

    bool take(char c)
    {
        const bool matches = !rest_.empty() && rest_.front() == c;
        rest_.remove_prefix(matches);
        return matches;
    }

    /// Exactly `digits` digits.
    bool digits(int digits, int &value)
    {
        value = 0;
        for (int i = 0; i < digits; i++) {
            if (rest_.empty() || rest_.front() < '0' || rest_.front() > '9') {
                return false;
            }
            value = 10 * value + (rest_.front() - '0');
            rest_.remove_prefix(1);
        }
        return true;
    }

    /// The digits after a decimal point, 1 to 9 of them, as nanoseconds.
    bool fraction(std::int32_t &nanoseconds)
    {
        int count = 0, digit = 0;
        nanoseconds = 0;
        while (!rest_.empty() && rest_.front() >= '0' && rest_.front() <= '9') {
            if (++count > 9) {
                return false;
            }
            digits(1, digit);
            nanoseconds = 10 * nanoseconds + digit;
        }
        for (int i = count; i < 9; i++) {
            nanoseconds *= 10;
        }
        return count > 0;
    }

    std::string_view rest() const { return rest_; }

private:
    std::string_view rest_;
};

[[noreturn]] void refuse(std::string_view text, const std::string &what)
{
    throw sim::SetupError("time \"" + shown(text) + "\": " + what);
}

[[noreturn]] void refuse_utc(std::string_view text)
{
    refuse(text, "UTC had no whole leap seconds before 1972-01-01; give TAI, TT or TDB");
}

/// "1972-JAN-1" or "1972-01-01", as kernels write it behind an @: days past 2000-01-01.
std::int64_t kernel_day(const KernelValue &value, const std::string &file)
{
    const auto refuse_date = [&] {
        refuse_line(file, value.line, "expected a date such as @1972-JAN-1, found \"" + value.text + "\"");
    };
    if (value.text.front() != '@') {
        refuse_date();
    }
    const std::string_view text = std::string_view(value.text).substr(1);
    const std::size_t first = text.find('-');
    const std::size_t last = text.rfind('-');
    if (first == text.npos || first == last) {
        refuse_date();
    }
    const auto year = parse_integer(text.substr(0, first));
    const std::string_view month_text = text.substr(first + 1, last - first - 1);
    const auto day = parse_integer(text.substr(last + 1));
    int month = parse_integer(month_text).value_or(0);
    for (int i = 0; i < 12; i++) {
        if (months[static_cast<std::size_t>(i)] == month_text) {
            month = i + 1;
        }
    }
    if (!year || !day || *year < first_year || *year > last_year || month < 1 || month > 12 || *day < 1 || *day > 31) {
        refuse_date();
    }
    const year_month_day date = std::chrono::year{*year} / month / *day;
    if (!date.ok()) {
        refuse_date();
    }
    return day_number(date);
}

} // namespace

std::optional<int> mjd_of(int year, int month, int day)
{
    const year_month_day date = std::chrono::year{year} / month / day;
    return date.ok() ? std::optional(static_cast<int>(day_number(date)) + mjd_2000) : std::nullopt;
}

std::string date_text(int mjd)
{
    return format_date(date_of(std::int64_t{mjd} - mjd_2000));
}

std::string format_tdb(double seconds)
{
    return format_time(calendar_time(static_cast<std::int64_t>(std::floor(seconds)))) + " TDB";
}

std::int64_t TimeSystem::Step::begin() const
{
    return (day * day_seconds - noon + tai_minus_utc) * second;
}

TimeSystem::TimeSystem()
{
    // The first days of UTC with one more second behind them, after the first.
    constexpr struct {
        std::int16_t year;
        std::int8_t month;
    } dates[] = {{1972, 1}, {1972, 7}, {1973, 1}, {1974, 1}, {1975, 1}, {1976, 1}, {1977, 1},
                 {1978, 1}, {1979, 1}, {1980, 1}, {1981, 7}, {1982, 7}, {1983, 7}, {1985, 7},
                 {1988, 1}, {1990, 1}, {1991, 1}, {1992, 7}, {1993, 7}, {1994, 7}, {1996, 1},
                 {1997, 7}, {1999, 1}, {2006, 1}, {2009, 1}, {2012, 7}, {2015, 7}, {2017, 1}};
    int tai_minus_utc = 10;
    for (const auto &date : dates) {
        steps_.push_back({day_number(year{date.year} / date.month / 1), tai_minus_utc++});
    }
}

TimeSystem TimeSystem::read(const std::string &path)
{
    const TextKernel kernel = TextKernel::read(path);
    if (!kernel.has("DELTET/DELTA_AT")) {
        throw sim::SetupError(path + ": does not define DELTET/DELTA_AT; expected a leap-seconds "
                                     "kernel (.tls)");
    }
    TimeSystem system;
    // About what these are is known; a number far beyond is damage.
    const auto numbers = [&](const char *name, const std::vector<double> &most) {
        std::vector<double> values = kernel.numbers(name, most.size(), most.size());
        for (std::size_t i = 0; i < most.size(); i++) {
            if (!(std::fabs(values[i]) <= most[i])) {
                refuse_line(path, kernel.values(name)[i].line,
                            std::string(name) + " is " + sim::format_number(values[i]) + "; expected at most " +
                                sim::format_number(most[i]));
            }
        }
        return values;
    };
    system.tt_minus_tai_ = static_cast<std::int64_t>(std::floor(1e9 * numbers("DELTET/DELTA_T_A", {100.0})[0] + 0.5));
    system.K_ = numbers("DELTET/K", {0.01})[0];
    system.e_ = numbers("DELTET/EB", {0.1})[0];
    const auto M = numbers("DELTET/M", {100.0, 1e-6});
    system.M0_ = M[0];
    system.M1_ = M[1];

    const auto &table = kernel.values("DELTET/DELTA_AT");
    if (table.size() % 2 != 0) {
        refuse_line(path, table.back().line,
                    "DELTET/DELTA_AT is a list of pairs (seconds, @date); the last is not whole");
    }
    system.steps_.clear();
    for (std::size_t i = 0; i < table.size(); i += 2) {
        const KernelValue &count = table[i];
        if (!count.is_number || count.number != std::floor(count.number) || std::fabs(count.number) > 1000.0) {
            refuse_line(path, count.line, "expected a whole number of seconds, found \"" + count.text + "\"");
        }
        const Step step{kernel_day(table[i + 1], path), static_cast<int>(count.number)};
        if (!system.steps_.empty()) {
            const Step &before = system.steps_.back();
            if (step.day <= before.day || step.tai_minus_utc != before.tai_minus_utc + 1) {
                refuse_line(path, count.line,
                            "dates must ascend and seconds grow by 1 each; found " + count.text + " at " +
                                table[i + 1].text + " after " + std::to_string(before.tai_minus_utc) + " at " +
                                format_date(date_of(before.day)));
            }
        }
        system.steps_.push_back(step);
    }
    system.path_ = path;
    for (const Step &known : TimeSystem().steps_) {
        if (!system.missing_ && !system.steps_.empty() && known.day > system.steps_.back().day) {
            system.missing_ = known;
        }
    }
    return system;
}

void TimeSystem::refuse_missing() const
{
    throw sim::SetupError(path_ + ": has no leap second before " + format_date(date_of(missing_->day)) +
                          ": UTC from then on needs a newer file");
}

std::int64_t TimeSystem::tdb_minus_tt(std::int64_t tt) const
{
    const double M = M0_ + M1_ * (static_cast<double>(tt) / 1e9);
    const double E = M + e_ * fm_sin(M);
    return static_cast<std::int64_t>(std::floor(1e9 * (K_ * fm_sin(E)) + 0.5));
}

Epoch TimeSystem::from_tt(std::int64_t tt) const
{
    return {tt + tdb_minus_tt(tt)};
}

std::int64_t TimeSystem::tt(Epoch epoch) const
{
    // K M1 < 1e-9: the first step is right to a nanosecond, the second wholly.
    std::int64_t tt = epoch.ns - tdb_minus_tt(epoch.ns);
    tt += epoch.ns - from_tt(tt).ns;
    return tt;
}

std::int64_t TimeSystem::gps(Epoch epoch) const
{
    return tai(epoch) - tai_minus_gps + (gps_days * day_seconds + noon) * second;
}

const TimeSystem::Step *TimeSystem::step_at(std::int64_t tai) const
{
    if (missing_ && tai >= missing_->begin() - second) { // the leap second ends the day before the step
        refuse_missing();
    }
    const Step *last = nullptr;
    for (const Step &step : steps_) {
        if (step.begin() <= tai) {
            last = &step;
        }
    }
    return last;
}

int TimeSystem::tai_minus_utc(Epoch epoch) const
{
    const Step *step = step_at(tai(epoch));
    if (!step) {
        refuse_utc(format_tdb(epoch.seconds()));
    }
    return step->tai_minus_utc;
}

Epoch TimeSystem::epoch(const CalendarTime &time, TimeScale scale) const
{
    const std::string shown = format_time(time) + " " + std::string(name_of(scale));
    const auto within = [&](const char *what, int value, int least, int most) {
        if (value < least || value > most) {
            refuse(shown, std::string(what) + " " + std::to_string(value) + " is not within " + std::to_string(least) +
                              " to " + std::to_string(most));
        }
    };
    within("year", time.year, first_year, last_year);
    within("month", time.month, 1, 12);
    const year_month_day_last last_day = year{time.year} / time.month / last;
    within("day", time.day, 1, static_cast<int>(unsigned{last_day.day()}));
    within("hour", time.hour, 0, 23);
    within("minute", time.minute, 0, 59);
    within("nanosecond", time.nanosecond, 0, 999'999'999);

    const std::int64_t day = day_number(date_of(time));
    const Step *step = nullptr;
    bool leap = false;
    if (scale == TimeScale::utc) {
        for (const Step &s : steps_) {
            step = s.day <= day ? &s : step;
            leap = leap || (s.day == day + 1 && &s != &steps_.front());
        }
        if (missing_ && day >= missing_->day) {
            refuse_missing();
        }
        if (!step) {
            refuse_utc(shown);
        }
    }
    if (time.second == 60) {
        if (!leap || time.hour != 23 || time.minute != 59) {
            refuse(shown, "second 60 exists only at 23:59 UTC before a leap second takes effect; the "
                          "last of this table is before " +
                              format_date(date_of(steps_.back().day)));
        }
    } else {
        within("second", time.second, 0, 59);
    }

    const std::int64_t past_noon = day * day_seconds - noon + time.hour * 3600 + time.minute * 60 + time.second;
    const std::int64_t reading = past_noon * second + time.nanosecond;
    switch (scale) {
    case TimeScale::utc: return from_tai(reading + step->tai_minus_utc * second);
    case TimeScale::tai: return from_tai(reading);
    case TimeScale::tt: return from_tt(reading);
    case TimeScale::gps: return from_tai(reading + tai_minus_gps);
    case TimeScale::tdb: break;
    }
    return {reading};
}

Epoch TimeSystem::epoch(std::string_view text) const
{
    Scanner scan(text);
    CalendarTime time;
    bool whole = scan.digits(4, time.year) && scan.take('-') && scan.digits(2, time.month) && scan.take('-') &&
                 scan.digits(2, time.day);
    // A blank may end the date ("... TDB") or stand for the T.
    const bool clock = whole && (scan.take('T') || (scan.rest().size() > 2 && scan.rest()[1] >= '0' &&
                                                    scan.rest()[1] <= '9' && scan.take(' ')));
    if (clock) {
        whole =
            scan.digits(2, time.hour) && scan.take(':') && scan.digits(2, time.minute) &&
            (!scan.take(':') || (scan.digits(2, time.second) && (!scan.take('.') || scan.fraction(time.nanosecond))));
    }
    const std::string_view suffix = scan.rest();
    TimeScale scale = TimeScale::utc;
    if (suffix == " TAI") {
        scale = TimeScale::tai;
    } else if (suffix == " TT") {
        scale = TimeScale::tt;
    } else if (suffix == " TDB") {
        scale = TimeScale::tdb;
    } else if (suffix == " GPS") {
        scale = TimeScale::gps;
    } else {
        whole = whole && (suffix.empty() || suffix == "Z" || suffix == " UTC");
    }
    if (!whole) {
        refuse(text, "expected a date as in 2015-03-02T12:00:00, with up to 9 decimals, and "
                     "optionally Z, \" UTC\", \" TAI\", \" TT\", \" TDB\" or \" GPS\"");
    }
    return epoch(time, scale);
}

CalendarTime TimeSystem::calendar(Epoch epoch, TimeScale scale) const
{
    std::int64_t reading = epoch.ns;
    bool in_leap_second = false;
    if (scale == TimeScale::tt) {
        reading = tt(epoch);
    } else if (scale == TimeScale::tai) {
        reading = tai(epoch);
    } else if (scale == TimeScale::gps) {
        reading = tai(epoch) - tai_minus_gps;
    } else if (scale == TimeScale::utc) {
        const std::int64_t now = tai(epoch);
        const Step *step = step_at(now);
        if (!step) {
            refuse_utc(format_tdb(epoch.seconds()));
        }
        reading = now - step->tai_minus_utc * second;
        if (step != &steps_.back() && now >= step[1].begin() - second) {
            in_leap_second = true;
            reading -= second; // 23:59:59 once more, to be called 60
        }
    }
    const auto whole = floor<seconds>(nanoseconds{reading});
    CalendarTime time = calendar_time(whole.count());
    time.second += in_leap_second;
    time.nanosecond = static_cast<std::int32_t>((nanoseconds{reading} - whole).count());
    return time;
}

std::string TimeSystem::text(Epoch epoch, TimeScale scale) const
{
    const CalendarTime time = calendar(epoch, scale);
    std::string text = format_time(time);
    if (time.nanosecond) {
        std::string digits = std::to_string(second + time.nanosecond).substr(1);
        digits.erase(digits.find_last_not_of('0') + 1);
        text += "." + digits;
    }
    return text + (scale == TimeScale::utc ? "Z" : " " + std::string(name_of(scale)));
}

} // namespace fledge::world
