// SPDX-License-Identifier: Apache-2.0
// Spins against their definition by a matrix, and against numerical derivatives, also in chains.
#include "flight/testing/base.h"
#include "flight/testing/poison.h"

extern "C" {
#include "flight/guidance/inertial_spin.h"
}

#include <gtest/gtest.h>

#include <vector>

namespace flight::testing {
namespace inertial_spin_test {

InertialSpin spinning(const Vector3d &omega_RR0_R0)
{
    InertialSpin m{};
    m.par.omega_RR0_R0 = vec(omega_RR0_R0);
    return m;
}

TEST(InertialSpin, rate_and_acceleration_are_derivatives)
{
    expect_derivatives<InertialSpin>([](Random &random, double rate) { return spinning(random.vector(rate)); },
                                     inertial_spin_update);
}

TEST(InertialSpin, is_a_turn_about_an_axis_of_the_base)
{
    Random random{2};
    for (int i = 0; i < 1000; i++) {
        Base base = any_base(random, 0.1);
        Vector3d w = random.vector(0.1);
        double t = 0.5 * random.below(2000);
        AttReference reference = run<InertialSpin>({spinning(w)}, base, t, inertial_spin_update), at = base.at(t);
        Matrix3d c = turn(w, w.norm() * t) * dcm(at.sigma_RN);
        EXPECT_LT(difference(dcm(reference.sigma_RN), c), 1e-13);
        EXPECT_LE(vec_norm(reference.sigma_RN), 1 + 1e-15);
        EXPECT_LT((eigen(reference.omega_RN_N) - eigen(at.omega_RN_N) - c.transpose() * w).norm(), 1e-15)
            << "the rate has the same components in R as in R0";
    }
}

TEST(InertialSpin, over_a_base_at_rest_the_rate_is_constant_to_the_bit)
{
    Random random{3};
    Base base{random.attitude()};
    InertialSpin m = spinning({0.01, 0.005236, -0.02});
    m.in.base = base.at(0);
    std::int64_t start = 123'456'789'012'345, period = 100'000'000; // 0.1 s is no double
    inertial_spin_update(&m, {start, 0});
    AttReference first = m.out.reference;
    EXPECT_LT((eigen(first.sigma_RN) - eigen(m.in.base.sigma_RN)).norm(), 3e-16) << "the spin begins at the base";
    for (int k = 1; k <= 100000; k++) {
        inertial_spin_update(&m, {start + k * period, period});
        ASSERT_EQ(std::memcmp(&m.out.reference.omega_RN_N, &first.omega_RN_N, sizeof(Vec3)), 0);
        ASSERT_EQ(eigen(m.out.reference.domega_RN_N), Vector3d::Zero());
    }
    Vector3d w = eigen(m.par.omega_RR0_R0);
    EXPECT_LT(difference(dcm(m.out.reference.sigma_RN), turn(w, w.norm() * 1e4) * base.c), 1e-13)
        << "after 37 turns nothing has accumulated";
}

TEST(InertialSpin, without_a_rate_it_is_the_base)
{
    Random random{4};
    for (const Vector3d &w : {Vector3d(0, 0, 0), Vector3d(1e-200, 0, -1e-300)}) {
        AttReference reference = run<InertialSpin>({spinning(w)}, {random.attitude()}, 1000, inertial_spin_update);
        EXPECT_EQ(reference.head.quality, QUALITY_GOOD);
    }
    Base base = any_base(random, 0.1);
    AttReference reference = run<InertialSpin>({spinning(Vector3d::Zero())}, base, 1000, inertial_spin_update),
                 at = base.at(1000);
    EXPECT_LT(difference(dcm(reference.sigma_RN), dcm(at.sigma_RN)), 1e-14);
    EXPECT_EQ(eigen(reference.omega_RN_N), eigen(at.omega_RN_N));
    EXPECT_EQ(eigen(reference.domega_RN_N), eigen(at.domega_RN_N));
}

TEST(InertialSpin, after_a_reset_the_spin_begins_anew)
{
    InertialSpin m = spinning({1, 1, 1});
    m.in.base.head = good();
    inertial_spin_update(&m, {0, 0});
    inertial_spin_update(&m, {500, 500});
    inertial_spin_reset(&m);
    inertial_spin_update(&m, {1'000'000'000, 0});
    EXPECT_EQ(eigen(m.out.reference.sigma_RN), Vector3d::Zero());
}

TEST(InertialSpin, counts_from_the_first_update_even_without_a_base)
{
    InertialSpin m = spinning({0, 0, 0.5});
    inertial_spin_update(&m, {0, 0});
    EXPECT_TRUE(all_zero(m.out));
    m.in.base.head = good();
    inertial_spin_update(&m, {2'000'000'000, 2'000'000'000});
    EXPECT_NEAR(m.out.reference.sigma_RN.v[2], std::tan(0.25), 1e-15);
    EXPECT_EQ(m.out.reference.head.sequence, 1u);
}

TEST(InertialSpin, quality_follows_the_base)
{
    InertialSpin m = spinning({0.5, 0, 0});
    for (auto [in, out] : {std::pair{QUALITY_STALE, QUALITY_DEGRADED},
                           {QUALITY_DEGRADED, QUALITY_DEGRADED},
                           {QUALITY_GOOD, QUALITY_GOOD}}) {
        m.in.base.head = with(in);
        inertial_spin_update(&m, {0, 0});
        EXPECT_EQ(m.out.reference.head.quality, out);
    }
}

TEST(InertialSpin, holds_the_last_reference_against_numbers_that_are_not_finite)
{
    Random random{5};
    InertialSpin m = spinning(random.vector());
    m.in.base = any_base(random, 0.1).at(1);
    inertial_spin_update(&m, {0, 0});
    AttReference &base = m.in.base;
    expect_held(
        m, doubles(base.sigma_RN, base.omega_RN_N, base.domega_RN_N, m.par),
        [](InertialSpin &x) {
            inertial_spin_update(&x, {500, 500});
        },
        [](InertialSpin &x) { return std::vector{&x.out.reference.head}; });
}

} // namespace inertial_spin_test
} // namespace flight::testing
