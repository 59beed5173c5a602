// SPDX-License-Identifier: Apache-2.0
// Clones that are stepped together, for the Python package fledge.mission. Times are integer nanoseconds here.
#include "core/extension.h"

#include "sim/batch.h"

#include <pybind11/numpy.h>
#include <pybind11/stl.h>

namespace py = pybind11;
using namespace py::literals;

namespace fledge::core {

namespace {

using sim::Batch;
using sim::BatchField;
using sim::BatchPlan;
using Rows = py::array_t<double, py::array::c_style>;
template <class T> using Column = py::array_t<T, py::array::c_style>;

/// Elements of a field of an object, which is a module, a model, or a struct inside of one.
void add_field(std::vector<BatchField> &fields, py::handle object, const FledgeField &field, std::size_t first,
               std::vector<std::string> names)
{
    PyObject *root = root_of(object.ptr());
    const auto instance = instance_of(root ? py::handle(root) : object);
    const std::ptrdiff_t at = as_object(object.ptr())->memory - instance->memory();
    const std::size_t offset = field.offset + first * element_size(field.type);
    fields.push_back({instance->path, static_cast<std::uint32_t>(at) + static_cast<std::uint32_t>(offset), field.type,
                      std::move(names)});
}

/// Without Python's lock; throws what Ctrl-C raised.
template <class Work> void unlocked(const Work &work)
{
    Poll poll;
    {
        py::gil_scoped_release release;
        work([&] { return poll([] { return true; }); });
    }
    poll.rethrow();
}

void reset(Batch &batch, const Column<std::int64_t> &which, const Column<std::uint64_t> &seeds,
           const Column<std::uint64_t> &runs, const py::bytes &snapshot)
{
    const std::vector<std::size_t> clones(which.data(), which.data() + which.size());
    std::vector<sim::BatchRun> chosen(clones.size());
    for (std::size_t i = 0; i < clones.size(); i++) {
        chosen[i] = {seeds.at(i), runs.at(i)};
    }
    const std::string_view bytes = snapshot;
    const std::span from(reinterpret_cast<const std::byte *>(bytes.data()), bytes.size());
    unlocked([&](const Batch::Poll &poll) { batch.reset(clones, chosen, from, poll); });
}

Rows step_clones(Batch &batch, const Rows &actions)
{
    Rows observed({batch.clones(), batch.observations()});
    const std::span given(actions.data(), static_cast<std::size_t>(actions.size()));
    const std::span to(observed.mutable_data(), static_cast<std::size_t>(observed.size()));
    unlocked([&](const Batch::Poll &poll) { batch.step(given, to, poll); });
    return observed;
}

Rows observe(const Batch &batch)
{
    Rows observed({batch.clones(), batch.observations()});
    batch.observe({observed.mutable_data(), static_cast<std::size_t>(observed.size())});
    return observed;
}

/// A number of each clone.
template <class T, class F> Column<T> column(const Batch &batch, const F &number)
{
    Column<T> values(batch.clones());
    for (std::size_t i = 0; i < batch.clones(); i++) {
        values.mutable_at(i) = static_cast<T>(number(i));
    }
    return values;
}

} // namespace

void bind_batch(py::module_ &m)
{
    py::class_<BatchPlan>(m, "BatchPlan")
        .def(py::init([](std::size_t clones, sim::Ns every, unsigned threads, const sim::CampaignPlan *campaign,
                         bool separate, std::size_t delay) {
                 return BatchPlan{clones,   every, threads, {}, {}, campaign ? *campaign : sim::CampaignPlan{},
                                  separate, delay};
             }),
             "clones"_a, "every"_a, "threads"_a, "campaign"_a, "separate"_a, "delay"_a)
        .def(
            "act",
            [](BatchPlan &plan, const AnyObject &object, const FledgeField &field, std::size_t first,
               std::vector<std::string> names) { add_field(plan.actions, object, field, first, std::move(names)); },
            "object"_a, "field"_a, "first"_a, "names"_a)
        .def(
            "observe",
            [](BatchPlan &plan, const AnyObject &object, const FledgeField &field, std::size_t first,
               std::vector<std::string> names) {
                add_field(plan.observations, object, field, first, std::move(names));
            },
            "object"_a, "field"_a, "first"_a, "names"_a);

    py::class_<Batch>(m, "Batch")
        .def(py::init<const sim::Simulation &, BatchPlan>(), "simulation"_a, "plan"_a)
        .def("reset", reset, "which"_a, "seeds"_a, "runs"_a, "snapshot"_a)
        .def("step", step_clones, "actions"_a,
             "The observations after the step; `actions` must have a row for each clone.")
        .def("observe", observe)
        .def("is_late", &Batch::is_late, "observation"_a)
        .def("failure", &Batch::failure, "clone"_a)
        .def("clone", &Batch::clone, py::return_value_policy::reference_internal, "clone"_a)
        .def("copy", &Batch::copy, "clone"_a)
        .def(
            "repeat",
            [](const Batch &b, std::size_t clone, const Rows &rows) {
                py::gil_scoped_release release;
                return b.repeat(clone, static_cast<std::size_t>(rows.shape(0)),
                                {rows.data(), static_cast<std::size_t>(rows.size())});
            },
            "clone"_a, "rows"_a)
        .def_property_readonly(
            "failed",
            [](const Batch &b) { return column<bool>(b, [&](std::size_t i) { return !b.failure(i).empty(); }); })
        .def_property_readonly(
            "time", [](const Batch &b) { return column<sim::Ns>(b, [&](std::size_t i) { return b.time(i); }); })
        .def_property_readonly(
            "seeds",
            [](const Batch &b) { return column<std::uint64_t>(b, [&](std::size_t i) { return b.run(i).seed; }); })
        .def_property_readonly(
            "runs",
            [](const Batch &b) { return column<std::uint64_t>(b, [&](std::size_t i) { return b.run(i).index; }); })
        .def_property_readonly("draws", [](const Batch &b) {
            Rows draws({b.clones(), b.drawn()});
            for (std::size_t i = 0; i < b.clones(); i++) {
                std::copy(b.draws(i).begin(), b.draws(i).end(), draws.mutable_data() + i * b.drawn());
            }
            return draws;
        });
}

} // namespace fledge::core
