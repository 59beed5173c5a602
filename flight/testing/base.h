// SPDX-License-Identifier: Apache-2.0
// A base reference in accelerated rotation, for the modules that turn relative to one.
#pragma once

#include "flight/testing/eigen.h"

#include "flight/msg/attitude.h"

namespace flight::testing {

inline std::int64_t ns(double t)
{
    return std::llround(t * 1e9);
}

/// A base that turns about an axis fixed in N, faster and faster: [R0N] = C turn(axis, angle).
struct Base {
    Matrix3d c = Matrix3d::Identity();
    Vector3d axis_N = Vector3d::UnitX();
    double rate = 0, acceleration = 0;

    AttReference at(double t) const
    {
        double angle = rate * t + acceleration * t * t / 2;
        Vector3d omega = axis_N * (rate + acceleration * t), domega = axis_N * acceleration;
        return {good(ns(t)), dcm_to_mrp(mat(c * turn(axis_N, angle))), vec(omega), vec(domega)};
    }
};

inline Base any_base(Random &random, double rate)
{
    return {random.attitude(), random.direction(), random.real(-rate, rate), random.real(-rate, rate) * rate};
}

} // namespace flight::testing
