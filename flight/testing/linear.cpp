// SPDX-License-Identifier: Apache-2.0
#include "flight/testing/linear.h"

#include <Eigen/SVD>

#include <algorithm>
#include <cmath>
#include <limits>

namespace flight::testing {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Of a square matrix, which needs no QR first: rows or columns of zero fill what is missing.
using Svd = Eigen::JacobiSVD<MatrixXd, Eigen::NoQRPreconditioner>;

Svd svd_of(const MatrixXd &a, unsigned options)
{
    const Index n = std::max(a.rows(), a.cols());
    MatrixXd square = MatrixXd::Zero(n, n);
    square.topLeftCorner(a.rows(), a.cols()) = a;
    return Svd(square, options);
}

} // namespace

VectorXd singular_values(const MatrixXd &a)
{
    return svd_of(a, 0).singularValues().head(std::min(a.rows(), a.cols()));
}

VectorXd least_squares(const MatrixXd &a, const VectorXd &b)
{
    const Svd svd = svd_of(a, Eigen::ComputeFullU | Eigen::ComputeFullV);
    const VectorXd &s = svd.singularValues();
    VectorXd x = VectorXd::Zero(a.cols());
    for (Index i = 0; i < s.size() && s[i] > 1e-9 * s[0]; i++) {
        x += svd.matrixV().col(i).head(a.cols()) * (svd.matrixU().col(i).head(a.rows()).dot(b) / s[i]);
    }
    return x;
}

double spectral_radius(const MatrixXd &a)
{
    MatrixXd power = a; // a^n / exp(n log)
    double log = 0, n = 1;
    for (int i = 0; i < 50; i++, n *= 2) {
        const double norm = power.norm();
        if (norm == 0) {
            return 0;
        }
        log += std::log(norm) / n;
        power = (power / norm).lazyProduct(power / norm).eval();
    }
    return std::exp(log);
}

MatrixXd cholesky(const MatrixXd &a)
{
    MatrixXd L = MatrixXd::Zero(a.rows(), a.rows());
    for (Index i = 0; i < a.rows(); i++) {
        for (Index j = 0; j < i; j++) {
            L(i, j) = (a(i, j) - L.row(i).head(j).dot(L.row(j).head(j))) / L(j, j);
        }
        const double pivot = a(i, i) - L.row(i).head(i).squaredNorm();
        if (!(pivot > 0)) {
            return {};
        }
        L(i, i) = std::sqrt(pivot);
    }
    return L;
}

VectorXd solve(const MatrixXd &a, const VectorXd &b)
{
    const MatrixXd L = cholesky(a);
    if (L.size() == 0) {
        return VectorXd::Constant(b.size(), std::numeric_limits<double>::quiet_NaN());
    }
    VectorXd x = b;
    for (Index i = 0; i < x.size(); i++) {
        x[i] = (x[i] - L.row(i).head(i).dot(x.head(i))) / L(i, i);
    }
    for (Index i = x.size() - 1; i >= 0; i--) {
        const Index after = x.size() - 1 - i;
        x[i] = (x[i] - L.col(i).tail(after).dot(x.tail(after))) / L(i, i);
    }
    return x;
}

} // namespace flight::testing
