// SPDX-License-Identifier: Apache-2.0
// Dispersed runs, for the Python package fledge.montecarlo.
#include "core/extension.h"

#include "sim/campaign.h"
#include "sim/text.h"
#include "world/dynamics/orbit.h"

#include <pybind11/functional.h>
#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <variant>

namespace py = pybind11;
using namespace py::literals;

namespace fledge::core {

namespace {

using sim::Distribution;
using sim::Ns;

const char *const kinds[] = {"uniform", "normal", "attitude", "choice", "grid", nullptr}; // of Distribution::Kind

Distribution distribution(const std::string &kind, double a, double b, double lo, double hi, const std::string &scale,
                          std::vector<double> choices, std::size_t stride)
{
    Distribution d;
    d.kind = named<Distribution::Kind>(kinds, kind);
    d.a = a;
    d.b = b;
    d.lo = lo;
    d.hi = hi;
    d.relative = scale == "relative";
    d.about = scale == "about";
    d.choices = std::move(choices);
    d.stride = stride;
    return d;
}

void add_dispersion(sim::CampaignPlan &plan, const sim::Simulation &nominal, const std::string &path,
                    std::vector<std::size_t> elements, const Distribution &drawn)
{
    sim::Dispersion dispersion{path, std::move(elements), drawn};
    sim::check_dispersion(nominal, dispersion);
    plan.dispersions.push_back(std::move(dispersion));
}

/// The elements of an orbit, of which some are drawn. `shape`: which two of its numbers give its size and shape.
struct DrawnOrbit {
    std::string path; ///< of the craft's orbit
    std::string shape;
    std::vector<double> nominal;    ///< the two, then i, Omega, omega and f
    std::vector<std::size_t> drawn; ///< which of these the draws replace
    double mu = 0.0, radius = 0.0, surface = 0.0;
    std::vector<double> axes;   ///< of the elements, three rows in N
    std::vector<double> origin; ///< position and velocity of the body in N

    /// r_BN_N and v_BN_N
    std::vector<double> operator()(const std::vector<double> &draws) const
    {
        std::vector<double> x = nominal;
        for (std::size_t k = 0; k < drawn.size(); k++) {
            x[drawn[k]] = draws[k];
        }
        try {
            return state(x);
        } catch (const sim::SetupError &error) {
            throw sim::SetupError(path + ": " + error.what());
        }
    }

private:
    std::vector<double> state(const std::vector<double> &x) const
    {
        world::OrbitElements elements{x[0], x[1], x[2], x[3], x[4], x[5]};
        if (shape == "a, e") {
            elements.p = world::semi_latus_rectum(x[0], x[1]);
        } else if (shape == "altitude, e") {
            elements.p = (radius + x[0]) * (1.0 + x[1]);
        } else if (shape == "rp, e") {
            elements.p = x[0] * (1.0 + x[1]);
        } else if (shape == "rp, ra") {
            if (!(0.0 < x[0] && x[0] <= x[1])) {
                throw sim::SetupError("the radius of periapsis, " + sim::format_number(x[0]) +
                                      " m, is not between 0 and that of apoapsis, " + sim::format_number(x[1]) + " m");
            }
            elements.e = (x[1] - x[0]) / (x[1] + x[0]);
            elements.p = x[0] * (1.0 + elements.e);
        }
        const world::OrbitState relative = world::orbit_state(mu, elements);
        const double lowest = elements.e < 1.0 ? elements.p / (1.0 + elements.e) : relative.r.norm();
        if (lowest < surface) {
            throw sim::SetupError("its lowest point, " + sim::format_number(lowest) +
                                  " m from the centre, is inside the body, of radius " + sim::format_number(surface) +
                                  " m");
        }
        std::vector<double> found = origin;
        for (std::size_t row = 0; row < 3; row++) {
            for (std::size_t k = 0; k < 3; k++) {
                found[k] += axes[3 * row + k] * relative.r[static_cast<Eigen::Index>(row)];
                found[3 + k] += axes[3 * row + k] * relative.v[static_cast<Eigen::Index>(row)];
            }
        }
        return found;
    }
};

void add_orbit(sim::CampaignPlan &plan, const sim::Simulation &nominal, const std::string &craft,
               const std::vector<std::string> &names, const std::vector<Distribution> &distributions,
               const std::string &shape, const std::vector<double> &elements, const std::vector<std::size_t> &drawn,
               double mu, double radius, double surface, const std::vector<double> &axes,
               const std::vector<double> &origin)
{
    sim::Composition composition;
    composition.parameters = {craft + ".r_BN_N", craft + ".v_BN_N"};
    for (std::size_t k = 0; k < names.size(); k++) {
        composition.numbers.push_back({names[k], elements[drawn[k]], distributions[k]});
    }
    composition.values = DrawnOrbit{craft + ".orbit", shape, elements, drawn, mu, radius, surface, axes, origin};
    sim::check_composition(nominal, composition);
    plan.compositions.push_back(std::move(composition));
}

/// A command that is drawn of some, and its time.
struct DrawnCommand {
    std::string path;                                          ///< "flight.commands[0]"
    std::vector<std::vector<std::vector<std::uint8_t>>> known; ///< the packets of each; 0 is none
    double at = 0.0;                                           ///< [s] unless it is drawn, too

    std::vector<sim::ScriptedCommand> operator()(const std::vector<double> &draws) const
    {
        const double time = draws.size() > 1 ? draws[1] : at;
        if (!(time >= 0.0 && time < 9.0e9)) {
            throw sim::SetupError(path + ".at: a command comes at 0 s or later, found " + sim::format_number(time) +
                                  " s");
        }
        const auto which = static_cast<std::size_t>(draws[0]);
        if (!(draws[0] >= 0.0) || which > known.size()) {
            throw sim::SetupError(path + ".which: there are " + std::to_string(known.size()) + " commands, found " +
                                  sim::format_number(draws[0]));
        }
        std::vector<sim::ScriptedCommand> commands;
        for (std::size_t i = 0; which > 0 && i < known[which - 1].size(); i++) {
            commands.push_back({static_cast<Ns>(std::llround(1e9 * time)), known[which - 1][i], true});
        }
        return commands;
    }
};

void add_command(sim::CampaignPlan &plan, const sim::Simulation &nominal, const std::string &process,
                 const std::string &path, const std::vector<std::vector<py::bytes>> &packets, const Distribution &which,
                 const std::variant<double, Distribution> &at)
{
    DrawnCommand command{path, {}, 0.0};
    for (const auto &choice : packets) {
        command.known.push_back(list_of(choice, [](const py::bytes &packet) { return octets(packet); }));
    }
    sim::Composition composition;
    composition.process = process;
    composition.numbers.push_back({path + ".which", 0.0, which});
    if (const auto *drawn = std::get_if<Distribution>(&at)) {
        composition.numbers.push_back({path + ".at", 0.0, *drawn});
    } else {
        command.at = std::get<double>(at);
    }
    composition.commands = std::move(command);
    sim::check_composition(nominal, composition);
    plan.compositions.push_back(std::move(composition));
}

void add_retained(sim::CampaignPlan &plan, const sim::Simulation &nominal, const std::string &port,
                  std::uint32_t offset, std::size_t elements, const FledgeField &field, bool raw)
{
    sim::Retained variable{port, offset, elements, field.type, raw};
    sim::check_retained(nominal, variable);
    plan.retained.push_back(std::move(variable));
}

void add_watched(sim::CampaignPlan &plan, std::size_t elements, bool happened)
{
    using Kind = sim::Retained::Kind;
    sim::Retained variable;
    variable.kind = happened ? Kind::happened : Kind::numbers;
    variable.elements = elements;
    plan.retained.push_back(std::move(variable));
}

/// A numpy array on the result's own memory, which it keeps alive.
py::array_t<double> view(py::handle owner, std::vector<double> &values, const std::vector<std::size_t> &shape)
{
    return py::array_t<double>(shape, values.data(), owner);
}

/// A member of a result that has a row for each run.
template <std::vector<double> sim::CampaignResult::*member> py::array_t<double> rows(const py::object &self)
{
    auto &r = self.cast<sim::CampaignResult &>();
    const std::size_t runs = r.flown.size();
    return view(self, r.*member, {runs, (r.*member).size() / runs});
}

using Progress = Typed<py::object, "Callable[[int, int], object] | None">;

std::pair<std::unique_ptr<sim::CampaignResult>, bool> fly(const sim::Simulation &nominal, const sim::CampaignPlan &plan,
                                                          unsigned threads, const Progress &progress,
                                                          const sim::Watch &watch)
{
    if (!sim::callables(nominal).empty()) {
        throw sim::SetupError("a mission that calls Python cannot be flown by threads");
    }
    Poll poll;
    const auto report = [&](sim::CampaignProgress at) {
        return poll([&] { return progress.is_none() || (progress(at.finished, at.failed), true); });
    };
    std::unique_ptr<sim::CampaignResult> result;
    {
        py::gil_scoped_release release;
        result = std::make_unique<sim::CampaignResult>(sim::fly(nominal, plan, threads, report, watch));
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
    py::class_<Distribution>(m, "Distribution")
        .def(py::init(&distribution), "kind"_a, "a"_a = 0.0, "b"_a = 0.0, "lo"_a = Distribution().lo,
             "hi"_a = Distribution().hi, "scale"_a = "", "choices"_a = std::vector<double>(), "stride"_a = 1,
             "scale: '' (values), 'about' (added to the nominal value) or 'relative' (factors of it).");
    py::class_<Plan>(m, "CampaignPlan")
        .def(py::init<>())
        .def_readwrite("seed", &Plan::seed)
        .def_readwrite("runs", &Plan::runs)
        .def_readwrite("duration", &Plan::duration)
        .def_readwrite("every", &Plan::every)
        .def_readwrite("first", &Plan::first)
        .def_readwrite("points", &Plan::points)
        .def("disperse", add_dispersion, "nominal"_a, "path"_a, "elements"_a, "drawn"_a)
        .def("clear_draws",
             [](Plan &plan) {
                 plan.dispersions.clear();
                 plan.compositions.clear();
             })
        .def("orbit", add_orbit, "nominal"_a, "craft"_a, "names"_a, "distributions"_a, "shape"_a, "elements"_a,
             "drawn"_a, "mu"_a, "radius"_a, "surface"_a, "axes"_a, "origin"_a)
        .def("command", add_command, "nominal"_a, "process"_a, "path"_a, "packets"_a, "which"_a, "at"_a)
        .def("retain", add_retained, "nominal"_a, "port"_a, "offset"_a, "elements"_a, "field"_a, "raw"_a)
        .def("watch", add_watched, "elements"_a, "happened"_a,
             "Retain numbers of a packet, or whether something happened: what `watch` of fly() finds, in its order.")
        .def(
            "check", [](const Plan &plan, const sim::Simulation &nominal) { sim::check_plan(nominal, plan); },
            "nominal"_a);

    py::class_<sim::CampaignResult>(m, "CampaignResult")
        .def_readonly("failures", &sim::CampaignResult::failures)
        .def_property_readonly("health", [](const sim::CampaignResult &r) { return list_of(r.health, health_rows); })
        .def_property_readonly("flown",
                               [](const sim::CampaignResult &r) {
                                   return list_of(r.flown, [](std::uint8_t flown) { return flown != 0; });
                               })
        .def_property_readonly("draws", rows<&sim::CampaignResult::draws>, "(runs, elements)")
        .def_property_readonly(
            "seen",
            [](const py::object &self) {
                auto &r = self.cast<sim::CampaignResult &>();
                const std::size_t runs = r.flown.size();
                return py::array_t<std::uint8_t>({runs, r.seen.size() / runs}, r.seen.data(), self);
            },
            "(runs, pairs of modes, events and branches) how often, up to 255")
        .def_property_readonly("entered", rows<&sim::CampaignResult::entered>, "(runs, modes) [s]")
        .def_property_readonly(
            "retained",
            [](const py::object &self) {
                auto &r = self.cast<sim::CampaignResult &>();
                const std::size_t runs = r.flown.size();
                std::vector<py::array_t<double>> list;
                for (auto &variable : r.retained) {
                    list.push_back(view(self, variable, {runs, r.samples, variable.size() / runs / r.samples}));
                }
                return list;
            },
            "an array (runs, samples, elements) of each variable");

    m.def(
        "callables", [](const sim::Simulation &s) { return sim::callables(s); }, "s"_a);
    m.def("mode_names", sim::mode_names, "simulation"_a);
    m.def(
        "fly_one",
        [](sim::Simulation &simulation, const Plan &plan, std::size_t index, const sim::Watch &watch) {
            py::gil_scoped_release release;
            return std::make_unique<sim::CampaignResult>(sim::fly_one(simulation, plan, index, watch));
        },
        "simulation"_a, "plan"_a, "index"_a, "watch"_a = py::none(),
        "The result of one run, flown in a simulation made for it.");
    m.def("disperse", sim::disperse, "nominal"_a, "simulation"_a, "plan"_a, "index"_a,
          "Set seed and parameters of one run; returns the draws.");
    m.def("fly", fly, "nominal"_a, "plan"_a, "threads"_a, "progress"_a = py::none(), "watch"_a = py::none(),
          "(result, whether Ctrl-C stopped it); progress(finished, failed) is called now and then. watch: makes a "
          "judge look at a simulation, and gives it and the atoms of what the plan watches.");
}

} // namespace fledge::core
