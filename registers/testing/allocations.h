// SPDX-License-Identifier: Apache-2.0
// Counts the calls of operator new in the program that links allocations.cpp.
#pragma once

namespace fledge::registers::testing {

long allocations();

} // namespace fledge::registers::testing
