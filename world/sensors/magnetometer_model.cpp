// SPDX-License-Identifier: Apache-2.0
#include "world/sensors/magnetometer_model.h"

namespace fledge::world {

void MagnetometerModel::update(Tick tick)
{
    const auto &[truth, field, injected] = interface_.in;
    MeasuredField &out = interface_.out.measured;
    Vec3 B = vec_add(mat_vec(mrp_to_dcm(truth.sigma_BN), field.B_N), interface_.par.residual_B);
    const bool speaks = read(tick, B);
    const Quality quality = quality_min(quality_through(truth.head), quality_through(field.head));
    out.head = head_of_reading(out.head, tick.t, quality, speaks);
    out.B_B = speaks ? B : out.B_B;
}

} // namespace fledge::world
