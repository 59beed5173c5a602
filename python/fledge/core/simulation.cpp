// SPDX-License-Identifier: Apache-2.0
// The kernel, for the Python package fledge.mission. Times are integer nanoseconds here.
#include "core/element.h"
#include "core/extension.h"
#include "core/value.h"

#include "ccsds/security/key_file.h"
#include "sim/simulation.h"
#include "world/consumer.h"

#include <pybind11/functional.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <array>
#include <map>

namespace py = pybind11;
using namespace py::literals;

namespace fledge::core {

namespace {

using sim::Condition;
using sim::Ns;
using sim::Operand;

sim::Port port_of(py::handle view)
{
    if (!is_view(view.ptr()) || !as_view(view.ptr())->owner || !is_root(as_view(view.ptr())->owner)) {
        throw py::type_error("expected an input or output, as in flight.control.error; found " +
                             std::string(py::repr(view)));
    }
    return {as_root(as_view(view.ptr())->owner)->instance, as_view(view.ptr())->member->field};
}

py::bytes bytes_of(const std::vector<std::byte> &bytes)
{
    return {reinterpret_cast<const char *>(bytes.data()), bytes.size()};
}

using Number = Typed<py::object, "int | float">;
using NumberOrNone = Typed<py::object, "int | float | None">;
using Step = Typed<py::object, "tuple[Operand, str, Operand] | str">;
using Trigger = Typed<py::object, "Condition | Callable[[], bool]">;
using TimedBytes = std::vector<std::pair<Ns, py::bytes>>;

// Python's names of the enumerators of conditions.
const char *const measures[] = {"element", "norm", "max_abs", nullptr};
const char *const joins[] = {"", "&", "|", "~"};

/// An element or a measure of a field of a message or module. `index` picks an element; the measures "norm" and
/// "max_abs" take them all.
Operand make_operand(const AnyObject &object, const FledgeField &field, std::uint32_t index, const std::string &measure)
{
    Operand operand;
    PyObject *root = root_of(object.ptr());
    operand.instance = instance_of(root ? py::handle(root) : py::handle(object));
    const std::uint32_t elements = static_cast<std::uint32_t>(sim::field_elements(field));
    operand.measure = named<ExecMeasure>(measures, measure);
    operand.elements = operand.measure == EXEC_ELEMENT ? 1 : elements;
    operand.offset = static_cast<std::uint32_t>(as_object(object.ptr())->memory - operand.instance->memory()) +
                     field.offset + index * (field.size / elements);
    operand.type = field.type;
    return operand;
}

/// A Python number as a double if that is exact, or else as a whole number of 64 bits.
Operand make_constant(const Number &x)
{
    if (!py::isinstance<py::int_>(x) || py::int_(py::float_(x)).equal(x)) {
        return Operand::of(x.cast<double>());
    }
    return x < py::int_(0) ? Operand::of(x.cast<std::int64_t>()) : Operand::of(x.cast<std::uint64_t>());
}

NumberOrNone constant_of(const Operand &operand)
{
    if (operand.instance) {
        return py::none();
    }
    if (operand.type == FLEDGE_F64) {
        return py::float_(operand.value());
    }
    return operand.type == FLEDGE_I64 ? py::object(py::int_(load<std::int64_t>(operand.constant.data())))
                                      : py::object(py::int_(load<std::uint64_t>(operand.constant.data())));
}

/// What an assignment to a field would write, which this takes back again: (bytes from the start of the instance's
/// memory, bytes) of the field, and of its count if it has one.
std::vector<std::pair<std::uint32_t, py::bytes>> encode(const AnyObject &object, const std::string &name,
                                                        py::handle value)
{
    const Object &to = *as_object(object.ptr());
    const auto instance = instance_of(py::handle(root_of(object.ptr())));
    const Member &member = *to.type->find(name);
    const std::vector<std::byte> before(instance->memory(), instance->memory() + instance->type().size);
    const auto given = instance->given, bare = instance->bare;
    const Stored stored = store(object.ptr(), member, value.ptr());
    std::vector<std::pair<std::uint32_t, py::bytes>> written;
    for (const Member *part : {&member, member.count}) {
        if (part) {
            const std::byte *at = to.memory + part->field->offset;
            written.emplace_back(static_cast<std::uint32_t>(at - instance->memory()),
                                 py::bytes(reinterpret_cast<const char *>(at), part->field->size));
        }
    }
    std::copy(before.begin(), before.end(), instance->memory());
    instance->given = given;
    instance->bare = bare;
    if (stored == Stored::needs_count) {
        complain_of_count(object.ptr(), member);
    }
    if (stored != Stored::yes) {
        throw py::error_already_set();
    }
    return written;
}

/// An event and its process. Python keeps the process alive as long as this object.
auto tally(const sim::Tally &tally)
{
    return std::tuple(tally.count, tally.first);
}

struct OwnEvent {
    sim::Process *process;
    std::shared_ptr<sim::Event> event;
};

/// A part of an instance's memory that an event writes.
using Setting = std::tuple<AnyInstance, std::uint32_t, py::bytes>;

OwnEvent add_event(sim::Process &process, const std::string &name, const Trigger &when, std::optional<Condition> until,
                   Ns hold, std::int32_t count, bool once, bool armed, std::vector<std::string> modes,
                   const std::string &mode, std::vector<std::pair<std::string, bool>> arms,
                   const std::vector<Setting> &set, std::function<void()> action, const std::string &text,
                   std::string file, int line)
{
    sim::Event event;
    event.name = name;
    event.text = text;
    if (py::isinstance<Condition>(when)) {
        event.condition = when.cast<Condition>();
    } else {
        event.predicate = when.cast<std::function<bool()>>();
    }
    event.until = std::move(until);
    event.hold = hold;
    event.count = count;
    event.once = once;
    event.armed = armed;
    event.modes = std::move(modes);
    event.mode = mode;
    event.arms = std::move(arms);
    for (const auto &[object, offset, bytes] : set) {
        const auto span = std::as_bytes(std::span(std::string_view(bytes)));
        event.set.push_back({instance_of(object), offset, {span.begin(), span.end()}});
    }
    event.action = std::move(action);
    event.at = {std::move(file), line};
    return {&process, process.add_event(std::move(event))};
}

/// times: [ns] as int64 in bytes, as numpy has them; messages: their bytes.
std::shared_ptr<const sim::Messages> messages_of(std::string_view times, std::string_view messages)
{
    auto made = std::make_shared<sim::Messages>();
    made->times.resize(times.size() / sizeof(Ns));
    made->bytes.resize(messages.size());
    // Not memcpy: either may be empty, and memcpy takes no null pointer.
    std::copy_n(times.data(), made->times.size() * sizeof(Ns), reinterpret_cast<char *>(made->times.data()));
    std::copy_n(messages.data(), messages.size(), reinterpret_cast<char *>(made->bytes.data()));
    return made;
}

/// sent: they are what other processes read.
void play(sim::Process &process, const AnyPort &output, const py::bytes &times, const py::bytes &messages, bool sent)
{
    const sim::Port port = port_of(output);
    process.play(*port.instance, {port.field, messages_of(times, messages), sent, {}});
}

void play_executive(sim::Process &process, const std::array<py::bytes, 2> &modes,
                    const std::array<py::bytes, 2> &happenings)
{
    process.play_executive(messages_of(modes[0], modes[1]), messages_of(happenings[0], happenings[1]));
}

void feed(sim::Simulation &simulation, const AnyPort &input, const py::bytes &times, const py::bytes &messages,
          bool always, std::vector<std::uint32_t> linear, Ns stale_after, const std::string &source)
{
    simulation.feed({port_of(input), messages_of(times, messages), always, std::move(linear), stale_after, source});
}

auto differential_states(const sim::Simulation &simulation)
{
    std::vector<std::tuple<std::string, std::string, std::string, std::string, std::size_t, std::size_t>> rows;
    std::map<const sim::Model *, std::string> paths;
    for (const auto &process : simulation.processes()) {
        for (const auto &instance : process->instances()) {
            paths[instance->model()] = instance->path;
        }
    }
    for (const auto &process : simulation.processes()) {
        for (const auto &instance : process->instances()) {
            if (sim::Model *model = instance->model()) {
                const auto *memory = reinterpret_cast<const double *>(model->memory().data());
                for (const sim::DifferentialState &state : model->differential_states()) {
                    rows.emplace_back(instance->path, paths.at(state.of), state.name, state.unit,
                                      sizeof(double) * static_cast<std::size_t>(state.value - memory),
                                      sizeof(double) * static_cast<std::size_t>(state.rate - memory));
                }
            }
        }
    }
    return rows;
}

py::bytes incoming(const sim::Process &process, const AnyPort &input)
{
    const auto bytes = process.incoming(port_of(input));
    return {reinterpret_cast<const char *>(bytes.data()), bytes.size()};
}

void put_out(const sim::Process &process, const AnyPort &output, const py::bytes &message)
{
    const sim::Port port = port_of(output);
    const std::string_view bytes = message;
    if (!process.flight() || port.field->group != FLEDGE_OUT || bytes.size() != port.field->size) {
        throw py::value_error(port.path() + " takes an output's " + std::to_string(port.field->size) +
                              " bytes, of a process that fly_by() flies");
    }
    std::memcpy(port.bytes(), bytes.data(), bytes.size());
}

using ProgressOrNone = Typed<py::object, "Callable[[int], object] | None">;

void fly_by_model(sim::Process &process, const std::string &as, const AnyInstance &computer,
                  const std::vector<std::tuple<AnyInstance, std::string, std::size_t>> &shared, std::ptrdiff_t request)
{
    const auto port_of_row = [](const auto &row) {
        const auto &[object, name, offset] = row;
        const auto instance = instance_of(object);
        for (const FledgeField &field : sim::fields(instance->type())) {
            if (field.name == name) {
                return sim::Shared{{instance, &field}, offset};
            }
        }
        throw py::value_error(instance->path + " has no " + name);
    };
    process.fly_by_model(as, instance_of(computer), list_of(shared, port_of_row), request);
}

bool run_until(sim::Simulation &simulation, Ns t, double pace, const ProgressOrNone &progress)
{
    Poll poll;
    const auto report = [&](Ns now) { return poll([&] { return progress.is_none() || (progress(now), true); }); };
    bool finished;
    {
        py::gil_scoped_release release;
        finished = simulation.run_until(t, {pace, report});
    }
    poll.rethrow();
    return finished;
}

void step(sim::Simulation &simulation, std::uint64_t n)
{
    for (std::uint64_t i = 0; i < n; i++) {
        simulation.step();
        if (i % 256 == 255 && PyErr_CheckSignals() != 0) {
            throw py::error_already_set();
        }
    }
}

/// A rule as fledge.commands has it.
using RuleRow = std::tuple<std::uint32_t, std::uint32_t, std::uint32_t, std::optional<std::uint32_t>, std::uint32_t,
                           std::uint32_t, double, double>;
/// (instance, offset, size, configuration, runs, rules) of a block.
using BlockRow = std::tuple<std::string, std::uint32_t, std::uint32_t, bool,
                            std::vector<std::pair<std::uint32_t, std::uint32_t>>, std::vector<RuleRow>>;

/// (instance, offset, size, runs) of a message that a module puts out.
using OutputRow =
    std::tuple<std::string, std::uint32_t, std::uint32_t, std::vector<std::pair<std::uint32_t, std::uint32_t>>>;

void set_dictionary(sim::Process &process, std::uint16_t stream, std::uint16_t telemetry, std::uint16_t version,
                    std::uint32_t room, const std::vector<BlockRow> &rows, const std::vector<OutputRow> &outputs)
{
    auto dictionary = std::make_shared<sim::Dictionary>();
    dictionary->stream = stream;
    dictionary->version = version;
    dictionary->telemetry = telemetry;
    dictionary->room = room;
    for (const auto &[instance, offset, size, configuration, runs, rules] : rows) {
        sim::Dictionary::Block block{instance, offset, size, configuration, {}, {}};
        for (const auto &[width, n] : runs) {
            block.runs.push_back({width, n});
        }
        for (const auto &[at, n, row, rows_at, flags, number, low, high] : rules) {
            block.rules.push_back({"", "", at, n, row, rows_at.value_or(COMMAND_ALL_ROWS), flags,
                                   static_cast<FledgeType>(number), low, high});
        }
        dictionary->blocks.push_back(std::move(block));
    }
    for (const auto &[instance, offset, size, runs] : outputs) {
        sim::Dictionary::Output output{instance, offset, size, {}};
        for (const auto &[width, n] : runs) {
            output.runs.push_back({width, n});
        }
        dictionary->outputs.push_back(std::move(output));
    }
    process.set_dictionary(std::move(dictionary));
}

auto reports(sim::Process &process)
{
    return list_of(process.take_reports(), [](const sim::CommandReply &reply) {
        const CommandReport &r = reply.report;
        return std::tuple(r.t, r.sequence, r.code, r.executed, r.reason, r.detail,
                          py::bytes(reinterpret_cast<const char *>(reply.data.data()), reply.data.size()), r.origin);
    });
}

/// The keys of a link, in a file.
struct LinkKeys {
    std::vector<AesGcmKey> expanded{16};
    AesGcmKeys keys{};
    SdlsProvider provider{};
};

void set_keys(sim::Process &process, const std::string &path)
{
    const auto made = std::make_shared<LinkKeys>();
    char why[400] = "";
    made->keys = {made->expanded.data(),
                  key_file_read(path.c_str(), made->expanded.data(), made->expanded.size(), why, sizeof why)};
    if (made->keys.n == 0) {
        throw sim::SetupError(why);
    }
    made->provider = {aes_gcm(&made->keys), &sdls_functions, 0};
    process.keys = std::shared_ptr<const void>(made, &made->provider);
}

TimedBytes timed(const std::vector<sim::Packet> &packets)
{
    return list_of(packets, [](const sim::Packet &packet) {
        return std::pair(packet.t, py::bytes(reinterpret_cast<const char *>(packet.bytes.data()), packet.bytes.size()));
    });
}

/// New objects for the instances of a process, by name, each with its parts or the model that it asks.
Typed<py::dict, "dict[str, Module | Model]"> wrap_instances(const sim::Process &process)
{
    py::dict objects;
    std::vector<std::pair<sim::Model *, py::object>> models;
    for (const auto &instance : process.instances()) {
        py::object object = object_of(instance);
        if (instance->model()) {
            models.emplace_back(instance->model(), object);
        }
        objects[py::str(instance->name)] = object;
    }
    for (const auto &[model, object] : models) {
        py::list parts;
        std::vector<const sim::Model *> uses;
        if (auto *consumer = dynamic_cast<world::Consumer *>(model)) {
            uses.push_back(consumer->source());
            for (const auto &further : consumer->further()) {
                uses.push_back(further.consumer->source());
            }
        } else {
            const auto of_craft = model->parts();
            uses.assign(of_craft.begin(), of_craft.end());
        }
        for (const sim::Model *part : uses) {
            for (const auto &[other, other_object] : models) {
                if (other == part) {
                    parts.append(other_object);
                }
            }
        }
        Py_XSETREF(as_root(object.ptr())->parts, py::tuple(parts).release().ptr());
    }
    return objects;
}

void bind_conditions(py::module_ &m)
{
    py::class_<Operand>(m, "Operand", "What a condition compares: of a field, or a constant.")
        .def(py::init(&make_operand), "object"_a, "field"_a, "index"_a, "measure"_a)
        .def(py::init(&make_constant), "x"_a)
        .def_property_readonly(
            "path", [](const Operand &o) { return o.instance ? std::optional(o.instance->path) : std::nullopt; },
            "of its module or model; None of a constant")
        .def_readonly("offset", &Operand::offset, "[bytes] of the first element, in its memory")
        .def_property_readonly("measure", [](const Operand &o) { return measures[o.measure]; })
        .def_property_readonly("constant", constant_of, "the number; None of a field");

    py::class_<Condition>(m, "Condition", "Comparisons of fields, joined by &, | and ~.")
        .def(py::init(
                 [](const Operand &left, const std::string &relation, const Operand &right, const std::string &text) {
                     return Condition({left, right, named<ExecRelation>(relations, relation)}, text);
                 }),
             "left"_a, "relation"_a, "right"_a, "text"_a)
        .def(
            "__and__", [](const Condition &a, const Condition &b) { return Condition(EXEC_BOTH, a, b); },
            py::is_operator(), "other"_a)
        .def(
            "__or__", [](const Condition &a, const Condition &b) { return Condition(EXEC_EITHER, a, b); },
            py::is_operator(), "other"_a)
        .def("__invert__", &Condition::operator~)
        .def("__repr__", &Condition::text)
        .def("__bool__",
             [](const Condition &c) -> bool {
                 throw py::type_error(c.text() + " is only known when the mission runs; join conditions with &, | and "
                                                 "~, each in parentheses, as in (x > 1) & (x < 2)");
             })
        .def("holds", &Condition::holds, "Whether it holds now.")
        .def_property_readonly(
            "steps",
            [](const Condition &c) {
                return list_of(c.steps(), [](const Condition::Step &step) -> Step {
                    if (step.join != EXEC_COMPARE) {
                        return py::str(joins[step.join]);
                    }
                    return py::make_tuple(step.comparison.left, relations[step.comparison.relation],
                                          step.comparison.right);
                });
            },
            "in postfix order: (operand, relation, operand) of a comparison, or '&', '|' of the two before, '~' of the "
            "one");
    m.def("encode", encode, "object"_a, "name"_a, "value"_a);
}

void bind_event(py::module_ &m)
{
    py::class_<OwnEvent>(m, "Event")
        .def_property_readonly("name", [](const OwnEvent &e) { return e.event->name; })
        .def_property(
            "armed", [](const OwnEvent &e) { return e.process->armed(*e.event); },
            [](const OwnEvent &e, bool armed) { e.process->arm(*e.event, armed); })
        .def_property_readonly("arming", [](const OwnEvent &e) { return e.process->arming(*e.event); })
        .def_property_readonly("fired_at", [](const OwnEvent &e) { return e.process->fired_at(*e.event); })
        .def_property_readonly(
            "fired", [](const OwnEvent &e) { return tally(e.process->fired(*e.event)); }, "(how often, when first)")
        .def_property_readonly("condition", [](const OwnEvent &e) { return e.event->condition; })
        .def_property_readonly("until", [](const OwnEvent &e) { return e.event->until; })
        .def_property_readonly("hold", [](const OwnEvent &e) { return e.event->hold; })
        .def_property_readonly("count", [](const OwnEvent &e) { return e.event->count; })
        .def_property_readonly("once", [](const OwnEvent &e) { return e.event->once; })
        .def_property_readonly("starts_armed", [](const OwnEvent &e) { return e.event->armed; })
        .def_property_readonly("modes", [](const OwnEvent &e) { return e.event->modes; })
        .def_property_readonly("mode", [](const OwnEvent &e) { return e.event->mode; })
        .def_property_readonly("arms", [](const OwnEvent &e) { return e.event->arms; })
        .def_property_readonly("set",
                               [](const OwnEvent &e) {
                                   return list_of(e.event->set, [](const sim::Setting &s) {
                                       return std::tuple(s.instance->path, s.offset, bytes_of(s.bytes));
                                   });
                               })
        .def_property("predicate", nullptr,
                      [](const OwnEvent &e, std::function<bool()> f) { e.event->predicate = std::move(f); })
        .def_property("action", nullptr,
                      [](const OwnEvent &e, std::function<void()> f) { e.event->action = std::move(f); });
}

void bind_log(py::module_ &m)
{
    py::class_<sim::Log, std::shared_ptr<sim::Log>>(m, "Log", "The samples of one port.")
        .def_property_readonly("path", [](const sim::Log &log) { return log.instance->path + "." + log.field->name; })
        .def_property_readonly(
            "struct", [](const sim::Log &log) { return log.field->sub; }, py::return_value_policy::reference)
        .def_readonly("every", &sim::Log::every)
        .def_readonly("rewinds", &sim::Log::rewinds)
        .def_readwrite("keep", &sim::Log::keep, "whether samples stay in memory")
        .def("__len__", [](const sim::Log &log) { return log.times.size(); })
        .def("times",
             [](const sim::Log &log) {
                 return py::bytes(reinterpret_cast<const char *>(log.times.data()), log.times.size() * sizeof(Ns));
             })
        .def("bytes", [](const sim::Log &log) { return bytes_of(log.bytes); })
        .def("last", [](const sim::Log &log) {
            const std::size_t size = log.times.empty() ? 0 : log.field->size;
            return py::bytes(reinterpret_cast<const char *>(log.bytes.data() + log.bytes.size() - size), size);
        });
}

using Process = py::class_<sim::Process>;

/// Commands and telemetry of a flight process.
void bind_commands(Process &process)
{
    process
        .def("set_dictionary", set_dictionary, "stream"_a, "telemetry"_a, "version"_a, "room"_a, "rows"_a, "outputs"_a)
        .def(
            "command",
            [](sim::Process &p, const py::bytes &bytes) { return static_cast<int>(p.command(octets(bytes))); },
            "bytes"_a)
        .def(
            "send_by",
            [](sim::Process &p, const AnyInstance &carrier, const py::bytes &bytes) {
                p.send_by(*instance_of(carrier), octets(bytes));
            },
            "carrier"_a, "bytes"_a)
        .def(
            "take_from",
            [](sim::Process &p, const AnyInstance &carrier, Ns t) {
                return timed(p.carrier(*instance_of(carrier)).take(t));
            },
            "carrier"_a, "t"_a)
        .def(
            "take_received", [](sim::Process &p) { return timed(p.received.take()); },
            "As take_packets(): commands that carriers brought, and the time before the instant that accepted them.")
        .def_property_readonly(
            "dictionary", [](const sim::Process &p) { return p.dictionary() ? int{p.dictionary()->version} : -1; },
            "its version; -1: none")
        .def(
            "set_script",
            [](sim::Process &p, const TimedBytes &rows) {
                p.set_script(list_of(rows, [](const auto &row) {
                    return sim::ScriptedCommand{row.first, octets(row.second), false};
                }));
            },
            "rows"_a)
        .def(
            "set_procedure_host",
            [](sim::Process &p, decltype(sim::ProcedureHost::start) start, decltype(sim::ProcedureHost::turn) turn,
               decltype(sim::ProcedureHost::end) end) {
                p.set_procedure_host({std::move(start), std::move(turn), std::move(end)});
            },
            "start"_a, "turn"_a, "end"_a,
            "What runs procedures: start(bytecode as numbers, sequence, turns), turn(t), end(t, killed, why).")
        .def(
            "command_mode",
            [](sim::Process &p, const std::string &mode) { return static_cast<int>(p.command_mode(mode)); }, "mode"_a)
        .def("take_reports", reports, "(t, sequence, code, stage, reason, detail, bytes read back) of each")
        .def(
            "take_packets", [](sim::Process &p) { return timed(p.telemetry.take()); },
            "(t, packet of telemetry) since the last call; they are kept from the first call on")
        .def(
            "play_telemetry",
            [](sim::Process &p, const TimedBytes &packets) {
                p.play_telemetry(list_of(packets, [](const auto &packet) {
                    return sim::Packet{packet.first, octets(packet.second)};
                }));
            },
            "packets"_a)
        .def("set_keys", set_keys, "path"_a, "Those of a link of frames, of a file.")
        .def(
            "take_units", [](sim::Process &p) { return timed(p.units.take()); },
            "The same as frames, if flight speaks them.")
        .def_property_readonly(
            "ground", [](const sim::Process &p) { return std::pair(p.ground().begun != 0, p.ground().last); },
            "(whether a command was accepted, the sequence of the last one)")
        .def_property_readonly(
            "command_counters",
            [](const sim::Process &p) {
                const CommandCounters c = p.command_counters();
                return std::tuple(c.accepted, c.executed, c.refused,
                                  std::vector<std::uint32_t>(c.reasons, c.reasons + COMMAND_REASONS));
            },
            "(accepted, executed, refused, refused for each reason)");
}

/// What other programs and records do in place of a process or its modules.
void bind_outside(Process &process)
{
    process.def("play", play, "output"_a, "times"_a, "messages"_a, "sent"_a)
        .def("play_executive", play_executive, "modes"_a, "happenings"_a,
             "By (times, messages) of its modes, and of what happened.")
        .def("fly_by", &sim::Process::fly_by, "flight"_a,
             "A function of the time [ns] flies in place of the process' modules.")
        .def("fly_by_model", fly_by_model, "name"_a, "computer"_a, "shared"_a, "request"_a,
             "A model flies in their place: (module, its field, where [bytes] the model has it) of what "
             "they share; where it has the mode to enter, or -1.")
        .def("incoming", incoming, "input"_a, "The bytes of the message that is for an input at this instant.")
        .def("put_out", put_out, "output"_a, "message"_a, "Write the bytes of an output, as fly_by's function.")
        .def(
            "reset_by", [](sim::Process &p, const AnyPort &input, Ns down) { p.reset_by(port_of(input), down); },
            "input"_a, "down"_a)
        .def_property_readonly("reset",
                               [](const sim::Process &p) {
                                   const auto &line = p.reset_line();
                                   return line ? std::optional(std::pair(line->input.path(), line->down))
                                               : std::nullopt;
                               })
        .def_property_readonly("outages", &sim::Process::outages);
}

void bind_process(py::module_ &m)
{
    Process process(m, "Process");
    process.def_readonly("name", &sim::Process::name)
        .def(
            "add",
            [](sim::Process &p, const std::string &name, const AnyInstance &object, std::string file, int line) {
                p.add(name, instance_of(object), {std::move(file), line});
            },
            "name"_a, "object"_a, "file"_a, "line"_a)
        .def(
            "add_task",
            [](sim::Process &p, const std::string &name, Ns period, Ns offset, int priority,
               const std::vector<AnyInstance> &run) {
                p.add_task({name, period, offset, priority, list_of(run, instance_of)});
            },
            "name"_a, "period"_a, "offset"_a, "priority"_a, "run"_a)
        .def(
            "add_mode",
            [](sim::Process &p, const std::string &name, std::vector<std::string> tasks, std::optional<Condition> when,
               std::vector<std::string> after, std::string file, int line) {
                p.add_mode({name, std::move(tasks), std::move(when), std::move(after), {std::move(file), line}});
            },
            "name"_a, "tasks"_a, "when"_a, "after"_a, "file"_a, "line"_a)
        .def("add_event", add_event, "name"_a, "when"_a, "until"_a, "hold"_a, "count"_a, "once"_a, "armed"_a, "modes"_a,
             "mode"_a, "arms"_a, "set"_a, "action"_a, "text"_a, "file"_a, "line"_a, py::keep_alive<0, 1>())
        .def("start_in", &sim::Process::start_in, "mode"_a)
        .def("enter", &sim::Process::enter, "mode"_a)
        .def_property_readonly("mode", &sim::Process::mode)
        .def_property_readonly(
            "entered",
            [](const sim::Process &p) {
                return list_of(p.modes(), [&](const sim::Mode &mode) { return tally(p.entered(mode)); });
            },
            "(how often, when first) of each mode")
        .def_property_readonly("requested_mode", &sim::Process::requested_mode)
        .def_property_readonly("integrator", [](const sim::Process &p) { return p.integrator().describe(); })
        .def(
            "set_integrator",
            [](sim::Process &p, std::shared_ptr<sim::Integrator> method) { p.set_integrator(std::move(method)); },
            "method"_a)
        .def("wrap", wrap_instances)
        .def_property_readonly(
            "tasks",
            [](const sim::Process &p) {
                return list_of(p.tasks(), [](const sim::Task &task) {
                    return std::tuple(task.name, task.period, task.offset, task.priority,
                                      list_of(task.run, [](const auto &instance) { return instance->name; }));
                });
            },
            "(name, period, offset, priority, names of what it runs) of each")
        .def_property_readonly(
            "modes",
            [](const sim::Process &p) {
                return list_of(p.modes(), [](const sim::Mode &mode) { return std::pair(mode.name, mode.tasks); });
            },
            "(name, names of its tasks) of each")
        .def_property_readonly(
            "guards",
            [](const sim::Process &p) {
                return list_of(p.modes(),
                               [](const sim::Mode &mode) { return std::tuple(mode.guard(), mode.when, mode.after); });
            },
            "(in words, the condition or None, the modes that it comes after) of each")
        .def_property_readonly(
            "events", [](const py::object &self) -> Typed<py::list, "list[Event]"> {
                auto &p = self.cast<sim::Process &>();
                py::list list;
                for (const auto &event : p.events()) {
                    list.append(OwnEvent{&p, event});
                    py::detail::keep_alive_impl(list[list.size() - 1], self);
                }
                return list;
            });
    bind_commands(process);
    bind_outside(process);
}

using Simulation = py::class_<sim::Simulation>;

/// Wires, feeds, and what keeps a simulation from running.
void bind_wiring(Simulation &simulation)
{
    simulation
        .def(
            "connect",
            [](sim::Simulation &s, const AnyPort &from, const AnyPort &to, int latency, Ns stale_after, int by,
               const std::string &mode, bool more, std::string file, int line) {
                s.connect(port_of(from), port_of(to),
                          {latency, stale_after, ExecChoice(by), mode, more, {std::move(file), line}});
            },
            "from_"_a, "to"_a, "latency"_a, "stale_after"_a, "by"_a, "mode"_a, "more"_a, "file"_a, "line"_a)
        .def_property_readonly(
            "wires",
            [](const sim::Simulation &s) {
                return list_of(s.wires(), [](const sim::Wire &wire) {
                    return std::tuple(wire.from.path(), wire.to.path(), wire.options.latency, wire.options.stale_after,
                                      wire.options.choice());
                });
            },
            "(from, to, latency, stale_after, choice) of each")
        .def("feed", feed, "input"_a, "times"_a, "messages"_a, "always"_a, "linear"_a, "stale_after"_a, "source"_a)
        .def_property_readonly(
            "feeds",
            [](const sim::Simulation &s) {
                return list_of(s.feeds(), [](const sim::Feed &feed) {
                    return std::tuple(feed.to.path(), feed.source, feed.stale_after);
                });
            },
            "(to, source in words, stale_after) of each")
        .def("cross_process_dependencies", [](const sim::Simulation &s) { return s.cross_process_dependencies(); })
        .def_property_readonly(
            "carriers",
            [](const sim::Simulation &s) {
                std::vector<std::pair<std::string, std::string>> found;
                for (const auto &process : s.processes()) {
                    for (const auto &instance : process->instances()) {
                        if (const auto *carrier = dynamic_cast<const sim::Carrier *>(instance->model())) {
                            found.emplace_back(instance->path, carrier->serves());
                        }
                    }
                }
                return found;
            },
            "(path, the flight process) of each model that carries units of bytes for flight.")
        .def("isolate", &sim::Simulation::isolate, "process"_a)
        .def(
            "problems",
            [](sim::Simulation &s) {
                return list_of(s.problems(), [](const sim::Problem &problem) {
                    return std::tuple(problem.at.file, problem.at.line, problem.text);
                });
            },
            "(file, line, text) of each reason why it cannot run");
}

/// Whether a process is in one of the modes; empty if there are none.
std::function<bool()> in_modes(sim::Simulation &simulation, const std::string &process,
                               const std::vector<std::string> &modes)
{
    if (modes.empty()) {
        return {};
    }
    return [&of = std::as_const(simulation.process(process)), modes] {
        return std::find(modes.begin(), modes.end(), of.mode()) != modes.end();
    };
}

/// Logs and archives.
void bind_records(Simulation &simulation)
{
    simulation
        .def(
            "record",
            [](sim::Simulation &s, const AnyPort &view, Ns every, bool keep, const std::string &process,
               const std::vector<std::string> &modes) {
                const sim::Port port = port_of(view);
                return s.recorder().record(port.instance, *port.field, every, keep, in_modes(s, process, modes));
            },
            "view"_a, "every"_a, "keep"_a, "process"_a = "", "modes"_a = std::vector<std::string>{},
            "modes: of the process; none: in all")
        .def_property_readonly("logs", [](sim::Simulation &s) { return s.recorder().logs(); })
        .def_property_readonly("followed", [](sim::Simulation &s) { return s.recorder().followed(); })
        .def(
            "record_executive",
            [](sim::Simulation &s, const std::string &process, std::size_t output, Ns every, const std::string &of,
               const std::vector<std::string> &modes) {
                const auto &instance = s.process(process).executive().instance();
                auto log =
                    s.recorder().record(instance, instance->type().fields[output], every, true, in_modes(s, of, modes));
                log->archive = false; // which follows the executive
                return log;
            },
            "process"_a, "output"_a, "every"_a, "of"_a = "", "modes"_a = std::vector<std::string>{})
        .def(
            "open_archive",
            [](sim::Simulation &s, const std::string &path, const sim::Pairs &run) {
                s.recorder().open_archive(path, run);
            },
            "path"_a, "run"_a)
        .def(
            "resume_archive",
            [](sim::Simulation &s, const std::string &path) { return s.recorder().resume_archive(path); }, "path"_a)
        .def_property_readonly("resumed", [](sim::Simulation &s) { return s.recorder().resumed(); })
        .def(
            "archive_metadata",
            [](sim::Simulation &s, const std::string &name, const sim::Pairs &pairs) {
                s.recorder().archive_metadata(name, pairs);
            },
            "name"_a, "pairs"_a)
        .def(
            "close_archive", [](sim::Simulation &s, const sim::Pairs &end) { s.recorder().close_archive(end); },
            "end"_a = sim::Pairs{})
        .def("open_outputs", &sim::Simulation::open_outputs, "path"_a)
        .def("close_outputs", &sim::Simulation::close_outputs)
        .def_property_readonly("archiving", [](sim::Simulation &s) { return s.recorder().archiving(); });
}

/// Snapshots and their blocks, for linearization and trim.
void bind_state(Simulation &simulation)
{
    simulation.def("snapshot", [](const sim::Simulation &s) { return bytes_of(s.snapshot()); })
        .def(
            "restore",
            [](sim::Simulation &s, const py::bytes &bytes, bool edited) {
                s.restore(std::as_bytes(std::span(std::string_view(bytes))), edited);
            },
            "snapshot"_a, "edited"_a = false)
        .def(
            "state_blocks",
            [](const sim::Simulation &s) {
                const char *const block_kinds[] = {"instance", "model", "held"};
                return list_of(s.state_blocks(), [&](const sim::Simulation::StateBlock &block) {
                    return std::tuple(block_kinds[block.kind], block.path, block.offset, block.size);
                });
            },
            "(kind, path, offset, size) of the blocks of a snapshot")
        .def("differential_states", differential_states,
             "(path of a model, path of whose state it is, name, unit, places of value and rate in the model's memory)")
        .def("follow", &sim::Simulation::follow, "next"_a)
        .def(
            "override_input",
            [](sim::Simulation &s, const AnyPort &input, std::uint32_t place, double value) {
                return s.override_input(port_of(input), place, value);
            },
            "input"_a, "place"_a, "value"_a)
        .def("clone", &sim::Simulation::clone);
}

} // namespace

std::vector<HealthRow> health_rows(const std::vector<sim::Finding> &findings)
{
    return list_of(findings, [](const sim::Finding &f) {
        const auto first = f.first < 0 ? std::nullopt : std::optional(static_cast<double>(f.first) / 1e9);
        return HealthRow(sim::kind_name(f.kind), f.path, first, f.count, f.text);
    });
}

void bind_simulation(py::module_ &m)
{
    py::class_<sim::Integrator, std::shared_ptr<sim::Integrator>>(m, "Integrator", "A method of integration.")
        .def("__repr__", &sim::Integrator::describe);
    m.def("rk4", [] { return std::shared_ptr<sim::Integrator>(sim::make_rk4()); });
    m.def(
        "adaptive",
        [](double relative, double absolute) {
            return std::shared_ptr<sim::Integrator>(sim::make_adaptive(relative, absolute));
        },
        "relative"_a, "absolute"_a);
    bind_conditions(m);
    bind_event(m);
    bind_log(m);
    bind_process(m);
    bind_crashes(m);

    Simulation simulation(m, "Simulation");
    simulation.def(py::init<std::uint64_t>(), "seed"_a = 0)
        .def("add_process", &sim::Simulation::add_process, "name"_a, py::return_value_policy::reference_internal)
        .def(
            "process", [](sim::Simulation &s, const std::string &name) -> sim::Process & { return s.process(name); },
            "name"_a, py::return_value_policy::reference_internal)
        .def_property("seed", &sim::Simulation::seed, &sim::Simulation::set_seed)
        .def("prepare", &sim::Simulation::prepare)
        .def("set_up_again", &sim::Simulation::set_up_again)
        .def("ready_for", &sim::Simulation::ready_for, "t"_a)
        .def("reset", &sim::Simulation::reset)
        .def_property_readonly("now", &sim::Simulation::now)
        .def_property_readonly("time", &sim::Simulation::time)
        .def("run_until", run_until, "t"_a, "pace"_a, "progress"_a)
        .def("step", step, "n"_a)
        .def_property_readonly(
            "pace_report",
            [](const sim::Simulation &s) {
                const sim::PaceReport report = s.pace_report();
                return std::tuple(report.instants, report.overruns, report.worst);
            },
            "(instants, overruns, worst delay in ns of wall time)")
        .def_property_readonly("health", [](const sim::Simulation &s) { return health_rows(s.health()); })
        .def_property_readonly("assumptions", &sim::Simulation::assumptions);
    bind_wiring(simulation);
    bind_records(simulation);
    bind_state(simulation);
}

} // namespace fledge::core
