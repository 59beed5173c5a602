// SPDX-License-Identifier: Apache-2.0
// A simulation owns a structure (structure.h), its run (runtime.h) and its records (recorder.h).
//
// At an instant t every process whose tasks are due runs, in the order in which the processes were
// added (the world first, then flight); then the processes check their events; then the recorder takes its records. A
// command given at t acts over [t, t + h). Time is integer nanoseconds; equal times are ordered by
// process, then priority (higher first), then declaration.
//
// Example:
//
//     #include "flight/guidance/tracking_error.h"
//     using namespace sim;
//     void fly(const FledgeStruct &module)
//     {
//         Simulation sim(1);
//         Process &flight = sim.add_process("flight");
//         const auto tracking = std::make_shared<Instance>(module);
//         flight.add("tracking", tracking);
//         flight.add_task({.name = "gnc", .period = 500'000'000, .run = {tracking}});
//         sim.run_until(60'000'000'000);
//     }
#pragma once

#include "sim/health.h"
#include "sim/recorder.h"
#include "sim/structure.h"

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace fledge::sim {

class Runtime;

/// Modules of a simulation that tasks run.
using Modules = std::span<const Instance *const>;

/// How the caller controls a long run.
struct RunControl {
    /// Simulated seconds per second of the wall clock; 0: as fast as possible.
    double pace = 0.0;
    /// Called about every 50 ms of wall time; false stops the run after the current instant.
    std::function<bool(Ns now)> poll;
    /// The caller has changed no parameter since the last run, so that there is nothing to look for.
    bool same_parameters = false;
};

/// How a paced run kept up.
struct PaceReport {
    std::uint64_t instants = 0;
    std::uint64_t overruns = 0; ///< instants that began later than 1 ms after their time
    Ns worst = 0;               ///< [ns] of wall time, the largest delay
};

class Simulation {
public:
    explicit Simulation(std::uint64_t seed = 0);
    ~Simulation();
    Simulation(const Simulation &) = delete;
    Simulation &operator=(const Simulation &) = delete;

    // ---- build

    /// Processes run in the order in which they are added.
    Process &add_process(const std::string &name);
    Process &process(std::string_view name) { return structure_.process(name); }
    const std::vector<std::unique_ptr<Process>> &processes() const { return structure_.processes; }

    /// Join an output to an input. Throws SetupError if the directions or types do not match, or if
    /// the input already has a writer. A wire with latency 1 is exchanged after the instants that are
    /// multiples of the longest task period of the two processes that it joins; until the first, it
    /// holds what the producer published at its reset.
    void connect(const Port &from, const Port &to, const WireOptions &options = {});
    const std::vector<Wire> &wires() const { return structure_.wires; }

    /// Give an input its messages by hand, in place of a wire. One that has a feed with messages gets others at any
    /// time. Throws SetupError if the port is no input of this simulation, has a wire, if the messages do not suit it,
    /// or if the simulation has run.
    void feed(Feed feed);
    /// From now on the caller writes an input: its wire is removed, and it needs none. A reset makes it a message that
    /// was never written. Throws SetupError if the port is no input of this simulation, or the simulation has run.
    void feed(const Port &input);
    const std::vector<Feed> &feeds() const { return structure_.feeds; }

    /// Call it before a change of the structure. Throws SetupError if the simulation has run; else the next run
    /// prepares again.
    void set_up_again();

    std::uint64_t seed() const { return structure_.seed; }
    void set_seed(std::uint64_t seed); ///< takes effect at the next reset

    /// One line for each parameter that is marked `assumed` and that the user left at zero, and for each assumption
    /// of a model: "world.wheels.friction was left at 0 ...".
    std::vector<std::string> assumptions() const { return sim::assumptions(structure_); }

    // ---- run

    /// Why it cannot run as it is composed, by the lines of the user's files; empty if it can, or has been prepared.
    std::vector<Problem> problems();

    /// Check everything, lay out the schedule, and reset. Called by the first run or step.
    /// Throws CompositionError with all problems.
    void prepare();
    bool prepared() const { return runtime_ != nullptr; }

    /// Prepare, and check that a run until t could begin, as run_until() does itself. Throws
    /// SetupError also if a model's data do not reach to t, RunError if the run has failed.
    void ready_for(Ns t);

    /// Go back to time 0: check and prepare everything again, and empty the logs. Throws SetupError as prepare() does.
    void reset();

    /// As reset(), but the simulation begins after the time t: it resets everything for t, and its first instant is the
    /// first one after t on the grids of the tasks.
    void begin_after(Ns t);

    Ns now() const;  ///< the last instant that has run, or is held; -1 before the first
    Ns next() const; ///< the next instant
    /// The time up to which all instants have run: the end of the last run, or the instant at which it was stopped. The
    /// state is that of now(), which comes before if no task runs at the end. -1 before the first run.
    Ns time() const;
    /// A run to t has no further instant; t is the time from now on. Throws RunError if an instant is due until t.
    void reach(Ns t);

    /// Run all instants up to and including t. Returns false if the control stopped it.
    /// The first call runs the instant 0. Throws as ready_for() does, before the first instant.
    /// before: hold the instant t before the first of these modules that is due there; the next run begins with the
    /// rest of it. Until then now() is t, and what the caller writes into their inputs and parameters counts at t.
    bool run_until(Ns t, const RunControl &control = {}, Modules before = {});
    /// When the first of these modules runs next: now(), if an instant is held there. -1: never.
    Ns next_of(Modules modules) const;
    /// Run one instant.
    void step();

    PaceReport pace_report() const;

    /// What a user should know of the run so far, what follows from the structure first, then by time.
    std::vector<Finding> health() const;

    /// Record an output or input. See Recorder.
    Recorder &recorder() { return recorder_; }

    /// Write all outputs to an MCAP file of their own from now on, each at the instants at which it has changed. The
    /// topics have the order in which the outputs are written at an instant. Throws as Recorder::open_archive() and,
    /// at the end, close_archive().
    void open_outputs(const std::string &path);
    void close_outputs() { outputs_.close_archive(); }

    // ---- copy and divide

    /// The whole dynamic state, which this simulation or a clone can restore.
    std::vector<std::byte> snapshot() const;
    /// [bytes] of the largest snapshot, of a simulation that is prepared: one after commands is larger.
    std::size_t snapshot_room() const;
    /// Throws SetupError, and changes nothing, if the bytes are damaged or belong to a simulation of another structure.
    /// Logs are kept. edited: the caller has changed numbers on purpose.
    void restore(std::span<const std::byte> bytes, bool edited = false);
    /// The check of restore() alone, of a simulation that is prepared.
    void check_snapshot(std::span<const std::byte> bytes) const;
    /// The random streams of the models begin anew, by the seed with which the simulation was prepared; all else stays.
    void reseed();

    /// Where a snapshot has the memory of an instance, of its model, or what a wire with latency holds.
    struct StateBlock {
        enum Kind { INSTANCE, MODEL, HELD } kind;
        std::string path; ///< of the instance, or of the wire's reader
        std::size_t offset, size;
    };
    std::vector<StateBlock> state_blocks() const;

    /// States or inputs were changed by a restored snapshot: models compute what follows, and publish. See
    /// Model::follow; next: with the inputs for the next update.
    void follow(bool next);

    /// In place of what comes to an input, a number at this place of its message [bytes] is this one from now on. A
    /// clone and a reset forget it. Returns false if nothing comes to the input: its memory is all there is.
    bool override_input(const Port &input, std::uint32_t place, double value);

    /// A simulation at the same time, which shares no data with this one. Its recorder is empty. Its events have copies
    /// of the C++ or Python callables.
    std::unique_ptr<Simulation> clone() const;

    std::vector<std::pair<std::string, std::string>> cross_process_dependencies(std::string_view process = {}) const
    {
        return sim::cross_process_dependencies(structure_, process);
    }

    /// Keep only one process: remove the other ones, their wires and their records.
    /// Throws SetupError, and changes nothing, if the simulation has run or if there are cross-process
    /// dependencies.
    void isolate(const std::string &process);

private:
    friend class Process;

    Structure structure_;
    std::vector<std::unique_ptr<Process>> removed_; ///< by isolate(): callers may hold references to them
    Recorder recorder_;
    Recorder outputs_;
    std::unique_ptr<Runtime> runtime_;
};

} // namespace fledge::sim
