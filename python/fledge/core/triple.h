// SPDX-License-Identifier: Apache-2.0
// Vectors as pybind11 passes them: tuples of three numbers.
#pragma once

#include <Eigen/Core>

#include <array>

namespace fledge::core {

using Triple = std::array<double, 3>;

inline Eigen::Vector3d vector(const Triple &x)
{
    return {x[0], x[1], x[2]};
}

inline Triple triple(const Eigen::Vector3d &x)
{
    return {x[0], x[1], x[2]};
}

} // namespace fledge::core
