// SPDX-License-Identifier: Apache-2.0
// How a program comes to a controller: what it is not told it takes from its environment, it greets at the
// one static address, and is answered or told why not.
#pragma once

#include "cosim/security/keys.h"
#include "cosim/transport/link.h"

#include <chrono>
#include <optional>
#include <string>

namespace fledge::cosim {

/// What is empty becomes what FLEDGE_SIMULATION, FLEDGE_NODE and FLEDGE_ADDRESS say. Throws LinkError.
void ask_environment(std::string &simulation, std::string &node, std::string &address);

/// The controller's answer. Throws LinkError if it refuses, does not let this one in, or is not there in
/// time, and ProtocolError.
Frame greet(zmq::context_t &context, const std::string &address, const std::optional<ClientKeys> &keys,
            const Hello &hello, std::chrono::milliseconds patience, const Limits &limits);

/// A controller that listens everywhere does not know by which name it is reached: that of `controller`.
std::string reachable(std::string address, const std::string &controller);

} // namespace fledge::cosim
