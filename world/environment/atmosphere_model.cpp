// SPDX-License-Identifier: Apache-2.0
#include "world/environment/atmosphere_model.h"

#include "sim/text.h"
#include "world/eigen.h"

#include <Eigen/Dense>

#include <algorithm>

namespace fledge::world {

using Eigen::Vector3d;
using sim::Ns;

void AtmosphereModel::prepare(const sim::Setup &setup)
{
    EnvironmentModel::prepare(setup);
    ellipsoid_ = Ellipsoid::of(bodies()[0]);
    refresh();
}

void AtmosphereModel::refresh()
{
    EnvironmentModel::refresh();
    const auto &par = interface_.par;
    standard_ = nullptr;
    if (par.law != ATMOSPHERE_STANDARD_1976 && par.density == 0.0) {
        refuse(".density must be > 0 kg/m^3, but for the law STANDARD_1976; found 0 kg/m^3");
    }
    switch (par.law) {
    case ATMOSPHERE_CONSTANT: break;
    case ATMOSPHERE_EXPONENTIAL:
        if (!(par.scale_height >= 1.0)) {
            refuse(".scale_height must be >= 1 m for the exponential law; found " +
                   sim::format_number(par.scale_height) + " m");
        }
        break;
    case ATMOSPHERE_STANDARD_1976:
        if (par.density != 0.0) {
            refuse(".density: the standard atmosphere has its own; found " + sim::format_number(par.density) +
                   " kg/m^3 besides");
        }
        standard_ = &StandardAtmosphere::get();
        break;
    }
}

void AtmosphereModel::reset(Ns)
{
    interface_.out = {};
}

double AtmosphereModel::density(double altitude) const
{
    const auto &par = interface_.par;
    if (standard_) {
        return standard_->at(altitude).density;
    }
    if (par.law == ATMOSPHERE_CONSTANT) {
        return par.density;
    }
    // Where it would be thicker than anything the craft is inside the body, and its run ends.
    return par.density * fm_exp(std::min((par.base - altitude) / par.scale_height, 100.0));
}

AtmosphereModel::State AtmosphereModel::at(Ns start, double tau, const Vector3d &r_BN_N) const
{
    const BodyAttitude &turned = attitude(start, tau);
    const Vector3d r_P = turned.dcm_PN * (r_BN_N - r_PN_N(0, start, tau));
    const double altitude = ellipsoid_.altitude(r_P);
    return {density(altitude), altitude,
            v_PN_N(0, start, tau) + turned.dcm_PN.transpose() * turned.omega_PN_P.cross(r_P)};
}

void AtmosphereModel::publish(Ns t)
{
    const CraftState &truth = interface_.in.truth;
    if (!head_written(truth.head)) {
        return;
    }
    const State state = at(t, 0.0, view(truth.r_BN_N));
    interface_.out.air = {head_next(interface_.out.air.head, t, quality_through(truth.head)), state.density,
                          state.altitude, vec(state.velocity_N)};
}

} // namespace fledge::world
