// SPDX-License-Identifier: Apache-2.0
// What models of a body's air in C++ have in common: it turns with the body, winds blow in it, parts of a spacecraft
// ask it, and it publishes an AirState in its task. A model of a project derives from AirModel as Atmosphere does.
#pragma once

#include "world/environment/air_source.h"
#include "world/environment/environment_model.h"
#include "world/msg/craft.h"
#include "world/msg/environment.h"

namespace fledge::world {

class AirModel : public EnvironmentModel, public AirSource {
public:
    State at(sim::Ns start, double tau, const Eigen::Vector3d &r_BN_N) const final;
    const std::string &name() const override { return EnvironmentModel::name(); }
    std::uint64_t version() const override { return EnvironmentModel::version(); }

    void prepare(const sim::Setup &setup) override;
    void reset(sim::Ns) override { air_ = {}; }

protected:
    AirModel(const CraftState &truth, AirState &air) : EnvironmentModel("body", true), truth_(truth), air_(air) {}

    /// Where the air is asked for.
    struct Place {
        sim::Ns start;
        double tau;          ///< [s] past start
        Eigen::Vector3d r_P; ///< [m] in the body's own axes
        double altitude;     ///< [m] over the ellipsoid
    };

    /// Density, temperature and molar mass at a place.
    virtual State air(const Place &place) const = 0;

    struct Wind {
        double east = 0.0, north = 0.0; ///< [m/s] relative to the turning body
    };
    virtual Wind wind(const Place &place) const = 0;

    const Ellipsoid &ellipsoid() const { return ellipsoid_; }

private:
    void publish(sim::Ns t) final;

    const CraftState &truth_;
    AirState &air_;
    Ellipsoid ellipsoid_;
};

} // namespace fledge::world
