// SPDX-License-Identifier: Apache-2.0
// The commands of one process of flight, by the code that every target flies (flight/command). Private to the kernel.
#pragma once

#include "flight/command/command.h"
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
    void forget(); ///< as the computer's reset does: what waits is lost, the script goes on
    /// Accept what the script has for the instant t; `last` is the one before it.
    void accept_script(Ns t, Ns last);
    /// The time after which the next command of the script comes; never if there is none.
    Ns scripted() const;
    /// The instant t is the last one that has run.
    void find_place(Ns t);
    CommandReason accept(const std::vector<std::uint8_t> &packet, Ns last); ///< after the instant `last`
    void execute(Ns t);

    bool waiting() const { return state_.waiting > 0; }
    /// Whether a snapshot must have its state.
    bool used() const;
    const CommandCounters &counters() const { return state_.counters; }
    /// The reports since the last call.
    std::vector<CommandReply> take_reports() { return std::exchange(reports_, {}); }

    void visit_state(const std::function<void(void *, std::size_t)> &block);

private:
    static void report(void *self, const CommandReport *report, const std::uint8_t *data);

    Runtime &runtime_;
    Process &process_;
    std::shared_ptr<const Dictionary> dictionary_;
    std::vector<CommandBlock> blocks_;
    std::vector<std::uint8_t> staged_, queue_;
    CommandTable table_{};
    CommandState state_{};
    std::vector<CommandReply> reports_;
    std::size_t place_ = 0; ///< in the script
};

} // namespace fledge::sim
