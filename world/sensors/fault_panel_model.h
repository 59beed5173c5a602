// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/sensors/fault_panel.h. All of its state is in the interface.
#pragma once

#include "sim/model.h"
#include "world/sensors/fault_panel.h"

namespace fledge::world {

class FaultPanelModel final : public sim::Model {
public:
    explicit FaultPanelModel(FaultPanel &interface) : interface_(interface) {}

    void prepare(const sim::Setup &) override {}
    void reset(sim::Ns) override { interface_.out = {}; }
    void update(Tick tick) override;

private:
    FaultPanel &interface_;
};

} // namespace fledge::world
