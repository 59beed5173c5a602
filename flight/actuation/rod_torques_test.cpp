// SPDX-License-Identifier: Apache-2.0
// The cross-product law: what a field lets rods give, with the least dipole.
#include "flight/testing/poison.h"

extern "C" {
#include "flight/actuation/rod_torques.h"
}

#include <gtest/gtest.h>

namespace flight::testing {
namespace rod_torques_test {

constexpr std::int64_t second = 1'000'000'000;

RodTorques any(Random &random, int n, double m_max = 0)
{
    RodTorques m{};
    m.in.torque = {good(), vec(random.vector(1e-3))};
    m.in.field = {good(), vec(random.direction() * random.real(2e-5, 6e-5))};
    m.in.rods.head = good();
    m.in.rods.n = static_cast<std::uint32_t>(n);
    for (int i = 0; i < n; i++) {
        m.in.rods.axes_B[i] = vec(i < 3 ? (Vector3d::Unit(i) + random.vector(0.3)).normalized() : random.direction());
        m.in.rods.m_max[i] = m_max;
    }
    m.par.field_min = 1e-6;
    return m;
}

Vector3d dipole(const RodTorques &m)
{
    Vector3d sum = Vector3d::Zero();
    for (std::uint32_t i = 0; i < m.in.rods.n; i++) {
        sum += m.out.command.dipole[i] * eigen(m.in.rods.axes_B[i]);
    }
    return sum;
}

TEST(RodTorques, gives_all_of_the_torque_but_what_is_along_the_field)
{
    Random random{1};
    for (int i = 0; i < 1000; i++) {
        RodTorques m = any(random, 3 + i % 6);
        rod_torques_update(&m, {0, 0});
        const Vector3d L = eigen(m.in.torque.torque_B), B = eigen(m.in.field.B_B), b = B.normalized();
        const Vector3d given = dipole(m).cross(B);
        EXPECT_LT((given - (L - L.dot(b) * b)).norm(), 1e-14);
        EXPECT_LT((given - eigen(m.out.achieved.torque_B)).norm(), 1e-16);
        EXPECT_LT(std::abs(dipole(m).dot(b)), 1e-10 * dipole(m).norm()) << "no part of it is idle";
        EXPECT_EQ(m.out.command.head.quality, QUALITY_GOOD);
    }
}

TEST(RodTorques, saturation_keeps_the_direction)
{
    Random random{2};
    int limited = 0;
    for (int i = 0; i < 300; i++) {
        RodTorques m = any(random, 3, 10), free = m;
        std::fill(free.in.rods.m_max, free.in.rods.m_max + 8, 0.0);
        rod_torques_update(&m, {0, 0});
        rod_torques_update(&free, {0, 0});
        const Vector3d given = eigen(m.out.achieved.torque_B), wanted = eigen(free.out.achieved.torque_B);
        EXPECT_LT(given.cross(wanted).norm(), 1e-12 * given.norm() * wanted.norm() + 1e-20);
        EXPECT_LE(*std::max_element(m.out.command.dipole, m.out.command.dipole + 8), 10 + 1e-12);
        limited += static_cast<int>(m.mem.saturated);
        EXPECT_EQ(given.norm() < 0.999 * wanted.norm(), m.mem.saturated == 1) << i;
    }
    EXPECT_GT(limited, 50);
}

TEST(RodTorques, two_rods_and_a_weak_field_are_degraded)
{
    Random random{3};
    RodTorques m = any(random, 2);
    rod_torques_update(&m, {0, 0});
    EXPECT_EQ(m.out.command.head.quality, QUALITY_DEGRADED);
    m = any(random, 3);
    m.in.field.B_B = vec3(1e-7, 0, 0);
    rod_torques_update(&m, {0, 0});
    EXPECT_EQ(dipole(m).norm(), 0.0);
    EXPECT_EQ(m.out.command.head.quality, QUALITY_DEGRADED);
    EXPECT_EQ(m.out.achieved.head.sequence, 1u);
}

TEST(RodTorques, the_dipoles_end_without_new_data)
{
    for (const Quality lost : {QUALITY_NONE, QUALITY_STALE, QUALITY_DEGRADED, QUALITY_GOOD}) {
        for (const bool field : {false, true}) {
            Random random{4};
            RodTorques m = any(random, 3);
            m.par.hold = 3;
            rod_torques_update(&m, {0, 0});
            (field ? m.in.field.head : m.in.torque.head).quality = lost;
            if (lost == QUALITY_GOOD) {
                (field ? m.in.field.B_B : m.in.torque.torque_B).v[1] = NAN;
            }
            for (int k = 1; k < 8; k++) {
                rod_torques_update(&m, {k * second, second});
                EXPECT_EQ(dipole(m).norm() > 0, k <= 3);
                EXPECT_EQ(vec_norm(m.out.achieved.torque_B) > 0, k <= 3);
                EXPECT_EQ(m.out.command.head.quality, QUALITY_DEGRADED);
            }
        }
    }
}

} // namespace rod_torques_test
} // namespace flight::testing
