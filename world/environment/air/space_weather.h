// SPDX-License-Identifier: Apache-2.0
// Files of the Sun's and the magnetic field's activity, and what each law of the air takes of them at an instant:
//
//   all but JB2008   F10.7 of the day before, as observed, not as adjusted to 1 au
//   NRLMSISE-00      mean F10.7 of 81 days, the day in their middle; the day's ap; ap of the 3 h now, and 3, 6 and 9 h
//                    before; means of the eight ap from 12 to 33 h and from 36 to 57 h before
//   DTM2000          the same mean F10.7; Kp of the 3 h before; mean of the eight Kp from 3 to 24 h before
//   MET              mean F10.7 of 162 days, the day in their middle; ap 6.7 h before, as Jacchia 1971
//   JB2008           by SOLFSMY: F10.7 and S10 with their means 1 day before, M10 2 days, Y10 5 days before;
//                    by DTCFILE: the storm's temperature, linear between the hours
//
// Days and hours are of UTC. Forms, recognised by their content:
//   CelesTrak        SW-All.csv, SW-All.txt, SW-Last5Years likewise: observed, predicted by day and by month (linear
//                    between the months), with means of 81 days
//   GFZ              Kp_ap_Ap_SN_F107_since_1932.txt, and the nowcast's
//   NOAA             45-day-ap-forecast.txt, of one ap a day
//   NOAA, daily      DSD.txt with F10.7 and DGD.txt with the estimated planetary A and K, together; those of a quarter
//                    or a year likewise
//   SET              SOLFSMY.TXT and DTCFILE.TXT, together
// Means that a file does not have are of those days that are there, at least half.
// Sources: the headers of the files; Picone et al. 2002; Bruinsma, Thuillier and Barlier 2003; Bowman et al. 2008.
#pragma once

#include "world/environment/air/air.h"
#include "world/environment/timescale.h"

#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace fledge::world {

enum class AirLaw { nrlmsise00, jb2008, dtm2000, met };

/// Kp by ap: between the 28 pairs of their definition linear.
double kp_of_ap(double ap);

/// ap by the third next to Kp, which is from 0 to 9, or NaN.
double ap_of_kp(double kp);

/// Immutable: clones and threads share it.
class SpaceWeather {
public:
    /// What several files have counts as in the first of them. Throws SetupError with file and line on a form that is
    /// unknown or damaged, on days out of order or left out, on values out of range.
    SpaceWeather(const std::vector<std::string> &paths, const TimeSystem &time);

    /// NaN where the files have nothing. `history` is left to the caller.
    SolarActivity at(Epoch epoch, AirLaw law) const;
    SolarActivity at(double mjd, AirLaw law) const; ///< [days] of UTC

    /// Whether the files have all that the law needs at from, to and between.
    bool covers(Epoch from, Epoch to, AirLaw law) const { return !missing(from, to, law); }

    /// Throws SetupError, with what is missing first and what to do, if they have not.
    void require(Epoch from, Epoch to, AirLaw law) const;

    /// For messages.
    const std::string &files() const { return files_; } ///< for messages
    const std::vector<std::string> &paths() const { return paths_; }

    static constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

    /// Of a day of UTC, in solar flux units.
    struct Day {
        Day();
        void set_ap(double all); ///< for the day and each 3 h of it, and Kp by it
        double F107 = unknown, mean_81 = unknown, mean_162 = unknown, Ap = unknown;
        std::array<double, 8> ap, kp;
    };

    /// Likewise, of JB2008's files: the fluxes, their means, and each hour's storm temperature [K].
    struct Jb2008Day {
        Jb2008Day();
        struct Flux {
            double of_day = unknown, mean = unknown;
        } F10, S10, M10, Y10;
        std::array<double, 24> storm;
    };

    /// Consecutive days from MJD `first` on.
    template <class D> struct Series {
        int first = 0;
        std::vector<D> days;

        int end() const { return first + static_cast<int>(days.size()); }
        const D *find(int mjd) const
        {
            return mjd >= first && mjd < end() ? &days[static_cast<std::size_t>(mjd - first)] : nullptr;
        }
        D &make(int mjd); ///< a day of it, with the days between
    };

    struct Activity {
        Series<Day> indices;
        Series<Jb2008Day> jb2008;
    };

private:
    std::optional<std::string> missing(Epoch from, Epoch to, AirLaw law) const;
    double mjd(Epoch epoch) const;

    TimeSystem time_;
    std::string files_;
    std::vector<std::string> paths_;
    Activity all_;
};

} // namespace fledge::world
