// SPDX-License-Identifier: Apache-2.0
// Forces of thrusters against the torque that they give.
#include "flight/testing/poison.h"

extern "C" {
#include "flight/actuation/thruster_mapping.h"
}

#include <gtest/gtest.h>

namespace flight::testing {
namespace thruster_mapping_test {

constexpr std::int64_t second = 1'000'000'000;

/// Four, in pairs that turn about b3 in both directions.
ThrusterMapping couples()
{
    ThrusterMapping m{};
    m.in.torque = {good(), vec3(0, 0, 2)};
    m.in.thrusters.head = good();
    m.in.thrusters.n = 4;
    for (int i = 0; i < 4; i++) {
        m.in.thrusters.r_TC_B[i] = vec3(i < 2 ? 1 : -1, 0, 0);
        m.in.thrusters.axes_B[i] = vec3(0, i % 2 ? -1 : 1, 0);
        m.in.thrusters.F_max[i] = 5;
    }
    return m;
}

Vector3d force_of(const ThrusterMapping &m, Vector3d *torque = nullptr)
{
    Vector3d force = Vector3d::Zero(), sum = Vector3d::Zero();
    for (std::uint32_t i = 0; i < m.in.thrusters.n; i++) {
        const Vector3d F = m.out.forces.F[i] * eigen(m.in.thrusters.axes_B[i]);
        force += F;
        sum += eigen(m.in.thrusters.r_TC_B[i]).cross(F);
    }
    if (torque) {
        *torque = sum;
    }
    return force;
}

/// Thrusters that can turn in every direction.
ThrusterMapping any(Random &random, int n)
{
    ThrusterMapping m{};
    m.in.torque.head = m.in.thrusters.head = good();
    m.in.thrusters.n = static_cast<std::uint32_t>(n);
    for (int i = 0; i < n; i++) {
        m.in.thrusters.r_TC_B[i] = vec(random.vector());
        m.in.thrusters.axes_B[i] = vec(random.direction());
        m.in.thrusters.F_max[i] = 1e9;
    }
    return m;
}

TEST(ThrusterMapping, forces_only_push_and_give_the_torque)
{
    Random random{1};
    int reached = 0;
    for (int i = 0; i < 1500; i++) {
        ThrusterMapping m = any(random, 4 + i % 5);
        m.in.torque.torque_B = vec(random.vector());
        thruster_mapping_update(&m, {0, 0});
        Vector3d torque;
        force_of(m, &torque);
        for (double F : m.out.forces.F) {
            EXPECT_GE(F, 0.0);
        }
        EXPECT_LT((torque - eigen(m.out.achieved.torque_B)).norm(), 1e-11 * (1 + torque.norm()));
        if (m.out.forces.head.quality == QUALITY_GOOD) {
            EXPECT_LT((torque - eigen(m.in.torque.torque_B)).norm(), 1e-6);
            reached++;
        } else {
            // The nearest: what is missing pulls at no thruster.
            const Vector3d missing = eigen(m.in.torque.torque_B) - torque;
            for (int k = 0; k < static_cast<int>(m.in.thrusters.n); k++) {
                const Vector3d d = eigen(vec_cross(m.in.thrusters.r_TC_B[k], m.in.thrusters.axes_B[k]));
                EXPECT_LT(d.dot(missing), 1e-6);
            }
        }
    }
    EXPECT_GT(reached, 500);
}

TEST(ThrusterMapping, torque_and_force_together)
{
    Random random{2};
    int reached = 0;
    for (int i = 0; i < 500; i++) {
        ThrusterMapping m = any(random, 8);
        const ThrusterSet &set = m.in.thrusters;
        Vector3d force = Vector3d::Zero(), torque = Vector3d::Zero();
        for (int k = 0; k < 8; k++) { // what some forces give can be given
            const Vector3d F = std::max(0.0, random.real(-5, 5)) * eigen(set.axes_B[k]);
            force += F;
            torque += eigen(set.r_TC_B[k]).cross(F);
        }
        m.in.torque.torque_B = vec(torque);
        m.in.force = {good(), vec(force)};
        thruster_mapping_update(&m, {0, 0});
        Vector3d given;
        EXPECT_LT((force_of(m, &given) - force).norm(), 1e-6 * (force.norm() + torque.norm()) + 1e-15);
        EXPECT_LT((given - torque).norm(), 1e-6 * (force.norm() + torque.norm()) + 1e-15);
        reached += m.out.forces.head.quality == QUALITY_GOOD;
    }
    EXPECT_EQ(reached, 500);
}

TEST(ThrusterMapping, uses_couples_and_available_thrusters)
{
    ThrusterMapping m = couples();
    thruster_mapping_update(&m, {0, 0});
    const double couple[] = {1, 0, 0, 1};
    for (int i = 0; i < 4; i++) {
        EXPECT_NEAR(m.out.forces.F[i], couple[i], 1e-6);
    }
    m.in.availability = {good(), {1, 1, 1, 0}};
    thruster_mapping_update(&m, {0, 0});
    EXPECT_NEAR(m.out.forces.F[0], 2, 1e-8);
    EXPECT_EQ(m.out.forces.F[3], 0.0);
    EXPECT_EQ(m.out.forces.head.quality, QUALITY_GOOD);
    m.in.torque.torque_B = vec3(0, 0, 20); // beyond its limit
    thruster_mapping_update(&m, {0, 0});
    EXPECT_NEAR(m.out.forces.F[0], 5, 1e-12);
    EXPECT_NEAR(m.out.achieved.torque_B.v[2], 5, 1e-12);
    EXPECT_EQ(m.mem.saturated, 1u);
    m.in.torque.torque_B = vec3(1, 0, 0); // none can
    thruster_mapping_update(&m, {0, 0});
    EXPECT_EQ(m.out.forces.head.quality, QUALITY_DEGRADED);
}

TEST(ThrusterMapping, closes_engines_partly_for_a_torque)
{
    ThrusterMapping m{};
    m.in.torque.head = m.in.thrusters.head = good();
    m.in.thrusters.n = 4;
    m.par.off_pulse = 1;
    Random random{3};
    for (int i = 0; i < 4; i++) {
        const double x = i % 2 ? 1 : -1, y = i / 2 ? 1 : -1; // tilted, in turn to both sides
        m.in.thrusters.r_TC_B[i] = vec3(x, y, -1);
        m.in.thrusters.axes_B[i] = vec(Vector3d(-0.1 * x, 0.1 * y, 1).normalized());
        m.in.thrusters.F_max[i] = 22;
    }
    for (int i = 0; i < 300; i++) {
        const Vector3d wanted = random.vector(1);
        m.in.torque.torque_B = vec(wanted);
        thruster_mapping_update(&m, {0, 0});
        Vector3d torque;
        const Vector3d force = force_of(m, &torque);
        EXPECT_LT((torque - wanted).norm(), 1e-6);
        EXPECT_GT(force.z(), 60) << "they go on pushing";
        EXPECT_NEAR(*std::max_element(m.out.forces.F, m.out.forces.F + 4), 22, 1e-9) << "one is fully open";
    }
}

TEST(ThrusterMapping, engines_in_balance_stay_open_where_nothing_is_wanted)
{
    Random random{4};
    for (int run = 0; run < 100; run++) {
        ThrusterMapping m = couples();
        m.par.off_pulse = 1;
        m.in.torque.torque_B = vec3(0, 0, 0);
        for (int i = 0; i < 4; i += 2) { // in pairs, but for a rounding
            const double arm = random.real(0.1, 1), F = random.real(1, 9), other = random.real(1, 9);
            for (int k = i; k < i + 2; k++) {
                m.in.thrusters.axes_B[k] = vec3(0, 1, 0);
                m.in.thrusters.r_TC_B[k] = vec3(k == i ? arm : -arm * F / other, 0.3, 0);
                m.in.thrusters.F_max[k] = k == i ? F : other;
            }
        }
        thruster_mapping_update(&m, {0, 0});
        EXPECT_EQ(m.out.forces.head.quality, QUALITY_GOOD);
        for (int i = 0; i < 4; i++) {
            EXPECT_NEAR(m.out.forces.F[i], m.in.thrusters.F_max[i], 1e-9);
        }
    }
}

TEST(ThrusterMapping, an_old_force_ends_and_the_torque_goes_on)
{
    ThrusterMapping m = couples();
    m.par.hold = 3;
    m.in.force = {good(), vec3(0, 1, 0)};
    for (int k = 0; k < 8; k++) {
        thruster_mapping_update(&m, {k * second, k ? second : 0});
        m.in.force.head.quality = QUALITY_STALE;
        EXPECT_NEAR(force_of(m).y(), k <= 3 ? 1 : 0, 1e-8) << k;
        EXPECT_NEAR(m.out.achieved.torque_B.v[2], 2, 1e-8);
        EXPECT_EQ(m.out.forces.head.quality, k ? QUALITY_DEGRADED : QUALITY_GOOD);
    }
}

TEST(ThrusterMapping, thrusters_out_of_use_stay_shut)
{
    Random random{11};
    for (int i = 0; i < 300; i++) {
        ThrusterMapping m = any(random, 8);
        m.par.off_pulse = i % 2;
        m.in.torque.torque_B = vec(random.vector());
        m.in.availability.head = good();
        for (int k = 0; k < 8; k++) {
            m.in.thrusters.F_max[k] = 20;
            m.in.availability.available[k] = k != i % 8 && k != i % 7;
        }
        thruster_mapping_update(&m, {0, 0});
        EXPECT_EQ(m.out.forces.F[i % 8], 0.0);
        EXPECT_EQ(m.out.forces.F[i % 7], 0.0);
        for (int k = 0; k < 8 && !m.par.off_pulse; k++) {
            EXPECT_EQ(m.mem.pushing >> k & 1u, m.out.forces.F[k] > 0.0);
        }
        Vector3d torque;
        force_of(m, &torque);
        EXPECT_LT((torque - eigen(m.out.achieved.torque_B)).norm(), 1e-9 * (1 + torque.norm()));
    }
}

TEST(ThrusterMapping, without_a_result_the_forces_are_held)
{
    ThrusterMapping m = couples();
    thruster_mapping_update(&m, {0, 0});
    const ThrusterMapping before = m;
    m.in.thrusters.r_TC_B[3].v[0] = NAN;
    thruster_mapping_update(&m, {second, second});
    EXPECT_TRUE(same_content(m.out.forces, before.out.forces));
    EXPECT_EQ(m.out.forces.head.sequence, before.out.forces.head.sequence);
    EXPECT_EQ(m.out.achieved.head.quality, QUALITY_DEGRADED);
}

TEST(ThrusterMapping, the_forces_end_without_new_data)
{
    for (const Quality lost : {QUALITY_NONE, QUALITY_STALE, QUALITY_DEGRADED, QUALITY_GOOD}) {
        ThrusterMapping m = couples();
        m.par.hold = 3;
        thruster_mapping_update(&m, {0, 0});
        m.in.torque.head.quality = lost;
        if (lost == QUALITY_GOOD) {
            m.in.torque.torque_B.v[1] = NAN;
        }
        for (int k = 1; k < 8; k++) {
            thruster_mapping_update(&m, {k * second, second});
            EXPECT_EQ(vec_norm(m.out.achieved.torque_B) > 0, k <= 3);
            EXPECT_EQ(*std::max_element(m.out.forces.F, m.out.forces.F + 8) > 0, k <= 3);
            EXPECT_EQ(m.out.forces.head.quality, QUALITY_DEGRADED);
        }
    }
}

} // namespace thruster_mapping_test
} // namespace flight::testing
