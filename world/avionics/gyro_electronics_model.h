// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/avionics/gyro_electronics.h.
#pragma once

#include "world/avionics/gyro_electronics.h"
#include "world/sensors/sensor.h"

namespace fledge::world {

class GyroElectronicsModel final : public LimitedSensor<GyroElectronics, 3> {
public:
    using LimitedSensor::LimitedSensor;
    void update(Tick tick) override;
};

} // namespace fledge::world
