// SPDX-License-Identifier: Apache-2.0
#include "world/environment/ground_station_model.h"

#include "world/eigen.h"

#include <Eigen/Dense>

#include <numbers>

namespace fledge::world {

using Eigen::Vector3d;
using sim::Ns;

void GroundStationModel::prepare(const sim::Setup &setup)
{
    EnvironmentModel::prepare(setup);
    refresh();
}

void GroundStationModel::refresh()
{
    EnvironmentModel::refresh();
    const auto &par = interface_.par;
    r_SP_P_ = Ellipsoid::of(bodies()[0]).point(par.latitude, par.longitude, par.altitude);
    double s_lat, c_lat, s_lon, c_lon;
    fm_sincos(par.latitude, &s_lat, &c_lat);
    fm_sincos(par.longitude, &s_lon, &c_lon);
    dcm_LP_ << -s_lon, c_lon, 0.0, -s_lat * c_lon, -s_lat * s_lon, c_lat, c_lat * c_lon, c_lat * s_lon, s_lat;
}

void GroundStationModel::reset(Ns t)
{
    interface_.out = {};
    publish(t);
}

GroundStationModel::Place GroundStationModel::at(Ns start, double tau) const
{
    const Eigen::Matrix3d dcm_NP = attitude(start, tau).dcm_PN.transpose();
    return {r_PN_N(0, start, tau) + dcm_NP * r_SP_P_, dcm_NP * dcm_LP_.row(2).transpose()};
}

void GroundStationModel::publish(Ns t)
{
    const BodyAttitude &turned = attitude(t, 0.0);
    const Eigen::Matrix3d dcm_NP = turned.dcm_PN.transpose();
    const Vector3d omega_N = dcm_NP * turned.omega_PN_P, arm_N = dcm_NP * r_SP_P_;
    const Vector3d r_N = r_PN_N(0, t, 0.0) + arm_N, v_N = v_PN_N(0, t, 0.0) + omega_N.cross(arm_N);
    ::BodyState &state = interface_.out.state;
    state = {head_next(state.head, t, QUALITY_GOOD), vec(r_N), vec(v_N), vec(omega_N.cross(omega_N.cross(arm_N)))};

    const CraftState &truth = interface_.in.truth;
    if (!head_written(truth.head)) {
        return;
    }
    const Vector3d way_N = view(truth.r_BN_N) - r_N;
    const Vector3d way_L = dcm_LP_ * (turned.dcm_PN * way_N);
    const double flat = std::sqrt(way_L[0] * way_L[0] + way_L[1] * way_L[1]), range = way_N.norm();
    const double azimuth = fm_atan2(way_L[0], way_L[1]), elevation = fm_atan2(way_L[2], flat);
    GroundContact &contact = interface_.out.contact;
    contact = {head_next(contact.head, t, quality_through(truth.head)),
               range,
               range > 0.0 ? way_N.dot(view(truth.v_BN_N) - v_N) / range : 0.0,
               azimuth < 0.0 ? azimuth + 2.0 * std::numbers::pi : azimuth,
               elevation,
               elevation >= interface_.par.mask ? 1u : 0u,
               0};
}

} // namespace fledge::world
