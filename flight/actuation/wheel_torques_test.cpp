// SPDX-License-Identifier: Apache-2.0
// Wheel torques against the pseudo-inverse by Eigen's singular values.
#include "flight/testing/eigen.h"
#include "flight/testing/linear.h"
#include "flight/testing/poison.h"

extern "C" {
#include "flight/actuation/wheel_torques.h"
}

#include <gtest/gtest.h>

namespace flight::testing {
namespace wheel_torques_test {

using Eigen::Matrix3Xd;
using Eigen::VectorXd;

/// The module with these unit axes as wheels.
WheelTorques with_wheels(const Matrix3Xd &G, const Vector3d &torque, double u_max = 0)
{
    WheelTorques m{};
    m.in.torque = {good(), vec(torque)};
    m.in.wheels.head = good();
    m.in.wheels.n = static_cast<std::uint32_t>(G.cols());
    for (int i = 0; i < G.cols(); i++) {
        m.in.wheels.axes_B[i] = vec(G.col(i));
        m.in.wheels.J[i] = 0.1;
        m.in.wheels.u_max[i] = u_max;
    }
    return m;
}

Matrix3Xd random_wheels(Random &random, int n)
{
    Matrix3Xd G(3, n);
    for (int i = 0; i < n; i++) {
        G.col(i) = random.direction();
    }
    return G;
}

/// True where the set is neither singular nor so near to it that the threshold of rank decides.
bool well_conditioned(const Matrix3Xd &a)
{
    return a.cols() >= a.rows() && singular_values(a).minCoeff() > 0.05;
}

VectorXd commands(const WheelTorques &m)
{
    return Eigen::Map<const Eigen::Matrix<double, WHEELS_MAX, 1>>(m.out.command.u)
        .head(static_cast<int>(m.in.wheels.n));
}

Vector3d achieved(const WheelTorques &m)
{
    return eigen(m.out.achieved.torque_B);
}

TEST(WheelTorques, is_the_pseudo_inverse_for_any_number_of_wheels)
{
    Random random{1};
    int full = 0;
    for (int i = 0; i < 4000; i++) {
        Matrix3Xd G = random_wheels(random, i % (WHEELS_MAX + 1));
        Vector3d L = random.vector();
        if (G.cols() >= 3 && !well_conditioned(G)) {
            continue;
        }
        if (G.cols() == 2 && std::fabs(G.col(0).dot(G.col(1))) > 0.99) {
            continue;
        }
        WheelTorques m = with_wheels(G, L);
        wheel_torques_update(&m, {500, 0});
        EXPECT_LT((commands(m) + least_squares(G, L)).norm(), 1e-11);
        EXPECT_LT((achieved(m) + G * commands(m)).norm(), 1e-13);
        EXPECT_EQ(m.out.command.head.t, 500);
        EXPECT_EQ(m.out.achieved.head.t, 500);
        if (G.cols() >= 3) {
            full++;
            EXPECT_LT((achieved(m) - L).norm(), 1e-12) << "the body gets what was wanted";
            EXPECT_EQ(m.out.command.head.quality, QUALITY_GOOD);
        } else {
            EXPECT_EQ(m.out.command.head.quality, QUALITY_DEGRADED);
            EXPECT_EQ(m.out.achieved.head.quality, QUALITY_DEGRADED);
        }
    }
    EXPECT_GT(full, 2000);
}

TEST(WheelTorques, uses_only_available_wheels)
{
    Random random{2};
    for (int i = 0; i < 4000; i++) {
        Matrix3Xd G = random_wheels(random, 3 + i % 6);
        WheelTorques m = with_wheels(G, random.vector());
        m.in.availability.head = good();
        for (int k = 0; k < G.cols(); k++) {
            m.in.availability.available[k] = random.below(4) ? 1 : 0;
            if (!m.in.availability.available[k]) {
                G.col(k).setZero();
            }
        }
        VectorXd s = singular_values(G);
        if ((s.array() > 1e-12 && s.array() < 0.05).any()) {
            continue;
        }
        wheel_torques_update(&m, {0, 0});
        EXPECT_LT((commands(m) + least_squares(G, eigen(m.in.torque.torque_B))).norm(), 1e-11);
        EXPECT_EQ(m.out.command.head.quality, s[2] > 0.05 ? QUALITY_GOOD : QUALITY_DEGRADED);
        for (int k = 0; k < G.cols(); k++) {
            if (!m.in.availability.available[k]) {
                EXPECT_EQ(m.out.command.u[k], 0);
            }
        }
    }
}

TEST(WheelTorques, controls_any_subset_of_axes)
{
    Random random{3};
    for (int i = 0; i < 4000; i++) {
        int rows = 1 + i % 3;
        Matrix3Xd G = random_wheels(random, 1 + random.below(WHEELS_MAX));
        Eigen::MatrixX3d C(rows, 3);
        WheelTorques m = with_wheels(G, random.vector());
        m.par.n_axes = static_cast<std::uint32_t>(rows);
        for (int k = 0; k < rows; k++) {
            C.row(k) = random.direction().transpose();
            m.par.axes_B[k] = vec(C.row(k).transpose() * random.real(0.1, 100)); // of any length
        }
        Eigen::MatrixXd A = C.lazyProduct(G);
        VectorXd s = singular_values(A);
        if ((s.array() > 1e-12 && s.array() < 0.05).any()) {
            continue;
        }
        Vector3d L = eigen(m.in.torque.torque_B);
        wheel_torques_update(&m, {0, 0});
        EXPECT_LT((commands(m) + least_squares(A, C * L)).norm(), 1e-10);
        if (G.cols() >= rows) {
            EXPECT_LT((C * achieved(m) - C * L).norm(), 1e-11);
            EXPECT_EQ(m.out.command.head.quality, QUALITY_GOOD);
        } else {
            EXPECT_EQ(m.out.command.head.quality, QUALITY_DEGRADED);
        }
    }
}

TEST(WheelTorques, no_other_command_of_the_same_torque_is_smaller)
{
    Random random{4};
    for (int i = 0; i < 500; i++) {
        Matrix3Xd G = random_wheels(random, 4 + i % 5);
        if (!well_conditioned(G)) {
            continue;
        }
        WheelTorques m = with_wheels(G, random.vector());
        wheel_torques_update(&m, {0, 0});
        EXPECT_LT((commands(m) - least_squares(G, G * commands(m))).norm(), 1e-12);
    }
}

TEST(WheelTorques, saturation_keeps_the_direction_and_uses_a_wheel_in_full)
{
    Random random{5};
    int saturated = 0;
    for (int i = 0; i < 3000; i++) {
        Matrix3Xd G = random_wheels(random, 3 + i % 6);
        if (!well_conditioned(G)) {
            continue;
        }
        WheelTorques free = with_wheels(G, random.vector()), m = free;
        for (int k = 0; k < G.cols(); k++) {
            m.in.wheels.u_max[k] = random.below(5) ? random.real(0.05, 1) : 0;
        }
        wheel_torques_update(&free, {0, 0});
        wheel_torques_update(&m, {0, 0});
        double use = 0; // the largest part of its limit that a wheel would have to give
        for (int k = 0; k < G.cols(); k++) {
            if (m.in.wheels.u_max[k] > 0) {
                use = std::max(use, std::fabs(free.out.command.u[k]) / m.in.wheels.u_max[k]);
            }
        }
        double factor = use > 1 ? 1 / use : 1;
        saturated += use > 1;
        EXPECT_LT((commands(m) - factor * commands(free)).norm(), 1e-14);
        EXPECT_LT((achieved(m) - factor * achieved(free)).norm(), 1e-13);
        EXPECT_EQ(m.out.command.head.quality, QUALITY_GOOD);
        EXPECT_EQ(m.mem.saturated, use > 1 ? 1u : 0u);
    }
    EXPECT_GT(saturated, 500);
}

TEST(WheelTorques, gives_the_nearest_torque_where_wheels_cannot_span_the_axes)
{
    Matrix3Xd planar(3, 4), line(3, 3), nothing(3, 2);
    planar << 1, 0, -1, std::sqrt(0.5), 0, 1, 0, std::sqrt(0.5), 0, 0, 0, 0;
    line << 1, -1, 1, 0, 0, 0, 0, 0, 0;
    nothing.setZero();
    Vector3d L{0.3, -0.2, 0.5};

    for (auto [G, expected] : {std::pair<Matrix3Xd, Vector3d>{planar, {0.3, -0.2, 0}},
                               {line, {0.3, 0, 0}},
                               {nothing, {0, 0, 0}},
                               {Matrix3Xd(3, 0), {0, 0, 0}}}) {
        WheelTorques m = with_wheels(G, L);
        wheel_torques_update(&m, {0, 0});
        EXPECT_LT((achieved(m) - expected).norm(), 1e-15);
        EXPECT_LT((commands(m) + least_squares(G, L)).norm(), 1e-15);
        EXPECT_EQ(m.out.command.head.quality, QUALITY_DEGRADED);
    }

    // The same planar wheels are all that two axes in their plane need.
    WheelTorques m = with_wheels(planar, L);
    m.par.n_axes = 2;
    m.par.axes_B[0] = vec3(1, 0, 0);
    m.par.axes_B[1] = vec3(0, 2, 0);
    wheel_torques_update(&m, {0, 0});
    EXPECT_LT((achieved(m) - Vector3d(0.3, -0.2, 0)).norm(), 1e-15);
    EXPECT_EQ(m.out.command.head.quality, QUALITY_GOOD);

    m.par.axes_B[1] = vec3(-3, 0, 0); // dependent axes
    wheel_torques_update(&m, {0, 0});
    EXPECT_EQ(m.out.command.head.quality, QUALITY_DEGRADED);
    m.par.axes_B[1] = vec3(0, 0, 0);
    wheel_torques_update(&m, {0, 0});
    EXPECT_EQ(m.out.command.head.quality, QUALITY_DEGRADED);
}

TEST(WheelTorques, a_change_of_configuration_counts_at_once)
{
    Matrix3Xd G = Matrix3d::Identity();
    WheelTorques m = with_wheels(G, {1, 2, 3});
    wheel_torques_update(&m, {0, 0});
    EXPECT_LT((commands(m) + Vector3d(1, 2, 3)).norm(), 1e-15);
    m.in.wheels.axes_B[0] = vec3(-1, 0, 0); // with the head's sequence unchanged
    wheel_torques_update(&m, {1, 1});
    EXPECT_LT((commands(m) + Vector3d(-1, 2, 3)).norm(), 1e-15);
    EXPECT_EQ(m.out.command.head.sequence, 2u);
    m.par.n_axes = 4; // more than three: all directions
    wheel_torques_update(&m, {2, 1});
    EXPECT_LT((commands(m) + Vector3d(-1, 2, 3)).norm(), 1e-15);
}

TEST(WheelTorques, quality_is_the_worst_of_what_it_used)
{
    const WheelTorques start = with_wheels(Matrix3d::Identity(), {1, 2, 3});
    for (int which = 0; which < 3; which++) {
        WheelTorques m = start;
        m.in.availability = {good(), {1, 1, 1, 1, 1, 1, 1, 1}};
        Head *heads[] = {&m.in.torque.head, &m.in.wheels.head, &m.in.availability.head};
        *heads[which] = with(QUALITY_STALE);
        wheel_torques_update(&m, {0, 0});
        EXPECT_EQ(m.out.command.head.quality, QUALITY_DEGRADED);
        EXPECT_EQ(m.out.achieved.head.quality, QUALITY_DEGRADED);

        wheel_torques_reset(&m);
        *heads[which] = Head{};
        wheel_torques_update(&m, {0, 0});
        if (which < 2) {
            EXPECT_TRUE(all_zero(m.out)) << "a required input was never written";
        } else {
            EXPECT_EQ(m.out.command.head.quality, QUALITY_GOOD) << "all may be used";
        }
    }
}

TEST(WheelTorques, holds_the_last_command_against_numbers_that_are_not_finite)
{
    Random random{6};
    WheelTorques m = with_wheels(random_wheels(random, 4), random.vector(), 10);
    wheel_torques_update(&m, {0, 0});
    WheelSet &wheels = m.in.wheels;
    Doubles in = doubles(m.in.torque.torque_B);
    for (int i = 0; i < 4; i++) {
        for (double *p : doubles(wheels.axes_B[i])) {
            in.push_back(p);
        }
    }
    auto update = [](WheelTorques &x) { wheel_torques_update(&x, {500, 500}); };
    expect_held(m, in, update, [](WheelTorques &x) { return std::vector{&x.out.command.head, &x.out.achieved.head}; });
    VectorXd last = commands(m);
    wheels.u_max[2] = NAN;
    m.in.torque.torque_B = vec3(1, 1, 1);
    update(m);
    EXPECT_EQ(commands(m), last);
    EXPECT_EQ(m.out.command.head.quality, QUALITY_DEGRADED);
}

TEST(WheelTorques, the_command_ends_after_a_time_without_new_data)
{
    constexpr std::int64_t second = 1'000'000'000;
    for (Quality quality : {QUALITY_NONE, QUALITY_STALE, QUALITY_DEGRADED, QUALITY_GOOD}) {
        for (double hold : {0.0, 0.4, 3.0, 1e6}) {
            Random random{5};
            WheelTorques m = with_wheels(random_wheels(random, 4), random.vector());
            m.par.hold = hold;
            wheel_torques_update(&m, {0, 0});
            const WheelTorques before = m;
            m.in.torque.head.quality = quality;
            if (quality == QUALITY_GOOD) {
                m.in.torque.torque_B.v[2] = NAN;
            }
            const double last = hold > 0 ? hold : 10 * 1.0;
            for (int k = 1; k < 20; k++) {
                wheel_torques_update(&m, {k * second, second});
                ASSERT_EQ(m.out.command.head.quality, QUALITY_DEGRADED);
                ASSERT_EQ(m.out.achieved.head.quality, QUALITY_DEGRADED);
                if (k <= last) {
                    ASSERT_TRUE(same_content(m.out.command, before.out.command)) << k;
                    ASSERT_TRUE(same_content(m.out.achieved, before.out.achieved)) << k;
                } else {
                    ASSERT_EQ(commands(m), VectorXd::Zero(4)) << k;
                    ASSERT_EQ(achieved(m), Vector3d::Zero()) << k;
                    ASSERT_EQ(m.out.command.head.t, k * second) << "zero is new";
                }
            }
            m.in.torque = before.in.torque;
            wheel_torques_update(&m, {20 * second, second});
            EXPECT_TRUE(same_content(m.out.command, before.out.command));
            EXPECT_EQ(m.out.command.head.quality, QUALITY_GOOD);
        }
    }
}

TEST(WheelTorques, without_wheels_there_is_no_torque)
{
    WheelTorques m = with_wheels(Matrix3Xd(3, 0), {1, 2, 3});
    wheel_torques_update(&m, {0, 0});
    EXPECT_EQ(m.out.command.u[0], 0.0);
    EXPECT_EQ(vec_norm(m.out.achieved.torque_B), 0.0);
    EXPECT_EQ(m.out.command.head.quality, QUALITY_DEGRADED);
}

} // namespace wheel_torques_test
} // namespace flight::testing
