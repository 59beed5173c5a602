// SPDX-License-Identifier: Apache-2.0
// All models of this library by name. introspect/emit/models.py writes the list from the interfaces.
//
// Example:
//
//     #include "sim/simulation.h"
//     std::shared_ptr<sim::Instance> make(std::string_view name)
//     {
//         for (const sim::ModelType &type : world::models()) {
//             if (type.interface->name == name) {
//                 return std::make_shared<sim::Instance>(type);
//             }
//         }
//         return nullptr;
//     }
#pragma once

#include "sim/model_library.h"

#include <span>

extern "C" const fledge::sim::ModelLibrary fledge_models_world;

namespace fledge::world {

inline std::span<const sim::ModelType> models()
{
    return {fledge_models_world.types, fledge_models_world.n};
}

} // namespace fledge::world
