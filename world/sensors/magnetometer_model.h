// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/sensors/magnetometer.h.
#pragma once

#include "world/sensors/magnetometer.h"
#include "world/sensors/triad.h"

namespace fledge::world {

class MagnetometerModel final : public Triad<Magnetometer> {
public:
    using Triad::Triad;
    void update(Tick tick) override;
};

} // namespace fledge::world
