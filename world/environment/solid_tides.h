// SPDX-License-Identifier: Apache-2.0
// The tides of the solid Earth, raised by the Moon and the Sun: the changes of the gravity field's coefficients of
// the degrees 2 to 4, and their gravity.
//
// Step 1 has the nominal Love numbers of an anelastic Earth, complex where they lag, and the effect of the tides of
// degree 2 on degree 4; step 2 corrects degree 2 for the frequencies of 71 tides. The tide of the pole is what the
// Earth's turning about another axis than the secular one does to the solid Earth.
// P is fixed in the Earth. Not here: tides of the oceans, also by the pole, and of the atmosphere.
//
// Source: IERS Conventions (2010), section 6.2, tables 6.3 and 6.5; section 6.4, with the secular pole of 7.1.4 in the
// version 1.3.0 of 2018.
#pragma once

#include "world/environment/timescale.h"

#include <Eigen/Core>

#include <complex>
#include <cstdint>
#include <limits>
#include <string>

namespace fledge::world {

class SolidTides {
public:
    /// C_nm and S_nm at [n][m], not normalised.
    struct Coefficients {
        double C[5][5] = {}, S[5][5] = {};
    };

    /// The frequencies' part of degree 2 without the Earth's turning, at the hours before and after an instant.
    struct Window {
        std::int64_t hour = std::numeric_limits<std::int64_t>::min();
        std::complex<double> before[3], after[3];
    };

    /// For a field with this mu [m^3/s^2] and radius [m]. `tide_system`: tide_free, or zero_tide if its C20 holds
    /// the permanent tide already. Throws SetupError on another one.
    SolidTides(double mu, double radius, const std::string &tide_system);

    /// At tau [s] after an epoch, with the Moon and the Sun relative to the Earth's centre [m]; N is the ICRF. Each
    /// caller keeps a window.
    Coefficients at(Epoch epoch, double tau, const Eigen::Matrix3d &dcm_PN, const Eigen::Vector3d &moon_N,
                    const Eigen::Vector3d &sun_N, Window &window) const;

    /// [m/s^2] Their gravity at r_P [m] outside the Earth.
    Eigen::Vector3d gravity(const Coefficients &tides, const Eigen::Vector3d &r_P) const;

    /// Step 1 of a body of this mu [m^3/s^2] at r_P [m], added to `tides`.
    void add_body(double mu, const Eigen::Vector3d &r_P, Coefficients &tides) const;

    /// Step 2, added to `tides`. `alpha`: [rad] right ascension of the prime meridian in the ICRF.
    void add_frequencies(Epoch epoch, double tau, double alpha, Window &window, Coefficients &tides) const;

    /// The tide of the pole by polar motion x and y [rad], added to `tides`.
    static void add_pole(Epoch epoch, const Eigen::Vector2d &pole, Coefficients &tides);

private:
    double mu_, radius_, mu_moon_, mu_sun_;
    double permanent_; ///< C20 that the field has already
};

} // namespace fledge::world
