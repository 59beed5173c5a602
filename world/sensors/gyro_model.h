// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/sensors/gyro.h.
#pragma once

#include "world/sensors/gyro.h"
#include "world/sensors/triad.h"

namespace fledge::world {

class GyroModel final : public Triad<Gyro> {
public:
    using Triad::Triad;
    void update(Tick tick) override;
};

} // namespace fledge::world
