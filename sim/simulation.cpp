// SPDX-License-Identifier: Apache-2.0
#include "sim/simulation.h"

#include "sim/runtime.h"
#include "sim/snapshot.h"
#include "sim/text.h"

#include <algorithm>
#include <cstring>
#include <iterator>
#include <set>
#include <unordered_map>

namespace fledge::sim {

Simulation::Simulation(std::uint64_t seed) : structure_{seed, {}, {}, {}} {}
Simulation::~Simulation() = default;

// ---- build

void Simulation::set_up_again()
{
    if (time() >= 0) {
        throw SetupError("the simulation has run until " + format_time(time()) +
                         "; reset it before its structure or seed changes");
    }
    runtime_.reset();
}

Process &Simulation::add_process(const std::string &name)
{
    set_up_again();
    for (const auto &process : processes()) {
        if (process->name == name) {
            throw SetupError("process " + name + " is already there");
        }
    }
    structure_.processes.push_back(std::unique_ptr<Process>(new Process(*this, name)));
    return *processes().back();
}

void Simulation::connect(const Port &from, const Port &to, const WireOptions &options)
{
    const std::string wire = from.path() + " >> " + to.path();
    for (const Port *port : {&from, &to}) {
        if (port->instance->name.empty()) {
            throw SetupError(wire + ": this " + port->instance->type().name +
                             " has no name yet; assign it to a process first");
        }
    }
    if (from.field->group != FLEDGE_OUT) {
        throw SetupError(wire + ": " + from.path() + " is not an output; " + from.instance->path + " has " +
                         format_list(field_names(from.instance->type(), FLEDGE_OUT)));
    }
    if (to.field->group != FLEDGE_IN) {
        throw SetupError(wire + ": " + to.path() + " is not an input; " + to.instance->path + " has " +
                         format_list(field_names(to.instance->type(), FLEDGE_IN)));
    }
    if (!same_type(from.field->sub, to.field->sub)) {
        throw SetupError(wire + ": " + to.path() + " takes " + to.field->sub->name + ", found " +
                         from.field->sub->name +
                         "; outputs of that type: " + format_list(structure_.outputs_of_type(to.field->sub)));
    }
    if (options.latency != 0 && options.latency != 1) {
        throw SetupError(wire + ": latency must be 0 or 1, found " + std::to_string(options.latency));
    }
    if (options.stale_after < 0) {
        throw SetupError(wire + ": stale_after must be >= 0, found " + format_time(options.stale_after));
    }
    if (options.latency && options.by != EXEC_SOLE) {
        throw SetupError(wire + ": a latency is for an input with one wire, this is one of several");
    }
    for (const Wire &other : structure_.wires) {
        if (other.to.instance == to.instance && other.to.field == to.field && !options.more) {
            throw SetupError(wire + ": " + to.path() + " is already written by " + other.from.path());
        }
    }
    if (structure_.feed_of(to)) {
        throw SetupError(wire + ": " + to.path() + " is fed by hand");
    }
    set_up_again();
    structure_.wires.push_back({from, to, options});
    to.set_fed(true);
}

void Simulation::feed(Feed feed)
{
    const Port &to = feed.to;
    const std::string path = to.path();
    const auto is_here = [&](const auto &process) { return process->find(to.instance->name) == to.instance; };
    if (to.field->group != FLEDGE_IN || std::none_of(processes().begin(), processes().end(), is_here)) {
        throw SetupError(path + " is no input of this simulation, and only inputs are fed by hand; " +
                         to.instance->path + " has " + format_list(field_names(to.instance->type(), FLEDGE_IN)));
    }
    for (const Wire &wire : wires()) {
        if (wire.to.instance == to.instance && wire.to.field == to.field) {
            throw SetupError(path + " cannot be fed by hand: " + wire.from.path() +
                             " already writes it; leave out that wire");
        }
    }
    if (feed.stale_after < 0) {
        throw SetupError("feed " + path + ": stale_after must be >= 0, found " + format_time(feed.stale_after));
    }
    if (feed.messages) {
        const Messages &messages = *feed.messages;
        messages.check("feed " + path, to.field->size);
        for (std::size_t i = 0; i < messages.times.size(); i++) {
            Head head;
            std::memcpy(&head, messages.message(i), sizeof head);
            for (const FledgeField &field : fields(*to.field->sub)) {
                if (head_written(head)) {
                    check_field(*to.field->sub, field, messages.message(i),
                                "feed " + path + " at " + format_time(messages.times[i]));
                }
            }
        }
    }
    const Feed *known = structure_.feed_of(to);
    if (!known || !known->messages || !feed.messages) {
        set_up_again();
    }
    to.set_fed(feed.messages != nullptr);
    if (!known) {
        structure_.feeds.push_back(std::move(feed));
        return;
    }
    structure_.feeds[static_cast<std::size_t>(known - structure_.feeds.data())] = std::move(feed);
    if (runtime_) {
        runtime_->feed_again();
    }
}

void Simulation::feed(const Port &input)
{
    set_up_again();
    std::erase_if(structure_.wires,
                  [&](const Wire &wire) { return wire.to.instance == input.instance && wire.to.field == input.field; });
    feed(Feed{input, nullptr, false, {}, 0, "the caller"});
}

void Simulation::set_seed(std::uint64_t seed)
{
    set_up_again();
    structure_.seed = seed;
}

// ---- run

/// What a model depends on: its parts, and the models that it calls.
static std::vector<const Model *> needed_by(const Instance &instance)
{
    std::vector<const Model *> models;
    // A copy calls this for each of them.
    instance.clone()->model()->copy_setup(*instance.model(), [&](const Model *needed) {
        models.push_back(needed);
        return const_cast<Model *>(needed);
    });
    return models;
}

std::vector<Problem> Simulation::problems()
{
    if (runtime_) {
        return {};
    }
    Faults faults;
    const std::set<const Instance *> bad = check(structure_, decide_roles(structure_), faults);
    std::set<const Model *> bad_models;
    for (const Instance *instance : bad) {
        bad_models.insert(instance->model());
    }
    for (const auto &process : processes()) {
        for (const auto &instance : process->instances()) {
            Model *model = instance->model();
            if (!model || bad.contains(instance.get())) {
                continue;
            }
            // A model computes with the parameters of those that it needs, within their rules.
            const auto is_bad = [&](const Model *needed) { return bad_models.contains(needed); };
            if (!bad.empty() && std::ranges::any_of(needed_by(*instance), is_bad)) {
                continue;
            }
            Setup setup{instance->path, seed(), &process->integrator()};
            for (const Wire &wire : structure_.wires) {
                if (wire.to.instance == instance) {
                    setup.wired.emplace_back(wire.to.field->name);
                }
            }
            for (const Feed &feed : structure_.feeds) {
                if (feed.to.instance == instance) {
                    setup.wired.emplace_back(feed.to.field->name);
                }
            }
            faults.collect([&] { model->prepare(setup); }, instance->at);
        }
    }
    std::vector<Problem> all = faults.all();
    std::ranges::stable_sort(all, {}, &Problem::at);
    return all;
}

void Simulation::prepare()
{
    if (runtime_) {
        return;
    }
    if (const auto wrong = problems(); !wrong.empty()) {
        throw CompositionError(wrong);
    }
    runtime_ = std::make_unique<Runtime>(structure_, decide_roles(structure_), recorder_, outputs_);
    try {
        runtime_->reset();
    } catch (...) { // a script's reset
        runtime_.reset();
        throw;
    }
    recorder_.reset();
    outputs_.reset();
    Faults faults;
    check_distinct(structure_, faults);
    if (!faults.all().empty()) {
        runtime_.reset();
        throw CompositionError(faults.all());
    }
}

void Simulation::reset()
{
    for (const auto &process : processes()) {
        process->requests = {};
    }
    // Prepare again, because the sizes of memory in the models may depend on changed parameters.
    runtime_.reset();
    prepare();
}

void Simulation::begin_after(Ns t)
{
    reset();
    runtime_->reset(t);
    recorder_.rewind(t);
    outputs_.rewind(t);
}

Ns Simulation::now() const
{
    return runtime_ ? runtime_->now : -1;
}

Ns Simulation::next() const
{
    return runtime_ ? runtime_->next : 0;
}

Ns Simulation::time() const
{
    return runtime_ ? runtime_->time() : -1;
}

Ns Simulation::next_of(Modules modules) const
{
    return runtime_->next_of(modules);
}

void Simulation::reach(Ns t)
{
    if (next() <= t) {
        throw RunError("the instant " + format_time(next()) + " has not run; " + format_time(t) + " comes after it");
    }
    runtime_->reached = std::max(runtime_->reached, t);
}

void Simulation::ready_for(Ns t)
{
    check_assigned(structure_, time() >= 0);
    if (runtime_ && runtime_->now < 0 && runtime_->parameters_changed()) {
        const Ns reached = runtime_->reached;
        const auto commands = [this](const std::function<void(std::byte *, std::size_t)> &block) {
            for (const auto &process : processes()) {
                if (const auto &own = runtime_->of(*process).commands) {
                    own->visit_state([&](void *p, std::size_t n) { block(static_cast<std::byte *>(p), n); });
                }
            }
        };
        std::vector<std::byte> waiting; // commands that were accepted
        commands([&](std::byte *p, std::size_t n) { waiting.insert(waiting.end(), p, p + n); });
        runtime_.reset(); // initial states are parameters too
        prepare();
        auto from = waiting.begin();
        commands([&](std::byte *p, std::size_t n) {
            std::copy_n(from, n, p);
            from += static_cast<std::ptrdiff_t>(n);
        });
        runtime_->reached = reached;
    }
    prepare();
    runtime_->ready_for(t);
}

bool Simulation::run_until(Ns t, const RunControl &control, Modules before)
{
    if (control.same_parameters && runtime_) {
        runtime_->ready_for(t, true);
    } else {
        ready_for(t);
    }
    if (recorder_.keeps()) {
        recorder_.reserve(runtime_->now, t, runtime_->shortest_period());
    }
    const bool whole = runtime_->run_until(t, control, before);
    if (recorder_.archiving()) {
        recorder_.save_archive(); // this program may now wait for a user, and be killed
    }
    return whole;
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

std::vector<Finding> Simulation::health() const
{
    std::vector<Finding> findings = structural_findings(structure_);
    if (runtime_) {
        const std::vector<Finding> seen = runtime_->health.findings();
        findings.insert(findings.end(), seen.begin(), seen.end());
    }
    std::stable_sort(findings.begin(), findings.end(),
                     [](const Finding &a, const Finding &b) { return a.first < b.first; });
    return findings;
}

void Simulation::open_outputs(const std::string &path)
{
    outputs_.forget([](const Log &) { return true; });
    const auto record = [&](const Instance &instance) {
        for (const FledgeField &field : fields(instance.type())) {
            if (field.group == FLEDGE_OUT) {
                const auto own = std::const_pointer_cast<Instance>(instance.shared_from_this());
                outputs_.record(own, field, 0, false)->changes = true;
            }
        }
    };
    for (const auto &process : processes()) {
        std::vector<const Instance *> run;
        for (const Task *task : in_order(*process)) {
            for (const auto &instance : task->run) {
                for (const Instance *part : with_parts(*process, *instance)) {
                    run.push_back(part);
                }
            }
        }
        for (const auto &instance : process->instances()) { // configuration, which is published first
            if (std::find(run.begin(), run.end(), instance.get()) == run.end()) {
                record(*instance);
            }
        }
        for (const Instance *instance : run) {
            record(*instance);
        }
    }
    outputs_.open_archive(path, {});
}

// ---- copy and divide

std::vector<std::byte> Simulation::snapshot() const
{
    if (!runtime_) {
        throw SetupError("there is nothing to take a snapshot of before the simulation is prepared; "
                         "run or reset it first");
    }
    return save(*runtime_);
}

std::size_t Simulation::snapshot_room() const
{
    return sim::snapshot_room(*runtime_);
}

void Simulation::restore(std::span<const std::byte> bytes, bool edited)
{
    prepare();
    sim::restore(*runtime_, bytes, edited);
    runtime_->set_begun(now() >= 0);
    recorder_.rewind(now());
    outputs_.rewind(now());
}

void Simulation::check_snapshot(std::span<const std::byte> bytes) const
{
    (void)sim::check_snapshot(*runtime_, bytes);
}

void Simulation::reseed()
{
    for (const auto &process : processes()) {
        for (const auto &instance : process->instances()) {
            if (instance->model()) {
                instance->model()->reseed();
            }
        }
    }
}

std::vector<Simulation::StateBlock> Simulation::state_blocks() const
{
    return runtime_ ? sim::state_blocks(*runtime_) : std::vector<StateBlock>{};
}

void Simulation::follow(bool next)
{
    prepare();
    for (const auto &process : processes()) {
        for (const Task &task : process->tasks()) {
            for (const auto &instance : task.run) {
                if (instance->model()) {
                    instance->model()->follow(next ? task.period : 0);
                }
            }
        }
    }
}

bool Simulation::override_input(const Port &input, std::uint32_t place, double value)
{
    prepare();
    return runtime_->override_input(input, place, value);
}

namespace {

/// Original -> clone.
struct Clones {
    std::unordered_map<const Instance *, std::shared_ptr<Instance>> instances;
    std::unordered_map<const Model *, Model *> models;

    const std::shared_ptr<Instance> &of(const std::shared_ptr<Instance> &instance) const
    {
        return instances.at(instance.get());
    }
};

} // namespace

std::unique_ptr<Simulation> Simulation::clone() const
{
    auto copy = std::make_unique<Simulation>(seed());
    Clones clones;
    for (const auto &process : processes()) {
        if (process->flight_ && !process->computer_) {
            throw SetupError(process->name +
                             " is flown by a computer outside of the simulation, which cannot be cloned");
        }
        Process &other = copy->add_process(process->name);
        other.stands_in = process->stands_in;
        other.integrator_ = process->integrator_;
        other.modes_ = process->modes_;
        other.initial_ = process->initial_;
        other.requests = process->requests;
        for (const auto &instance : process->instances_) {
            const auto &clone = clones.instances[instance.get()] = instance->clone();
            other.instances_.push_back(clone);
            if (instance->model()) {
                clones.models[instance->model()] = clone->model();
            }
        }
        for (const auto &[instance, playback] : process->playback_) {
            const auto &own = clones.instances.at(instance);
            other.playback_[own.get()] = {own->memory(), playback.outputs};
        }
        other.executive_.play_as(process->executive_);
        for (Task task : process->tasks_) {
            for (auto &instance : task.run) {
                instance = clones.of(instance);
            }
            other.tasks_.push_back(std::move(task));
        }
    }
    // What follows may use an instance of any process, so all clones must exist first.
    const auto replace = [&](std::shared_ptr<Instance> &instance) { instance = clones.of(instance); };
    for (std::size_t i = 0; i < processes().size(); i++) {
        const Process &process = *processes()[i];
        Process &other = *copy->processes()[i];
        for (Mode &mode : other.modes_) {
            if (mode.when) {
                mode.when->visit(replace);
            }
        }
        for (const auto &event : process.events_) {
            other.events_.push_back(std::make_shared<Event>(*event));
            other.events_.back()->visit(replace);
        }
        if (process.computer_) {
            std::vector<Shared> shared = process.shared_;
            for (Shared &each : shared) {
                replace(each.port.instance);
            }
            other.set_computer(clones.of(process.computer_), std::move(shared), process.request_);
        }
        other.dictionary_ = process.dictionary_;
        other.script_ = process.script_;
        other.played_telemetry_ = process.played_telemetry_;
        other.keys = process.keys;
        if (const auto &line = process.reset_) {
            other.reset_ = ResetLine{{clones.of(line->input.instance), line->input.field}, line->down};
        }
    }
    for (const auto &[original, counterpart] : clones.models) {
        counterpart->copy_setup(*original, [&](const Model *model) { return clones.models.at(model); });
    }
    for (Wire wire : wires()) {
        replace(wire.from.instance);
        replace(wire.to.instance);
        copy->structure_.wires.push_back(std::move(wire));
    }
    for (Feed feed : feeds()) {
        replace(feed.to.instance);
        copy->structure_.feeds.push_back(std::move(feed));
    }
    if (runtime_) {
        copy->prepare();
        copy->restore(snapshot());
    }
    return copy;
}

void Simulation::isolate(const std::string &name)
{
    const Process &isolated = process(name);
    Faults faults;
    for (const auto &[what, other] : cross_process_dependencies(name)) {
        faults.add(what + " depends on " + other + ", of another process");
    }
    faults.raise();
    set_up_again();
    const auto removed = [&](const Instance &instance) {
        return isolated.find(instance.name).get() != &instance && isolated.executive().instance().get() != &instance;
    };
    std::erase_if(structure_.wires, [&](const Wire &wire) {
        const bool gone = removed(*wire.from.instance) || removed(*wire.to.instance);
        if (gone) {
            wire.to.set_fed(false);
        }
        return gone;
    });
    std::erase_if(structure_.feeds, [&](const Feed &feed) { return removed(*feed.to.instance); });
    recorder_.forget([&](const Log &log) { return removed(*log.instance); });
    auto &all = structure_.processes;
    const auto rest =
        std::stable_partition(all.begin(), all.end(), [&](const auto &process) { return process.get() == &isolated; });
    removed_.insert(removed_.end(), std::make_move_iterator(rest), std::make_move_iterator(all.end()));
    all.erase(rest, all.end());
}

} // namespace fledge::sim
