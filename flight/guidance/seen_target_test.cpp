// SPDX-License-Identifier: Apache-2.0
// Another spacecraft by a sensor, against the two motions from which the sight was made.
#include "flight/testing/poison.h"

extern "C" {
#include "flight/guidance/seen_target.h"
#include "flight/math/attitude.h"
}

#include <gtest/gtest.h>

namespace flight::testing {
namespace seen_target_test {

/// Uniform motion and a turn about a fixed axis.
struct Craft {
    Matrix3d c; ///< [BN] at time 0
    Vector3d omega_N, r, v;

    Matrix3d dcm_at(double t) const { return c * turn(omega_N, omega_N.norm() * t); }
    Vector3d at(double t) const { return r + t * v; }
};

Craft any_craft(Random &random)
{
    return {random.attitude(), random.vector(0.05), random.vector(1e6), random.vector(100)};
}

/// T as B sees it at `then`, and what B knows of itself at `now`.
SeenTarget seen(const Craft &B, const Craft &T, double then, double now)
{
    const Matrix3d BN = B.dcm_at(then), TN = T.dcm_at(then);
    SeenTarget m{};
    m.in.seen = {good(std::llround(then * 1e9)), vec(BN * (T.at(then) - B.at(then))), vec(BN * (T.v - B.v)),
                 dcm_to_mrp(mat(TN * BN.transpose())), vec(BN * (T.omega_N - B.omega_N))};
    m.in.own = {good(), dcm_to_mrp(mat(B.dcm_at(now))), vec(B.dcm_at(now) * B.omega_N)};
    m.in.orbit = {good(), vec(B.at(now)), vec(B.v), {}};
    m.par.hold = 5;
    seen_target_update(&m, {std::llround(now * 1e9), 0});
    return m;
}

TEST(SeenTarget, is_where_and_as_the_other_craft_is_also_from_an_old_sight)
{
    Random random{1};
    for (int i = 0; i < 500; i++) {
        const Craft B = any_craft(random), T = any_craft(random);
        const double then = 1 + i % 3, now = then + (i % 2 ? random.real(0, 4) : 0);
        const SeenTarget m = seen(B, T, then, now);
        EXPECT_LT(difference(dcm(m.out.attitude.sigma_BN), T.dcm_at(then)), 1e-8);
        EXPECT_LT((eigen(m.out.attitude.omega_BN_B) - T.dcm_at(then) * T.omega_N).norm(), 1e-9);
        EXPECT_EQ(m.out.attitude.head.t, std::llround(then * 1e9));
        EXPECT_LT((eigen(m.out.body.r_PN_N) - T.at(now)).norm(), 2e-2) << "a turn by 1e-9 s at 2000 km";
        EXPECT_LT((eigen(m.out.body.v_PN_N) - T.v).norm(), 1e-5);
        EXPECT_EQ(m.out.body.head.t, std::llround(now * 1e9));
    }
}

TEST(SeenTarget, a_sight_that_is_too_old_or_of_a_time_to_come_does_not_count)
{
    Random random{2};
    const Craft B = any_craft(random), T = any_craft(random);
    for (const std::int64_t of : {std::int64_t{-4'000'000'001}, std::int64_t{1'000'000'001}, INT64_MAX}) {
        SeenTarget m = seen(B, T, 1, 1);
        const auto before = m.out;
        m.in.seen.head.t = of;
        seen_target_update(&m, {1'000'000'000, 0});
        EXPECT_TRUE(same_content(m.out.attitude, before.attitude));
        EXPECT_TRUE(same_content(m.out.body, before.body));
        EXPECT_EQ(m.out.body.head.quality, QUALITY_DEGRADED);
    }
    SeenTarget m = seen(B, T, 1, 1);
    auto &in = m.in;
    expect_held(
        m, doubles(in.seen.sigma_TB, in.own.omega_BN_B, in.own.sigma_BN, in.seen.omega_TB_B),
        [](SeenTarget &x) {
            seen_target_update(&x, {2'000'000'000, 0});
            x.out.body = {}; // which need not depend on all of them
        },
        [](SeenTarget &x) {
            x.out.body = {};
            return std::vector{&x.out.attitude.head};
        });
}

TEST(SeenTarget, without_an_orbit_the_attitude_is_whole)
{
    Random random{3};
    SeenTarget m = seen(any_craft(random), any_craft(random), 1, 1);
    seen_target_reset(&m);
    m.in.orbit.head = {};
    seen_target_update(&m, {1'000'000'000, 0});
    EXPECT_EQ(m.out.attitude.head.quality, QUALITY_GOOD);
    EXPECT_TRUE(all_zero(m.out.body));
}

} // namespace seen_target_test
} // namespace flight::testing
