// SPDX-License-Identifier: Apache-2.0
// An exported mission's flight as a node, for a target that knows only the registers of its boards. The node puts
// messages of other nodes into the lanes, ticks the clock at flight's instants, and publishes what flight wrote. Other
// nodes see flight as a process of a simulation: the same topics, latencies and rates. Messages age in flight.
//
// If the back end makes snapshots of flight's computer, so does the node.
//
// Two topics more are the link to the ground: commands, which other programs write, and telemetry, as packets one after
// another in a message. If the mission has a radio, a model of another node, units of bytes go by it, too
// (cosim/node/simulation_node.h).
#pragma once

#include "cosim/node/delegate.h"
#include "cosim/node/mailbox.h"
#include "cosim/node/units.h"
#include "registers/backend.h"
#include "registers/outside.h"
#include "targets/mission_host.h"

#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <span>

namespace fledge::cosim {

class BoardNode : public Node {
public:
    /// The tables of the mission, as both sides of its boards have them; the node does not call flight's functions.
    /// Both live as long as the node. `reply_timeout`: for flight to answer a tick.
    BoardNode(const MissionHost &mission, registers::Backend &backend, std::chrono::nanoseconds reply_timeout);

    /// A command: the node puts it into its lane before flight's first instant after `after`. Call it in the order of
    /// time, before the run. Throws registers::Error if no lane carries commands.
    void command(Ns after, std::vector<std::uint8_t> packet);

    /// A model of another node carries its units. Call it before the run. Throws registers::Error if no lanes carry
    /// commands and telemetry.
    void speak_by_radio();

    /// Called with each packet of telemetry, and the instant of flight after which the node found it.
    std::function<void(Ns t, std::span<const std::uint8_t> packet)> telemetry;

    /// Resets flight, and reads its initial outputs; or goes on from a snapshot. Throws registers::Error if flight does
    /// not answer, or the snapshot is of another mission.
    Initialized initialize(const Initialize &request) override;
    std::vector<Subscription> desired() override;
    std::vector<Publication> match(const std::vector<Channel> &channels) override;
    void start(const std::vector<Channel> &wired) override;
    Tock tick(const Tick &tick) override;
    Bytes save() override;
    void finish(const std::string &reason) override;

    /// Errors at this end of the lanes.
    const MissionIoCounts &counts() const { return counts_; }

private:
    struct Message {
        std::string topic;
        Schema schema;
        std::vector<SchemaField> fields;
        Bytes held; ///< the last value put or taken
        bool to_flight = false, carried = false;
    };

    /// Packets as a topic: their number of bytes, and the bytes.
    struct Link {
        Link(const MissionHost &mission, MissionQueue queue, const char *name);
        std::uint32_t room() const { return static_cast<std::uint32_t>(held.size() - sizeof(std::uint32_t)); }

        std::string topic; ///< "": no lane carries such packets
        Schema schema;
        std::vector<SchemaField> fields;
        Bytes held;
        std::optional<std::uint32_t> channel;
    };

    template <class Archive> void pass_state(Archive &archive);
    void restore(const Initialize &request);
    Ns next_after(Ns t) const;
    bool is_down(Ns t);
    void take_commands(const Record &record);
    void take_unit(const std::byte *unit, std::size_t size);
    void put_telemetry(Ns t, std::vector<Record> &records);
    void send_commands(Ns t);
    void exchange(Ns t);

    const MissionHost &mission_;
    registers::Backend &backend_;
    registers::Outside outside_;
    std::chrono::nanoseconds reply_timeout_;
    std::vector<Message> messages_;                 ///< by id
    std::map<std::uint32_t, std::uint32_t> inputs_; ///< channel -> id
    Inbox inbox_;
    Outbox outbox_;
    struct Command {
        Ns after;
        std::vector<std::uint8_t> packet;
    };
    std::vector<Command> script_;
    std::size_t sent_ = 0;
    Link commands_, telemetry_;
    std::deque<std::vector<std::uint8_t>> waiting_,
        found_;                                ///< commands of others; telemetry that was not published yet
    bool by_radio_ = false, was_down_ = false; ///< at the last instant
    std::optional<std::uint32_t> uplink_;
    UnitsOut downlink_;
    std::vector<sim::Packet> received_, transmitted_; ///< by radio, in this instant
    std::uint32_t published_ = 0;                     ///< messages of telemetry since the last matching
    std::vector<std::uint8_t> packet_;                ///< room for a packet of telemetry
    MissionIoCounts counts_{};
    Ns reached_ = -1;
};

} // namespace fledge::cosim
