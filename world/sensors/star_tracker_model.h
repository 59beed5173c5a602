// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/sensors/star_tracker.h.
#pragma once

#include "world/sensors/sensor.h"
#include "world/sensors/star_tracker.h"

namespace fledge::world {

class StarTrackerModel final : public Sensor<StarTracker, 3, Late<StarAttitude>> {
public:
    using Sensor::Sensor;
    void update(Tick tick) override;

private:
    void check() const override;
    bool limited() const override { return true; }
    std::uint32_t blind(double dt, const Vec3 &boresight_B);
};

} // namespace fledge::world
