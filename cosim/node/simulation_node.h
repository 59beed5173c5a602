// SPDX-License-Identifier: Apache-2.0
// A process of a Simulation as a node: "flight" here, "world" in another program. Messages of other nodes enter by
// stand-ins, instances with one output each, wired to the inputs. Other nodes can read all outputs of the process, by
// the topics of records: "/world/nav/attitude".
//
// Such a run gives the bits of a single program if wires along the order of its processes have the latency
// same_instant, wires against it next_instant, and wires with latency 1 next_exchange. Modes and events are checked
// when the process itself steps.
#pragma once

#include "cosim/node/delegate.h"
#include "cosim/node/mailbox.h"
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

    Initialized initialize(const Initialize &request) override;
    std::vector<Subscription> desired() override { return subscriptions_; }
    std::vector<Publication> match(const std::vector<Channel> &asked) override;
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

    sim::Simulation &simulation_;
    sim::Process &process_;
    sim::Process &others_;
    Ns end_ = 0; ///< of the run
    std::vector<Subscription> subscriptions_;
    std::map<std::string, std::unique_ptr<StandIn>> stand_ins_; ///< by topic
    std::map<std::uint32_t, Input> inputs_;                     ///< by channel
    Inbox inbox_;
    Outbox outbox_; ///< of the process' instances
};

} // namespace fledge::cosim
