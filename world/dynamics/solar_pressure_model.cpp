// SPDX-License-Identifier: Apache-2.0
#include "world/dynamics/solar_pressure_model.h"

#include "sim/text.h"
#include "world/constants.h"
#include "world/eigen.h"

namespace fledge::world {

void SolarPressureModel::check() const
{
    const auto &par = interface_.par;
    if (par.n == 0 && par.area * par.Cr == 0.0) {
        throw sim::SetupError(name_ + ".area is " + sim::format_number(par.area) + " m^2 and Cr " +
                              sim::format_number(par.Cr) + ", and there are no facets: nothing feels the light");
    }
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
    }
    Surface::refresh();
}

void SolarPressureModel::start(const Vec3 &omega, double *x)
{
    Surface::start(omega, x);
    if (radiation_.model()) {
        radiation_.check(name_, "radiation");
    }
}

bool SolarPressureModel::latch(const double *x, const BodyRate &rate, double dt)
{
    const bool changed = radiation_.model() && radiation_.changed();
    return Surface::latch(x, rate, dt) || changed;
}

void SolarPressureModel::copy_setup(const sim::Model &original,
                                    const std::function<sim::Model *(const sim::Model *)> &counterpart)
{
    Surface::copy_setup(original, counterpart);
    radiation_.copy(dynamic_cast<const SolarPressureModel &>(original).radiation_, counterpart);
}

void SolarPressureModel::shine(const Vec3 &s_B, double visible, double infrared, const Motion &motion,
                               Loads &loads) const
{
    const auto &par = interface_.par;
    const double pressure = visible / speed_of_light, heat = infrared / speed_of_light;
    push(vec_scale(-(pressure + heat) * par.Cr * par.area, s_B), s_B, motion, loads,
         [&](std::size_t i, const Vec3 &normal_B, double cosine) {
             const Vec3 along = vec_scale(1.0 - par.specular[i], s_B);
             const Vec3 across = vec_scale(2.0 * (par.specular[i] * cosine + par.diffuse[i] / 3.0), normal_B);
             const Vec3 push = vec_scale(-pressure * par.areas[i] * cosine, vec_add(along, across));
             if (heat == 0.0) {
                 return push;
             }
             const Vec3 back = vec_scale(2.0 / 3.0 * par.diffuse_infrared[i], normal_B);
             return vec_add(push, vec_scale(-heat * par.areas[i] * cosine, vec_add(s_B, back)));
         });
}

void SolarPressureModel::derive(const double *, const Motion &motion, double *, Loads &loads) const
{
    const SunlightModel::State light = source_->at(motion.start, motion.tau, view(motion.r_BN_N));
    shine(mat_vec(motion.C_BN, vec(light.s_N)), light.irradiance, 0.0, motion, loads);
    if (!radiation_.model()) {
        return;
    }
    Loads all = load_;
    for (const auto &element : radiation_->at(motion.start, motion.tau, view(motion.r_BN_N))) {
        shine(mat_vec(motion.C_BN, vec(element.towards_N)), element.reflected, element.infrared, motion, loads);
        all.force_B = vec_add(all.force_B, load_.force_B);
        all.torque = vec_add(all.torque, load_.torque);
    }
    load_ = all;
}

} // namespace fledge::world
