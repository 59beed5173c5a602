// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/sensors/gyro.h.
//
// Example:
//
//     using namespace world;
//     Gyro gyro{};
//     GyroModel model(gyro);
//     const auto method = sim::make_rk4();
//     model.prepare({"world.gyro", 1, method.get()});
//     model.reset(0);
//     gyro.in.truth.omega_BN_B = vec3(0.0, 0.0, 0.01);
//     model.update({.t = 100'000'000, .dt = 100'000'000}); // gyro.out.rate
#pragma once

#include "world/sensors/gyro.h"
#include "world/sensors/triad.h"

namespace fledge::world {

class GyroModel final : public Triad<Gyro> {
public:
    using Triad::Triad;
    void update(Tick tick) override;
};

} // namespace fledge::world
