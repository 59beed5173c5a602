// SPDX-License-Identifier: Apache-2.0
// Linear algebra for matrices of any size, compiled once: each source that uses decompositions of Eigen takes seconds.
#pragma once

#include <Eigen/Core>

namespace flight::testing {

/// In descending order.
Eigen::VectorXd singular_values(const Eigen::MatrixXd &a);

/// The shortest of all x with the least |a x - b|. Singular values up to 1e-9 of the largest count as zero.
Eigen::VectorXd least_squares(const Eigen::MatrixXd &a, const Eigen::VectorXd &b);

/// The largest absolute value of an eigenvalue, by Gelfand's formula: the limit of |a^n|^(1/n).
double spectral_radius(const Eigen::MatrixXd &a);

/// The lower triangle L with L L^T = a, where `a` is symmetric; of no size unless `a` is positive definite.
Eigen::MatrixXd cholesky(const Eigen::MatrixXd &a);

/// The x of a x = b, where `a` is symmetric; not numbers unless `a` is positive definite.
Eigen::VectorXd solve(const Eigen::MatrixXd &a, const Eigen::VectorXd &b);

} // namespace flight::testing
