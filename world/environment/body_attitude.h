// SPDX-License-Identifier: Apache-2.0
// How a body stands and turns.
#pragma once

#include <Eigen/Core>

namespace fledge::world {

struct BodyAttitude {
    Eigen::Matrix3d dcm_PN;     ///< maps N (ICRF) to P (fixed in the body)
    Eigen::Vector3d omega_PN_P; ///< [rad/s] of P relative to N, P components
};

} // namespace fledge::world
