// SPDX-License-Identifier: Apache-2.0
// Plain numbers from Python's numbers, nested sequences and buffers of doubles.
#pragma once

#include "core/object.h"
#include "flight/exec/assign.h"

#include <array>

namespace fledge::core {

/// A nested sequence of numbers, flattened by rows.
struct Numbers {
    std::uint32_t ndim = 0;
    std::array<std::size_t, FLEDGE_DIMS_MAX> shape{};
    std::vector<AssignNumber> values;
};

enum class Read {
    yes,
    foreign, ///< holds an object that only to_si() in Python can convert
    ragged,
    error ///< an exception is set
};

/// A Python number; an exception is set if it is none, or beyond a double.
AssignNumber number_of(PyObject *value);

/// A float or int, but no bool.
bool is_plain_number(PyObject *value);

Read read_numbers(PyObject *value, Numbers &out);

} // namespace fledge::core
