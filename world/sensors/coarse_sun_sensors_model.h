// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/sensors/coarse_sun_sensors.h. All of its state is in the interface.
#pragma once

#include "sim/model.h"
#include "world/sensors/coarse_sun_sensors.h"

namespace fledge::world {

class CoarseSunSensorsModel final : public sim::Model {
public:
    explicit CoarseSunSensorsModel(CoarseSunSensors &interface) : interface_(interface) {}

    void prepare(const sim::Setup &) override {}
    void reset(sim::Ns) override { interface_.out = {}; }
    void update(Tick tick) override;

private:
    CoarseSunSensors &interface_;
};

} // namespace fledge::world
