// SPDX-License-Identifier: Apache-2.0
// The broker of the thesis' appendix C: a frontend where asynchronous programs publish, and a backend where they
// subscribe. Nodes exchange messages inside ticks and tocks; the broker shows these messages to observers.
//
// It runs on its own thread, and the run does not wait for it:
//
// - The Router copies records into a ring. If the ring is full, the newest record of each topic waits for room;
//   the broker drops and counts older ones.
// - If an observer does not keep up, libzmq drops the messages beyond `waiting`. The observer notices the gap by
//   Record::count, which counts from 1 since the last Start.
//
// Complete observers, which the configuration names, miss no message of the topics that they are to hear: each has a
// backend of its own, which drops none of these, and shows of each other topic the newest message, up to 50 times a
// second. While one of them takes no more, the ring fills, and holds() lets the Router wait. One that takes nothing for
// `patience` misses messages, as others do, until it takes some again. The run does not wait for one that is gone.
//
// On the backend a message has two parts: the topic's name, and a frame Published. An initial value has the count 0.
// A new subscriber gets the last message of each topic at once. The other subscribers of the topic get it again, too,
// with the same count. At the end the broker sends "finish" with a frame Finish repeatedly, until all observers have
// received it and unsubscribed from "finish". The frontend takes messages of the same form.
#pragma once

#include "cosim/controller/run_listener.h"
#include "cosim/router/byte_ring.h"
#include "cosim/security/authenticator.h"
#include "cosim/transport/link.h"

#include <atomic>
#include <chrono>
#include <deque>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <utility>
#include <vector>

namespace fledge::cosim {

struct BrokerConfig {
    std::string frontend, backend;            ///< addresses; TCP port "*": any free one
    std::size_t room = std::size_t{16} << 20; ///< bytes of the ring; a record may take half
    int waiting = 1000;                       ///< the most messages in the queue of an observer
    Limits limits = {};
    bool any_user = false; ///< over "ipc://"; else only programs of this user can connect
    Ns after = -1;         ///< of what was written until then, observers see only the last message of each topic
    std::map<std::string, unsigned> observers = {};  ///< complete ones, so many of each of these programs
    std::string complete;                            ///< the address of their backends, which end with "-" and a number
                                                     ///< but over TCP
    std::set<std::string> complete_topics = {};      ///< topics that they are to hear; empty: all
    std::chrono::milliseconds patience{60'000};      ///< 0: for ever,
    std::chrono::milliseconds last_patience{10'000}; ///< but so long after the end
};

struct BrokerCounts {
    std::uint64_t published = 0; ///< records from the run
    std::uint64_t dropped = 0;   ///< of these, not sent to any observer
    std::uint64_t received = 0;  ///< well-formed messages of asynchronous programs
    std::uint64_t refused = 0;   ///< messages that were malformed, or came too fast
};

class Broker final : public RunListener {
public:
    /// A message of an asynchronous program.
    struct Written {
        std::string program, topic;
        Payload payload;
    };

    /// With an authenticator, which outlives the broker, only programs with an allowed key can connect, and they can
    /// write only under the names of that key. Throws LinkError.
    Broker(zmq::context_t &context, BrokerConfig config, Authenticator *authenticator = nullptr);
    ~Broker() override;

    const std::string &frontend() const { return frontend_address_; }
    const std::string &backend() const { return backend_address_; }

    // On the Router's thread.

    void began(const Exchange &exchange) override;
    void wrote(const std::string &node, const std::vector<Record> &records) override;
    void settled(Ns t) override;
    void ended(const std::string &reason) override;
    /// Send records for which the ring had no room. To be called from time to time.
    void send_late();

    /// Whether the run has to wait, because complete observers do not keep up.
    bool holds() const { return !complete_.empty() && (!late_.empty() || ring_.fill() > 0.5); }
    /// The backend for the next observer of this program: of a complete one, if possible one that no other uses.
    const std::string &backend(const std::string &program);
    /// How many complete observers of this program have subscribed since the beginning.
    std::size_t came(const std::string &program) const;

    bool received() const { return received_any_.load(std::memory_order_relaxed); }
    /// The messages of asynchronous programs since the last call, in order.
    std::vector<Written> take();
    /// Count a refused message, and report each reason once.
    void refuse(const std::string &why);
    /// Reasons of refusals.
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
        bool subscribed = true; ///< an observer subscribes to it; valid while looked == subscriptions_
        std::uint64_t looked = 0;
    };
    /// The backend of one complete observer. More than one share it, and its patience, if more come than are expected.
    struct Complete {
        Complete(std::string its_program, zmq::socket_t its_socket)
            : program(std::move(its_program)), socket(std::move(its_socket))
        {
        }
        std::string program;
        zmq::socket_t socket;
        std::string address = {};
        std::atomic<std::size_t> came{0};
        std::atomic<bool> taken{false};
        bool has = false;                                       ///< the message of frame_
        std::set<std::string> newer = {};                       ///< topics whose newest message it may see
        std::string stuck = {};                                 ///< the topic of a message that it does not take,
        std::chrono::steady_clock::time_point stuck_since = {}; ///< since then
    };

    void pass_on(const std::string &node, const Record &record);
    void pass_on_past(std::uint32_t channel);
    bool put(Kind kind, const std::string &topic, const std::string &node, const Record &record);
    void put_now_or_later(const std::string &topic, const std::string &node, const Record &record);

    void serve();
    bool drain();
    void publish(std::span<const std::byte> entry);
    void send(const std::string &topic, const Message &message);
    bool send_to(Complete &observer);
    bool gave_up(Complete &observer);
    bool deliver();
    void show_newest();
    bool send_end();
    bool subscribed(const std::string &topic, Last &last);
    void receive_subscriptions(zmq::socket_t &socket, Complete *complete);
    void report(const std::string &text);
    bool receive_messages();
    std::string read(std::span<zmq::message_t, 2> parts, Written &written);

    BrokerConfig config_;
    Authenticator *authenticator_;
    zmq::socket_t frontend_, backend_;
    std::deque<Complete> complete_;
    std::string frontend_address_, backend_address_;

    ByteRing ring_; ///< from the Router's thread to the broker's

    // Used by the Router's thread.
    std::vector<std::string> topics_;                    ///< by channel
    std::deque<std::pair<std::string, Published>> late_; ///< topics and records for which the ring had no room
    std::map<std::uint32_t, std::pair<std::string, Record>> past_; ///< by channel: see BrokerConfig::after
    std::string end_;
    bool end_is_late_ = false;
    std::size_t given_ = 0; ///< the last of complete_ that backend() has named

    // Used by the broker's thread.
    std::map<std::string, Last> last_;                              ///< by topic
    std::set<std::pair<const Complete *, std::string>> subscribed_; ///< whose backend (null: backend_), and prefixes
    std::optional<Finish> finish_;                                  ///< set when the run is over
    std::uint64_t subscriptions_ = 1;                               ///< counts changes of subscribed_
    Bytes frame_;                                                   ///< of the entry that is sent,
    std::string topic_;                                             ///< and its topic; "": complete observers have it
    std::chrono::steady_clock::time_point seen_newest_; ///< when complete observers saw their `newer` topics
    bool shown_ = false;                                ///< the other observers have the first entry of the ring

    // Used by both threads.
    std::atomic<bool> received_any_{false}, ends_{false}, stop_{false};
    std::atomic<std::uint64_t> published_{0}, dropped_{0}, received_{0}, refused_{0};
    std::mutex mutex_; ///< of all members below
    std::vector<Written> inbox_;
    std::size_t inbox_bytes_ = 0;
    std::set<std::string> reported_;
    std::vector<std::string> reports_;

    std::thread thread_;
};

} // namespace fledge::cosim
