// SPDX-License-Identifier: Apache-2.0
// Modules and models whose interface and behaviour are a class in Python: see fledge/prototype. Their tables are made
// at run time, and stand beside those of the libraries.
#pragma once

#include "core/object.h"

namespace fledge::core {

/// Whether a name is `__class__`, which is the class of a prototype for super() and isinstance().
bool is_class_name(PyObject *name);

/// The class of a prototype. A new reference.
PyObject *class_of_object(PyObject *self);

/// What the class of a prototype has under a name that is no field: a method, bound to the object, or a constant. A new
/// reference; null, perhaps with an exception set, if there is none.
PyObject *attribute_of_class(PyObject *self, PyObject *name);

} // namespace fledge::core
