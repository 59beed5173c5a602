// SPDX-License-Identifier: Apache-2.0
// Air that parts of a spacecraft ask for at each stage of the integrator: of a model in C++ (air_model.h), or of a
// prototype in Python with a method `air_at(self, t, r_BN_N)`.
#pragma once

#include "sim/scripted_model.h"

#include <Eigen/Core>

#include <array>
#include <memory>

namespace fledge::world {

class AirSource {
public:
    static constexpr const char *kind = "Atmosphere";

    struct State {
        double density = 0.0;                ///< [kg/m^3]
        double altitude = 0.0;               ///< [m]
        Eigen::Vector3d velocity_N{0, 0, 0}; ///< [m/s] of the air relative to N
        double temperature = 0.0;            ///< [K]      0: unknown
        double molar_mass = 0.0;             ///< [kg/mol] 0: unknown
    };

    virtual ~AirSource() = default;

    /// At r_BN_N [m] and start + tau [s].
    virtual State at(sim::Ns start, double tau, const Eigen::Vector3d &r_BN_N) const = 0;

    /// "world.air"; empty before the model is prepared.
    virtual const std::string &name() const = 0;

    /// Changes whenever a parameter changes.
    virtual std::uint64_t version() const = 0;

    /// Whether temperature and molar mass are known, as accommodation needs them.
    virtual bool has_temperature() const = 0;

    /// The air of a model; null if it has none.
    static std::shared_ptr<const AirSource> of(const sim::Model &model);
};

/// The air of a prototype in Python.
class ScriptedAir final : public AirSource {
public:
    explicit ScriptedAir(const sim::ScriptedModel &model) : model_(model) {}

    State at(sim::Ns start, double tau, const Eigen::Vector3d &r_BN_N) const override;
    const std::string &name() const override { return model_.instance().path; }
    std::uint64_t version() const override { return model_.version(); }
    bool has_temperature() const override { return true; } // what it leaves out is noticed where it is used

private:
    const sim::ScriptedModel &model_;
};

} // namespace fledge::world
