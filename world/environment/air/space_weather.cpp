// SPDX-License-Identifier: Apache-2.0
#include "world/environment/air/space_weather.h"

#include "sim/error.h"
#include "world/environment/air/space_weather_files.h"

#include <algorithm>
#include <cmath>
#include <iterator>

namespace fledge::world {

namespace {

using Day = SpaceWeather::Day;
using Jb2008Day = SpaceWeather::Jb2008Day;

/// ap of Kp = 0, 1/3, 2/3, ... 9.
constexpr double ap_of_thirds[] = {0,  2,  3,  4,  5,  6,  7,   9,   12,  15,  18,  22,  27,  32,
                                   39, 48, 56, 67, 80, 94, 111, 132, 154, 179, 207, 236, 300, 400};

void fill(double &value, double from)
{
    if (std::isnan(value)) {
        value = from;
    }
}

void fill(Day &day, const Day &from)
{
    fill(day.F107, from.F107);
    fill(day.mean_81, from.mean_81);
    fill(day.Ap, from.Ap);
    for (std::size_t k = 0; k < 8; k++) {
        fill(day.ap[k], from.ap[k]);
        fill(day.kp[k], from.kp[k]);
    }
}

void fill(Jb2008Day &day, const Jb2008Day &from)
{
    for (Jb2008Day::Flux Jb2008Day::*const flux :
         {&Jb2008Day::F10, &Jb2008Day::S10, &Jb2008Day::M10, &Jb2008Day::Y10}) {
        fill((day.*flux).of_day, (from.*flux).of_day);
        fill((day.*flux).mean, (from.*flux).mean);
    }
    for (std::size_t k = 0; k < 24; k++) {
        fill(day.storm[k], from.storm[k]);
    }
}

template <class D> void merge(SpaceWeather::Series<D> &into, const SpaceWeather::Series<D> &from)
{
    for (int mjd = from.first; mjd < from.end(); mjd++) {
        fill(into.make(mjd), *from.find(mjd));
    }
}

/// Of F10.7 over the days around, those at both ends with a weight; unknown if fewer than half are there.
double mean_flux(const SpaceWeather::Series<Day> &series, int mjd, int reach, double end)
{
    double sum = 0.0, weights = 0.0;
    for (int i = -reach; i <= reach; i++) {
        const Day *day = series.find(mjd + i);
        if (day && !std::isnan(day->F107)) {
            const double weight = std::abs(i) == reach ? end : 1.0;
            sum += weight * day->F107;
            weights += weight;
        }
    }
    return weights >= reach - 0.5 + end ? sum / weights : SpaceWeather::unknown;
}

const char *name_of(AirLaw law)
{
    switch (law) {
    case AirLaw::nrlmsise00: return "NRLMSISE-00";
    case AirLaw::jb2008: return "JB2008";
    case AirLaw::dtm2000: return "DTM2000";
    case AirLaw::met: break;
    }
    return "MET";
}

/// What a law misses; null if nothing.
const char *lack(const SolarActivity &a, AirLaw law)
{
    if (law == AirLaw::jb2008) {
        if (std::isnan(a.storm_temperature)) {
            return "storm temperature (DTCFILE.TXT)";
        }
        const double sum =
            a.F10_jb + a.F107_average + a.S10 + a.S10_average + a.M10 + a.M10_average + a.Y10 + a.Y10_average;
        return std::isnan(sum) ? "F10, S10, M10 and Y10 of 1, 1, 2 and 5 days before (SOLFSMY.TXT)" : nullptr;
    }
    if (std::isnan(a.F107)) {
        return "F10.7 of the day before";
    }
    if (std::isnan(a.F107_average)) {
        return law == AirLaw::met ? "mean F10.7 of 162 days (half of them)" : "mean F10.7 of 81 days (41 of them)";
    }
    switch (law) {
    case AirLaw::nrlmsise00:
        return std::any_of(a.ap.begin(), a.ap.end(), [](double ap) { return std::isnan(ap); })
                   ? "ap of the day and of the 57 h before"
                   : nullptr;
    case AirLaw::dtm2000: return std::isnan(a.kp_before + a.kp_average) ? "Kp of the 24 h before" : nullptr;
    default: return std::isnan(a.ap_before) ? "ap of 6.7 h before" : nullptr;
    }
}

} // namespace

double kp_of_ap(double ap)
{
    const double *next = std::upper_bound(std::begin(ap_of_thirds), std::end(ap_of_thirds), ap);
    if (std::isnan(ap) || next == std::begin(ap_of_thirds)) {
        return ap - ap; // 0 at most, or NaN
    }
    if (next == std::end(ap_of_thirds)) {
        return 9.0;
    }
    return (static_cast<double>(next - 1 - ap_of_thirds) + (ap - next[-1]) / (next[0] - next[-1])) / 3.0;
}

double ap_of_kp(double kp)
{
    return std::isnan(kp) ? kp : ap_of_thirds[static_cast<std::size_t>(std::lround(3.0 * kp))];
}

SpaceWeather::Day::Day()
{
    ap.fill(unknown);
    kp.fill(unknown);
}

void SpaceWeather::Day::set_ap(double all)
{
    Ap = all;
    ap.fill(all);
    kp.fill(kp_of_ap(all));
}

SpaceWeather::Jb2008Day::Jb2008Day()
{
    storm.fill(unknown);
}

template <class D> D &SpaceWeather::Series<D>::make(int mjd)
{
    if (days.empty()) {
        first = mjd;
    }
    if (mjd < first) {
        days.insert(days.begin(), static_cast<std::size_t>(first - mjd), D());
        first = mjd;
    }
    days.resize(std::max(days.size(), static_cast<std::size_t>(mjd - first) + 1));
    return days[static_cast<std::size_t>(mjd - first)];
}

template Day &SpaceWeather::Series<Day>::make(int);
template Jb2008Day &SpaceWeather::Series<Jb2008Day>::make(int);

SpaceWeather::SpaceWeather(const std::vector<std::string> &paths, const TimeSystem &time) : time_(time), paths_(paths)
{
    if (paths.empty()) {
        throw sim::SetupError("the activity of the Sun needs a file of indices, as CelesTrak's SW-All.csv");
    }
    for (const std::string &path : paths) {
        const Activity read = read_activity(path);
        merge(all_.indices, read.indices);
        merge(all_.jb2008, read.jb2008);
        files_ += (files_.empty() ? "" : ", ") + path;
    }
    for (int mjd = all_.indices.first; mjd < all_.indices.end(); mjd++) {
        Day &day = all_.indices.make(mjd);
        fill(day.mean_81, mean_flux(all_.indices, mjd, 40, 1.0));
        day.mean_162 = mean_flux(all_.indices, mjd, 81, 0.5);
    }
}

double SpaceWeather::mjd(Epoch epoch) const
{
    const CalendarTime utc = time_.calendar(epoch, TimeScale::utc);
    const double seconds = 3600.0 * utc.hour + 60.0 * utc.minute + utc.second + 1e-9 * utc.nanosecond;
    return *mjd_of(utc.year, utc.month, utc.day) + std::min(seconds, 86'399.999'999) / 86'400.0;
}

SolarActivity SpaceWeather::at(Epoch epoch, AirLaw law) const
{
    return at(mjd(epoch), law);
}

SolarActivity SpaceWeather::at(double mjd, AirLaw law) const
{
    static const Day no_day;
    static const Jb2008Day no_jb2008_day;
    const auto day = [&](int d) -> const Day & { return all_.indices.find(d) ? *all_.indices.find(d) : no_day; };
    mjd = mjd > 100.0 ? std::min(mjd, 1e6) : 100.0; // where no file has days
    const auto jb = [&](int d) -> const Jb2008Day & {
        return all_.jb2008.find(d) ? *all_.jb2008.find(d) : no_jb2008_day;
    };
    const int today = static_cast<int>(std::floor(mjd)), now = static_cast<int>(std::floor(8.0 * mjd));
    const auto ap = [&](int k) { return day(k / 8).ap[static_cast<std::size_t>(k % 8)]; };
    const auto kp = [&](int k) { return day(k / 8).kp[static_cast<std::size_t>(k % 8)]; };
    const auto mean = [&](const auto &index, int first, int last) { // `first` to `last` times 3 h before
        double sum = 0.0;
        for (int k = first; k <= last; k++) {
            sum += index(now - k);
        }
        return sum / (last - first + 1);
    };
    SolarActivity a;
    a.F107 = day(today - 1).F107;
    a.F107_average = law == AirLaw::met      ? day(today).mean_162
                     : law == AirLaw::jb2008 ? jb(today - 1).F10.mean
                                             : day(today).mean_81;
    a.ap = {day(today).Ap, ap(now), ap(now - 1), ap(now - 2), ap(now - 3), mean(ap, 4, 11), mean(ap, 12, 19)};
    a.ap_before = ap(static_cast<int>(std::floor(8.0 * (mjd - 6.7 / 24.0))));
    a.kp_before = kp(now - 1);
    a.kp_average = mean(kp, 1, 8);
    a.F10_jb = jb(today - 1).F10.of_day;
    a.S10 = jb(today - 1).S10.of_day;
    a.S10_average = jb(today - 1).S10.mean;
    a.M10 = jb(today - 2).M10.of_day;
    a.M10_average = jb(today - 2).M10.mean;
    a.Y10 = jb(today - 5).Y10.of_day;
    a.Y10_average = jb(today - 5).Y10.mean;
    const double hours = 24.0 * mjd;
    const int hour = static_cast<int>(std::floor(hours));
    const auto storm = [&](int h) { return jb(h / 24).storm[static_cast<std::size_t>(h % 24)]; };
    a.storm_temperature = storm(hour) + (hours - hour) * (storm(hour + 1) - storm(hour));
    return a;
}

std::optional<std::string> SpaceWeather::missing(Epoch from, Epoch to, AirLaw law) const
{
    constexpr std::int64_t three_hours = 10'800'000'000'000;
    const std::int64_t end = time_.tai(to);
    for (std::int64_t tai = time_.tai(from);; tai = std::min(tai + three_hours, end)) {
        const Epoch epoch = time_.from_tai(tai);
        if (const char *what = lack(at(epoch, law), law)) {
            return std::string(what) + " at " + time_.text(epoch);
        }
        if (tai >= end) {
            return {};
        }
    }
}

void SpaceWeather::require(Epoch from, Epoch to, AirLaw law) const
{
    const auto what = missing(from, to, law);
    if (!what) {
        return;
    }
    std::string has;
    const auto days = [&](const auto &series, const char *name) {
        if (!series.days.empty()) {
            has += (has.empty() ? "" : ", ") + std::string(name) + " from " + date_text(series.first) + " to " +
                   date_text(series.end() - 1);
        }
    };
    days(all_.indices, "F10.7, Kp or ap");
    days(all_.jb2008, "indices of JB2008");
    throw sim::SetupError(files_ + ": " + name_of(law) + " needs the " + *what + ", which is not there; found " + has +
                          ": give a file with these days, besides or instead, or change the dates of the run");
}

} // namespace fledge::world
