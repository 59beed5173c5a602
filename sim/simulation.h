// SPDX-License-Identifier: Apache-2.0
// A simulation owns a structure (structure.h), its run (runtime.h) and its records (recorder.h).
//
// At an instant t every process whose tasks are due runs, in the order in which the processes were
// added (the world first, then flight); then events are looked at; then records are taken. A
// command given at t acts over [t, t + h). Time is integer nanoseconds; equal times are ordered by
// process, then priority (higher first), then declaration.
#pragma once

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

/// How the caller controls a long run.
struct RunControl {
    /// Simulated seconds per second of the wall clock; 0: as fast as possible.
    double pace = 0.0;
    /// Called about every 50 ms of wall time; false stops the run after the current instant.
    std::function<bool(Ns now)> poll;
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
    void connect(const Port &from, const Port &to, WireOptions options = {});
    const std::vector<Wire> &wires() const { return structure_.wires; }

    std::uint64_t seed() const { return structure_.seed; }
    void set_seed(std::uint64_t seed); ///< takes effect at the next reset

    /// One line per parameter marked `assumed` that was left at zero, "world.wheels.friction: ...",
    /// and the assumptions that the models state.
    std::vector<std::string> assumptions() const { return sim::assumptions(structure_); }

    // ---- run

    /// Check everything, lay out the schedule, and reset. Called by the first run or step.
    /// Throws SetupError that lists all faults.
    void prepare();
    bool prepared() const { return runtime_ != nullptr; }

    /// Prepare, and check that a run until t could begin, as run_until() does itself. Throws
    /// SetupError also if a model's data do not reach to t, RunError if the run has failed.
    void ready_for(Ns t);

    /// Back to time 0: everything is checked and prepared anew, and the logs are emptied. Throws
    /// SetupError as prepare() does.
    void reset();

    /// As reset(), but the simulation begins late: all is reset for the time t, and the first instant is the
    /// first after it on the grids of the tasks.
    void begin_after(Ns t);

    Ns now() const;  ///< the last instant that has run; -1 before the first
    Ns next() const; ///< the next instant

    /// Run all instants up to and including t. Returns false if the control stopped it.
    /// The first call runs the instant 0. Throws as ready_for() does, before the first instant.
    bool run_until(Ns t, const RunControl &control = {});
    /// Run one instant.
    void step();

    PaceReport pace_report() const;

    /// Record an output or input. See Recorder.
    Recorder &recorder() { return recorder_; }

    // ---- copy and divide

    /// The whole dynamic state, to be restored into this simulation or a clone.
    std::vector<std::byte> snapshot() const;
    /// Throws SetupError if the bytes belong to a simulation of another structure. Logs are kept.
    void restore(std::span<const std::byte> bytes);

    /// A simulation that shares nothing with this one and stands at the same time. Its recorder is
    /// empty. Events with C++ or Python callables are shared by copy of the callable.
    std::unique_ptr<Simulation> clone() const;

    std::vector<std::pair<std::string, std::string>> cross_process_dependencies(std::string_view process = {}) const
    {
        return sim::cross_process_dependencies(structure_, process);
    }

    /// Become the simulation of one process: the other processes, their wires and their records are removed.
    /// Throws SetupError, and changes nothing, if the simulation has run or if there are cross-process
    /// dependencies.
    void isolate(const std::string &process);

private:
    friend class Process;

    /// The structure is about to change. Throws SetupError once the simulation has run; before
    /// that, the next run prepares anew.
    void set_up_again();

    Structure structure_;
    std::vector<std::unique_ptr<Process>> removed_; ///< by isolate(): callers may hold references to them
    Recorder recorder_;
    std::unique_ptr<Runtime> runtime_;
};

} // namespace fledge::sim
