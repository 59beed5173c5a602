// SPDX-License-Identifier: Apache-2.0
// From Python's values to a field's bytes: convert, check, and undo if the check fails.
#include "core/element.h"
#include "core/errors.h"
#include "core/numbers.h"
#include "core/script.h"
#include "core/value.h"
#include "flight/exec/assign.h"
#include "sim/error.h"

#include <optional>

namespace fledge::core {

namespace {

// --- complaining -----------------------------------------------------------------------------------

AssignField described(const Member &member)
{
    const FledgeField &field = *member.field;
    AssignField all{field.type, field.size, field.ndim, {}, field.count, field.unit, field.ctype};
    std::copy_n(field.shape, field.ndim, all.shape);
    return all;
}

std::string expectation(const Member &member)
{
    std::string text;
    const AssignField field = described(member);
    assign_expected(
        {&text, [](void *to, const char *words, std::size_t n) { static_cast<std::string *>(to)->append(words, n); }},
        &field);
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

/// Remember that the user gave a field; inside a struct, the module's field that holds it.
void mark_given(PyObject *object, const Member &member, bool bare)
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
    as_root(object)->instance->bare[outer->index] = bare;
}

bool is_given(PyObject *object, const Member &member)
{
    return is_root(object) && as_root(object)->instance->given[member.index];
}

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

/// The bytes of a field, made aside because a value may be a view of what is there.
struct Made {
    std::vector<std::byte> bytes;
    std::optional<std::uint32_t> rows; ///< that count then, of a field with a count
    bool bare = false;                 ///< of plain numbers, without a unit
};

/// Put them in place, unless that breaks a rule.
Stored put(PyObject *object, const Member &member, Made &made)
{
    std::byte *to = as_object(object)->memory + member.field->offset;
    const std::uint32_t n = made.rows ? read_count(*as_object(object), *member.count) : 0;
    if (made.rows && !settle_count(object, member, *made.rows)) {
        return Stored::no;
    }
    std::swap_ranges(made.bytes.begin(), made.bytes.end(), to);
    if (obeys(object, member)) {
        return Stored::yes;
    }
    std::swap_ranges(made.bytes.begin(), made.bytes.end(), to);
    if (made.rows) {
        write_count(*as_object(object), *member.count, n);
    }
    return Stored::no;
}

Stored make_numbers(PyObject *object, const Member &member, PyObject *value, Made &made)
{
    const FledgeField &field = *member.field;
    const bool names = field.type == FLEDGE_ENUM && !(field.ndim && PyLong_CheckExact(value));
    const bool flag = PyBool_Check(value) && !field.ndim && !assign_is_float(field.type) && !names;
    Numbers in;
    Read read = flag ? Read::yes : names ? Read::foreign : read_numbers(value, in);
    made.bare = read == Read::yes;
    if (flag) {
        in.values.push_back(number_of(value));
    } else if (read == Read::foreign) {
        PyObject *plain = names ? to_enumerators(object, member, value) : to_si(object, member, value);
        if (!plain) {
            return Stored::no;
        }
        in = {};
        read = read_numbers(plain, in);
        Py_DECREF(plain);
    }
    if (read != Read::yes) {
        return refuse(object, member, value, read == Read::ragged && field.ndim ? "rows of unequal length" : "");
    }
    const AssignField all = described(member);
    AssignSpread spread;
    const std::uint32_t rows = field.ndim ? rows_of(*as_object(object), member) : 1;
    switch (assign_spread(&all, in.shape.data(), in.ndim, rows, &spread)) {
    case ASSIGN_FITS: break;
    case ASSIGN_NO_ROWS: return Stored::needs_count;
    case ASSIGN_WRONG_SHAPE:
        std::string found = in.ndim ? "shape (" : "a single number";
        for (std::uint32_t i = 0; i < in.ndim; i++) {
            found += (i ? ", " : "") + std::to_string(in.shape[i]);
        }
        return refuse(object, member, value, field.ndim ? found + (in.ndim ? ")" : "") : "");
    }
    if (member.count && in.ndim) {
        made.rows = spread.rows;
    }
    const std::size_t step = spread.step * element_size(field.type);
    for (std::size_t i = 0; i < std::max<std::size_t>(in.values.size(), spread.copies); i++) {
        if (!assign_number(field.type, made.bytes.data() + i * step, in.values[spread.copies > 1 ? 0 : i])) {
            return refuse(object, member, value);
        }
    }
    return Stored::yes;
}

Stored make_text(PyObject *object, const Member &member, PyObject *value, Made &made)
{
    Py_ssize_t size = 0;
    const char *text = PyUnicode_Check(value) ? PyUnicode_AsUTF8AndSize(value, &size) : nullptr;
    if (!text || static_cast<std::size_t>(size) >= member.field->size) {
        return refuse(object, member, value);
    }
    std::memcpy(made.bytes.data(), text, static_cast<std::size_t>(size));
    return Stored::yes;
}

/// A row of `rows`, from a struct of the same type or from a dict: fields that it leaves out become 0.
bool make_row(PyObject *object, const Member &member, std::size_t index, PyObject *value, std::byte *rows)
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

/// A struct, or an array of them.
Stored make_structs(PyObject *object, const Member &member, PyObject *value, Made &made)
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
    for (std::size_t i = 0; i < n; i++) {
        PyObject *element = list ? PySequence_Fast_GET_ITEM(value, static_cast<Py_ssize_t>(i)) : value;
        if (!make_row(object, member, i, element, made.bytes.data())) {
            return Stored::no;
        }
    }
    if (member.count) {
        made.rows = static_cast<std::uint32_t>(n);
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
    case Writable::wired: refuse_field(self, member, "wired_input"); return -1;
    case Writable::too_early:
        PyErr_Format(setup_error(),
                     "%s is memory, and the run begins with a reset, which sets it anew: assign it after the first "
                     "instant, sim.step(), or to a parameter",
                     path().c_str());
        return -1;
    case Writable::elsewhere: refuse_field(self, member, "flown_elsewhere"); return -1;
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
        const bool plain =
            exec_computable(x) && !(field.flags & FLEDGE_NON_ZERO) && exec_within(field.bounds, field.lo, field.hi, x);
        if ((plain || !member.checked) && writable(self, member) == Writable::yes) {
            save(as_object(self)->memory + field.offset, x);
            if (!running()) {
                mark_given(self, member, true);
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
    Made made{std::vector<std::byte>(member.field->size), {}};
    const auto make = member.field->type == FLEDGE_STRUCT ? make_structs
                      : member.field->type == FLEDGE_CHAR ? make_text
                                                          : make_numbers;
    Stored stored = make(object, member, value, made);
    if (stored == Stored::yes) {
        stored = put(object, member, made);
    }
    if (stored == Stored::yes && !running()) {
        mark_given(object, member, made.bare);
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
