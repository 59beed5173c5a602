// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/avionics/power_unit.h.
#pragma once

#include "world/avionics/power_unit.h"
#include "world/sensors/sensor.h"

namespace fledge::world {

class PowerUnitModel final : public LimitedSensor<PowerUnit, SWITCH_CARDS + 1> {
public:
    using LimitedSensor::LimitedSensor;
    void reset(sim::Ns t) override;
    void update(Tick tick) override;
};

} // namespace fledge::world
