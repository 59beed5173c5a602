// SPDX-License-Identifier: Apache-2.0
#include "world/sensors/accelerometer_model.h"

namespace fledge::world {

void AccelerometerModel::update(Tick tick)
{
    const CraftState &truth = interface_.in.truth;
    const Vec3 &r = interface_.par.r_AB_B, &omega = truth.omega_BN_B;
    SpecificForce &out = interface_.out.force;
    CraftState &before = interface_.mem.before;
    const Mat3 BN = mrp_to_dcm(truth.sigma_BN);
    const double dt = tick_seconds(tick.dt);
    Vec3 force;
    if (dt > 0.0) {
        const Mat3 B0N = mrp_to_dcm(before.sigma_BN);
        const Vec3 v0_N = vec_add(before.v_BN_N, mat_transpose_vec(B0N, vec_cross(before.omega_BN_B, r)));
        const Vec3 v_N = vec_add(truth.v_BN_N, mat_transpose_vec(BN, vec_cross(omega, r)));
        const Vec3 fallen_N = vec_scale(0.5 * dt, vec_add(before.g_CN_N, truth.g_CN_N));
        const Vec3 pushed_N = vec_sub(vec_sub(v_N, v0_N), fallen_N);
        force = vec_scale(0.5 / dt, vec_add(mat_vec(B0N, pushed_N), mat_vec(BN, pushed_N)));
    } else {
        const Vec3 pushed_N = vec_sub(truth.a_BN_N, truth.g_CN_N);
        const Vec3 turning = vec_add(vec_cross(truth.domega_BN_B, r), vec_cross(omega, vec_cross(omega, r)));
        force = vec_add(mat_vec(BN, pushed_N), turning);
    }
    before = truth;
    const bool speaks = read(tick, force);
    out.head = head_of_reading(out.head, tick.t, quality_through(truth.head), speaks);
    out.f_B = speaks ? force : out.f_B;
    out.dv_B = speaks ? vec_add(out.dv_B, vec_scale(dt, force)) : out.dv_B;
}

} // namespace fledge::world
