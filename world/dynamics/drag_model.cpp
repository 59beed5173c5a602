// SPDX-License-Identifier: Apache-2.0
#include "world/dynamics/drag_model.h"

#include "world/eigen.h"

namespace fledge::world {

void DragModel::prepare(const sim::Setup &setup)
{
    name_ = setup.name;
    if (interface_.par.n == 0 && interface_.par.area == 0.0) {
        throw sim::SetupError(name_ + ".area is 0 m^2, and there are no facets: nothing feels the air");
    }
    refresh();
}

void DragModel::refresh()
{
    for (std::size_t i = 0; i < interface_.par.n; i++) {
        normals_B_[i] = vec_unit(interface_.par.normals_B[i]);
    }
    changed_ = true;
}

void DragModel::start(const Vec3 &, double *)
{
    air_.check(name_, "air");
    interface_.out = {};
}

bool DragModel::latch(const double *, const BodyRate &, double)
{
    const bool changed = air_.changed() || changed_;
    changed_ = false;
    return changed;
}

void DragModel::derive(const double *, const Motion &motion, double *, Loads &loads) const
{
    const auto &par = interface_.par;
    const AtmosphereModel::State air = air_->at(motion.start, motion.tau, view(motion.r_BN_N));
    const Vec3 v_B = mat_vec(motion.C_BN, vec_sub(motion.v_BN_N, vec(air.velocity_N)));
    const Vec3 pressure_B = vec_scale(-0.5 * air.density * par.Cd * vec_norm(v_B), v_B);
    Loads own{};
    if (par.n == 0) {
        own.push(vec_scale(par.area, pressure_B), vec_sub(par.centre_B, motion.r_CB_B));
    }
    const Vec3 way_B = vec_unit(v_B);
    for (std::size_t i = 0; i < par.n; i++) {
        if (const double cosine = vec_dot(normals_B_[i], way_B); cosine > 0.0) {
            own.push(vec_scale(par.areas[i] * cosine, pressure_B), vec_sub(par.centres_B[i], motion.r_CB_B));
        }
    }
    loads.force_B = vec_add(loads.force_B, own.force_B);
    loads.torque = vec_add(loads.torque, own.torque);
    load_ = own;
}

void DragModel::publish(sim::Ns t, const double *, const Vec3 &)
{
    ForceTorque &load = interface_.out.load;
    load = {head_next(load.head, t, QUALITY_GOOD), {}, load_.force_B, load_.torque};
}

void DragModel::copy_setup(const sim::Model &original,
                           const std::function<sim::Model *(const sim::Model *)> &counterpart)
{
    air_.copy(dynamic_cast<const DragModel &>(original).air_, counterpart);
}

} // namespace fledge::world
