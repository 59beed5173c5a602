// SPDX-License-Identifier: Apache-2.0
// How planets stand and turn, by the IAU's model: the right ascension and declination of the pole
// and the prime meridian W as polynomials and sines of time,
//
//   ra  = a0 + a1 T + a2 T^2 + sum_i ra_i  sin E_i         T: centuries of TDB past J2000
//   dec = d0 + d1 T + d2 T^2 + sum_i dec_i cos E_i         d: days of it
//   W   = w0 + w1 d + w2 d^2 + sum_i w_i   sin E_i         E_i = e0_i + e1_i T + ...
//
//   [PN] = R3(W) R1(90 deg - dec) R3(90 deg + ra)
//
// N is the ICRF, P is fixed in the body: p3 along its pole, p1 through its prime meridian.
//
// Built in are the Sun, Mercury to Neptune and the Moon, of the IAU's report of 2000 (Seidelmann et
// al. 2002), as in NAIF's pck00008.tpc. The Moon has all
// 13 periodic terms: within about 0.01 deg of its libration. The Earth has precession only, neither
// nutation nor the true length of day: within about 0.2 deg of the terrestrial frame. earth_rotation.h
// has what replaces it.
#pragma once

#include "world/environment/earth_rotation.h"
#include "world/environment/ephemeris.h"
#include "world/environment/text_kernel.h"

#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace fledge::world {

/// Of one body. Each caller has its own, as it keeps what it interpolates from.
class Orientation {
public:
    /// From the built-in constants. Throws SetupError that lists the bodies it knows.
    static Orientation built_in(int body);

    /// From BODYnnn_POLE_RA, _POLE_DEC, _PM and their periodic terms in a text kernel (.tpc).
    /// Throws SetupError if one is missing or not of the right shape.
    static Orientation from(const TextKernel &pck, int body);

    /// Of the Earth; of the Moon's principal axes.
    static Orientation of(std::shared_ptr<const EarthRotation> earth);
    static Orientation of(std::shared_ptr<const Librations> moon);

    int body() const { return body_; }

    /// At tau [s] after an epoch.
    BodyAttitude at(Epoch epoch, double tau = 0.0) const;
    Eigen::Matrix3d dcm_PN(Epoch epoch, double tau = 0.0) const;

    /// [rad] Polar motion x and y, of the Earth where it is known.
    std::optional<Eigen::Vector2d> pole(Epoch epoch) const { return earth_ ? earth_->pole(epoch) : std::nullopt; }

    /// Throws SetupError unless it is known at all instants from, to.
    void require(Epoch from, Epoch to) const;

private:
    struct Term {
        double E[3];        ///< [rad], per century, per century^2
        double ra, dec, pm; ///< [rad] amplitudes
    };

    int body_ = 0;
    double ra_[3] = {}, dec_[3] = {}; ///< [rad], per century, per century^2
    double pm_[3] = {};               ///< [rad], per day, per day^2
    std::vector<Term> terms_;
    std::shared_ptr<const EarthRotation> earth_; ///< this or the Moon's librations replace them
    std::shared_ptr<const Librations> moon_;
    mutable EarthRotation::Window window_;
};

/// [m] The mean of BODYnnn_RADII's first two, and the third. Throws SetupError if they are missing.
double equatorial_radius(const TextKernel &pck, int body);
double polar_radius(const TextKernel &pck, int body);

} // namespace fledge::world
