// SPDX-License-Identifier: Apache-2.0
// The state of a run as bytes. Private to the kernel.
#pragma once

#include "sim/runtime.h"

namespace fledge::sim {

std::vector<std::byte> save(Runtime &runtime);

std::vector<Simulation::StateBlock> state_blocks(Runtime &runtime);

/// Throws SetupError if the bytes are of a run of another structure; returns whether they have the state of commands.
bool check_snapshot(Runtime &runtime, std::span<const std::byte> bytes);

/// Throws as the check does.
void restore(Runtime &runtime, std::span<const std::byte> bytes);

} // namespace fledge::sim
