// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/sensors/craft_sensor.h.
#pragma once

#include "world/sensors/craft_sensor.h"
#include "world/sensors/sensor.h"

namespace fledge::world {

class CraftSensorModel final : public Sensor<CraftSensor, 12> {
public:
    using Sensor::Sensor;
    void update(Tick tick) override;
};

} // namespace fledge::world
