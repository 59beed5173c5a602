// SPDX-License-Identifier: Apache-2.0
// C++ exceptions as Python's: SetupError is a ValueError, CompositionError a SetupError, RunError a RuntimeError.
#pragma once

#define PY_SSIZE_T_CLEAN
#include <Python.h>

#include <exception>

namespace fledge::core {

/// Make the exception types and add them to the extension.
bool add_exceptions(PyObject *module);

PyObject *setup_error(); ///< borrowed
PyObject *run_error();   ///< borrowed

/// Set the Python exception of an error of the kernel; false, and nothing is set, of another one.
bool set_error(const std::exception_ptr &error);

/// In a catch (...): set the Python exception that belongs to the one being handled.
void translate_exception();

} // namespace fledge::core
