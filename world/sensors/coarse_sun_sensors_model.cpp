// SPDX-License-Identifier: Apache-2.0
#include "world/sensors/coarse_sun_sensors_model.h"

#include "flight/math/attitude.h"

#include <algorithm>

namespace fledge::world {

void CoarseSunSensorsModel::update(Tick tick)
{
    const auto &[truth, sun, light, injected] = interface_.in;
    const auto &par = interface_.par;
    SunCurrents &out = interface_.out.currents;
    const double visible = head_written(light.head) ? light.visible : 1.0;
    const Vec3 s_B = vec_unit(mat_vec(mrp_to_dcm(truth.sigma_BN), to_sun()));
    begin_faults(tick.t);
    for (std::uint32_t i = 0; i < par.n; i++) {
        const double cosine = vec_dot(vec_unit(par.axes_B[i]), s_B);
        const bool sees = cosine > 0.0 && (par.view[i] == 0.0 || cosine >= fm_cos(par.view[i]));
        double current = sees ? par.current[i] * cosine * visible : 0.0;
        state_.faults.apply(i, {&current, 1}, 0.0, par.current[i]);
        out.current[i] = std::clamp(current, 0.0, par.current[i]);
    }
    out.head = head_next(out.head, tick.t,
                         quality_min(quality_through(truth.head),
                                     quality_min(quality_optional(sun.head), quality_optional(light.head))));
}

} // namespace fledge::world
