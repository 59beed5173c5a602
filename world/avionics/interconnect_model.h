// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/avionics/interconnect.h. All of its state is in the interface.
#pragma once

#include "sim/model.h"
#include "world/avionics/interconnect.h"

namespace fledge::world {

class InterconnectModel final : public sim::Model {
public:
    explicit InterconnectModel(Interconnect &interface) : interface_(interface) {}

    void prepare(const sim::Setup &setup) override;
    void reset(sim::Ns t) override;
    void update(Tick tick) override;

private:
    Interconnect &interface_;
};

} // namespace fledge::world
