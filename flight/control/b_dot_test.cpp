// SPDX-License-Identifier: Apache-2.0
// A tumble ends in the field as the closed form says, from the gyro or from the field alone.
#include "flight/testing/poison.h"

extern "C" {
#include "flight/control/b_dot.h"
}

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

namespace flight::testing {
namespace {

constexpr std::int64_t second = 1'000'000'000;

BDot any(double gain)
{
    BDot m{};
    m.par.gain = gain;
    m.par.field_min = 1e-7;
    return m;
}

/// A body in a field that rests in N, stepped by h [s] with the torque that rods can give of the one wanted.
struct Tumbler {
    Matrix3d inertia = Matrix3d::Identity();
    Vector3d omega_B = Vector3d::Zero(), B_N = Vector3d(0, 0, 3e-5);
    Matrix3d dcm_BN = Matrix3d::Identity();

    Vector3d field() const { return dcm_BN * B_N; }
    double energy() const { return 0.5 * omega_B.dot(inertia * omega_B); }

    void step(const Vector3d &wanted, double h)
    {
        const Vector3d b = field().normalized(), torque = wanted - wanted.dot(b) * b;
        const Vector3d momentum = inertia * omega_B;
        omega_B += h * inertia.ldlt().solve(torque - omega_B.cross(momentum));
        const double angle = h * omega_B.norm();
        if (angle > 0) {
            dcm_BN = Eigen::AngleAxisd(-angle, omega_B.normalized()).toRotationMatrix() * dcm_BN;
        }
    }
};

/// Fly for `updates` of a second, of ten steps each.
template <class Look> void fly(BDot &m, Tumbler &body, int updates, bool gyro, const Look &look)
{
    for (int k = 0; k < updates; k++) {
        const std::int64_t t = k * second;
        m.in.field = {{t, QUALITY_GOOD, static_cast<std::uint32_t>(k + 1)}, vec(body.field())};
        if (gyro) {
            m.in.gyro = {good(t), vec(body.omega_B)};
        }
        b_dot_update(&m, {t, k ? second : 0});
        look(k);
        for (int i = 0; i < 10; i++) {
            body.step(eigen(m.out.torque.torque_B), 0.1);
        }
    }
}

TEST(BDot, the_rate_across_the_field_of_a_sphere_decays_exponentially)
{
    for (const bool gyro : {true, false}) {
        BDot m = any(0.02);
        Tumbler body;
        body.inertia *= 2;
        body.omega_B = {0.03, -0.02, 0.05};
        const Vector3d across = {0.03, -0.02, 0}; // with an axis of symmetry, the rate rests in the body but for this
        fly(m, body, 200, gyro, [](int) {});
        const double decay = std::exp(-0.02 / 2 * 200);
        const Vector3d b = body.field().normalized();
        const Vector3d left = body.omega_B - body.omega_B.dot(b) * b;
        EXPECT_NEAR(left.norm(), across.norm() * decay, (gyro ? 0.02 : 0.04) * across.norm() * decay) << gyro;
        EXPECT_NEAR(body.omega_B.dot(b), 0.05, 1e-4) << "rods give nothing along the field";
        EXPECT_EQ(m.out.torque.head.quality, QUALITY_GOOD);
    }
}

TEST(BDot, the_field_tells_the_rate_across_it)
{
    Random random{1};
    for (int i = 0; i < 500; i++) {
        BDot m = any(1);
        const Vector3d omega = random.direction() * random.real(0, 0.1),
                       B = random.direction() * random.real(2e-5, 6e-5);
        for (int k = 0; k < 2; k++) {
            const Vector3d now = Eigen::AngleAxisd(-0.1 * k * omega.norm(), omega.normalized()) * B;
            m.in.field = {{k * second / 10, QUALITY_GOOD, 1}, vec(now)};
            b_dot_update(&m, {k * second / 10, k * second / 10});
        }
        const Vector3d half = Eigen::AngleAxisd(-0.05 * omega.norm(), omega.normalized()) * B;
        const Vector3d b = half.normalized();
        EXPECT_LT((eigen(m.out.rate.omega_BN_B) - (omega - omega.dot(b) * b)).norm(), 2e-5 * omega.norm());
    }
}

TEST(BDot, the_energy_of_any_body_falls)
{
    Random random{2};
    for (int i = 0; i < 20; i++) {
        BDot m = any(0.01);
        Tumbler body;
        body.inertia = Vector3d(1, 1.5, 2).asDiagonal();
        body.dcm_BN = random.attitude();
        body.omega_B = random.direction() * 0.05;
        double last = body.energy();
        fly(m, body, 300, true, [&](int) {
            EXPECT_LT(body.energy(), last * (1 + 2e-4)); // of the steps, which are of first order
            last = body.energy();
        });
        EXPECT_LT(last, 0.9 * 0.5 * 2 * 0.05 * 0.05);
    }
}

TEST(BDot, the_rods_rest_while_the_field_is_measured)
{
    for (const bool gyro : {true, false}) {
        BDot m = any(0.02);
        m.par.measure = 2;
        m.par.act = 3;
        Tumbler body;
        body.omega_B = {0.03, -0.02, 0.01};
        Vec3 held = {{0, 0, 0}};
        fly(m, body, 50, gyro, [&](int k) {
            const double torque = vec_norm(m.out.torque.torque_B);
            EXPECT_EQ(torque > 0, k % 5 >= 2) << k;
            if (k % 5 == 2) {
                held = m.out.torque.torque_B;
            } else if (k % 5 > 2) {
                EXPECT_EQ(vec_norm(vec_sub(held, m.out.torque.torque_B)), 0.0)
                    << "readings of these times do not count";
            }
            EXPECT_EQ(m.out.measured.head.t, (k % 5 >= 2 ? k - k % 5 + 1 : k) * second);
        });
    }
}

TEST(BDot, without_new_data_the_torque_ends)
{
    for (const Quality lost : {QUALITY_NONE, QUALITY_STALE, QUALITY_GOOD}) {
        BDot m = any(1);
        m.par.hold = 3;
        Tumbler body;
        body.omega_B = {0.03, -0.02, 0.01};
        fly(m, body, 5, false, [&](int k) { EXPECT_EQ(vec_norm(m.out.torque.torque_B) > 0, k > 0); });
        EXPECT_EQ(m.out.torque.head.quality, QUALITY_GOOD);
        m.in.field.head.quality = lost;
        if (lost == QUALITY_GOOD) {
            m.in.field.B_B.v[1] = NAN;
        }
        for (int k = 5; k < 12; k++) {
            b_dot_update(&m, {k * second, second});
            EXPECT_EQ(vec_norm(m.out.torque.torque_B) > 0, k <= 7);
            EXPECT_EQ(m.out.torque.head.quality == QUALITY_DEGRADED, k > 7);
        }
    }
}

TEST(BDot, a_weak_field_tells_nothing_and_a_silent_gyro_degrades)
{
    BDot m = any(1);
    m.in.field = {good(), vec3(1e-8, 0, 0)};
    m.in.gyro = {good(), vec3(0.1, 0.1, 0)};
    b_dot_update(&m, {0, 0});
    EXPECT_EQ(vec_norm(m.out.torque.torque_B), 0.0);
    EXPECT_EQ(m.out.torque.head.quality, QUALITY_DEGRADED);
    Tumbler body;
    body.omega_B = {0.03, -0.02, 0.01};
    m = any(1);
    m.in.gyro.head = {0, QUALITY_STALE, 1};
    fly(m, body, 3, false, [](int) {});
    EXPECT_GT(vec_norm(m.out.torque.torque_B), 0.0);
    EXPECT_EQ(m.out.torque.head.quality, QUALITY_DEGRADED);
    b_dot_reset(&m);
    EXPECT_EQ(m.out.torque.head.sequence + m.mem.readings + m.mem.known, 0u);
}

} // namespace
} // namespace flight::testing
