// SPDX-License-Identifier: Apache-2.0
// From a field's bytes to Python's values.
#include "core/element.h"
#include "core/errors.h"
#include "core/numbers.h"
#include "core/script.h"
#include "core/value.h"

#define NPY_NO_DEPRECATED_API NPY_1_7_API_VERSION
#include <numpy/arrayobject.h>

#include <bit>

namespace fledge::core {

namespace {

PyObject *get_f64(PyObject *self, void *closure)
{
    return PyFloat_FromDouble(load<double>(as_object(self)->memory + member_of(closure).field->offset));
}

PyObject *get_number(PyObject *self, void *closure)
{
    const FledgeField &field = *member_of(closure).field;
    return with_type(field.type, [&]<class T>(T) -> PyObject * {
        const T value = load<T>(as_object(self)->memory + field.offset);
        if constexpr (std::is_floating_point_v<T>) {
            return PyFloat_FromDouble(value);
        } else if constexpr (std::is_unsigned_v<T>) {
            return PyLong_FromUnsignedLongLong(value);
        } else {
            return PyLong_FromLongLong(value);
        }
    });
}

/// The Python class of an enum, made once.
PyObject *enumeration_of(Member &member)
{
    if (!member.enumeration) {
        const FledgeEnum &values = *member.field->values;
        PyObject *make = hook("enumeration");
        PyObject *list = PyList_New(0);
        for (std::uint32_t i = 0; make && list && i < values.n; i++) {
            PyObject *item = Py_BuildValue("(sLs)", values.values[i].name,
                                           static_cast<long long>(values.values[i].value), values.values[i].doc);
            if (!item || PyList_Append(list, item)) {
                Py_CLEAR(list);
            }
            Py_XDECREF(item);
        }
        if (make && list) {
            member.enumeration = PyObject_CallFunction(make, "ssO", values.name, values.doc, list);
        }
        Py_XDECREF(list);
    }
    return member.enumeration;
}

PyObject *get_enum(PyObject *self, void *closure)
{
    PyObject *number = get_number(self, closure);
    PyObject *type = number ? enumeration_of(*static_cast<Member *>(closure)) : nullptr;
    PyObject *value = type ? PyObject_CallOneArg(type, number) : nullptr;
    if (type && !value) { // a value without a name is shown as it is
        PyErr_Clear();
        return number;
    }
    Py_XDECREF(number);
    return value;
}

PyObject *get_text(PyObject *self, void *closure)
{
    const FledgeField &field = *member_of(closure).field;
    const char *text = reinterpret_cast<const char *>(as_object(self)->memory + field.offset);
    return PyUnicode_DecodeUTF8(text, static_cast<Py_ssize_t>(strnlen(text, field.size)), "replace");
}

PyObject *make_view(PyObject *owner, const Member &member, std::byte *memory, std::size_t index = 0)
{
    View *view = PyObject_New(View, member.sub->python);
    if (view) {
        view->memory = memory;
        view->type = member.sub;
        view->weak = nullptr;
        view->owner = Py_NewRef(owner);
        view->member = &member;
        view->index = index;
    }
    return reinterpret_cast<PyObject *>(view);
}

PyObject *get_struct(PyObject *self, void *closure)
{
    const Member &member = member_of(closure);
    std::byte *memory = as_object(self)->memory + member.field->offset;
    if (!member.field->ndim) {
        return make_view(self, member, memory);
    }
    const std::uint32_t rows = rows_of(*as_object(self), member);
    PyObject *tuple = PyTuple_New(rows);
    for (std::uint32_t i = 0; tuple && i < rows; i++) {
        PyObject *view = make_view(self, member, memory + i * member.sub->table->size, i);
        if (!view) {
            Py_CLEAR(tuple);
        } else {
            PyTuple_SET_ITEM(tuple, i, view);
        }
    }
    return tuple;
}

int numpy_type(FledgeType type)
{
    static const int types[] = {NPY_FLOAT64, NPY_FLOAT32, NPY_INT8,  NPY_UINT8,  NPY_INT16, NPY_UINT16,
                                NPY_INT32,   NPY_UINT32,  NPY_INT64, NPY_UINT64, NPY_INT8,  NPY_INT32};
    return types[type]; // no struct comes here
}

/// An element of an array as a number of Python's: numpy's integers wrap, and its floats divide by 0.
PyObject *plain(PyObject *value)
{
    if (!value || !PyArray_CheckScalar(value)) {
        return value;
    }
    PyObject *number = PyFloat_Check(value) ? PyFloat_FromDouble(PyFloat_AS_DOUBLE(value))
                                            : PyObject_CallMethod(value, "item", nullptr);
    Py_DECREF(value);
    return number;
}

/// a[i] = value, where an array of integers takes what a field of its type takes; numpy cuts other numbers.
int store_at(PyObject *self, PyObject *index, PyObject *value)
{
    const int type = PyArray_TYPE(reinterpret_cast<PyArrayObject *>(self));
    if (value && PyTypeNum_ISINTEGER(type) && is_plain_number(value)) {
        const AssignNumber number = number_of(value);
        std::uint64_t aside;
        // By size and sign: C has more than one type of the same size, and numpy has a number for each.
        static const FledgeType types[][2] = {
            {FLEDGE_U8, FLEDGE_I8}, {FLEDGE_U16, FLEDGE_I16}, {FLEDGE_U32, FLEDGE_I32}, {FLEDGE_U64, FLEDGE_I64}};
        const auto size = static_cast<unsigned>(PyArray_ITEMSIZE(reinterpret_cast<PyArrayObject *>(self)));
        const FledgeType of = types[std::countr_zero(size)][PyTypeNum_ISSIGNED(type)];
        if (PyErr_Occurred() || !assign_number(of, &aside, number)) {
            PyErr_Format(setup_error(), "expected a whole number that an element of %d bits holds; found %R",
                         8 * static_cast<int>(size), value);
            return -1;
        }
    }
    return PyArray_Type.tp_as_mapping->mp_ass_subscript(self, index, value);
}

/// The class of the arrays that functions of flight in Python see, whose elements are those of a target.
PyTypeObject *flying_array()
{
    static PyObject *made = [] {
        static const auto at = [](PyObject *self, PyObject *index) {
            return plain(PyArray_Type.tp_as_mapping->mp_subscript(self, index));
        };
        static const auto item = [](PyObject *self, Py_ssize_t index) {
            return plain(PyArray_Type.tp_as_sequence->sq_item(self, index));
        };
        PyType_Slot slots[] = {{Py_mp_subscript, reinterpret_cast<void *>(static_cast<binaryfunc>(at))},
                               {Py_mp_ass_subscript, reinterpret_cast<void *>(store_at)},
                               {Py_sq_item, reinterpret_cast<void *>(static_cast<ssizeargfunc>(item))},
                               {}};
        PyType_Spec spec{"fledge.flight.array", 0, 0, Py_TPFLAGS_DEFAULT, slots};
        return PyType_FromSpecWithBases(&spec, reinterpret_cast<PyObject *>(&PyArray_Type));
    }();
    return reinterpret_cast<PyTypeObject *>(made);
}

/// A numpy view of the rows that count. numpy is imported by the first of them.
PyObject *get_array(PyObject *self, void *closure)
{
    if (!PyArray_API && _import_array() < 0) {
        return nullptr;
    }
    const Member &member = member_of(closure);
    const FledgeField &field = *member.field;
    npy_intp shape[FLEDGE_DIMS_MAX];
    std::copy_n(field.shape, field.ndim, shape);
    shape[0] = rows_of(*as_object(self), member);
    const int flags = writable(self, member) == Writable::yes ? NPY_ARRAY_CARRAY : NPY_ARRAY_CARRAY_RO;
    PyTypeObject *type = flies() ? flying_array() : &PyArray_Type;
    if (!type) {
        return nullptr;
    }
    PyObject *array =
        PyArray_NewFromDescr(type, PyArray_DescrFromType(numpy_type(field.type)), static_cast<int>(field.ndim), shape,
                             nullptr, as_object(self)->memory + field.offset, flags, nullptr);
    if (array && PyArray_SetBaseObject(reinterpret_cast<PyArrayObject *>(array), Py_NewRef(self)) < 0) {
        Py_CLEAR(array);
    }
    return array;
}

} // namespace

PyObject *get_memory(PyObject *self, void *closure)
{
    const Member &member = member_of(closure);
    if (as_root(self)->instance->maker == sim::Instance::Maker::itself || running()) { // a reset in Python runs always
        return getter_for(*member.field)(self, closure);
    }
    refuse_field(self, member, "unknown_memory");
    return nullptr;
}

PyObject *row_of(PyObject *object, const Member &member, std::size_t index, std::byte *memory)
{
    return make_view(object, member, memory + index * member.sub->table->size, index);
}

getter getter_for(const FledgeField &field)
{
    switch (field.type) {
    case FLEDGE_STRUCT: return get_struct;
    case FLEDGE_CHAR: return get_text;
    case FLEDGE_ENUM: return field.ndim ? get_array : get_enum;
    default: return field.ndim ? get_array : field.type == FLEDGE_F64 ? get_f64 : get_number;
    }
}

} // namespace fledge::core
