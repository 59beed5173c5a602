// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/avionics/star_tracker_electronics.h.
#pragma once

#include "world/avionics/star_tracker_electronics.h"
#include "world/sensors/sensor.h"

namespace fledge::world {

class StarTrackerElectronicsModel final : public LimitedSensor<StarTrackerElectronics, 4> {
public:
    using LimitedSensor::LimitedSensor;
    void update(Tick tick) override;
};

} // namespace fledge::world
