// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdexcept>

namespace fledge::cosim {

/// A connection, shared memory or a system resource that cannot be had, or is gone.
class LinkError : public std::runtime_error {
    using runtime_error::runtime_error;
};

} // namespace fledge::cosim
