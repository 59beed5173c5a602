// SPDX-License-Identifier: Apache-2.0
// What can go wrong. Set-up errors name the instance, the port or parameter, the rule, the value
// found and the valid choices; run errors name the instance and the time, and keep the last good values.
#pragma once

#include <stdexcept>

namespace fledge::sim {

struct SetupError : std::runtime_error {
    using std::runtime_error::runtime_error;
};

struct RunError : std::runtime_error {
    using std::runtime_error::runtime_error;
};

} // namespace fledge::sim
