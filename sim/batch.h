// SPDX-License-Identifier: Apache-2.0
// Many clones of one simulation that are stepped together, from arrays of numbers to arrays of numbers.
//
// A clone is fixed by its seed, its run, and the actions that it was given: neither the number of threads nor the other
// clones change a bit of it. Runs are those of a campaign (campaign.h): a seed and an index give the random streams and
// the dispersed parameters.
#pragma once

#include "sim/campaign.h"

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace fledge::sim {

/// Numbers that lie together in the memory of an instance.
struct BatchField {
    std::string instance;     ///< "world.wheels"
    std::uint32_t offset = 0; ///< [bytes] of the first one, from the start of that memory
    FledgeType type = FLEDGE_F64;
    std::vector<std::string> names; ///< of each, for messages: "world.wheels.command.u[0]"
};

struct BatchPlan {
    std::size_t clones = 0;
    Ns every = 0;         ///< the duration of a step, > 0
    unsigned threads = 1; ///< that work, the caller's among them
    std::vector<BatchField> actions, observations;
    CampaignPlan campaign; ///< the seed, and what is dispersed
    bool separate = false; ///< the caller gives each clone functions of its own, in place of those that all share
    std::size_t delay = 0; ///< [periods of flight] of an action on its way
};

/// Which run a clone flies.
struct BatchRun {
    std::uint64_t seed = 0;
    std::uint64_t index = 0;
};

/// An action in an input is a message that is made at the start of each step and replaces its wire. One in an output
/// replaces each wire from it. One in a parameter is a change of it. All clones have the parameters that `nominal` had
/// when the batch was made.
///
/// A clone stands before the first module of flight that has an action. So an action counts at the very instant that
/// was observed, as the output of a law in flight does, and only then the rest of that instant runs. What runs from
/// that module on is observed as of the instant before. A model of the world reads an action when it next runs, for the
/// time since this instant, and needs no such place.
///
/// A clone fails alone: by an action that breaks the rule of a parameter, or by an error in its run. It then stands
/// still until it is reset.
///
/// The functions that take `poll` call it now and then on the caller's thread, and return false if it ended them.
class Batch {
public:
    using Poll = std::function<bool()>;

    /// Throws SetupError if an action or observation is no number of this simulation or cannot be acted on, if a module
    /// or an event calls a function of the user's, unless the plan is `separate`, or if the simulation itself could not
    /// run.
    Batch(const Simulation &nominal, BatchPlan plan);
    ~Batch();
    Batch(const Batch &) = delete;
    Batch &operator=(const Batch &) = delete;

    std::size_t clones() const;
    std::size_t actions() const { return actions_; }           ///< numbers per clone
    std::size_t observations() const { return observations_; } ///< numbers per clone
    std::size_t drawn() const;                                 ///< numbers per clone
    /// Whether the numbers of a field of the plan's observations are those of the instant before.
    bool is_late(std::size_t observation) const { return late_[observation]; }

    /// Begin the clones `which` anew at time 0, each with its run, up to the first instant in which an action can
    /// count: with tasks without an offset, the instant 0. With a snapshot: set them to it, and run them to the first
    /// such instant from there; one of a clone of this batch is in one. Their random streams begin anew at the
    /// snapshot, as the runs say, and their parameters are its. No action is on its way. Throws SetupError, and changes
    /// nothing, if it is of another simulation.
    bool reset(std::span<const std::size_t> which, std::span<const BatchRun> runs,
               std::span<const std::byte> snapshot = {}, const Poll &poll = {});

    /// Write the actions, (clones, actions()) by rows, and run each clone for a step. Throws SetupError before any of
    /// them moves if a clone has not begun, or a number is not finite or none of its field's type. A step that `poll`
    /// ended is taken up by the next call: clones that had come to its end stand still.
    bool step(std::span<const double> actions, std::span<double> observed, const Poll &poll = {});

    /// The observations, (clones, observations()) by rows; NaN of clones that have failed or not begun. step() gives
    /// the same.
    void observe(std::span<double> to) const;

    const std::string &failure(std::size_t clone) const; ///< "" if it has not failed
    Ns time(std::size_t clone) const;                    ///< -1: it has not begun
    BatchRun run(std::size_t clone) const;
    const std::vector<double> &draws(std::size_t clone) const; ///< NaN of a clone that was set to a snapshot

    /// A clone itself, to give it functions of its own; it lives as long as the batch.
    Simulation &clone(std::size_t clone) const;

    /// A copy of a clone as it stands. Throws SetupError if it has not begun.
    std::unique_ptr<Simulation> copy(std::size_t clone) const;

    /// The run of a clone anew from time 0, alone, with the actions of (steps, actions()) by rows. Throws SetupError if
    /// the clone has not begun, RunError where the run fails.
    std::unique_ptr<Simulation> repeat(std::size_t clone, std::size_t steps, std::span<const double> rows) const;

private:
    struct Clone;
    class Crew;

    void add_target(const Simulation &original, const BatchField &action);
    void find_order();
    std::size_t place_of(const std::string &path) const;
    void count_from(const Instance &instance);
    bool is_direct(const Wire &wire) const;
    void see_period(const Instance &instance, const std::string &path);
    void find_late();
    void lay_out(Clone &clone) const;
    void go_to_place(Clone &clone) const;
    void write(Clone &clone, Ns made, std::span<const double> actions) const;
    void begin(Clone &clone, BatchRun run, std::span<const std::byte> snapshot) const;
    bool advance(Clone &clone, std::span<const double> actions, const RunControl &control) const;
    void read_row(const Clone &clone, std::span<double> row) const;
    void check_actions(std::span<const double> actions) const;

    /// Numbers that go from a row of the actions into an input or a parameter.
    struct Target {
        BatchField field;
        std::size_t column = 0;
        const FledgeField *input = nullptr; ///< of which it is a part; null: it is a parameter
    };
    BatchPlan plan_;
    std::unique_ptr<Simulation> nominal_;
    std::vector<Target> targets_;
    struct Run {
        const Process *process;
        const Task *task;
        const Instance *instance;
    };
    std::vector<Run> order_;          ///< what tasks run, in the order of an instant
    std::vector<std::string> before_; ///< a step ends before the first of these modules
    Ns period_ = 0;                   ///< [ns] of what the actions replace; 0: there are none
    Ns delay_ = 0;                    ///< [ns]
    std::vector<bool> late_;          ///< of each observation
    std::size_t actions_ = 0, observations_ = 0;
    std::vector<Clone> clones_;
    std::unique_ptr<Crew> crew_;
};

} // namespace fledge::sim
