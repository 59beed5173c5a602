// SPDX-License-Identifier: Apache-2.0
// The solar system as a run sees it: where the bodies are and how they stand at the times of the
// run, which begins at an epoch, in N.
//
// N has the axes of the ICRF (J2000) and its origin in a body or barycentre, the centre. The run's
// clock counts seconds of TDB. Nothing here changes, so clones and threads share one Sky.
#pragma once

#include "sim/integrator.h"
#include "world/environment/ephemeris.h"
#include "world/environment/orientation.h"

#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace fledge::world {

/// How a Sky is made, of files.
struct SkySetup {
    std::string epoch; ///< "2015-03-02T12:00:00", in UTC unless a scale follows
    int center = 0;
    std::vector<std::string> kernels; ///< SPK; "DE405": that of the folder `de405`
    std::optional<std::string> leap_seconds, pck;
    std::optional<EarthData> earth;
    bool principal_axes = false; ///< of the Moon, by the librations of DE405
    std::string de405 = Ephemeris::de405_folder;
};

class Sky {
public:
    /// Throws SetupError for files that are missing, damaged or of another kind, too.
    explicit Sky(SkySetup setup);

    /// The bodies' orientations come from `pck` where it has them, else from built-in constants; that of the
    /// Earth from `earth` and that of the Moon from `moon`, if they are given.
    /// Throws SetupError if the ephemeris has not the center at the epoch, or `earth` is not known then.
    Sky(Ephemeris ephemeris, TimeSystem time, Epoch epoch, int center, std::optional<TextKernel> pck = std::nullopt,
        const std::optional<EarthData> &earth = std::nullopt, std::shared_ptr<const Librations> moon = nullptr);

    const std::optional<SkySetup> &setup() const { return setup_; } ///< none if it was made of parts

    const Ephemeris &ephemeris() const { return ephemeris_; }
    const TimeSystem &time_system() const { return time_; }
    int center() const { return center_; }

    /// The instant at which the run has the time t. Throws SetupError beyond 1708 to 2291.
    Epoch epoch_at(sim::Ns t) const;

    /// The number under which the ephemeris has a body: that of its system's barycentre for a
    /// planet that it has only together with its moons.
    int given_as(int body) const;

    /// Of a body, under the number from given_as(), relative to the centre at start + tau [s].
    /// Throw RunError where the ephemeris does not have it.
    Eigen::Vector3d position(int body, sim::Ns start, double tau, Ephemeris::Cursor &cursor) const;
    BodyState state(int body, sim::Ns t, Ephemeris::Cursor &cursor) const;

    /// Whether N and the time of the run are the same in both.
    bool has_frame_of(const Sky &other) const { return center_ == other.center_ && epoch_ == other.epoch_; }

    /// Throws SetupError unless the body's position is there at every instant from, to.
    void require(int body, sim::Ns from, sim::Ns to) const;

    /// Throws SetupError if it is not known. Each caller keeps its own.
    Orientation orientation(int body) const;

    /// Throws SetupError unless the orientation is known at every instant from, to.
    void require(const Orientation &orientation, sim::Ns from, sim::Ns to) const;

    /// Maps N to the Earth's true equator and equinox at t, by the theory of `earth`, or else IAU 2006/2000A.
    Eigen::Matrix3d true_of_date(sim::Ns t) const;

    /// Maps N to the true equator and mean equinox of date, the frame of two-line elements.
    Eigen::Matrix3d teme_of_date(sim::Ns t) const { return world::teme_of_date(time_, epoch_at(t)); }

private:
    std::optional<SkySetup> setup_;
    Ephemeris ephemeris_;
    TimeSystem time_;
    Epoch epoch_;
    int center_, given_center_;
    std::optional<TextKernel> pck_;
    std::shared_ptr<const EarthRotation> earth_;
    std::shared_ptr<const Librations> moon_;
    EarthData::Theory theory_ = EarthData::Theory::iau2006;
};

} // namespace fledge::world
