// SPDX-License-Identifier: Apache-2.0
// The closed-form pseudo-inverse against Eigen's eigenvalues.
#include "flight/math/mat.h"
#include "flight/testing/eigen.h"

#include <gtest/gtest.h>

namespace flight::testing {
namespace mat_test {

Matrix3d reference_pinv(const Matrix3d &s, int rank)
{
    Eigen::SelfAdjointEigenSolver<Matrix3d> solver(s);
    Matrix3d p = Matrix3d::Zero();
    for (int i = 3 - rank; i < 3; i++) { // ascending
        Vector3d v = solver.eigenvectors().col(i);
        p += v * v.transpose() / solver.eigenvalues()[i];
    }
    return p;
}

TEST(SymPinv, every_rank_and_scale)
{
    Random random{1};
    for (int i = 0; i < 4000; i++) {
        int wanted = 1 + i % 3;
        double scale = std::pow(10, random.real(-20, 20));
        Matrix3d q = random.attitude();
        Vector3d d{1, random.real(0.01, 1), random.real(0.01, 1)};
        d.tail(3 - wanted).setZero();
        Matrix3d s = scale * q * d.asDiagonal() * q.transpose();
        s = (s + s.transpose().eval()) / 2;

        int rank = -1;
        Matrix3d p = eigen(mat_sym_pinv(mat(s), &rank));
        EXPECT_EQ(rank, wanted);
        EXPECT_LT((p - reference_pinv(s, wanted)).norm(), 1e-11 * p.norm()) << s;
    }
}

TEST(SymPinv, ill_conditioned_but_of_full_rank)
{
    Random random{2};
    for (int i = 0; i < 1000; i++) {
        Matrix3d q = random.attitude();
        Matrix3d s = q * Vector3d(1, 1e-2, 1e-4).asDiagonal() * q.transpose();
        s = (s + s.transpose().eval()) / 2;
        int rank = -1;
        Matrix3d p = eigen(mat_sym_pinv(mat(s), &rank));
        EXPECT_EQ(rank, 3);
        EXPECT_LT((s * p - Matrix3d::Identity()).norm(), 1e-9);
    }
}

TEST(SymPinv, nothing_and_not_a_number)
{
    int rank = -1;
    EXPECT_EQ(eigen(mat_sym_pinv(Mat3{}, &rank)), Matrix3d::Zero());
    EXPECT_EQ(rank, 0);
    Mat3 nan = mat_identity();
    nan.m[1][1] = NAN;
    mat_sym_pinv(nan, &rank);
    EXPECT_EQ(rank, 0);
}

} // namespace mat_test
} // namespace flight::testing
