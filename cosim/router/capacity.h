// SPDX-License-Identifier: Apache-2.0
// Room for many nodes: open files of this program, and libzmq's sockets.
#pragma once

#include <cstddef>
#include <zmq.hpp>

namespace fledge::cosim {

/// Let this program have the files and sockets that so many nodes need, in a context that has no sockets yet. Throws
/// LinkError if the system allows fewer files.
void make_room(zmq::context_t &context, std::size_t nodes);

} // namespace fledge::cosim
