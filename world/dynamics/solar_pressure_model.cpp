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

void SolarPressureModel::derive(const double *, const Motion &motion, double *, Loads &loads) const
{
    const auto &par = interface_.par;
    const SunlightModel::State light = source_->at(motion.start, motion.tau, view(motion.r_BN_N));
    const double pressure = light.irradiance / speed_of_light;
    const Vec3 s_B = mat_vec(motion.C_BN, vec(light.s_N));
    push(vec_scale(-pressure * par.Cr * par.area, s_B), s_B, motion, loads,
         [&](std::size_t i, const Vec3 &normal_B, double cosine) {
             const Vec3 along = vec_scale(1.0 - par.specular[i], s_B);
             const Vec3 across = vec_scale(2.0 * (par.specular[i] * cosine + par.diffuse[i] / 3.0), normal_B);
             return vec_scale(-pressure * par.areas[i] * cosine, vec_add(along, across));
         });
}

} // namespace fledge::world
