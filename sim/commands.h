// SPDX-License-Identifier: Apache-2.0
// The commands of one process of flight, by the code that every target flies (flight/command). Private to the kernel.
#pragma once

#include "flight/telemetry/telemetry.h"
#include "sim/structure.h"

#include <functional>
#include <memory>
#include <utility>
#include <vector>

namespace fledge::sim {

class Runtime;

class Commands {
public:
    /// The process and the dictionary of it, and the run that the commands change; both live longer.
    Commands(Runtime &runtime, Process &process, std::shared_ptr<const Dictionary> dictionary);

    /// Nothing waits, and nothing was counted.
    void begin();
    void forget(Ns t); ///< as the computer's reset at t does: what waits is lost, the script goes on
    /// Accept what carriers and the script have for the instant t; `last` is the one before it.
    void accept_due(Ns t, Ns last);
    /// The time after which the process' next instant executes something; never: as things stand, none does.
    Ns next(Ns now) const;
    /// The instant t is the last one that has run.
    void find_place(Ns t);
    CommandReason accept(std::span<const std::uint8_t> packet, Ns last); ///< after the instant `last`
    void execute(Ns t);

    /// After the events of the instant t: let the procedure have its turn. Returns whether it has changed parameters.
    bool run_procedure(Ns t);
    CommandReason enter(std::uint16_t mode) { return command_enter(&context_, mode); } ///< of a procedure

    /// Whether telemetry is on that counts flight's instants, of all of its tasks.
    bool counts_instants() const { return rates_[0].on != 0; }
    /// At the end of flight's instant t: send the telemetry that is due.
    void send_telemetry(Ns t);

    /// Whether a snapshot must have its state.
    bool used() const;
    const CommandCounters &counters() const { return state_.counters; }
    const CommandLink &ground() const { return state_.ground; }
    /// The reports since the last call.
    std::vector<CommandReply> take_reports() { return std::exchange(reports_, {}); }

    void visit_state(const std::function<void(void *, std::size_t)> &block);

private:
    void lay_out_blocks();
    void lay_out_calls();
    void lay_out_outputs();
    void lay_out_services();
    std::uint16_t mode() const;
    Ns scripted() const; ///< after which the next command of the script comes; never if there is none
    static CommandReason start(const CommandContext *context, std::uint16_t slot, std::uint32_t n, std::uint32_t turns);
    static CommandReason stop(const CommandContext *context, std::uint16_t slot);
    void end_procedure(Ns t, bool killed, const std::string &why);
    /// Write what a procedure changed: `before` is the memory of each instance. Returns "", or why it is refused.
    std::string write_changes(const std::vector<std::vector<std::byte>> &before);
    std::string write_changes(const Dictionary::Block &block, std::uint16_t place, const std::byte *before);

    static void report(void *self, const CommandReport *report, const std::uint8_t *data);
    static void keep(void *self, const std::uint8_t *packet, std::uint32_t n);
    void send(Ns t, Unit unit);
    void wrap(const std::uint8_t *packet, std::uint32_t n); ///< into frames; 0: send what waits
    Ns played() const;                                      ///< the time of the next packet of a target that flew

    Runtime &runtime_;
    Process &process_;
    std::shared_ptr<const Dictionary> dictionary_;
    std::vector<CommandBlock> blocks_;
    std::vector<std::uint8_t> staged_, queue_;
    std::vector<const CommandService *> services_;
    std::vector<Instance *> service_modules_;
    std::vector<std::uint16_t> events_; ///< the places of outputs that are events
    CommandServices table_of_services_{};
    CommandTable table_{};
    CommandState state_{};
    static constexpr std::uint16_t slots = 2;        // as targets/micropython/procedure.c has
    static constexpr std::uint32_t slot_room = 2048; // [bytes]

    std::vector<std::uint8_t> slots_ = std::vector<std::uint8_t>(slots * slot_room);
    CommandProcedures procedures_{};
    CommandContext context_{}; ///< of the procedure that runs
    std::uint16_t slot_ = 0;   ///< of it
    bool runs_ = false;
    std::vector<CommandReply> reports_;
    std::vector<Carrier *> carriers_;

    std::vector<TelemetryOutput> outputs_;
    std::vector<const std::byte *> live_; ///< the messages themselves
    std::vector<TelemetryRate> rates_;
    std::vector<std::byte> image_; ///< a mission's memory for telemetry: the address of this object, then the outputs
    std::vector<std::uint8_t> packet_;
    TelemetryTable telemetry_{};
    Ns reported_ = -1;                   ///< the instant that telemetry is about
    std::size_t place_ = 0, played_ = 0; ///< in the script, and in the packets of a target that flew
};

} // namespace fledge::sim
