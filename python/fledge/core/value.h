// SPDX-License-Identifier: Apache-2.0
// Between a field's bytes and Python's values. These are the functions of the getsets: the closure is
// the Member.
#pragma once

#include "core/object.h"

namespace fledge::core {

/// The getter and setter that suit the field.
getter getter_for(const FledgeField &field);
setter setter_for(const FledgeField &field);

/// The getter of a module's memory. An error where the module does not run here, because it is not known then.
PyObject *get_memory(PyObject *self, void *closure);

/// A row of an array of structs, whose first is at `memory`. A new reference, or null with an exception set.
PyObject *row_of(PyObject *object, const Member &member, std::size_t index, std::byte *memory);

enum class Stored {
    yes,
    no,         ///< an exception is set
    needs_count ///< a number for an array whose count is still 0; no exception is set
};

/// Convert, check and write. On failure the memory is as before.
Stored store(PyObject *object, const Member &member, PyObject *value);

/// Store the items of a dict: in the order of the table, so that the array that sets a count comes before a number that
/// fills it. A name that is no field raises `unknown`. False with an exception set on failure.
bool set_fields(PyObject *object, const Type &type, PyObject *values, PyObject *unknown);

/// Set the error of a number for an array without rows.
void complain_of_count(PyObject *object, const Member &member);

} // namespace fledge::core
