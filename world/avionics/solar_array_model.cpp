// SPDX-License-Identifier: Apache-2.0
#include "world/avionics/solar_array_model.h"

#include "flight/math/attitude.h"

#include <algorithm>

namespace fledge::world {

void SolarArrayModel::update(Tick tick)
{
    const auto &[truth, light, angles] = interface_.in;
    const auto &par = interface_.par;
    const Mat3 BN = mrp_to_dcm(truth.sigma_BN);
    const Vec3 s_B = mat_vec(BN, light.s_N);
    const auto seen = elements(tick.t, truth.r_BN_N);
    double area = 0.0;      // that the Sun sees
    double reflected = 0.0; // [W] from the planet
    for (std::uint32_t i = 0; i < par.n; i++) {
        Vec3 normal = vec_unit(par.normals_B[i]);
        if (head_written(angles.head) && vec_norm2(par.axes_B[i]) > 0.0) {
            // A DCM turns frames: the panel turns the other way.
            const Vec3 turn = vec_scale(angles.theta[i], vec_unit(par.axes_B[i]));
            normal = mat_transpose_vec(mrp_to_dcm(mrp_turn(turn)), normal);
        }
        area += par.areas[i] * std::max(vec_dot(normal, s_B), 0.0);
        const Vec3 normal_N = seen.empty() ? Vec3{} : mat_transpose_vec(BN, normal);
        for (const auto &element : seen) {
            const double cosine = vec_dot(normal_N, vec(element.towards_N));
            reflected += par.areas[i] * std::max(cosine, 0.0) * element.reflected;
        }
    }
    ArrayPower &out = interface_.out.array;
    out = {head_next(out.head, tick.t, quality_min(quality_through(truth.head), quality_through(light.head))),
           par.efficiency * area * light.irradiance + par.efficiency * reflected};
}

} // namespace fledge::world
