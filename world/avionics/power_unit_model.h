// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/avionics/power_unit.h.
#pragma once

#include "world/avionics/power_unit.h"
#include "world/sensors/sensor.h"

namespace fledge::world {

class PowerUnitModel final : public Sensor<PowerUnit, SWITCH_CARDS + 1> {
public:
    using Sensor::Sensor;
    void reset(sim::Ns t) override;
    void update(Tick tick) override;

private:
    bool limited() const override { return true; }
};

} // namespace fledge::world
