// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdexcept>

namespace fledge::emulator {

/// A mistake of the user: a board file, a program, a snapshot.
struct Error : std::runtime_error {
    using std::runtime_error::runtime_error;
};

} // namespace fledge::emulator
