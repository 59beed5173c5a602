// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/avionics/gyro_electronics.h.
#pragma once

#include "world/avionics/gyro_electronics.h"
#include "world/sensors/sensor.h"

namespace fledge::world {

class GyroElectronicsModel final : public Sensor<GyroElectronics, 3> {
public:
    using Sensor::Sensor;
    void update(Tick tick) override;

private:
    bool limited() const override { return true; }
};

} // namespace fledge::world
