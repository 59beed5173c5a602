// SPDX-License-Identifier: Apache-2.0
// Modules and models whose interface and behaviour are a class in Python: see fledge/prototype. Their tables are made
// at run time, and stand beside those of the libraries.
#pragma once

#include "core/object.h"

#include <pybind11/pybind11.h>

namespace fledge::core {

/// The table of an introspect Struct, which lives as long as the process. structs: name -> type of what its fields are;
/// schema: of a message, else None.
const FledgeStruct &table_from(const pybind11::handle &s, const pybind11::dict &structs,
                               const pybind11::handle &schema);

/// Whether a name is `__class__`, which is the class of a prototype for super() and isinstance().
bool is_class_name(PyObject *name);

/// The class of a prototype. A new reference.
PyObject *class_of_object(PyObject *self);

/// What the class of a prototype has under a name that is no field: a method, bound to the object, or a constant. A new
/// reference; null, perhaps with an exception set, if there is none.
PyObject *attribute_of_class(PyObject *self, PyObject *name);

} // namespace fledge::core
