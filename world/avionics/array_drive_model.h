// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/avionics/array_drive.h.
#pragma once

#include "world/avionics/array_drive.h"
#include "world/sensors/sensor.h"

namespace fledge::world {

class ArrayDriveModel final : public LimitedSensor<ArrayDrive, ARRAYS_MAX> {
public:
    using LimitedSensor::LimitedSensor;
    void update(Tick tick) override;
};

} // namespace fledge::world
