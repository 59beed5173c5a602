// SPDX-License-Identifier: Apache-2.0
#include "world/environment/air_model.h"

#include "sim/error.h"
#include "sim/text.h"
#include "world/eigen.h"

#include <Eigen/Dense>

#include <cmath>

namespace fledge::world {

using Eigen::Vector3d;
using sim::Ns;

std::shared_ptr<const AirSource> AirSource::of(const sim::Model &model)
{
    if (const auto *scripted = dynamic_cast<const sim::ScriptedModel *>(&model)) {
        return scripted->answers() ? std::make_shared<const ScriptedAir>(*scripted) : nullptr;
    }
    return {std::shared_ptr<void>(), dynamic_cast<const AirSource *>(&model)};
}

AirSource::State ScriptedAir::at(Ns start, double tau, const Vector3d &r_BN_N) const
{
    std::array<double, 6> answer{}; // as Python's air_at() returns them
    const double t = tick_seconds(start) + tau;
    model_.ask(t, std::span<const double, 3>(r_BN_N.data(), 3), answer);
    const auto &[density, v0, v1, v2, temperature, molar_mass] = answer;
    return {density, 0.0, {v0, v1, v2}, temperature, molar_mass};
}

void AirModel::prepare(const sim::Setup &setup)
{
    EnvironmentModel::prepare(setup);
    ellipsoid_ = Ellipsoid::of(bodies()[0]);
    refresh();
}

AirSource::State AirModel::at(Ns start, double tau, const Vector3d &r_BN_N) const
{
    const BodyAttitude &turned = attitude(start, tau);
    const Vector3d r_P = turned.dcm_PN * (r_BN_N - r_PN_N(0, start, tau));
    const Place place{start, tau, r_P, ellipsoid_.altitude(r_P)};
    State state = air(place);
    state.altitude = place.altitude;
    Vector3d v_P = turned.omega_PN_P.cross(r_P);
    if (const Wind blowing = wind(place); blowing.east != 0.0 || blowing.north != 0.0) {
        const double a2 = ellipsoid_.a * ellipsoid_.a, b2 = ellipsoid_.b * ellipsoid_.b;
        const Vector3d up = Vector3d(r_P[0] / a2, r_P[1] / a2, r_P[2] / b2).normalized();
        const Vector3d east = Vector3d(-r_P[1], r_P[0], 0.0).normalized(); // 0 over a pole
        v_P += blowing.east * east + blowing.north * up.cross(east);
    }
    state.velocity_N = v_PN_N(0, start, tau) + turned.dcm_PN.transpose() * v_P;
    return state;
}

void AirModel::publish(Ns t)
{
    if (!head_written(truth_.head)) {
        return;
    }
    const State state = at(t, 0.0, view(truth_.r_BN_N));
    air_ = {head_next(air_.head, t, quality_through(truth_.head)),
            state.density,
            state.altitude,
            vec(state.velocity_N),
            state.temperature,
            state.molar_mass};
}

} // namespace fledge::world
