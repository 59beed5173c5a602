// SPDX-License-Identifier: Apache-2.0
#include "world/environment/earth_rotation.h"

#include "flight/math/elementary.h"
#include "sim/error.h"
#include "sim/text.h"
#include "world/constants.h"
#include "world/environment/text_input.h"

#include <erfa.h>

#include <algorithm>
#include <cmath>

namespace fledge::world {

using Eigen::Matrix3d;
using Eigen::RowVector3d;
using Eigen::Vector3d;

namespace {

constexpr double two_pi = 6.28318530717958647692;
constexpr double arcsecond = two_pi / 1'296'000.0;
constexpr std::int64_t day_ns = 86'400'000'000'000;
constexpr double j2000 = 2'451'545.0;           // [d] Julian date
constexpr int mjd_1972 = 41'317;                // since then UTC has whole leap seconds
constexpr double turns_j2000 = 0.7790572732640; // of the Earth rotation angle
constexpr double excess = 0.00273781191135448;  // turns a day of UT1, beyond one
constexpr std::int64_t interval_ns = day_ns / 4;

/// ERFA calls the C library's functions, whose last bits depend on the machine. Those of the values at the knots go
/// here, 6e-14 rad, 0.4 um on the ground, so that a run has the same bits on another machine, unless a value is just at
/// the edge of its rounding.
double without_last_bits(double x)
{
    return std::floor(0x1p44 * x + 0.5) * 0x1p-44;
}

Matrix3d without_last_bits(const double (&dcm)[3][3])
{
    Matrix3d rounded;
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            rounded(i, j) = without_last_bits(dcm[i][j]);
        }
    }
    return rounded;
}

double wrapped(double angle)
{
    return angle - two_pi * std::floor(angle / two_pi + 0.5);
}

enum : int { at_X, at_Y, at_s, at_x, at_y, at_ut1 };

} // namespace

EarthRotation::EarthRotation(const EarthData &data, const TimeSystem &time)
    : theory_(data.theory), time_(time), ut1_tai_(data.ut1_tai), pole_(data.pole)
{
    if (data.eop) {
        read(*data.eop);
    } else if (!ut1_tai_) {
        throw sim::SetupError("the Earth's orientation needs UT1: a file of the IERS, or ut1_tai");
    }
    const auto within = [](const char *what, double found, double most) {
        if (!(std::fabs(found) <= most)) {
            throw sim::SetupError("the Earth's orientation: " + std::string(what) + " must be within +-" +
                                  sim::format_number(most) + "; found " + sim::format_number(found));
        }
    };
    within("ut1_tai [s]", ut1_tai_.value_or(0.0), 200.0);
    for (int i = 0; pole_ && i < 2; i++) {
        within("polar_motion [rad]", (*pole_)[i], 10.0 * arcsecond);
    }
}

/// Lines of days, after lines of text:
///   14 C04   year month day      MJD  x ["]  y ["]  UT1-UTC [s]  LOD [s]  dX ["]  dY ["] ...
///   20 C04   year month day hour MJD  x ["]  y ["]  UT1-UTC [s]  dX ["]   dY ["] ...
void EarthRotation::read(const std::string &path)
{
    file_ = path;
    std::size_t number = 0, columns = 0;
    int last = 0;
    const std::string text = read_whole(path);
    for (const std::string_view line : lines_of(text)) {
        number++;
        const std::vector<std::string_view> words = words_of(line);
        const auto year = words.empty() ? std::nullopt : parse_integer(words[0]);
        if (words.empty() || (!year && days_.empty())) {
            continue;
        }
        const auto refuse = [&](const std::string &what) { refuse_line(path, number, what); };
        std::vector<double> values;
        for (const std::string_view word : words) {
            const auto value = parse_number(word);
            if (!value) {
                refuse("expected a day of EOP C04: numbers only; found \"" + std::string(word) + "\"");
            }
            values.push_back(*value);
        }
        const bool hours = values.size() > 4 && values[3] < 24.0;
        const std::size_t first = hours ? 5 : 4, offsets = first + (hours ? 3 : 4);
        if (values.size() < offsets + 2) {
            refuse("expected a day of EOP C04: date, MJD, x, y, UT1-UTC, LOD, dX, dY; found " +
                   std::to_string(values.size()) + " numbers");
        }
        if (values.size() != columns && columns) {
            refuse("has " + std::to_string(values.size()) + " numbers; the days before have " +
                   std::to_string(columns));
        }
        columns = values.size();
        const double mjd_read = values[first - 1];
        if (!(mjd_read >= 0.0 && mjd_read < 100'000.0) || mjd_read != std::floor(mjd_read) ||
            (hours && values[3] != 0.0)) {
            refuse("expected a whole MJD; found " + sim::format_number(mjd_read));
        }
        const int mjd = static_cast<int>(mjd_read);
        if (last && mjd != last + 1) {
            refuse("expected the day after MJD " + std::to_string(last) + "; found MJD " + std::to_string(mjd));
        }
        last = mjd;
        if (mjd < mjd_1972) {
            continue;
        }
        const Epoch noon{(std::int64_t{mjd - mjd_2000} * day_ns)}; // of that day, TDB: the date by which leaps go
        const CalendarTime date = time_.calendar(noon, TimeScale::tdb);
        if (values[0] != date.year || values[1] != date.month || values[2] != date.day) {
            refuse("the date is not that of MJD " + std::to_string(mjd));
        }
        const double tai_utc =
            time_.tai_minus_utc(time_.epoch({date.year, date.month, date.day, 0, 0, 0, 0}, TimeScale::utc));
        Day read{};
        read.tai = std::int64_t{mjd - mjd_2000} * day_ns - day_ns / 2 + static_cast<std::int64_t>(tai_utc * 1e9);
        read.measured = {values[first + 2] - tai_utc, values[first] * arcsecond, values[first + 1] * arcsecond,
                         values[offsets] * arcsecond, values[offsets + 1] * arcsecond};
        const auto within = [&](const char *what, double found, double most) {
            if (!(std::fabs(found) <= most)) {
                refuse(std::string(what) + " is " + sim::format_number(found) + "; expected at most " +
                       sim::format_number(most));
            }
        };
        within("x [arcsec]", values[first], 2.0);
        within("y [arcsec]", values[first + 1], 2.0);
        within("UT1-UTC [s]", values[first + 2], 1.0);
        within("dX [arcsec]", values[offsets], 0.02);
        within("dY [arcsec]", values[offsets + 1], 0.02);
        if (!days_.empty()) {
            const Measured &before = days_.back().measured;
            within("the change of UT1-TAI in a day [s] (do the leap seconds fit?)",
                   read.measured.ut1_tai - before.ut1_tai, 0.01);
            within("the change of x in a day [arcsec]", (read.measured.x - before.x) / arcsecond, 0.1);
            within("the change of y in a day [arcsec]", (read.measured.y - before.y) / arcsecond, 0.1);
        }
        days_.push_back(read);
    }
    if (days_.size() < 4) {
        throw sim::SetupError(path + ": has " + std::to_string(days_.size()) + " days of EOP C04 since 1972; " +
                              "expected at least 4: a file of the IERS, as eopc04.1962-now");
    }
}

void EarthRotation::require(Epoch from, Epoch to) const
{
    if (days_.empty()) {
        return;
    }
    const auto covers = [&](Epoch epoch) {
        const std::int64_t tai = time_.tai(epoch);
        return tai >= days_.front().tai && tai <= days_.back().tai;
    };
    for (const Epoch &epoch : {from, to}) {
        if (!covers(epoch)) {
            throw sim::SetupError(file_ + ": the Earth's orientation is given from " +
                                  time_.text(time_.from_tai(days_.front().tai)) + " to " +
                                  time_.text(time_.from_tai(days_.back().tai)) + "; asked for at " + time_.text(epoch));
        }
    }
}

EarthRotation::Measured EarthRotation::measured(Epoch epoch) const
{
    Measured sum;
    if (!days_.empty()) {
        const std::int64_t tai = time_.tai(epoch);
        const auto after =
            std::upper_bound(days_.begin(), days_.end(), tai, [](std::int64_t t, const Day &d) { return t < d.tai; });
        const auto first =
            std::clamp(after - days_.begin() - 2, std::ptrdiff_t{0}, static_cast<std::ptrdiff_t>(days_.size()) - 4);
        const Day *knots = &days_[static_cast<std::size_t>(first)];
        for (int i = 0; i < 4; i++) {
            double weight = 1.0;
            for (int k = 0; k < 4; k++) {
                if (k != i) {
                    weight *=
                        static_cast<double>(tai - knots[k].tai) / static_cast<double>(knots[i].tai - knots[k].tai);
                }
            }
            const Measured &at = knots[i].measured;
            sum.ut1_tai += weight * at.ut1_tai;
            sum.x += weight * at.x;
            sum.y += weight * at.y;
            sum.dX += weight * at.dX;
            sum.dY += weight * at.dY;
        }
    }
    sum.ut1_tai = ut1_tai_.value_or(sum.ut1_tai);
    if (pole_) {
        sum.x = (*pole_)[0];
        sum.y = (*pole_)[1];
    }
    return sum;
}

std::optional<Eigen::Vector2d> EarthRotation::pole(Epoch epoch) const
{
    if (!pole_ && days_.empty()) {
        return {};
    }
    const Measured now = measured(epoch);
    return Eigen::Vector2d(now.x, now.y);
}

EarthRotation::Values EarthRotation::knot(Epoch epoch) const
{
    const Measured now = measured(epoch);
    const double tt = static_cast<double>(time_.tt(epoch)) / static_cast<double>(day_ns); // [d] past J2000
    const auto tai_ns = static_cast<double>(time_.tai(epoch));
    const double ut1 = (tai_ns / 1e9 + now.ut1_tai) / day_s;
    double X, Y, s;
    if (theory_ == EarthData::Theory::iau2006) {
        eraXys06a(j2000, tt, &X, &Y, &s);
        X += now.dX;
        Y += now.dY;
        s -= eraSp00(j2000, tt);
    } else {
        double to_date[3][3];
        eraPnm80(j2000, tt, to_date);
        X = to_date[2][0];
        Y = to_date[2][1];
        // So that R3(theta - s) M is R3(sidereal time) times precession and nutation.
        s = wrapped(eraEra00(j2000, ut1) - eraGmst82(j2000, ut1) - eraEqeq94(j2000, tt) - eraEors(to_date, 0.0));
    }
    Values values;
    values << without_last_bits(X), without_last_bits(Y), without_last_bits(s), now.x, now.y,
        now.ut1_tai - static_cast<double>(epoch.ns - time_.tai(epoch)) / 1e9;
    return values;
}

/// The differences of the interval that holds the instant, and where in it the instant is, 0 to 1.
const EarthRotation::Values *EarthRotation::move(Window &window, Epoch epoch, double tau, double &u) const
{
    const std::int64_t ns = epoch.ns + static_cast<std::int64_t>(1e9 * tau);
    const std::int64_t interval = ns / interval_ns - (ns % interval_ns < 0);
    if (interval != window.interval) {
        Values knots[6];
        for (std::int64_t i = 0; i < 6; i++) {
            const std::int64_t before = interval + i - window.interval;
            const bool known = before >= 0 && before < 6;
            knots[i] = known ? window.knots[before] : knot({(interval + i - 2) * interval_ns});
        }
        std::copy(knots, knots + 6, window.knots);
        for (int order = 1; order < 6; order++) { // now Newton's divided differences
            for (int i = 5; i >= order; i--) {
                knots[i] = (knots[i] - knots[i - 1]) / order;
            }
        }
        std::copy(knots, knots + 6, window.differences);
        window.interval = interval;
    }
    u = (static_cast<double>(epoch.ns - interval * interval_ns) + 1e9 * tau) / static_cast<double>(interval_ns);
    return window.differences;
}

namespace {

/// Newton's form, with knots at -2 to 3.
EarthRotation::Values evaluate(const EarthRotation::Values *d, double u)
{
    return d[0] + (u + 2.0) * (d[1] + (u + 1.0) * (d[2] + u * (d[3] + (u - 1.0) * (d[4] + (u - 2.0) * d[5]))));
}

/// Its derivative by u.
EarthRotation::Values slope(const EarthRotation::Values *d, double u)
{
    EarthRotation::Values value = d[5], change = EarthRotation::Values::Zero();
    for (int i = 4; i >= 0; i--) {
        const double factor = u - (i - 2);
        change = value + factor * change;
        value = d[i] + factor * value;
    }
    return change;
}

/// R3(theta - s).
struct Turn {
    double s, c;
};

Turn turn(Epoch epoch, double tau, const EarthRotation::Values &values)
{
    // Whole days and the rest: the angle turns fast, and keeps its resolution so.
    const std::int64_t days = epoch.ns / day_ns;
    const double rest = (static_cast<double>(epoch.ns - days * day_ns) / 1e9 + tau + values[at_ut1]) / day_s;
    const double turns = turns_j2000 + excess * (static_cast<double>(days) + rest) + rest;
    Turn turn;
    fm_sincos(two_pi * (turns - std::floor(turns)) - values[at_s], &turn.s, &turn.c);
    return turn;
}

/// Of an angle so small that its cube hardly matters.
double small_sin(double x)
{
    return x * (1.0 - x * x / 6.0);
}

double small_cos(double x)
{
    return 1.0 - 0.5 * x * x;
}

Matrix3d to_pole(double X, double Y)
{
    const double Z = std::sqrt(1.0 - X * X - Y * Y), a = 1.0 / (1.0 + Z);
    Matrix3d M;
    M << 1.0 - a * X * X, -a * X * Y, -X, -a * X * Y, 1.0 - a * Y * Y, -Y, X, Y, Z;
    return M;
}

Matrix3d assemble(const EarthRotation::Values &values, const Turn &turn)
{
    const Matrix3d M = to_pole(values[at_X], values[at_Y]);
    const double sx = small_sin(values[at_x]), cx = small_cos(values[at_x]);
    const double sy = small_sin(values[at_y]), cy = small_cos(values[at_y]);
    const RowVector3d first = turn.c * M.row(0) + turn.s * M.row(1);
    const RowVector3d second = turn.c * M.row(1) - turn.s * M.row(0);
    const RowVector3d third = cx * M.row(2) - sx * first;
    Matrix3d dcm;
    dcm.row(0) = cx * first + sx * M.row(2);
    dcm.row(1) = cy * second - sy * third;
    dcm.row(2) = sy * second + cy * third;
    return dcm;
}

} // namespace

Matrix3d EarthRotation::dcm_PN(Epoch epoch, double tau, Window &window) const
{
    double u;
    const Values *differences = move(window, epoch, tau, u);
    const Values values = evaluate(differences, u);
    return assemble(values, turn(epoch, tau, values));
}

BodyAttitude EarthRotation::at(Epoch epoch, double tau, Window &window) const
{
    double u;
    const Values *differences = move(window, epoch, tau, u);
    const Values values = evaluate(differences, u);
    const Values rates = slope(differences, u) / (static_cast<double>(interval_ns) / 1e9);
    const auto [s, c] = turn(epoch, tau, values);
    BodyAttitude attitude;
    attitude.dcm_PN = assemble(values, {s, c});

    // The rate of the celestial pole's frame, then of each turn that follows, each time in the frame it leads to.
    const double X = values[at_X], Y = values[at_Y], dX = rates[at_X], dY = rates[at_Y];
    const Matrix3d M = to_pole(X, Y);
    const RowVector3d pole(dX, dY, -(X * dX + Y * dY) / M(2, 2));
    const double w1 = -pole.dot(M.row(1)), w2 = pole.dot(M.row(0)), w3 = (dX * Y - X * dY) / (1.0 + M(2, 2));
    const double spin = two_pi * (1.0 + excess) / day_s * (1.0 + rates[at_ut1]) - rates[at_s];
    const Vector3d turned(c * w1 + s * w2, c * w2 - s * w1, w3 + spin);
    const double sx = small_sin(values[at_x]), cx = small_cos(values[at_x]);
    const double sy = small_sin(values[at_y]), cy = small_cos(values[at_y]);
    const Vector3d tilted(cx * turned[0] + sx * turned[2], turned[1] - rates[at_x], cx * turned[2] - sx * turned[0]);
    attitude.omega_PN_P =
        Vector3d(tilted[0] - rates[at_y], cy * tilted[1] - sy * tilted[2], sy * tilted[1] + cy * tilted[2]);
    return attitude;
}

Matrix3d true_of_date(EarthData::Theory theory, const TimeSystem &time, Epoch epoch)
{
    const double tt = static_cast<double>(time.tt(epoch)) / static_cast<double>(day_ns);
    double to_date[3][3];
    (theory == EarthData::Theory::iau2006 ? eraPnm06a : eraPnm80)(j2000, tt, to_date);
    return without_last_bits(to_date);
}

Matrix3d teme_of_date(const TimeSystem &time, Epoch epoch)
{
    const double tt = static_cast<double>(time.tt(epoch)) / static_cast<double>(day_ns);
    double dpsi, deps, to_date[3][3];
    eraNut80(j2000, tt, &dpsi, &deps);
    eraPnm80(j2000, tt, to_date);
    eraRz(dpsi * std::cos(eraObl80(j2000, tt)), to_date);
    return without_last_bits(to_date);
}

} // namespace fledge::world
