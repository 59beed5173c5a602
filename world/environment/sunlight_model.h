// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/environment/sunlight.h.
#pragma once

#include "world/environment/environment_model.h"
#include "world/environment/shadow.h"
#include "world/environment/sunlight.h"

namespace fledge::world {

class SunlightModel final : public EnvironmentModel {
public:
    static constexpr const char *kind = "Sunlight";

    explicit SunlightModel(Sunlight &interface) : EnvironmentModel("sun", false), interface_(interface) {}

    void prepare(const sim::Setup &setup) override;
    void ensure_data_until(sim::Ns until) override;

    struct State {
        double visible;      ///< [-] share of the Sun's disc
        double irradiance;   ///< [W/m^2] with the eclipse
        Eigen::Vector3d s_N; ///< [-] unit vector towards the Sun
    };

    /// At r_BN_N [m] and start + tau [s].
    State at(sim::Ns start, double tau, const Eigen::Vector3d &r_BN_N) const;

    /// The same where nothing hides the Sun.
    State unhidden(sim::Ns start, double tau, const Eigen::Vector3d &r_BN_N) const;

    void reset(sim::Ns) override { interface_.out = {}; }

private:
    /// Of a body that may hide the Sun.
    struct Shape {
        Ellipsoid ellipsoid;
        std::optional<Orientation> orientation; ///< without it its pole stands still
    };

    double hidden_by(std::size_t body, sim::Ns start, double tau, const Eigen::Vector3d &r_BN_N,
                     const Eigen::Vector3d &r_SB, Disc &disc) const;
    State light(double visible, const Eigen::Vector3d &r_SB) const;
    void publish(sim::Ns t) override;

    Sunlight &interface_;
    std::vector<Shape> shapes_;       ///< in the order of bodies()
    mutable std::vector<Disc> discs_; ///< of the Sun, and of the bodies before it
};

} // namespace fledge::world
