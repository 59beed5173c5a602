// SPDX-License-Identifier: Apache-2.0
// How a program reaches a controller: it takes missing options from its environment, sends a Hello to the one
// static address, and gets a Welcome or a reason.
#pragma once

#include "cosim/security/keys.h"
#include "cosim/transport/handshake.h"
#include "cosim/transport/link.h"

#include <chrono>
#include <optional>
#include <string>

namespace fledge::cosim {

/// Fill in what is empty from FLEDGE_SIMULATION, FLEDGE_NODE and FLEDGE_ADDRESS. Throws LinkError.
void ask_environment(std::string &simulation, std::string &node, std::string &address);

/// The controller's answer. Throws ProtocolError, and LinkError if the controller refuses, does not accept the
/// key, or does not answer in time.
Frame greet(zmq::context_t &context, const std::string &address, const std::optional<ClientKeys> &keys,
            const Hello &hello, std::chrono::milliseconds connect_timeout, const Limits &limits);

/// A controller that listens at all addresses does not know its host name: take it from `controller`.
std::string reachable(std::string address, const std::string &controller);

} // namespace fledge::cosim
