// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/avionics/vehicle_clock.h. All of its state is in the interface.
//
// Example:
//
//     using namespace world;
//     VehicleClock clock{};
//     VehicleClockModel model(clock);
//     const auto method = sim::make_rk4();
//     model.prepare({"world.clock", 1, method.get()});
//     model.reset(0);
//     model.update({.t = 100'000'000, .dt = 100'000'000}); // clock.out.reading
#pragma once

#include "sim/model.h"
#include "world/avionics/vehicle_clock.h"

namespace fledge::world {

class VehicleClockModel final : public sim::Model {
public:
    explicit VehicleClockModel(VehicleClock &interface) : interface_(interface) {}

    void prepare(const sim::Setup &setup) override;
    void reset(sim::Ns t) override;
    void update(Tick tick) override;

private:
    VehicleClock &interface_;
};

} // namespace fledge::world
