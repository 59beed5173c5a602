// SPDX-License-Identifier: Apache-2.0
// From Python's values to a field's bytes: convert, check, and undo if the check fails.
#include "core/doc.h"
#include "core/element.h"
#include "core/errors.h"
#include "core/numbers.h"
#include "core/value.h"
#include "sim/error.h"

#include <cmath>
#include <limits>

namespace fledge::core {

namespace {

// --- complaining -----------------------------------------------------------------------------------

/// "shape (3, 3), or 3 numbers for the diagonal, or one for a multiple of the identity, in kg m^2"
std::string expectation(const Member &member)
{
    const FledgeField &field = *member.field;
    std::string text;
    if (field.type == FLEDGE_CHAR) {
        return "a text of up to " + std::to_string(field.size - 1) + " bytes";
    }
    if (field.type == FLEDGE_STRUCT) {
        const std::string one = std::string(field.ctype) + " or dict of its fields";
        return field.ndim ? "a list of " + std::string(field.count ? "up to " : "") + std::to_string(field.shape[0]) +
                                ", each a " + one
                          : one;
    }
    const std::string range =
        is_float(field.type) || field.type == FLEDGE_ENUM ? "" : with_type(field.type, []<class T>(T) {
            return "from " + std::to_string(std::numeric_limits<T>::min()) + " to " +
                   std::to_string(std::numeric_limits<T>::max());
        });
    if (!field.ndim) {
        text = range.empty() ? "a number" : "a whole number " + range;
    } else {
        text = "shape " + shape_text(field) + (range.empty() ? "" : " of whole numbers " + range);
        if (field.count && field.ndim == 1) {
            text += ", or one number for all";
        } else if (!field.count && field.ndim == 2 && field.shape[0] == field.shape[1]) {
            text += ", or " + std::to_string(field.shape[0]) +
                    " numbers for the diagonal, or one for a multiple of the identity";
        }
    }
    if (const std::string unit = unit_text(field); !unit.empty()) {
        text += ", in " + unit.substr(2, unit.size() - 3);
    }
    return text;
}

/// Set SetupError: "flight.control.K: expected a number, in N m; found 'high'".
Stored refuse(PyObject *object, const Member &member, PyObject *value, const std::string &found = "")
{
    std::string text = found;
    if (text.empty()) {
        if (PyObject *shown = PyObject_Repr(value)) {
            const char *utf8 = PyUnicode_AsUTF8(shown);
            text = utf8 ? utf8 : "?";
            std::replace(text.begin(), text.end(), '\n', ' ');
            if (text.size() > 80) {
                text = text.substr(0, 77) + "...";
            }
            Py_DECREF(shown);
        }
    }
    PyErr_Clear();
    PyErr_SetString(
        setup_error(),
        (path_of(object) + "." + member.field->name + ": expected " + expectation(member) + "; found " + text).c_str());
    return Stored::no;
}

// --- writing ---------------------------------------------------------------------------------------

/// A new reference to plain numbers in SI, from Python's to_si(); null with an exception set on failure.
PyObject *to_si(PyObject *object, const Member &member, PyObject *value)
{
    const FledgeField &field = *member.field;
    PyObject *function = hook("to_si");
    if (!function) {
        return nullptr;
    }
    PyObject *dims = PyTuple_New(8);
    for (Py_ssize_t i = 0; dims && i < 8; i++) {
        PyTuple_SET_ITEM(dims, i, PyLong_FromLong(field.dims[i]));
    }
    const std::string path = path_of(object) + "." + field.name, expected = expectation(member);
    return PyObject_CallFunction(function, "OssNs", value, path.c_str(), field.unit, dims, expected.c_str());
}

/// Remember that the user gave a parameter; inside a struct, the parameter that holds it.
void mark_given(PyObject *object, const Member &member)
{
    const Member *outer = &member;
    while (is_view(object)) {
        outer = as_view(object)->member;
        object = as_view(object)->owner;
        if (!object) {
            return;
        }
    }
    as_root(object)->instance->given[outer->index] = true;
}

bool is_given(PyObject *object, const Member &member)
{
    return is_root(object) && as_root(object)->instance->given[member.index];
}

/// The bytes of a field and of its count. Calling it writes them back.
class Undo {
public:
    Undo(const Object &object, const Member &member) : object_(object), member_(member)
    {
        keep(member);
        if (member.count) {
            keep(*member.count);
        }
    }
    void operator()()
    {
        std::size_t at = 0;
        put_back(member_, at);
        if (member_.count) {
            put_back(*member_.count, at);
        }
    }

private:
    void keep(const Member &member)
    {
        const std::byte *from = object_.memory + member.field->offset;
        bytes_.insert(bytes_.end(), from, from + member.field->size);
    }
    void put_back(const Member &member, std::size_t &at)
    {
        std::memcpy(object_.memory + member.field->offset, bytes_.data() + at, member.field->size);
        at += member.field->size;
    }
    const Object &object_;
    const Member &member_;
    std::vector<std::byte> bytes_;
};

/// Whether the field holds the header's rule. Only parameters are checked: tests may write any number into inputs and
/// memory.
bool obeys(PyObject *object, const Member &member)
{
    if (!member.checked) {
        return true;
    }
    try {
        sim::check_field(*member.owner->table, *member.field, as_object(object)->memory, path_of(object));
    } catch (...) {
        translate_exception();
        return false;
    }
    return true;
}

/// False with SetupError set if the number does not fit into the field's C type.
bool write_number(std::byte *to, FledgeType type, Number x)
{
    return with_type(type, [&]<class T>(T) {
        if constexpr (!std::is_floating_point_v<T>) {
            if (!(x >= static_cast<Number>(std::numeric_limits<T>::min()) &&
                  x <= static_cast<Number>(std::numeric_limits<T>::max())) ||
                x != std::floor(x)) {
                return false;
            }
        }
        save(to, static_cast<T>(x));
        return true;
    });
}

/// Set the array's count to the number of rows, unless the user or another array has set it.
bool settle_count(PyObject *object, const Member &member, std::uint32_t rows)
{
    const std::uint32_t n = read_count(*as_object(object), *member.count);
    if (n == rows) {
        return true;
    }
    std::string holder;
    if (n && is_given(object, *member.count)) {
        holder = "as given";
    }
    for (const Member &other : member.owner->members) {
        if (n && other.count == member.count && &other != &member && (is_given(object, other) || !is_root(object))) {
            holder = holder.empty() ? "as in " + std::string(other.field->name) : holder;
        }
    }
    if (!holder.empty()) {
        PyErr_Format(setup_error(), "%s.%s: expected %u rows, for %s is %u, %s; found %u. Set %s first to change it",
                     path_of(object).c_str(), member.field->name, n, member.field->count, n, holder.c_str(), rows,
                     member.field->count);
        return false;
    }
    write_count(*as_object(object), *member.count, rows);
    if (!obeys(object, *member.count)) {
        write_count(*as_object(object), *member.count, n);
        return false;
    }
    return true;
}

/// Spread the given numbers over the elements of the field. `out` gets the size of the field.
Stored spread(PyObject *object, const Member &member, PyObject *value, const Numbers &in, std::vector<Number> &out)
{
    const FledgeField &field = *member.field;
    const std::size_t elements = sim::field_elements(field);
    const std::size_t row = elements / field.shape[0];
    const auto same_from = [&](std::uint32_t first) {
        return in.ndim == static_cast<int>(field.ndim) &&
               std::equal(field.shape + first, field.shape + field.ndim, in.shape.begin() + first);
    };
    out.assign(elements, 0.0L);
    if (member.count) {
        if (in.ndim == 0 && field.ndim == 1) {
            const std::uint32_t rows = rows_of(*as_object(object), member);
            if (rows == 0) {
                return Stored::needs_count;
            }
            std::fill_n(out.begin(), rows, in.values[0]);
            return Stored::yes;
        }
        if (same_from(1) && in.shape[0] <= field.shape[0] && in.shape[0] > 0) {
            if (!settle_count(object, member, static_cast<std::uint32_t>(in.shape[0]))) {
                return Stored::no;
            }
            std::copy(in.values.begin(), in.values.end(), out.begin());
            return Stored::yes;
        }
    } else if (same_from(0)) {
        out = in.values;
        return Stored::yes;
    } else if (field.ndim == 2 && row == field.shape[0] && (in.ndim == 0 || (in.ndim == 1 && in.shape[0] == row))) {
        for (std::size_t i = 0; i < row; i++) {
            out[i * row + i] = in.values[in.ndim ? i : 0];
        }
        return Stored::yes;
    }
    std::string found = in.ndim ? "shape (" : "a single number";
    for (int i = 0; i < in.ndim; i++) {
        found += (i ? ", " : "") + std::to_string(in.shape[static_cast<std::size_t>(i)]);
    }
    return refuse(object, member, value, found + (in.ndim ? ")" : ""));
}

Stored store_numbers(PyObject *object, const Member &member, PyObject *value)
{
    const FledgeField &field = *member.field;
    Numbers numbers;
    numbers.values.reserve(sim::field_elements(field));
    Read read = read_numbers(value, numbers);
    if (read == Read::foreign) {
        PyObject *plain = to_si(object, member, value);
        if (!plain) {
            return Stored::no;
        }
        numbers = {};
        read = read_numbers(plain, numbers);
        Py_DECREF(plain);
    }
    switch (read) {
    case Read::yes: break;
    case Read::ragged: return refuse(object, member, value, "rows of unequal length");
    case Read::foreign:
    case Read::error: return refuse(object, member, value);
    }
    Undo undo(*as_object(object), member);
    std::vector<Number> values;
    if (const Stored stored = spread(object, member, value, numbers, values); stored != Stored::yes) {
        return stored;
    }
    std::byte *to = as_object(object)->memory + field.offset;
    const std::size_t width = field.size / values.size();
    for (std::size_t i = 0; i < values.size(); i++) {
        if (!write_number(to + i * width, field.type, values[i])) {
            undo();
            return refuse(object, member, value);
        }
    }
    if (!obeys(object, member)) {
        undo();
        return Stored::no;
    }
    return Stored::yes;
}

/// A new reference to the number of an enumerator, or to nested lists of them; null with an exception set.
PyObject *to_enumerators(PyObject *object, const Member &member, PyObject *value)
{
    const FledgeEnum &values = *member.field->values;
    PyObject *convert = hook("to_enumerators");
    PyObject *list = PyList_New(0);
    for (std::uint32_t i = 0; convert && list && i < values.n; i++) {
        PyObject *item = Py_BuildValue("(sL)", values.values[i].name, static_cast<long long>(values.values[i].value));
        if (!item || PyList_Append(list, item)) {
            Py_CLEAR(list);
        }
        Py_XDECREF(item);
    }
    const std::string path = path_of(object) + "." + member.field->name;
    return convert && list ? PyObject_CallFunction(convert, "sNOs", values.name, list, value, path.c_str()) : nullptr;
}

Stored store_array(PyObject *object, const Member &member, PyObject *value)
{
    const FledgeField &field = *member.field;
    if (field.type == FLEDGE_ENUM && !PyLong_CheckExact(value)) {
        PyObject *numbers = to_enumerators(object, member, value);
        const Stored stored = numbers ? store_numbers(object, member, numbers) : Stored::no;
        Py_XDECREF(numbers);
        return stored;
    }
    return store_numbers(object, member, value);
}

/// A whole number, without a detour through a double.
bool write_integer(std::byte *to, FledgeType type, PyObject *value)
{
    return with_type(type, [&]<class T>(T) {
        if constexpr (std::is_floating_point_v<T>) {
            return false;
        } else if constexpr (std::is_same_v<T, std::uint64_t>) {
            const unsigned long long x = PyLong_AsUnsignedLongLong(value);
            if (PyErr_Occurred()) {
                return false;
            }
            save(to, static_cast<T>(x));
            return true;
        } else {
            const long long x = PyLong_AsLongLong(value);
            if (PyErr_Occurred() || x < static_cast<long long>(std::numeric_limits<T>::min()) ||
                x > static_cast<long long>(std::numeric_limits<T>::max())) {
                return false;
            }
            save(to, static_cast<T>(x));
            return true;
        }
    });
}

Stored store_scalar(PyObject *object, const Member &member, PyObject *value)
{
    const FledgeField &field = *member.field;
    if (!is_plain_number(value) && !(PyBool_Check(value) && !is_float(field.type))) {
        PyObject *plain = to_si(object, member, value);
        if (!plain) {
            return Stored::no;
        }
        const Stored stored =
            is_plain_number(plain) ? store_scalar(object, member, plain) : refuse(object, member, value);
        Py_DECREF(plain);
        return stored;
    }
    Undo undo(*as_object(object), member);
    std::byte *to = as_object(object)->memory + field.offset;
    bool fits;
    if (PyLong_Check(value) && !is_float(field.type)) {
        fits = write_integer(to, field.type, value);
    } else {
        const double x = PyFloat_AsDouble(value);
        fits = !(x == -1.0 && PyErr_Occurred()) && write_number(to, field.type, x);
    }
    if (!fits) {
        undo();
        return refuse(object, member, value);
    }
    if (!obeys(object, member)) {
        undo();
        return Stored::no;
    }
    return Stored::yes;
}

Stored store_enum(PyObject *object, const Member &member, PyObject *value)
{
    PyObject *number = to_enumerators(object, member, value);
    if (number && PyLong_Check(number)) {
        save(as_object(object)->memory + member.field->offset, static_cast<std::int32_t>(PyLong_AsLong(number)));
    }
    const Stored stored = !number ? Stored::no : PyLong_Check(number) ? Stored::yes : refuse(object, member, value);
    Py_XDECREF(number);
    return stored;
}

Stored store_text(PyObject *object, const Member &member, PyObject *value)
{
    Py_ssize_t size = 0;
    const char *text = PyUnicode_Check(value) ? PyUnicode_AsUTF8AndSize(value, &size) : nullptr;
    if (!text || static_cast<std::size_t>(size) >= member.field->size) {
        return refuse(object, member, value);
    }
    std::byte *to = as_object(object)->memory + member.field->offset;
    std::memset(to, 0, member.field->size);
    std::memcpy(to, text, static_cast<std::size_t>(size));
    return Stored::yes;
}

/// A row of `rows`, from a struct of the same type or from a dict: fields that it leaves out become 0.
bool store_row(PyObject *object, const Member &member, std::size_t index, PyObject *value, std::byte *rows)
{
    const Type &type = *member.sub;
    if (is_view(value) && as_view(value)->type == &type) {
        std::memcpy(rows + index * type.table->size, as_view(value)->memory, type.table->size);
        return true;
    }
    if (!PyDict_Check(value)) {
        refuse(object, member, value, is_object(value) ? as_object(value)->type->table->name : "");
        return false;
    }
    PyObject *row = row_of(object, member, index, rows);
    const bool stored = row && set_fields(row, type, value, setup_error());
    Py_XDECREF(row);
    return stored;
}

/// A struct, or an array of them. They are made aside, because the values may be views of what was there.
Stored store_struct(PyObject *object, const Member &member, PyObject *value)
{
    const FledgeField &field = *member.field;
    const bool list = PyList_Check(value) || PyTuple_Check(value);
    const auto n = static_cast<std::size_t>(list ? PySequence_Fast_GET_SIZE(value) : 1);
    if (field.ndim > 1 || list != (field.ndim == 1) ||
        (list && (member.count ? n > field.shape[0] : n != field.shape[0]))) {
        return refuse(object, member, value,
                      list && field.ndim ? std::to_string(n)
                      : is_object(value) ? as_object(value)->type->table->name
                                         : "");
    }
    std::vector<std::byte> rows(field.size);
    for (std::size_t i = 0; i < n; i++) {
        PyObject *one = list ? PySequence_Fast_GET_ITEM(value, static_cast<Py_ssize_t>(i)) : value;
        if (!store_row(object, member, i, one, rows.data())) {
            return Stored::no;
        }
    }
    Undo undo(*as_object(object), member);
    if (member.count && !settle_count(object, member, static_cast<std::uint32_t>(n))) {
        return Stored::no;
    }
    std::copy(rows.begin(), rows.end(), as_object(object)->memory + field.offset);
    if (!obeys(object, member)) {
        undo();
        return Stored::no;
    }
    return Stored::yes;
}

int set_any(PyObject *self, PyObject *value, void *closure)
{
    const Member &member = member_of(closure);
    if (!value) {
        PyErr_Format(PyExc_AttributeError, "%s.%s cannot be deleted", path_of(self).c_str(), member.field->name);
        return -1;
    }
    const auto path = [&] { return path_of(self) + "." + member.field->name; };
    switch (writable(self, member)) {
    case Writable::yes: break;
    case Writable::of_another:
        PyErr_Format(setup_error(), "%s is of another module: an update writes its own alone", path().c_str());
        return -1;
    case Writable::given:
        PyErr_Format(setup_error(),
                     "%s is a parameter or an input: an update only reads these, because no reset undoes what it "
                     "writes there; what it remembers belongs into its memory",
                     path().c_str());
        return -1;
    case Writable::written:
        PyErr_Format(setup_error(),
                     "%s is in an output of %s, which writes it at each update: an assignment has no "
                     "effect. Assign to a parameter, or to an input that is not wired",
                     path().c_str(), as_root(root_of(self))->instance->path.c_str());
        return -1;
    }
    const Stored stored = store(self, member, value);
    if (stored == Stored::needs_count) {
        complain_of_count(self, member);
    }
    return stored == Stored::yes ? 0 : -1;
}

/// The common case, a float for a double, without a detour: 10 ns.
int set_f64(PyObject *self, PyObject *value, void *closure)
{
    const Member &member = member_of(closure);
    const FledgeField &field = *member.field;
    if (value && PyFloat_CheckExact(value)) {
        const double x = PyFloat_AS_DOUBLE(value);
        const bool above = field.bounds & FLEDGE_LO_OPEN ? x > field.lo : x >= field.lo;
        const bool below = field.bounds & FLEDGE_HI_OPEN ? x < field.hi : x <= field.hi;
        const bool plain = exec_computable(x) && !(field.flags & FLEDGE_NON_ZERO) &&
                           (above || !(field.bounds & FLEDGE_HAS_LO)) && (below || !(field.bounds & FLEDGE_HAS_HI));
        if ((plain || !member.checked) && writable(self, member) == Writable::yes) {
            save(as_object(self)->memory + field.offset, x);
            if (member.checked) {
                mark_given(self, member);
            }
            return 0;
        }
    }
    return set_any(self, value, closure);
}

} // namespace

setter setter_for(const FledgeField &field)
{
    return field.type == FLEDGE_F64 && !field.ndim ? set_f64 : set_any;
}

Stored store(PyObject *object, const Member &member, PyObject *value)
{
    Stored stored;
    switch (member.field->type) {
    case FLEDGE_STRUCT: stored = store_struct(object, member, value); break;
    case FLEDGE_CHAR: stored = store_text(object, member, value); break;
    case FLEDGE_ENUM:
        if (!member.field->ndim) {
            stored = store_enum(object, member, value);
            break;
        }
        [[fallthrough]];
    default: stored = member.field->ndim ? store_array(object, member, value) : store_scalar(object, member, value);
    }
    if (stored == Stored::yes && member.checked) {
        mark_given(object, member);
    }
    return stored;
}

void complain_of_count(PyObject *object, const Member &member)
{
    std::string others;
    for (const Member &other : member.owner->members) {
        if (other.count == member.count && &other != &member) {
            others += std::string(others.empty() ? "" : ", ") + other.field->name;
        }
    }
    PyErr_Format(setup_error(),
                 "%s.%s: one number fills the rows that count, and there are none yet; set %s, or "
                 "give an array with rows%s%s",
                 path_of(object).c_str(), member.field->name, member.field->count, others.empty() ? "" : ", such as ",
                 others.c_str());
}

} // namespace fledge::core
