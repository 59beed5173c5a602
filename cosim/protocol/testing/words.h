// SPDX-License-Identifier: Apache-2.0
// A message of one word, for tests.
#pragma once

#include "cosim/protocol/protocol.h"

#include <cstring>

namespace fledge::cosim {

inline constexpr const char *word_text = "uint64 x  # x [-] a word\n";

inline Payload word(std::uint64_t x)
{
    return make_payload(std::as_bytes(std::span(&x, 1)));
}

inline std::uint64_t word_of(const Payload &payload)
{
    std::uint64_t x = 0;
    std::memcpy(&x, payload.data() + 4, 8);
    return x;
}

} // namespace fledge::cosim
