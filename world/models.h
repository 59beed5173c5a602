// SPDX-License-Identifier: Apache-2.0
// All models of this library, for whoever creates them by name.
#pragma once

#include "sim/model.h"

#include <span>

namespace fledge::world {

std::span<const sim::ModelType> models();

} // namespace fledge::world
