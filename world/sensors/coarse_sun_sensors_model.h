// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/sensors/coarse_sun_sensors.h.
#pragma once

#include "world/sensors/coarse_sun_sensors.h"
#include "world/sensors/sensor.h"

namespace fledge::world {

class CoarseSunSensorsModel final : public Sensor<CoarseSunSensors, SUN_SENSORS_MAX> {
public:
    using Sensor::Sensor;
    void update(Tick tick) override;

private:
    void check() const override
    {
        Sensor::check();
        check_sun();
    }
    bool limited() const override { return true; }
};

} // namespace fledge::world
