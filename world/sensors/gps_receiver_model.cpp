// SPDX-License-Identifier: Apache-2.0
// The error that wanders, of standard deviation s and correlation time T, sampled exactly:
//
//   x_k = e x_(k-1) + s sqrt(1 - e^2) n,   e = exp(-dt / T),   x_0 = s n.
#include "world/sensors/gps_receiver_model.h"

namespace fledge::world {

void GpsReceiverModel::wander(double dt)
{
    const auto &par = interface_.par;
    auto &mem = interface_.mem;
    const double stays = mem.started ? (par.wander_time > 0.0 ? fm_exp(-dt / par.wander_time) : 1.0) : 0.0;
    mem.started = 1;
    for (int i = 0; i < 3; i++) {
        mem.wandered.v[i] = stays * mem.wandered.v[i] + par.wander.v[i] * fm_sqrt(1.0 - stays * stays) * normal();
    }
}

void GpsReceiverModel::update(Tick tick)
{
    const auto &par = interface_.par;
    const CraftState &truth = interface_.in.truth;
    const Mat3 C_BN = mrp_to_dcm(truth.sigma_BN);
    NavOrbit reading{};
    wander(tick_seconds(tick.dt));
    reading.r_BN_N = vec_add(vec_add(truth.r_BN_N, mat_transpose_vec(C_BN, par.r_AB_B)), interface_.mem.wandered);
    reading.v_BN_N = vec_add(truth.v_BN_N, mat_transpose_vec(C_BN, vec_cross(truth.omega_BN_B, par.r_AB_B)));
    for (int i = 0; i < 3; i++) {
        reading.r_BN_N.v[i] += par.position_noise.v[i] * normal();
        reading.v_BN_N.v[i] += par.velocity_noise.v[i] * normal();
    }
    begin_faults(tick.t);
    bool speaks = state_.faults.apply(0, reading.r_BN_N.v);
    speaks |= state_.faults.apply(3, reading.v_BN_N.v);
    reading.head = {tick.t, quality_through(truth.head), 0};
    state_.readings.publish(reading, speaks, par.latency, tick.t, interface_.out.orbit);
}

} // namespace fledge::world
