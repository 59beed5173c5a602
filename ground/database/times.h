// SPDX-License-Identifier: Apache-2.0
// Times of XTCE as [ns] since 1970-01-01T00:00:00 UTC, counted as POSIX does: each day has 86,400 s, and a leap second
// has the same numbers as the second behind it. Before 1972, TAI - UTC is taken as 10 s, as it was then.
#pragma once

#include "ground/database/numbers.h"

namespace fledge::ground {

inline constexpr std::int64_t one_second = 1'000'000'000; // [ns]

/// [ns] since 1970-01-01T00:00:00 of TAI, to UTC and back.
Wide utc_of_tai(Wide tai);
Wide tai_of_utc(Wide utc);

/// Of TAI, GPS, J2000 (2000-01-01T12:00:00 TT), UNIX, POSIX, or a date of UTC. Of a date before 1972, as of UNIX, days
/// of 86,400 s are counted; else all seconds, leap seconds too. Nothing: it is none of these, or behind 2200.
std::optional<Epoch> epoch_of(std::string_view text);

/// "2026-03-01", "2026-03-01T12:00:00.5", with "Z", "+01:00" or nothing behind it: UTC. Nothing: it is no such date.
std::optional<std::int64_t> date_of(std::string_view text);

/// Whether it is such a date within a leap second, as "2016-12-31T23:59:60": it has the number of 1 s later.
bool is_leap_second(std::string_view text);

/// "P1DT2H3M4.5S", "1.5 s", "20 ms": [ns]. Nothing: it is no such duration.
std::optional<std::int64_t> duration_of(std::string_view text);

/// A text as a value of a type of times: a date or a duration.
std::optional<std::int64_t> time_of(const Type &type, std::string_view text);

/// "2026-03-01T12:00:00.5Z" of a time, "1.5" [s] of a duration.
std::string time_text(Kind kind, std::int64_t ns);

/// The same with its unit, as a user may give it: "1.5 s".
std::string time_words(Kind kind, std::int64_t ns);

/// The units of a type's values, as time_text() shows them: "UTC", "s", else those of the database.
std::string unit_of(const Type &type);

} // namespace fledge::ground
