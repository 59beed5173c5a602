// SPDX-License-Identifier: Apache-2.0
// Input that no one wrote on purpose must never bring the host down. Each function tries one random input; a sanitizer
// sees what it does wrong. It returns what is wrong besides, for a person, or "".
#pragma once

#include <cstdint>
#include <string>

namespace fledge::emulator::testing {

/// Words decode to something; capstone gives a legal one the same name.
std::string fuzz_decoder(std::uint64_t seed);

/// A processor in any state in front of memory with any words: all engines go the same way.
std::string fuzz_processor(std::uint64_t seed);

/// A damaged ELF file, board file or snapshot is refused by an Error, or it can be run.
std::string fuzz_files(std::uint64_t seed);

} // namespace fledge::emulator::testing
