// SPDX-License-Identifier: Apache-2.0
// The rate servo on the equations of motion, alone and behind MRP steering.
#include "flight/testing/linear.h"
#include "flight/testing/poison.h"

extern "C" {
#include "flight/control/mrp_steering.h"
#include "flight/control/rate_servo.h"
#include "flight/math/attitude.h"
}

#include <gtest/gtest.h>

namespace flight::testing {
namespace rate_servo_test {

constexpr std::int64_t second = 1'000'000'000;

RateServo any(Random &random, std::uint32_t n)
{
    RateServo m{};
    m.in.error = {good(), random.mrp(), vec(random.vector()), vec(random.vector()), vec(random.vector())};
    m.in.command = {good(), vec(random.vector()), vec(random.vector())};
    m.in.vehicle = {good(), mat(random.spd(100))};
    m.in.external = {good(), vec(random.vector())};
    m.in.wheels.head = m.in.speeds.head = n > 0 ? good() : Head{};
    m.in.wheels.n = n;
    for (std::uint32_t i = 0; i < n; i++) {
        m.in.wheels.axes_B[i] = vec(random.direction());
        m.in.wheels.J[i] = random.real(0.01, 1);
        m.in.speeds.Omega[i] = random.real(-500, 500);
    }
    m.par.P = mat(random.spd(10));
    return m;
}

TEST(RateServo, lyapunov_function_falls_as_the_damping_alone)
{
    Random random{1};
    for (int i = 0; i < 3000; i++) {
        RateServo m = any(random, static_cast<std::uint32_t>(i % 5));
        m.par.K_I = i % 2 ? random.real(0, 5) : 0;
        m.mem.z = vec(random.vector());
        const Matrix3d I = eigen(m.in.vehicle.I_B);
        const Vector3d omega_BR = eigen(m.in.error.omega_BR_B), omega_RN = eigen(m.in.error.omega_RN_B);
        const Vector3d omega_BN = omega_BR + omega_RN, omega_BD = omega_BR - eigen(m.in.command.omega_DR_B);
        Vector3d H = I * omega_BN;
        for (std::uint32_t k = 0; k < m.in.wheels.n; k++) {
            const Vector3d g = eigen(m.in.wheels.axes_B[k]);
            H += m.in.wheels.J[k] * (omega_BN.dot(g) + m.in.speeds.Omega[k]) * g;
        }
        const Vector3d z = m.par.K_I > 0 ? eigen(m.mem.z) : Vector3d::Zero();
        rate_servo_update(&m, {0, 0});
        const Vector3d torque = eigen(m.out.torque.torque_B) + eigen(m.in.external.torque_B);
        const Vector3d domega_BN = solve(I, torque - omega_BN.cross(H));
        const Vector3d domega_RN = eigen(m.in.error.domega_RN_B) - omega_BN.cross(omega_RN); // derivative in B
        const Vector3d domega_BD = domega_BN - domega_RN - eigen(m.in.command.domega_DR_B);
        const double dV = omega_BD.dot(I * domega_BD) + m.par.K_I * z.dot(omega_BD);
        const double damping = omega_BD.dot(eigen(m.par.P) * omega_BD);
        EXPECT_NEAR(dV, -damping, 1e-13 * (H.norm() * 10 + damping + (I * domega_BN).norm() * omega_BD.norm()));
        EXPECT_LT(dV, 0);
    }
}

TEST(RateServo, behind_steering_a_large_turn_keeps_to_the_rate_limit_and_ends_at_the_reference)
{
    Random random{2};
    for (int run = 0; run < runs(10); run++) {
        RateServo servo{};
        MrpSteering steering{};
        const Matrix3d I = random.spd(50);
        steering.par = {0.15, 1.0, 0.02};
        servo.par.P = mat(30.0 * I / I.trace() * 10);
        servo.in.vehicle = {good(), mat(I)};
        Vec3 sigma = random.mrp();
        Vector3d omega = Vector3d::Zero();
        double fastest = 0;
        for (int k = 0; k < 8000; k++) {
            steering.in.error = {good(), sigma, vec(omega), {}, {}};
            mrp_steering_update(&steering, {k * second / 10, second / 10});
            servo.in.error = steering.in.error;
            servo.in.command = steering.out.command;
            rate_servo_update(&servo, {k * second / 10, second / 10});
            omega += 0.1 * solve(I, eigen(servo.out.torque.torque_B) - omega.cross(I * omega));
            sigma = mrp_short(vec_add(sigma, vec_scale(0.1, mrp_rate(sigma, vec(omega)))));
            fastest = std::max(fastest, omega.cwiseAbs().maxCoeff());
        }
        EXPECT_LT(fastest, 0.0201);
        EXPECT_LT(vec_norm(sigma), 1e-6);
        EXPECT_LT(omega.norm(), 1e-6);
    }
}

TEST(RateServo, integral_removes_a_constant_torque_and_does_not_wind_up)
{
    for (const double limit : {0.0, 0.01}) {
        RateServo m{};
        m.in.vehicle = {good(), mat_identity()};
        m.par.P = mat(2 * Matrix3d::Identity());
        m.par.K_I = 0.5;
        m.par.u_I_max = limit;
        Vector3d omega = Vector3d::Zero();
        const Vector3d L(0.03, -0.05, 0.02);
        for (int k = 0; k < 3000; k++) {
            m.in.error = {good(), {}, vec(omega), {}, {}};
            m.in.command.head = good();
            rate_servo_update(&m, {k * second / 20, k ? second / 20 : 0});
            omega += 0.05 * (eigen(m.out.torque.torque_B) + L);
        }
        if (limit > 0) {
            EXPECT_LT((m.par.K_I * eigen(m.mem.z) - Vector3d(0.01, -0.01, 0.01)).norm(), 1e-12);
            EXPECT_NEAR(omega[0], (0.03 - 0.01) / 2, 1e-9);
        } else {
            EXPECT_LT(omega.norm(), 1e-9);
            EXPECT_LT((m.par.K_I * eigen(m.mem.z) - L).norm(), 1e-8);
        }
    }
}

TEST(RateServo, holds_against_bad_numbers_and_ends_without_new_data)
{
    Random random{3};
    RateServo m = any(random, 3);
    m.par.hold = 3;
    rate_servo_update(&m, {0, 0});
    auto &in = m.in;
    expect_held(
        m,
        doubles(in.error.omega_BR_B, in.error.omega_RN_B, in.error.domega_RN_B, in.command.omega_DR_B,
                in.command.domega_DR_B, in.vehicle.I_B, in.external.torque_B, m.par.P, in.wheels.axes_B[2],
                in.wheels.J[0], in.speeds.Omega[1]),
        [](RateServo &x) {
            rate_servo_update(&x, {second, second});
        },
        [](RateServo &x) { return std::vector{&x.out.torque.head}; });
    for (Head *head : {&in.error.head, &in.command.head}) {
        for (const Quality lost : {QUALITY_NONE, QUALITY_STALE, QUALITY_DEGRADED}) {
            RateServo servo = m;
            Head *its = head == &in.error.head ? &servo.in.error.head : &servo.in.command.head;
            its->quality = lost;
            for (int k = 1; k < 8; k++) {
                rate_servo_update(&servo, {k * second, second});
                EXPECT_EQ(servo.out.torque.head.quality, QUALITY_DEGRADED);
                EXPECT_EQ(vec_norm(servo.out.torque.torque_B) > 0, k <= 3) << k;
            }
        }
    }
}

} // namespace rate_servo_test
} // namespace flight::testing
