// SPDX-License-Identifier: Apache-2.0
#include "world/sensors/accelerometer_model.h"

namespace fledge::world {

void AccelerometerModel::update(Tick tick)
{
    const CraftState &truth = interface_.in.truth;
    const Vec3 &r = interface_.par.r_AB_B, &omega = truth.omega_BN_B;
    SpecificForce &out = interface_.out.force;
    const Vec3 pushed_N = vec_sub(truth.a_BN_N, truth.g_CN_N);
    const Vec3 turning = vec_add(vec_cross(truth.domega_BN_B, r), vec_cross(omega, vec_cross(omega, r)));
    Vec3 force = vec_add(mat_vec(mrp_to_dcm(truth.sigma_BN), pushed_N), turning);
    const bool speaks = read(tick, force);
    out.head = head_of_reading(out.head, tick.t, quality_through(truth.head), speaks);
    out.f_B = speaks ? force : out.f_B;
}

} // namespace fledge::world
