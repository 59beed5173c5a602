// SPDX-License-Identifier: Apache-2.0
// Reads MCAP files (https://mcap.dev/spec): the records of the container, and whole files.
//
// Scan reads a file from its beginning, with or without a summary, so that whole, truncated and unindexed files are
// read alike, and checks every checksum. It stops at the first fault. The messages before it stay readable, and
// `problem` names the fault and the data that are still good.
//
// Example:
//
//     std::uint64_t messages(record::Bytes file)
//     {
//         const record::Scan scan(file, [](const record::Channel &) { return std::nullopt; });
//         std::uint64_t n = 0;
//         for (const record::Channel &channel : scan.channels) {
//             n += channel.offsets.size();
//         }
//         return scan.problem.empty() ? n : 0;
//     }
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace fledge::record {

using Bytes = std::span<const std::uint8_t>;
using Pairs = std::vector<std::pair<std::string, std::string>>;

inline constexpr std::array<std::uint8_t, 8> magic{0x89, 'M', 'C', 'A', 'P', '0', '\r', '\n'};
inline constexpr std::size_t prefix = 9, chunk_head = 49; ///< of a record, and of a chunk that is not compressed
inline constexpr std::size_t time_at = 15, cdr_at = 31, payload_at = 35; ///< within a Message record

/// The operation codes of records.
inline constexpr std::uint8_t op_header = 1, op_footer = 2, op_schema = 3, op_channel = 4, op_message = 5, op_chunk = 6,
                              op_message_index = 7, op_chunk_index = 8, op_attachment = 9, op_attachment_index = 10,
                              op_statistics = 11, op_metadata = 12, op_metadata_index = 13, op_summary_offset = 14,
                              op_data_end = 15;

/// A fault at a byte of the file.
struct Damage {
    std::uint64_t at;
    std::string what;
};

/// The file has a feature of MCAP that is not supported.
struct Unsupported {
    std::string what;
};

/// A little-endian number of n bytes.
inline std::uint64_t number(const std::uint8_t *at, std::size_t n)
{
    std::uint64_t value = 0;
    while (n-- > 0) {
        value = value << 8 | at[n];
    }
    return value;
}

std::uint32_t crc(Bytes bytes);

/// The fields of a record in their order; throws Damage if a field reaches beyond the record.
struct Fields {
    Bytes rest;
    std::uint64_t record = 0;

    Bytes take(std::uint64_t n);
    std::uint64_t integer(std::size_t n) { return number(take(n).data(), n); }
    std::string text(); ///< throws Damage, too, if it is not UTF-8
    Pairs pairs();      ///< if a key is repeated, its last value counts
};

/// A Channel record, its Schema, and the places of its messages.
struct Channel {
    std::uint16_t id = 0, schema = 0;
    std::string topic, encoding;
    std::array<std::string, 3> definition; ///< of the schema: name, encoding, text
    Pairs metadata;
    std::vector<std::uint64_t> offsets;  ///< of its Message records in the file
    std::optional<std::uint64_t> length; ///< required of each Message record
};

using Metadata = std::vector<std::pair<std::string, Pairs>>;

/// The contents of a file.
struct Scan {
    /// The length, without the prefix, that each Message record of a new channel must have; none: any.
    using Length = std::function<std::optional<std::uint64_t>(const Channel &)>;

    /// Throws Unsupported.
    Scan(Bytes file, const Length &length);

    std::vector<Channel> channels; ///< in the order of their declaration
    Metadata metadata;             ///< records of one name are not merged
    std::string profile, library;
    std::string problem; ///< the fault; "": there is none
    std::uint64_t problem_at = 0;
    std::optional<std::uint64_t> good_until; ///< [ns] all messages before it are complete and right; none: not known
};

/// The metadata of a file, up to the first fault; of chunks only the heads are read.
Metadata metadata_of(Bytes file);

} // namespace fledge::record
