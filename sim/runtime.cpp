// SPDX-License-Identifier: Apache-2.0
// The loop. Between prepare() and the end of a run nothing here allocates.
#include "sim/runtime.h"

#include "sim/text.h"

#include <algorithm>
#include <chrono>
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
    for (std::uint32_t i = 0; i < n; i++) {
        to[i] = from[i];
    }
}

inline void carry(const Copy &copy, Ns t)
{
    copy_words(copy.from, copy.to, copy.words);
    if (copy.stale_after) {
        Head head;
        std::memcpy(&head, copy.to, sizeof head);
        if (t - head.t > copy.stale_after && head.quality > QUALITY_STALE) {
            head.quality = QUALITY_STALE;
            std::memcpy(copy.to, &head, sizeof head);
        }
    }
}

void update_model(void *model, Tick tick)
{
    static_cast<Model *>(model)->update(tick);
}

/// The tables hold a module's functions without their argument's type. All of them take one pointer
/// to a struct, which every ABI that we fly on passes alike.
using ModuleReset = void (*)(void *);
using ModuleUpdate = void (*)(void *, Tick);

ModuleReset reset_of(const Instance &module)
{
    return reinterpret_cast<ModuleReset>(module.type().reset);
}

ModuleUpdate update_of(const Instance &module)
{
    return reinterpret_cast<ModuleUpdate>(module.type().update);
}

Copy copy_of(const Wire &wire, const Word *from)
{
    return {from, words(wire.to.bytes()), wire.to.field->size / 8, wire.options.stale_after};
}

void append(std::vector<std::byte> &bytes, const void *from, std::size_t n)
{
    bytes.resize(bytes.size() + n);
    std::memcpy(bytes.data() + bytes.size() - n, from, n);
}

/// The bytes of an instance's parameters.
std::vector<std::byte> parameters(const Instance &instance)
{
    std::vector<std::byte> bytes;
    for (const FledgeField &field : fields(instance.type())) {
        if (field.group == FLEDGE_PAR) {
            append(bytes, instance.memory() + field.offset, field.size);
        }
    }
    return bytes;
}

bool unchanged(const Instance &instance, const std::vector<std::byte> &seen)
{
    std::size_t at = 0;
    for (const FledgeField &field : fields(instance.type())) {
        if (field.group == FLEDGE_PAR) {
            if (std::memcmp(instance.memory() + field.offset, seen.data() + at, field.size)) {
                return false;
            }
            at += field.size;
        }
    }
    return true;
}

/// The first multiple of the task's period, from its offset on, at or after t.
Ns on_grid(const RunTask &task, Ns t)
{
    if (t <= task.offset) {
        return task.offset;
    }
    const Ns periods = (t - task.offset + task.period - 1) / task.period;
    return task.offset + periods * task.period;
}

Ns longest_period(const Process &process)
{
    Ns longest = 0;
    for (const Task &task : process.tasks()) {
        longest = std::max(longest, task.period);
    }
    return longest;
}

const Process &process_of(const Simulation &simulation, const Instance &instance)
{
    return *std::find_if(simulation.processes().begin(), simulation.processes().end(), [&](const auto &p) {
                return p->find(instance.name).get() == &instance;
            })->get();
}

} // namespace

Simulation::Runtime::Runtime(Simulation &owner) : simulation(owner)
{
    // Exchanges first: copies point into their buffers, which must not move.
    exchanges.reserve(owner.wires_.size());
    for (const auto &process : owner.processes_) {
        std::vector<const Instance *> run;
        std::vector<const Task *> order;
        for (const Task &task : process->tasks_) {
            order.push_back(&task);
        }
        std::stable_sort(order.begin(), order.end(),
                         [](const Task *a, const Task *b) { return a->priority > b->priority; });
        for (const Task *task : order) {
            RunTask entry{task, process.get(), static_cast<std::uint32_t>(steps.size()), 0, task->period, task->offset};
            for (const auto &instance : task->run) {
                run.push_back(instance.get());
                const auto first = static_cast<std::uint32_t>(copies.size());
                lay_out_wires(*instance);
                const auto last = static_cast<std::uint32_t>(copies.size());
                if (Model *model = instance->model()) {
                    steps.push_back({update_model, model, first, last});
                } else {
                    steps.push_back({update_of(*instance), instance->memory(), first, last});
                }
            }
            entry.last_step = static_cast<std::uint32_t>(steps.size());
            tasks.push_back(entry);
        }
        for (const auto &instance : process->instances_) {
            known.emplace_back(instance.get(), parameters(*instance));
            if (!instance->model() && std::find(run.begin(), run.end(), instance.get()) == run.end()) {
                Configuration module{instance.get(), {}};
                for (const Wire &wire : owner.wires_) {
                    if (wire.from.instance == instance) {
                        module.copies.push_back(copy_of(wire, words(wire.from.bytes())));
                        module.copies.back().stale_after = 0; // it does not age
                    }
                }
                configuration.push_back(std::move(module));
            }
        }
    }
}

/// The wires into an instance, then those into the parts that it advances.
void Simulation::Runtime::lay_out_wires(const Instance &consumer)
{
    const auto in_task = [&](const Instance &producer) {
        const Process &process = process_of(simulation, producer);
        return producer.model() || std::any_of(process.tasks_.begin(), process.tasks_.end(), [&](const Task &task) {
                   return std::any_of(task.run.begin(), task.run.end(),
                                      [&](const auto &i) { return i.get() == &producer; });
               });
    };
    for (const Wire &wire : simulation.wires_) {
        if (wire.to.instance.get() != &consumer || !in_task(*wire.from.instance)) {
            continue; // what a configuration module says is carried when it changes
        }
        const Word *from = words(wire.from.bytes());
        if (wire.options.latency) {
            const std::uint32_t n = wire.from.field->size / 8;
            const Ns period = std::max(longest_period(process_of(simulation, *wire.from.instance)),
                                       longest_period(process_of(simulation, consumer)));
            exchanges.push_back({from, n, period, -1, std::vector<std::uint64_t>(n)});
            from = exchanges.back().held.data();
        }
        copies.push_back(copy_of(wire, from));
    }
    if (consumer.model()) {
        for (const Model *part : consumer.model()->parts()) {
            for (const auto &instance : process_of(simulation, consumer).instances_) {
                if (instance->model() == part) {
                    lay_out_wires(*instance);
                }
            }
        }
    }
}

void Simulation::Runtime::reset(Ns after)
{
    const Ns start = std::max<Ns>(after, 0);
    now = after;
    failure.clear();
    pace = {};
    for (const Wire &wire : simulation.wires_) {
        std::memset(wire.to.bytes(), 0, wire.to.field->size);
    }
    for (const auto &process : simulation.processes_) {
        process->ran_ = -1;
        process->mode_ = process->initial_;
        process->pending_ = -1;
        std::vector<Model *> parts;
        for (const auto &instance : process->instances_) {
            if (instance->model()) {
                const auto own = instance->model()->parts();
                parts.insert(parts.end(), own.begin(), own.end());
            }
        }
        for (const auto &instance : process->instances_) {
            if (!instance->model()) {
                reset_of (*instance)(instance->memory());
            } else if (std::find(parts.begin(), parts.end(), instance->model()) == parts.end()) {
                instance->model()->reset(start);
            }
        }
        for (const auto &event : process->events_) {
            event->armed = true;
            event->from = 0;
            event->since = event->fired_at = -1;
        }
    }
    for (RunTask &task : tasks) {
        task.active = task.process->active(*task.task, task.process->mode_);
        task.next = on_grid(task, after + 1);
        task.last = -1;
    }
    for (const Configuration &module : configuration) {
        publish(module, start);
    }
    for (Exchange &exchange : exchanges) {
        copy_words(exchange.from, exchange.held.data(), exchange.words);
        exchange.done = -1;
    }
    next = next_instant();
}

void Simulation::Runtime::publish(const Configuration &module, Ns t)
{
    update_of (*module.instance)(module.instance->memory(), {t, 0});
    for (const Copy &copy : module.copies) {
        carry(copy, t);
    }
}

bool Simulation::Runtime::parameters_changed() const
{
    return std::any_of(known.begin(), known.end(),
                       [](const auto &entry) { return !unchanged(*entry.first, entry.second); });
}

void Simulation::Runtime::take_parameters()
{
    std::string faults;
    std::vector<Instance *> changed;
    for (auto &[instance, seen] : known) {
        if (!unchanged(*instance, seen)) {
            try {
                check_parameters(*instance);
                changed.push_back(instance);
            } catch (const SetupError &error) {
                faults += (faults.empty() ? "" : "\n") + std::string(error.what());
            }
        }
    }
    if (!faults.empty()) {
        throw SetupError(faults);
    }
    for (Instance *instance : changed) {
        if (instance->model()) {
            instance->model()->refresh();
        }
        for (const Configuration &module : configuration) {
            if (module.instance == instance) {
                publish(module, std::max<Ns>(now, 0));
            }
        }
        for (auto &[other, seen] : known) {
            if (other == instance) {
                seen = parameters(*instance);
            }
        }
    }
}

void Simulation::Runtime::ready_for(Ns t)
{
    if (!failure.empty()) {
        throw RunError("the run ended: " + failure + "\nreset it, or restore a snapshot");
    }
    take_parameters();
    std::string faults;
    for (const auto &process : simulation.processes_) {
        for (const auto &instance : process->instances_) {
            if (instance->model()) {
                try {
                    instance->model()->ensure_data_until(t);
                } catch (const SetupError &error) {
                    faults += (faults.empty() ? "" : "\n") + std::string(error.what());
                }
            }
        }
    }
    if (!faults.empty()) {
        throw SetupError(faults);
    }
}

/// The next instant of a task, in the mode that its process is in or was asked to enter.
Ns Simulation::Runtime::next_of(const RunTask &task) const
{
    const Process &process = *task.process;
    if (task.active) {
        return task.next;
    }
    return simulation.mode_asked_ && process.pending_ >= 0 && process.active(*task.task, process.pending_)
               ? on_grid(task, now + 1)
               : never;
}

Ns Simulation::Runtime::next_instant() const
{
    Ns t = never;
    for (const RunTask &task : tasks) {
        t = std::min(t, next_of(task));
    }
    return t;
}

/// Enter the mode that was asked for, if this is an instant of the process: those of others are not seen
/// by its computer. Called in its turn, so that who runs before it sees nothing of it yet.
void Simulation::Runtime::enter_mode(Process &process, Ns t)
{
    const auto its_own = [&](const RunTask &task) { return task.process == &process && next_of(task) == t; };
    if (std::none_of(tasks.begin(), tasks.end(), its_own)) {
        return;
    }
    process.mode_ = process.pending_;
    process.pending_ = -1;
    for (RunTask &task : tasks) {
        if (task.process != &process) {
            continue;
        }
        const bool active = process.active(*task.task, process.mode_);
        if (active && !task.active) {
            for (const auto &instance : task.task->run) {
                if (instance->model()) {
                    instance->model()->reset(t);
                } else {
                    reset_of (*instance)(instance->memory());
                }
            }
            task.next = on_grid(task, t);
            task.last = -1;
        }
        task.active = active;
    }
}

inline void Simulation::Runtime::run_task(RunTask &task, Ns t)
{
    const Tick tick{t, task.last < 0 ? 0 : t - task.last};
    for (std::uint32_t i = task.first_step; i < task.last_step; i++) {
        const Step &step = steps[i];
        for (std::uint32_t k = step.first_copy; k < step.last_copy; k++) {
            carry(copies[k], t);
        }
        step.update(step.self, tick);
    }
    task.process->ran_ = t;
    task.last = t;
    task.next = t + task.period;
}

void Simulation::Runtime::run_events(Ns t)
{
    bool fired = true;
    while (fired) {
        fired = false;
        for (const auto &process : simulation.processes_) {
            if (process->ran_ != t) {
                continue; // flight looks at its events when flight runs, here as on its own computer
            }
            for (std::size_t i = 0; i < process->events_.size(); i++) {
                if (Event &e = *process->events_[i]; t < e.from || (e.once && !e.armed)) {
                    e.since = -1;
                    continue;
                }
                // By index and by copy of the pointer: an action may add events.
                const std::shared_ptr<Event> event = process->events_[i];
                if (!(event->condition ? event->condition->holds() : event->predicate())) {
                    event->since = -1;
                    event->armed = event->armed || !event->once;
                    continue;
                }
                if (event->since < 0) {
                    event->since = t;
                }
                if (!event->armed || t - event->since < event->hold) {
                    continue;
                }
                if (event->fired_at == t) {
                    throw RunError("event " + process->name + "." + event->name + " fires again at " + format_time(t) +
                                   ", the instant at which it fired: " +
                                   (event->condition ? event->condition->text + " holds" : "its condition holds") +
                                   " and it was armed anew");
                }
                event->armed = false;
                event->fired_at = t;
                fired = true;
                if (!event->mode.empty()) {
                    process->enter(event->mode);
                }
                if (event->action) {
                    event->action();
                }
            }
        }
    }
}

void Simulation::Runtime::instant()
{
    const Ns t = next;
    for (Exchange &exchange : exchanges) {
        // What stood there at the last multiple of its period before t.
        const Ns due = t > 0 ? (t - 1) / exchange.period * exchange.period : -1;
        if (due > exchange.done) {
            exchange.done = due;
            copy_words(exchange.from, exchange.held.data(), exchange.words);
        }
    }
    for (RunTask &task : tasks) {
        if (simulation.mode_asked_ && task.process->pending_ >= 0) {
            enter_mode(*task.process, t);
        }
        if (task.active && task.next == t) {
            run_task(task, t);
        }
    }
    if (simulation.mode_asked_) {
        simulation.mode_asked_ = std::any_of(simulation.processes_.begin(), simulation.processes_.end(),
                                             [](const auto &process) { return process->pending_ >= 0; });
    }
    now = t;
    if (simulation.has_events_) {
        run_events(t);
    }
    simulation.recorder_.take(t);
    next = next_instant();
}

bool Simulation::Runtime::run_until(Ns t, const RunControl &control)
{
    using Clock = std::chrono::steady_clock;
    using namespace std::chrono_literals;
    const auto start = Clock::now();
    const Ns simulated_start = std::max<Ns>(now, 0);
    auto polled = start;
    int until_look = 1; // the clock is read now and then only: it costs as much as a small update
    const auto polite = [&](Clock::time_point at) {
        if (control.poll && at - polled >= 50ms) {
            polled = at;
            return control.poll(now);
        }
        return true;
    };
    try {
        while (next <= t) {
            if (control.pace > 0.0) {
                const auto due = start + std::chrono::nanoseconds(static_cast<Ns>(
                                             static_cast<double>(next - simulated_start) / control.pace));
                auto at = Clock::now();
                pace.instants++;
                pace.overruns += at - due > 1ms;
                pace.worst = std::max<Ns>(pace.worst, (at - due) / 1ns);
                while (at < due) {
                    const auto until = std::min(due, at + 50ms).time_since_epoch();
                    const timespec wake{until / 1s, (until % 1s) / 1ns};
                    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &wake, nullptr);
                    at = Clock::now();
                    if (!polite(at)) {
                        return false;
                    }
                }
            } else if (--until_look == 0) {
                until_look = 256;
                if (!polite(Clock::now())) {
                    return false;
                }
            }
            instant();
        }
    } catch (const std::exception &error) {
        failure = error.what();
        failure.resize(std::min(failure.size(), failure.find('\n'))); // Python adds a traceback
        throw;
    }
    return true;
}

// ---- snapshots: one walk over all that changes, for saving and for restoring alike

void Simulation::Runtime::shape(const std::function<void(void *, std::size_t)> &block) const
{
    auto &self = const_cast<Runtime &>(*this);
    const auto value = [&](auto &x) { block(&x, sizeof x); };
    value(self.now);
    value(self.next);
    for (RunTask &task : self.tasks) {
        value(task.next);
        value(task.last);
        value(task.active);
    }
    for (Exchange &exchange : self.exchanges) {
        value(exchange.done);
        block(exchange.held.data(), exchange.words * sizeof(Word));
    }
    for (const auto &process : simulation.processes_) {
        value(process->mode_);
        value(process->pending_);
        for (const auto &event : process->events_) {
            value(event->armed);
            value(event->since);
            value(event->fired_at);
        }
        for (const auto &instance : process->instances_) {
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

std::uint64_t Simulation::Runtime::shape_hash() const
{
    std::uint64_t hash = 0xcbf29ce484222325u; // FNV-1a, by words
    const auto mix = [&](std::uint64_t x) { hash = (hash ^ x) * 0x100000001b3u; };
    for (const auto &process : simulation.processes_) {
        for (const auto &instance : process->instances_) {
            mix(instance->type().hash);
        }
    }
    shape([&](void *, std::size_t n) { mix(n); });
    return hash;
}

std::vector<std::byte> Simulation::Runtime::save() const
{
    const std::uint64_t hash = shape_hash();
    std::vector<std::byte> bytes;
    append(bytes, &hash, sizeof hash);
    shape([&](void *p, std::size_t n) { append(bytes, p, n); });
    return bytes;
}

void Simulation::Runtime::restore(std::span<const std::byte> bytes)
{
    const std::uint64_t expected = shape_hash();
    std::uint64_t hash = 0;
    std::size_t size = sizeof hash;
    shape([&](void *, std::size_t n) { size += n; });
    if (bytes.size() >= sizeof hash) {
        std::memcpy(&hash, bytes.data(), sizeof hash);
    }
    if (hash != expected || bytes.size() != size) {
        throw SetupError("this snapshot (" + std::to_string(bytes.size()) +
                         " bytes) is of a simulation with other modules, tasks or events; this one's have " +
                         std::to_string(size) + " bytes");
    }
    const std::byte *from = bytes.data() + sizeof hash;
    shape([&](void *p, std::size_t n) {
        std::memcpy(p, from, n);
        from += n;
    });
    failure.clear();
    simulation.mode_asked_ = true; // perhaps: the processes know
    // What models derive from their parameters follows the restored ones.
    for (auto &[instance, seen] : known) {
        if (instance->model() && !unchanged(*instance, seen)) {
            instance->model()->refresh();
        }
        seen = parameters(*instance);
    }
    simulation.recorder_.rewind(now);
}

// ---- what Simulation hands on to it

void Simulation::reset()
{
    // Anew from the parameters as they are now: they may have changed what models make room for.
    runtime_.reset();
    prepare();
}

void Simulation::begin_after(Ns t)
{
    reset();
    runtime_->reset(t);
    recorder_.rewind(t);
}

Ns Simulation::now() const
{
    return runtime_ ? runtime_->now : -1;
}

Ns Simulation::next() const
{
    return runtime_ ? runtime_->next : 0;
}

void Simulation::ready_for(Ns t)
{
    if (runtime_ && runtime_->now < 0 && runtime_->parameters_changed()) {
        reset(); // initial states are parameters too
    }
    prepare();
    runtime_->ready_for(t);
}

bool Simulation::run_until(Ns t, const RunControl &control)
{
    ready_for(t);
    Ns shortest = Runtime::never;
    for (const RunTask &task : runtime_->tasks) {
        shortest = std::min(shortest, task.period);
    }
    recorder_.reserve(runtime_->now, t, shortest);
    return runtime_->run_until(t, control);
}

void Simulation::step()
{
    prepare();
    if (runtime_->next == Runtime::never) {
        throw SetupError("no task is active: there is nothing to step");
    }
    run_until(runtime_->next);
}

PaceReport Simulation::pace_report() const
{
    return runtime_ ? runtime_->pace : PaceReport{};
}

std::vector<std::byte> Simulation::snapshot() const
{
    if (!runtime_) {
        throw SetupError("there is nothing to take a snapshot of before the simulation is prepared; "
                         "run or reset it first");
    }
    return runtime_->save();
}

void Simulation::restore(std::span<const std::byte> bytes)
{
    prepare();
    runtime_->restore(bytes);
}

} // namespace fledge::sim
