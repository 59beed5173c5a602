// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/avionics/wheel_converter.h.
#pragma once

#include "world/avionics/wheel_converter.h"
#include "world/sensors/sensor.h"

namespace fledge::world {

class WheelConverterModel final : public Sensor<WheelConverter, 2 * WHEELS_MAX> {
public:
    using Sensor::Sensor;
    void update(Tick tick) override;
};

} // namespace fledge::world
