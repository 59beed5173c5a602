// SPDX-License-Identifier: Apache-2.0
#include "flight/testing/base.h"
#include "flight/testing/poison.h"

extern "C" {
#include "flight/guidance/base_reference.h"
}

#include <gtest/gtest.h>

namespace flight::testing {
namespace base_reference_test {

BaseReference base_of(BaseSource source)
{
    BaseReference m{};
    m.par.hold = 100;
    m.par.source = source;
    return m;
}

NavAttitude seen(const AttReference &reference)
{
    return {reference.head, reference.sigma_RN, vec(dcm(reference.sigma_RN) * eigen(reference.omega_RN_N))};
}

TEST(BaseReference, carries_a_reference_to_now_along_a_turn_of_constant_acceleration)
{
    Random random{1};
    for (int i = 0; i < 1000; i++) {
        const Base base = any_base(random, 0.1);
        const double sent = random.real(0, 50), age = random.real(0, 50);
        BaseReference m = base_of(i % 2 ? BASE_COMMANDED : BASE_OWN);
        (i % 2 ? m.in.commanded : m.in.own) = base.at(sent);
        (i % 2 ? m.in.own : m.in.commanded) = base.at(3); // does not count
        const std::int64_t now = ns(sent) + ns(age);
        base_reference_update(&m, {now, 0});
        const AttReference expected = base.at(sent + age), &found = m.out.reference;
        EXPECT_LT(difference(dcm(found.sigma_RN), dcm(expected.sigma_RN)), 1e-9); // times are whole ns
        EXPECT_LT((eigen(found.omega_RN_N) - eigen(expected.omega_RN_N)).norm(), 1e-9);
        EXPECT_EQ(eigen(found.domega_RN_N), eigen(expected.domega_RN_N));
        EXPECT_EQ(found.head.t, now);
        EXPECT_EQ(found.head.quality, QUALITY_GOOD);
    }
}

TEST(BaseReference, carries_what_is_seen_at_its_rate)
{
    Random random{2};
    for (int i = 0; i < 1000; i++) {
        Base base = any_base(random, 0.1);
        base.acceleration = 0;
        const double age = random.real(0, 50);
        BaseReference m = base_of(BASE_SENSED);
        m.in.sensed = seen(base.at(1));
        m.in.commanded = base.at(40); // does not count
        base_reference_update(&m, {m.in.sensed.head.t + ns(age), 0});
        const AttReference expected = base.at(1 + age), &found = m.out.reference;
        EXPECT_LT(difference(dcm(found.sigma_RN), dcm(expected.sigma_RN)), 1e-9);
        EXPECT_LT((eigen(found.omega_RN_N) - eigen(expected.omega_RN_N)).norm(), 1e-12);
        EXPECT_TRUE(all_zero(found.domega_RN_N));
    }
}

TEST(BaseReference, a_base_that_is_missing_or_too_old_does_not_count)
{
    Random random{3};
    BaseReference m = base_of(BASE_COMMANDED);
    base_reference_update(&m, {0, 0});
    EXPECT_TRUE(all_zero(m.out));
    m.in.commanded = any_base(random, 0.1).at(0);
    base_reference_update(&m, {ns(100), 0});
    EXPECT_EQ(m.out.reference.head.quality, QUALITY_GOOD);
    const AttReference before = m.out.reference;
    base_reference_update(&m, {ns(100) + 1, 1});
    EXPECT_EQ(m.out.reference.head.quality, QUALITY_DEGRADED);
    EXPECT_EQ(m.out.reference.head.t, before.head.t);
    EXPECT_EQ(eigen(m.out.reference.sigma_RN), eigen(before.sigma_RN));
    m.in.commanded.head.t = ns(90);
    m.in.commanded.head.quality = QUALITY_STALE;
    base_reference_update(&m, {ns(101), 1});
    EXPECT_EQ(m.out.reference.head.t, ns(101));
    EXPECT_EQ(m.out.reference.head.quality, QUALITY_DEGRADED);
}

TEST(BaseReference, holds_the_last_reference_against_numbers_that_are_not_finite)
{
    Random random{4};
    for (BaseSource source : {BASE_COMMANDED, BASE_SENSED}) {
        BaseReference m = base_of(source);
        m.in.commanded = any_base(random, 0.1).at(0);
        m.in.sensed = seen(m.in.commanded);
        base_reference_update(&m, {ns(1), 0});
        expect_held(
            m,
            source == BASE_COMMANDED
                ? doubles(m.in.commanded.sigma_RN, m.in.commanded.omega_RN_N, m.in.commanded.domega_RN_N)
                : doubles(m.in.sensed.sigma_BN, m.in.sensed.omega_BN_B),
            [](BaseReference &x) {
                base_reference_update(&x, {ns(2), ns(1)});
            },
            [](BaseReference &x) { return std::vector{&x.out.reference.head}; });
    }
}

} // namespace base_reference_test
} // namespace flight::testing
