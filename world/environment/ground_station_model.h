// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/environment/ground_station.h.
#pragma once

#include "world/environment/environment_model.h"
#include "world/environment/ground_station.h"

namespace fledge::world {

class GroundStationModel final : public EnvironmentModel {
public:
    static constexpr const char *kind = "GroundStation";

    explicit GroundStationModel(GroundStation &interface) : EnvironmentModel("body", true), interface_(interface) {}

    void prepare(const sim::Setup &setup) override;
    void refresh() override;
    void reset(sim::Ns t) override;

    struct Place {
        Eigen::Vector3d r_N, up_N; ///< [m] of the station; its zenith
    };
    Place at(sim::Ns start, double tau) const; ///< at start + tau [s]
    double mask() const { return interface_.par.mask; }

private:
    double spin() const override { return interface_.par.spin; }
    void publish(sim::Ns t) override;

    GroundStation &interface_;
    Eigen::Vector3d r_SP_P_{0, 0, 0}; ///< [m] of the station
    Eigen::Matrix3d dcm_LP_;          ///< L: east, north, up
};

} // namespace fledge::world
