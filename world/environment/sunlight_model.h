// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/environment/sunlight.h.
#pragma once

#include "world/environment/environment_model.h"
#include "world/environment/sunlight.h"

namespace fledge::world {

class SunlightModel final : public EnvironmentModel {
public:
    static constexpr const char *kind = "Sunlight";

    explicit SunlightModel(Sunlight &interface) : EnvironmentModel("sun", false), interface_(interface) {}

    struct State {
        double visible;      ///< [-] share of the Sun's disc
        double irradiance;   ///< [W/m^2] with the eclipse
        Eigen::Vector3d s_N; ///< [-] unit vector towards the Sun
    };

    /// At r_BN_N [m] and start + tau [s].
    State at(sim::Ns start, double tau, const Eigen::Vector3d &r_BN_N) const;

    void reset(sim::Ns) override { interface_.out = {}; }

private:
    void publish(sim::Ns t) override;

    Sunlight &interface_;
};

} // namespace fledge::world
