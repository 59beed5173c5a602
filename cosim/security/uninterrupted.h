// SPDX-License-Identifier: Apache-2.0
// Calls of libzmq that a signal interrupts are made again.
#pragma once

#include <cerrno>
#include <zmq.hpp>

namespace fledge::cosim {

/// Call libzmq until no signal interrupts it; a call that a signal interrupts has done nothing.
template <class Call> auto uninterrupted(Call call)
{
    for (;;) {
        try {
            return call();
        } catch (const zmq::error_t &error) {
            if (error.num() != EINTR) {
                throw;
            }
        }
    }
}

} // namespace fledge::cosim
