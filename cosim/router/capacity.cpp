// SPDX-License-Identifier: Apache-2.0
#include "cosim/router/capacity.h"

#include "cosim/transport/link_error.h"

#include <algorithm>
#include <string>
#include <sys/resource.h>

namespace fledge::cosim {

namespace {

/// Of each node: two of its socket, its connection, two of their events, and shared memory; while it joins, its
/// greeting and the connection of that.
constexpr std::size_t files_per_node = 8, sockets_per_node = 3;
constexpr std::size_t others = 100; ///< the program's own, the broker's, and some observers'

} // namespace

void make_room(zmq::context_t &context, std::size_t nodes)
{
    const int sockets = static_cast<int>(std::min<std::size_t>(sockets_per_node * nodes + others, 60'000));
    context.set(zmq::ctxopt::max_sockets, std::max(sockets, context.get(zmq::ctxopt::max_sockets)));
    const rlim_t needed = files_per_node * nodes + others;
    rlimit files{};
    if (getrlimit(RLIMIT_NOFILE, &files) || files.rlim_cur >= needed) {
        return;
    }
    if (files.rlim_max < needed) {
        throw LinkError(std::to_string(nodes) + " nodes need " + std::to_string(needed) +
                        " open files in the controller's program; this system allows it " +
                        std::to_string(files.rlim_max) +
                        " (ulimit -Hn; nofile in /etc/security/limits.conf raises it)");
    }
    files.rlim_cur = needed;
    setrlimit(RLIMIT_NOFILE, &files);
}

} // namespace fledge::cosim
