// SPDX-License-Identifier: Apache-2.0
#include "flight/navigation/testing/directions.h"

extern "C" {
#include "flight/navigation/triad.h"
}

namespace flight::testing {
namespace triad_test {

void take(Triad &m, const Sky &sky)
{
    m.in.primary = sky.seen[0];
    m.in.secondary = sky.seen[1];
}

TEST(Triad, meets_the_primary_and_turns_about_it_as_the_secondary_says)
{
    Random random{1};
    for (int i = 0; i < 10000; i++) {
        Sky sky(random, 2, 0.02, 0.01, 0.1);
        if (i % 3 == 0) { // turns by about 180 degrees
            sky.dcm_BN =
                turn(i % 2 ? Vector3d::Unit(i % 3).eval() : random.direction(), pi + random.real(-1, 1) * 1e-9);
            sky.measure(random, i % 2);
        }
        Triad m{};
        m.par = {1e-6, 1, 100};
        take(m, sky);
        triad_update(&m, {0, 0});
        ASSERT_NE(m.out.attitude.head.quality, QUALITY_NONE);
        const Matrix3d A = dcm(m.out.attitude.sigma_BN);
        const Vector3d w1 = eigen(sky.seen[0].d_B), w2 = eigen(sky.seen[1].d_B);
        const Vector3d b1 = A * eigen(sky.seen[0].d_N), b2 = A * eigen(sky.seen[1].d_N);
        EXPECT_LT((b1 - w1).norm(), 1e-14);
        EXPECT_LT(std::abs(b2.dot(w1.cross(w2).normalized())), 1e-13); // in the plane of both
        EXPECT_GT(b2.dot(w2 - w1 * w1.dot(w2)), 0);                    // and on the side of the secondary
        EXPECT_NEAR(std::sqrt(m.out.state.misfit) * std::hypot(sky.seen[0].std, sky.seen[1].std),
                    std::abs(std::acos(w1.dot(w2)) - std::acos(b1.dot(b2))), 1e-7);
    }
}

TEST(Triad, its_errors_are_as_large_as_it_says)
{
    expect_fix_consistent<Triad>(take, triad_update, 2, 0.3, 0.01);
}

TEST(Triad, says_what_it_lacks)
{
    expect_fix_faults<Triad>(
        [](Triad &m) {
            return std::vector<SeenDirection *>{&m.in.primary, &m.in.secondary};
        },
        triad_update);
}

TEST(Triad, the_primary_is_the_one_to_trust)
{
    Random random{2};
    double better = 0, worse = 0;
    for (int i = 0; i < 2000; i++) {
        Sky sky(random, 2, 0.5, 0.01, 0.01);
        sky.seen[1].std = 0.1;
        sky.measure(random, 1);
        Triad m{};
        m.par = {0.1, 1, 100};
        take(m, sky);
        triad_update(&m, {0, 0});
        better += sky.error(m.out.attitude.sigma_BN).squaredNorm();
        std::swap(m.in.primary, m.in.secondary);
        triad_reset(&m);
        EXPECT_TRUE(all_zero(m.out));
        triad_update(&m, {0, 0});
        worse += sky.error(m.out.attitude.sigma_BN).squaredNorm();
    }
    EXPECT_LT(1.3 * better, worse);
}

} // namespace triad_test
} // namespace flight::testing
