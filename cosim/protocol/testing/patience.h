// SPDX-License-Identifier: Apache-2.0
// For tests: how long they wait for what must happen, however busy the machine is. ctest limits a whole test.
#pragma once

#include <chrono>

namespace fledge::cosim {

constexpr std::chrono::seconds patience{300};

} // namespace fledge::cosim
