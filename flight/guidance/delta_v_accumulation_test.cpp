// SPDX-License-Identifier: Apache-2.0
// The sum of accelerations against integrals in closed form.
#include "flight/testing/poison.h"

extern "C" {
#include "flight/guidance/delta_v_accumulation.h"
#include "flight/math/attitude.h"
}

#include <gtest/gtest.h>

namespace flight::testing {
namespace delta_v_accumulation_test {

constexpr std::int64_t ms = 1'000'000;

TEST(DeltaVAccumulation, is_the_integral_in_N_of_a_force_in_a_body_that_turns)
{
    // The error is that of a mean attitude, less than the trapezoid's: step^2 / 12 times the integral of the second
    // derivative.
    // f_B = (1 + t / 10) b1, B turns about b3 at w from N: dv = int (1 + t / 10) (cos wt, sin wt, 0).
    const double w = 0.05, step = 0.1;
    DeltaVAccumulation m{};
    m.par.bias_B = vec3(0.1, -0.2, 0.3);
    for (int k = 0; k <= 600; k++) {
        const double t = step * k;
        m.in.attitude = {good(), vec3(0, 0, std::tan(w * t / 4)), {}};
        m.in.force = {good(k * 100 * ms), vec3(1.1 + t / 10, -0.2, 0.3), vec3(1.1 * t + t * t / 20, -0.2 * t, 0.3 * t)};
        delta_v_accumulation_update(&m, {k * 100 * ms, k ? 100 * ms : 0});
        const double s = std::sin(w * t), c = std::cos(w * t);
        const double x = s / w + (c + w * t * s - 1) / (10 * w * w), y = (1 - c) / w + (s - w * t * c) / (10 * w * w);
        const double error = step * step / 12 * (w * w * (t + t * t / 20) + 0.2 * w * t);
        EXPECT_LT((eigen(m.out.sum.dv_N) - Vector3d(x, y, 0)).norm(), 1.01 * error + 1e-12);
        EXPECT_NEAR(m.out.sum.path, t + t * t / 20, 1e-11);
    }
}

TEST(DeltaVAccumulation, pulses_between_two_updates_are_not_lost)
{
    // 30 ms of each half second, always before the sensor's last step.
    DeltaVAccumulation m{};
    m.in.attitude.head = good();
    for (int k = 0; k <= 100; k++) {
        m.in.force = {good(k * 500 * ms), vec3(0, 0, 0), vec3(0, 0, 0.03 * 2 * k)};
        delta_v_accumulation_update(&m, {k * 500 * ms, k ? 500 * ms : 0});
    }
    EXPECT_NEAR(m.out.sum.dv_N.v[2], 6.0, 1e-12);
    EXPECT_NEAR(m.out.sum.path, 6.0, 1e-12);
    EXPECT_EQ(m.out.sum.a_N.v[2], 0.0);
}

TEST(DeltaVAccumulation, counts_each_measurement_once_and_all_of_a_gap)
{
    DeltaVAccumulation m{};
    m.in.attitude.head = good();
    m.in.force = {good(), vec3(0, 0, 2), vec3(0, 0, 70)}; // the sensor has counted since long before
    delta_v_accumulation_update(&m, {0, 0});
    for (int k = 1; k < 5; k++) { // the sensor has nothing new
        delta_v_accumulation_update(&m, {k * 100 * ms, 100 * ms});
        EXPECT_EQ(m.out.sum.dv_N.v[2], 0.0);
    }
    m.in.force.head = {};
    delta_v_accumulation_update(&m, {500 * ms, 100 * ms});
    EXPECT_EQ(m.out.sum.head.quality, QUALITY_DEGRADED);
    EXPECT_EQ(m.out.sum.head.t, 0);
    m.in.force.head = good(1000 * ms);
    m.in.force.dv_B.v[2] = 72;
    delta_v_accumulation_update(&m, {1100 * ms, 600 * ms}); // late by 0.1 s
    EXPECT_NEAR(m.out.sum.dv_N.v[2], 2.0, 1e-15);
    EXPECT_EQ(m.out.sum.head.t, 1000 * ms);
    m.in.force.head = good(900 * ms); // an older one is not
    m.in.force.dv_B.v[2] = 71.8;
    delta_v_accumulation_update(&m, {1200 * ms, 100 * ms});
    EXPECT_NEAR(m.out.sum.dv_N.v[2], 2.0, 1e-15);
    EXPECT_EQ(m.out.sum.head.quality, QUALITY_DEGRADED);
}

TEST(DeltaVAccumulation, a_huge_first_number_is_not_begun_with)
{
    DeltaVAccumulation m{};
    m.in.attitude.head = m.in.force.head = good();
    for (Vec3 *huge : {&m.in.force.f_B, &m.in.force.dv_B}) {
        *huge = vec3(1e200, 0, 0);
        delta_v_accumulation_update(&m, {0, 0});
        EXPECT_EQ(m.out.sum.head.quality, QUALITY_NONE);
        *huge = vec3(1, 0, 0);
    }
    for (int k = 1; k < 4; k++) {
        m.in.force.head = good(k * 1000 * ms);
        m.in.force.dv_B.v[0] = k;
        delta_v_accumulation_update(&m, {k * 1000 * ms, 1000 * ms});
        EXPECT_EQ(m.out.sum.head.quality, QUALITY_GOOD);
    }
    EXPECT_NEAR(m.out.sum.path, 2, 1e-15);
}

TEST(DeltaVAccumulation, holds_against_bad_numbers)
{
    DeltaVAccumulation m{};
    m.in.attitude.head = m.in.force.head = good();
    delta_v_accumulation_update(&m, {0, 0});
    expect_held(
        m, doubles(m.in.force.f_B, m.in.force.dv_B, m.in.attitude.sigma_BN, m.par.bias_B),
        [](DeltaVAccumulation &x) {
            delta_v_accumulation_update(&x, {100 * ms, 100 * ms});
        },
        [](DeltaVAccumulation &x) { return std::vector{&x.out.sum.head}; });
}

} // namespace delta_v_accumulation_test
} // namespace flight::testing
