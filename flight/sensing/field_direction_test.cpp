// SPDX-License-Identifier: Apache-2.0
#include "flight/testing/consistency.h"
#include "flight/testing/poison.h"

extern "C" {
#include "flight/sensing/field_direction.h"
}

#include <gtest/gtest.h>

namespace flight::testing {
namespace field_direction_test {

FieldDirection any(Random &random, double stronger)
{
    FieldDirection m{};
    m.par.std = 0.01;
    m.par.noise = 300e-9;
    m.par.differ = 0.2;
    const Vector3d B = random.real(2e-5, 6e-5) * random.direction();
    m.in.known = {good(7), vec(B)};
    m.in.field = {good(7), vec(Vector3d(stronger * (random.attitude() * B)))};
    field_direction_update(&m, {7, 1});
    return m;
}

TEST(FieldDirection, pairs_fields_that_agree)
{
    Random random{1};
    for (int i = 0; i < 2000; i++) {
        const double stronger = random.real(0.6, 1.4);
        const FieldDirection m = any(random, stronger);
        const bool fits = std::abs(stronger - 1) <= 0.2;
        ASSERT_EQ(m.out.seen.head.quality, fits ? QUALITY_GOOD : QUALITY_NONE);
        EXPECT_EQ(m.out.agreement.taken, fits ? 1u : 0u);
        EXPECT_EQ(m.out.agreement.refused, fits ? 0u : 1u);
        EXPECT_NEAR(m.out.agreement.differ, stronger - 1, 1e-12);
        if (fits) {
            EXPECT_LT((eigen(m.out.seen.d_B) - eigen(m.in.field.B_B).normalized()).norm(), 1e-15);
            EXPECT_LT((eigen(m.out.seen.d_N) - eigen(m.in.known.B_N).normalized()).norm(), 1e-15);
        }
    }
}

TEST(FieldDirection, says_how_large_its_error_is)
{
    Random random{2};
    double sum = 0;
    const int n = 20000;
    for (int i = 0; i < n; i++) {
        FieldDirection m = any(random, 1);
        const Matrix3d dcm_BN = random.attitude();
        Vector3d b = dcm_BN * eigen(m.in.known.B_N);
        const Vector3d small = random.normals(m.par.std);
        b += random.normals(m.par.noise) + small.cross(b);
        m.in.field = {good(9), vec(b)};
        field_direction_update(&m, {9, 2});
        const Vector3d across = eigen(m.out.seen.d_B).cross(dcm_BN * eigen(m.out.seen.d_N));
        sum += across.squaredNorm() / (m.out.seen.std * m.out.seen.std) / n;
    }
    expect_chi_square(sum, 2, n);
}

TEST(FieldDirection, looks_at_each_measurement_once)
{
    Random random{3};
    FieldDirection m = any(random, 1);
    const auto out = m.out;
    m.in.field.B_B.v[0] = 1;
    field_direction_update(&m, {8, 1}); // seen
    m.in.field.head.t = 10;
    field_direction_update(&m, {9, 1}); // to come
    EXPECT_EQ(std::memcmp(&m.out, &out, sizeof out), 0);
    field_direction_update(&m, {10, 1});
    field_direction_update(&m, {11, 1});
    EXPECT_EQ(m.out.agreement.refused, 1u);
    EXPECT_EQ(m.out.seen.head.quality, QUALITY_DEGRADED);
    EXPECT_EQ(m.out.seen.head.t, 7);
    m.in.field = {good(2), m.in.known.B_N};
    field_direction_update(&m, {3, 1}); // the clock went back
    EXPECT_EQ(m.out.seen.head.t, 2);
    EXPECT_EQ(m.out.seen.head.quality, QUALITY_GOOD);
    m.in.known.head.quality = QUALITY_NONE;
    m.in.field.head.t = 4;
    field_direction_update(&m, {4, 1});
    EXPECT_EQ(m.out.seen.head.quality, QUALITY_DEGRADED);
    EXPECT_EQ(m.out.agreement.taken, 2u);
    m.in.known.head.quality = QUALITY_STALE;
    field_direction_update(&m, {5, 1});
    EXPECT_EQ(m.out.seen.head.t, 4) << "with the known field the measurement counts";
    EXPECT_EQ(m.out.seen.head.quality, QUALITY_DEGRADED);
}

TEST(FieldDirection, is_sound_whatever_comes)
{
    Random random{4};
    FieldDirection m = any(random, 1);
    for (int round = 0; round < 20000; round++) {
        const auto size = random.below(2) ? 1e-5 : 1;
        throw_numbers(doubles(m.in.field.B_B, m.in.known.B_N, m.par.std, m.par.noise, m.par.differ), random, round);
        m.in.known.B_N = vec_scale(size, m.in.known.B_N);
        m.in.field.head = {round, any_quality(random), 1};
        m.in.known.head = {INT64_MAX, any_quality(random), 1};
        field_direction_update(&m, {round, 1});
        ASSERT_TRUE(m.out.seen.head.quality < QUALITY_GOOD || direction_speaks(&m.out.seen));
        expect_finite(doubles(m.out.seen.d_B, m.out.seen.d_N, m.out.seen.std, m.out.agreement.differ), round);
    }
}

} // namespace field_direction_test
} // namespace flight::testing
