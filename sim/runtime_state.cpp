// SPDX-License-Identifier: Apache-2.0
// What changes beside the loop: parameters between runs, snapshots, and the state of commands.
#include "sim/runtime.h"

#include "sim/text.h"

#include <algorithm>

namespace fledge::sim {

bool Runtime::parameters_changed() const
{
    return std::ranges::any_of(parameters_, &Parameters::changed);
}

void Runtime::take_parameters()
{
    Faults faults;
    for (const Parameters &parameters : parameters_) {
        if (!parameters.changed()) {
            continue;
        }
        const auto differing = parameters.differing();
        faults.collect([&] { check_parameters(*parameters.instance); });
        for (const FledgeField *field : differing) {
            if (field->flags & FLEDGE_INITIAL && now >= 0) {
                faults.add(parameters.instance->path + "." + field->name +
                           " is an initial value, and the run has come to " + format_time(time()) +
                           ": a change has no effect; reset the simulation first");
            }
        }
    }
    faults.raise();
    for (Parameters &parameters : parameters_) {
        if (!parameters.changed()) {
            continue;
        }
        parameters.refresh();
        changes_ = true;
        for (Configuration &module : configuration_) {
            if (module.instance == parameters.instance && (now < 0 || held_.task >= 0)) {
                publish(module, std::max<Ns>(now, 0)); // the rest of an instant that is held has the new ones
            } else if (module.instance == parameters.instance) {
                module.changed = module.process->publishes = 1;
            }
        }
        parameters.see();
    }
    next = next_instant();
}

void Runtime::ready_for(Ns t, bool same_parameters)
{
    if (!failure_.empty()) {
        throw RunError("the run ended: " + failure_ + "\nreset it, or restore a snapshot");
    }
    if (!same_parameters) {
        take_parameters();
    }
    for (RunProcess &process : processes_) {
        if (now < 0) {
            keep_parameters(process);
        }
    }
    try {
        for (Model *model : models_) {
            model->ensure_data_until(t);
        }
    } catch (const SetupError &) { // what all of them say
        Faults faults;
        for (Model *model : models_) {
            faults.collect([&] { model->ensure_data_until(t); });
        }
        faults.raise();
    }
}

// --- snapshots

void Runtime::visit_held(const std::function<void(const Wire &, void *, std::size_t)> &block)
{
    for (Exchange &exchange : wiring_.exchanges) {
        block(*exchange.wire, exchange.held.data(), exchange.words * sizeof(Word));
    }
}

void Runtime::visit_process(RunProcess &process, const std::function<void(void *, std::size_t)> &block)
{
    const auto value = [&](auto &x) { block(&x, sizeof x); };
    value(process.mode);
    value(process.requested);
    value(process.publishes);
    value(process.counted);
    for (Tally &tally : process.entered) {
        value(tally);
    }
    if (const auto messages = process.process->executive().memory(); !messages.empty()) {
        block(messages.data(), messages.size());
    }
    if (process.reset) {
        value(process.resets);
        value(process.restarts);
        value(process.down_until);
        block(process.parameters.data(), process.parameters.size());
    }
    for (RunEvent &event : process.events) {
        value(event.state);
        value(event.fired);
    }
    for (const auto &instance : process.process->instances()) {
        block(instance->memory(), instance->type().size);
        if (instance->model()) {
            const auto memory = instance->model()->memory();
            if (!memory.empty()) {
                block(memory.data(), memory.size());
            }
        }
    }
}

void Runtime::visit_state(const std::function<void(void *, std::size_t)> &block)
{
    const auto value = [&](auto &x) { block(&x, sizeof x); };
    value(now);
    value(reached);
    value(next);
    value(held_);
    for (RunTask &task : tasks_) {
        value(task.state);
    }
    for (Exchange &exchange : wiring_.exchanges) {
        value(exchange.done);
        block(exchange.held.data(), exchange.words * sizeof(Word));
    }
    health.visit_state(block);
    for (Configuration &module : configuration_) {
        const auto parameters = std::ranges::find(parameters_, module.instance, &Parameters::instance);
        if (now >= 0 && parameters->changed()) {
            module.changed = module.process->publishes = 1; // after a restore they are as if seen
        }
        value(module.changed);
    }
    for (RunProcess &process : processes_) {
        visit_process(process, block);
    }
}

void Runtime::restored()
{
    failure_.clear();
    wiring_.feed_again();
    modes_begin_ = true;
    for (RunProcess &process : processes_) {
        const auto has_run = [&](const RunTask &task) { return task.process == &process && task.state.last == now; };
        process.ran = held_.task >= 0 && std::ranges::any_of(tasks_, has_run) ? now : -1;
    }
    find_places();
    for (Parameters &parameters : parameters_) {
        parameters.refresh();
        parameters.see();
    }
}

void Runtime::find_places()
{
    changes_ = true;
    for (RunProcess &process : processes_) {
        if (process.commands) {
            process.commands->find_place(last_tick(*process.process, seen(process)));
        }
    }
    next = next_instant();
}

void Runtime::visit_commands(const std::function<void(void *, std::size_t)> &block)
{
    for (RunProcess &process : processes_) {
        if (process.commands) {
            process.commands->visit_state(block);
        }
    }
}

bool Runtime::commands_used() const
{
    return std::any_of(processes_.begin(), processes_.end(),
                       [](const RunProcess &process) { return process.commands && process.commands->used(); });
}

void Runtime::forget_commands()
{
    for (RunProcess &process : processes_) {
        if (process.commands) {
            process.commands->begin();
        }
    }
}

} // namespace fledge::sim
