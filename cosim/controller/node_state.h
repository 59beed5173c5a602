// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "cosim/controller/config.h"
#include "cosim/controller/restart_log.h"

#include <optional>

namespace fledge::cosim {

/// The last step of the protocol that a node has completed. From `entered` to `matched` nodes wait for each other.
enum class Stage {
    absent,
    entered,
    initialized,
    desired,
    matched,
    idle,
    ticking,
    saving,
    dismissed, ///< the controller requested its end, while the run goes on
    finished,
    lost,
};

/// What the controller knows of a node, or of an asynchronous program.
struct NodeState {
    NodeConfig config;
    std::optional<AsynchronousConfig> program; ///< an asynchronous program: never a member
    Stage stage = Stage::absent;
    bool member = false;    ///< it takes part
    bool been = false;      ///< it took part, now or before
    bool joining = false;   ///< it came during the run and waits for the next boundary
    bool matching = false;  ///< it takes part in the current matching
    bool returning = false; ///< its program was lost; a new one repeats its ticks

    std::uint32_t number = 0; ///< of the last request
    bool awaited = false;     ///< the controller waits for its reply
    std::size_t expected = 0; ///< the kind of the reply

    Schedule schedule;
    bool saves = false; ///< it makes snapshots
    std::vector<Subscription> subscriptions;
    std::vector<Publication> publications;
    Ns reached = -1, until = -1; ///< the last instant it stepped through, and the last granted
    RestartLog log;
    RestartLog past;    ///< what it wrote in the run from which this one goes on
    Ns from = -1;       ///< its program goes on from a snapshot of this instant; until there, `past` answers for it
    Ns keep = for_ever; ///< the time of its next snapshot: no step beyond without it
    int tries = 0;      ///< restarts since its last progress

    const std::string &name() const { return config.name; }
    /// Whether a program is connected.
    bool connected() const { return stage != Stage::absent && stage != Stage::finished && stage != Stage::lost; }
    /// It writes nothing more.
    bool over() const { return !member || stage == Stage::finished; }
    /// The run waits for it at its time.
    bool scheduled() const { return config.joins == Join::at_time && !been; }
    bool played() const { return reached < from; }
    Ns granted() const { return stage == Stage::ticking ? until : reached; }
    /// The first instant at which it may still write.
    Ns first_write() const { return over() ? for_ever : schedule.first_write_after(reached); }
    /// It will not write up to t.
    bool complete(Ns t) const { return t != for_ever && first_write() > t; }
};

using Nodes = std::vector<NodeState>;

} // namespace fledge::cosim
