// SPDX-License-Identifier: Apache-2.0
// C++ exceptions as Python's: SetupError is a ValueError, RunError a RuntimeError.
#pragma once

#define PY_SSIZE_T_CLEAN
#include <Python.h>

namespace fledge::core {

/// Make the exception types and add them to the extension.
bool add_exceptions(PyObject *module);

PyObject *setup_error(); ///< borrowed
PyObject *run_error();   ///< borrowed

/// In a catch (...): set the Python exception that belongs to the one being handled.
void translate_exception();

} // namespace fledge::core
