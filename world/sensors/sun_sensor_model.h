// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/sensors/sun_sensor.h.
#pragma once

#include "world/sensors/sun_sensor.h"
#include "world/sensors/sunlight_sensor.h"

namespace fledge::world {

class SunSensorModel final : public SunlightSensor<SunSensor, 3> {
public:
    using SunlightSensor::SunlightSensor;
    void update(Tick tick) override;
};

} // namespace fledge::world
