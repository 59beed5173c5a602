// SPDX-License-Identifier: Apache-2.0
#include "core/numbers.h"

#include <algorithm>
#include <cstring>

namespace fledge::core {

bool is_plain_number(PyObject *value)
{
    return PyFloat_Check(value) || (PyLong_Check(value) && !PyBool_Check(value));
}

AssignNumber number_of(PyObject *value)
{
    if (PyLong_Check(value)) {
        int beyond = 0;
        const long long x = PyLong_AsLongLongAndOverflow(value, &beyond);
        if (!beyond) {
            return assign_whole(x);
        }
        const unsigned long long natural = PyLong_AsUnsignedLongLong(value);
        if (!PyErr_Occurred()) {
            return {static_cast<double>(natural), natural, 1};
        }
        PyErr_Clear();
        if (beyond < 0) {
            return {PyFloat_AsDouble(value), UINT64_MAX, -1}; // below all whole numbers of 64 bits
        }
    }
    return assign_real(PyFloat_AsDouble(value));
}

namespace {

Read read_sequence(PyObject *value, Numbers &out, std::uint32_t depth)
{
    const Py_ssize_t n = PySequence_Fast_GET_SIZE(value);
    PyObject **items = PySequence_Fast_ITEMS(value);
    if (depth == FLEDGE_DIMS_MAX) {
        return Read::ragged;
    }
    const auto size = static_cast<std::size_t>(n);
    if (out.values.empty() && depth == out.ndim) { // the first of this depth
        out.ndim = depth + 1;
        out.shape[depth] = size;
    } else if (depth >= out.ndim || out.shape[depth] != size) {
        return Read::ragged;
    }
    for (Py_ssize_t i = 0; i < n; i++) {
        PyObject *item = items[i];
        if (PyFloat_CheckExact(item)) {
            if (depth + 1 != out.ndim) {
                return Read::ragged;
            }
            out.values.push_back(assign_real(PyFloat_AS_DOUBLE(item)));
        } else if (PyList_CheckExact(item) || PyTuple_CheckExact(item)) {
            if (const Read read = read_sequence(item, out, depth + 1); read != Read::yes) {
                return read;
            }
        } else if (is_plain_number(item) || PyBool_Check(item)) {
            if (depth + 1 != out.ndim) {
                return Read::ragged;
            }
            out.values.push_back(number_of(item));
            if (PyErr_Occurred()) {
                return Read::error;
            }
        } else {
            return Read::foreign;
        }
    }
    return Read::yes;
}

/// From an object that offers its memory as doubles, such as a numpy array. The memory of a masked array does not tell
/// which of its numbers count.
Read read_buffer(PyObject *value, Numbers &out)
{
    if (PyObject_HasAttrString(value, "mask")) {
        return Read::foreign;
    }
    Py_buffer buffer;
    if (PyObject_GetBuffer(value, &buffer, PyBUF_FULL_RO)) {
        PyErr_Clear();
        return Read::foreign;
    }
    Read read = Read::foreign;
    if (buffer.format && !std::strcmp(buffer.format, "d") && buffer.ndim <= FLEDGE_DIMS_MAX) {
        out.ndim = static_cast<std::uint32_t>(buffer.ndim);
        std::copy_n(buffer.shape, buffer.ndim, out.shape.begin());
        std::vector<double> values(static_cast<std::size_t>(buffer.len) / sizeof(double));
        read = PyBuffer_ToContiguous(values.data(), &buffer, buffer.len, 'C') ? Read::error : Read::yes;
        std::transform(values.begin(), values.end(), std::back_inserter(out.values), assign_real);
    }
    PyBuffer_Release(&buffer);
    return read;
}

} // namespace

Read read_numbers(PyObject *value, Numbers &out)
{
    if (is_plain_number(value)) {
        out.values.push_back(number_of(value));
        return PyErr_Occurred() ? Read::error : Read::yes;
    }
    if (PyList_Check(value) || PyTuple_Check(value)) {
        return read_sequence(value, out, 0);
    }
    return PyObject_CheckBuffer(value) ? read_buffer(value, out) : Read::foreign;
}

} // namespace fledge::core
