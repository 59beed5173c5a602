// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/avionics/sun_sensor_converter.h.
#pragma once

#include "world/avionics/sun_sensor_converter.h"
#include "world/sensors/sensor.h"

namespace fledge::world {

class SunSensorConverterModel final : public LimitedSensor<SunSensorConverter, SUN_SENSORS_MAX> {
public:
    using LimitedSensor::LimitedSensor;
    void update(Tick tick) override;

private:
    void check() const override;
};

} // namespace fledge::world
