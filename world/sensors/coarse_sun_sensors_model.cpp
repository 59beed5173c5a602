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
    const Mat3 BN = mrp_to_dcm(truth.sigma_BN);
    const Vec3 s_B = vec_unit(mat_vec(BN, to_sun()));
    const auto seen_of_planet = elements(tick.t, truth.r_BN_N);
    const double sunlight = seen_of_planet.empty() ? 0.0 : planet_->sunlight(tick.t, 0.0);
    begin_faults(tick.t);
    for (std::uint32_t i = 0; i < par.n; i++) {
        const Vec3 axis_B = vec_unit(par.axes_B[i]);
        const Vec3 axis_N = seen_of_planet.empty() ? Vec3{} : mat_transpose_vec(BN, axis_B);
        const double edge = par.view[i] == 0.0 ? 0.0 : fm_cos(par.view[i]);
        const auto seen = [&](double cosine) { return cosine > 0.0 && cosine >= edge ? cosine : 0.0; };
        double current = par.current[i] * seen(vec_dot(axis_B, s_B)) * visible;
        for (const auto &element : seen_of_planet) {
            const double cosine = seen(vec_dot(axis_N, vec(element.towards_N)));
            current += par.current[i] * cosine * element.reflected / sunlight;
        }
        const double most = std::max(par.current[i], current);
        state_.faults.apply(i, {&current, 1}, 0.0, par.current[i]);
        out.current[i] = std::clamp(current, 0.0, most);
    }
    out.head = head_next(out.head, tick.t,
                         quality_min(quality_through(truth.head),
                                     quality_min(quality_optional(sun.head), quality_optional(light.head))));
}

} // namespace fledge::world
