// SPDX-License-Identifier: Apache-2.0
// Attitudes against Rodrigues' formula, round trips, and the attitudes where formulas break.
#include "flight/testing/derivative.h"
#include "flight/testing/eigen.h"

#include <gtest/gtest.h>

#include <vector>

namespace flight::testing {
namespace attitude_test {

/// Random turns, and the turns by 0, nearly 0, nearly 180 and 180 degrees about many axes.
std::vector<Matrix3d> attitudes()
{
    std::vector<Matrix3d> all;
    Random random{11};
    for (int i = 0; i < 3000; i++) {
        all.push_back(random.attitude());
    }
    std::vector<Vector3d> axes;
    for (int x = -1; x <= 1; x++) {
        for (int y = -1; y <= 1; y++) {
            for (int z = -1; z <= 1; z++) {
                if (x || y || z) {
                    axes.push_back(Vector3d(x, y, z).normalized());
                }
            }
        }
    }
    for (int i = 0; i < 50; i++) {
        axes.push_back(random.direction());
    }
    for (const Vector3d &axis : axes) {
        for (double angle : {0.0, 1e-300, 1e-17, 1e-12, 1e-8, 1e-4, pi / 2, 2 * pi / 3}) {
            all.push_back(turn(axis, angle));
            all.push_back(turn(axis, pi - angle));
        }
        all.push_back(2 * axis * axis.transpose() - Matrix3d::Identity()); // 180 degrees, exactly
    }
    return all;
}

TEST(Mrp, matrix_is_rodrigues_formula_for_both_sets)
{
    Random random{1};
    for (int i = 0; i < 3000; i++) {
        Vec3 sigma = random.mrp();
        EXPECT_LT(difference(eigen(mrp_to_dcm(sigma)), dcm(sigma)), 2e-15);
        EXPECT_LT(difference(eigen(mrp_to_dcm(mrp_shadow(sigma))), dcm(sigma)), 4e-15);
    }
    EXPECT_EQ(eigen(mrp_to_dcm(vec3(0, 0, 0))), Matrix3d::Identity());
    EXPECT_EQ(eigen(mrp_to_dcm(vec3(0, 0, 1))), Vector3d(-1, -1, 1).asDiagonal().toDenseMatrix());
}

TEST(Mrp, of_a_matrix_and_back_for_every_attitude)
{
    for (const Matrix3d &c : attitudes()) {
        Vec3 sigma = dcm_to_mrp(mat(c));
        EXPECT_LE(vec_norm(sigma), 1 + 1e-15);
        EXPECT_LT(difference(eigen(mrp_to_dcm(sigma)), c), 3e-15) << c;
    }
}

TEST(Mrp, of_an_exact_half_turn_is_exact)
{
    for (int axis = 0; axis < 3; axis++) {
        Vector3d e = Vector3d::Unit(axis);
        Matrix3d c = 2 * e * e.transpose() - Matrix3d::Identity();
        EXPECT_EQ(eigen(dcm_to_mrp(mat(c))), e);
    }
}

TEST(Mrp, small_turns_keep_their_relative_accuracy)
{
    Random random{2};
    for (double angle = 1e-14; angle < 1; angle *= 10) {
        Vector3d axis = random.direction();
        Matrix3d c =
            Matrix3d::Identity() - angle * skew(axis) + angle * angle / 2 * skew(axis) * skew(axis); // to O(angle^3)
        Vector3d expected = axis * angle / 4;
        EXPECT_LT((eigen(dcm_to_mrp(mat(c))) - expected).norm(), angle * (angle * angle + 1e-15)) << angle;
    }
}

TEST(Mrp, of_a_turn_by_a_vector)
{
    Random random{12};
    for (int i = 0; i < 3000; i++) {
        const Vector3d e = random.direction();
        const double angle = i % 3 ? std::exp(random.real(-30, std::log(pi))) : random.real(0.09, 0.11);
        EXPECT_LT((eigen(mrp_turn(vec(angle * e))) - std::tan(angle / 4) * e).norm(), 1e-15 * std::tan(angle / 4));
    }
    EXPECT_TRUE(all_zero(mrp_turn(vec3(0, 0, 0))));
    EXPECT_NEAR(vec_norm(mrp_turn(vec3(0, 1.5 * pi, 0))), std::tan(pi / 8), 1e-15) << "the short set";
}

TEST(Mrp, of_a_matrix_that_is_not_quite_orthonormal_stays_near)
{
    Random random{3};
    for (int i = 0; i < 1000; i++) {
        Matrix3d c = random.attitude();
        Matrix3d noise;
        noise << random.vector(1e-6), random.vector(1e-6), random.vector(1e-6);
        Vec3 sigma = dcm_to_mrp(mat(c + noise));
        EXPECT_LE(vec_norm(sigma), 1 + 1e-6);
        EXPECT_LT(difference(dcm(sigma), c), 5e-6);
    }
}

TEST(Mrp, switches_only_beyond_the_unit_sphere)
{
    EXPECT_EQ(eigen(mrp_short(vec3(0, 0, 1))), Vector3d(0, 0, 1));
    EXPECT_EQ(eigen(mrp_short(vec3(0, -1, 0))), Vector3d(0, -1, 0));
    EXPECT_EQ(eigen(mrp_short(vec3(0, 0, 2))), Vector3d(0, 0, -0.5));
    double beyond = std::nextafter(1.0, 2.0);
    EXPECT_LT(mrp_short(vec3(beyond, 0, 0)).v[0], 0);
}

TEST(Mrp, nearer_set_makes_a_path_continuous)
{
    Random random{4};
    for (int i = 0; i < 3000; i++) {
        Vec3 a = random.mrp(), to = random.mrp();
        double same = (eigen(a) - eigen(to)).norm();
        double other = (eigen(mrp_shadow(a)) - eigen(to)).norm();
        EXPECT_NEAR((eigen(mrp_nearer(a, to)) - eigen(to)).norm(), std::min(same, other), 1e-12);
    }
    EXPECT_EQ(eigen(mrp_nearer(vec3(0, 0, 0), vec3(1, 0, 0))), Vector3d::Zero());
}

TEST(Mrp, composition_is_the_product_of_matrices)
{
    std::vector<Matrix3d> all = attitudes();
    for (std::size_t i = 0; i < all.size(); i++) {
        const Matrix3d &cb = all[i], &ba = all[(i * 7919 + 13) % all.size()];
        Vec3 sigma_CB = dcm_to_mrp(mat(cb)), sigma_BA = dcm_to_mrp(mat(ba));
        Vec3 sigma_CA = mrp_compose(sigma_CB, sigma_BA);
        EXPECT_LE(vec_norm(sigma_CA), 1 + 1e-15);
        EXPECT_LT(difference(dcm(sigma_CA), cb * ba), 6e-15);
        EXPECT_LT(difference(dcm(mrp_relative(sigma_CB, sigma_BA)), cb * ba.transpose()), 6e-15);
    }
}

TEST(Mrp, composition_at_its_classic_singularities)
{
    // A full turn in the textbook form, 1 + |a|^2 |b|^2 - 2 a.b = 0: a and the other set
    // of -a.
    for (double length : {1.0, 0.5, 0.01, 3.0}) {
        Vec3 a = vec3(0, length, 0), inverse = mrp_shadow(vec_neg(a));
        EXPECT_LT(eigen(mrp_compose(a, inverse)).norm(), 1e-15) << length;
        EXPECT_LT(eigen(mrp_relative(a, a)).norm(), 1e-15) << length;
    }
    EXPECT_EQ(eigen(mrp_compose(vec3(0, 0, 0), vec3(0, 0, 1))), Vector3d(0, 0, 1));
    // A half turn in result, from quarters.
    double quarter = std::tan(pi / 8);
    Vec3 half = mrp_compose(vec3(quarter, 0, 0), vec3(quarter, 0, 0));
    EXPECT_NEAR(std::fabs(half.v[0]), 1, 1e-15);
}

TEST(Mrp, kinematics_match_the_derivative_of_the_matrix)
{
    Random random{5};
    for (int i = 0; i < 1000; i++) {
        Matrix3d c = random.attitude();
        Vector3d omega = random.vector();
        auto sigma_at = [&](double t) { // turns on at omega, in B components
            Vec3 sigma = dcm_to_mrp(mat(turn(omega, omega.norm() * t) * c));
            return eigen(mrp_nearer(sigma, dcm_to_mrp(mat(c))));
        };
        Vec3 sigma = vec(sigma_at(0));
        Vec3 dsigma = mrp_rate(sigma, vec(omega));
        EXPECT_LT((derivative<Vector3d>(sigma_at, 0.05) - eigen(dsigma)).norm(), 1e-11);
        EXPECT_LT((eigen(mrp_omega(sigma, dsigma)) - omega).norm(), 1e-14);
        Vec3 shadow = mrp_shadow(sigma);
        EXPECT_LT((eigen(mrp_omega(shadow, mrp_rate(shadow, vec(omega)))) - omega).norm(), 1e-14);
    }
}

TEST(Quat, round_trips_and_sign)
{
    for (const Matrix3d &c : attitudes()) {
        Quat q = dcm_to_quat(mat(c));
        EXPECT_GE(q.q[0], 0);
        EXPECT_NEAR(quat_norm(q), 1, 1e-15);
        EXPECT_LT(difference(eigen(quat_to_dcm(q)), c), 3e-15);
        Vec3 sigma = quat_to_mrp(q);
        EXPECT_LT(difference(dcm(sigma), c), 4e-15);
        Quat back = mrp_to_quat(sigma);
        for (int i = 0; i < 4; i++) {
            EXPECT_NEAR(back.q[i], q.q[i], 3e-15);
        }
        Quat other = {{-q.q[0], -q.q[1], -q.q[2], -q.q[3]}};
        EXPECT_LT(difference(dcm(quat_to_mrp(other)), c), 4e-15);
    }
}

TEST(Quat, is_scalar_first_and_carries_A_into_B)
{
    Quat q = dcm_to_quat(mat(turn(2, 0.6)));
    EXPECT_NEAR(q.q[0], std::cos(0.3), 1e-15);
    EXPECT_NEAR(q.q[3], std::sin(0.3), 1e-15);
}

TEST(Euler, matrix_is_the_product_of_elementary_turns)
{
    Random random{6};
    for (int i = 0; i < 3000; i++) {
        Vector3d a = random.vector(10);
        Matrix3d c = turn(0, a[2]) * turn(1, a[1]) * turn(2, a[0]);
        EXPECT_LT(difference(eigen(euler_to_dcm(vec(a))), c), 1e-15);
    }
}

TEST(Euler, of_a_matrix_and_back_up_to_and_in_gimbal_lock)
{
    auto check = [](const Matrix3d &c) {
        Vec3 angles = dcm_to_euler(mat(c));
        EXPECT_LE(std::fabs(angles.v[1]), pi / 2);
        EXPECT_LT(difference(eigen(euler_to_dcm(angles)), c), 2e-15) << c;
    };
    for (const Matrix3d &c : attitudes()) {
        check(c);
    }
    Random random{7};
    for (double off : {0.0, 1e-300, 1e-160, 1e-17, 1e-16, 1e-12, 1e-9, 1e-8, 1e-6, 1e-3}) {
        for (int i = 0; i < 200; i++) {
            double pitch = (i % 2 ? 1 : -1) * (pi / 2 - off);
            check(turn(0, random.real(-pi, pi)) * turn(1, pitch) * turn(2, random.real(-pi, pi)));
        }
    }
    Matrix3d lock; // exactly
    lock << 0, 0, -1, 0, 1, 0, 1, 0, 0;
    check(lock);
    EXPECT_EQ(dcm_to_euler(mat(lock)).v[0], 0);
}

TEST(Euler, angles_are_recovered)
{
    Random random{8};
    for (int i = 0; i < 1000; i++) {
        Vector3d a{random.real(-pi, pi), random.real(-1.5, 1.5), random.real(-pi, pi)};
        EXPECT_LT((eigen(dcm_to_euler(euler_to_dcm(vec(a)))) - a).norm(), 1e-13);
    }
}

} // namespace attitude_test
} // namespace flight::testing
