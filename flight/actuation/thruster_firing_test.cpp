// SPDX-License-Identifier: Apache-2.0
// Pulses against the forces that they stand for.
#include "flight/testing/poison.h"

extern "C" {
#include "flight/actuation/thruster_firing.h"
}

#include <gtest/gtest.h>

namespace flight::testing {
namespace thruster_firing_test {

constexpr std::int64_t ms = 1'000'000;

struct Firing {
    ThrusterFiring m{};
    std::int64_t t = 0;

    Firing()
    {
        m.in.thrusters.head = good();
        m.in.thrusters.n = 2;
        m.in.thrusters.F_max[0] = m.in.thrusters.F_max[1] = 4;
        m.par = {0.5, 0.02, 0.75, 0.25};
    }

    /// [ns] How long thruster 0 is open from this update on.
    std::int64_t fire(double F)
    {
        m.in.forces.head = good(t);
        m.in.forces.F[0] = F;
        thruster_firing_update(&m, {t, t ? 500 * ms : 0});
        const std::int64_t open = std::max<std::int64_t>(0, m.out.times.off[0] - t);
        t += 500 * ms;
        return open;
    }
};

TEST(ThrusterFiring, the_mean_force_is_the_wanted_one)
{
    Firing f;
    Random random{1};
    for (int i = 0; i < 300; i++) {
        const double F = random.real(0.2, 3.99);
        EXPECT_NEAR(4 * static_cast<double>(f.fire(F)) / 0.5e9, F, 1e-8);
        EXPECT_EQ(f.m.out.times.burns[0], i + 1u);
        EXPECT_EQ(f.m.out.times.burns[1], 0u);
    }
}

TEST(ThrusterFiring, without_thrusters_nothing_opens)
{
    Firing f;
    f.m.in.thrusters.n = 0;
    EXPECT_EQ(f.fire(3), 0);
    EXPECT_EQ(f.m.out.times.burns[0], 0u);
    EXPECT_EQ(f.m.mem.opened, 0u);
    EXPECT_EQ(f.m.out.times.head.quality, QUALITY_GOOD);
}

TEST(ThrusterFiring, short_pulses_are_decided_by_a_schmitt_trigger)
{
    Firing f;
    const double least = 4 * 0.02 / 0.5; // [N] of the shortest pulse
    EXPECT_EQ(f.fire(0), 0);
    EXPECT_EQ(f.fire(0.5 * least), 0) << "between the levels it stays shut";
    EXPECT_EQ(f.fire(0.74 * least), 0);
    EXPECT_EQ(f.fire(0.76 * least), 20 * ms);
    EXPECT_EQ(f.fire(0.5 * least), 20 * ms) << "and stays in use";
    EXPECT_EQ(f.fire(0.26 * least), 20 * ms);
    EXPECT_EQ(f.fire(0.24 * least), 0);
    EXPECT_EQ(f.fire(0.5 * least), 0);
    EXPECT_EQ(f.fire(-1), 0);
    EXPECT_EQ(f.m.out.times.burns[0], 3u);
}

TEST(ThrusterFiring, a_full_force_leaves_it_open_without_a_gap)
{
    Firing f;
    for (int i = 0; i < 5; i++) {
        EXPECT_EQ(f.fire(i % 2 ? 4 : 400), 500 * ms);
        EXPECT_EQ(f.m.out.times.on[0], 0);
        EXPECT_EQ(f.m.out.times.burns[0], 1u);
    }
    EXPECT_EQ(f.fire(1), 125 * ms);
    EXPECT_EQ(f.m.out.times.burns[0], 1u) << "it closes in the same burn";
    EXPECT_EQ(f.fire(1), 125 * ms);
    EXPECT_EQ(f.m.out.times.burns[0], 2u);
}

TEST(ThrusterFiring, opens_nothing_on_data_that_are_lost)
{
    for (const Quality lost : {QUALITY_NONE, QUALITY_STALE, QUALITY_DEGRADED, QUALITY_GOOD}) {
        Firing f;
        f.fire(2);
        const std::int64_t at = f.t;
        f.m.in.forces.head.quality = lost;
        for (int k = 0; k < 4; k++, f.t += 500 * ms) {
            if (lost == QUALITY_GOOD) {
                f.m.in.forces.head.t = f.t;
                f.m.in.forces.F[0] = NAN;
            }
            thruster_firing_update(&f.m, {f.t, 500 * ms});
            EXPECT_EQ(f.m.out.times.head.quality, QUALITY_DEGRADED);
            EXPECT_LE(f.m.out.times.off[0], lost == QUALITY_DEGRADED ? at + 250 * ms : 250 * ms);
        }
    }
    for (const double F : {2.0, double{NAN}}) { // one force alone would turn the body
        Firing f;
        f.m.in.forces.F[1] = F;
        EXPECT_EQ(f.fire(2), F > 0 ? 250 * ms : 0);
        EXPECT_EQ(f.m.out.times.off[1], f.m.out.times.off[0]);
    }
    Firing early; // the next command comes before a pulse has ended
    early.fire(2);
    early.t = 100 * ms;
    early.fire(0);
    EXPECT_EQ(early.m.out.times.off[0], 100 * ms);
    Firing never;
    thruster_firing_update(&never.m, {0, 0});
    EXPECT_TRUE(all_zero(never.m.out));
}

} // namespace thruster_firing_test
} // namespace flight::testing
