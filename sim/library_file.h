// SPDX-License-Identifier: Apache-2.0
// The shared library of a project: tables of its modules, and what makes its models.
#pragma once

#include "sim/model_library.h"
#include "sim/table.h"

#include <span>
#include <string>

namespace fledge::sim {

struct LibraryFile {
    const FledgeLibrary *tables;
    std::span<const ModelType> models;
};

/// Throws SetupError if the library was built for another version of what is named.
void check_version(const std::string &library, const char *what, std::uint32_t found, std::uint32_t ours);

/// Load a library, which exports `fledge_library_<name>`, and `fledge_models_<name>` if it has models. The tables of
/// the messages that it shares with Fledge are in the library here that has the address `ours`; a path without a slash
/// is beside that. It stays open, because types live as long as the process. Throws SetupError if it cannot be loaded,
/// or is no such library.
LibraryFile open_library(const std::string &path, const std::string &name, const void *ours);

} // namespace fledge::sim
