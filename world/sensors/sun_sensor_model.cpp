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
    const Mat3 BN = mrp_to_dcm(truth.sigma_BN), case_B = mrp_to_dcm(mrp_turn(par.misalignment));
    Vec3 s_S = mat_vec(case_B, vec_unit(mat_vec(BN, to_sun())));
    const auto views = [&](const Vec3 &a) {
        return vec_dot(vec_unit(par.boresight_B), a) >= fm_cos(par.view) && vec_norm2(a) > 0.0;
    };
    const bool in_view = views(s_S);
    const auto seen = elements(tick.t, truth.r_BN_N);
    if (!seen.empty()) { // the mean of all light
        const double sunlight = planet_->sunlight(tick.t, 0.0);
        s_S = vec_scale(head_written(light.head) ? light.visible : 1.0, s_S);
        for (const auto &element : seen) {
            const Vec3 towards_S = mat_vec(case_B, mat_vec(BN, vec(element.towards_N)));
            const double share = (1.0 - par.rejection) * element.reflected / sunlight;
            s_S = views(towards_S) ? vec_add(s_S, vec_scale(share, towards_S)) : s_S;
        }
        s_S = vec_unit(s_S);
    }
    Vec3 s = mat_vec(mrp_to_dcm(mrp_turn(turn)), s_S);
    const bool lit = !head_written(light.head) || (light.visible > 0.0 && light.visible >= par.visible_min);
    const bool speaks = state_.faults.replace(0, s.v, -1.0, 1.0) && in_view && lit;
    const Quality quality =
        quality_min(quality_through(truth.head), quality_min(quality_optional(sun.head), quality_optional(light.head)));
    out.head = head_of_reading(out.head, tick.t, quality, speaks);
    out.s_B = speaks ? s : out.s_B;
}

} // namespace fledge::world
