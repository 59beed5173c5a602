// SPDX-License-Identifier: Apache-2.0
#include "world/sensors/gyro_model.h"

namespace fledge::world {

void GyroModel::update(Tick tick)
{
    const CraftState &truth = interface_.in.truth;
    GyroRate &out = interface_.out.rate;
    Vec3 rate = truth.omega_BN_B;
    const bool speaks = read(tick, rate);
    out.head = head_of_reading(out.head, tick.t, quality_through(truth.head), speaks);
    out.omega_BN_B = speaks ? rate : out.omega_BN_B;
}

} // namespace fledge::world
