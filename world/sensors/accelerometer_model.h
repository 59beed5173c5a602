// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/sensors/accelerometer.h.
#pragma once

#include "world/sensors/accelerometer.h"
#include "world/sensors/triad.h"

namespace fledge::world {

class AccelerometerModel final : public Triad<Accelerometer> {
public:
    using Triad::Triad;
    void update(Tick tick) override;
};

} // namespace fledge::world
