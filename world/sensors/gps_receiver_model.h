// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/sensors/gps_receiver.h.
#pragma once

#include "world/sensors/gps_receiver.h"
#include "world/sensors/sensor.h"

namespace fledge::world {

class GpsReceiverModel final : public Sensor<GpsReceiver, 6, Late<NavOrbit>> {
public:
    using Sensor::Sensor;
    void update(Tick tick) override;

private:
    void wander(double dt);
};

} // namespace fledge::world
