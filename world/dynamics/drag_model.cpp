// SPDX-License-Identifier: Apache-2.0
#include "world/dynamics/drag_model.h"

#include "world/eigen.h"

namespace fledge::world {

void DragModel::check() const
{
    if (interface_.par.n == 0 && interface_.par.area == 0.0) {
        throw sim::SetupError(name_ + ".area is 0 m^2, and there are no facets: nothing feels the air");
    }
}

void DragModel::derive(const double *, const Motion &motion, double *, Loads &loads) const
{
    const auto &par = interface_.par;
    const AirSource::State air = source_->at(motion.start, motion.tau, view(motion.r_BN_N));
    const Vec3 v_B = mat_vec(motion.C_BN, vec_sub(motion.v_BN_N, vec(air.velocity_N)));
    const Vec3 pressure_B = vec_scale(-0.5 * air.density * par.Cd * vec_norm(v_B), v_B);
    push(vec_scale(par.area, pressure_B), vec_unit(v_B), motion, loads,
         [&](std::size_t i, const Vec3 &, double cosine) { return vec_scale(par.areas[i] * cosine, pressure_B); });
}

} // namespace fledge::world
