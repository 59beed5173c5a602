// SPDX-License-Identifier: Apache-2.0
#include "world/avionics/array_drive_model.h"

#include "world/testing/flyer.h"

#include <gtest/gtest.h>

namespace array_drive_model_test {

using namespace fledge::world;
using namespace fledge::world::testing;

struct Drive {
    ArrayDrive i{};
    ArrayDriveModel model{i};
    Ns t = 0;

    Drive()
    {
        i.par.n = 2;
        i.par.load = 5;
        i.par.step = 1e-3;
        i.par.rate = 25.0;
        i.par.count = 2e-3;
        i.in.command.head.quality = QUALITY_GOOD;
        model.prepare({"world.drive", 1, nullptr});
        model.reset(0);
        model.update({0, 0});
    }
    void step(Ns dt = 100 * ms)
    {
        t += dt;
        model.update({t, dt});
    }
    double angle(std::size_t k = 0) const { return i.out.angles.theta[k]; }
};

TEST(ArrayDrive, ItGoesToItsTargetByWholeStepsAtItsRate)
{
    for (const int target : {400, -400}) {
        Drive d;
        d.i.in.command.target[1] = target;
        const double sign = target > 0 ? 1.0 : -1.0;
        for (int k = 1; k <= 200; k++) {
            d.step();
            const double steps = std::min(std::floor(2.5 * k + 1e-9), 400.0); // 2.5 in an update
            ASSERT_NEAR(d.angle(1), sign * 1e-3 * steps, 1e-12) << k;
            ASSERT_EQ(d.i.out.state.moving, steps < 400 ? 0b10u : 0u);
            ASSERT_NEAR(d.i.out.state.position[1], sign * steps / 2, 0.5);
            ASSERT_EQ(d.i.out.panels.theta[1], d.angle(1));
        }
        EXPECT_EQ(d.i.out.state.position[1], target / 2);
        EXPECT_EQ(d.angle(0), 0.0);
    }
}

TEST(ArrayDrive, WithoutPowerOrWithAFaultItHoldsItsPositionAndStopsEndIt)
{
    Drive d;
    d.i.par.range = 30;
    d.i.par.n_faults = 1;
    d.i.par.faults[0] = {FAULT_DEAD, 1u << 0, 0.0, 250 * ms, second};
    d.i.in.command.target[0] = d.i.in.command.target[1] = 1000;
    while (d.t < 1200 * ms) {
        d.step();
    }
    EXPECT_NEAR(d.angle(0), 0.005, 1e-12);
    EXPECT_NEAR(d.angle(1), 0.030, 1e-12) << "the stop";
    EXPECT_EQ(d.i.out.state.moving, 0u);
    d.i.in.power.head.quality = QUALITY_GOOD;
    const std::uint32_t counter = d.i.out.state.counter;
    d.i.in.command.target[1] = 0;
    while (d.t < 2 * second) {
        d.step();
    }
    EXPECT_NEAR(d.angle(1), 0.030, 1e-12);
    EXPECT_EQ(d.i.out.state.counter, counter);
    d.i.in.power.on = 1u << 5;
    while (d.t < 4 * second) {
        d.step();
    }
    EXPECT_NEAR(d.angle(0), 0.030, 1e-12);
    EXPECT_EQ(d.angle(1), 0.0);
}

} // namespace array_drive_model_test
