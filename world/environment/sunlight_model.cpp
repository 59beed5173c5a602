// SPDX-License-Identifier: Apache-2.0
#include "world/environment/sunlight_model.h"

#include "world/constants.h"
#include "world/eigen.h"

#include <Eigen/Dense>

#include <algorithm>

namespace fledge::world {

using Eigen::Vector3d;
using sim::Ns;

namespace {

constexpr double astronomical_unit = 149597870700.0; // [m]
constexpr double solar_constant = 1361.0;            // [W/m^2]

} // namespace

void SunlightModel::prepare(const sim::Setup &setup)
{
    EnvironmentModel::prepare(setup);
    shapes_.clear();
    discs_.assign(bodies().size(), {{0.0, 0.0}, 1.0});
    for (const GravityBody &body : bodies()) {
        if (std::ranges::count_if(bodies(), [&](const GravityBody &other) {
                return other.name == body.name && other.r_PN_N == body.r_PN_N;
            }) > 1) {
            refuse(".shadows: " + body.name + " is there twice: name each body once");
        }
        Shape &shape = shapes_.emplace_back(Shape{Ellipsoid::of(body), {}});
        if (sky() && shape.ellipsoid.b != shape.ellipsoid.a && !body.pole_stays) {
            shape.orientation = sky()->orientation(*body.naif);
        }
    }
}

void SunlightModel::ensure_data_until(Ns until)
{
    EnvironmentModel::ensure_data_until(until);
    for (const Shape &shape : shapes_) {
        if (interface_.par.oblate && shape.orientation) {
            try {
                sky()->require(*shape.orientation, 0, until);
            } catch (const sim::SetupError &error) {
                refuse(std::string(": ") + error.what());
            }
        }
    }
}

double SunlightModel::hidden_by(std::size_t i, Ns start, double tau, const Vector3d &r_BN_N, const Vector3d &r_SB,
                                Disc &disc) const
{
    const double sun_radius = bodies()[0].radius;
    Vector3d r_PB = r_BN_N - r_PN_N(i, start, tau);
    if (interface_.par.light_time) { // light goes straight where the Sun stands still
        r_PB += r_PB.norm() / speed_of_light * (v_PN_N(i, start, tau) - v_PN_N(0, start, tau));
    }
    if (!interface_.par.oblate) {
        return hidden_share(r_SB, sun_radius, r_PB, bodies()[i].radius, &disc);
    }
    const auto &[ellipsoid, orientation] = shapes_[i];
    const Vector3d pole = orientation ? Vector3d(orientation->at(sky()->epoch_at(start), tau).dcm_PN.row(2).transpose())
                                      : bodies()[i].pole_N;
    return hidden_share(r_SB, sun_radius, r_PB, ellipsoid.a, ellipsoid.b, pole, &disc);
}

SunlightModel::State SunlightModel::at(Ns start, double tau, const Vector3d &r_BN_N) const
{
    const Vector3d r_SB = r_BN_N - r_PN_N(0, start, tau);
    double hidden = 0.0;
    bool meet = false;
    discs_.resize(1);
    for (std::size_t i = 1; i < bodies().size(); i++) {
        Disc disc{};
        const double share = hidden_by(i, start, tau, r_BN_N, r_SB, disc);
        if (share == 1.0) {
            return light(0.0, r_SB);
        }
        hidden += share;
        if (share > 0.0) {
            meet |= std::any_of(discs_.begin() + 1, discs_.end(), [&](const Disc &other) { return disc.meets(other); });
            discs_.push_back(disc);
        }
    }
    return light(meet ? 1.0 - hidden_together(discs_) : std::max(1.0 - hidden, 0.0), r_SB);
}

SunlightModel::State SunlightModel::unhidden(Ns start, double tau, const Vector3d &r_BN_N) const
{
    return light(1.0, r_BN_N - r_PN_N(0, start, tau));
}

SunlightModel::State SunlightModel::light(double visible, const Vector3d &r_SB) const
{
    const double distance = r_SB.norm();
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
