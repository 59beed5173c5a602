// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/avionics/power_unit.h. All of its state is in the interface.
#pragma once

#include "sim/model.h"
#include "world/avionics/power_unit.h"

namespace fledge::world {

class PowerUnitModel final : public sim::Model {
public:
    explicit PowerUnitModel(PowerUnit &interface) : interface_(interface) {}

    void prepare(const sim::Setup &setup) override;
    void reset(sim::Ns t) override;
    void update(Tick tick) override;

private:
    PowerUnit &interface_;
};

} // namespace fledge::world
