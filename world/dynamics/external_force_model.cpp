// SPDX-License-Identifier: Apache-2.0
#include "world/dynamics/external_force_model.h"

#include <cstring>

namespace fledge::world {

void ExternalForceModel::start(const Vec3 &, double *)
{
    held_ = {};
}

bool ExternalForceModel::latch(const double *, const BodyRate &, double dt)
{
    const ForceTorque &in = interface_.in.external;
    const Held before = held_;
    held_ = {};
    if (dt > 0.0 && head_written(in.head)) {
        held_ = {in.force_N, in.force_B, in.torque_B};
    }
    return std::memcmp(&before, &held_, sizeof before) != 0;
}

void ExternalForceModel::derive(const double *, const Motion &, double *, Loads &loads) const
{
    loads.force_N = vec_add(loads.force_N, held_.force_N);
    loads.force_B = vec_add(loads.force_B, held_.force_B);
    loads.torque = vec_add(loads.torque, held_.torque_B);
}

} // namespace fledge::world
