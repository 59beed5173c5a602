// SPDX-License-Identifier: Apache-2.0
#include "world/dynamics/solar_pressure_model.h"

#include "sim/text.h"
#include "world/constants.h"
#include "world/eigen.h"

namespace fledge::world {

namespace {

} // namespace

void SolarPressureModel::prepare(const sim::Setup &setup)
{
    name_ = setup.name;
    const auto &par = interface_.par;
    if (par.n == 0 && par.area * par.Cr == 0.0) {
        throw sim::SetupError(name_ + ".area is " + sim::format_number(par.area) + " m^2 and Cr " +
                              sim::format_number(par.Cr) + ", and there are no facets: nothing feels the light");
    }
    refresh();
}

void SolarPressureModel::refresh()
{
    const auto &par = interface_.par;
    for (std::size_t i = 0; i < par.n; i++) {
        if (par.specular[i] + par.diffuse[i] > 1.0) {
            throw sim::SetupError(
                name_ + ".diffuse[" + std::to_string(i) +
                "]: the shares that a facet reflects, specular and diffuse, must not exceed 1; found " +
                sim::format_number(par.specular[i] + par.diffuse[i]));
        }
        normals_B_[i] = vec_unit(par.normals_B[i]);
    }
    changed_ = true;
}

void SolarPressureModel::start(const Vec3 &, double *)
{
    light_.check(name_, "light");
    interface_.out = {};
}

bool SolarPressureModel::latch(const double *, const BodyRate &, double)
{
    const bool changed = light_.changed() || changed_;
    changed_ = false;
    return changed;
}

void SolarPressureModel::derive(const double *, const Motion &motion, double *, Loads &loads) const
{
    const auto &par = interface_.par;
    const SunlightModel::State light = light_->at(motion.start, motion.tau, view(motion.r_BN_N));
    const double pressure = light.irradiance / speed_of_light;
    const Vec3 s_B = mat_vec(motion.C_BN, vec(light.s_N));
    Loads own{};
    if (par.n == 0) {
        own.push(vec_scale(-pressure * par.Cr * par.area, s_B), vec_sub(par.centre_B, motion.r_CB_B));
    }
    for (std::size_t i = 0; i < par.n; i++) {
        if (const double cosine = vec_dot(normals_B_[i], s_B); cosine > 0.0) {
            const Vec3 along = vec_scale(1.0 - par.specular[i], s_B);
            const Vec3 across = vec_scale(2.0 * (par.specular[i] * cosine + par.diffuse[i] / 3.0), normals_B_[i]);
            own.push(vec_scale(-pressure * par.areas[i] * cosine, vec_add(along, across)),
                     vec_sub(par.centres_B[i], motion.r_CB_B));
        }
    }
    loads.force_B = vec_add(loads.force_B, own.force_B);
    loads.torque = vec_add(loads.torque, own.torque);
    load_ = own;
}

void SolarPressureModel::publish(sim::Ns t, const double *, const Vec3 &)
{
    ForceTorque &load = interface_.out.load;
    load = {head_next(load.head, t, QUALITY_GOOD), {}, load_.force_B, load_.torque};
}

void SolarPressureModel::copy_setup(const sim::Model &original,
                                    const std::function<sim::Model *(const sim::Model *)> &counterpart)
{
    light_.copy(dynamic_cast<const SolarPressureModel &>(original).light_, counterpart);
}

} // namespace fledge::world
