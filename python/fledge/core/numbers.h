// SPDX-License-Identifier: Apache-2.0
// Plain numbers from Python's numbers, nested sequences and buffers of doubles.
#pragma once

#include "core/object.h"

#include <array>
#include <limits>

namespace fledge::core {

/// Holds every double and every whole number of 64 bits exactly.
using Number = long double;
static_assert(std::numeric_limits<Number>::digits >= 64);

/// A nested sequence of numbers, flattened by rows.
struct Numbers {
    int ndim = 0;
    std::array<std::size_t, FLEDGE_DIMS_MAX> shape{};
    std::vector<Number> values;
};

enum class Read {
    yes,
    foreign, ///< holds an object that only to_si() in Python can convert
    ragged,
    error ///< an exception is set
};

/// A Python number; an exception is set if it is none, or beyond a double.
Number number_of(PyObject *value);

/// A float or int, but no bool.
bool is_plain_number(PyObject *value);

Read read_numbers(PyObject *value, Numbers &out);

} // namespace fledge::core
