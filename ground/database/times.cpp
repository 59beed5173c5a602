// SPDX-License-Identifier: Apache-2.0
#include "ground/database/times.h"

#include "ground/database/decoder.h"

#include <algorithm>
#include <array>
#include <chrono>

namespace fledge::ground {

namespace {

using namespace std::chrono;
using View = std::string_view;

constexpr std::int64_t second = 1'000'000'000; // [ns]

constexpr std::int64_t seconds_at(year_month_day date)
{
    return duration_cast<seconds>(sys_days(date).time_since_epoch()).count();
}

/// [s] of UTC from which on TAI - UTC is 10, 11, ... s (IERS Bulletin C), as in world/environment/timescale.cpp.
constexpr std::array steps = [] {
    constexpr std::pair<int, unsigned> months[] = {
        {1972, 1}, {1972, 7}, {1973, 1}, {1974, 1}, {1975, 1}, {1976, 1}, {1977, 1}, {1978, 1}, {1979, 1}, {1980, 1},
        {1981, 7}, {1982, 7}, {1983, 7}, {1985, 7}, {1988, 1}, {1990, 1}, {1991, 1}, {1992, 7}, {1993, 7}, {1994, 7},
        {1996, 1}, {1997, 7}, {1999, 1}, {2006, 1}, {2009, 1}, {2012, 7}, {2015, 7}, {2017, 1}};
    std::array<std::int64_t, std::size(months)> result{};
    for (std::size_t i = 0; i < result.size(); i++) {
        result[i] = seconds_at(year(months[i].first) / month(months[i].second) / 1);
    }
    return result;
}();

/// The last step that has begun.
template <class Begun> std::int64_t tai_minus_utc(const Begun &begun)
{
    std::int64_t i = std::ssize(steps) - 1;
    for (; i > 0 && !begun(steps[static_cast<std::size_t>(i)], 10 + i); i--) {
    }
    return (10 + i) * second;
}

/// Takes a text apart, from left to right.
class Scanner {
public:
    explicit Scanner(View text) : rest_(text) {}

    bool take(View text)
    {
        const bool matches = rest_.starts_with(text);
        rest_.remove_prefix(matches ? text.size() : 0);
        return matches;
    }

    /// So many digits; most: at most so many, and at least one.
    std::optional<std::int64_t> digits(std::size_t least, std::size_t most)
    {
        std::int64_t value = 0;
        std::size_t n = 0;
        for (; n < most && n < rest_.size() && rest_[n] >= '0' && rest_[n] <= '9'; n++) {
            value = 10 * value + (rest_[n] - '0');
        }
        rest_.remove_prefix(n);
        return n >= least ? std::optional(value) : std::nullopt;
    }

    /// [1e-9] A decimal point and digits behind it, if there are any; rounded down.
    std::int64_t fraction()
    {
        std::int64_t value = 0;
        if (rest_.size() > 1 && rest_[0] == '.' && rest_[1] >= '0' && rest_[1] <= '9') {
            rest_.remove_prefix(1);
            const std::size_t before = rest_.size();
            value = *digits(1, 9);
            for (std::size_t n = before - rest_.size(); n < 9; n++) {
                value *= 10;
            }
            rest_.remove_prefix(std::min(rest_.find_first_not_of("0123456789"), rest_.size()));
        }
        return value;
    }

    bool at_end() const { return rest_.empty(); }

private:
    View rest_;
};

std::optional<std::int64_t> narrow(Wide ns)
{
    const auto result = static_cast<std::int64_t>(ns);
    return result == ns ? std::optional(result) : std::nullopt;
}

/// "2026-03-01" [s]
std::optional<std::int64_t> day_of(Scanner &scan)
{
    const auto y = scan.digits(4, 4);
    const auto m = scan.take("-") ? scan.digits(2, 2) : std::nullopt;
    const auto d = scan.take("-") ? scan.digits(2, 2) : std::nullopt;
    if (!y || !m || !d) {
        return std::nullopt;
    }
    const auto date = year(static_cast<int>(*y)) / month(static_cast<unsigned>(*m)) / day(static_cast<unsigned>(*d));
    return date.ok() ? std::optional(seconds_at(date)) : std::nullopt;
}

/// "12:00" [s]
std::optional<std::int64_t> minutes_of(Scanner &scan)
{
    const auto h = scan.digits(2, 2);
    const auto m = scan.take(":") ? scan.digits(2, 2) : std::nullopt;
    return h && m && *h < 24 && *m < 60 ? std::optional(3600 * *h + 60 * *m) : std::nullopt;
}

} // namespace

Wide utc_of_tai(Wide tai)
{
    return tai - tai_minus_utc([&](std::int64_t begin, std::int64_t by) { return tai >= (begin + by) * second; });
}

Wide tai_of_utc(Wide utc)
{
    return utc + tai_minus_utc([&](std::int64_t begin, std::int64_t) { return utc >= begin * second; });
}

std::optional<Epoch> epoch_of(View text)
{
    if (text == "UNIX" || text == "POSIX") {
        return Epoch{0, false};
    }
    if (text == "TAI") {
        return Epoch{seconds_at(1958y / 1 / 1) * second, true};
    }
    if (text == "GPS") {
        return Epoch{(seconds_at(1980y / 1 / 6) + 19) * second, true};
    }
    if (text == "J2000") { // TT = TAI + 32.184 s
        return Epoch{(seconds_at(2000y / 1 / 1) + 43'200) * second - 32'184'000'000, true};
    }
    const auto date = date_of(text);
    if (!date || *date < steps[0] * second) {
        return date ? std::optional(Epoch{*date, false}) : std::nullopt;
    }
    if (*date > seconds_at(2200y / 1 / 1) * second) {
        return std::nullopt;
    }
    return Epoch{static_cast<std::int64_t>(tai_of_utc(*date)) - (is_leap_second(text) ? second : 0), true};
}

std::optional<std::int64_t> date_of(View text)
{
    Scanner scan(text);
    const auto day = day_of(scan);
    Wide ns = Wide(day.value_or(0)) * second;
    bool leaps = false;
    if (day && (scan.take("T") || scan.take(" "))) {
        const auto minutes = minutes_of(scan);
        const auto s = scan.take(":") ? scan.digits(2, 2) : std::nullopt;
        if (!minutes || !s || *s > 60) {
            return std::nullopt;
        }
        leaps = *s == 60;
        ns += Wide(*minutes + *s) * second + scan.fraction();
    }
    const bool east = scan.take("+");
    if (east || scan.take("-")) {
        const auto zone = minutes_of(scan);
        if (!zone) {
            return std::nullopt;
        }
        ns -= (east ? *zone : -*zone) * second;
    } else {
        scan.take("Z");
    }
    if (leaps && std::find(steps.begin() + 1, steps.end(), static_cast<std::int64_t>(ns / second)) == steps.end()) {
        return std::nullopt;
    }
    return day && scan.at_end() ? narrow(ns) : std::nullopt;
}

bool is_leap_second(View text)
{
    return date_of(text) && text.find(":60") != View::npos;
}

std::optional<std::int64_t> duration_of(View text)
{
    constexpr std::pair<View, std::int64_t> days[] = {{"D", 86'400 * second}};
    constexpr std::pair<View, std::int64_t> clock[] = {{"H", 3600 * second}, {"M", 60 * second}, {"S", second}};
    constexpr std::pair<View, std::int64_t> units[] = {{"s", second}, {"ms", second / 1000}, {"us", 1000}, {"ns", 1}};
    Scanner scan(text);
    const bool negative = scan.take("-");
    Wide ns = 0;
    bool any = false;
    // Parts in their order, each at most once.
    const auto parts = [&](std::span<const std::pair<View, std::int64_t>> names) {
        while (!scan.at_end() && !names.empty()) {
            Scanner ahead = scan;
            const auto whole = ahead.digits(1, 18);
            const std::int64_t fraction = ahead.fraction();
            std::size_t i = 0;
            while (whole && i < names.size() && !ahead.take(names[i].first)) {
                i++;
            }
            if (!whole || i == names.size()) {
                return;
            }
            ns += Wide(*whole) * names[i].second + Wide(fraction) * names[i].second / second;
            names = names.subspan(i + 1);
            any = true;
            scan = ahead;
        }
    };
    if (scan.take("P")) {
        parts(days);
        if (scan.take("T")) {
            any = false;
            parts(clock);
        }
    } else {
        scan.take("+");
        const auto whole = scan.digits(1, 18);
        const std::int64_t fraction = scan.fraction();
        scan.take(" ");
        for (const auto &[name, by] : units) {
            if (whole && !any && scan.take(name)) {
                ns = Wide(*whole) * by + Wide(fraction) * by / second;
                any = true;
            }
        }
    }
    return any && scan.at_end() ? narrow(negative ? -ns : ns) : std::nullopt;
}

std::optional<std::int64_t> time_of(const Type &type, View text)
{
    const Kind kind = value_kind(type);
    return kind == Kind::time ? date_of(text) : kind == Kind::duration ? duration_of(text) : std::nullopt;
}

std::string time_text(Kind kind, std::int64_t ns)
{
    const auto two = [](auto n) { return (n < 10 ? "0" : "") + std::to_string(n); };
    const bool minus = kind == Kind::duration && ns < 0;
    const std::uint64_t size = minus ? -static_cast<std::uint64_t>(ns) : static_cast<std::uint64_t>(ns);
    std::int64_t s = kind == Kind::duration ? static_cast<std::int64_t>(size / second) : ns / second;
    std::int64_t part = kind == Kind::duration ? static_cast<std::int64_t>(size % second) : ns % second;
    s -= part < 0;
    part += part < 0 ? second : 0;
    std::string fraction = part == 0 ? "" : "." + std::to_string(second + part).substr(1);
    fraction.erase(std::min(fraction.find_last_not_of('0') + 1, fraction.size()));
    if (kind == Kind::duration) {
        return (minus ? "-" : "") + std::to_string(s) + fraction;
    }
    const auto midnight = floor<days>(sys_seconds(seconds(s)));
    const year_month_day date(midnight);
    const hh_mm_ss clock(sys_seconds(seconds(s)) - midnight);
    return std::to_string(int(date.year())) + "-" + two(unsigned(date.month())) + "-" + two(unsigned(date.day())) +
           "T" + two(clock.hours().count()) + ":" + two(clock.minutes().count()) + ":" + two(clock.seconds().count()) +
           fraction + "Z";
}

std::string time_words(Kind kind, std::int64_t ns)
{
    return time_text(kind, ns) + (kind == Kind::duration ? " s" : "");
}

std::string unit_of(const Type &type)
{
    const Kind kind = value_kind(type);
    std::string all = kind == Kind::time ? "UTC" : kind == Kind::duration ? "s" : "";
    for (const std::string &unit : all.empty() ? type.units : std::vector<std::string>()) {
        all += (all.empty() ? "" : " ") + unit;
    }
    return all;
}

} // namespace fledge::ground
