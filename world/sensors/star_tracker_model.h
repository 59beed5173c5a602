// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/sensors/star_tracker.h.
#pragma once

#include "world/sensors/sensor.h"
#include "world/sensors/star_tracker.h"

namespace fledge::world {

class StarTrackerModel final : public LimitedSensor<StarTracker, 3, Late<StarAttitude>> {
public:
    /// The bits of `mem.blind`: by what the tracker is blind.
    enum Blind : std::uint32_t { by_sun = 1, by_planet = 2, by_moon = 4, by_rate = 8, by_loss = 16 };

    using LimitedSensor::LimitedSensor;
    void update(Tick tick) override;

private:
    void check() const override;
    std::uint32_t blinded_by(double dt, const Vec3 &boresight_B);
};

} // namespace fledge::world
