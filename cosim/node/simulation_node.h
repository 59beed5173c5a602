// SPDX-License-Identifier: Apache-2.0
// A process of a Simulation as a node: "flight" here, "world" in another program. Messages of other nodes enter by
// stand-ins, instances with one output each, wired to the inputs. Other nodes can read all outputs of the process, by
// the topics of records: "/world/nav/attitude".
//
// Such a run gives the bits of a single program if wires along the order of its processes have the latency
// same_instant, wires against it next_instant, and wires with latency 1 next_exchange. Modes and events are checked
// when the process itself steps.
//
// A model that carries units for flight, as a radio does, owns what is on its way, also where flight and the ground are
// other programs. `/flight/downlink` brings what flight sent, `/world/radio/uplink` what the ground sent by
// world.radio; both are seen at the next instant, and count as sent at the one before. What has arrived goes out at
// each instant of flight, as `/flight/uplink` and `/world/radio/downlink`.
#pragma once

#include "cosim/node/delegate.h"
#include "cosim/node/mailbox.h"
#include "cosim/node/units.h"
#include "sim/simulation.h"

#include <map>
#include <memory>

namespace fledge::cosim {

class SimulationNode : public Node {
public:
    /// The simulation has this one process, wired except for the inputs from other nodes. It outlives the node.
    SimulationNode(sim::Simulation &simulation, const std::string &process);
    ~SimulationNode() override;

    /// Wire a topic of another node to an input. Throws SetupError as Simulation::connect does, or if another input
    /// reads the topic at another latency.
    void read(const std::string &topic, const sim::Port &to, Latency latency, Ns stale_after = 0);

    /// Carry the units of a flight process in another program, which steps at these rates, by the models that serve it.
    /// Throws SetupError if this process does not step at each of its instants.
    void carry(const std::string &flight, std::vector<Rate> rates);

    Initialized initialize(const Initialize &request) override;
    std::vector<Subscription> desired() override;
    std::vector<Publication> match(const std::vector<Channel> &channels) override;
    void start(const std::vector<Channel> &wired) override;
    Tock tick(const Tick &tick) override;
    Bytes save() override;
    void finish(const std::string &reason) override;

private:
    struct StandIn;
    struct Input {
        std::span<std::byte> bytes; ///< of the stand-in
        std::vector<SchemaField> fields;
    };

    /// A model that serves a flight process.
    struct Radio {
        sim::Carrier *carrier;
        std::string topic; ///< "/world/radio"
        std::optional<std::uint32_t> uplink;
        UnitsOut downlink;
        std::vector<sim::Packet> arrived; ///< at the ground, and not handed over yet
    };
    struct Served {
        std::string flight;
        std::vector<Rate> rates;
        std::vector<Radio> radios;
        std::optional<std::uint32_t> downlink;
        UnitsOut uplink;
        std::vector<sim::Packet> arrived; ///< at flight
        Ns every() const;
    };
    std::vector<std::vector<sim::Packet> *> arrived();
    bool listen(const Channel &channel);
    bool send(const Record &record);
    void hand_over(Ns t, std::vector<Record> &records);

    sim::Simulation &simulation_;
    sim::Process &process_;
    sim::Process &others_;
    Ns end_ = 0;           ///< of the run
    bool stepped_ = false; ///< since its beginning: parameters do not change between the ticks of a run
    std::vector<Subscription> subscriptions_;
    std::map<std::string, std::unique_ptr<StandIn>> stand_ins_; ///< by topic
    std::map<std::uint32_t, Input> inputs_;                     ///< by channel
    Inbox inbox_;
    Outbox outbox_; ///< of the process' instances
    std::vector<Served> served_;
};

} // namespace fledge::cosim
