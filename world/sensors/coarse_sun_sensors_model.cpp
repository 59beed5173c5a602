// SPDX-License-Identifier: Apache-2.0
#include "world/sensors/coarse_sun_sensors_model.h"

#include "flight/math/attitude.h"

#include <algorithm>

namespace fledge::world {

void CoarseSunSensorsModel::update(Tick tick)
{
    const auto &[truth, sun] = interface_.in;
    const auto &par = interface_.par;
    SunCurrents &out = interface_.out.currents;
    const Vec3 s_N = head_written(sun.head) ? vec_sub(sun.r_PN_N, truth.r_BN_N) : par.s_N;
    const Vec3 s_B = vec_unit(mat_vec(mrp_to_dcm(truth.sigma_BN), s_N));
    for (std::uint32_t i = 0; i < par.n; i++) {
        const double cosine = vec_dot(vec_unit(par.axes_B[i]), s_B);
        const bool sees = cosine > 0.0 && (par.view[i] == 0.0 || cosine >= fm_cos(par.view[i]));
        out.current[i] = sees ? par.current[i] * cosine : 0.0;
    }
    out.head = head_next(out.head, tick.t, quality_min(quality_through(truth.head), quality_optional(sun.head)));
}

} // namespace fledge::world
