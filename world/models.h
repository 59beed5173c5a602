// SPDX-License-Identifier: Apache-2.0
// All models of this library by name. introspect/emit/models.py writes the list from the interfaces.
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
