// SPDX-License-Identifier: Apache-2.0
// Formulas of signal temporal logic, for the package fledge.requirements.
#include "core/extension.h"
#include "core/value.h"

#include "flight/telemetry/telemetry.h"
#include "sim/judge.h"
#include "sim/simulation.h"

#include <pybind11/numpy.h>
#include <pybind11/stl.h>

namespace py = pybind11;
using namespace py::literals;

namespace fledge::core {

namespace {

using sim::FormulaNode;
using sim::Judge;
using sim::Ns;

template <class T> using Array = py::array_t<T, py::array::c_style | py::array::forcecast>;

const char *const node_kinds[] = {"atom",       "constant", "not",  "and",    "or",    "always",
                                  "eventually", "until",    "once", "begins", "clock", nullptr};
const char *const operations[] = {"source", "constant", "element", "norm",  "max_abs", "abs",
                                  "+",      "-",        "scaled",  "angle", "turned",  nullptr};

const char *const becomes[] = {"accepted", "executed", "refused", nullptr};

/// Nodes as (kind, a, b, from [ns], to [ns] or None).
int formula(Judge &judge, const std::vector<std::tuple<std::string, int, int, Ns, std::optional<Ns>>> &rows)
{
    std::vector<FormulaNode> nodes;
    nodes.reserve(rows.size());
    for (const auto &[kind, a, b, from, to] : rows) {
        nodes.push_back({named<FormulaNode::Kind>(node_kinds, kind), a, b, from, to.value_or(sim::no_end)});
    }
    return judge.formula(nodes);
}

/// A field of an output or input of an instance; messages have their head at their beginning. of_message: its quality
/// is that of the number.
int source_of_field(Judge &judge, sim::Simulation &simulation, const std::string &instance, const std::string &port,
                    std::uint32_t offset, const FledgeField &field, std::size_t elements, bool of_message)
{
    const auto separator = instance.find('.');
    sim::Process &process = simulation.process(instance.substr(0, separator));
    const std::shared_ptr<sim::Instance> found =
        separator == std::string::npos ? process.executive().instance() : process.find(instance.substr(separator + 1));
    for (const FledgeField &candidate : sim::fields(found->type())) {
        if (candidate.name == port) {
            return judge.source(found, candidate.offset + offset, field.type, elements,
                                of_message ? std::optional(candidate.offset) : std::nullopt);
        }
    }
    throw std::invalid_argument(instance + " has no " + port);
}

int source_of_event(Judge &judge, sim::Simulation &simulation, const std::string &process, const std::string &name)
{
    sim::Process &found = simulation.process(process);
    for (const auto &event : found.events()) {
        if (event->name == name) {
            return judge.source(found, event);
        }
    }
    throw std::invalid_argument(process + " has no event " + name);
}

int source_of_command(Judge &judge, sim::Simulation &simulation, const std::string &process, int code,
                      const std::string &became)
{
    return judge.source(simulation.recorder(), simulation.process(process), code,
                        named<Judge::Became>(becomes, became));
}

int source_of_packet(Judge &judge, sim::Simulation &simulation, const std::string &process, std::uint16_t stream)
{
    return judge.source(simulation.process(process), stream);
}

/// head: whether it is an output, which begins with its head, behind the header of the packet.
int source_of_telemetry(Judge &judge, sim::Simulation &simulation, const std::string &process, std::uint16_t stream,
                        std::uint32_t offset, int type, std::size_t elements, bool head)
{
    return judge.source(simulation.process(process), stream, TELEMETRY_HEADER + offset, static_cast<FledgeType>(type),
                        elements, head ? std::optional<std::uint32_t>(TELEMETRY_HEADER) : std::nullopt);
}

void play_signals(Judge &judge, const Array<Ns> &times, const std::vector<Array<double>> &sources)
{
    std::vector<std::span<const double>> spans;
    spans.reserve(sources.size());
    for (const auto &source : sources) {
        spans.emplace_back(source.data(), static_cast<std::size_t>(source.size()));
    }
    judge.play({times.data(), static_cast<std::size_t>(times.size())}, spans);
}

/// (low, high, t, atom of the lower bound, the same of the upper one); t is -1 and the atom -1 where nothing decided.
auto value(Judge &judge, int formula)
{
    const sim::Robustness r = judge.value(formula);
    const sim::Witness &without = r.at_low.unknown ? r.at_low : r.at_high; // if any, the atom without a value
    return std::tuple(r.low, r.high, r.at_low.t, r.at_low.atom, r.at_high.t, r.at_high.atom,
                      without.unknown ? without.t : -1, without.unknown ? without.atom : -1);
}

/// Formulas of many judges, by their numbers.
struct Highest {
    std::vector<std::pair<std::shared_ptr<Judge>, int>> formulas;

    Array<double> margins() const
    {
        Array<double> found(static_cast<py::ssize_t>(formulas.size()));
        double *to = found.mutable_data();
        for (const auto &[judge, number] : formulas) {
            *to++ = judge->value(number).high;
        }
        return found;
    }
};

} // namespace

void bind_judge(py::module_ &m)
{
    py::class_<Judge, std::shared_ptr<Judge>>(m, "Judge", "Judges formulas on signals. See sim/judge.h.")
        .def(py::init())
        .def("source", source_of_field, "simulation"_a, "instance"_a, "port"_a, "offset"_a, "field"_a, "elements"_a,
             "of_message"_a)
        .def("event", source_of_event, "simulation"_a, "process"_a, "name"_a)
        .def("command", source_of_command, "simulation"_a, "process"_a, "code"_a, "became"_a)
        .def("packet", source_of_packet, "simulation"_a, "process"_a, "stream"_a)
        .def("telemetry", source_of_telemetry, "simulation"_a, "process"_a, "stream"_a, "offset"_a, "type"_a,
             "elements"_a, "head"_a)
        .def(
            "given", [](Judge &judge, std::size_t elements) { return judge.source(elements); }, "elements"_a)
        .def(
            "constant", [](Judge &judge, const std::vector<double> &numbers) { return judge.constant(numbers); },
            "numbers"_a)
        .def(
            "expression",
            [](Judge &judge, const std::string &operation, int a, int b, double number) {
                return judge.expression(named<Judge::Operation>(operations, operation), a, b, number);
            },
            "operation"_a, "a"_a, "b"_a, "number"_a)
        .def(
            "atom",
            [](Judge &judge, int value, const std::string &relation, double limit, double scale) {
                return judge.atom(value, named<Judge::Relation>(relations, relation), limit, scale);
            },
            "value"_a, "relation"_a, "limit"_a, "scale"_a)
        .def("formula", formula, "rows"_a)
        .def_readwrite("stops", &Judge::stops)
        .def_readwrite("stop", &Judge::stop)
        .def_readwrite("traces", &Judge::traces)
        .def_readwrite("every", &Judge::every)
        .def(
            "watch", [](const std::shared_ptr<Judge> &judge, sim::Simulation &s) { s.recorder().watch(judge); }, "s"_a,
            py::keep_alive<1, 2>())
        .def("play", play_signals, "times"_a, "sources"_a)
        .def("finish", &Judge::finish, "t"_a)
        .def("value", value, "formula"_a)
        .def_property_readonly("went_back", &Judge::went_back)
        .def_property_readonly("times",
                               [](Judge &judge) {
                                   return Array<Ns>(static_cast<py::ssize_t>(judge.times().size()),
                                                    judge.times().data());
                               })
        .def(
            "trace",
            [](Judge &judge, int atom) {
                const std::vector<double> found = judge.trace(atom);
                return Array<double>(static_cast<py::ssize_t>(found.size()), found.data());
            },
            "atom"_a);
    py::class_<Highest>(m, "Highest", "Reads formulas of many judges at once.")
        .def(py::init<std::vector<std::pair<std::shared_ptr<Judge>, int>>>(), "formulas"_a)
        .def("margins", &Highest::margins, "the largest that each can still have");
}

} // namespace fledge::core
