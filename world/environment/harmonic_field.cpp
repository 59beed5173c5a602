// SPDX-License-Identifier: Apache-2.0
#include "world/environment/harmonic_field.h"

#include "flight/math/elementary.h"
#include "sim/error.h"
#include "sim/text.h"
#include "world/environment/text_input.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <string_view>

namespace fledge::world {

namespace {

constexpr int highest_in_header = 10'000; // a header beyond it is damaged: 1.6 GB of numbers
constexpr double largest_radius = 1e9;    // [m] beyond that of the Sun

/// sqrt((2 - d_m0) (2 n + 1) (n - m)! / (n + m)!): C = C' / this for an unnormalised C'.
double normalisation(int n, int m)
{
    double square = (m == 0 ? 1.0 : 2.0) * (2.0 * n + 1.0);
    for (int k = n - m + 1; k <= n + m; k++) {
        square /= k;
    }
    return std::sqrt(square);
}

/// The degree and order that the header of a file promises.
struct Promise {
    int degree, order;

    /// The degree up to which rows are kept: no higher than it is wanted, nor where so many rows lack something before.
    int kept(int wanted, std::size_t rows) const
    {
        std::size_t count = 0;
        for (int n = 2; n < std::min(degree, wanted); n++) {
            count += static_cast<std::size_t>(std::min(n, order)) + 1;
            if (count > rows) {
                return n;
            }
        }
        return std::min(degree, wanted);
    }
};

/// Takes the coefficients of a file in any order, and checks that each comes once.
class Collector {
public:
    /// Those up to the degree of the field are kept.
    Collector(std::string file, HarmonicField &field, Promise promise, bool normalised)
        : file_(std::move(file)), field_(field), promise_(promise), normalised_(normalised),
          seen_(HarmonicField::index(field.degree + 1, 0), false)
    {
    }

    /// n, m, C, S are the words from `first` on.
    void take(const std::vector<std::string_view> &words, std::size_t first, std::size_t line)
    {
        take(row(words, first, line), line);
    }

    struct Row {
        int n, m;
        double C, S; ///< normalised

        std::size_t index() const { return HarmonicField::index(n, m); }
    };

    bool keeps(const Row &row) const { return row.n <= field_.degree; }

    Row row(const std::vector<std::string_view> &words, std::size_t first, std::size_t line) const
    {
        if (words.size() < first + 4) {
            refuse_line(file_, line, "expected n, m, C, S, found " + std::to_string(words.size() - first) + " values");
        }
        const auto n = parse_integer(words[first]), m = parse_integer(words[first + 1]);
        const auto C = parse_number(words[first + 2]), S = parse_number(words[first + 3]);
        if (!n || !m || !C || !S) {
            const std::size_t bad = !n ? 0 : !m ? 1 : !C ? 2 : 3;
            refuse_line(file_, line, "expected a number, found \"" + std::string(words[first + bad]) + "\"");
        }
        if (*n < 0 || *n > promise_.degree || *m < 0 || *m > std::min(*n, promise_.order)) {
            refuse_line(file_, line,
                        "degree " + std::to_string(*n) + ", order " + std::to_string(*m) +
                            "; the header promises up to " + std::to_string(promise_.degree) + ", " +
                            std::to_string(promise_.order));
        }
        const double scale = normalised_ || *n > field_.degree ? 1.0 : 1.0 / normalisation(*n, *m);
        const Row row{*n, *m, *C * scale, *S * scale};
        if (!std::isfinite(row.C) || !std::isfinite(row.S)) {
            refuse_line(file_, line, "the coefficient is beyond the range of numbers");
        }
        return row;
    }

    void take(const Row &row, std::size_t line)
    {
        if (!keeps(row)) {
            return;
        }
        const std::size_t i = row.index();
        if (seen_[i]) {
            refuse_line(file_, line,
                        "degree " + std::to_string(row.n) + ", order " + std::to_string(row.m) + " is given twice");
        }
        seen_[i] = true;
        field_.C[i] = row.C;
        field_.S[i] = row.S;
    }

    void add(const Row &row, double factor)
    {
        field_.C[row.index()] += row.C * factor;
        field_.S[row.index()] += row.S * factor;
    }

    void finish(const char *perhaps = "Is the file cut short?") const
    {
        for (int n = 2; n <= field_.degree; n++) {
            for (int m = 0; m <= std::min(n, promise_.order); m++) {
                if (!seen_[HarmonicField::index(n, m)]) {
                    refuse_file(file_, "degree " + std::to_string(n) + ", order " + std::to_string(m) +
                                           " is missing; the header promises all up to " +
                                           std::to_string(promise_.degree) + ", " + std::to_string(promise_.order) +
                                           ". " + perhaps +
                                           (n > 2 ? " Up to degree " + std::to_string(n - 1) +
                                                        " all is there: give degree=" + std::to_string(n - 1)
                                                  : ""));
                }
            }
        }
    }

private:
    std::string file_;
    HarmonicField &field_;
    Promise promise_;
    bool normalised_;
    std::vector<bool> seen_;
};

} // namespace

HarmonicField HarmonicField::zero(double mu, double radius, int degree)
{
    if (!(mu > 0.0 && std::isfinite(mu) && radius > 0.0 && std::isfinite(radius) && degree >= 0 &&
          degree <= highest_in_header)) {
        throw sim::SetupError("gravity field: mu and the radius must be > 0 and the degree 0 to " +
                              std::to_string(highest_in_header) + "; found " + sim::format_number(mu) + ", " +
                              sim::format_number(radius) + " and " + std::to_string(degree));
    }
    HarmonicField field;
    field.mu = mu;
    field.radius = radius;
    field.degree = field.order = degree;
    field.tide_system = "unknown";
    field.C.assign(index(degree + 1, 0), 0.0);
    field.S = field.C;
    field.C[0] = 1.0;
    return field;
}

double HarmonicField::J(int n) const
{
    if (n < 0 || n > degree) {
        throw sim::SetupError("gravity field " + name + ": has no J" + std::to_string(n) + "; its degree is " +
                              std::to_string(degree));
    }
    return -std::sqrt(2.0 * n + 1.0) * C[index(n, 0)];
}

namespace {

/// A field of zeros, by what a file says.
HarmonicField empty_field(const std::string &path, double mu, double radius, int degree)
{
    try {
        return HarmonicField::zero(mu, radius, degree);
    } catch (const sim::SetupError &error) {
        refuse_file(path, error.what());
    }
}

HarmonicField parse_shadr(std::string_view text, const std::string &path, double expected_mu, int wanted)
{
    const auto lines = lines_of(text);
    const auto header = lines.empty() ? std::vector<std::string_view>() : words_of(lines[0]);
    const auto number = [&](std::size_t i) { return i < header.size() ? parse_number(header[i]) : std::nullopt; };
    const auto integer = [&](std::size_t i) { return i < header.size() ? parse_integer(header[i]) : std::nullopt; };
    const auto radius = number(0), mu = number(1);
    const auto degree = integer(3), order = integer(4), normalised = integer(5);
    if (!radius || !mu || !degree || !order || !normalised || *radius <= 0.0 || *mu <= 0.0 || *degree < 0 ||
        *degree > highest_in_header || *order < 0 || *order > *degree) {
        refuse_line(path, 1,
                    "expected the header of a SHADR file: radius, mu, sigma of mu, degree, order, 1 if normalised; or "
                    "a file in ICGEM's format, with a line end_of_head. Others, as GMAT's .cof, SHM, EGM and GRGS, are "
                    "not read: icgem.gfz-potsdam.de has most fields as .gfc");
    }
    if (*normalised != 0 && *normalised != 1) {
        refuse_line(path, 1,
                    "the sixth value is 1: fully normalised, or 0: not normalised; found " +
                        std::to_string(*normalised));
    }
    if (*radius > largest_radius) {
        refuse_line(path, 1,
                    "a radius of " + sim::format_number(*radius) + " is none: SHADR has the radius first, then mu");
    }
    const Promise promise{*degree, *order};
    // 10^4.5 is halfway between mu in m^3/s^2 and in km^3/s^2, on the scale of exponents.
    const bool kilometres = expected_mu > 0.0 ? *mu * std::sqrt(1e9) < expected_mu : *radius < 1e5;
    HarmonicField field = empty_field(path, *mu * (kilometres ? 1e9 : 1.0), *radius * (kilometres ? 1e3 : 1.0),
                                      promise.kept(wanted, lines.size()));
    field.name = path;
    field.order = std::min(field.degree, *order);
    Collector collector(path, field, promise, *normalised == 1);
    for (std::size_t i = 1; i < lines.size(); i++) {
        const auto words = words_of(lines[i]);
        if (!words.empty()) {
            collector.take(words, 0, i + 1);
        }
    }
    collector.finish();
    return field;
}

/// The head of a file in ICGEM's format.
struct IcgemHead {
    std::string name, tide_system = "unknown";
    std::optional<double> mu, radius;
    std::optional<int> degree;
    bool normalised = true;
    bool intervals = false; ///< icgem2.0: each term that varies has a time from which and up to which it holds

    /// From a line of a key and a value.
    void take(const std::string &path, std::size_t line, std::string_view key, std::string_view value)
    {
        bool understood = true;
        if (key == "product_type" && value != "gravity_field") {
            refuse_line(path, line, "expected product_type gravity_field, found " + std::string(value));
        } else if (key == "modelname") {
            name = shown(value);
        } else if (key == "earth_gravity_constant" || key == "gravity_constant") {
            understood = (mu = parse_number(value)).has_value();
        } else if (key == "radius") {
            understood = (radius = parse_number(value)).has_value();
        } else if (key == "max_degree") {
            understood = (degree = parse_integer(value)).has_value();
        } else if (key == "norm") {
            normalised = value == "fully_normalized";
            understood = normalised || value == "unnormalized";
        } else if (key == "tide_system") {
            tide_system = shown(value);
        } else if (key == "format") {
            intervals = value == "icgem2.0";
            understood = intervals || value == "icgem1.0";
        }
        if (!understood) {
            refuse_line(path, line,
                        "the value \"" + std::string(value) + "\" of " + std::string(key) + " is not understood");
        }
    }
};

/// A date in a row.
struct IcgemDate {
    double day;      ///< [d] past 2000-01-01
    double new_year; ///< and the beginning of its year
};

/// Of yyyymmdd or yyyymmdd.hhmm; the minutes may be 60, as EIGEN-6S4 has them.
std::optional<IcgemDate> parse_date(std::string_view word)
{
    const auto date = parse_integer(word.substr(0, 8));
    const auto clock = word.size() == 8 ? 0 : word.size() == 13 && word[8] == '.' ? parse_integer(word.substr(9)) : -1;
    if (word.size() < 8 || !date || *date < 1'00'00 || !clock || *clock < 0 || *clock > 2400 || *clock % 100 > 60) {
        return {};
    }
    const int year = *date / 1'00'00;
    const auto mjd = mjd_of(year, *date / 100 % 100, *date % 100);
    if (!mjd) {
        return {};
    }
    const int minutes = *clock / 100 * 60 + *clock % 100;
    return IcgemDate{*mjd - mjd_2000 + minutes / 1440.0, static_cast<double>(*mjd_of(year, 1, 1) - mjd_2000)};
}

/// Takes the rows behind the head: what changes, as it is at the epoch.
class IcgemRows {
public:
    IcgemRows(const std::string &path, const IcgemHead &head, HarmonicField &field, Promise promise,
              std::optional<Epoch> epoch)
        : path_(path), collector_(path, field, promise, head.normalised), intervals_(head.intervals),
          begin_(field.C.size(), std::numeric_limits<double>::quiet_NaN())
    {
        if (epoch) {
            now_ = epoch->seconds() / 86400.0 + 0.5;
        }
    }

    void take(const std::vector<std::string_view> &words, std::size_t line)
    {
        const std::string_view key = words[0];
        const bool value = key == "gfct", slope = key == "trnd" || key == "dot", wave = key == "acos" || key == "asin";
        if (key == "gfc") {
            collector_.take(words, 1, line);
        } else if (value || slope || wave) {
            take_term(words, value, wave, line);
        } else {
            refuse_line(path_, line,
                        "expected gfc, gfct, trnd, dot, asin or acos, found \"" + std::string(key.substr(0, 40)) +
                            "\"");
        }
    }

    void finish() const
    {
        collector_.finish(intervals_ && now_ ? "Does no interval of it hold the epoch, or is the file cut short?"
                                             : "Is the file cut short?");
    }

private:
    void take_term(const std::vector<std::string_view> &words, bool value, bool wave, std::size_t line)
    {
        if (!now_) {
            refuse_line(path_, line,
                        "its coefficients change in time; say when they are to hold, as in epoch=\"2026-03-20\"");
        }
        const Collector::Row row = collector_.row(words, 1, line);
        if (!collector_.keeps(row)) {
            return;
        }
        // n, m, C, S, their sigmas or none, t0, t1, period.
        const std::size_t dates = intervals_ ? 2 : value ? 1 : 0, tail = words.size() - dates - (wave ? 1 : 0);
        if (tail < 5 || tail > words.size()) {
            refuse_line(path_, line, "the row ends before its dates or its period");
        }
        IcgemDate t0{begin_[row.index()], begin_[row.index()]};
        if (dates > 0) {
            t0 = date(words[tail], line);
        }
        if (dates == 2 && (*now_ < t0.day || *now_ >= date(words[tail + 1], line).day)) {
            return;
        }
        if (value) {
            collector_.take(row, line);
            begin_[row.index()] = t0.day;
            return;
        }
        if (std::isnan(begin_[row.index()])) {
            refuse_line(path_, line,
                        "expected gfct of degree " + std::to_string(row.n) + ", order " + std::to_string(row.m) +
                            " at the epoch before what it changes by");
        }
        collector_.add(row, wave ? phase(words, t0, line) : (*now_ - t0.day) / days_a_year);
    }

    /// cos or sin of 2 pi (t - t0) / period. With intervals they count from the new year before t0, where
    /// EIGEN-6S4 is continuous: from t0 it would jump by 100 times as much in 2002 and 2014.
    double phase(const std::vector<std::string_view> &words, const IcgemDate &t0, std::size_t line) const
    {
        const auto period = parse_number(words.back());
        if (!period || !(*period > 0.001)) { // it may be the sigma before a period that is left out
            refuse_line(path_, line, "expected a period > 0.001 y, found \"" + std::string(words.back()) + "\"");
        }
        const double years = (*now_ - (intervals_ ? t0.new_year : t0.day)) / days_a_year;
        double s = 0.0, c = 0.0;
        fm_sincos(2.0 * std::numbers::pi * years / *period, &s, &c);
        return words[0] == "acos" ? c : s;
    }

    IcgemDate date(std::string_view word, std::size_t line) const
    {
        const auto date = parse_date(word);
        if (!date) {
            refuse_line(path_, line, "expected a date yyyymmdd or yyyymmdd.hhmm, found \"" + std::string(word) + "\"");
        }
        return *date;
    }

    static constexpr double days_a_year = 365.25;

    std::string path_;
    Collector collector_;
    bool intervals_;
    std::vector<double> begin_; // [d] past 2000-01-01, t0 of gfct
    std::optional<double> now_; // [d] past 2000-01-01
};

IcgemHead parse_head(const std::vector<std::string_view> &lines, const std::string &path, std::size_t &i)
{
    const auto key = [&](std::size_t at) {
        const auto words = words_of(lines[at]);
        return words.empty() ? std::string_view() : words[0];
    };
    // All before begin_of_head is comment; without it, only what has no key.
    for (std::size_t at = 0; at < lines.size() && !key(at).starts_with("end_of_head"); at++) {
        if (key(at).starts_with("begin_of_head")) {
            i = at + 1;
        }
    }
    IcgemHead head;
    head.name = path;
    bool ended = false;
    for (; i < lines.size() && !ended; i++) {
        const auto words = words_of(lines[i]);
        ended = key(i).starts_with("end_of_head");
        if (words.size() >= 2) {
            head.take(path, i + 1, words[0], words[1]);
        }
    }
    if (!ended) {
        throw sim::SetupError(path + ": has no line end_of_head; expected a gravity field in ICGEM's format (.gfc)");
    }
    if (!head.mu || !head.radius || !head.degree) {
        throw sim::SetupError(path + ": its header lacks " +
                              (!head.mu       ? "earth_gravity_constant"
                               : !head.radius ? "radius"
                                              : "max_degree"));
    }
    return head;
}

HarmonicField parse_icgem(std::string_view text, const std::string &path, std::optional<Epoch> epoch, int wanted)
{
    const auto lines = lines_of(text);
    std::size_t i = 0;
    const IcgemHead head = parse_head(lines, path, i);
    const Promise promise{*head.degree, *head.degree};
    HarmonicField field = empty_field(path, *head.mu, *head.radius, promise.kept(wanted, lines.size()));
    field.name = head.name;
    field.tide_system = head.tide_system;
    IcgemRows rows(path, head, field, promise, epoch);
    for (; i < lines.size(); i++) {
        const auto words = words_of(lines[i]);
        if (!words.empty()) {
            rows.take(words, i + 1);
        }
    }
    rows.finish();
    return field;
}

} // namespace

HarmonicField read_gravity_field(const std::string &path, std::optional<Epoch> epoch, double mu, int degree)
{
    const std::string text = read_whole(path);
    if (text.starts_with("\x1f\x8b") || text.starts_with("PK\3\4")) {
        refuse_file(path, "is compressed; unpack it first, with gunzip or unzip");
    }
    const bool icgem = path.ends_with(".gfc") || text.find("\nend_of_head") != text.npos;
    return icgem ? parse_icgem(text, path, epoch, degree) : parse_shadr(text, path, mu, degree);
}

} // namespace fledge::world
