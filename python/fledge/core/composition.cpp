// SPDX-License-Identifier: Apache-2.0
// A simulation as JSON, as FMUs have it.
#include "core/extension.h"

#include "fmi/simulation/composition.h"

#include <nlohmann/json.hpp>
#include <pybind11/stl.h>

namespace py = pybind11;
using namespace py::literals;

namespace fledge::core {

void bind_composition(py::module_ &m)
{
    m.def(
        "compose",
        [](const sim::Simulation &simulation, const std::string &process) {
            fmi::Composition made = fmi::compose(simulation, process);
            return std::pair(std::move(made.text), std::move(made.files));
        },
        "simulation"_a, "process"_a,
        "(JSON, (path, name) of each file that it needs) of a simulation that has not run. process: the outputs of the "
        "others come from outside; empty: none.");
    m.def(
        "build_composition",
        [](const std::string &text, const std::string &folder) {
            return fmi::build(nlohmann::json::parse(text), folder);
        },
        "text"_a, "folder"_a, "The simulation of compose().");
}

} // namespace fledge::core
