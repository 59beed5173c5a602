// SPDX-License-Identifier: Apache-2.0
// Between a field's bytes and Python's values. These are the functions of the getsets: the closure is
// the Member.
#pragma once

#include "core/object.h"

namespace fledge::core {

/// The getter and setter that suit the field.
getter getter_for(const FledgeField &field);
setter setter_for(const FledgeField &field);

/// A row of an array of structs. A new reference, or null with an exception set.
PyObject *row_of(PyObject *object, const Member &member, std::uint32_t index);

enum class Stored {
    yes,
    no,         ///< an exception is set
    needs_count ///< a number for an array whose count is still 0; no exception is set
};

/// Convert, check and write. On failure the memory is as before.
Stored store(PyObject *object, const Member &member, PyObject *value);

/// Set the error of a number for an array without rows.
void complain_of_count(PyObject *object, const Member &member);

} // namespace fledge::core
