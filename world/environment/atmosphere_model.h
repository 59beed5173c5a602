// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/environment/atmosphere.h.
#pragma once

#include "world/environment/atmosphere.h"
#include "world/environment/environment_model.h"
#include "world/environment/standard_atmosphere.h"

namespace fledge::world {

class AtmosphereModel final : public EnvironmentModel {
public:
    static constexpr const char *kind = "Atmosphere";

    explicit AtmosphereModel(Atmosphere &interface) : EnvironmentModel("body", true), interface_(interface) {}

    struct State {
        double density;             ///< [kg/m^3]
        double altitude;            ///< [m]
        Eigen::Vector3d velocity_N; ///< [m/s] of the air relative to N
    };

    /// At r_BN_N [m] and start + tau [s].
    State at(sim::Ns start, double tau, const Eigen::Vector3d &r_BN_N) const;

    void prepare(const sim::Setup &setup) override;
    void refresh() override;
    void reset(sim::Ns t) override;

private:
    double density(double altitude) const;
    double spin() const override { return interface_.par.spin; }
    void publish(sim::Ns t) override;

    Atmosphere &interface_;
    Ellipsoid ellipsoid_;
    const StandardAtmosphere *standard_ = nullptr;
};

} // namespace fledge::world
