// SPDX-License-Identifier: Apache-2.0
// The database that Python holds, and values as objects of Python.
#pragma once

#include "ground/monitor/limits.h"

#include <pybind11/pybind11.h>

namespace py = pybind11;

namespace fledge::ground {

class Loaded {
public:
    Loaded(Database database, bool plans) : db_(std::move(database)), decoder_(db_, plans) {}

    const Database &database() const { return db_; }
    Decoder &decoder() { return decoder_; }

private:
    Database db_;
    Decoder decoder_;
};

/// The object of a word of this kind; bytes: of a text or a binary value; raw: of a label that no enumerator has.
py::object object(const Type &type, Kind kind, std::uint64_t word, std::string_view bytes, std::uint64_t raw);

/// {"warning": [low, high]}, None: open. Throws Refusal.
Bands bands_of(const py::dict &given);

/// The name of a kind of values.
const char *name_of(Kind kind);

/// The raw value of a field and its value, None if it has none.
std::pair<py::object, py::object> objects(const Database &database, const Decoded &packet, std::size_t field);

} // namespace fledge::ground
