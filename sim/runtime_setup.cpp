// SPDX-License-Identifier: Apache-2.0
// The schedule of a run, from its structure, and its beginning.
#include "sim/runtime.h"

#include "flight/msg/computer.h"

#include <algorithm>
#include <cstring>

namespace fledge::sim {

namespace {

void update_model(void *model, Tick tick)
{
    static_cast<Model *>(model)->update(tick);
}

void update_script(void *module, Tick tick)
{
    static_cast<Instance *>(module)->update(tick);
}

void update_playback(void *playback, Tick tick)
{
    static_cast<Playback *>(playback)->at(tick.t);
}

} // namespace

void reset_instance(Instance &instance, Ns t)
{
    const Runs runs(&instance);
    if (instance.model()) {
        instance.model()->reset(t);
    } else {
        instance.reset();
    }
}

/// As in a computer that begins: what modules keep over a reset of flight is gone, too.
void clear_modules(const Process &process)
{
    for (const auto &instance : process.instances()) {
        if (!instance->model()) {
            clear(*instance);
        }
    }
}

Runtime::Runtime(const Structure &built, Roles roles, Recorder &recorder, Recorder &outputs)
    : structure(built), roles_(std::move(roles)), wiring_(structure, roles_, health), recorder_(recorder),
      outputs_(outputs)
{
    // Pointers go into it, so that its elements must not move.
    processes_.reserve(structure.processes.size());
    for (const auto &process : structure.processes) {
        RunProcess &run = processes_.emplace_back();
        run.process = process.get();
        if (process->dictionary()) {
            run.commands = std::make_unique<Commands>(*this, *process, process->dictionary());
        }
        run.events.resize(process->events().size());
        has_events_ |= !run.events.empty();
        find_own_events(run);
        for (const Task *task : in_order(*process)) {
            RunTask entry{{}, {task->period, task->offset}, &run, static_cast<std::uint32_t>(steps_.size()), 0, task,
                          {}};
            for (int mode = 0; mode < static_cast<int>(process->modes().size()); mode++) {
                entry.runs_in.push_back(process->runs_in(*task, mode));
            }
            for (const auto &instance : task->run) {
                add_step(run, *task, *instance);
            }
            entry.last_step = static_cast<std::uint32_t>(steps_.size());
            entry.watched = health.end_task();
            tasks_.push_back(std::move(entry));
        }
        if (const auto &line = process->reset_line(); line && process->playback().empty()) {
            run.reset = reinterpret_cast<const std::byte *>(wiring_.source(line->input));
        }
        add_instances(run);
        keep_parameters(run);
    }
}

/// An update of a task, behind the wires into it.
void Runtime::add_step(RunProcess &run, const Task &task, Instance &instance)
{
    Process &process = *run.process;
    const std::uint32_t first = wiring_.size();
    for (const Instance *part : with_parts(process, instance)) {
        wiring_.lay_out(*part);
        if (!process.stands_in) {
            health.watch(*part, task, structure);
        }
    }
    const std::uint32_t last = wiring_.size();
    const auto add = [&](void (*update)(void *, Tick), void *self) {
        steps_.push_back({update, self, &instance, first, last});
    };
    if (!process.playback().empty()) {
        add(update_playback, &process.playback().at(&instance));
    } else if (Model *model = instance.model()) {
        add(update_model, model);
    } else if (instance.script.update) {
        add(update_script, &instance);
    } else {
        // Straight to the type's function, as Instance::update() calls it.
        add(reinterpret_cast<void (*)(void *, Tick)>(instance.type().update), instance.memory());
    }
}

void Runtime::add_instances(RunProcess &run)
{
    for (const auto &instance : run.process->instances()) {
        if (instance->model()) {
            models_.push_back(instance->model());
        }
        if (instance != run.process->computer()) { // it has those of the modules
            parameters_.emplace_back(*instance, run);
        }
        if (roles_.at(instance.get()).configuration) {
            Configuration module{instance.get(), &run, {}};
            for (const Wire &wire : structure.wires) {
                if (wire.from.instance == instance) {
                    module.copies.push_back(copy_of(wire, words(wire.from.bytes())));
                    module.copies.back().stale_after = 0; // it does not age
                }
            }
            configuration_.push_back(std::move(module));
        }
    }
}

void Runtime::find_own_events(RunProcess &process)
{
    process.own_events = true;
    for (const auto &event : process.process->events()) {
        event->visit([&](const std::shared_ptr<Instance> &used) {
            process.own_events =
                process.own_events && (!event->is_data() || roles_.at(used.get()).process == process.process);
        });
    }
}

// --- the beginning

void Runtime::reset(Ns after)
{
    const Ns start = std::max<Ns>(after, 0);
    now = reached = after;
    failure_.clear();
    held_ = {};
    pace = {};
    health.reset();
    changes_ = true; // the first instant checks it
    wiring_.clear();
    wiring_.feed_again();
    set_begun(false);
    plays_ = false;
    for (RunProcess &process : processes_) {
        plays_ |= process.process->executive().plays();
        clear_modules(*process.process);
        begin(process, start);
        const Requests &requests = process.process->requests;
        process.requested = requests.mode < 0 ? process.mode : requests.mode;
        for (const auto &[event, armed] : requests.armed) {
            process.events[event].state.armed = armed;
        }
        process.process->executive().forget();
        process.counted = -1;
        process.entered.assign(process.process->modes().size(), {});
        process.followed.assign(process.entered.size() * process.entered.size(), 0);
        process.resets = process.restarts = 0;
        process.changed_at = -1;
        process.outages.clear();
        if (process.commands) {
            process.commands->begin();
        }
    }
    for (RunTask &task : tasks_) {
        task.state = exec_start(task.rate, task.state.active, after + 1);
    }
    for (Configuration &module : configuration_) {
        publish(module, start);
    }
    wiring_.hold_outputs();
    next = next_instant();
}

void Runtime::set_begun(bool begun)
{
    for (const auto &process : structure.processes) {
        for (const auto &instance : process->instances()) {
            instance->begun = begun;
        }
    }
}

/// Its modules, mode, events and tasks as at the start of a run at t.
void Runtime::begin(RunProcess &process, Ns t)
{
    process.mode = process.requested = process.process->initial_mode();
    modes_begin_ = true;
    process.ran = -1;
    process.down_until = -1;
    process.publishes = 0;
    for (const auto &instance : process.process->instances()) {
        if (!roles_.at(instance.get()).part) {
            reset_instance(*instance, t);
        }
    }
    for (std::size_t i = 0; i < process.events.size(); i++) {
        process.events[i].state = process.process->events()[i]->armed ? exec_armed() : exec_disarmed();
        process.events[i].from = 0;
    }
    for (RunTask &task : tasks_) {
        if (task.process == &process) {
            task.state = exec_start(task.rate, process.process->runs_in(*task.task, process.mode), t);
        }
    }
}

/// The process alone begins again, as MISSION_restart of an exported mission.
void Runtime::restart(RunProcess &process, Ns t)
{
    for (const Wire &wire : structure.wires) {
        const Role &from = roles_.at(wire.from.instance.get());
        if (roles_.at(wire.to.instance.get()).process != process.process) {
            continue;
        }
        if (from.configuration && from.process != process.process) { // as the exchange still holds it
            Copy copy = copy_of(wire, words(wire.from.bytes()));
            copy.stale_after = 0;
            carry(copy, -1, t);
        } else {
            std::memset(wire.to.bytes(), 0, wire.to.field->size);
        }
    }
    for (const Feed &feed : structure.feeds) {
        if (roles_.at(feed.to.instance.get()).process == process.process) {
            std::memset(feed.to.bytes(), 0, feed.to.field->size);
        }
    }
    begin(process, t);
    process.changed_at = t;
    for (Configuration &module : configuration_) {
        if (module.process == &process) {
            publish(module, t);
        }
    }
}

/// As its computer begins with them, if it can be reset.
void Runtime::keep_parameters(RunProcess &process) const
{
    process.parameters.clear();
    for (const Parameters &parameters : parameters_) {
        if (process.reset && parameters.process == &process) {
            process.parameters.insert(process.parameters.end(), parameters.now.begin(), parameters.now.end());
        }
    }
}

} // namespace fledge::sim
