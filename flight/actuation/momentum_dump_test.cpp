// SPDX-License-Identifier: Apache-2.0
// The decay of the wheels' momentum against its closed form.
#include "flight/testing/poison.h"

extern "C" {
#include "flight/actuation/momentum_dump.h"
}

#include <gtest/gtest.h>

namespace flight::testing {
namespace momentum_dump_test {

constexpr std::int64_t second = 1'000'000'000;

MomentumDump with(const Vector3d &h)
{
    MomentumDump m{};
    m.in.wheels.head = m.in.speeds.head = good();
    m.in.wheels.n = 3;
    for (int i = 0; i < 3; i++) {
        m.in.wheels.axes_B[i] = vec(Vector3d::Unit(i));
        m.in.wheels.J[i] = 0.5;
        m.in.speeds.Omega[i] = h[i] / 0.5;
    }
    m.par.gain = 0.01;
    return m;
}

/// What the wheels take up in a second of the torque.
void take_up(MomentumDump &m)
{
    for (int i = 0; i < 3; i++) {
        m.in.speeds.Omega[i] += m.out.torque.torque_B.v[i] / 0.5;
    }
}

TEST(MomentumDump, momentum_decays_to_what_is_wanted)
{
    const Vector3d h(3, -2, 1), wanted(0.5, 0.5, 0);
    MomentumDump m = with(h);
    m.par.h_wanted_B = vec(wanted);
    for (int k = 0; k < 500; k++) {
        momentum_dump_update(&m, {k * second, k ? second : 0});
        const Vector3d now = 0.5 * Vector3d(m.in.speeds.Omega[0], m.in.speeds.Omega[1], m.in.speeds.Omega[2]);
        EXPECT_LT((now - wanted - (h - wanted) * std::pow(0.99, k)).norm(), 1e-12);
        EXPECT_LT((eigen(m.out.torque.torque_B) + 0.01 * (now - wanted)).norm(), 1e-14);
        take_up(m);
    }
    EXPECT_EQ(m.mem.dumps, 1u);
}

TEST(MomentumDump, begins_at_one_size_and_ends_at_another_and_keeps_to_its_limit)
{
    MomentumDump m = with({0, 0, 2.9});
    m.par = {{}, 1, 0.1, 3, 1, 0};
    momentum_dump_update(&m, {0, 0});
    EXPECT_EQ(vec_norm(m.out.torque.torque_B), 0.0);
    m.in.speeds.Omega[2] = 3.1 / 0.5;
    int updates = 0;
    for (int k = 1; k < 60; k++) {
        momentum_dump_update(&m, {k * second, second});
        const double torque = m.out.torque.torque_B.v[2];
        EXPECT_TRUE(torque == 0.0 || std::abs(torque + 0.1) < 1e-15);
        updates += torque != 0.0;
        take_up(m);
    }
    EXPECT_EQ(updates, 21) << "from 3.1 to 1 by 0.1 a second";
    EXPECT_EQ(m.mem.dumping, 0u);
    EXPECT_EQ(m.mem.dumps, 1u);
}

TEST(MomentumDump, ends_without_new_speeds)
{
    for (const Quality lost : {QUALITY_NONE, QUALITY_STALE, QUALITY_DEGRADED, QUALITY_GOOD}) {
        MomentumDump m = with({3, 0, 0});
        m.par.hold = 3;
        momentum_dump_update(&m, {0, 0});
        m.in.speeds.head.quality = lost;
        if (lost == QUALITY_GOOD) {
            m.in.speeds.Omega[1] = NAN;
        }
        for (int k = 1; k < 8; k++) {
            momentum_dump_update(&m, {k * second, second});
            EXPECT_EQ(vec_norm(m.out.torque.torque_B) > 0, k <= 3);
            EXPECT_EQ(m.out.torque.head.quality, QUALITY_DEGRADED);
        }
    }
}

} // namespace momentum_dump_test
} // namespace flight::testing
