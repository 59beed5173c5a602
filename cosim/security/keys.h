// SPDX-License-Identifier: Apache-2.0
// Keys, for an exchange that goes beyond one machine: what is sent is encrypted, and only those take
// part whose public key the controller knows (libzmq's CURVE). `./fledge keys` makes them.
//
//     KEYS/controller.secret         the controller's pair; stays with it, mode 0600
//     KEYS/controller.public         goes to all others
//     KEYS/allowed/NAME.public       who may take part, and as which nodes
//
//     KEYS/NAME.secret               the pair of a node, or of a machine of several nodes
//     KEYS/NAME.public               goes to the controller
//     KEYS/controller.public
//
// Both may be one folder. A file is one of ZeroMQ's certificates, which other tools read too:
//
//     metadata
//         name = "world"
//         nodes = "world flight"     in allowed/: the nodes that it may speak as; "*": all
//     curve
//         public-key = "..."         40 characters of Z85
//         secret-key = "..."         in NAME.secret
#pragma once

#include <chrono>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>
#include <zmq.hpp>

namespace fledge::cosim {

/// A key that is missing or cannot be used. The text names the file and says what to do.
class KeyError : public std::runtime_error {
    using runtime_error::runtime_error;
};

/// In Z85.
struct KeyPair {
    std::string open, secret;
};

/// What a program needs that connects.
struct ClientKeys {
    KeyPair own;
    std::string controller; ///< its public key
};

/// One that may take part.
struct AllowedKey {
    std::string name;               ///< of its file
    std::string key;                ///< public
    std::vector<std::string> nodes; ///< that it may speak as; "*": all

    bool may_speak_as(const std::string &node) const;
};

/// A folder or file of keys: `given`, else what FLEDGE_KEYS says; "" if neither.
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

/// Watches a socket that connects, for what libzmq does not tell otherwise: it would try for ever.
class Handshake {
public:
    Handshake(zmq::context_t &context, zmq::socket_t &socket, bool keyed);
    ~Handshake();
    Handshake(const Handshake &) = delete;
    Handshake &operator=(const Handshake &) = delete;

    zmq::pollitem_t events() { return {monitor_.handle(), 0, ZMQ_POLLIN, 0}; }

    /// Why the other side does not let this one in; "" as long as it may.
    const std::string &failure();
    /// Whether the connection is made.
    bool made() const { return made_; }
    /// Whether it was, and has been gone for so long. libzmq tries to make it again.
    bool gone_for(std::chrono::milliseconds time) const
    {
        return lost_ && !made_ && std::chrono::steady_clock::now() - *lost_ >= time;
    }

private:
    zmq::socket_t &socket_;
    zmq::socket_t monitor_;
    bool keyed_, made_ = false;
    std::optional<std::chrono::steady_clock::time_point> lost_;
    int broken_off_ = 0;
    std::string failure_;
};

/// The kind and value of the next event on a monitor's socket; false if there is none.
bool next_event(zmq::socket_t &monitor, std::uint16_t &kind, std::uint32_t &value);

/// In words, what an event says that means that a connecting socket is not let in; "" if it is none.
std::string refusal(std::uint16_t kind, std::uint32_t value, bool keyed);

} // namespace fledge::cosim
