// SPDX-License-Identifier: Apache-2.0
#include "sim/structure.h"

#include "sim/text.h"

#include <algorithm>
#include <cstring>
#include <functional>

namespace fledge::sim {

std::string Port::path() const
{
    return instance->path + "." + field->name;
}

void Port::set_fed(bool fed) const
{
    instance->fed[static_cast<std::size_t>(field - instance->type().fields)] = fed;
}

std::string Mode::guard() const
{
    std::string text;
    for (const std::string &mode : after) {
        text += (text.empty() ? "after " : " or ") + mode;
    }
    return text + (when && !text.empty() ? ", " : "") + (when ? "if " + when->text() : "");
}

void Event::visit(const std::function<void(std::shared_ptr<Instance> &)> &f)
{
    for (std::optional<Condition> *part : {&condition, &until}) {
        if (*part) {
            (*part)->visit(f);
        }
    }
    for (Setting &setting : set) {
        f(setting.instance);
    }
}

std::size_t Messages::until(Ns t) const
{
    return static_cast<std::size_t>(std::upper_bound(times.begin(), times.end(), t) - times.begin());
}

void Messages::check(const std::string &path, std::size_t size) const
{
    const auto falls = std::adjacent_find(times.begin(), times.end(), std::greater_equal<>());
    if (falls != times.end()) {
        throw SetupError(path + ": the times of messages must rise; found " + format_time(falls[0]) + ", then " +
                         format_time(falls[1]));
    }
    if (bytes.size() != times.size() * size) {
        throw SetupError(path + ": expected a message of " + std::to_string(size) + " bytes for each time");
    }
}

const Feed *Structure::feed_of(const Port &input) const
{
    const auto found = std::find_if(feeds.begin(), feeds.end(), [&](const Feed &feed) {
        return feed.to.instance == input.instance && feed.to.field == input.field;
    });
    return found == feeds.end() ? nullptr : &*found;
}

bool same_type(const FledgeStruct *a, const FledgeStruct *b)
{
    // Two libraries may each hold a table of the same message.
    return a == b || (a && b && a->hash == b->hash && !std::strcmp(a->name, b->name));
}

Process &Structure::process(std::string_view name) const
{
    std::vector<std::string> names;
    for (const auto &process : processes) {
        if (process->name == name) {
            return *process;
        }
        names.push_back(process->name);
    }
    throw SetupError("there is no process " + std::string(name) + "; there are " + format_list(names));
}

std::vector<Carrier *> Structure::carriers(const Process &of) const
{
    std::vector<Carrier *> all;
    for (const auto &process : processes) {
        for (const auto &instance : process->instances()) {
            auto *carrier = dynamic_cast<Carrier *>(instance->model());
            if (carrier && carrier->serves() == of.name) {
                all.push_back(carrier);
            }
        }
    }
    return all;
}

std::vector<std::string> Structure::outputs_of_type(const FledgeStruct *type) const
{
    std::vector<std::string> paths;
    for (const auto &process : processes) {
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

Roles decide_roles(const Structure &structure)
{
    Roles roles;
    for (const auto &process : structure.processes) {
        std::map<const Model *, const Instance *> models;
        for (const auto &instance : process->instances()) {
            roles[instance.get()].process = process.get();
            models[instance->model()] = instance.get();
        }
        for (const Task &task : process->tasks()) {
            for (const auto &instance : task.run) {
                roles[instance.get()].scheduled = true;
            }
        }
        for (const auto &instance : process->instances()) {
            if (!instance->model()) {
                Role &role = roles[instance.get()];
                role.configuration = !role.scheduled;
                continue;
            }
            for (const Model *part : instance->model()->parts()) {
                if (const auto it = models.find(part); it != models.end()) {
                    roles[it->second].part = true;
                }
            }
        }
    }
    return roles;
}

std::vector<const Task *> in_order(const Process &process)
{
    std::vector<const Task *> order;
    for (const Task &task : process.tasks()) {
        order.push_back(&task);
    }
    std::stable_sort(order.begin(), order.end(),
                     [](const Task *a, const Task *b) { return a->priority > b->priority; });
    return order;
}

Ns longest_period(const Process &process)
{
    Ns longest = 0;
    for (const Task &task : process.tasks()) {
        longest = std::max(longest, task.period);
    }
    return longest;
}

std::string WireOptions::choice() const
{
    static constexpr const char *words[] = {"", "newest", "first", "best", "in "};
    return words[by] + mode;
}

std::vector<const Instance *> with_parts(const Process &process, const Instance &instance)
{
    std::vector<const Instance *> all{&instance};
    if (instance.model()) {
        for (const Model *part : instance.model()->parts()) {
            for (const auto &other : process.instances()) {
                if (other->model() == part) {
                    const auto more = with_parts(process, *other);
                    all.insert(all.end(), more.begin(), more.end());
                }
            }
        }
    }
    return all;
}

namespace {

/// Wires of several into one input.
void check_choices(const Structure &structure, const Roles &roles, Faults &faults)
{
    for (const Wire &wire : structure.wires) {
        const Role &from = roles.at(wire.from.instance.get()), &to = roles.at(wire.to.instance.get());
        const std::string choice = wire.from.path() + " >> " + wire.to.path() + ", " + wire.options.choice();
        if (wire.options.by == EXEC_SOLE) {
            continue;
        }
        const SourceLine &at = wire.options.at;
        if (from.process != to.process) {
            faults.add(choice + ": outputs to choose from are of the process of their reader, " + to.process->name +
                           "; let a module of it read this one",
                       at);
        }
        if (from.configuration) {
            faults.add(choice + ": no task runs " + wire.from.instance->path + ", so that it writes only once", at);
        }
        std::vector<std::string> modes;
        for (const Mode &mode : to.process->modes()) {
            modes.push_back(mode.name);
        }
        if (wire.options.by == EXEC_IN_MODE &&
            std::find(modes.begin(), modes.end(), wire.options.mode) == modes.end()) {
            faults.add(choice + ": the modes of " + to.process->name + " are " + format_list(modes), at);
        }
    }
}

} // namespace

std::set<const Instance *> check(const Structure &structure, const Roles &roles, Faults &faults)
{
    std::set<const Instance *> bad;
    check_choices(structure, roles, faults);
    for (const auto &process : structure.processes) {
        std::vector<std::string> modes;
        for (const Mode &mode : process->modes()) {
            modes.push_back(mode.name);
        }
        for (const Mode &mode : process->modes()) {
            for (const std::string &name : mode.after) {
                if (std::find(modes.begin(), modes.end(), name) == modes.end()) {
                    faults.add("mode " + process->name + "." + mode.name + " is entered after " + name +
                                   "; the modes of " + process->name + " are " + format_list(modes),
                               mode.at);
                }
            }
        }
        for (const auto &event : process->events()) {
            for (const auto &[name, on] : event->arms) {
                if (!process->event(name)) {
                    std::vector<std::string> names;
                    for (const auto &other : process->events()) {
                        names.push_back(other->name);
                    }
                    faults.add("event " + process->name + "." + event->name + (on ? " arms " : " disarms ") + name +
                                   "; the events of " + process->name + " are " + format_list(names),
                               event->at);
                }
            }
            for (const Setting &setting : event->set) {
                const FledgeField &field = *field_at(setting.instance->type(), setting.offset);
                if (field.group == FLEDGE_OUT && roles.at(setting.instance.get()).configuration) {
                    faults.add("event " + process->name + "." + event->name + " sets " + setting.instance->path + "." +
                                   field.name + ", which follows from the parameters of a module in no task: set those",
                               event->at);
                }
            }
        }
        for (const auto &instance : process->instances()) {
            if (instance == process->computer()) {
                continue; // it has what the modules have
            }
            const Role &role = roles.at(instance.get());
            const bool has_inputs = !field_names(instance->type(), FLEDGE_IN).empty();
            const char *whole = instance->model() ? instance->model()->part_of() : nullptr;
            const auto add = [&](const std::string &what) { faults.add(what, instance->at); };
            if (whole && !role.part) {
                add(std::string(instance->type().name) + " " + instance->path + " is a part of no " + whole +
                    ": add it to the `parts` of one, and to no task");
            } else if (role.part && role.scheduled) {
                add(instance->path + " is part of another model, which advances it: take it out of its task");
            } else if (!role.part && !role.scheduled && (!role.configuration || has_inputs)) {
                add(instance->path + " is in no task: name it in the `run` of one, or leave it out");
            }
            if (!faults.collect([&] { check_parameters(*instance); }, instance->at)) {
                bad.insert(instance.get());
            }
            for (const FledgeField &field : fields(instance->type())) {
                const auto feeds = [&](const Wire &wire) {
                    return wire.to.instance == instance && wire.to.field == &field;
                };
                if (field.group == FLEDGE_IN && !(field.flags & FLEDGE_OPTIONAL) &&
                    std::none_of(structure.wires.begin(), structure.wires.end(), feeds) &&
                    !structure.feed_of({instance, &field})) {
                    add(instance->path + "." + field.name + " is not wired, nor fed by hand; outputs of its type " +
                        field.sub->name + ": " + format_list(structure.outputs_of_type(field.sub)));
                }
            }
        }
    }
    return bad;
}

void check_assigned(const Structure &structure, bool flown)
{
    Faults faults;
    for (const auto &process : structure.processes) {
        for (const auto &instance : process->instances()) {
            const auto all = fields(instance->type());
            for (std::size_t i = 0; i < all.size(); i++) {
                if (all[i].group != FLEDGE_IN || !instance->given[i] || instance->fed[i]) {
                    continue;
                }
                Head head;
                std::memcpy(&head, instance->memory() + all[i].offset, sizeof head);
                if (!head_written(head)) {
                    const std::string path = instance->path + "." + all[i].name;
                    faults.add(path +
                               " was assigned, but its head says that nothing was written, so that nothing "
                               "reads it: " +
                               (flown ? "write its head too, " + path +
                                            ".head = {\"quality\": \"GOOD\", \"sequence\": 1}; or reset() the "
                                            "simulation, and give the message by sim.feed("
                                      : "give the message by sim.feed(") +
                               path + ", ...)");
                }
            }
        }
    }
    faults.raise();
}

void check_distinct(const Structure &structure, Faults &faults)
{
    for (const Wire &wire : structure.wires) {
        const char *distinct = wire.to.field->distinct;
        if (!distinct) {
            continue;
        }
        for (const Wire &other : structure.wires) {
            if (other.to.instance != wire.to.instance || std::strcmp(other.to.field->name, distinct)) {
                continue;
            }
            const std::byte *first = wire.from.bytes(), *second = other.from.bytes();
            const auto written = [](const std::byte *message) {
                Head head;
                std::memcpy(&head, message, sizeof head);
                return head_written(head);
            };
            const bool same = first == second || (written(first) && written(second) &&
                                                  !std::memcmp(first + sizeof(Head), second + sizeof(Head),
                                                               wire.to.field->size - sizeof(Head)));
            if (same) {
                faults.add(wire.to.path() + " must differ from " + other.to.path() + ": " + wire.from.path() +
                               (first == second ? " feeds both" : " and " + other.from.path() + " say the same"),
                           wire.options.at);
            }
        }
    }
}

std::vector<std::pair<std::string, std::string>> cross_process_dependencies(const Structure &structure,
                                                                            std::string_view process)
{
    std::vector<std::pair<std::string, std::string>> dependencies;
    for (const auto &own : structure.processes) {
        const auto foreign = [&](const auto &is_it) -> const Instance * {
            for (const auto &other : structure.processes) {
                for (const auto &instance : other->instances()) {
                    if (other != own && is_it(*instance)) {
                        return instance.get();
                    }
                }
            }
            return nullptr;
        };
        // The dependency breaks if either of the two processes is removed.
        const auto add = [&](const std::string &what, const Instance *whose) {
            if (whose &&
                (process.empty() || own->name == process || whose->path.starts_with(std::string(process) + "."))) {
                dependencies.emplace_back(what, whose->path);
            }
        };
        for (Mode mode : own->modes()) { // a copy, because visit may change what it finds
            if (mode.when) {
                mode.when->visit([&](const std::shared_ptr<Instance> &used) {
                    add(own->name + "." + mode.name, foreign([&](const Instance &i) { return &i == used.get(); }));
                });
            }
        }
        for (const auto &event : own->events()) {
            event->visit([&](const std::shared_ptr<Instance> &used) {
                add(own->name + "." + event->name, foreign([&](const Instance &i) { return &i == used.get(); }));
            });
        }
        for (const auto &instance : own->instances()) {
            if (!instance->model()) {
                continue;
            }
            // A copy of the model requests the counterpart of every model that it depends on.
            const auto clone = instance->clone();
            clone->model()->copy_setup(*instance->model(), [&](const Model *model) {
                add(instance->path, foreign([&](const Instance &i) { return i.model() == model; }));
                return const_cast<Model *>(model);
            });
        }
    }
    return dependencies;
}

std::vector<std::string> assumptions(const Structure &structure)
{
    std::vector<std::string> lines;
    for (const auto &process : structure.processes) {
        for (const auto &instance : process->instances()) {
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
