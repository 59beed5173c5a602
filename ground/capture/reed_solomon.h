// SPDX-License-Identifier: Apache-2.0
// The Reed-Solomon code of telemetry (CCSDS 131.0-B): 255 symbols, 32 of them check symbols, in dual basis.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

namespace fledge::ground {

constexpr std::size_t reed_solomon_length = 255, reed_solomon_check = 32;

/// Correct a codeblock of `depth` interleaved code words in place: the frame, then 32 * depth check symbols. A shorter
/// codeblock has virtual fill. Returns the number of wrong symbols; nothing: a code word has more than 16, and stays
/// unchanged. `codeblock` has depth * n bytes, n from 33 to 255.
std::optional<std::size_t> reed_solomon_correct(std::span<std::uint8_t> codeblock, std::size_t depth);

} // namespace fledge::ground
