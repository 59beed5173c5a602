// SPDX-License-Identifier: Apache-2.0
// The functions of flight/math for Python: numbers and numpy arrays in, numbers and new arrays out, with the bits of C.
#include "core/extension.h"
#include "core/numbers.h"
#include "sim/function.h"

#define NPY_NO_DEPRECATED_API NPY_1_7_API_VERSION
#include <numpy/arrayobject.h>

#include <algorithm>
#include <cstring>

extern "C" {
extern const FledgeFunctions fledge_functions_flight;
}

namespace py = pybind11;

namespace fledge::core {

namespace {

using Numbers9 = std::array<double, FLEDGE_FUNCTION_NUMBERS>;

std::string shape_of(int ndim, const npy_intp *shape)
{
    std::string text = "(";
    for (int i = 0; i < ndim; i++) {
        text += std::to_string(shape[i]) + (i + 1 < ndim ? ", " : ndim == 1 ? "," : "");
    }
    return text + ")";
}

/// Set TypeError: "vec_add: b: expected shape (3,); found the shape (2,)".
bool refuse(const FledgeFunction &f, const FledgeArgument &argument, PyObject *value)
{
    PyErr_Clear();
    const npy_intp wanted[] = {argument.shape[0], argument.shape[1]};
    const std::string expected =
        argument.ndim ? "numbers of the shape " + shape_of(static_cast<int>(argument.ndim), wanted) : "a number";
    if (PyArray_Check(value)) {
        auto *array = reinterpret_cast<PyArrayObject *>(value);
        PyErr_Format(PyExc_TypeError, "%s: %s: expected %s; found the shape %s", f.name, argument.name,
                     expected.c_str(), shape_of(PyArray_NDIM(array), PyArray_DIMS(array)).c_str());
    } else {
        PyErr_Format(PyExc_TypeError, "%s: %s: expected %s; found %.100R", f.name, argument.name, expected.c_str(),
                     value);
    }
    return false;
}

bool take(const FledgeFunction &f, const FledgeArgument &argument, PyObject *value, Numbers9 &into)
{
    if (!argument.ndim) {
        if (!is_plain_number(value) && PyArray_Check(value) && PyArray_NDIM(reinterpret_cast<PyArrayObject *>(value))) {
            return refuse(f, argument, value);
        }
        into[0] = PyFloat_AsDouble(value);
        return into[0] != -1.0 || !PyErr_Occurred() || refuse(f, argument, value);
    }
    // Only conversions without loss: no texts, no complex numbers, no quantities with units.
    PyObject *plain = PyArray_FROM_O(value);
    const bool safe =
        plain && PyArray_CanCastSafely(PyArray_TYPE(reinterpret_cast<PyArrayObject *>(plain)), NPY_DOUBLE);
    PyObject *array = safe ? PyArray_FROM_OTF(plain, NPY_DOUBLE, NPY_ARRAY_IN_ARRAY) : nullptr;
    Py_XDECREF(plain);
    if (!array) {
        return refuse(f, argument, value);
    }
    auto *numbers = reinterpret_cast<PyArrayObject *>(array);
    const bool fits = PyArray_NDIM(numbers) == static_cast<int>(argument.ndim) &&
                      std::equal(argument.shape, argument.shape + argument.ndim, PyArray_DIMS(numbers));
    if (fits) {
        std::memcpy(into.data(), PyArray_DATA(numbers), static_cast<std::size_t>(PyArray_NBYTES(numbers)));
    } else {
        refuse(f, argument, array);
    }
    Py_DECREF(array);
    return fits;
}

PyObject *give(const FledgeArgument &argument, const Numbers9 &from)
{
    if (!argument.ndim) {
        return argument.whole ? PyLong_FromDouble(from[0]) : PyFloat_FromDouble(from[0]);
    }
    npy_intp shape[] = {argument.shape[0], argument.shape[1]};
    PyObject *array = PyArray_SimpleNew(static_cast<int>(argument.ndim), shape, NPY_DOUBLE);
    if (array) {
        auto *numbers = reinterpret_cast<PyArrayObject *>(array);
        std::memcpy(PyArray_DATA(numbers), from.data(), static_cast<std::size_t>(PyArray_NBYTES(numbers)));
    }
    return array;
}

PyObject *call(PyObject *self, PyObject *const *arguments, Py_ssize_t n)
{
    const auto &f = *static_cast<const FledgeFunction *>(PyCapsule_GetPointer(self, nullptr));
    if (!PyArray_API && _import_array() < 0) {
        return nullptr;
    }
    if (n != f.n_in) {
        return PyErr_Format(PyExc_TypeError, "%s takes %u arguments; found %zd", f.name, f.n_in, n);
    }
    std::array<Numbers9, FLEDGE_FUNCTION_ARGUMENTS> in, out;
    const double *from[FLEDGE_FUNCTION_ARGUMENTS];
    double *to[FLEDGE_FUNCTION_ARGUMENTS];
    for (std::size_t i = 0; i < FLEDGE_FUNCTION_ARGUMENTS; i++) {
        from[i] = in[i].data();
        to[i] = out[i].data();
        if (i < f.n_in && !take(f, f.in[i], arguments[i], in[i])) {
            return nullptr;
        }
    }
    f.call(from, to);
    if (f.n_out == 1) {
        return give(f.out[0], out[0]);
    }
    PyObject *all = PyTuple_New(f.n_out);
    for (std::uint32_t i = 0; all && i < f.n_out; i++) {
        PyObject *result = give(f.out[i], out[i]);
        if (!result) {
            Py_CLEAR(all);
        } else {
            PyTuple_SET_ITEM(all, i, result);
        }
    }
    return all;
}

std::string doc_of(const FledgeFunction &f)
{
    std::string names, shapes;
    const auto shape = [](const FledgeArgument &argument) {
        const npy_intp of[] = {argument.shape[0], argument.shape[1]};
        return argument.ndim    ? "shape " + shape_of(static_cast<int>(argument.ndim), of)
               : argument.whole ? "int"
                                : "float";
    };
    for (std::uint32_t i = 0; i < f.n_in; i++) {
        names += std::string(f.in[i].name) + ", ";
        shapes += std::string(f.in[i].name) + ": " + shape(f.in[i]) + "\n";
    }
    std::string given;
    for (std::uint32_t i = 0; i < f.n_out; i++) {
        given += (i ? ", " : "") + (*f.out[i].name ? std::string(f.out[i].name) + ": " : "") + shape(f.out[i]);
    }
    return std::string(f.name) + "(" + names + (f.n_in ? "/" : "") + ")\n--\n\n" + f.doc + (*f.doc ? "\n\n" : "") +
           shapes + "Returns " + given + ". Declared in " + f.header + ".";
}

} // namespace

void bind_functions(py::module_ &m)
{
    m.def(
        "functions", []() -> Typed<py::dict, "dict[str, tuple[Callable[..., Any], str]]"> {
            static std::deque<std::pair<std::string, PyMethodDef>> kept;
            py::dict functions;
            const py::str module("fledge.flight_math");
            for (std::uint32_t i = 0; i < fledge_functions_flight.n; i++) {
                const FledgeFunction &f = fledge_functions_flight.functions[i];
                auto &[doc, method] = kept.emplace_back(doc_of(f), PyMethodDef{});
                method = {f.name, reinterpret_cast<PyCFunction>(reinterpret_cast<void (*)()>(call)), METH_FASTCALL,
                          doc.c_str()};
                const py::capsule self(&f);
                functions[f.name] = py::make_tuple(
                    py::reinterpret_steal<py::object>(PyCFunction_NewEx(&method, self.ptr(), module.ptr())), f.header);
            }
            return functions;
        },
        "(function, header) of each function of flight/math, by name.");
}

} // namespace fledge::core
