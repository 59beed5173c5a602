// SPDX-License-Identifier: Apache-2.0
#include "world/environment/sunlight_model.h"

#include "world/eigen.h"
#include "world/environment/shadow.h"

#include <Eigen/Dense>

#include <algorithm>

namespace fledge::world {

using Eigen::Vector3d;
using sim::Ns;

namespace {

constexpr double astronomical_unit = 149597870700.0; // [m]
constexpr double solar_constant = 1361.0;            // [W/m^2]

} // namespace

SunlightModel::State SunlightModel::at(Ns start, double tau, const Vector3d &r_BN_N) const
{
    const Vector3d r_SB = r_BN_N - r_PN_N(0, start, tau);
    double hidden = 0.0;
    for (std::size_t i = 1; i < bodies().size(); i++) {
        hidden += hidden_share(r_SB, bodies()[0].radius, r_BN_N - r_PN_N(i, start, tau), bodies()[i].radius);
    }
    const double visible = std::max(1.0 - hidden, 0.0), distance = r_SB.norm();
    const double at_1_AU = interface_.par.irradiance > 0.0 ? interface_.par.irradiance : solar_constant;
    const double AU = astronomical_unit / distance;
    return {visible, visible * at_1_AU * AU * AU, r_SB / -distance};
}

void SunlightModel::publish(Ns t)
{
    const CraftState &truth = interface_.in.truth;
    if (!head_written(truth.head)) {
        return;
    }
    const State state = at(t, 0.0, view(truth.r_BN_N));
    interface_.out.light = {head_next(interface_.out.light.head, t, quality_through(truth.head)), state.visible,
                            state.irradiance, vec(state.s_N)};
}

} // namespace fledge::world
