// SPDX-License-Identifier: Apache-2.0
#include "core/errors.h"

#include "sim/error.h"

#include <new>

#include <pybind11/pybind11.h>

namespace fledge::core {

namespace {
PyObject *the_setup_error, *the_run_error;
}

bool add_exceptions(PyObject *module)
{
    the_setup_error = PyErr_NewExceptionWithDoc("fledge.SetupError",
                                                "Something is wrong with a mission before it runs: "
                                                "the text names the instance, the rule, the\n"
                                                "value found and the valid choices.",
                                                PyExc_ValueError, nullptr);
    the_run_error = PyErr_NewExceptionWithDoc(
        "fledge.RunError", "A run cannot go on: the text names the instance, the time and the last good values.",
        PyExc_RuntimeError, nullptr);
    return the_setup_error && the_run_error && !PyModule_AddObjectRef(module, "SetupError", the_setup_error) &&
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

void translate_exception()
{
    try {
        throw;
    } catch (const sim::SetupError &error) {
        PyErr_SetString(the_setup_error, error.what());
    } catch (const sim::RunError &error) {
        PyErr_SetString(the_run_error, error.what());
    } catch (pybind11::error_already_set &error) {
        error.restore();
    } catch (const std::bad_alloc &) {
        PyErr_NoMemory();
    } catch (const std::exception &error) {
        PyErr_SetString(PyExc_RuntimeError, error.what());
    }
}

} // namespace fledge::core
