// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/avionics/propulsion_card.h. All of its state is in the interface.
#pragma once

#include "sim/model.h"
#include "world/avionics/propulsion_card.h"

namespace fledge::world {

class PropulsionCardModel final : public sim::Model {
public:
    explicit PropulsionCardModel(PropulsionCard &interface) : interface_(interface) {}

    void prepare(const sim::Setup &setup) override;
    void reset(sim::Ns t) override;
    void update(Tick tick) override;

private:
    PropulsionCard &interface_;
};

} // namespace fledge::world
