// SPDX-License-Identifier: Apache-2.0
#include "world/sensors/craft_sensor_model.h"

namespace fledge::world {

void CraftSensorModel::update(Tick tick)
{
    const auto &[truth, other, injected] = interface_.in;
    const auto &par = interface_.par;
    SeenCraft &out = interface_.out.seen;
    const Mat3 C_BN = mrp_to_dcm(truth.sigma_BN), C_TN = mrp_to_dcm(other.sigma_BN);
    Vec3 r = mat_vec(C_BN, vec_sub(other.r_BN_N, truth.r_BN_N));
    Vec3 v = mat_vec(C_BN, vec_sub(other.v_BN_N, truth.v_BN_N));
    Vec3 omega = vec_sub(mat_vec(C_BN, mat_transpose_vec(C_TN, other.omega_BN_B)), truth.omega_BN_B);

    const double distance = vec_norm(r);
    const Vec3 sight = vec_unit(r), boresight = vec_unit(par.boresight_B);
    const bool in_view =
        vec_norm2(boresight) == 0.0 || vec_dot(sight, boresight) >= (par.view > 0.0 ? fm_cos(par.view) : 0.0);
    const bool near = par.range_max == 0.0 || distance <= par.range_max;

    // White noise of the deviation `across` in all directions, and more or less along the line of sight.
    const double across = par.bearing_noise * distance, along = par.range_noise + par.range_share * distance;
    const Vec3 white = normals();
    r = vec_add(r, vec_add(vec_scale(across, white), vec_scale((along - across) * vec_dot(white, sight), sight)));
    v = vec_add(v, vec_scale(par.velocity_noise, normals()));
    Vec3 turn = vec_scale(par.attitude_noise, normals());
    omega = vec_add(omega, vec_scale(par.rate_noise, normals()));

    Faults<12> &faults = state_.faults;
    begin_faults(tick.t);
    faults.add(6, turn.v);
    Vec3 sigma = mrp_compose(mrp_turn(turn), mrp_relative(other.sigma_BN, truth.sigma_BN));
    bool speaks = faults.apply(0, r.v);
    speaks |= faults.apply(3, v.v);
    speaks |= faults.replace(6, sigma.v, -1.0, 1.0);
    speaks |= faults.apply(9, omega.v);
    speaks = speaks && in_view && near;

    const Quality quality = quality_min(quality_through(truth.head), quality_through(other.head));
    out.head = head_of_reading(out.head, tick.t, quality, speaks);
    if (speaks) {
        out.r_TB_B = r;
        out.v_TB_B = v;
        out.sigma_TB = sigma;
        out.omega_TB_B = omega;
    }
}

} // namespace fledge::world
