// SPDX-License-Identifier: Apache-2.0
// Which programs may connect to a controller with keys. libzmq asks about each connection, by its protocol ZAP,
// before it reads anything from it. The answer is in the folder of keys, which is read again for each connection,
// so that the user can allow a key while the controller waits for its node.
#pragma once

#include "cosim/security/keys.h"

#include <atomic>
#include <chrono>
#include <map>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <vector>

namespace fledge::cosim {

class Authenticator {
public:
    /// One per context. It outlives the sockets that it guards: without an authenticator, libzmq accepts every
    /// connection. Throws KeyError.
    Authenticator(zmq::context_t &context, std::filesystem::path folder);
    ~Authenticator();
    Authenticator(const Authenticator &) = delete;
    Authenticator &operator=(const Authenticator &) = delete;

    /// Before the socket is bound: accept only keys that may use the name `node`; "": all allowed keys.
    void guard(zmq::socket_t &socket, const std::string &node = "");

    /// Whether the sender's key may use the name `node`.
    bool may_speak_as(zmq::message_t &message, const std::string &node) const;

    /// The name of the sender's key; "" if it is unknown.
    std::string name_of(zmq::message_t &message) const;

    /// Which programs were refused, and why; each text once.
    std::vector<std::string> take_reports();

private:
    void serve();
    void answer();
    const AllowedKey *find(const std::string &key) const;
    void read_again();
    void report(const std::string &text);

    std::filesystem::path folder_;
    KeyPair own_;
    zmq::socket_t requests_; ///< of libzmq
    zmq::socket_t end_;      ///< a message to `ended_` ends the thread
    zmq::socket_t ended_;
    mutable std::mutex mutex_; ///< of what follows
    std::vector<AllowedKey> allowed_;
    std::chrono::steady_clock::time_point read_;
    std::filesystem::file_time_type changed_;
    std::map<std::string, std::string> nodes_; ///< by domain
    std::set<std::string> reported_;
    std::vector<std::string> reports_;
    std::thread thread_;
};

} // namespace fledge::cosim
