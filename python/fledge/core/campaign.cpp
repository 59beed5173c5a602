// SPDX-License-Identifier: Apache-2.0
// Dispersed runs, for the Python package fledge.montecarlo.
#include "core/extension.h"

#include "sim/campaign.h"

#include <pybind11/numpy.h>
#include <pybind11/stl.h>

namespace py = pybind11;

namespace fledge::core {

namespace {

using sim::Distribution;
using sim::Ns;

const char *const kinds[] = {"uniform", "normal", "attitude", "choice", nullptr}; // of Distribution::Kind

void add_dispersion(sim::CampaignPlan &plan, const sim::Simulation &nominal, const std::string &path,
                    std::vector<std::size_t> elements, const std::string &kind, double a, double b, double lo,
                    double hi, const std::string &scale, std::vector<double> choices)
{
    sim::Dispersion dispersion{path, std::move(elements), {}};
    Distribution &d = dispersion.distribution;
    d.kind = named<Distribution::Kind>(kinds, kind);
    d.a = a;
    d.b = b;
    d.lo = lo;
    d.hi = hi;
    d.relative = scale == "relative";
    d.about = scale == "about";
    d.choices = std::move(choices);
    sim::check_dispersion(nominal, dispersion);
    plan.dispersions.push_back(std::move(dispersion));
}

void add_retained(sim::CampaignPlan &plan, const sim::Simulation &nominal, const std::string &port,
                  std::uint32_t offset, std::size_t elements, const FledgeField &field)
{
    sim::Retained variable{port, offset, elements, field.type};
    sim::check_retained(nominal, variable);
    plan.retained.push_back(std::move(variable));
}

/// A numpy array on the result's own memory, which it keeps alive.
py::array view(py::handle owner, std::vector<double> &values, std::vector<std::size_t> shape)
{
    return py::array_t<double>(std::move(shape), values.data(), owner);
}

std::pair<std::unique_ptr<sim::CampaignResult>, bool> fly(const sim::Simulation &nominal, const sim::CampaignPlan &plan,
                                                          unsigned threads, py::object progress)
{
    if (sim::has_callables(nominal)) {
        throw sim::SetupError("a mission that calls Python cannot be flown by threads");
    }
    Poll poll;
    const auto report = [&](sim::CampaignProgress at) {
        return poll([&] { return progress.is_none() || (progress(at.finished, at.failed), true); });
    };
    std::unique_ptr<sim::CampaignResult> result;
    {
        py::gil_scoped_release release;
        result = std::make_unique<sim::CampaignResult>(sim::fly(nominal, plan, threads, report));
    }
    try {
        poll.rethrow();
    } catch (py::error_already_set &error) {
        if (!error.matches(PyExc_KeyboardInterrupt)) {
            throw;
        }
        return {std::move(result), true}; // with the finished runs
    }
    return {std::move(result), false};
}

} // namespace

void bind_campaign(py::module_ &m)
{
    using Plan = sim::CampaignPlan;
    py::class_<Plan>(m, "CampaignPlan")
        .def(py::init<>())
        .def_readwrite("seed", &Plan::seed)
        .def_readwrite("runs", &Plan::runs)
        .def_readwrite("duration", &Plan::duration)
        .def_readwrite("every", &Plan::every)
        .def("disperse", add_dispersion, py::arg("nominal"), py::arg("path"), py::arg("elements"), py::arg("kind"),
             py::arg("a"), py::arg("b"), py::arg("lo"), py::arg("hi"), py::arg("scale"), py::arg("choices"),
             "scale: '' (values), 'about' (added to the nominal value) or 'relative' (factors of it).")
        .def("retain", add_retained)
        .def("check", [](const Plan &plan, const sim::Simulation &nominal) { sim::check_plan(nominal, plan); });

    py::class_<sim::CampaignResult>(m, "CampaignResult")
        .def_readonly("failures", &sim::CampaignResult::failures)
        .def_property_readonly("health", [](const sim::CampaignResult &r) { return list_of(r.health, health_rows); })
        .def_property_readonly("flown",
                               [](const sim::CampaignResult &r) {
                                   return list_of(r.flown, [](std::uint8_t flown) { return flown != 0; });
                               })
        .def_property_readonly(
            "draws",
            [](py::object self) {
                auto &r = self.cast<sim::CampaignResult &>();
                const std::size_t runs = r.flown.size();
                return view(self, r.draws, {runs, r.draws.size() / runs});
            },
            "(runs, elements)")
        .def_property_readonly(
            "retained",
            [](py::object self) {
                auto &r = self.cast<sim::CampaignResult &>();
                const std::size_t runs = r.flown.size();
                py::list list;
                for (auto &variable : r.retained) {
                    list.append(view(self, variable, {runs, r.samples, variable.size() / runs / r.samples}));
                }
                return list;
            },
            "an array (runs, samples, elements) of each variable");

    m.def("has_callables", sim::has_callables);
    m.def(
        "fly_one",
        [](sim::Simulation &simulation, const Plan &plan, std::size_t index) {
            py::gil_scoped_release release;
            return std::make_unique<sim::CampaignResult>(sim::fly_one(simulation, plan, index));
        },
        "The result of one run, flown in a simulation made for it.");
    m.def("disperse", sim::disperse, "Set seed and parameters of one run; returns the draws.");
    m.def("fly", fly, py::arg("nominal"), py::arg("plan"), py::arg("threads"), py::arg("progress") = py::none(),
          "(result, whether Ctrl-C stopped it); progress(finished, failed) is called now and then.");
}

} // namespace fledge::core
