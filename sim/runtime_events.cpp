// SPDX-License-Identifier: Apache-2.0
// Events: those that reach nothing of other processes at the end of a process' turn, the others at that of the instant.
#include "sim/runtime.h"

#include "sim/text.h"

#include <algorithm>

namespace fledge::sim {

RunEvent &Runtime::of(const Process &process, const Event &event)
{
    const auto &events = process.events();
    const auto it =
        std::find_if(events.begin(), events.end(), [&](const auto &other) { return other.get() == &event; });
    return of(process).events[static_cast<std::size_t>(it - events.begin())];
}

void Runtime::event_added(const Process &process)
{
    // The process checks it from the next instant on: an action may add an event that adds another one.
    of(process).events.push_back({process.events().back()->armed ? exec_armed() : exec_disarmed(), {}, now + 1});
    find_own_events(of(process));
    has_events_ = changes_ = true;
}

/// At the end of the process' turn: the processes that run later at the same instant see what the events have changed,
/// as they do where each is a program of its own.
void Runtime::run_own_events(RunProcess &process, Ns t)
{
    for (std::size_t i = 0; process.own_events && process.ran == t && i < process.events.size(); i++) {
        if (process.process->events()[i]->is_data()) {
            (void)run_event(process, i, t);
        }
    }
}

/// What is left: Python, and what reaches other processes.
void Runtime::run_events(Ns t)
{
    bool first = true, fired = true;
    while (fired) {
        fired = false;
        for (RunProcess &process : processes_) {
            if (process.ran != t) {
                continue; // flight checks its events when it runs, as on its own computer
            }
            for (std::size_t i = 0; i < process.events.size(); i++) {
                if ((!first || process.own_events) && process.process->events()[i]->is_data()) {
                    continue;
                }
                ExecEvent &state = process.events[i].state;
                state.held -= !first && state.held > 0; // the same instant counts once
                fired |= run_event(process, i, t);
            }
        }
        first = false;
    }
}

bool Runtime::run_event(RunProcess &process, std::size_t i, Ns t)
{
    // By index and by a copy of the pointer: Python may add events.
    const std::shared_ptr<Event> event = process.process->events()[i];
    if (t < process.events[i].from) {
        return false;
    }
    const auto &modes = event->modes;
    const bool in_mode = modes.empty() || std::find(modes.begin(), modes.end(), process.process->mode()) != modes.end();
    const bool checked = process.events[i].state.armed != 0 && in_mode; // a disarmed event does not call its predicate
    const bool holds = checked && (event->condition ? event->condition->holds() : event->predicate());
    const bool again = event->until ? event->until->holds() : !holds;
    const Ns fired_before = process.events[i].state.fired_at;
    if (!exec_fires(&process.events[i].state, holds, again, event->hold, event->count, event->once, t)) {
        return false;
    }
    if (fired_before == t) {
        throw RunError("event " + process.process->name + "." + event->name + " fires again at " + format_time(t) +
                       ", the instant at which it fired: " +
                       (event->condition ? event->condition->text() + " holds" : "its condition holds") +
                       " and it was armed anew");
    }
    if (!process.process->executive().plays()) {
        process.events[i].fired.add(t);
    }
    const int mode = event->mode.empty() ? -1 : process.process->mode_index(event->mode);
    const bool refused = mode >= 0 && !process.process->may_enter(mode);
    process.process->executive().event(t, i, event->name, event->text, refused);
    if (mode >= 0 && !refused) {
        request(process, mode);
    }
    act(process, *event, t);
    return true;
}

void Runtime::act(RunProcess &process, const Event &event, Ns t)
{
    for (const auto &[name, armed] : event.arms) {
        of(*process.process, *process.process->event(name)).state.armed = armed;
    }
    for (const Setting &setting : event.set) {
        const bool played = !process.process->playback().empty() &&
                            field_at(setting.instance->type(), setting.offset)->group == FLEDGE_OUT;
        if (!played) { // the record has what was set
            std::copy(setting.bytes.begin(), setting.bytes.end(), setting.instance->memory() + setting.offset);
        }
    }
    for (Parameters &parameters : parameters_) {
        const auto sets = [&](const Setting &setting) { return setting.instance.get() == parameters.instance; };
        if (std::any_of(event.set.begin(), event.set.end(), sets)) {
            parameters.see();
            publish(*parameters.instance, t);
        }
    }
    if (event.action) {
        event.action();
        for (const Parameters &parameters : parameters_) {
            parameters.refresh();
        }
    }
}

} // namespace fledge::sim
