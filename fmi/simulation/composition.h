// SPDX-License-Identifier: Apache-2.0
// A simulation as JSON, so that an FMU flies it without Python. What is no data is refused: Python in events and
// updates, and data of a project's own models besides those that all models have (see Model::copy_setup).
//
// Bytes are hexadecimal, times integer nanoseconds. Instances are named by their paths ("world.craft"), ports by theirs
// ("world.craft.external"); enumerators are their numbers.
//
// Example:
//
//     #include "fmi/simulation/composition.h"
//     #include <nlohmann/json.hpp>
//     std::unique_ptr<sim::Simulation> again(const sim::Simulation &simulation)
//     {
//         return fmi::build(nlohmann::json::parse(fmi::compose(simulation, "").text), "files");
//     }
#pragma once

#include "sim/simulation.h"

#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <utility>
#include <vector>

namespace fledge::fmi {

struct Composition {
    std::string text; ///< JSON
    /// (path, name in the folder of the text) of the files that it needs.
    std::vector<std::pair<std::string, std::string>> files;
};

/// A simulation that has not run. process: the one that is to fly; the others are there for their outputs, which then
/// come from outside; "": all fly. Throws CompositionError with all that is no data, SetupError for an unknown process
/// or one that depends on others besides wires.
Composition compose(const sim::Simulation &simulation, const std::string &process);

/// folder: where its files are. The functions of processes whose outputs come from outside do nothing: what is written
/// into those outputs stays. Throws SetupError with the place in the JSON.
std::unique_ptr<sim::Simulation> build(const nlohmann::json &composition, const std::string &folder);

/// All instances of a simulation, in the order of their processes: `block` of an FMU's variables is an index of it.
std::vector<std::shared_ptr<sim::Instance>> blocks(const sim::Simulation &simulation);

} // namespace fledge::fmi
