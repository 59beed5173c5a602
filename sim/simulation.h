// SPDX-License-Identifier: Apache-2.0
// The kernel: processes of tasks of modules and models, wires between them, and their common time.
//
// At an instant t every process whose tasks are due runs, in the order in which the processes were
// added (the world first, then flight); then events are looked at; then records are taken. A
// command given at t acts over [t, t + h). Time is integer nanoseconds; equal times are ordered by
// process, then priority (higher first), then declaration.
#pragma once

#include "sim/error.h"
#include "sim/instance.h"
#include "sim/recorder.h"

#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace fledge::sim {

class Process;
class Simulation;

/// An input or output of an instance.
struct Port {
    std::shared_ptr<Instance> instance;
    const FledgeField *field = nullptr;

    std::string path() const; ///< "flight.control.error"
    std::byte *bytes() const { return instance->memory() + field->offset; }
};

struct WireOptions {
    /// 0: the consumer reads what the producer last wrote. 1: it reads what the producer had at the
    /// end of the last exchange before, so that the two processes may run side by side; see
    /// Simulation::connect.
    int latency = 0;
    /// [ns] A message older than this reaches the consumer with its quality lowered; 0: never.
    Ns stale_after = 0;
};

struct Wire {
    Port from, to;
    WireOptions options;
};

/// Modules or models that run in order, at one rate.
struct Task {
    std::string name;
    Ns period = 0;
    Ns offset = 0;
    int priority = 0;
    std::vector<std::shared_ptr<Instance>> run;
};

/// A named set of active tasks. Tasks that no mode names are always active.
struct Mode {
    std::string name;
    std::vector<std::string> tasks;
};

/// A comparison of a field with a constant: flight's events are made of these, because they export.
struct Condition {
    enum class Measure { element, norm, max_abs };
    enum class Comparison { less, less_equal, greater, greater_equal, equal, not_equal };

    std::shared_ptr<Instance> instance;
    std::uint32_t offset = 0;     ///< bytes from the start of the instance's memory
    FledgeType type = FLEDGE_F64; ///< of the elements
    std::uint32_t elements = 1;
    Measure measure = Measure::element;
    Comparison comparison = Comparison::less;
    double constant = 0.0;
    std::string text; ///< as the user would write it

    bool holds() const;
};

/// Something that happens once its condition holds. A process looks at its events at the instants at
/// which one of its tasks ran. An event fires when the condition has held for `hold`,
/// is then disarmed, and arms itself again when the condition no longer holds (unless `once`).
/// An event that is armed by its own action while its condition still holds would fire again at the
/// same instant: that is a RunError.
struct Event {
    std::string name;
    std::optional<Condition> condition; ///< one of these two
    std::function<bool()> predicate;
    Ns hold = 0;
    bool once = false;
    std::string mode;             ///< enter this mode of the event's process; "": none
    std::function<void()> action; ///< and call this; may be empty

    Ns from = 0; ///< not looked at before
    bool armed = true;
    Ns since = -1;    ///< when the condition began to hold; -1: it does not
    Ns fired_at = -1; ///< when it last fired; -1: never
};

/// The tasks that live together: "flight" or "world".
class Process {
public:
    std::string name;

    /// Give an instance its name. Throws SetupError if the name is taken or no identifier, or if
    /// the instance already has a process.
    void add(const std::string &name, std::shared_ptr<Instance> instance);

    /// Throws SetupError on a period <= 0, a negative offset, an unknown or twice used instance.
    void add_task(Task task);
    void add_mode(Mode mode);
    /// Returned event stays at its address; arm() by setting `armed`.
    std::shared_ptr<Event> add_event(Event event);
    /// Begin in this mode. The first one added is the default.
    void start_in(const std::string &mode);

    /// Ask for a mode; it takes effect at the next instant of this process.
    void enter(const std::string &mode);
    /// The mode in force; "" if the process has none.
    const std::string &mode() const;

    void set_integrator(std::shared_ptr<const Integrator> integrator);
    const Integrator &integrator() const { return *integrator_; }

    const std::vector<std::shared_ptr<Instance>> &instances() const { return instances_; }
    const std::vector<Task> &tasks() const { return tasks_; }
    const std::vector<Mode> &modes() const { return modes_; }
    const std::vector<std::shared_ptr<Event>> &events() const { return events_; }
    std::shared_ptr<Instance> find(std::string_view instance) const; ///< or null

private:
    friend class Simulation;
    Process(Simulation &owner, std::string process_name);

    int mode_index(const std::string &mode) const; ///< throws SetupError with the valid names
    bool active(const Task &task, int mode) const;

    Simulation *owner_;
    std::vector<std::shared_ptr<Instance>> instances_;
    std::vector<Task> tasks_;
    std::vector<Mode> modes_;
    std::vector<std::shared_ptr<Event>> events_;
    std::shared_ptr<const Integrator> integrator_;
    int mode_ = -1, pending_ = -1, initial_ = -1;
    Ns ran_ = -1; ///< the last instant at which one of its tasks ran
};

/// What a long run asks of the outside.
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

    /// Processes run in the order in which they are added.
    Process &add_process(const std::string &name);
    Process &process(std::string_view name); ///< throws SetupError with the valid names
    const std::vector<std::unique_ptr<Process>> &processes() const { return processes_; }

    /// Join an output to an input. Throws SetupError if the directions or types do not match, or if
    /// the input already has a writer. A wire with latency 1 is exchanged after the instants that are
    /// multiples of the longest task period of the two processes that it joins; until the first, it
    /// holds what the producer published at its reset.
    void connect(const Port &from, const Port &to, WireOptions options = {});
    const std::vector<Wire> &wires() const { return wires_; }

    std::uint64_t seed() const { return seed_; }
    void set_seed(std::uint64_t seed); ///< takes effect at the next reset

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

    /// The whole dynamic state, to be restored into this simulation or a clone.
    std::vector<std::byte> snapshot() const;
    /// Throws SetupError if the bytes belong to a simulation of another shape. Logs are kept.
    void restore(std::span<const std::byte> bytes);

    /// A simulation that shares nothing with this one and stands at the same time. Its recorder is
    /// empty. Events with C++ or Python callables are shared by copy of the callable.
    std::unique_ptr<Simulation> clone() const;

    /// What ties a process to others, or any to any, wires apart: (what it is, whose it is) of each event
    /// that looks at the instance of another, and of each model that has a part there. Python callables
    /// are not seen.
    std::vector<std::pair<std::string, std::string>> ties(std::string_view process = {}) const;

    /// Become the simulation of one of its processes: the others with their wires and records are no part
    /// of it any more. Throws SetupError, and changes nothing, if it has run or if there are ties.
    void keep(const std::string &process);

    /// One line per parameter marked `assumed` that was left at zero, "world.wheels.friction: ...",
    /// and what the models say themselves.
    std::vector<std::string> assumptions() const;

private:
    friend class Process;
    struct Runtime;

    /// The structure is about to change. Throws SetupError once the simulation has run; before
    /// that, the next run prepares anew.
    void set_up_again();

    std::uint64_t seed_;
    std::vector<std::unique_ptr<Process>> processes_;
    std::vector<std::unique_ptr<Process>> left_; ///< out by keep(): others may hold references to them
    std::vector<Wire> wires_;
    Recorder recorder_;
    bool mode_asked_ = false; ///< by some process, and not yet entered
    bool has_events_ = false;
    std::unique_ptr<Runtime> runtime_;
};

} // namespace fledge::sim
