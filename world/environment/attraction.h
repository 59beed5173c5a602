// SPDX-License-Identifier: Apache-2.0
// All that attracts a spacecraft: its acceleration relative to the origin of N.
//
// Without a sky N is inertial, and every body is where GravityBody says. With one, bodies are where
// the ephemeris has them, and where N's origin is a body, that falls too, towards all the others:
//
//   a = sum_P [ gravity_P(r - r_P) - mu_P r_P / |r_P|^3 ]
//
// The centre itself is at rest in the origin and has no second term. If the origin is the barycentre of
// the solar system, no body has a second term. If the origin is the barycentre of a planet and its moons,
// these have none, because they do not move it.
#pragma once

#include "world/environment/gravity.h"
#include "world/environment/sky.h"
#include "world/environment/solid_tides.h"

#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace fledge::world {

class Attraction {
public:
    /// Throws SetupError on what `checked` refuses, if a name is listed twice, and if mu and radius give a gravity at
    /// the surface outside 1e-6 to 1e4 m/s^2.
    void add(const GravityBody &body);
    const std::vector<GravityBody> &bodies() const { return bodies_; }

    void set_sky(std::shared_ptr<const Sky> sky) { sky_ = std::move(sky); }
    const std::shared_ptr<const Sky> &sky() const { return sky_; }

    /// A spacecraft that begins at r_BN_N [m] was meant to be on an orbit about this body.
    void expect_orbit(const GravityBody &about, const Eigen::Vector3d &r_BN_N) { orbit_ = {about, r_BN_N}; }

    /// Find every body at time 0. `craft` is what errors call the spacecraft. Throws SetupError if
    /// a body is not in the sky, if the position r_BN_N lies in one, or if it is that of an orbit about a body that
    /// does not attract the spacecraft, or does so with another mu.
    void prepare(const std::string &craft, const Eigen::Vector3d &r_BN_N);

    /// A step of the integration begins at `start`, with this position [m] and velocity [m/s] of the spacecraft.
    void begin_step(sim::Ns start, const Eigen::Vector3d &r_BN_N, const Eigen::Vector3d &v_BN_N);

    /// The step ended at start + tau, and the next one begins there. Throws RunError, with time and altitude, if the
    /// spacecraft is inside a body, or was so within the step: at its nearest point on the polynomial of degree 5
    /// through position, velocity and gravity at both ends of the step.
    void end_step(sim::Ns start, double tau, const Eigen::Vector3d &r_BN_N, const Eigen::Vector3d &v_BN_N);

    /// [m/s^2] Times the square of a step's length, at least twice the height of the step's arc over its chord,
    /// because gravity outside the body is largest at its surface. 0 if it has none.
    static double arc(const GravityBody &body);

    /// Throws SetupError if the sky has not all bodies up to `until`.
    void ensure_data_until(sim::Ns until);

    /// mu of the only body, if it is a point at rest in the origin; else 0. After prepare().
    double central_mu() const;

    /// [m/s^2] at r_BN_N [m] and start + tau [s]. Throws RunError where the sky ends.
    Eigen::Vector3d at(sim::Ns start, double tau, const Eigen::Vector3d &r_BN_N);

    /// [N m] The torque of gravity on a body with this inertia, B components: that of points.
    Eigen::Vector3d torque(sim::Ns start, double tau, const Eigen::Vector3d &r_BN_N, const Eigen::Matrix3d &dcm_BN,
                           const Eigen::Matrix3d &I_B);

    /// [1/s^2] The gradient of gravity, that of points, N components: a mass at d from r_BN_N feels this times d more.
    Eigen::Matrix3d gradient(sim::Ns start, double tau, const Eigen::Vector3d &r_BN_N);

    /// One line for each body that another one stands for.
    std::vector<std::string> assumptions() const;

private:
    /// The Moon, the Sun and what they make of the Earth's field.
    struct Tide {
        SolidTides model;
        Ephemeris::Cursor moon{}, sun{};
        SolidTides::Window window{};
        SolidTides::Coefficients now{};
    };

    /// A body in the sky.
    struct Source {
        double mu = 0.0;                  ///< of the body, or of the system that stands for it
        int target = 0;                   ///< the body that is read from the ephemeris
        bool moves = false;               ///< relative to the origin
        bool pulls_origin = false;        ///< so that there is a second term
        bool point = true;                ///< neither zonals nor a field
        std::vector<Orientation> turning; ///< of a field, or of zonals: one

        // Where and how it was found last: methods of integration ask for an instant twice.
        sim::Ns start = 0;
        double tau = std::numeric_limits<double>::quiet_NaN();
        Eigen::Vector3d r_PN_N{0, 0, 0};
        Eigen::Matrix3d dcm_PN;
        Eigen::Vector3d pole_N;
        Ephemeris::Cursor cursor;
        std::optional<Tide> tide;
    };

    struct Orbit {
        GravityBody about;
        Eigen::Vector3d r_BN_N;
    };

    void require_orbit_body(const Eigen::Vector3d &r_BN_N) const;
    Source find(const GravityBody &body) const;
    void require(int target, sim::Ns from, sim::Ns to) const;
    void place(Source &source, sim::Ns start, double tau) const;
    Eigen::Vector3d position(std::size_t body, sim::Ns start, double tau);
    Eigen::Vector3d pull(const GravityBody &body, const Source &source, const Eigen::Vector3d &r_BN_N) const;

    /// An end of a step.
    struct Knot {
        sim::Ns start = 0;
        double tau = 0.0;
        Eigen::Vector3d r_BN_N{0, 0, 0}, v_BN_N{0, 0, 0};
    };

    void look_closer(std::size_t body, const Knot &end, const Eigen::Vector3d &r_BP_N, double h);

    std::string craft_;
    std::vector<GravityBody> bodies_;
    std::vector<Source> sources_; // in the same order; none without a sky
    std::shared_ptr<const Sky> sky_;
    std::optional<Orbit> orbit_;
    sim::Ns covered_ = 0;

    Knot last_;
    std::vector<Eigen::Vector3d> last_r_BP_N_; // at last_, relative to each body
};

} // namespace fledge::world
