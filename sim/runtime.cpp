// SPDX-License-Identifier: Apache-2.0
// The loop. Between prepare() and the end of a run nothing here allocates.
#include "sim/runtime.h"

#include "flight/msg/computer.h"
#include "sim/pacing.h"

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <span>

namespace fledge::sim {

Ns Runtime::shortest_period() const
{
    Ns shortest = never;
    for (const RunTask &task : tasks_) {
        shortest = std::min(shortest, task.rate.period);
    }
    return shortest;
}

RunProcess &Runtime::of(const Process &process)
{
    return *std::find_if(processes_.begin(), processes_.end(),
                         [&](const RunProcess &run) { return run.process == &process; });
}

// --- what comes next

/// The next instant of a task, in the mode that its process is in or is requested to enter.
inline Ns Runtime::next_of(const RunTask &task) const
{
    const RunProcess &process = *task.process;
    if (!process.reset && !process.commands && process.requested == process.mode) {
        return task.state.active ? task.state.next : never;
    }
    Ns commanded = process.reset ? time() : never; // at which a target ticks, whatever its mode
    if (process.commands && !process.reset) {
        commanded = process.commands->counts_instants() ? time() : process.commands->next(time());
    }
    const bool requested =
        process.requested != process.mode && task.runs_in[static_cast<std::size_t>(process.requested)];
    return std::min(exec_next(&task.state, task.rate, requested, time()),
                    commanded == never ? never : exec_on_grid(task.rate, exec_later(commanded, 1)));
}

Ns Runtime::next_instant() const
{
    Ns t = never;
    for (const RunTask &task : tasks_) {
        t = exec_sooner(t, next_of(task));
    }
    return t;
}

Ns Runtime::next_of(Modules modules) const
{
    if (held_.task >= 0 && std::ranges::find(modules, steps_[held_.step].instance) != modules.end()) {
        return now;
    }
    Ns t = never;
    for (const RunTask &task : tasks_) {
        if (first_of(task, modules) != task.last_step) {
            const Ns due = next_of(task);
            // A task that is due in the instant that is held at another module runs with the rest of it.
            t = exec_sooner(t, due > now ? due : exec_later(due, task.rate.period));
        }
    }
    return t < never ? t : -1;
}

/// The last instant at which a process has had its turn.
Ns Runtime::seen(const RunProcess &process) const
{
    return held_.task >= 0 && &process > tasks_[static_cast<std::size_t>(held_.task)].process ? held_.before : now;
}

void Runtime::expect_changes()
{
    changes_ = true;
    next = next_instant();
}

void Runtime::enter(const Process &process, int mode)
{
    process.request_of_computer(mode);
    request(of(process), mode);
}

void Runtime::request(RunProcess &process, int mode)
{
    process.requested = mode;
    expect_changes(); // a task of that mode may come sooner than what was next
}

/// The last instant until t at which a target's clock ticks: on the grids of all tasks; -1: none.
Ns Runtime::last_tick(const Process &process, Ns t) const
{
    Ns last = -1;
    for (const RunTask &task : tasks_) {
        if (task.process->process == &process && t >= task.rate.offset) {
            last = std::max(last, t - (t - task.rate.offset) % task.rate.period);
        }
    }
    return last;
}

void Runtime::set_commands(Process &process, std::shared_ptr<const Dictionary> dictionary)
{
    of(process).commands = std::make_unique<Commands>(*this, process, std::move(dictionary));
    expect_changes();
}

CommandReason Runtime::command(const Process &process, const std::vector<std::uint8_t> &packet)
{
    const CommandReason reason = of(process).commands->accept(packet, last_tick(process, time()));
    if (reason == COMMAND_OK) {
        expect_changes();
    }
    return reason;
}

std::span<const std::byte> Runtime::incoming(const Port &input) const
{
    const auto reads = [&](const RunProcess &run) { return run.process == roles_.at(input.instance.get()).process; };
    const std::int32_t mode = std::find_if(processes_.begin(), processes_.end(), reads)->mode;
    return {reinterpret_cast<const std::byte *>(wiring_.incoming(input, mode, time())), input.field->size};
}

bool Runtime::override_input(const Port &input, std::uint32_t place, double value)
{
    return wiring_.override_input(input, place, value, [&](std::uint32_t at) {
        for (Step &step : steps_) {
            step.first_copy += step.first_copy >= at;
            step.last_copy += step.last_copy >= at;
        }
    });
}

// --- the beginning of a process' turn

/// After a reset: with the parameters of the run's start.
void Runtime::begin_anew(RunProcess &process, std::uint32_t count, Ns t)
{
    process.resets = count;
    auto from = process.parameters.begin();
    for (Parameters &parameters : parameters_) {
        if (parameters.process == &process) {
            std::copy_n(from, parameters.now.size(), parameters.now.begin());
            from += static_cast<std::ptrdiff_t>(parameters.now.size());
        }
    }
    see_parameters(process);
    clear_modules(*process.process);
    restart(process, t);
    if (process.commands) {
        process.commands->forget(t);
    }
    process.process->executive().reset(t, ++process.restarts);
}

/// Whether the computer of a process is down at t. If it was reset, it goes down; after that it begins anew at the
/// first instant on the grids of its tasks, as a board's node does (cosim/node/board_node.cpp).
bool Runtime::is_down(RunProcess &process, Ns t)
{
    const auto due = [&](const RunTask &task) { return task.process == &process && next_of(task) == t; };
    if (std::none_of(tasks_.begin(), tasks_.end(), due)) {
        return process.down_until > t;
    }
    std::uint32_t count = 0;
    std::memcpy(&count, process.reset + offsetof(ComputerReset, count), sizeof count);
    if (process.down_until < 0 && count != process.resets) {
        process.down_until = exec_later(t, process.process->reset_line()->down);
        process.outages.emplace_back(t, process.down_until);
        process.requested = process.mode;
        for (RunTask &task : tasks_) {
            if (task.process == &process) {
                task.state = exec_start(task.rate, 1, process.down_until);
            }
        }
    }
    if (process.down_until < 0 || t < process.down_until) {
        return process.down_until >= 0;
    }
    begin_anew(process, count, t);
    return false;
}

void Runtime::publish(const Instance &instance, Ns t)
{
    for (Configuration &module : configuration_) {
        if (module.instance == &instance) {
            publish(module, t);
        }
    }
}

void Runtime::publish(Configuration &module, Ns t)
{
    module.changed = 0;
    {
        const Runs runs(module.instance);
        module.instance->update({t, 0});
    }
    for (const Copy &copy : module.copies) {
        carry(copy, -1, t);
    }
}

/// The parameters of a process are as they should be: its commands have changed them.
void Runtime::see_parameters(const RunProcess &process)
{
    for (Parameters &parameters : parameters_) {
        if (parameters.process == &process) {
            parameters.see();
        }
    }
}

/// What was changed since the process' last instant: it publishes its configuration, executes its commands
/// and enters the mode that was requested, if this is an instant of it: its computer does not see the instants of other
/// processes. Called when the process' turn comes, so that the processes before it still see it as it was.
void Runtime::make_changes(RunProcess &process, Ns t)
{
    const bool commanded = process.commands && process.commands->next(t - 1) < t;
    if (process.requested == process.mode && !process.publishes && !commanded) {
        return;
    }
    const auto runs_now = [&](const RunTask &task) { return task.process == &process && next_of(task) == t; };
    if (std::none_of(tasks_.begin(), tasks_.end(), runs_now)) {
        return;
    }
    for (Configuration &module : configuration_) {
        if (module.process == &process && module.changed) {
            publish(module, t);
        }
    }
    process.publishes = 0;
    if (commanded) {
        process.commands->accept_due(t, last_tick(*process.process, t - 1));
        process.commands->execute(t);
        see_parameters(process);
    }
    if (process.requested == process.mode) {
        return;
    }
    process.mode = process.requested;
    process.changed_at = t;
    modes_begin_ = true;
    for (RunTask &task : tasks_) {
        if (task.process == &process &&
            exec_switch(&task.state, task.runs_in[static_cast<std::size_t>(process.mode)], task.rate, t)) {
            for (const auto &instance : task.task->run) {
                reset_instance(*instance, t);
            }
        }
    }
}

// --- an instant

void RunProcess::enter(std::size_t to, Ns t)
{
    entered[to].add(t);
    if (counted >= 0) {
        std::uint8_t &times = followed[static_cast<std::size_t>(counted) * entered.size() + to];
        times = static_cast<std::uint8_t>(times + (times < UINT8_MAX));
    }
    counted = static_cast<std::int32_t>(to);
}

/// What a process does that flew elsewhere: what is requested here does not count.
void Runtime::play(RunProcess &process, Ns t)
{
    process.requested = process.mode;
    process.process->executive().publish_played(
        now, t,
        [&](Ns at, std::uint32_t mode) {
            process.mode = process.requested = static_cast<std::int32_t>(mode);
            process.enter(mode, at);
        },
        [&](Ns at, std::uint32_t event) {
            if (event < process.events.size()) {
                process.events[event].fired.add(at);
            }
        });
}

inline Tick Runtime::begin_task(RunTask &task, Ns t)
{
    if (const auto &flight = task.process->process->flight(); flight && task.process->ran != t) {
        flight(t);
    }
    return exec_begin(&task.state, task.rate, t);
}

inline void Runtime::run_steps(const RunTask &task, std::uint32_t first, std::uint32_t last, Tick tick)
{
    const std::int32_t mode = task.process->mode;
    running_->task.store(task.task, std::memory_order_relaxed);
    const Copy *const copies = wiring_.copies();
    for (const Step *step = steps_.data() + first, *const end = steps_.data() + last; step != end; step++) {
        for (const Copy *copy = copies + step->first_copy, *const behind = copies + step->last_copy; copy != behind;
             copy++) {
            if (carry(*copy, mode, tick.t)) {
                health.was_stale(copy->age, tick.t);
            }
        }
        running_->instance.store(step->instance, std::memory_order_relaxed);
        step->update(step->self, tick);
    }
    running_->instance.store(nullptr, std::memory_order_relaxed);
}

inline void Runtime::end_task(const RunTask &task, Ns t)
{
    health.task_ran(task.watched, t);
    task.process->ran = t;
}

inline void Runtime::run_task(RunTask &task, Ns t)
{
    const Tick tick = begin_task(task, t);
    run_steps(task, task.first_step, task.last_step, tick);
    end_task(task, t);
}

inline void Runtime::end_turn(RunProcess *process, bool down, Ns t)
{
    if (process && has_events_) {
        run_own_events(*process, t);
    }
    if (process && process->commands && process->ran == t && process->commands->run_procedure(t)) {
        see_parameters(*process);
    }
    if (process && process->commands && !down && last_tick(*process->process, t) == t) {
        process->commands->send_telemetry(t);
    }
}

/// The tasks that are due, in the order of equal times: a process has its turn with all of its own. after: the last one
/// that has run; null: none. Returns false if the instant is held before one of these modules.
bool Runtime::run_tasks(Ns t, const RunTask *after, Modules before)
{
    RunProcess *turn = after ? after->process : nullptr;
    bool down = false;
    for (RunTask &task : std::span(tasks_).subspan(after ? static_cast<std::size_t>(after - tasks_.data()) + 1 : 0)) {
        if (task.process != turn) {
            end_turn(turn, down, t);
            turn = task.process;
            down = turn->reset && is_down(*turn, t);
            if (changes_ && !down) {
                make_changes(*turn, t);
            }
        }
        if (!down && exec_due(&task.state, t)) {
            if (!before.empty() && hold(task, before, t)) {
                return false;
            }
            run_task(task, t);
        }
    }
    end_turn(turn, down, t);
    return true;
}

inline void Runtime::take_records(Ns t)
{
    recorder_.take(t);
    outputs_.take(t);
}

/// The tasks that are due, where nothing else can be: without a look at what the general way asks each process. Returns
/// whether it stayed so.
inline bool Runtime::run_plainly(Ns t)
{
    Ns soonest = never;
    for (RunTask &task : tasks_) {
        if (exec_due(&task.state, t)) {
            run_task(task, t);
            if (changes_) { // by a function of Python
                run_tasks(t, &task);
                return false;
            }
        }
        soonest = exec_sooner(soonest, task.state.active ? task.state.next : never);
    }
    now = t;
    take_records(t);
    next = changes_ ? next_instant() : soonest;
    return true;
}

void Runtime::instant()
{
    const Ns t = next;
    running_->t.store(t, std::memory_order_relaxed);
    if (!plain_ || changes_ || modes_begin_) {
        deliver(t);
        run_tasks(t);
    } else if (run_plainly(t)) {
        return;
    }
    end_instant(t);
}

/// What comes to processes from outside, at the beginning of an instant.
void Runtime::deliver(Ns t)
{
    for (std::size_t i = 0; plays_ && i < processes_.size(); i++) {
        if (processes_[i].process->executive().plays()) {
            play(processes_[i], t);
        }
    }
    if (!wiring_.exchanges.empty()) {
        wiring_.exchange(t);
    }
    wiring_.feed(t);
}

/// Run the next instant up to the first of these modules; if none of them is due, the whole of it.
void Runtime::instant_before(Modules modules)
{
    const Ns t = next;
    running_->t.store(t, std::memory_order_relaxed);
    deliver(t);
    if (run_tasks(t, nullptr, modules)) {
        end_instant(t);
    }
}

/// The first step of a task that runs one of these modules; its end if none does.
std::uint32_t Runtime::first_of(const RunTask &task, Modules modules) const
{
    const auto is_one = [&](const Step &step) { return std::ranges::find(modules, step.instance) != modules.end(); };
    const auto steps = std::span(steps_).subspan(task.first_step, task.last_step - task.first_step);
    return task.first_step + static_cast<std::uint32_t>(std::ranges::find_if(steps, is_one) - steps.begin());
}

/// Run a task that is due up to the first of these modules. Returns false, and does nothing, if it runs none.
bool Runtime::hold(RunTask &task, Modules before, Ns t)
{
    const std::uint32_t step = first_of(task, before);
    if (step == task.last_step) {
        return false;
    }
    held_ = {now, 0, static_cast<std::int32_t>(&task - tasks_.data()), step};
    if (step != task.first_step) {
        const Tick tick = begin_task(task, t);
        held_.dt = tick.dt;
        run_steps(task, task.first_step, step, tick);
    }
    if (now < 0) {
        set_begun(true);
    }
    now = t;
    next = next_instant();
    recorder_.take_early(t, [&](const Instance &instance) { return waits(instance, t); });
    return true;
}

/// Whether an instance may change in the rest of the instant t, which is held.
bool Runtime::waits(const Instance &instance, Ns t) const
{
    const auto role = roles_.find(&instance);
    if (role == roles_.end()) {
        return true; // an executive
    }
    for (auto i = static_cast<std::size_t>(held_.task); i < tasks_.size(); i++) {
        const RunTask &task = tasks_[i];
        const bool first = i == static_cast<std::size_t>(held_.task);
        if (role->second.process != task.process->process || (!first && !exec_due(&task.state, t))) {
            continue;
        }
        for (std::uint32_t step = first ? held_.step : task.first_step; step != task.last_step; step++) {
            const auto parts = with_parts(*task.process->process, *steps_[step].instance);
            if (std::ranges::find(parts, &instance) != parts.end()) {
                return true;
            }
        }
    }
    return false;
}

/// The rest of an instant that is held.
void Runtime::finish_instant()
{
    const Ns t = now;
    const Held held = std::exchange(held_, {});
    now = held.before;
    running_->t.store(t, std::memory_order_relaxed);
    wiring_.feed(t); // after a restore
    RunTask &task = tasks_[static_cast<std::size_t>(held.task)];
    if (held.step == task.first_step) {
        run_task(task, t);
    } else {
        run_steps(task, held.step, task.last_step, {t, held.dt});
        end_task(task, t);
    }
    run_tasks(t, &task);
    end_instant(t);
}

void Runtime::end_instant(Ns t)
{
    if (changes_) {
        changes_ = std::any_of(processes_.begin(), processes_.end(), [t](const RunProcess &process) {
            return process.requested != process.mode || process.publishes ||
                   (process.commands && process.commands->next(t) < never);
        });
        plain_ = !plays_ && !has_events_ && wiring_.exchanges.empty() && !wiring_.feeds() &&
                 std::none_of(processes_.begin(), processes_.end(),
                              [](const RunProcess &process) { return process.reset || process.commands; });
    }
    if (now < 0) {
        set_begun(true);
    }
    now = t;
    if (modes_begin_) {
        publish_modes(t);
    }
    if (has_events_) {
        run_events(t);
    }
    take_records(t);
    next = next_instant();
}

/// The process is in its mode at t.
void Runtime::publish_mode(RunProcess &process, Ns t)
{
    if (process.process->executive().plays()) {
        return;
    }
    const auto mode = static_cast<std::size_t>(process.mode);
    if (process.counted != process.mode) {
        process.enter(mode, t);
    }
    process.process->executive().mode(t, process.mode, process.process->modes()[mode].name);
}

/// At the end of an instant: processes that began, or whose mode changed, publish their mode.
void Runtime::publish_modes(Ns t)
{
    modes_begin_ = false;
    for (RunProcess &process : processes_) {
        if (process.mode >= 0 && (process.ran == t || process.changed_at == t)) {
            publish_mode(process, t);
        }
        modes_begin_ = modes_begin_ || (process.mode >= 0 && process.ran < 0);
    }
}

// --- a run

bool Runtime::run_until(Ns t, const RunControl &control, Modules before)
{
    const Runs runs;
    running_ = &runs.now();
    Pacing pacing(control, std::max<Ns>(time(), 0), pace);
    const auto stopped = [&] {
        reached = time();
        return false;
    };
    const Ns whole = before.empty() ? t : t - 1; // until then all instants run to their ends
    try {
        if (held_.task >= 0) {
            finish_instant();
            if (recorder_.take_stop()) {
                return stopped();
            }
        }
        while (next <= whole) {
            if (!pacing.admits(next, now)) {
                return stopped();
            }
            instant();
            if (recorder_.take_stop()) {
                return stopped();
            }
        }
        if (next <= t) {
            instant_before(before);
            if (held_.task >= 0) {
                return true;
            }
            if (recorder_.take_stop()) {
                return stopped();
            }
        }
    } catch (const std::exception &error) {
        failure_ = error.what();
        failure_.resize(std::min(failure_.size(), failure_.find('\n'))); // Python adds a traceback
        throw;
    }
    if (!pacing.end(t, now)) {
        return stopped();
    }
    reached = std::max(reached, t);
    return true;
}

} // namespace fledge::sim
