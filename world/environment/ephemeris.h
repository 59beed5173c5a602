// SPDX-License-Identifier: Apache-2.0
// Where the bodies of the solar system are: JPL's DE405 and SPICE SPK kernels, behind one interface.
//
//   Ephemeris ephemeris;
//   ephemeris.add_de405();                       // the Sun, the planets, the Moon, 1960 to 2060
//   ephemeris.add_spk("jup365.bsp");             // added later, so read first
//   ephemeris.require(sun, mars, begin, end);    // SetupError unless it is all there
//   Ephemeris::Cursor cursor;                    // one per caller
//   Vector3d r = ephemeris.position(sun, mars, begin, tau, cursor);
//
// Both sources hold segments, most of them Chebyshev polynomials over equal intervals, each of a body
// relative to another, its centre. Bodies and centres form a tree; the state of any body relative to any
// other is summed along the way through it, from each of the two up to where their ways meet. Where several
// segments hold a body at an instant, the one counts that was loaded last, and in a file the last,
// as in SPICE.
//
// Axes are those of the ICRF, which the ephemerides take as J2000. Nothing is corrected for light
// time.
#pragma once

#include "world/environment/timescale.h"

#include <Eigen/Core>

#include <cstddef>
#include <deque>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace fledge::world {

/// A body relative to another, ICRF axes.
struct BodyState {
    Eigen::Vector3d r; ///< [m]
    Eigen::Vector3d v; ///< [m/s]
    Eigen::Vector3d a; ///< [m/s^2]
};

/// One body relative to another over a span of time, by records: Chebyshev polynomials over consecutive
/// intervals of equal length, or states and differences, see spk_types.h. A record of polynomials holds the
/// middle and half the length of its interval [s], then the coefficients of x, y, z [km], then, if the
/// velocity has its own, those of vx, vy, vz [km/s].
struct EphemerisSegment {
    enum class Method { chebyshev, differences, conics, lagrange, hermite, hermite_of_both };
    static constexpr int most_nodes = 28; ///< of a polynomial through states, those twice of Hermite's

    int target = 0, center = 0;
    double first = 0.0, last = 0.0;   ///< [s] TDB past J2000: it holds from, to; both included
    double start = 0.0, length = 0.0; ///< [s] begin of the first record, length of each
    const double *records = nullptr;
    std::size_t count = 0; ///< of records
    std::size_t record_words = 0;
    int coefficients = 0; ///< per component
    bool has_velocity = false;
    std::string file;
    Method method = Method::chebyshev;
    int frame = 1; ///< NAIF's number of its axes F, 1: of the ICRF
    Eigen::Matrix3d dcm_NF = Eigen::Matrix3d::Identity();
    bool cut_at_ends = false;       ///< fewer records near the ends, in place of a window that is moved
    std::size_t window = 0;         ///< records of a polynomial
    const double *epochs = nullptr; ///< [s] of the records; null: equal steps
    double mu = 0.0;                ///< [km^3/s^2] of conics

    bool is_plain() const { return method == Method::chebyshev && frame == 1; }
};

/// How the Moon stands: the Euler angles of its principal axes relative to the ICRF, [PN] = R3(psi) R1(theta) R3(phi).
struct Librations {
    EphemerisSegment segment; ///< of phi, theta, psi [rad] in place of x, y, z
    std::shared_ptr<const void> memory;

    /// Writes phi, theta, psi and their rates [rad/s].
    void angles(Epoch epoch, double tau, double *angles, double *rates) const;

    /// Throws SetupError unless they are given at all instants from, to.
    void require(Epoch from, Epoch to) const;
};

class Ephemeris {
public:
    /// Where the Debian package casacore-data-jpl-de405 puts it.
    static constexpr const char *de405_folder = "/usr/share/casacore/data/ephemerides/DE405";

    Ephemeris() = default;
    Ephemeris(Ephemeris &&) = default;
    Ephemeris &operator=(Ephemeris &&) = default;

    /// Add a SPICE SPK kernel, see spk.h; or JPL's DE405, see de405.h. A kernel that is added later is
    /// read first. Throws SetupError on a file that is missing, damaged or of a kind that is not read.
    void add_spk(const std::string &path);
    void add_de405(const std::string &folder = de405_folder);

    /// Add segments whose records lie in `memory`.
    void add(std::vector<EphemerisSegment> segments, std::shared_ptr<const void> memory);

    /// What a caller keeps between its evaluations: the way through the tree, and the span of time
    /// for which it is the right one. Begin a new one after adding to the ephemeris.
    class Cursor {
        friend class Ephemeris;
        static constexpr int most = 12;
        struct Leg {
            const EphemerisSegment *segment;
            double sign;
        };
        int target = 0, center = 0, count = 0;
        double from = std::numeric_limits<double>::infinity(), to = -from;
        Leg legs[most];
    };

    /// Position [m] of `target` relative to `center` (NAIF numbers) at `epoch` and tau [s] after
    /// it. 199, 299 and 499 are taken from their barycentres 1, 2 and 4 where they are not given
    /// themselves: 0.2 m off at Mars. Throws SetupError where `require` would.
    Eigen::Vector3d position(int target, int center, Epoch epoch, double tau, Cursor &cursor) const;
    BodyState state(int target, int center, Epoch epoch, double tau, Cursor &cursor) const;

    /// Without a cursor: finds the way each time.
    BodyState state(int target, int center, Epoch epoch) const;

    /// Whether `target` is given relative to `center` at every instant from `from` to `to`.
    bool covers(int target, int center, Epoch from, Epoch to) const;

    /// The same, but throws SetupError that names the body, the files, their spans and the instant.
    void require(int target, int center, Epoch from, Epoch to) const;

    /// The bodies that are given in any file at any time, ascending.
    std::vector<int> bodies() const;

private:
    struct Step;
    Step step_up(int body, double t) const;
    bool find_way(int target, int center, double t, Cursor &cursor) const;
    std::string why_not(int target, int center, double t, const std::string &when) const;
    const Cursor &way(int target, int center, double t, Cursor &cursor) const;
    double first_gap(int target, int center, Epoch from, Epoch to) const;

    std::deque<EphemerisSegment> segments_; // in the order of loading; they never move
    std::map<int, std::vector<const EphemerisSegment *>> of_body_;
    std::vector<std::shared_ptr<const void>> memory_;
    std::vector<std::string> files_;
};

} // namespace fledge::world
