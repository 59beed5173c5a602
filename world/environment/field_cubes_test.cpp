// SPDX-License-Identifier: Apache-2.0
// Against polynomials, which cubes must repeat, and waves, whose fourth derivatives are known.
#include "world/environment/field_cubes.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace fledge::world {
namespace field_cubes_test {

using Eigen::Vector3d;

std::vector<Vector3d> places(double most, int n)
{
    std::mt19937 random(1);
    std::uniform_real_distribution<double> in(-most, most);
    std::vector<Vector3d> all;
    for (int i = 0; i < n; i++) {
        const double x = in(random), y = in(random), z = in(random);
        all.emplace_back(x, y, z);
    }
    return all;
}

TEST(FieldCubes, RepeatAPolynomialOfThirdDegreeInEach)
{
    const auto cubic = [](const Vector3d &r) {
        const auto of = [](double x) { return ((0.25 * x - 0.5) * x + 2.0) * x - 1.0; };
        return Vector3d(of(r.x()) * of(r.y()) * of(r.z()), of(r.z()), r.x() * r.y() * r.y() - 3.0);
    };
    FieldCubes cubes;
    cubes.set(1e-3, 1.0);
    for (const Vector3d &r : places(3.0, 2000)) {
        EXPECT_LT((cubes.at(r, 0, cubic) - cubic(r)).norm(), 1e-11 * (1.0 + cubic(r).norm())) << r.transpose();
    }
}

TEST(FieldCubes, HoldTheirBoundAndNotMuchLess)
{
    const double k = 2.0;
    const auto waves = [&](const Vector3d &r) {
        return Vector3d(std::sin(k * r.x()), std::cos(k * r.y()) * std::sin(k * r.z()), std::sin(k * r.sum()));
    };
    for (const double error : {1e-2, 1e-4, 1e-6}) {
        FieldCubes cubes;
        cubes.set(error, std::pow(k, 4));
        double worst = 0.0;
        for (const Vector3d &r : places(10.0 * cubes.edge(), 20'000)) {
            worst = std::max(worst, (cubes.at(r, 0, waves) - waves(r)).cwiseAbs().maxCoeff());
        }
        EXPECT_LT(worst, error);
        EXPECT_GT(worst, 0.1 * error);
    }
}

TEST(FieldCubes, DependOnThePlaceAndTheFieldAlone)
{
    const auto field = [](double shift) {
        return [shift](const Vector3d &r) {
            return Vector3d(std::sin(r.x() + shift), std::sin(r.y() * r.z()), std::exp(0.1 * r.z()));
        };
    };
    FieldCubes there, back;
    there.set(1e-4, 1.0);
    back.set(1e-4, 1.0);
    auto all = places(20.0, 500);
    all.emplace_back(0, 0, 0);
    all.push_back(there.edge() * Vector3d(1, -2, 3));
    std::vector<Vector3d> found;
    for (const Vector3d &r : all) {
        found.push_back(there.at(r, 7, field(0.0)));
        EXPECT_NEAR(there.at(r, 8, field(1.0)).x(), std::sin(r.x() + 1.0), 1e-4);
    }
    for (std::size_t i = all.size(); i-- > 0;) {
        EXPECT_EQ(back.at(all[i], 7, field(0.0)), found[i]);
    }
}

TEST(FieldCubes, BesideAFaceTheyAreFilledOnce)
{
    FieldCubes cubes;
    cubes.set(1e-4, 1.0);
    int filled = 0;
    const auto field = [&](const Vector3d &r) {
        filled++;
        return r;
    };
    for (int i = 0; i < 1000; i++) {
        (void)cubes.at(1e-3 * Vector3d(i % 2 - 0.5, i / 2 % 2 - 0.5, i / 4 % 2 - 0.5), 0, field);
    }
    EXPECT_EQ(filled, 8 * 64);
}

TEST(FieldCubes, WhereThereIsNoCubeTheFieldIsTheExactOne)
{
    FieldCubes cubes;
    cubes.set(1e-4, 1.0);
    const auto field = [](const Vector3d &r) { return r; };
    EXPECT_TRUE(cubes.at(Vector3d::Constant(std::numeric_limits<double>::quiet_NaN()), 0, field).hasNaN());
    EXPECT_EQ(cubes.at(Vector3d(1e30, 0, 0), 0, field), Vector3d(1e30, 0, 0));
}

} // namespace field_cubes_test
} // namespace fledge::world
