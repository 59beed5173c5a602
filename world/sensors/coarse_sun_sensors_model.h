// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/sensors/coarse_sun_sensors.h.
#pragma once

#include "world/sensors/coarse_sun_sensors.h"
#include "world/sensors/sunlight_sensor.h"

namespace fledge::world {

class CoarseSunSensorsModel final : public SunlightSensor<CoarseSunSensors, SUN_SENSORS_MAX> {
public:
    using SunlightSensor::SunlightSensor;
    void update(Tick tick) override;
};

} // namespace fledge::world
