// SPDX-License-Identifier: Apache-2.0
// A process of a Simulation as a node: "flight" here, "world" in another program. What comes from
// others enters by stand-ins, instances with one output each, which are wired to the inputs that want
// it. All outputs of the process can be read by others, by the topics that records use:
// "/world/nav/attitude".
//
// Such a run gives the bits of a single program if wires along the order of its processes are read at
// the same_instant, those against it at the next_instant, those with latency 1 at the next_exchange.
// Modes and events are looked at when the process itself steps.
#pragma once

#include "cosim/node/delegate.h"
#include "cosim/node/mailbox.h"
#include "sim/simulation.h"

#include <map>
#include <memory>

namespace fledge::cosim {

class SimulationNode : public Node {
public:
    /// The simulation has this one process, in which all is made and wired but what comes from
    /// others; the node lives no longer than it.
    SimulationNode(sim::Simulation &simulation, const std::string &process);
    ~SimulationNode() override;

    /// Wire a topic of another node to an input. Throws SetupError as Simulation::connect does, or if
    /// the topic was read at another latency.
    void read(const std::string &topic, const sim::Port &to, Latency latency, Ns stale_after = 0);

    Initialized initialize(const Initialize &request) override;
    std::vector<Want> desired() override { return wants_; }
    std::vector<Offer> match(const std::vector<Channel> &asked) override;
    void start(const std::vector<Channel> &wired) override;
    Tock tick(const Tick &tick) override;
    Bytes save() override;

private:
    struct StandIn;
    struct Input {
        std::span<std::byte> bytes; ///< of the stand-in
        std::vector<SchemaField> fields;
    };

    sim::Simulation &simulation_;
    sim::Process &process_;
    sim::Process &others_;
    std::vector<Want> wants_;
    std::map<std::string, std::unique_ptr<StandIn>> stand_ins_; ///< by topic
    std::map<std::uint32_t, Input> inputs_;                     ///< by channel
    Inbox inbox_;
    Outbox outbox_; ///< of the process' instances
};

} // namespace fledge::cosim
