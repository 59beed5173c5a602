// SPDX-License-Identifier: Apache-2.0
#include "world/sensors/sun_sensor_model.h"

namespace fledge::world {

void SunSensorModel::update(Tick tick)
{
    const auto &[truth, sun, light, injected] = interface_.in;
    const auto &par = interface_.par;
    SunHeading &out = interface_.out.heading;
    const double dt = tick_seconds(tick.dt);
    const double deviation = fm_sqrt(par.deviation * par.deviation + (dt > 0.0 ? par.noise / dt : 0.0));

    Vec3 turn = vec_scale(deviation, normals());
    begin_faults(tick.t);
    state_.faults.add(0, turn.v);
    const Vec3 s_S =
        mat_vec(mrp_to_dcm(mrp_turn(par.misalignment)), vec_unit(mat_vec(mrp_to_dcm(truth.sigma_BN), to_sun())));
    Vec3 s = mat_vec(mrp_to_dcm(mrp_turn(turn)), s_S);
    const bool in_view = vec_dot(vec_unit(par.boresight_B), s_S) >= fm_cos(par.view) && vec_norm2(s_S) > 0.0;
    const bool lit = !head_written(light.head) || (light.visible > 0.0 && light.visible >= par.visible_min);
    const bool speaks = state_.faults.replace(0, s.v, -1.0, 1.0) && in_view && lit;
    const Quality quality =
        quality_min(quality_through(truth.head), quality_min(quality_optional(sun.head), quality_optional(light.head)));
    out.head = head_of_reading(out.head, tick.t, quality, speaks);
    out.s_B = speaks ? s : out.s_B;
}

} // namespace fledge::world
