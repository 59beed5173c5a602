// SPDX-License-Identifier: Apache-2.0
#include "core/object.h"

#include "core/doc.h"
#include "core/errors.h"
#include "core/prototype.h"
#include "core/script.h"
#include "core/value.h"
#include "sim/error.h"
#include "sim/text.h"

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <map>
#include <new>
#include <structmember.h>
#include <unordered_map>

namespace fledge::core {

namespace {

// The extension's state. Types live until the interpreter ends.
PyTypeObject *module_base, *model_base, *message_base;
std::deque<Type> all_types;
std::unordered_map<const FledgeStruct *, Type *> by_table;
std::unordered_map<PyTypeObject *, Type *> by_python;
std::map<std::pair<std::string, std::uint64_t>, Type *> by_content;

// --- attributes ------------------------------------------------------------------------------------

/// Set an exception that names the object and the valid names.
void refuse_name(PyObject *self, PyObject *name, PyObject *exception, const char *reason = "unknown_attribute")
{
    if (PyObject *explain = hook(reason)) {
        if (PyObject *text = PyObject_CallFunctionObjArgs(explain, self, name, nullptr)) {
            PyErr_SetObject(exception, text);
            Py_DECREF(text);
        }
    }
}

/// Replace a plain AttributeError by one that names the object and the valid names. Tools probe for names with a
/// leading underscore: these errors stay.
void explain_attribute(PyObject *self, PyObject *name)
{
    if (!PyErr_ExceptionMatches(PyExc_AttributeError) || PyUnicode_READ_CHAR(name, 0) == '_') {
        return;
    }
    PyErr_Clear();
    refuse_name(self, name, PyExc_AttributeError);
}

PyObject *get_attribute(PyObject *self, PyObject *name)
{
    const bool prototype = as_object(self)->type->prototype;
    if (prototype && is_class_name(name)) {
        return class_of_object(self);
    }
    PyObject *value = PyObject_GenericGetAttr(self, name);
    if (!value && prototype && PyErr_ExceptionMatches(PyExc_AttributeError)) {
        PyObject *type, *error, *trace;
        PyErr_Fetch(&type, &error, &trace);
        value = attribute_of_class(self, name);
        if (value || PyErr_Occurred()) {
            Py_XDECREF(type);
            Py_XDECREF(error);
            Py_XDECREF(trace);
        } else {
            PyErr_Restore(type, error, trace);
        }
    }
    if (!value) {
        explain_attribute(self, name);
    }
    return value;
}

int set_attribute(PyObject *self, PyObject *name, PyObject *value)
{
    const int failed = PyObject_GenericSetAttr(self, name, value);
    if (failed && value && PyErr_ExceptionMatches(PyExc_AttributeError)) {
        // The name exists, but cannot be assigned: a method, or a read-only property.
        PyObject *there = PyObject_GetAttr(reinterpret_cast<PyObject *>(Py_TYPE(self)), name);
        if (there) {
            Py_DECREF(there);
            PyErr_Format(PyExc_AttributeError, "%s: '%U' cannot be assigned", path_of(self).c_str(), name);
        } else if (as_object(self)->type->prototype) {
            PyErr_Clear();
            refuse_name(self, name, PyExc_AttributeError, "undeclared_attribute");
        } else {
            explain_attribute(self, name);
        }
    }
    return failed;
}

PyObject *represent_html(PyObject *self, PyObject *)
{
    PyObject *show = hook("show_html");
    return show ? PyObject_CallOneArg(show, self) : nullptr;
}

PyObject *represent(PyObject *self)
{
    PyObject *show = hook("show");
    return show ? PyObject_CallOneArg(show, self) : nullptr;
}

// --- making ----------------------------------------------------------------------------------------

/// Set fields from keywords, and the properties that Python has added to the type.
bool set_keywords(PyObject *self, const Type &type, PyObject *arguments, PyObject *keywords)
{
    if (PyTuple_GET_SIZE(arguments) > 0) {
        const Member *example = nullptr;
        for (const Member &member : type.members) {
            if (!example || (member.checked && !example->checked)) {
                example = &member;
            }
        }
        PyErr_Format(PyExc_TypeError, "%s takes keywords only%s%s%s", type.table->name, example ? ", as in " : "",
                     example ? example->field->name : "", example ? "=..." : "");
        return false;
    }
    return !keywords || set_fields(self, type, keywords, PyExc_TypeError);
}

Root *allocate_root(const Type &type, std::shared_ptr<sim::Instance> instance)
{
    Root *self = PyObject_New(Root, type.python);
    if (self) {
        self->memory = instance->memory();
        self->type = &type;
        self->weak = self->parts = self->context = nullptr;
        self->runs = false;
        self->tick = nullptr;
        new (&self->instance) std::shared_ptr<sim::Instance>(std::move(instance));
    }
    return self;
}

PyObject *new_root(PyTypeObject *python, PyObject *arguments, PyObject *keywords)
{
    const Type &type = *by_python.at(python);
    Root *self = nullptr;
    try {
        self = allocate_root(type, type.model ? std::make_shared<sim::Instance>(*type.model)
                                              : std::make_shared<sim::Instance>(*type.table));
    } catch (...) {
        translate_exception();
    }
    PyObject *rest = self ? take_script(*self, keywords) : nullptr;
    if (self && (!rest || !set_keywords(reinterpret_cast<PyObject *>(self), type, arguments, rest))) {
        Py_CLEAR(self);
    }
    Py_XDECREF(rest);
    return reinterpret_cast<PyObject *>(self);
}

PyObject *new_message(PyTypeObject *python, PyObject *arguments, PyObject *keywords)
{
    const Type &type = *by_python.at(python);
    View *self = PyObject_New(View, python);
    if (!self) {
        return nullptr;
    }
    self->type = &type;
    self->weak = self->owner = nullptr;
    self->member = nullptr;
    self->memory = static_cast<std::byte *>(std::calloc(1, type.table->size));
    if (!self->memory) {
        Py_DECREF(self);
        return PyErr_NoMemory();
    }
    if (!set_keywords(reinterpret_cast<PyObject *>(self), type, arguments, keywords)) {
        Py_CLEAR(self);
    }
    return reinterpret_cast<PyObject *>(self);
}

PyObject *no_new(PyTypeObject *python, PyObject *, PyObject *)
{
    const Type *type = find_type(python);
    PyErr_Format(PyExc_TypeError,
                 type ? "%s is the memory of a prototype; call its class instead"
                      : "%s is a base type; make an object of one of its types instead",
                 python->tp_name);
    return nullptr;
}

void delete_root(PyObject *object)
{
    Root *self = as_root(object);
    PyTypeObject *python = Py_TYPE(object);
    if (self->weak) {
        PyObject_ClearWeakRefs(object);
    }
    Py_XDECREF(self->parts);
    Py_XDECREF(self->context);
    self->instance.~shared_ptr();
    PyObject_Free(object);
    Py_DECREF(python);
}

void delete_view(PyObject *object)
{
    View *self = as_view(object);
    PyTypeObject *python = Py_TYPE(object);
    if (self->weak) {
        PyObject_ClearWeakRefs(object);
    }
    if (self->owner) {
        Py_DECREF(self->owner);
    } else {
        std::free(self->memory);
    }
    PyObject_Free(object);
    Py_DECREF(python);
}

// --- methods ---------------------------------------------------------------------------------------

/// a.out >> b.in, or >> [b.in, c.in]
PyObject *wire(PyObject *from, PyObject *to)
{
    if (!is_view(from)) {
        Py_RETURN_NOTIMPLEMENTED;
    }
    PyObject *join = hook("wire");
    return join ? PyObject_CallFunctionObjArgs(join, from, to, nullptr) : nullptr;
}

PyObject *reset(PyObject *self, PyObject *)
{
    try {
        Root *root = as_root(self);
        sim::check_parameters(*root->instance);
        root->instance->reset();
    } catch (...) {
        translate_exception();
        return nullptr;
    }
    Py_RETURN_NONE;
}

PyObject *update(PyObject *self, PyObject *arguments, PyObject *keywords)
{
    static const char *names[] = {"t", "dt", "t_ns", "dt_ns", nullptr};
    double t = 0.0, dt = 0.0;
    PyObject *t_ns = Py_None, *dt_ns = Py_None;
    if (!PyArg_ParseTupleAndKeywords(arguments, keywords, "|dd$OO:update", const_cast<char **>(names), &t, &dt, &t_ns,
                                     &dt_ns)) {
        return nullptr;
    }
    const auto ns = [](double seconds, PyObject *exact) -> std::int64_t {
        return exact == Py_None ? std::llround(seconds * 1e9) : PyLong_AsLongLong(exact);
    };
    const Tick tick{ns(t, t_ns), ns(dt, dt_ns)};
    if (PyErr_Occurred()) {
        return nullptr;
    }
    try {
        as_root(self)->instance->update(tick);
    } catch (...) {
        translate_exception();
        return nullptr;
    }
    Py_RETURN_NONE;
}

PyMethodDef module_methods[] = {
    {"reset", reset, METH_NOARGS,
     "reset($self, /)\n--\n\nForget what was learnt from earlier updates, as at the start of a "
     "run.\n"
     "The parameters are checked first: SetupError lists every fault."},
    {"update", reinterpret_cast<PyCFunction>(reinterpret_cast<void (*)()>(update)), METH_VARARGS | METH_KEYWORDS,
     "update($self, /, t=0.0, dt=0.0, *, t_ns=None, dt_ns=None)\n--\n\n"
     "Run the algorithm once, by itself: read the inputs, write the outputs.\n\n"
     "t is the time [s], dt the time since the last update [s], 0 at the first after a reset. Give "
     "t_ns\n"
     "and dt_ns instead for exact nanoseconds."},
    // From here on those of a world model too.
    {"publish", reinterpret_cast<PyCFunction>(reinterpret_cast<void (*)()>(publish)), METH_VARARGS | METH_KEYWORDS,
     "publish($self, output, /, quality=\"GOOD\")\n--\n\n"
     "In an update in Python: the output was written, for the time of this update."},
    {"held", held, METH_O,
     "held($self, output, /)\n--\n\n"
     "In an update in Python: the output could not be computed anew. It keeps its content, time and sequence;\n"
     "its quality is no more than DEGRADED."},
    // And those of a message.
    {"_repr_html_", represent_html, METH_NOARGS, "_repr_html_($self, /)\n--\n\nWhat a notebook shows."},
    {}};
constexpr int own_methods = 2, with_messages = 4;

PyMemberDef object_members[] = {
    {"__weaklistoffset__", T_PYSSIZET, static_cast<Py_ssize_t>(offsetof(Object, weak)), READONLY, nullptr}, {}};

PyTypeObject *make_base(const char *name, const char *doc, std::size_t size, PyMethodDef *methods, bool wires)
{
    std::vector<PyType_Slot> slots{{Py_tp_new, reinterpret_cast<void *>(no_new)},
                                   {Py_tp_doc, const_cast<char *>(doc)},
                                   {Py_tp_members, object_members},
                                   {Py_tp_methods, methods}};
    if (wires) {
        slots.push_back({Py_nb_rshift, reinterpret_cast<void *>(wire)});
    }
    slots.push_back({0, nullptr});
    PyType_Spec spec{name, static_cast<int>(size), 0, Py_TPFLAGS_DEFAULT | Py_TPFLAGS_BASETYPE, slots.data()};
    return reinterpret_cast<PyTypeObject *>(PyType_FromSpec(&spec));
}

} // namespace

bool set_fields(PyObject *self, const Type &type, PyObject *values, PyObject *unknown)
{
    Py_ssize_t found = 0;
    std::vector<std::pair<const Member *, PyObject *>> waiting;
    for (const Member &member : type.members) {
        PyObject *value = PyDict_GetItemWithError(values, member.name);
        if (!value) {
            continue;
        }
        found++;
        switch (store(self, member, value)) {
        case Stored::yes: break;
        case Stored::no: return false;
        case Stored::needs_count: waiting.emplace_back(&member, value);
        }
    }
    for (const auto &[member, value] : waiting) {
        switch (store(self, *member, value)) {
        case Stored::yes: break;
        case Stored::needs_count: complain_of_count(self, *member); [[fallthrough]];
        case Stored::no: return false;
        }
    }
    if (found == PyDict_GET_SIZE(values)) {
        return true;
    }
    PyObject *name, *value;
    for (Py_ssize_t i = 0; PyDict_Next(values, &i, &name, &value);) {
        if (PyUnicode_Check(name) && type.find(PyUnicode_AsUTF8(name))) {
            continue;
        }
        PyObject *there =
            PyUnicode_Check(name) ? PyObject_GetAttr(reinterpret_cast<PyObject *>(Py_TYPE(self)), name) : nullptr;
        const bool property = there && PyObject_TypeCheck(there, &PyProperty_Type);
        Py_XDECREF(there);
        PyErr_Clear();
        if (property) {
            if (PyObject_SetAttr(self, name, value)) {
                return false;
            }
        } else {
            refuse_name(self, name, unknown);
            return false;
        }
    }
    return true;
}

const Member *Type::find(std::string_view name) const
{
    for (const Member &member : members) {
        if (name == member.field->name) {
            return &member;
        }
    }
    return nullptr;
}

bool is_root(PyObject *p)
{
    return PyObject_TypeCheck(p, module_base) || PyObject_TypeCheck(p, model_base);
}

bool is_view(PyObject *p)
{
    return PyObject_TypeCheck(p, message_base);
}

bool is_object(PyObject *p)
{
    return is_view(p) || is_root(p);
}

std::string path_of(PyObject *object)
{
    if (is_root(object)) {
        return as_root(object)->instance->path;
    }
    const View *view = as_view(object);
    if (!view->owner) {
        return view->type->table->name;
    }
    const FledgeField &field = *view->member->field;
    return path_of(view->owner) + "." + field.name + sim::index_text(field, view->index);
}

PyObject *root_of(PyObject *object)
{
    while (object && is_view(object)) {
        object = as_view(object)->owner;
    }
    return object;
}

Writable writable(PyObject *object, const Member &member)
{
    const Member *outer = &member; // the field of the module that the member is in
    for (; object && is_view(object); object = as_view(object)->owner) {
        outer = as_view(object)->member;
    }
    if (!object) {
        return Writable::yes; // of no module
    }
    const Root &root = *as_root(object);
    const auto group = static_cast<FledgeGroup>(outer->field->group);
    if (running() == root.instance.get()) {
        if (group == FLEDGE_PAR || group == FLEDGE_IN) {
            return Writable::given;
        }
    } else if (running() && !root.instance->name.empty()) {
        return Writable::of_another;
    } else if (root.instance->maker == sim::Instance::Maker::computer) {
        return Writable::elsewhere;
    } else if (group == FLEDGE_IN && root.instance->fed[outer->index]) {
        return Writable::wired;
    } else if (group == FLEDGE_MEM && !running() && !root.instance->name.empty() && !root.instance->begun) {
        return Writable::too_early;
    }
    return group == FLEDGE_OUT && !root.runs && !root.instance->name.empty() ? Writable::written : Writable::yes;
}

PyObject *wrap(std::shared_ptr<sim::Instance> instance)
{
    const Type *type = find_type(instance->type());
    if (!type) {
        PyErr_Format(PyExc_TypeError, "no library with the type %s is loaded", instance->type().name);
        return nullptr;
    }
    return reinterpret_cast<PyObject *>(allocate_root(*type, std::move(instance)));
}

void refuse_field(PyObject *object, const Member &member, const char *function)
{
    PyObject *explain = hook(function);
    const std::string path = path_of(object) + "." + member.field->name;
    PyObject *text = explain ? PyObject_CallFunction(explain, "Os", root_of(object), path.c_str()) : nullptr;
    if (text) {
        PyErr_SetObject(setup_error(), text);
        Py_DECREF(text);
    }
}

PyObject *hook(const char *name)
{
    static PyObject *hooks;
    if (!hooks) {
        hooks = PyImport_ImportModule("fledge.objects.hooks");
    }
    PyObject *function = hooks ? PyObject_GetAttrString(hooks, name) : nullptr;
    Py_XDECREF(function); // the module holds it
    return function;
}

bool add_base_types(PyObject *module)
{
    module_base = make_base("fledge.Module", "A flight algorithm: its inputs, outputs, parameters and memory.",
                            sizeof(Root), module_methods, false);
    model_base =
        make_base("fledge.Model", "A piece of the simulated world.", sizeof(Root), module_methods + own_methods, false);
    message_base = make_base("fledge.Message", "What modules and models exchange. `a.output >> b.input` makes a wire.",
                             sizeof(View), module_methods + with_messages, true);
    return module_base && model_base && message_base && !PyModule_AddType(module, module_base) &&
           !PyModule_AddType(module, model_base) && !PyModule_AddType(module, message_base);
}

const Type *find_type(const FledgeStruct &table)
{
    const auto known = by_table.find(&table);
    if (known != by_table.end()) {
        return known->second;
    }
    const auto same = by_content.find({table.name, table.hash});
    return same == by_content.end() ? nullptr : same->second;
}

const Type *find_type(PyTypeObject *python)
{
    const auto known = by_python.find(python);
    return known == by_python.end() ? nullptr : known->second;
}

namespace {

const Type *make_type(const FledgeStruct &table, const char *library, const sim::ModelType *model, bool prototype)
{
    Type &type = all_types.emplace_back();
    type.table = &table;
    type.model = model;
    type.prototype = prototype;
    for (std::uint32_t i = 0; i < table.n; i++) {
        const FledgeField &field = table.fields[i];
        if (field.flags & FLEDGE_SPARE) {
            continue;
        }
        Member &member = type.members.emplace_back();
        member.field = &field;
        member.owner = &type;
        member.index = i;
        member.checked = field.group == FLEDGE_PAR;
        member.doc = field_doc(field);
        if (!(member.name = PyUnicode_InternFromString(field.name))) {
            return nullptr;
        }
        if (field.sub && !(member.sub = type_of(*field.sub, library))) {
            return nullptr;
        }
    }
    for (Member &member : type.members) {
        if (member.field->count) {
            member.count = type.find(member.field->count);
        }
        const bool memory = table.kind == FLEDGE_MODULE && member.field->group == FLEDGE_MEM;
        type.getset.push_back({member.field->name, memory ? get_memory : getter_for(*member.field),
                               setter_for(*member.field), member.doc.c_str(), &member});
    }
    type.getset.push_back({});

    const bool root = table.kind == FLEDGE_MODULE || table.kind == FLEDGE_MODEL;
    const std::string name = "fledge." + std::string(library) + "." + table.name;
    const std::string doc = type_doc(table);
    const newfunc make = prototype ? no_new : root ? new_root : new_message;
    PyType_Slot slots[] = {{Py_tp_new, reinterpret_cast<void *>(make)},
                           {Py_tp_dealloc, reinterpret_cast<void *>(root ? delete_root : delete_view)},
                           {Py_tp_getattro, reinterpret_cast<void *>(get_attribute)},
                           {Py_tp_setattro, reinterpret_cast<void *>(set_attribute)},
                           {Py_tp_repr, reinterpret_cast<void *>(represent)},
                           {Py_tp_getset, type.getset.data()},
                           {Py_tp_doc, const_cast<char *>(doc.c_str())},
                           {0, nullptr}};
    // Not a base type: an attribute misspelt in a subclass would become one of the instance.
    PyType_Spec spec{name.c_str(), static_cast<int>(root ? sizeof(Root) : sizeof(View)), 0, Py_TPFLAGS_DEFAULT, slots};
    PyTypeObject *base = table.kind == FLEDGE_MODULE  ? module_base
                         : table.kind == FLEDGE_MODEL ? model_base
                                                      : message_base;
    type.python = reinterpret_cast<PyTypeObject *>(PyType_FromSpecWithBases(&spec, reinterpret_cast<PyObject *>(base)));
    if (!type.python) {
        return nullptr;
    }
    by_table[&table] = &type;
    by_python[type.python] = &type;
    return &type;
}

} // namespace

const Type *type_of(const FledgeStruct &table, const char *library, const sim::ModelType *model)
{
    if (const Type *known = find_type(table)) {
        return known;
    }
    const Type *type = make_type(table, library, model, false);
    if (type) {
        by_content[{table.name, table.hash}] = by_table.at(&table);
    }
    return type;
}

const Type *make_prototype_type(const FledgeStruct &table)
{
    return make_type(table, "prototype", nullptr, true);
}

PyObject *new_object(const Type &type, std::shared_ptr<sim::Instance> instance, PyObject *keywords)
{
    auto *self = reinterpret_cast<PyObject *>(allocate_root(type, std::move(instance)));
    if (self && !set_fields(self, type, keywords, PyExc_TypeError)) {
        Py_CLEAR(self);
    }
    return self;
}

} // namespace fledge::core
