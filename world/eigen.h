// SPDX-License-Identifier: Apache-2.0
// Messages hold Vec3 and Mat3, the world computes with Eigen: views of the one as the other.
#pragma once

#include "flight/math/vec.h"

#include <Eigen/Core>

namespace fledge::world {

inline Eigen::Map<const Eigen::Vector3d> view(const Vec3 &a)
{
    return Eigen::Map<const Eigen::Vector3d>(a.v);
}

inline Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> view(const Mat3 &a)
{
    return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(a.m[0]);
}

inline bool is_zero(const Vec3 &a)
{
    return a.v[0] == 0.0 && a.v[1] == 0.0 && a.v[2] == 0.0;
}

inline Vec3 vec(const Eigen::Vector3d &a)
{
    return vec3(a[0], a[1], a[2]);
}

inline Mat3 mat(const Eigen::Matrix3d &a)
{
    Mat3 b;
    Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(b.m[0]) = a;
    return b;
}

} // namespace fledge::world
