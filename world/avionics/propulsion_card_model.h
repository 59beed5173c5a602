// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/avionics/propulsion_card.h.
#pragma once

#include "world/avionics/propulsion_card.h"
#include "world/sensors/sensor.h"

namespace fledge::world {

class PropulsionCardModel final : public LimitedSensor<PropulsionCard, THRUSTERS_MAX + 1> {
public:
    using LimitedSensor::LimitedSensor;
    void reset(sim::Ns t) override;
    void update(Tick tick) override;

private:
    void command(std::size_t i, Tick tick);
    void shut(std::size_t i, Tick tick);
    void report();
};

} // namespace fledge::world
