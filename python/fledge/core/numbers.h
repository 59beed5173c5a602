// SPDX-License-Identifier: Apache-2.0
// Plain numbers from what Python hands over: numbers, nested sequences, buffers of doubles.
#pragma once

#include "core/object.h"

#include <array>

namespace fledge::core {

/// A nested sequence of numbers, flattened by rows.
struct Numbers {
    int ndim = 0;
    std::array<std::size_t, FLEDGE_DIMS_MAX> shape{};
    std::vector<double> values;
};

enum class Read {
    yes,
    foreign, ///< holds something that only the Python helper understands
    ragged,
    error ///< an exception is set
};

/// A float or int, but no bool.
bool is_plain_number(PyObject *value);

Read read_numbers(PyObject *value, Numbers &out);

} // namespace fledge::core
