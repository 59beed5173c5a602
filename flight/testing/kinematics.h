// SPDX-License-Identifier: Apache-2.0
// What every attitude reference must satisfy: its rate is the derivative of its attitude, and its
// acceleration the derivative of its rate.
#pragma once

#include "flight/testing/derivative.h"
#include "flight/testing/eigen.h"

#include "flight/msg/attitude.h"

#include <algorithm>

namespace flight::testing {

/// The angular rate of R in N components, of [RN](t): d[RN]/dt [RN]^T = -[omega x] in R components.
template <class F> Vector3d numerical_rate(F dcm_at, double h)
{
    Matrix3d c = dcm_at(0);
    Matrix3d w = -derivative<Matrix3d>(dcm_at, h) * c.transpose();
    return c.transpose() * Vector3d(w(2, 1) - w(1, 2), w(0, 2) - w(2, 0), w(1, 0) - w(0, 1)) / 2;
}

/// The errors of a reference against numerical derivatives, relative to what drives them: the rate
/// to `rate`, the acceleration to its square (it may pass through zero where they do not).
struct KinematicErrors {
    double rate, acceleration;
};

/// `reference_at` gives the AttReference at a time in seconds from now; `rate` in rad/s is a scale
/// of its motion, and the widest difference spans a tenth of a radian.
template <class F> KinematicErrors kinematic_errors(F reference_at, double rate)
{
    double h = 0.05 / rate;
    AttReference now = reference_at(0.0);
    auto dcm_at = [&](double t) -> Matrix3d { return dcm(reference_at(t).sigma_RN); };
    auto rate_at = [&](double t) -> Vector3d { return eigen(reference_at(t).omega_RN_N); };
    Vector3d omega = eigen(now.omega_RN_N), domega = eigen(now.domega_RN_N);
    return {(numerical_rate(dcm_at, h) - omega).norm() / rate,
            (derivative<Vector3d>(rate_at, h) - domega).norm() / (rate * rate)};
}

} // namespace flight::testing
