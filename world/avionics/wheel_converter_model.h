// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/avionics/wheel_converter.h. All of its state is in the interface.
#pragma once

#include "sim/model.h"
#include "world/avionics/wheel_converter.h"

namespace fledge::world {

class WheelConverterModel final : public sim::Model {
public:
    explicit WheelConverterModel(WheelConverter &interface) : interface_(interface) {}

    void prepare(const sim::Setup &) override {}
    void reset(sim::Ns t) override;
    void update(Tick tick) override;

private:
    WheelConverter &interface_;
};

} // namespace fledge::world
