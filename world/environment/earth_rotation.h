// SPDX-License-Identifier: Apache-2.0
// How the Earth stands in N: precession and nutation by a theory of the IAU, UT1 and the motion of the pole as the
// IERS measured them. P is the International Terrestrial Reference System.
//
//   [PN] = R1(-y) R2(-x) R3(theta - s) M(X, Y)
//
// M takes n3 to the celestial pole (X, Y) by the shortest way, s places the origin of longitudes on its equator,
// theta is the Earth rotation angle, linear in UT1, and (x, y) is the celestial pole on the Earth.
//
//   iau2006   precession IAU 2006, nutation IAU 2000A, with the measured offsets dX and dY; N is the ICRF.
//   iau1980   precession IAU 1976, nutation IAU 1980, sidereal time 1982/94, without offsets, for comparison with
//             older tools: as they do, it takes N as the mean equator and equinox of J2000.
//
// Not there: the tides of the oceans in UT1 and in the pole, 3 cm on the ground.
// Sources: IERS Conventions (2010), chapter 5; the theories themselves are the library ERFA's.
#pragma once

#include "world/environment/body_attitude.h"
#include "world/environment/timescale.h"

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace fledge::world {

/// Where the Earth rotation comes from: a file of the IERS, or numbers, which also replace those of a file.
struct EarthData {
    enum class Theory { iau2006, iau1980 };

    Theory theory = Theory::iau2006;
    std::optional<std::string> eop;      ///< a file of the series EOP 14 C04 or 20 C04, with dX and dY
    std::optional<double> ut1_tai;       ///< [s] UT1 - TAI
    std::optional<Eigen::Vector2d> pole; ///< [rad] x and y; without it and without a file: 0
};

class EarthRotation {
public:
    /// Throws SetupError with file and line if the file is damaged, and if UT1 is not given at all.
    EarthRotation(const EarthData &data, const TimeSystem &time);

    /// What changes slowly: X, Y, s, x, y [rad] and UT1 - TDB [s].
    static constexpr int slow = 6;
    using Values = Eigen::Array<double, slow, 1>;

    /// Polynomials of degree 5 through the values at six instants, 6 h apart. One per caller: a step of the
    /// integrator costs one evaluation of them, and the theory is evaluated once in 6 h.
    class Window {
        friend class EarthRotation;
        std::int64_t interval = std::numeric_limits<std::int32_t>::min(); ///< none: 4 a day, 1708 to 2291
        Values knots[6], differences[6];
    };

    BodyAttitude at(Epoch epoch, double tau, Window &window) const;
    Eigen::Matrix3d dcm_PN(Epoch epoch, double tau, Window &window) const;

    /// Throws SetupError unless the file has all instants from, to.
    void require(Epoch from, Epoch to) const;

    /// [s] UT1 - TAI, [rad] x and y of the pole, dX and dY: interpolated between the days (Lagrange, 4 points).
    struct Measured {
        double ut1_tai = 0.0, x = 0.0, y = 0.0, dX = 0.0, dY = 0.0;
    };
    Measured measured(Epoch epoch) const;

    /// [rad] x and y of the pole, where a file or `pole` gives them.
    std::optional<Eigen::Vector2d> pole(Epoch epoch) const;

private:
    struct Day {
        std::int64_t tai; ///< [ns] past 2000-01-01T12:00:00 TAI
        Measured measured;
    };

    void read(const std::string &path);
    Values knot(Epoch epoch) const;
    const Values *move(Window &window, Epoch epoch, double tau, double &u) const;

    EarthData::Theory theory_;
    TimeSystem time_;
    std::string file_;
    std::vector<Day> days_;
    std::optional<double> ut1_tai_;
    std::optional<Eigen::Vector2d> pole_;
};

/// Maps N to the Earth's true equator and equinox of date, by precession and nutation alone.
Eigen::Matrix3d true_of_date(EarthData::Theory theory, const TimeSystem &time, Epoch epoch);

/// Maps N to TEME, the Earth's true equator and mean equinox of date, in which two-line elements are, by IAU 1976/1980.
Eigen::Matrix3d teme_of_date(const TimeSystem &time, Epoch epoch);

} // namespace fledge::world
