// SPDX-License-Identifier: Apache-2.0
// Time and interrupts are the same on every engine, in slices of any length, and after a snapshot taken anywhere.
// All return what differs, for a person, or "".
#pragma once

#include <cstdint>
#include <string>

namespace fledge::emulator::testing {

/// A random program with timers on all engines: in slices of random lengths, and in one.
std::string compare_times(std::uint64_t seed);

/// Another one: snapshots at random times, in memory and as a file, each continued on two engines.
std::string compare_snapshots(std::uint64_t seed, int count);

} // namespace fledge::emulator::testing
