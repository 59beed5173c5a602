// SPDX-License-Identifier: Apache-2.0
// The state of a run as bytes: a hash of its layout, a checksum of all else, the state. Private to the kernel.
#pragma once

#include "sim/runtime.h"

namespace fledge::sim {

std::vector<std::byte> save(Runtime &runtime);

std::size_t snapshot_room(Runtime &runtime); ///< see Simulation::snapshot_room()

std::vector<Simulation::StateBlock> state_blocks(Runtime &runtime);

/// Throws SetupError if the bytes are damaged, or of a run of another structure; returns whether they have the state of
/// commands. edited: the caller has changed numbers on purpose, so that the checksum does not count.
bool check_snapshot(Runtime &runtime, std::span<const std::byte> bytes, bool edited = false);

/// Throws as the check does, and changes nothing then.
void restore(Runtime &runtime, std::span<const std::byte> bytes, bool edited);

} // namespace fledge::sim
