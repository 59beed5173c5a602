// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/sensors/sun_sensor.h.
#pragma once

#include "world/sensors/sensor.h"
#include "world/sensors/sun_sensor.h"

namespace fledge::world {

class SunSensorModel final : public Sensor<SunSensor, 3> {
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
