// SPDX-License-Identifier: Apache-2.0
// The database that Python holds, and conversions between values and objects of Python.
#pragma once

#include "core/typed.h"
#include "ground/database/command_decoder.h"
#include "ground/monitor/limits.h"

#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <array>

namespace py = pybind11;

namespace fledge::ground {

using core::Typed;
using Value = Typed<py::object, "int | float | str | bytes | None">;
using PathOrNone = std::optional<std::string>;          ///< of a container
using ArgumentDict = Typed<py::dict, "dict[str, Any]">; ///< arguments of a command
using LimitDict = Typed<py::dict, "dict[str, list[float | None]]">;
using Names = Typed<py::dict, "dict[str, str]">;
using DictRows = Typed<py::list, "list[dict[str, Any]]">; ///< dicts for JSON

class Loaded {
public:
    Loaded(Database database, bool plans) : db_(std::move(database)), decoder_(db_, plans) {}

    const Database &database() const { return db_; }
    Decoder &decoder() { return decoder_; }

    /// The decoder of commands, which is built at its first use.
    CommandDecoder &commands(Header header)
    {
        auto &decoder = commands_[static_cast<std::size_t>(header)];
        if (!decoder) {
            decoder = std::make_unique<CommandDecoder>(db_, header);
        }
        return *decoder;
    }

private:
    Database db_;
    Decoder decoder_;
    std::array<std::unique_ptr<CommandDecoder>, 3> commands_; ///< by headers
};

/// The bytes of an object of Python, while it lives, and the object of bytes.
inline std::span<const std::uint8_t> octets(std::string_view bytes)
{
    return {reinterpret_cast<const std::uint8_t *>(bytes.data()), bytes.size()};
}

inline py::bytes bytes_of(std::span<const std::uint8_t> octets)
{
    return {reinterpret_cast<const char *>(octets.data()), octets.size()};
}

/// The object of a word of this kind; bytes: of a text or a binary value; raw: of a label that no enumerator has.
Value object(const Type &type, Kind kind, std::uint64_t word, std::string_view bytes, std::uint64_t raw);

/// The object of the end of a range; None: it is open.
py::object end_of(const Number &end);

/// {"warning": [low, high]}, None: open. Throws Refusal.
Bands bands_of(const LimitDict &given);

/// The name of a kind of values.
const char *name_of(Kind kind);

inline PathOrNone path_of(const Database &database, Id container)
{
    return container == no_id ? std::nullopt : std::optional(database.containers[container].path);
}

/// The raw value of a field and its value, None if it has none.
std::pair<Value, Value> objects(const Database &database, const Decoded &packet, std::size_t field);

} // namespace fledge::ground
