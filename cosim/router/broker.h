// SPDX-License-Identifier: Apache-2.0
// The broker of the thesis' appendix C: a frontend where asynchronous programs publish, a backend where
// they subscribe. What nodes exchange rides inside ticks and tocks; here it is shown to those who watch.
//
// It has a thread of its own, and the run never waits for it:
//
// - The Router copies records into a ring. Where the ring is full, of each topic the newest waits until
//   there is room; those before it are dropped and counted.
// - libzmq drops for an observer that does not keep up what exceeds `waiting`. So an observer sees a
//   gap by Record::count, which counts from 1 since the last Start without any.
//
// On the backend a message has two parts: the topic's name, and a frame Published. What a topic held at the
// beginning has count 0. Whoever subscribes gets the last of each topic at once; as subscriptions to the
// same topic share it, others may see it again, with the count that they have seen. At the end comes
// "finish" with a frame Finish, again and again until nobody subscribes to that any longer: who has
// got it unsubscribes. To the frontend go messages of the same form.
#pragma once

#include "cosim/controller/run_listener.h"
#include "cosim/router/byte_ring.h"
#include "cosim/security/authenticator.h"
#include "cosim/transport/link.h"

#include <atomic>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

namespace fledge::cosim {

struct BrokerConfig {
    std::string frontend, backend;            ///< addresses; of a TCP port "*", any free one
    std::size_t room = std::size_t{16} << 20; ///< bytes of records that wait for its thread; one has up to half
    int waiting = 1000;                       ///< most messages that wait for one observer
    Limits limits = {};
};

struct BrokerCounts {
    std::uint64_t published = 0; ///< records that it was given
    std::uint64_t dropped = 0;   ///< of those, before they were sent to anybody
    std::uint64_t received = 0;  ///< from asynchronous programs, and well formed
    std::uint64_t refused = 0;   ///< what was not, or came too fast
};

class Broker final : public Witness {
public:
    /// What an asynchronous program wrote.
    struct Written {
        std::string program, topic;
        Bytes payload;
    };

    /// With a gate, only who is allowed may connect, and write under the names of its key; the gate
    /// outlives the broker. Throws LinkError.
    Broker(zmq::context_t &context, BrokerConfig config, Gate *gate = nullptr);
    ~Broker() override;

    const std::string &frontend() const { return frontend_address_; }
    const std::string &backend() const { return backend_address_; }

    // On the Router's thread.

    void began(const Exchange &exchange) override;
    void wrote(const std::string &node, const std::vector<Record> &records) override;
    void ended(const std::string &reason) override;
    /// From time to time: hand on what there was no room for.
    void tend() { hand_on_late(); }

    bool heard() const { return heard_.load(std::memory_order_relaxed); }
    /// What asynchronous programs wrote since the last time, in order.
    std::vector<Written> take();
    /// One of these may not be: count it, and tell the user once.
    void refuse(const std::string &why);
    /// What was refused.
    std::vector<std::string> take_reports();
    BrokerCounts counts() const;

private:
    enum class Kind : std::uint32_t { record, finish };
    struct Head {
        Kind kind;
        std::uint32_t channel, count, topic, node; ///< the last two: bytes of their names
        std::uint32_t spare;
        std::uint64_t payload; ///< bytes
        Ns t;
    };
    struct Last {
        Published published;
        bool wanted = true; ///< somebody subscribed to it; as of `looked`
        std::uint64_t looked = 0;
    };

    bool hand_on(Kind kind, const std::string &topic, const std::string &node, const Record &record);
    void hand_on_or_keep(const std::string &topic, const std::string &node, const Record &record);
    void hand_on_late();

    void serve();
    bool drain();
    void publish(std::span<const std::byte> entry);
    void send(const std::string &topic, const Message &message);
    bool tell_end();
    bool wanted(const std::string &topic, Last &last);
    void hear_subscriptions();
    bool hear_programs();
    std::string read(std::vector<zmq::message_t> &parts, Written &written);

    BrokerConfig config_;
    Gate *gate_;
    zmq::socket_t frontend_, backend_;
    std::string frontend_address_, backend_address_;

    ByteRing ring_; ///< from the Router's thread to the broker's

    // The Router's.
    std::vector<std::string> topics_;       ///< by channel
    std::map<std::string, Published> late_; ///< by topic: the newest of what found no room
    std::string end_;
    bool end_is_late_ = false;

    // The broker's.
    std::map<std::string, Last> last_; ///< by topic
    std::set<std::string> subscribed_; ///< prefixes
    std::optional<Finish> over_;       ///< the run is
    std::uint64_t subscriptions_ = 1;  ///< changes of that
    Bytes frame_;

    // Between the two.
    std::atomic<bool> heard_{false}, stop_{false};
    std::atomic<std::uint64_t> published_{0}, dropped_{0}, received_{0}, refused_{0};
    std::mutex mutex_; ///< of what follows
    std::vector<Written> inbox_;
    std::size_t inbox_bytes_ = 0;
    std::set<std::string> said_;
    std::vector<std::string> reports_;

    std::thread thread_;
};

} // namespace fledge::cosim
