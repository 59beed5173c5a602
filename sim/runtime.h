// SPDX-License-Identifier: Apache-2.0
// The run of a structure: its schedule as the loop walks it (flat arrays, without names), and the state of
// the run besides the memory of the instances. The rules of time are those of flight/exec.
// Private to the kernel.
#pragma once

#include "flight/exec/event.h"
#include "flight/exec/task.h"
#include "sim/commands.h"
#include "sim/crash.h"
#include "sim/health.h"
#include "sim/parameters.h"
#include "sim/simulation.h"
#include "sim/wiring.h"

#include <algorithm>
#include <limits>

namespace fledge::sim {

struct Step {
    void (*update)(void *, Tick);
    void *self;
    const Instance *instance;
    std::uint32_t first_copy, last_copy; ///< the wires into it
};

struct RunEvent {
    ExecEvent state;
    Tally fired;
    Ns from; ///< the process does not check the event before this time
};

struct RunProcess {
    Process *process;
    std::int32_t mode, requested; ///< the mode in force, and the one that was requested; -1: it has no modes
    Ns ran = -1;                  ///< the last instant at which one of its tasks ran
    std::vector<RunEvent> events;
    bool own_events = true;             ///< its events of data reach nothing of other processes
    std::int32_t publishes = 0;         ///< 1: some of its configuration is changed
    std::int32_t counted = -1;          ///< the mode that was counted last
    std::vector<Tally> entered;         ///< by mode
    std::vector<std::uint8_t> followed; ///< by mode and the next mode: how often, up to 255; of no snapshot
    std::unique_ptr<Commands> commands; ///< null: it has no dictionary

    void enter(std::size_t to, Ns t);

    // Of a process whose computer can be reset.
    const std::byte *reset = nullptr;  ///< the ComputerReset; null: it cannot be reset
    std::uint32_t resets = 0;          ///< the last count seen
    std::uint32_t restarts = 0;        ///< how often it began anew
    Ns changed_at = -1;                ///< when its mode changed last, or it began anew
    Ns down_until = -1;                ///< -1: it runs
    std::vector<std::byte> parameters; ///< of all its instances, as the run began
    std::vector<std::pair<Ns, Ns>> outages;
};

struct RunTask {
    ExecTask state;
    ExecRate rate;
    RunProcess *process;
    std::uint32_t first_step, last_step;
    const Task *task;
    std::vector<bool> runs_in; ///< by mode
    std::uint32_t watched = 0; ///< its number in Health
};

/// An instant that is held before an update, with the rest of it to run.
struct Held {
    Ns before = -1;         ///< the instant before it
    Ns dt = 0;              ///< [ns] of the tick of the task
    std::int32_t task = -1; ///< its number; -1: no instant is held
    std::uint32_t step = 0; ///< the update; the first one of its task: the task has not begun
};

/// A module in no task: its parameters are published at the start, and after a change at its process' next instant.
struct Configuration {
    Instance *instance;
    RunProcess *process;
    std::vector<Copy> copies; ///< the wires from it
    std::int32_t changed = 0; ///< 1: it is published at the next instant of its process
};

void reset_instance(Instance &instance, Ns t);

/// As in a computer that begins: what modules keep over a reset of flight is gone, too.
void clear_modules(const Process &process);

class Runtime {
public:
    static constexpr Ns never = std::numeric_limits<Ns>::max();

    Runtime(const Structure &structure, Roles roles, Recorder &recorder, Recorder &outputs);

    void reset(Ns after = -1);                                       ///< the first instant comes after this time
    bool run_until(Ns t, const RunControl &control, Modules before); ///< see Simulation::run_until()
    Ns time() const { return std::max(now, reached); }               ///< see Simulation::time()
    Ns shortest_period() const;
    Ns next_of(Modules modules) const; ///< see Simulation::next_of()

    /// The check before a run until t: takes over the changed parameters, and checks that the models can
    /// go so far. Throws SetupError with all that cannot, RunError if the run has failed.
    void ready_for(Ns t, bool same_parameters = false);
    bool parameters_changed() const;

    /// What feeds deliver has changed: look at it anew.
    void feed_again() { wiring_.feed_again(); }

    void set_begun(bool begun); ///< Instance::begun, of all
    RunProcess &of(const Process &process);
    RunEvent &of(const Process &process, const Event &event);
    void enter(const Process &process, int mode); ///< as requested from outside
    void request(RunProcess &process, int mode);
    void event_added(const Process &process);
    std::span<const std::byte> incoming(const Port &input) const;
    bool override_input(const Port &input, std::uint32_t place, double value); ///< see Simulation::override_input()
    /// Call with what each wire with latency holds.
    void visit_held(const std::function<void(const Wire &, void *, std::size_t)> &block);
    void set_commands(Process &process, std::shared_ptr<const Dictionary> dictionary);
    CommandReason command(const Process &process, const std::vector<std::uint8_t> &packet);
    void expect_changes(); ///< a command waits, or is on its way

    // What commands do.
    void publish(const Instance &module, Ns t);
    void restart(RunProcess &process, Ns t);

    /// Call with every block of memory that changes during a run, for saving and for restoring alike.
    void visit_state(const std::function<void(void *, std::size_t)> &block);
    /// The state was restored: derive anew what follows from it.
    void restored();
    /// Scripts go on from here.
    void find_places();
    /// The same for the state of the commands of all processes, which a snapshot has only if they were used.
    void visit_commands(const std::function<void(void *, std::size_t)> &block);
    bool commands_used() const;
    void forget_commands();

    const Structure &structure;
    Ns now = -1;
    Ns reached = -1; ///< the end of the last run that was not stopped
    Ns next = 0;
    PaceReport pace;
    Health health{structure};

private:
    void add_step(RunProcess &run, const Task &task, Instance &instance);
    void add_instances(RunProcess &run);
    void take_parameters();
    void instant(); ///< run one
    void instant_before(Modules modules);
    void finish_instant();
    bool hold(RunTask &task, Modules before, Ns t);
    std::uint32_t first_of(const RunTask &task, Modules modules) const;
    bool waits(const Instance &instance, Ns t) const;
    Ns seen(const RunProcess &process) const;
    bool run_tasks(Ns t, const RunTask *after = nullptr, Modules before = {});
    bool run_plainly(Ns t);
    void deliver(Ns t);
    void end_instant(Ns t);
    void take_records(Ns t);
    void end_turn(RunProcess *process, bool down, Ns t);
    Ns last_tick(const Process &process, Ns t) const;
    Ns next_of(const RunTask &task) const;
    Ns next_instant() const;
    void make_changes(RunProcess &process, Ns t);
    void publish_mode(RunProcess &process, Ns t);
    void play(RunProcess &process, Ns t);
    void publish_modes(Ns t);
    void see_parameters(const RunProcess &process);
    void begin(RunProcess &process, Ns t);
    bool is_down(RunProcess &process, Ns t);
    void begin_anew(RunProcess &process, std::uint32_t count, Ns t);
    void keep_parameters(RunProcess &process) const;
    Tick begin_task(RunTask &task, Ns t);
    void run_steps(const RunTask &task, std::uint32_t first, std::uint32_t last, Tick tick);
    void end_task(const RunTask &task, Ns t);
    void run_task(RunTask &task, Ns t);
    void find_own_events(RunProcess &process);
    void run_own_events(RunProcess &process, Ns t);
    void run_events(Ns t);
    bool run_event(RunProcess &process, std::size_t i, Ns t); ///< returns whether it fired
    void act(RunProcess &process, const Event &event, Ns t);
    void publish(Configuration &module, Ns t);
    void visit_process(RunProcess &process, const std::function<void(void *, std::size_t)> &block);

    Roles roles_;
    Wiring wiring_;
    Recorder &recorder_, &outputs_;
    std::vector<Step> steps_;
    std::vector<RunProcess> processes_;
    std::vector<RunTask> tasks_; ///< in the order of equal times
    std::vector<Configuration> configuration_;
    std::vector<Model *> models_;
    std::vector<Parameters> parameters_;
    bool changes_ = false; ///< some process has a change before it, which counts at its next instant
    bool plain_ = false;   ///< while changes_ is false: nothing but tasks can be due
    bool has_events_ = false;
    bool plays_ = false; ///< some process flew elsewhere
    Held held_;
    bool modes_begin_ = false;   ///< some process with modes has not run since it began
    Running *running_ = nullptr; ///< of the thread that runs
    std::string failure_;        ///< why the run cannot go on; "" if it can
};

} // namespace fledge::sim
