// SPDX-License-Identifier: Apache-2.0
// Definitions that the files of the decoder share; users include decoder.h.
//
//     decoder.cpp             packets, entry by entry
//     decoder_plans.cpp       containers whose places are fixed, in loops
//     decoder_values.cpp      references, conditions and calibration
#pragma once

#include "ground/database/decoder.h"

namespace fledge::ground {

inline constexpr std::size_t most_fields = 1 << 20; // of a packet
inline constexpr std::size_t most_effort = 1 << 23; // entries and 8-byte words that a packet may take

inline std::uint64_t word(double x)
{
    return std::bit_cast<std::uint64_t>(x);
}

/// The enumerators of a type: a table from the lowest value on if it is short, and all in their order.
struct Decoder::Labels {
    std::int64_t low = 0;
    std::vector<std::uint32_t> table;
    std::vector<std::pair<std::int64_t, std::uint32_t>> sorted; ///< low end, place
};

/// The value of an earlier packet.
struct Decoder::Held {
    Reference reference;
    bool there = false;
    Field field{};
    std::uint64_t raw = 0, value = 0;
    Status status = Status::good;
    std::string text; ///< of a text or binary value
};

struct Decoder::Walk {
    std::size_t at;                     ///< [bits]
    std::size_t start;                  ///< [bits] of the container
    bool included = false;              ///< in another container
    bool back = false;                  ///< `at` is behind an entry that is placed from the packet's end
    std::size_t front = 0;              ///< [bits] then: where the entries of heirs begin
    std::size_t most = 0;               ///< [bits] behind the furthest entry that is placed from the start
    std::size_t tail = ~std::size_t(0); ///< [bits] of the first entry that is placed from the end
    std::size_t end = 0;                ///< [bits] behind the furthest of these
};

/// Decodes a container whose places are fixed, as loops.
struct Decoder::Plan {
    enum class Load : std::uint8_t { u8, u16, u32, u64, i8, i16, i32, f32, f64, bits, other };
    enum class Make : std::uint8_t { same, from_natural, from_integer, line, other };
    struct Step {
        Load load;
        Make make;
        std::uint32_t first, n; ///< fields
        std::uint32_t bits;     ///< of each
        std::size_t at;         ///< [bits] of the first
        const Type *type;       ///< of the first, and of all unless `make` needs no type
    };
    /// Finds the heirs by a value that restrictions compare: those that may fit each value, and those without it.
    struct Dispatch {
        std::size_t at = 0;
        const Encoding *encoding = nullptr; ///< nullptr: there is none
        std::unordered_map<std::uint64_t, std::vector<Id>> heirs;
        std::vector<Id> others;
    };
    bool fixed = false;
    bool searches = false;         ///< its heirs are searched entry by entry
    std::size_t end = 0, most = 0; ///< [bits] behind the last entry, and behind the furthest
    std::vector<Field> fields;
    std::vector<std::size_t> places; ///< [bits] of each field
    std::vector<PathNode> nodes{{0, 0, no_id}};
    std::vector<EmptyArray> empty;
    std::vector<Step> steps;
    std::vector<std::pair<std::uint32_t, std::uint32_t>> held; ///< field, slot
    Dispatch dispatch;
};

} // namespace fledge::ground
