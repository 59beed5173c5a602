// SPDX-License-Identifier: Apache-2.0
#include "world/environment/planet_radiation_model.h"

#include "world/constants.h"
#include "world/eigen.h"

#include <Eigen/Dense>

#include <algorithm>
#include <numbers>

namespace fledge::world {

using Eigen::Vector3d;
using sim::Ns;

namespace {

constexpr double winter_of_1981 = -6584.5 * day_s; // [s] past J2000: 22 December 1981, 0 h
constexpr double season_year = 365.25 * day_s;     // [s]

} // namespace

void PlanetRadiationModel::prepare(const sim::Setup &setup)
{
    EnvironmentModel::prepare(setup);
    refresh();
}

void PlanetRadiationModel::refresh()
{
    EnvironmentModel::refresh();
    const auto &par = interface_.par;
    if (par.law == PLANET_RADIATION_KNOCKE_1988 && !sky()) {
        refuse(".law: KNOCKE_1988 depends on the season: give the model a sky, as in sky=world.Sky(...), or take the "
               "law CONSTANT");
    }
    if (par.law == PLANET_RADIATION_CONSTANT && par.albedo == 0.0 && par.emissivity == 0.0) {
        refuse(".albedo and .emissivity are 0: the body sends no light. Give at least one, or take the law "
               "KNOCKE_1988 of the Earth");
    }
}

void PlanetRadiationModel::reset(Ns)
{
    interface_.out = {};
    light_.check(name(), "light");
    if (static_cast<bool>(sky()) != static_cast<bool>(light_->sky()) ||
        (sky() && !sky()->has_frame_of(*light_->sky()))) {
        refuse(".light: the Sunlight must be in the same sky");
    }
}

void PlanetRadiationModel::copy_setup(const sim::Model &original,
                                      const std::function<sim::Model *(const sim::Model *)> &counterpart)
{
    EnvironmentModel::copy_setup(original, counterpart);
    light_.copy(dynamic_cast<const PlanetRadiationModel &>(original).light_, counterpart);
}

PlanetRadiationModel::Brightness PlanetRadiationModel::brightness(double season, double s) const
{
    if (interface_.par.law == PLANET_RADIATION_CONSTANT) {
        return {interface_.par.albedo, interface_.par.emissivity};
    }
    const double P2 = 1.5 * s * s - 0.5;
    return {0.34 + 0.10 * season * s + 0.29 * P2, 0.68 - 0.07 * season * s - 0.18 * P2};
}

std::span<const PlanetRadiationModel::Element> PlanetRadiationModel::at(Ns start, double tau,
                                                                        const Vector3d &r_BN_N) const
{
    const Vector3d r_PN = r_PN_N(0, start, tau), r = r_BN_N - r_PN;
    const double R = bodies()[0].radius, distance = r.norm();
    if (!(distance > R)) {
        return {};
    }
    const SunlightModel::State sun = light_->unhidden(start, tau, r_PN);
    Vector3d pole = Vector3d::UnitZ();
    double season = 0.0;
    if (interface_.par.law == PLANET_RADIATION_KNOCKE_1988) {
        pole = attitude(start, tau).dcm_PN.row(2).transpose();
        season =
            fm_cos(2.0 * std::numbers::pi * (sky()->epoch_at(start).seconds() + tau - winter_of_1981) / season_year);
    }
    const Vector3d up = r / distance;
    Vector3d along = sun.s_N - sun.s_N.dot(up) * up; // elements lie symmetrically about the plane of the Sun
    along = along.squaredNorm() > 1e-20 ? along.normalized() : up.unitOrthogonal();
    const Vector3d across = up.cross(along);

    const unsigned rings = interface_.par.rings ? interface_.par.rings : 2;
    const unsigned n = 1 + 3 * rings * (rings + 1);
    const double sine2 = (R / distance) * (R / distance);
    const double step = sine2 / (1.0 + std::sqrt(1.0 - sine2)) / n; // of the cosine of the angle from down; w / 2 pi
    Element *element = elements_.data();
    for (unsigned ring = 0; ring <= rings; ring++) {
        const unsigned around = ring ? 6 * ring : 1;
        const double below = ring ? step * (1 + 3 * ring * ring) : 0.0; // 1 - cosine, at half of the ring's angle
        const double cosine = 1.0 - below, sine = std::sqrt(below * (2.0 - below));
        const double mean = ring ? 1.0 : 1.0 - 0.5 * step;
        const double way = distance * cosine - std::sqrt(std::max(R * R - distance * distance * sine * sine, 0.0));
        for (unsigned i = 0; i < around; i++, element++) {
            double s, c;
            fm_sincos(2.0 * std::numbers::pi * (i + 0.5) / around, &s, &c);
            element->towards_N = sine * (c * along + s * across) - cosine * up;
            const Vector3d zenith = (r + way * element->towards_N) / R;
            const Brightness ground = brightness(season, zenith.dot(pole));
            const double share = 2.0 * step * mean * sun.irradiance;
            element->reflected = share * ground.albedo * std::max(zenith.dot(sun.s_N), 0.0);
            element->infrared = 0.25 * share * ground.emissivity;
        }
    }
    return {elements_.data(), n};
}

void PlanetRadiationModel::publish(Ns t)
{
    const CraftState &truth = interface_.in.truth;
    if (!head_written(truth.head)) {
        return;
    }
    Vector3d reflected(0, 0, 0), infrared(0, 0, 0);
    for (const Element &element : at(t, 0.0, view(truth.r_BN_N))) {
        reflected += element.reflected * element.towards_N;
        infrared += element.infrared * element.towards_N;
    }
    PlanetLight &out = interface_.out.planet;
    out = {head_next(out.head, t, quality_through(truth.head)), vec(reflected), vec(infrared), sunlight(t, 0.0)};
}

} // namespace fledge::world
