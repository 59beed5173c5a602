// SPDX-License-Identifier: Apache-2.0
#include "core/errors.h"

#include "sim/error.h"

#include <new>

#include <pybind11/pybind11.h>

namespace fledge::core {

namespace {
PyObject *the_setup_error, *the_composition_error, *the_run_error;
}

bool add_exceptions(PyObject *module)
{
    the_setup_error = PyErr_NewExceptionWithDoc("fledge.SetupError",
                                                "Something is wrong with a mission before it runs: "
                                                "the text names the instance, the rule, the\n"
                                                "value found and the valid choices.",
                                                PyExc_ValueError, nullptr);
    the_composition_error = PyErr_NewExceptionWithDoc("fledge.CompositionError",
                                                      "A mission as it is composed cannot fly. The text has a line for "
                                                      "each reason: the file and the\n"
                                                      "line that made what is wrong, and what to do about it.",
                                                      the_setup_error, nullptr);
    the_run_error = PyErr_NewExceptionWithDoc(
        "fledge.RunError", "A run cannot go on: the text names the instance, the time and the last good values.",
        PyExc_RuntimeError, nullptr);
    return the_setup_error && the_composition_error && the_run_error &&
           !PyModule_AddObjectRef(module, "SetupError", the_setup_error) &&
           !PyModule_AddObjectRef(module, "CompositionError", the_composition_error) &&
           !PyModule_AddObjectRef(module, "RunError", the_run_error);
}

PyObject *setup_error()
{
    return the_setup_error;
}

PyObject *run_error()
{
    return the_run_error;
}

bool set_error(const std::exception_ptr &error)
{
    try {
        std::rethrow_exception(error);
    } catch (const sim::CompositionError &e) {
        PyErr_SetString(the_composition_error, e.what());
    } catch (const sim::SetupError &e) {
        PyErr_SetString(the_setup_error, e.what());
    } catch (const sim::RunError &e) {
        PyErr_SetString(the_run_error, e.what());
    } catch (...) {
        return false;
    }
    return true;
}

void translate_exception()
{
    if (set_error(std::current_exception())) {
        return;
    }
    try {
        throw;
    } catch (pybind11::error_already_set &error) {
        error.restore();
    } catch (const std::bad_alloc &) {
        PyErr_NoMemory();
    } catch (const std::exception &error) {
        PyErr_SetString(PyExc_RuntimeError, error.what());
    }
}

} // namespace fledge::core
