// SPDX-License-Identifier: Apache-2.0
// Who is let in at a controller with keys. libzmq asks about each connection, by a protocol of its own
// (ZAP), before anything of it is read: the answer is in the folder of keys. The folder is read again
// when somebody comes, so that a key can be allowed while a controller waits for its node.
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

class Gate {
public:
    /// One per context, for that is what libzmq asks. It outlives the sockets that it guards: libzmq
    /// would let everybody in if nobody answered. Throws KeyError.
    Gate(zmq::context_t &context, std::filesystem::path folder);
    ~Gate();
    Gate(const Gate &) = delete;
    Gate &operator=(const Gate &) = delete;

    /// From now on only those are let in at this socket who may speak as `node`; "": all that are
    /// allowed at all. Before it is bound.
    void guard(zmq::socket_t &socket, const std::string &node = "");

    /// Whether who sent this message may speak as `node`.
    bool may_speak_as(zmq::message_t &message, const std::string &node) const;

    /// The name of the key that a message came with; "" if it is not known.
    std::string name_of(zmq::message_t &message) const;

    /// What the user should know: who was not let in, and why. Each is said once.
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
    zmq::socket_t end_;      ///< this side of a pair by which the thread is told to end
    zmq::socket_t told_;
    mutable std::mutex mutex_; ///< of what follows
    std::vector<AllowedKey> allowed_;
    std::chrono::steady_clock::time_point read_;
    std::filesystem::file_time_type changed_;
    std::map<std::string, std::string> nodes_; ///< by domain
    std::set<std::string> said_;
    std::vector<std::string> reports_;
    std::thread thread_;
};

} // namespace fledge::cosim
