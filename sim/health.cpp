// SPDX-License-Identifier: Apache-2.0
#include "sim/health.h"

#include "sim/text.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numeric>
#include <set>

namespace fledge::sim {

namespace {

/// Call with (offset in the message, name) of every double in a message, elements of arrays included.
template <class Visit>
void each_double(const FledgeStruct &type, std::uint32_t base, const std::string &prefix, const Visit &visit)
{
    for (const FledgeField &field : fields(type)) {
        const std::size_t n = field_elements(field);
        for (std::size_t i = 0; i < n; i++) {
            const auto at = base + field.offset + static_cast<std::uint32_t>(i * (field.size / n));
            const std::string name = prefix + field.name + (field.ndim ? index_text(field, i) : "");
            if (field.sub) {
                each_double(*field.sub, at, name + ".", visit);
            } else if (field.type == FLEDGE_F64) {
                visit(at, name);
            }
        }
    }
}

std::string often(const Tally &tally, std::uint64_t updates)
{
    return " at " + std::to_string(tally.count) + " of " + std::to_string(updates) + " updates, first at " +
           format_time(tally.first);
}

/// Where in its process an instance runs.
struct TaskPlace {
    const Process *process;
    const Task *task;
    std::size_t task_order; ///< among the tasks of the process, at equal times
    std::size_t order;      ///< in the task
};

std::map<const Instance *, TaskPlace> places_of(const Structure &structure)
{
    std::map<const Instance *, TaskPlace> places;
    for (const auto &process : structure.processes) {
        const std::vector<const Task *> tasks = in_order(*process);
        for (std::size_t k = 0; k < tasks.size() && !process->stands_in; k++) {
            for (std::size_t i = 0; i < tasks[k]->run.size(); i++) {
                const Instance &instance = *tasks[k]->run[i];
                for (const Instance *part : with_parts(*process, instance)) {
                    places[part] = {process.get(), tasks[k], k, i};
                }
            }
        }
    }
    return places;
}

/// Whether both run in some mode, and at some equal times.
bool coincide(const TaskPlace &a, const TaskPlace &b)
{
    bool together = a.process->modes().empty();
    for (int mode = 0; mode < static_cast<int>(a.process->modes().size()); mode++) {
        together |= a.process->runs_in(*a.task, mode) && a.process->runs_in(*b.task, mode);
    }
    return together && (a.task->offset - b.task->offset) % std::gcd(a.task->period, b.task->period) == 0;
}

std::string every(const TaskPlace &place)
{
    return place.process->name + "." + place.task->name + " (every " + format_time(place.task->period) + ")";
}

} // namespace

std::string not_finite(const FledgeStruct &type, const std::byte *message)
{
    std::string text;
    each_double(type, 0, "", [&](std::uint32_t at, const std::string &name) {
        double x;
        std::memcpy(&x, message + at, sizeof x);
        if (text.empty() && !std::isfinite(x)) {
            text = name + " is " + format_number(x);
        }
    });
    return text;
}

const char *kind_name(Finding::Kind kind)
{
    static const char *const names[] = {"unwritten", "held",       "degraded", "stale",
                                        "saturated", "not finite", "late",     "uneven"};
    return names[static_cast<std::size_t>(kind)];
}

std::vector<Finding> structural_findings(const Structure &structure)
{
    std::vector<Finding> findings;
    const auto places = places_of(structure);
    const auto place_of = [&](const Port &port) {
        const auto it = places.find(port.instance.get());
        return it == places.end() ? nullptr : &it->second;
    };
    // The steps that read what a step of the same process writes at the same instant.
    std::map<std::pair<const Task *, std::size_t>, std::set<std::pair<const Task *, std::size_t>>> readers;
    for (const Wire &wire : structure.wires) {
        const TaskPlace *from = place_of(wire.from), *to = place_of(wire.to);
        if (from && to && from->process == to->process && !wire.options.latency) {
            readers[{from->task, from->order}].insert({to->task, to->order});
        }
    }
    const auto leads_to = [&](const TaskPlace &from, const TaskPlace &to) {
        std::set<std::pair<const Task *, std::size_t>> seen;
        std::vector<std::pair<const Task *, std::size_t>> next{{from.task, from.order}};
        while (!next.empty()) {
            const auto node = next.back();
            next.pop_back();
            if (node == std::pair{to.task, to.order}) {
                return true;
            }
            if (seen.insert(node).second) {
                next.insert(next.end(), readers[node].begin(), readers[node].end());
            }
        }
        return false;
    };
    const auto before = [](const TaskPlace &a, const TaskPlace &b) {
        return std::pair{a.task_order, a.order} < std::pair{b.task_order, b.order};
    };
    std::set<std::pair<const Task *, const Task *>> uneven;
    for (const Wire &wire : structure.wires) {
        const TaskPlace *from = place_of(wire.from), *to = place_of(wire.to);
        if (!from || !to) {
            continue;
        }
        if (from->process == to->process && !wire.options.latency && before(*to, *from) && coincide(*from, *to) &&
            !leads_to(*to, *from)) {
            const std::string reader = wire.to.instance->path, writer = wire.from.instance->path;
            findings.push_back(
                {Finding::Kind::late, wire.to.path(), -1, 0,
                 wire.to.path() + " reads " + wire.from.path() + " a step late: " +
                     (from->task == to->task
                          ? "task " + to->process->name + "." + to->task->name + " runs " + reader + " before " +
                                writer + "; let it run " + writer + " first"
                          : "task " + to->process->name + "." + to->task->name + " runs before " + from->process->name +
                                "." + from->task->name + "; declare that one first, or give it a higher priority")});
        }
        const Ns first = from->task->period, second = to->task->period;
        if (first % second && second % first && uneven.insert(std::minmax(from->task, to->task)).second) {
            findings.push_back({Finding::Kind::uneven, wire.to.path(), -1, 0,
                                wire.to.path() + " of task " + every(*to) + " reads " + wire.from.path() + " of task " +
                                    every(*from) +
                                    ": neither period divides the other, so the age of what it reads changes"});
        }
    }
    return findings;
}

Health::Health(const Structure &structure)
{
    // The messages of other programs come at exchanges, too.
    bool exchanges = std::any_of(structure.wires.begin(), structure.wires.end(),
                                 [](const Wire &wire) { return wire.options.latency; });
    Ns longest = 0;
    for (const auto &process : structure.processes) {
        exchanges |= process->stands_in && !process->instances().empty();
        longest = std::max(longest, longest_period(*process));
    }
    first_exchange_ = exchanges ? longest : 0;
}

void Health::watch(const Instance &instance, const Task &task, const Structure &structure)
{
    const auto number = static_cast<std::uint32_t>(tasks_.size());
    for (const FledgeField &field : fields(instance.type())) {
        if (field.group == FLEDGE_OUT && field.sub) {
            const std::byte *message = instance.memory() + field.offset;
            if (!instance.model()) {
                const std::size_t first = doubles_.size();
                each_double(*field.sub, 0, "", [&](std::uint32_t at, const std::string &) {
                    const bool follows = doubles_.size() > first &&
                                         message + at == doubles_.back().first + doubles_.back().n * sizeof(double);
                    follows ? (void)doubles_.back().n++ : doubles_.push_back({message + at, 1});
                });
            }
            const auto reads = std::find_if(structure.wires.begin(), structure.wires.end(), [&](const Wire &wire) {
                return wire.from.instance.get() == &instance && wire.from.field == &field;
            });
            seen_.push_back({message, 0, 0});
            outputs_.push_back({static_cast<std::uint64_t>(first_exchange_ / task.period),
                                {},
                                &instance,
                                &field,
                                reads == structure.wires.end() ? "" : reads->to.path(),
                                number});
        } else if (field.group == FLEDGE_MEM && field.type == FLEDGE_U64 && !field.ndim &&
                   !std::strcmp(field.name, "saturated")) {
            limits_.push_back(
                {reinterpret_cast<const std::uint64_t *>(instance.memory() + field.offset), 0, {}, &instance, number});
        }
    }
}

std::uint32_t Health::end_task()
{
    const Watched before = tasks_.empty() ? Watched{} : tasks_.back();
    const auto count = [](const auto &all) { return static_cast<std::uint32_t>(all.size()); };
    tasks_.push_back({before.last_output, count(outputs_), before.last_double, count(doubles_), before.last_limit,
                      count(limits_), 0});
    return count(tasks_) - 1;
}

std::uint32_t Health::watch_age(const Port &input)
{
    ages_.push_back({input.path(), {}});
    return static_cast<std::uint32_t>(ages_.size() - 1);
}

void Health::reset()
{
    visit_state([](void *state, std::size_t n) { std::memset(state, 0, n); });
}

void Health::note(const Watched &task, bool finite, Ns t)
{
    for (std::uint32_t i = task.first_output; i < task.last_output; i++) {
        Output &output = outputs_[i];
        Head head;
        std::memcpy(&head, seen_[i].message, sizeof head);
        if (!head_written(head)) {
            output.tallies.unwritten.add(t);
        } else if (head.quality != QUALITY_GOOD) {
            (seen_[i].written() ? output.tallies.degraded : output.tallies.held).add(t);
        }
        if (finite || !seen_[i].written() || output.instance->model()) {
            continue;
        }
        if (const std::string what = not_finite(*output.field->sub, seen_[i].message); !what.empty()) {
            output.tallies.not_finite.add(t);
            if (head.quality == QUALITY_GOOD) {
                throw RunError(output.instance->path + "." + output.field->name + " says GOOD at " + format_time(t) +
                               ", but its " + what);
            }
        }
    }
}

std::vector<Finding> Health::findings() const
{
    std::vector<Finding> findings;
    const auto add = [&](Finding::Kind kind, const std::string &path, const Tally &tally, const std::string &text) {
        if (tally.count) {
            findings.push_back({kind, path, tally.first, tally.count, path + text});
        }
    };
    for (std::size_t i = 0; i < outputs_.size(); i++) {
        const Output &output = outputs_[i];
        const std::string path = output.instance->path + "." + output.field->name;
        const std::uint64_t updates = tasks_[output.task].updates;
        const Tally &unwritten = output.tallies.unwritten;
        if (!output.reader.empty() && unwritten.count > output.grace) {
            add(Finding::Kind::unwritten, path, unwritten,
                (unwritten.count == updates ? " was never written" : " was not written" + often(unwritten, updates)) +
                    "; " + output.reader + " reads it");
        }
        add(Finding::Kind::held, path, output.tallies.held,
            " held its last value" + often(output.tallies.held, updates));
        add(Finding::Kind::degraded, path, output.tallies.degraded,
            " was degraded" + often(output.tallies.degraded, updates));
        add(Finding::Kind::not_finite, path, output.tallies.not_finite,
            " was not finite" + often(output.tallies.not_finite, updates));
        if (const std::string what = not_finite(*output.field->sub, seen_[i].message);
            output.instance->model() && !what.empty()) {
            findings.push_back({Finding::Kind::not_finite, path, -1, 0, path + " is not finite at the end: " + what});
        }
    }
    for (const Limit &limit : limits_) {
        add(Finding::Kind::saturated, limit.instance->path, limit.saturated,
            " was at its limits" + often(limit.saturated, tasks_[limit.task].updates));
    }
    for (const Age &age : ages_) {
        add(Finding::Kind::stale, age.input, age.stale,
            " was stale at " + std::to_string(age.stale.count) + " updates, first at " + format_time(age.stale.first));
    }
    return findings;
}

} // namespace fledge::sim
