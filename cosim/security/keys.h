// SPDX-License-Identifier: Apache-2.0
// Keys, for an exchange beyond one machine: all messages are encrypted, and only programs whose public key the
// controller knows take part (CURVE of libzmq). `./fledge keys` makes keys.
//
//     KEYS/controller.secret         the controller's pair; stays with it, mode 0600
//     KEYS/controller.public         for all nodes
//     KEYS/allowed/NAME.public       keys that may take part, and as which nodes
//
//     KEYS/NAME.secret               the pair of a node, or of a machine of several nodes
//     KEYS/NAME.public               for the controller
//     KEYS/controller.public
//
// Both may be one folder. A file is a certificate as ZeroMQ's other tools read and write it:
//
//     metadata
//         name = "world"
//         nodes = "world flight"     in allowed/: the nodes whose names it may use; "*": all
//     curve
//         public-key = "..."         40 characters of Z85
//         secret-key = "..."         in NAME.secret
//
// Example:
//
//     zmq::context_t context;
//     zmq::socket_t socket(context, zmq::socket_type::dealer);
//     cosim::use_keys(socket, cosim::read_client_keys(cosim::place_of_keys("keys"), "world")); // throws KeyError
#pragma once

#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>
#include <zmq.hpp>

namespace fledge::cosim {

/// A missing or unusable key. The text names the file and says what to do.
class KeyError : public std::runtime_error {
    using runtime_error::runtime_error;
};

/// In Z85.
struct KeyPair {
    std::string open, secret;
};

/// For a program that connects.
struct ClientKeys {
    KeyPair own;
    std::string controller; ///< its public key
};

/// A key that may take part.
struct AllowedKey {
    std::string name;               ///< of its file
    std::string key;                ///< public
    std::vector<std::string> nodes; ///< whose names it may use; "*": all

    bool may_speak_as(const std::string &node) const;
};

/// A folder or file of keys: `given`, else FLEDGE_KEYS, else "".
std::string place_of_keys(const std::string &given);

/// The keys of a node. Of a folder: NODE.secret, else the only one there but the controller's.
/// Throws KeyError.
ClientKeys read_client_keys(const std::filesystem::path &place, const std::string &node);

/// The pair of the controller. Throws KeyError.
KeyPair read_controller_keys(const std::filesystem::path &folder);

/// Throws KeyError.
std::vector<AllowedKey> read_allowed_keys(const std::filesystem::path &folder);

/// Before it connects.
void use_keys(zmq::socket_t &socket, const ClientKeys &keys);

} // namespace fledge::cosim
