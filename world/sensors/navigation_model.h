// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/sensors/navigation.h.
#pragma once

#include "world/sensors/navigation.h"
#include "world/sensors/sensor.h"

namespace fledge::world {

class NavigationModel final : public Sensor<Navigation, 12> {
public:
    using Sensor::Sensor;
    void prepare(const sim::Setup &setup) override;
    void refresh() override;
    void update(Tick tick) override;

private:
    void take_parameters();
    Vec3 error(const Vec3 &bias, const Vec3 &deviation);
    void write(sim::Ns t, const Vec3 &mrp, const Vec3 &rate, const Vec3 &position, const Vec3 &velocity);
    [[gnu::noinline]] void update_faultily(sim::Ns t, Vec3 turn, const Vec3 &rate, const Vec3 &position,
                                           const Vec3 &velocity);

    Vec3 bias_turn_{};   ///< the MRP of attitude_bias
    bool noisy_ = false; ///< whether there is any noise
};

} // namespace fledge::world
