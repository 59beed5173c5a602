// SPDX-License-Identifier: Apache-2.0
// Set-up: what may be joined to what, and what must be there before a run. The loop itself is in
// runtime.cpp.
#include "sim/simulation.h"

#include "flight/exec/event.h"
#include "sim/runtime.h"
#include "sim/text.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <iterator>
#include <unordered_map>

namespace fledge::sim {

namespace {

bool same_type(const FledgeStruct *a, const FledgeStruct *b)
{
    // Two libraries may each hold a table of the same message.
    return a == b || (a && b && a->hash == b->hash && !std::strcmp(a->name, b->name));
}

template <class T> T element(const std::byte *p)
{
    T value;
    std::memcpy(&value, p, sizeof value);
    return value;
}

/// The paths of all ports of a type, for messages.
std::vector<std::string> outputs_of_type(const Simulation &simulation, const FledgeStruct *type)
{
    std::vector<std::string> paths;
    for (const auto &process : simulation.processes()) {
        for (const auto &instance : process->instances()) {
            for (const FledgeField &field : fields(instance->type())) {
                if (field.group == FLEDGE_OUT && same_type(field.sub, type)) {
                    paths.push_back(instance->path + "." + field.name);
                }
            }
        }
    }
    return paths;
}

/// Inputs that must differ, such as two bodies to point at, and do not: wired to one output, or to
/// two that say the same at the start. "" if there are none.
std::string coincident_inputs(const Simulation &simulation)
{
    std::string faults;
    for (const Wire &wire : simulation.wires()) {
        const char *distinct = wire.to.field->distinct;
        if (!distinct) {
            continue;
        }
        for (const Wire &other : simulation.wires()) {
            if (other.to.instance != wire.to.instance || std::strcmp(other.to.field->name, distinct)) {
                continue;
            }
            const std::byte *one = wire.from.bytes(), *two = other.from.bytes();
            const auto written = [](const std::byte *message) {
                return element<Head>(message).quality != QUALITY_NONE;
            };
            const bool same = one == two || (written(one) && written(two) &&
                                             !std::memcmp(one + sizeof(Head), two + sizeof(Head),
                                                          wire.to.field->size - sizeof(Head)));
            if (same) {
                faults += (faults.empty() ? "" : "\n") + wire.to.path() + " must differ from " + other.to.path() +
                          ": " + wire.from.path() +
                          (one == two ? " feeds both" : " and " + other.from.path() + " say the same");
            }
        }
    }
    return faults;
}

} // namespace

std::string Port::path() const
{
    return instance->path + "." + field->name;
}

bool Condition::holds() const
{
    const std::byte *p = instance->memory() + offset;
    double value = element_read(type, p);
    if (measure != Measure::element) {
        const double *x = reinterpret_cast<const double *>(p);
        if (type != FLEDGE_F64) {
            static thread_local std::vector<double> numbers;
            numbers.resize(elements);
            for (std::size_t i = 0; i < elements; i++) {
                numbers[i] = element_read(type, p + i * element_size(type));
            }
            x = numbers.data();
        }
        value = measure == Measure::norm ? exec_norm(x, elements) : exec_max_abs(x, elements);
    }
    switch (comparison) {
    case Comparison::less: return value < constant;
    case Comparison::less_equal: return value <= constant;
    case Comparison::greater: return value > constant;
    case Comparison::greater_equal: return value >= constant;
    case Comparison::equal: return value == constant;
    case Comparison::not_equal: return value != constant;
    }
    return false;
}

Simulation::Simulation(std::uint64_t seed) : seed_(seed) {}
Simulation::~Simulation() = default;

Process &Simulation::add_process(const std::string &name)
{
    set_up_again();
    for (const auto &process : processes_) {
        if (process->name == name) {
            throw SetupError("process " + name + " is already there");
        }
    }
    processes_.push_back(std::unique_ptr<Process>(new Process(*this, name)));
    return *processes_.back();
}

Process &Simulation::process(std::string_view name)
{
    std::vector<std::string> names;
    for (const auto &process : processes_) {
        if (process->name == name) {
            return *process;
        }
        names.push_back(process->name);
    }
    throw SetupError("there is no process " + std::string(name) + "; there are " + format_list(names));
}

void Simulation::connect(const Port &from, const Port &to, WireOptions options)
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
                         "; outputs of that type: " + format_list(outputs_of_type(*this, to.field->sub)));
    }
    if (options.latency != 0 && options.latency != 1) {
        throw SetupError(wire + ": latency must be 0 or 1, found " + std::to_string(options.latency));
    }
    if (options.stale_after < 0) {
        throw SetupError(wire + ": stale_after must be >= 0, found " + format_time(options.stale_after));
    }
    for (const Wire &other : wires_) {
        if (other.to.instance == to.instance && other.to.field == to.field) {
            throw SetupError(wire + ": " + to.path() + " is already written by " + other.from.path());
        }
    }
    set_up_again();
    wires_.push_back({from, to, options});
}

void Simulation::set_seed(std::uint64_t seed)
{
    set_up_again();
    seed_ = seed;
}

void Simulation::set_up_again()
{
    if (runtime_ && runtime_->now >= 0) {
        throw SetupError("the simulation has run until " + format_time(runtime_->now) +
                         "; reset it before its structure or seed changes");
    }
    runtime_.reset();
}

void Simulation::prepare()
{
    if (runtime_) {
        return;
    }
    std::string faults;
    const auto fault = [&](const std::string &text) { faults += (faults.empty() ? "" : "\n") + text; };
    const auto collect = [&](const auto &check) {
        try {
            check();
        } catch (const SetupError &error) {
            fault(error.what());
        }
    };

    for (const auto &process : processes_) {
        // Models that others advance, and instances that stand in a task.
        std::vector<const Model *> parts;
        std::vector<const Instance *> run;
        for (const auto &instance : process->instances_) {
            if (instance->model()) {
                const auto own = instance->model()->parts();
                parts.insert(parts.end(), own.begin(), own.end());
            }
        }
        for (const Task &task : process->tasks_) {
            for (const auto &instance : task.run) {
                run.push_back(instance.get());
            }
        }
        for (const auto &instance : process->instances_) {
            const bool is_part =
                instance->model() && std::find(parts.begin(), parts.end(), instance->model()) != parts.end();
            const bool in_task = std::find(run.begin(), run.end(), instance.get()) != run.end();
            const bool has_inputs = !field_names(instance->type(), FLEDGE_IN).empty();
            if (is_part && in_task) {
                fault(instance->path + " is part of another model, which advances it: take it out of its task");
            } else if (!is_part && !in_task && (instance->model() || has_inputs)) {
                fault(instance->path + " is in no task");
            }
            collect([&] { check_parameters(*instance); });
            for (const FledgeField &field : fields(instance->type())) {
                const auto feeds = [&](const Wire &wire) {
                    return wire.to.instance == instance && wire.to.field == &field;
                };
                if (field.group == FLEDGE_IN && !(field.flags & FLEDGE_OPTIONAL) &&
                    std::none_of(wires_.begin(), wires_.end(), feeds)) {
                    fault(instance->path + "." + field.name + " is not wired; outputs of its type " + field.sub->name +
                          ": " + format_list(outputs_of_type(*this, field.sub)));
                }
            }
        }
    }
    if (!faults.empty()) {
        throw SetupError(faults);
    }
    for (const auto &process : processes_) {
        for (const auto &instance : process->instances_) {
            if (Model *model = instance->model()) {
                collect([&] { model->prepare({instance->path, seed_, process->integrator_.get()}); });
            }
        }
    }
    if (!faults.empty()) {
        throw SetupError(faults);
    }
    runtime_ = std::make_unique<Runtime>(*this);
    runtime_->reset();
    recorder_.reset();
    if (const std::string coincident = coincident_inputs(*this); !coincident.empty()) {
        runtime_.reset();
        throw SetupError(coincident);
    }
}

std::unique_ptr<Simulation> Simulation::clone() const
{
    auto copy = std::make_unique<Simulation>(seed_);
    std::unordered_map<const Instance *, std::shared_ptr<Instance>> twin;
    std::unordered_map<const Model *, Model *> model;
    for (const auto &process : processes_) {
        Process &other = copy->add_process(process->name);
        other.integrator_ = process->integrator_;
        for (const auto &instance : process->instances_) {
            auto &twin_instance = twin[instance.get()] = instance->twin();
            other.instances_.push_back(twin_instance);
            if (instance->model()) {
                model[instance->model()] = twin_instance->model();
            }
        }
        for (Task task : process->tasks_) {
            for (auto &instance : task.run) {
                instance = twin.at(instance.get());
            }
            other.tasks_.push_back(std::move(task));
        }
        other.modes_ = process->modes_;
        other.mode_ = process->mode_;
        other.pending_ = process->pending_;
        other.initial_ = process->initial_;
    }
    copy->mode_asked_ = mode_asked_;
    copy->has_events_ = has_events_;
    // Events may watch the instances of any process, so all twins must be there.
    for (std::size_t i = 0; i < processes_.size(); i++) {
        for (const auto &event : processes_[i]->events_) {
            auto other = std::make_shared<Event>(*event);
            if (other->condition) {
                other->condition->instance = twin.at(other->condition->instance.get());
            }
            copy->processes_[i]->events_.push_back(std::move(other));
        }
    }
    for (const auto &[original, counterpart] : model) {
        counterpart->copy_setup(*original, [&](const Model *m) { return model.at(m); });
    }
    for (Wire wire : wires_) {
        wire.from.instance = twin.at(wire.from.instance.get());
        wire.to.instance = twin.at(wire.to.instance.get());
        copy->wires_.push_back(std::move(wire));
    }
    if (runtime_) {
        copy->prepare();
        copy->restore(snapshot());
    }
    return copy;
}

std::vector<std::pair<std::string, std::string>> Simulation::ties(std::string_view process) const
{
    std::vector<std::pair<std::string, std::string>> found;
    for (const auto &one : processes_) {
        const auto foreign = [&](const auto &is_it) -> const Instance * {
            for (const auto &other : processes_) {
                for (const auto &instance : other->instances_) {
                    if (other != one && is_it(*instance)) {
                        return instance.get();
                    }
                }
            }
            return nullptr;
        };
        // Whichever of the two is kept, the tie is broken.
        const auto tie = [&](const std::string &what, const Instance *whose) {
            if (whose &&
                (process.empty() || one->name == process || whose->path.starts_with(std::string(process) + "."))) {
                found.emplace_back(what, whose->path);
            }
        };
        for (const auto &event : one->events_) {
            if (event->condition) {
                tie(one->name + "." + event->name,
                    foreign([&](const Instance &i) { return &i == event->condition->instance.get(); }));
            }
        }
        for (const auto &instance : one->instances_) {
            if (!instance->model()) {
                continue;
            }
            // A copy of the model asks for all others that it depends on.
            const auto twin = instance->twin();
            twin->model()->copy_setup(*instance->model(), [&](const Model *model) {
                tie(instance->path, foreign([&](const Instance &i) { return i.model() == model; }));
                return const_cast<Model *>(model);
            });
        }
    }
    return found;
}

void Simulation::keep(const std::string &process)
{
    const Process &kept = this->process(process);
    std::string faults;
    for (const auto &[what, whose] : ties(process)) {
        faults += (faults.empty() ? "" : "\n") + what + " depends on " + whose + ", of another process";
    }
    if (!faults.empty()) {
        throw SetupError(faults);
    }
    set_up_again();
    const auto goes = [&](const Instance &instance) { return kept.find(instance.name).get() != &instance; };
    std::erase_if(wires_, [&](const Wire &wire) { return goes(*wire.from.instance) || goes(*wire.to.instance); });
    recorder_.forget([&](const Log &log) { return goes(*log.instance); });
    const auto rest = std::stable_partition(processes_.begin(), processes_.end(),
                                            [&](const auto &one) { return one.get() == &kept; });
    left_.insert(left_.end(), std::make_move_iterator(rest), std::make_move_iterator(processes_.end()));
    processes_.erase(rest, processes_.end());
    has_events_ = !kept.events_.empty();
    mode_asked_ = kept.pending_ >= 0;
}

std::vector<std::string> Simulation::assumptions() const
{
    std::vector<std::string> lines;
    for (const auto &process : processes_) {
        for (const auto &instance : process->instances_) {
            if (instance->model()) {
                for (const std::string &line : instance->model()->assumptions()) {
                    lines.push_back(instance->path + "." + line);
                }
            }
            const FledgeStruct &type = instance->type();
            for (std::size_t i = 0; i < type.n; i++) {
                const FledgeField &field = type.fields[i];
                const std::byte *bytes = instance->memory() + field.offset;
                if (field.flags & FLEDGE_ASSUMED && !instance->given[i] &&
                    std::all_of(bytes, bytes + field.size, [](std::byte b) { return b == std::byte{0}; })) {
                    const std::string unit = std::strcmp(field.unit, "-") ? " " + std::string(field.unit) : "";
                    lines.push_back(instance->path + "." + field.name + " was left at 0" + unit + ": " + field.doc);
                }
            }
        }
    }
    return lines;
}

} // namespace fledge::sim
