// SPDX-License-Identifier: Apache-2.0
// Non-negative least squares against the best of all sets of positive numbers, by Eigen's singular values.
#include "flight/testing/eigen.h"
#include "flight/testing/linear.h"

extern "C" {
#include "flight/math/nnls.h"
}

#include <gtest/gtest.h>

namespace flight::testing {
namespace nnls_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

Nnls problem(const MatrixXd &A, const VectorXd &b)
{
    Nnls p{};
    p.m = A.rows() > 3 ? NNLS_ROWS : 3; // the rest is 0
    p.n = static_cast<std::uint32_t>(A.cols());
    for (int i = 0; i < A.cols(); i++) {
        for (int k = 0; k < A.rows(); k++) {
            p.a[i][k] = A(k, i);
        }
    }
    for (int k = 0; k < b.size(); k++) {
        p.b[k] = b[k];
    }
    return p;
}

struct Solution {
    VectorXd x, r;
    bool ended;
};

Solution solved(const MatrixXd &A, const VectorXd &b, std::uint32_t set = 0)
{
    const Nnls p = problem(A, b);
    double x[NNLS_COLUMNS] = {}, r[NNLS_ROWS] = {};
    const bool ended = nnls(&p, &set, x, r);
    return {Eigen::Map<VectorXd>(x, A.cols()), Eigen::Map<VectorXd>(r, A.rows()), ended};
}

/// By the definition: of all sets whose least-norm solution has no negative number, the one with the least residual
/// and, among equals, the least norm.
VectorXd best_of_all_sets(const MatrixXd &A, const VectorXd &b)
{
    VectorXd best = VectorXd::Zero(A.cols());
    double least = b.norm();
    for (int set = 1; set < 1 << A.cols(); set++) {
        MatrixXd part = A;
        for (int i = 0; i < A.cols(); i++) {
            if (!(set >> i & 1)) {
                part.col(i).setZero();
            }
        }
        const VectorXd x = least_squares(part, b);
        const double left = (A.lazyProduct(x) - b).norm();
        if (x.minCoeff() < -1e-12 || (left > least - 1e-9 && (left > least + 1e-9 || x.norm() > best.norm() - 1e-12))) {
            continue;
        }
        best = x;
        least = std::min(least, left);
    }
    return best;
}

TEST(Nnls, is_the_best_of_all_sets)
{
    Random random{1};
    int reached = 0;
    for (int k = 0; k < 150; k++) {
        const int m = k % 2 ? 3 : 6, n = 1 + k % 8;
        MatrixXd A(m, n);
        VectorXd b(m);
        for (double &a : A.reshaped()) {
            a = random.real(-1, 1);
        }
        for (double &b_i : b) {
            b_i = random.real(-1, 1);
        }
        const Solution s = solved(A, b, static_cast<std::uint32_t>(random.below(256)));
        ASSERT_TRUE(s.ended);
        EXPECT_GE(s.x.minCoeff(), 0.0);
        EXPECT_LT((s.r - (b - A.lazyProduct(s.x))).norm(), 1e-14);
        EXPECT_LT((s.x - best_of_all_sets(A, b)).norm(), 1e-5 * (1 + s.x.norm())) << k;
        reached += s.r.norm() < 1e-12;
    }
    EXPECT_GT(reached, 20);
}

TEST(Nnls, what_can_be_reached_is_reached_to_rounding)
{
    Random random{2};
    int exact = 0;
    for (int k = 0; k < 2000; k++) {
        MatrixXd A(3, 8);
        VectorXd wanted(8);
        for (double &a : A.reshaped()) {
            a = random.real(-1, 1);
        }
        for (double &x : wanted) {
            x = std::max(0.0, random.real(-1, 1));
        }
        const Solution s = solved(A, A.lazyProduct(wanted));
        ASSERT_TRUE(s.ended);
        EXPECT_LT(s.r.norm(), 1e-8) << "of columns that are nearly dependent";
        exact += s.r.norm() < 1e-14;
        EXPECT_LE(s.x.norm(), wanted.norm() * (1 + 1e-6)) << "another one is smaller";
    }
    EXPECT_GT(exact, 1900);
}

TEST(Nnls, equal_columns_share_and_columns_of_zero_have_none)
{
    MatrixXd A(2, 4);
    A << 1, 1, 0, -1, 0, 0, 0, 0;
    const Solution s = solved(A, Eigen::Vector2d(3, 0));
    EXPECT_LT((s.x - Eigen::Vector4d(1.5, 1.5, 0, 0)).norm(), 1e-6);
    EXPECT_LT((solved(A, Eigen::Vector2d(-3, 0)).x - Eigen::Vector4d(0, 0, 0, 3)).norm(), 1e-8);
    EXPECT_EQ(solved(A, Eigen::Vector2d(0, 1)).x.norm(), 0.0) << "nothing helps";
    EXPECT_EQ(solved(A, Eigen::Vector2d(0, 0), 15).x.norm(), 0.0);
}

/// Pairs that push both ways along axes that are turned: across an axis, only rounding says where a pair pushes.
TEST(Nnls, columns_across_b_stay_zero)
{
    Random random{4};
    for (int k = 0; k < 500; k++) {
        MatrixXd A(3, 6);
        const Matrix3d axes = random.attitude();
        A << axes, -axes;
        VectorXd x(6);
        x << random.real(1, 2), 0, k % 2, 0, 0, 0;
        const Solution s = solved(A, A.lazyProduct(x));
        ASSERT_TRUE(s.ended) << k;
        EXPECT_LT((s.x - x).norm(), 1e-12) << k;
        EXPECT_LT(s.r.norm(), 1e-14);
    }
}

TEST(Nnls, ends_whatever_it_is_given)
{
    Random random{3};
    for (const double bad : {static_cast<double>(NAN), HUGE_VAL, 1e300, 5e-324}) {
        for (int k = 0; k < 50; k++) {
            MatrixXd A = MatrixXd::Random(6, 8);
            VectorXd b = VectorXd::Random(6);
            (k % 2 ? A(random.below(6), random.below(8)) : b(random.below(6))) = bad;
            const Solution s = solved(A, b); // and does not hang
            EXPECT_TRUE(s.ended ? s.x.minCoeff() >= 0.0 : bad != 5e-324);
        }
    }
}

} // namespace nnls_test
} // namespace flight::testing
