// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/avionics/solar_array.h. All of its state is in the interface.
#pragma once

#include "sim/model.h"
#include "world/avionics/solar_array.h"

namespace fledge::world {

class SolarArrayModel final : public sim::Model {
public:
    explicit SolarArrayModel(SolarArray &interface) : interface_(interface) {}

    void prepare(const sim::Setup &) override {}
    void reset(sim::Ns) override { interface_.out = {}; }
    void update(Tick tick) override;

private:
    SolarArray &interface_;
};

} // namespace fledge::world
