// SPDX-License-Identifier: Apache-2.0
#include "world/dynamics/gravity_gradient_model.h"

#include "sim/error.h"
#include "world/dynamics/spacecraft_model.h"

namespace fledge::world {

void GravityGradientModel::join(const sim::Model &spacecraft)
{
    craft_ = &dynamic_cast<const SpacecraftModel &>(spacecraft);
}

void GravityGradientModel::start(const Vec3 &, double *)
{
    if (craft_->gravity().empty()) {
        throw sim::SetupError(name_ + ": no body attracts the spacecraft; give it its `gravity`");
    }
    interface_.out = {};
}

void GravityGradientModel::derive(const double *, const Motion &motion, double *, Loads &loads) const
{
    torque_B_ = craft_->gravity_torque(motion, loads);
    loads.torque = vec_add(loads.torque, torque_B_);
}

void GravityGradientModel::publish(sim::Ns t, const double *, const Vec3 &)
{
    ForceTorque &load = interface_.out.load;
    load = {head_next(load.head, t, QUALITY_GOOD), {}, {}, torque_B_};
}

} // namespace fledge::world
