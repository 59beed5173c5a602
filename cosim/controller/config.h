// SPDX-License-Identifier: Apache-2.0
// What the user decides about a run.
#pragma once

#include "cosim/controller/run_listener.h"
#include "cosim/controller/schedule.h"
#include "cosim/controller/topic_map.h"
#include "cosim/protocol/words.h"

#include <algorithm>
#include <memory>

namespace fledge::cosim {

/// A node's place in ControllerConfig::nodes.
using NodeId = std::size_t;

/// What to do when a node is lost during the run. Before its first tick, a loss ends the run.
enum class Policy {
    abort,   ///< end the run
    pause,   ///< no node steps until the lost node is back
    hold,    ///< go on; its messages keep their last values
    drop,    ///< go on; its messages become all zero, which is "never written"
    restart, ///< another program of its name goes on from its last snapshot, unnoticed by the other nodes
};

inline constexpr std::pair<std::string_view, Policy> policy_words[] = {{"abort", Policy::abort},
                                                                       {"pause", Policy::pause},
                                                                       {"hold", Policy::hold},
                                                                       {"drop", Policy::drop},
                                                                       {"restart", Policy::restart}};

/// When a node takes part.
enum class Join {
    at_start,      ///< the run does not begin without it
    at_time,       ///< the run waits for it at NodeConfig::joins_after
    when_it_comes, ///< at the first time that no other node has passed, or never
};

struct NodeConfig {
    std::string name;
    Policy on_loss = Policy::abort;
    Join joins = Join::at_start;
    Ns joins_after = -1;          ///< at_time: it begins after this instant
    bool rejoins = false;         ///< after it left or was given up (hold, drop), it may come again
    Ns save_every = 0;            ///< simulated time between snapshots; 0: when the log is full
    std::vector<Rate> steps = {}; ///< the required rates; empty: any
    TopicMap names = {};          ///< its names of topics
};

/// A program that does not step (a ground system): the controller gives its messages a time.
struct AsynchronousConfig {
    std::string name;
    std::vector<std::string> topics = {}; ///< that it writes, if nodes read them; empty: all "/NAME/..."
    unsigned complete = 0; ///< so many of its observers miss no message: the run waits for them. 0: they may
    std::vector<std::string> hears = {}; ///< of these topics; empty: of all

    bool writes(const std::string &topic) const
    {
        return topics.empty() ? topic.starts_with("/" + name + "/")
                              : std::find(topics.begin(), topics.end(), topic) != topics.end();
    }
};

/// What was written in a run up to an instant, for a run that goes on from there.
struct Past {
    struct Topic {
        std::string name;
        Payload initial;
        std::vector<std::pair<Ns, Payload>> messages; ///< with the times of writing, ascending
    };
    Ns until = -1;
    std::vector<Topic> topics;
    std::vector<NodeSnapshot> snapshots; ///< each of a time <= until; a node without one steps from the start
};

struct ControllerConfig {
    std::string simulation;
    std::vector<NodeConfig> nodes;
    Ns end = 0; ///< the last instant
    std::uint64_t seed = 0;
    std::string frontend, backend;            ///< addresses of the broker, for the nodes
    std::uint32_t batch = 1000;               ///< most instants in one tick
    std::uint32_t ahead = 4096;               ///< most messages that wait for one reader; at least 4
    bool listened = false;                    ///< give Began and Wrote, for run listeners
    std::size_t log = std::size_t{256} << 20; ///< most bytes of a RestartLog
    std::vector<AsynchronousConfig> asynchronous = {};
    std::vector<std::string> watched = {}; ///< topics that nodes write even without a reader
    Ns keep_every = 0;                     ///< simulated time between snapshots of all nodes; 0: none
    std::shared_ptr<const Past> past;      ///< the run goes on from there; null: from the start
    Ns horizon = for_ever;                 ///< no node steps beyond it: see Controller::set_horizon()

    /// Throws std::invalid_argument if it makes no sense.
    void check() const;
};

} // namespace fledge::cosim
