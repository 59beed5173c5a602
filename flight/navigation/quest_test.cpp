// SPDX-License-Identifier: Apache-2.0
#include "flight/navigation/testing/directions.h"

extern "C" {
#include "flight/navigation/quest.h"
}

#include <Eigen/SVD>

namespace flight::testing {
namespace quest_test {

void take(Quest &m, const Sky &sky)
{
    SeenDirection *const in[] = {&m.in.first, &m.in.second, &m.in.third, &m.in.fourth};
    for (std::size_t i = 0; i < sky.seen.size(); i++) {
        *in[i] = sky.seen[i];
    }
}

Quest flown(const Sky &sky, double gate = 1e9)
{
    Quest m{};
    m.par = {0.001, 1, gate};
    take(m, sky);
    quest_update(&m, {0, 0});
    return m;
}

/// Markley 1988: Wahba's problem by singular values.
Matrix3d by_svd(const Sky &sky)
{
    Matrix3d B = Matrix3d::Zero();
    double sum = 0;
    for (const SeenDirection &direction : sky.seen) {
        B += eigen(direction.d_B) * eigen(direction.d_N).transpose() / (direction.std * direction.std);
        sum += 1 / (direction.std * direction.std);
    }
    const Eigen::JacobiSVD<Matrix3d> svd(B / sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
    const Matrix3d U = svd.matrixU(), V = svd.matrixV();
    return U * Vector3d(1, 1, U.determinant() * V.determinant()).asDiagonal() * V.transpose();
}

double misfit(const Sky &sky, const Matrix3d &A)
{
    double sum = 0;
    for (const SeenDirection &direction : sky.seen) {
        sum += (eigen(direction.d_B) - A * eigen(direction.d_N)).squaredNorm() / (direction.std * direction.std);
    }
    return sum;
}

TEST(Quest, is_the_attitude_of_singular_values)
{
    Random random{1};
    double worst = 0;
    for (int i = 0; i < campaign_runs(10000, 300'000); i++) {
        Sky sky(random, 2 + i % 3, 0.3, 0.01, 0.1);
        if (i % 4 != 0) { // turns by about 180 degrees, where Gibbs' vector is singular, also about the axes of N
            const Vector3d axis = i % 4 == 1 ? Vector3d::Unit(i / 4 % 3).eval() : random.direction();
            sky.dcm_BN = turn(axis, pi + random.real(-1, 1) * std::pow(10, random.real(-16, -1)));
            sky.measure(random, i % 8 < 4 ? 1 : 0);
        }
        const Quest m = flown(sky);
        ASSERT_EQ(m.out.attitude.head.quality, QUALITY_GOOD);
        worst = std::max(worst, difference(dcm(m.out.attitude.sigma_BN), by_svd(sky)));
        EXPECT_NEAR(m.out.state.misfit, misfit(sky, by_svd(sky)), 1e-11);
    }
    EXPECT_LT(worst, 1e-12);
}

TEST(Quest, has_the_least_misfit_also_of_directions_with_errors_that_are_far_apart)
{
    Random random{2};
    for (int i = 0; i < 4000; i++) {
        const Sky sky(random, 2 + i % 3, 0.2, 5e-6, 0.05);
        const Quest m = flown(sky);
        ASSERT_EQ(m.out.attitude.head.quality, QUALITY_GOOD);
        const Matrix3d A = dcm(m.out.attitude.sigma_BN), P = eigen(m.out.attitude.P_B);
        const Vector3d axis = P * random.direction(), unit = axis.normalized();
        const double std = 1 / std::sqrt(unit.dot(P.inverse() * unit)), h = 0.01 * std;
        const double less = misfit(sky, turn(unit, -h) * A), more = misfit(sky, turn(unit, h) * A);
        EXPECT_LT(std::abs(less - more) / (2 * (less + more - 2 * misfit(sky, A))) * h, 2e-3 * std)
            << "off the minimum";
    }
}

TEST(Quest, its_errors_are_as_large_as_it_says)
{
    expect_fix_consistent<Quest>(take, quest_update, 4, 0.3, 0.01);
}

TEST(Quest, says_what_it_lacks)
{
    const auto ports = [](Quest &m) {
        return std::vector<SeenDirection *>{&m.in.first, &m.in.third, &m.in.second, &m.in.fourth};
    };
    expect_fix_faults<Quest>(ports, quest_update);
}

TEST(Quest, leaves_degraded_directions_out_where_good_ones_suffice)
{
    Random random{3};
    for (int i = 0; i < 500; i++) {
        Sky sky(random, 4, 0.2, 0.001, 0.01);
        const int bad = random.below(4);
        SeenDirection &direction = sky.seen[static_cast<std::size_t>(bad)];
        direction.head.quality = i % 2 ? QUALITY_DEGRADED : QUALITY_STALE;
        direction.d_B = vec(random.direction());
        const Quest m = flown(sky, 8);
        EXPECT_EQ(m.out.attitude.head.quality, QUALITY_GOOD);
        EXPECT_EQ(m.out.state.n, 3u);
        EXPECT_LT(sky.error(m.out.attitude.sigma_BN).norm(), 6 * m.out.state.std);
    }
}

TEST(Quest, directions_that_contradict_each_other_are_found_out)
{
    Random random{4};
    int found = 0;
    for (int i = 0; i < 1000; i++) {
        Sky sky(random, 3, 0.3, 0.005, 0.005);
        SeenDirection &direction = sky.seen[static_cast<std::size_t>(random.below(3))];
        direction.d_B = vec(Vector3d(turn(eigen(direction.d_B).cross(random.direction()), 0.1) * eigen(direction.d_B)));
        const Quest m = flown(sky, 5);
        found += m.out.state.finding == FIX_MISFIT;
        EXPECT_EQ(m.out.state.finding == FIX_MISFIT, m.out.attitude.head.quality == QUALITY_DEGRADED);
    }
    EXPECT_GT(found, 950) << "of a direction off by 20 standard deviations";
    Sky sky(random, 3, 0.3, 0.005, 0.005);
    for (SeenDirection &direction : sky.seen) { // mirrored: no turn fits
        direction.d_B = vec_neg(direction.d_B);
    }
    EXPECT_EQ(flown(sky, 5).out.state.finding, FIX_MISFIT);
}

} // namespace quest_test
} // namespace flight::testing
