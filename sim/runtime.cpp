// SPDX-License-Identifier: Apache-2.0
// The loop. Between prepare() and the end of a run nothing here allocates.
#include "sim/runtime.h"

#include "flight/exec/message.h"
#include "flight/msg/computer.h"
#include "sim/text.h"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstring>
#include <ctime>

namespace fledge::sim {

namespace {

Word *words(std::byte *p)
{
    return reinterpret_cast<Word *>(p);
}

/// A loop of words: for the few dozen bytes of a message it beats a call of memcpy, which gcc would
/// make of it but for an option in CMakeLists.txt.
inline void copy_words(const Word *from, Word *to, std::uint32_t n)
{
#pragma GCC unroll 4
    for (std::uint32_t i = 0; i < n; i++) {
        to[i] = from[i];
    }
}

/// Whether an input that holds this message takes the one of the copy.
inline bool takes(const Copy &copy, const Word *held, std::int32_t mode, Ns t)
{
    if (copy.by == EXEC_IN_MODE) {
        return copy.mode == mode;
    }
    Head heads[2];
    std::memcpy(&heads[0], held, sizeof(Head));
    std::memcpy(&heads[1], copy.from, sizeof(Head));
    return exec_takes(copy.by, heads[0], heads[1], t, copy.stale_after);
}

/// Returns whether the message became stale.
inline bool carry(const Copy &copy, std::int32_t mode, Ns t)
{
    if (copy.by == EXEC_SOLE || takes(copy, copy.to, mode, t)) {
        copy_words(copy.from, copy.to, copy.words);
    }
    if (copy.stale_after) {
        Head head;
        std::memcpy(&head, copy.to, sizeof head);
        const Quality before = head.quality;
        exec_age(&head, t, copy.stale_after);
        std::memcpy(copy.to, &head, sizeof head);
        return head.quality != before;
    }
    return false;
}

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

Copy copy_of(const Wire &wire, const Word *from)
{
    return {from, words(wire.to.bytes()), wire.to.field->size / 8, wire.options.stale_after, 0, EXEC_SOLE, -1};
}

/// The parameters of an instance, which lie together in its memory.
std::span<std::byte> parameters_of(const Instance &instance)
{
    std::span<std::byte> found;
    for (const FledgeField &field : fields(instance.type())) {
        if (field.group == FLEDGE_PAR) {
            found = {found.empty() ? instance.memory() + field.offset : found.data(), found.size() + field.size};
        }
    }
    return found;
}

} // namespace

bool Parameters::changed() const
{
    return !now.empty() && std::memcmp(now.data(), seen.data(), now.size()) != 0;
}

void Parameters::see()
{
    seen.assign(now.begin(), now.end());
}

std::vector<const FledgeField *> Parameters::differing() const
{
    std::vector<const FledgeField *> found;
    for (const FledgeField &field : fields(instance->type())) {
        const std::byte *at = instance->memory() + field.offset;
        if (field.group == FLEDGE_PAR && std::memcmp(at, seen.data() + (at - now.data()), field.size)) {
            found.push_back(&field);
        }
    }
    return found;
}

void Parameters::refresh() const
{
    if (instance->model() && changed()) {
        instance->model()->refresh();
    }
}

Runtime::Runtime(const Structure &built, Roles roles, Recorder &recorder, Recorder &outputs)
    : structure(built), roles_(std::move(roles)), recorder_(recorder), outputs_(outputs)
{
    // Pointers go into both, so that their elements must not move.
    exchanges_.reserve(structure.wires.size());
    fed_.reserve(structure.feeds.size());
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
                const auto first = static_cast<std::uint32_t>(copies_.size());
                for (const Instance *one : with_parts(*process, *instance)) {
                    lay_out_wires(*one);
                    if (!process->stands_in) {
                        health.watch(*one, *task, structure);
                    }
                }
                const auto last = static_cast<std::uint32_t>(copies_.size());
                const auto add = [&](void (*update)(void *, Tick), void *self) {
                    steps_.push_back({update, self, instance.get(), first, last});
                };
                if (!process->playback().empty()) {
                    add(update_playback, &process->playback().at(instance.get()));
                } else if (Model *model = instance->model()) {
                    add(update_model, model);
                } else if (instance->script.update) {
                    add(update_script, instance.get());
                } else {
                    // Straight to the type's function, as Instance::update() calls it.
                    add(reinterpret_cast<void (*)(void *, Tick)>(instance->type().update), instance->memory());
                }
            }
            entry.last_step = static_cast<std::uint32_t>(steps_.size());
            entry.watched = health.end_task();
            tasks_.push_back(std::move(entry));
        }
        if (const auto &line = process->reset_line(); line && process->playback().empty()) {
            const Word *input = words(line->input.bytes());
            const auto into = [&](const Copy &copy) { return copy.to == input; };
            const auto wire = std::find_if(copies_.begin(), copies_.end(), into);
            run.reset = reinterpret_cast<const std::byte *>(wire == copies_.end() ? input : wire->from);
        }
        for (const auto &instance : process->instances()) {
            if (instance->model()) {
                models_.push_back(instance->model());
            }
            parameters_.push_back({instance.get(), &run, parameters_of(*instance), {}});
            parameters_.back().see();
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
        keep_parameters(run);
    }
}

/// The wires into an instance.
void Runtime::lay_out_wires(const Instance &consumer)
{
    for (const Wire &wire : structure.wires) {
        if (wire.to.instance.get() != &consumer || roles_.at(wire.from.instance.get()).configuration) {
            continue; // the output of a configuration module is copied when it changes
        }
        const Process &reader = *roles_.at(&consumer).process;
        const auto *from =
            reinterpret_cast<const Word *>(roles_.at(wire.from.instance.get()).process->given(wire.from, reader));
        if (wire.options.latency) {
            const std::uint32_t n = wire.from.field->size / 8;
            const Ns period = std::max(longest_period(*roles_.at(wire.from.instance.get()).process),
                                       longest_period(*roles_.at(&consumer).process));
            exchanges_.push_back({&wire, from, n, period, -1, std::vector<std::uint64_t>(n)});
            from = exchanges_.back().held.data();
        }
        Copy copy = copy_of(wire, from);
        const auto first =
            std::find_if(copies_.begin(), copies_.end(), [&](const Copy &one) { return one.to == copy.to; });
        if (wire.options.by == EXEC_IN_MODE) {
            copy.by = EXEC_IN_MODE;
            copy.mode = reader.mode_index(wire.options.mode);
        } else if (first != copies_.end()) {
            copy.by = wire.options.by;
        }
        if (wire.options.stale_after) {
            copy.age = first == copies_.end() ? health.watch_age(wire.to) : first->age;
        }
        copies_.push_back(copy);
    }
    for (const Feed &feed : structure.feeds) {
        if (feed.to.instance.get() == &consumer && feed.messages) {
            const std::uint32_t n = feed.to.field->size / 8;
            fed_.push_back({&feed, 0, std::vector<std::uint64_t>(n)});
            copies_.push_back({fed_.back().held.data(), words(feed.to.bytes()), n, feed.stale_after, 0, EXEC_SOLE, -1});
            if (feed.stale_after) {
                copies_.back().age = health.watch_age(feed.to);
            }
        }
    }
}

/// What an input that is fed gets at t, and when that changes next.
void Runtime::deliver(Fed &fed, Ns t)
{
    const Messages &messages = *fed.feed->messages;
    const std::size_t n = messages.until(t);
    std::byte *held = reinterpret_cast<std::byte *>(fed.held.data());
    fed.due = n < messages.times.size() ? messages.times[n] : never;
    if (n == 0) {
        std::fill(fed.held.begin(), fed.held.end(), 0); // nothing was written yet
        return;
    }
    const std::byte *last = messages.message(n - 1);
    std::memcpy(held, last, fed.held.size() * sizeof(Word));
    const bool between = !fed.feed->linear.empty() && n < messages.times.size();
    if (!between && !fed.feed->always) {
        return;
    }
    fed.due = exec_later(t, 1);
    // A writing for each instant. The reader's own memory has the last one, so that a snapshot has it.
    Head head, seen;
    std::memcpy(&head, held, sizeof head);
    std::memcpy(&seen, fed.feed->to.bytes(), sizeof seen);
    if (between) {
        const std::byte *coming = messages.message(n);
        const double share = static_cast<double>(t - messages.times[n - 1]) /
                             static_cast<double>(messages.times[n] - messages.times[n - 1]);
        for (const std::uint32_t at : fed.feed->linear) {
            double a, b;
            std::memcpy(&a, last + at, sizeof a);
            std::memcpy(&b, coming + at, sizeof b);
            a += share * (b - a);
            std::memcpy(held + at, &a, sizeof a);
        }
        Head later;
        std::memcpy(&later, coming, sizeof later);
        head.quality = quality_min(head.quality, later.quality);
    }
    head = head_next(seen, t, head.quality);
    std::memcpy(held, &head, sizeof head);
}

void Runtime::feed_again()
{
    for (Fed &fed : fed_) {
        fed.due = 0;
    }
}

void Runtime::reset(Ns after)
{
    const Ns start = std::max<Ns>(after, 0);
    now = reached = after;
    failure_.clear();
    pace = {};
    health.reset();
    changes_ = true; // the first instant checks it
    for (const Wire &wire : structure.wires) {
        std::memset(wire.to.bytes(), 0, wire.to.field->size);
    }
    for (const Feed &feed : structure.feeds) {
        std::memset(feed.to.bytes(), 0, feed.to.field->size);
    }
    feed_again();
    set_begun(false);
    for (RunProcess &process : processes_) {
        clear_modules(*process.process);
        begin(process, start);
        const Requests &requests = process.process->requests;
        process.asked = requests.mode < 0 ? process.mode : requests.mode;
        for (const auto &[event, armed] : requests.armed) {
            process.events[event].state.armed = armed;
        }
        process.process->executive().forget();
        process.counted = -1;
        process.entered.assign(process.process->modes().size(), {});
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
    for (Exchange &exchange : exchanges_) {
        copy_words(exchange.from, exchange.held.data(), exchange.words);
        exchange.done = -1;
    }
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
    process.mode = process.asked = process.process->initial_mode();
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
            carry({words(wire.from.bytes()), words(wire.to.bytes()), wire.to.field->size / 8, 0, 0, EXEC_SOLE, -1}, -1,
                  t);
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
    for (const Parameters &one : parameters_) {
        if (process.reset && one.process == &process) {
            process.parameters.insert(process.parameters.end(), one.now.begin(), one.now.end());
        }
    }
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
        process.asked = process.mode;
        for (RunTask &task : tasks_) {
            if (task.process == &process) {
                task.state = exec_start(task.rate, 1, process.down_until);
            }
        }
    }
    if (process.down_until < 0 || t < process.down_until) {
        return process.down_until >= 0;
    }
    process.resets = count;
    auto from = process.parameters.begin();
    for (Parameters &one : parameters_) {
        if (one.process == &process) {
            std::copy_n(from, one.now.size(), one.now.begin());
            from += static_cast<std::ptrdiff_t>(one.now.size());
        }
    }
    see_parameters(process);
    clear_modules(*process.process);
    restart(process, t);
    if (process.commands) {
        process.commands->forget(t);
    }
    process.process->executive().reset(t, ++process.restarts);
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

bool Runtime::parameters_changed() const
{
    return std::ranges::any_of(parameters_, &Parameters::changed);
}

void Runtime::take_parameters()
{
    Faults faults;
    for (const Parameters &one : parameters_) {
        if (!one.changed()) {
            continue;
        }
        const auto differing = one.differing();
        faults.collect([&] { check_parameters(*one.instance); });
        for (const FledgeField *field : differing) {
            if (field->flags & FLEDGE_INITIAL && now >= 0) {
                faults.add(one.instance->path + "." + field->name + " is an initial value, and the run has come to " +
                           format_time(time()) + ": a change has no effect; reset the simulation first");
            }
        }
    }
    faults.raise();
    for (Parameters &one : parameters_) {
        if (!one.changed()) {
            continue;
        }
        one.refresh();
        changes_ = true;
        for (Configuration &module : configuration_) {
            if (module.instance == one.instance && now < 0) {
                publish(module, 0);
            } else if (module.instance == one.instance) {
                module.changed = module.process->publishes = 1;
            }
        }
        one.see();
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
    Faults faults;
    for (Model *model : models_) {
        faults.collect([&] { model->ensure_data_until(t); });
    }
    faults.raise();
}

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
                         [&](const auto &one) { return one.process == &process; });
}

RunEvent &Runtime::of(const Process &process, const Event &event)
{
    const auto &events = process.events();
    const auto it = std::find_if(events.begin(), events.end(), [&](const auto &one) { return one.get() == &event; });
    return of(process).events[static_cast<std::size_t>(it - events.begin())];
}

void Runtime::enter(const Process &process, int mode)
{
    of(process).asked = mode;
    expect_changes(); // a task of that mode may come sooner than what was next
}

void Runtime::event_added(const Process &process)
{
    // The process checks it from the next instant on: an action may add an event that adds another one.
    of(process).events.push_back({process.events().back()->armed ? exec_armed() : exec_disarmed(), {}, now + 1});
    find_own_events(of(process));
    has_events_ = true;
}

void Runtime::set_commands(Process &process, std::shared_ptr<const Dictionary> dictionary)
{
    of(process).commands = std::make_unique<Commands>(*this, process, std::move(dictionary));
    expect_changes();
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

CommandReason Runtime::command(const Process &process, const std::vector<std::uint8_t> &packet)
{
    const CommandReason reason = of(process).commands->accept(packet, last_tick(process, time()));
    if (reason == COMMAND_OK) {
        expect_changes();
    }
    return reason;
}

void Runtime::expect_changes()
{
    changes_ = true;
    next = next_instant();
}

/// The next instant of a task, in the mode that its process is in or was asked to enter.
inline Ns Runtime::next_of(const RunTask &task) const
{
    const RunProcess &process = *task.process;
    Ns commanded = process.reset ? time() : never; // at which a target ticks, whatever its mode
    if (process.commands && !process.reset) {
        commanded = process.commands->counts_instants() ? time() : process.commands->next(time());
    }
    const bool asked = process.asked != process.mode && task.runs_in[static_cast<std::size_t>(process.asked)];
    return std::min(exec_next(&task.state, task.rate, asked, time()),
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

/// What was changed since the process' last instant: it publishes its configuration, executes its commands
/// and enters the mode that was asked for, if this is an instant of it: its computer does not see the instants of other
/// processes. Called when the process' turn comes, so that the processes before it still see it as it was.
void Runtime::make_changes(RunProcess &process, Ns t)
{
    const bool commanded = process.commands && process.commands->next(t - 1) < t;
    if (process.asked == process.mode && !process.publishes && !commanded) {
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
    if (process.asked == process.mode) {
        return;
    }
    process.mode = process.asked;
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

/// The parameters of a process are as they should be: its commands have changed them.
void Runtime::see_parameters(const RunProcess &process)
{
    for (Parameters &one : parameters_) {
        if (one.process == &process) {
            one.see();
        }
    }
}

std::span<const std::byte> Runtime::incoming(const Port &input) const
{
    // If nothing is carried: of configuration, which is there already; without a wire; or not in this mode.
    const Word *const own = words(input.bytes()), *found = own;
    const auto reads = [&](const RunProcess &one) { return one.process == roles_.at(input.instance.get()).process; };
    const std::int32_t mode = std::find_if(processes_.begin(), processes_.end(), reads)->mode;
    for (const Copy &one : copies_) {
        if (one.to == own && (one.by == EXEC_SOLE || takes(one, found, mode, time()))) {
            found = one.from;
        }
    }
    return {reinterpret_cast<const std::byte *>(found), input.field->size};
}

bool Runtime::override_input(const Port &input, std::uint32_t place, double value)
{
    const Word *message = words(input.bytes());
    Word *to = words(input.bytes() + place);
    const auto is = [&](const Word *end) { return [=](const Copy &one) { return one.to == end; }; };
    const auto last = std::find_if(copies_.rbegin(), copies_.rend(), is(message)); // of several, behind all
    if (last == copies_.rend()) {
        return false;
    }
    std::uint64_t bits;
    std::memcpy(&bits, &value, sizeof bits);
    for (std::uint64_t &one : overrides_) {
        const auto from = [&](const Copy &copy) { return copy.from == &one && copy.to == to; };
        if (std::any_of(copies_.begin(), copies_.end(), from)) {
            one = bits;
            return true;
        }
    }
    // One more copy, of a word, behind that of the message.
    const auto at = static_cast<std::uint32_t>(copies_.rend() - last);
    copies_.insert(copies_.begin() + at, {&overrides_.emplace_back(bits), to, 1, 0, 0, EXEC_SOLE, -1});
    for (Step &step : steps_) {
        step.first_copy += step.first_copy >= at;
        step.last_copy += step.last_copy >= at;
    }
    return true;
}

void Runtime::visit_held(const std::function<void(const Wire &, void *, std::size_t)> &block)
{
    for (Exchange &exchange : exchanges_) {
        block(*exchange.wire, exchange.held.data(), exchange.words * sizeof(Word));
    }
}

inline void Runtime::run_task(RunTask &task, Ns t)
{
    if (const auto &flight = task.process->process->flight(); flight && task.process->ran != t) {
        flight(t);
    }
    const Tick tick = exec_begin(&task.state, task.rate, t);
    const std::int32_t mode = task.process->mode;
    running_->task.store(task.task, std::memory_order_relaxed);
    for (std::uint32_t i = task.first_step; i < task.last_step; i++) {
        const Step &step = steps_[i];
        for (std::uint32_t k = step.first_copy; k < step.last_copy; k++) {
            if (carry(copies_[k], mode, t)) {
                health.was_stale(copies_[k].age, t);
            }
        }
        running_->instance.store(step.instance, std::memory_order_relaxed);
        step.update(step.self, tick);
    }
    running_->instance.store(nullptr, std::memory_order_relaxed);
    health.task_ran(task.watched, t);
    task.process->ran = t;
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
    const bool looks = process.events[i].state.armed != 0 && in_mode; // a disarmed event does not call its predicate
    const bool holds = looks && (event->condition ? event->condition->holds() : event->predicate());
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
        enter(*process.process, mode);
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
    for (Parameters &one : parameters_) {
        const auto sets = [&](const Setting &setting) { return setting.instance.get() == one.instance; };
        if (std::any_of(event.set.begin(), event.set.end(), sets)) {
            one.see();
            publish(*one.instance, t);
        }
    }
    if (event.action) {
        event.action();
        for (const Parameters &one : parameters_) {
            one.refresh();
        }
    }
}

/// What a process does that flew elsewhere: what it is asked for here does not count.
void Runtime::play(RunProcess &process, Ns t)
{
    process.asked = process.mode;
    process.process->executive().say_played(
        now, t,
        [&](Ns at, std::uint32_t mode) {
            process.mode = process.asked = static_cast<std::int32_t>(mode);
            process.entered[mode].add(at);
        },
        [&](Ns at, std::uint32_t event) {
            if (event < process.events.size()) {
                process.events[event].fired.add(at);
            }
        });
}

void Runtime::instant()
{
    const Ns t = next;
    running_->t.store(t, std::memory_order_relaxed);
    for (RunProcess &process : processes_) {
        if (process.process->executive().plays()) {
            play(process, t);
        }
    }
    for (Exchange &exchange : exchanges_) {
        // Hold the message of the last multiple of the period before t.
        const Ns due = t > 0 ? (t - 1) / exchange.period * exchange.period : -1;
        if (due > exchange.done) {
            exchange.done = due;
            copy_words(exchange.from, exchange.held.data(), exchange.words);
        }
    }
    for (Fed &fed : fed_) {
        if (t >= fed.due) {
            deliver(fed, t);
        }
    }
    RunProcess *turn = nullptr;
    bool down = false;
    const auto end_turn = [&] {
        if (turn && has_events_) {
            run_own_events(*turn, t);
        }
        if (turn && turn->commands && turn->ran == t && turn->commands->run_procedure(t)) {
            see_parameters(*turn);
        }
        if (turn && turn->commands && !down && last_tick(*turn->process, t) == t) {
            turn->commands->tell(t);
        }
    };
    for (RunTask &task : tasks_) {
        if (task.process != turn) {
            end_turn();
            turn = task.process;
            down = task.process->reset && is_down(*task.process, t);
            if (changes_ && !down) {
                make_changes(*task.process, t);
            }
        }
        if (!down && exec_due(&task.state, t)) {
            run_task(task, t);
        }
    }
    end_turn();
    if (changes_) {
        changes_ = std::any_of(processes_.begin(), processes_.end(), [t](const RunProcess &process) {
            return process.asked != process.mode || process.publishes ||
                   (process.commands && process.commands->next(t) < never);
        });
    }
    if (now < 0) {
        set_begun(true);
    }
    now = t;
    if (modes_begin_) {
        say_modes(t);
    }
    if (has_events_) {
        run_events(t);
    }
    recorder_.take(t);
    outputs_.take(t);
    next = next_instant();
}

/// The process is in its mode at t.
void Runtime::say_mode(RunProcess &process, Ns t)
{
    if (process.process->executive().plays()) {
        return;
    }
    const auto mode = static_cast<std::size_t>(process.mode);
    if (process.counted != process.mode) {
        process.counted = process.mode;
        process.entered[mode].add(t);
    }
    process.process->executive().mode(t, process.mode, process.process->modes()[mode].name);
}

/// At the end of an instant: processes that began, or whose mode changed, say in which they are.
void Runtime::say_modes(Ns t)
{
    modes_begin_ = false;
    for (RunProcess &process : processes_) {
        if (process.mode >= 0 && (process.ran == t || process.changed_at == t)) {
            say_mode(process, t);
        }
        modes_begin_ = modes_begin_ || (process.mode >= 0 && process.ran < 0);
    }
}

bool Runtime::run_until(Ns t, const RunControl &control)
{
    using Clock = std::chrono::steady_clock;
    using namespace std::chrono_literals;
    const Runs runs;
    running_ = &running();
    const auto start = control.pace > 0.0 ? Clock::now() : Clock::time_point{};
    const Ns simulated_start = std::max<Ns>(time(), 0);
    auto polled = start;
    // Read the clock only sometimes, for it takes as long as a small update; more often where updates are slow.
    int looks_after = 16, until_look = looks_after;
    Clock::time_point looked;
    const auto polite = [&](Clock::time_point at) {
        if (control.poll && at - polled >= 50ms) {
            polled = at;
            return control.poll(now);
        }
        return true;
    };
    // Sleep until the simulated time's place on the wall clock; false if the control stopped the run.
    const auto sleep_until = [&](Ns simulated) {
        const auto due = start + std::chrono::nanoseconds(
                                     static_cast<Ns>(static_cast<double>(simulated - simulated_start) / control.pace));
        auto at = Clock::now();
        pace.worst = std::max<Ns>(pace.worst, (at - due) / 1ns);
        pace.overruns += at - due > 1ms;
        while (polite(at)) { // also where the run is late
            if (at >= due) {
                return true;
            }
            const auto until = std::min(due, at + 50ms).time_since_epoch();
            const timespec wake{until / 1s, (until % 1s) / 1ns};
            clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &wake, nullptr);
            at = Clock::now();
        }
        return false;
    };
    const auto stopped = [&] {
        reached = time();
        return false;
    };
    try {
        while (next <= t) {
            if (control.pace > 0.0) {
                pace.instants++;
                if (!sleep_until(next)) {
                    return stopped();
                }
            } else if (control.poll && --until_look == 0) {
                const auto at = Clock::now();
                looks_after = at - looked > 5ms ? std::max(1, looks_after / 2) : std::min(256, 2 * looks_after);
                until_look = looks_after;
                looked = at;
                if (!polite(at)) {
                    return stopped();
                }
            }
            instant();
            if (recorder_.take_stop()) {
                return stopped();
            }
        }
    } catch (const std::exception &error) {
        failure_ = error.what();
        failure_.resize(std::min(failure_.size(), failure_.find('\n'))); // Python adds a traceback
        throw;
    }
    if (control.pace > 0.0 && now < t && !sleep_until(t)) {
        return stopped();
    }
    reached = std::max(reached, t);
    return true;
}

void Runtime::visit_state(const std::function<void(void *, std::size_t)> &block)
{
    const auto value = [&](auto &x) { block(&x, sizeof x); };
    value(now);
    value(reached);
    value(next);
    for (RunTask &task : tasks_) {
        value(task.state);
    }
    for (Exchange &exchange : exchanges_) {
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
        value(process.mode);
        value(process.asked);
        value(process.publishes);
        value(process.counted);
        for (Tally &tally : process.entered) {
            value(tally);
        }
        if (const auto said = process.process->executive().memory(); !said.empty()) {
            block(said.data(), said.size());
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
}

void Runtime::restored()
{
    failure_.clear();
    feed_again();
    modes_begin_ = true;
    for (RunProcess &process : processes_) {
        process.ran = -1;
    }
    find_places();
    for (Parameters &one : parameters_) {
        one.refresh();
        one.see();
    }
}

void Runtime::find_places()
{
    changes_ = true;
    for (RunProcess &process : processes_) {
        if (process.commands) {
            process.commands->find_place(last_tick(*process.process, now));
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
