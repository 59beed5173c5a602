// SPDX-License-Identifier: Apache-2.0
// Instants and the scales that date them: UTC, TAI, TT, TDB, and the time of GPS.
//
//   TAI = UTC + leap seconds          a whole number of seconds since 1972
//   TT  = TAI + 32.184 s
//   GPS = TAI - 19 s
//   TDB = TT + K sin E,  E = M + e sin M,  M = M0 + M1 t        (t: TT past J2000)
//
// The last is the model of SPICE's leap-seconds kernels: within 30 us of the full theory (Moyer
// 1981), 0.9 m of the Earth's way around the Sun. All else is exact in integer nanoseconds.
// Rounding TDB - TT to a nanosecond makes a round trip through TDB exact but for 1 ns at one
// instant in 3e9.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace fledge::world {

/// An instant: integer nanoseconds of TDB past J2000, which is 2000-01-01T12:00:00 TDB.
/// It reaches from 1708 to 2291.
struct Epoch {
    std::int64_t ns = 0;

    /// [s] TDB past J2000; rounded to 60 ns or so far from J2000.
    double seconds() const { return static_cast<double>(ns) / 1e9; }

    friend bool operator==(const Epoch &, const Epoch &) = default;
    friend auto operator<=>(const Epoch &, const Epoch &) = default;
};

enum class TimeScale { utc, tai, tt, tdb, gps };

/// What a clock on a wall shows, in the Gregorian calendar (also before its introduction).
struct CalendarTime {
    int year = 2000, month = 1, day = 1;
    int hour = 0, minute = 0, second = 0; ///< second is 60 during a leap second
    std::int32_t nanosecond = 0;

    friend bool operator==(const CalendarTime &, const CalendarTime &) = default;
};

inline constexpr int mjd_2000 = 51'544; ///< [d] Modified Julian date of 2000-01-01

/// [d] Modified Julian date of a day of the Gregorian calendar; none if there is no such day.
std::optional<int> mjd_of(int year, int month, int day);

/// "2015-03-02" of a Modified Julian date.
std::string date_text(int mjd);

/// "2015-03-02T12:00:00 TDB" for [s] TDB past J2000, any year; to the second below, for messages.
std::string format_tdb(double seconds);

/// Leap seconds, and what relates TDB to TT.
class TimeSystem {
public:
    /// Leap seconds from IERS Bulletin C: 1972 to the one at the end of 2016, TAI - UTC = 37 s.
    /// None has been announced since.
    TimeSystem();

    /// From a SPICE leap-seconds kernel (.tls). Throws SetupError with file and line if it is
    /// damaged. Where it ends before a leap second that is built in, UTC from that one on throws SetupError.
    static TimeSystem read(const std::string &path);

    /// From "2015-03-02T12:00:00", "2015-03-02 12:00:00.5 TDB", "2016-12-31T23:59:60Z",
    /// "2015-03-02". The scale is UTC (also "Z", " UTC") unless " TAI", " TT", " TDB" or " GPS" follows.
    /// Throws SetupError on a time that is none, on UTC before 1972, on years outside 1709 to 2291.
    Epoch epoch(std::string_view text) const;
    Epoch epoch(const CalendarTime &time, TimeScale scale) const;

    /// Throws SetupError for UTC before 1972.
    CalendarTime calendar(Epoch epoch, TimeScale scale) const;

    /// As `epoch` reads it, with as many digits as needed: "2016-12-31T23:59:60Z", "... TDB".
    std::string text(Epoch epoch, TimeScale scale = TimeScale::utc) const;

    /// [ns] of TAI and of TT past 2000-01-01T12:00:00 on their own scale, and back.
    std::int64_t tt(Epoch epoch) const;
    std::int64_t tai(Epoch epoch) const { return tt(epoch) - tt_minus_tai_; }
    Epoch from_tt(std::int64_t tt) const;
    Epoch from_tai(std::int64_t tai) const { return from_tt(tai + tt_minus_tai_); }

    /// [ns] of GPS past 1980-01-06T00:00:00, when its weeks began to count.
    std::int64_t gps(Epoch epoch) const;

    /// [s] TAI - UTC. Throws SetupError before 1972.
    int tai_minus_utc(Epoch epoch) const;

private:
    struct Step {
        std::int64_t day;  ///< days past 2000-01-01, from whose beginning on
        int tai_minus_utc; ///< [s]

        std::int64_t begin() const; ///< as TAI
    };

    const Step *step_at(std::int64_t tai) const;
    [[noreturn]] void refuse_missing() const;
    std::int64_t tdb_minus_tt(std::int64_t tt) const;

    std::vector<Step> steps_;
    std::optional<Step> missing_;                ///< the first one that is built in and not in the file
    std::string path_;                           ///< of the file
    std::int64_t tt_minus_tai_ = 32'184'000'000; ///< [ns]
    double K_ = 1.657e-3;                        ///< [s]     amplitude of TDB - TT
    double e_ = 1.671e-2;                        ///< [-]     eccentricity of the Earth's orbit
    double M0_ = 6.239996;                       ///< [rad]   its mean anomaly at J2000
    double M1_ = 1.99096871e-7;                  ///< [rad/s] and the rate of that
};

} // namespace fledge::world
