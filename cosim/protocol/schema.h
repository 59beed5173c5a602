// SPDX-License-Identifier: Apache-2.0
// The definition of a message, which nodes exchange at matching: the archive's ros2msg text, in which comments carry
// true names, units and shapes (introspect/emit/schema.py).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace fledge::cosim {

/// An invalid definition. The message names the line and the reason.
class SchemaError : public std::runtime_error {
    using runtime_error::runtime_error;
};

/// As frames carry it.
struct Schema {
    std::string name;       ///< "AttError"; "": any
    std::string text;       ///< "": the node uses the definition of its partner
    std::uint32_t size = 0; ///< bytes of the struct; 0 without text
    std::uint64_t hash = 0; ///< schema_hash(text); equal texts need no comparison

    bool given() const { return !text.empty(); }
    bool operator==(const Schema &) const = default;
};

/// FNV-1a, 64 bits, over the bytes of the text.
std::uint64_t schema_hash(std::string_view text);

/// A schema from its name and text. Throws SchemaError.
Schema make_schema(std::string name, std::string text);

/// A number, or an array of numbers, in memory order.
struct SchemaField {
    std::string name;  ///< from the message down: "head.t", "sigma_BR", "wheels[2].axis_B"
    std::string type;  ///< "float64"
    std::string unit;  ///< "" if none is given
    std::string shape; ///< "", "3", "3, 3"
    std::uint32_t offset = 0;
    std::uint32_t item = 0;   ///< bytes of one number
    std::uint32_t count = 1;  ///< numbers
    std::string choices = {}; ///< of an enumeration: "OFF=0, ON=1"

    bool operator==(const SchemaField &) const = default;
};

/// Limits of a definition, which comes from another program.
inline constexpr std::uint32_t schema_size_max = 1u << 24;
inline constexpr std::size_t schema_fields_max = 1u << 16;
inline constexpr std::size_t schema_text_max = 1u << 24; ///< bytes of all names, units and choices

/// The fields that a text defines. Throws SchemaError, also if the struct would need padding.
std::vector<SchemaField> parse_schema(std::string_view text);

/// Why a definition cannot be used: its text, or a size or hash that is not that of the text; "" if it can.
std::string schema_fault(const Schema &schema);

/// The fields of a definition. Throws SchemaError, also if its size is not that of its text.
std::vector<SchemaField> fields_of(const Schema &schema);

/// Why a subscription cannot read a publication: the first field that differs; "" if it can. Names, types, shapes and
/// units have to be equal; the prose in comments may differ.
std::string schema_difference(const Schema &published, const Schema &subscribed);

/// Convert the numbers of a struct from one byte order to the other.
void swap_bytes(std::span<const SchemaField> fields, std::span<std::byte> bytes);

} // namespace fledge::cosim
