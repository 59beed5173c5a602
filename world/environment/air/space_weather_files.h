// SPDX-License-Identifier: Apache-2.0
// Reading the files of indices that space_weather.h names.
#pragma once

#include "world/environment/air/space_weather.h"

namespace fledge::world {

/// Throws SetupError with file and line if it is none of them, or damaged.
SpaceWeather::Activity read_activity(const std::string &path);

} // namespace fledge::world
