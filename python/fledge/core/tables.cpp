// SPDX-License-Identifier: Apache-2.0
// Libraries, their types, and the tables of types and objects.
#include "core/doc.h"
#include "core/extension.h"
#include "core/script.h"
#include "core/value.h"

#include "sim/error.h"
#include "sim/library_file.h"
#include "world/models.h"

#include <cstring>
#include <span>

extern "C" {
extern const FledgeLibrary fledge_library_flight;
extern const FledgeLibrary fledge_library_world;
}

namespace py = pybind11;
using namespace py::literals;

namespace fledge::core {

namespace {

const char *type_name(FledgeType type)
{
    static const char *const names[] = {"f64", "f32", "i8",  "u8",   "i16",  "u16",   "i32",
                                        "u32", "i64", "u64", "char", "enum", "struct"};
    return names[type];
}

const char *group_name(FledgeGroup group)
{
    static const char *const names[] = {"", "in", "out", "par", "mem"};
    return names[group];
}

const char *kind_name(FledgeKind kind)
{
    static const char *const names[] = {"plain", "message", "module", "model"};
    return names[kind];
}

using Models = std::span<const sim::ModelType>;

const sim::ModelType *model_of(const FledgeStruct &table, Models models)
{
    for (const sim::ModelType &model : models) {
        if (model.interface == &table) {
            return &model;
        }
    }
    return nullptr;
}

/// The types of a library by name.
using Types = Typed<py::dict, "dict[str, type[Module] | type[Model] | type[Message]]">;

Types types_of(const FledgeLibrary &library, Models models)
{
    sim::check_version(library.name, "tables", library.version, FLEDGE_TABLE_VERSION);
    py::dict types;
    for (std::uint32_t i = 0; i < library.n; i++) {
        const FledgeStruct &table = *library.structs[i];
        const sim::ModelType *model = model_of(table, models);
        if (table.kind == FLEDGE_MODEL && !model) {
            throw sim::SetupError("the library " + std::string(library.name) + " has no behaviour for the model " +
                                  table.name);
        }
        const Type *type = type_of(table, library.name, model);
        if (!type) {
            throw py::error_already_set();
        }
        types[table.name] = py::reinterpret_borrow<py::object>(reinterpret_cast<PyObject *>(type->python));
    }
    return types;
}

Types load_library(const std::string &path, const std::string &name)
{
    const sim::LibraryFile file = sim::open_library(path, name, &fledge_library_flight);
    return types_of(*file.tables, file.models);
}

const FledgeStruct &struct_of(py::handle object)
{
    const Type *type = PyType_Check(object.ptr()) ? find_type(reinterpret_cast<PyTypeObject *>(object.ptr()))
                                                  : find_type(Py_TYPE(object.ptr()));
    if (!type) {
        throw py::type_error("expected a module, model or message, found " + std::string(py::repr(object)));
    }
    return *type->table;
}

/// (name, doc, [(name, value, doc), ...]), or None.
using Enumeration =
    std::tuple<const char *, const char *, std::vector<std::tuple<const char *, std::int64_t, const char *>>>;

std::optional<Enumeration> enumeration(const FledgeEnum *table)
{
    if (!table) {
        return std::nullopt;
    }
    return Enumeration(table->name, table->doc,
                       list_of(std::span(table->values, table->n), [](const FledgeEnumerator &value) {
                           return std::tuple(value.name, value.value, value.doc);
                       }));
}

std::optional<std::string> text_or_none(const char *text)
{
    return text ? std::optional<std::string>(text) : std::nullopt;
}

using StructOf = Typed<py::object, "Struct">; ///< of a field whose type is "struct"; else None
using FieldOrNone = Typed<py::object, "Field | None">;
using FieldObject = Typed<py::object, "Field">;
using Row = Typed<py::object, "Message">;
using InstanceOrNone = Typed<py::object, "Module | Model | None">;
using ScriptOrNone = Typed<py::object, "tuple[Callable[..., Any], Callable[..., Any] | None] | None">;
using Reference = Typed<py::object, "Callable[[], Any]">; ///< a weak one
using ReferenceOrNone = Typed<py::object, "Callable[[], Any] | None">;

template <class T> py::object referenced(const T *value)
{
    return py::cast(value, py::return_value_policy::reference); // of null: None
}

template <class T> T need(T value, const char *what, py::handle found)
{
    if (!value) {
        throw py::type_error("expected " + std::string(what) + ", found " + std::string(py::repr(found)));
    }
    return value;
}

} // namespace

std::shared_ptr<sim::Instance> instance_of(py::handle object)
{
    need(is_root(object.ptr()), "a module or model", object);
    return as_root(object.ptr())->instance;
}

py::object object_of(std::shared_ptr<sim::Instance> instance)
{
    PyObject *object = wrap(std::move(instance));
    if (!object) {
        throw py::error_already_set();
    }
    return py::reinterpret_steal<py::object>(object);
}

namespace {

Typed<py::tuple, "tuple[int, ...]"> numbers_of(auto range)
{
    py::tuple numbers(range.size());
    for (std::size_t i = 0; i < range.size(); i++) {
        numbers[i] = static_cast<int>(range[i]);
    }
    return numbers;
}

void bind_field(py::module_ &m)
{
    using Field = FledgeField;
    py::class_<Field> fields(m, "Field", "A field of a struct, as declared in its header.");
    fields.def_readonly("name", &Field::name)
        .def_readonly("offset", &Field::offset, "[bytes] from the start of the struct")
        .def_readonly("size", &Field::size, "[bytes]")
        .def_readonly("unit", &Field::unit, "as in the header; '-' if dimensionless, '' if none is given")
        .def_readonly("ctype", &Field::ctype)
        .def_readonly("doc", &Field::doc)
        .def_property_readonly(
            "type", [](const Field &f) { return type_name(f.type); }, "f64, i32, ... struct")
        .def_property_readonly(
            "group", [](const Field &f) { return group_name(f.group); }, "in, out, par, mem or ''")
        .def_property_readonly("rule", rule_text, "'required, > 0', or ''")
        .def_property_readonly(
            "count", [](const Field &f) { return text_or_none(f.count); },
            "the field that says how many rows count, or None")
        .def_property_readonly("shape", [](const Field &f) { return numbers_of(std::span(f.shape, f.ndim)); })
        .def_property_readonly(
            "dims", [](const Field &f) { return numbers_of(std::span(f.dims, 8)); },
            "exponents of m, kg, s, A, K, mol, cd, rad")
        .def_property_readonly("struct", [](const Field &f) -> StructOf { return referenced(f.sub); })
        .def_property_readonly(
            "enumerators",
            [](const Field &f) {
                const std::span all(f.values ? f.values->values : nullptr, f.values ? f.values->n : 0);
                return list_of(all, [](const FledgeEnumerator &enumerator) {
                    return std::pair(enumerator.name, enumerator.value);
                });
            },
            "(name, value) of each, of an enum")
        .def_property_readonly(
            "enumeration", [](const Field &f) { return enumeration(f.values); },
            "(name, doc, [(name, value, doc), ...]) of an enum, or None")
        .def_property_readonly(
            "bounds",
            [](const Field &f) {
                const auto end = [&](std::uint32_t has, double x) {
                    return f.bounds & has ? std::optional(x) : std::nullopt;
                };
                return std::tuple(end(FLEDGE_HAS_LO, f.lo), end(FLEDGE_HAS_HI, f.hi),
                                  static_cast<bool>(f.bounds & FLEDGE_LO_OPEN),
                                  static_cast<bool>(f.bounds & FLEDGE_HI_OPEN));
            },
            "(lowest or None, highest or None, whether the lowest itself is excluded, and the highest)")
        .def_property_readonly(
            "distinct", [](const Field &f) { return text_or_none(f.distinct); },
            "the input that may not hold the same, or None");
    const auto flag = [&](const char *name, std::uint32_t bit) {
        fields.def_property_readonly(name, [bit](const Field &f) { return static_cast<bool>(f.flags & bit); });
    };
    flag("required", FLEDGE_REQUIRED);
    flag("assumed", FLEDGE_ASSUMED);
    flag("non_zero", FLEDGE_NON_ZERO);
    flag("inertia", FLEDGE_INERTIA);
    flag("initial", FLEDGE_INITIAL);
    flag("optional", FLEDGE_OPTIONAL);
    flag("spare", FLEDGE_SPARE);
}

void bind_struct(py::module_ &m)
{
    py::class_<FledgeStruct>(m, "Struct", "A module, model, message or plain struct, as declared in its header.")
        .def_readonly("name", &FledgeStruct::name)
        .def_readonly("doc", &FledgeStruct::doc)
        .def_readonly("header", &FledgeStruct::header)
        .def_readonly("folder", &FledgeStruct::folder)
        .def_readonly("size", &FledgeStruct::size)
        .def_readonly("align", &FledgeStruct::align)
        .def_readonly("hash", &FledgeStruct::hash)
        .def_property_readonly(
            "kind", [](const FledgeStruct &s) { return kind_name(s.kind); }, "plain, message, module or model")
        .def_property_readonly(
            "service", [](const FledgeStruct &s) { return s.service != nullptr; }, "whether commands need the module")
        .def_property_readonly(
            "events", [](const FledgeStruct &s) { return enumeration(s.events); },
            "(name, doc, [(name, value, doc), ...]) of what a module says, or None")
        .def_property_readonly("schema", [](const FledgeStruct &s) { return s.schema ? s.schema : ""; })
        .def_property_readonly("fields", [](const py::object &self) {
            const auto &s = self.cast<const FledgeStruct &>();
            return list_of(std::span(s.fields, s.n), [](const FledgeField &f) { return FieldObject(referenced(&f)); });
        });
}

void bind_libraries(py::module_ &m)
{
    m.def(
        "library",
        [](const std::string &name) {
            return types_of(name == "world" ? fledge_library_world : fledge_library_flight, world::models());
        },
        "name"_a, "The types of the library 'flight' or 'world', by name.");
    const auto message = [](const char *name) -> const FledgeStruct & {
        const FledgeLibrary &flight = fledge_library_flight;
        return **std::find_if(flight.structs, flight.structs + flight.n,
                              [&](const FledgeStruct *table) { return std::strcmp(table->name, name) == 0; });
    };
    sim::set_executive_types(message("ProcessMode"), message("Activity"));
    m.def("load_library", load_library, "path"_a, "name"_a,
          "Load a shared library of modules and models and return its types by name.");
    m.def("struct", struct_of, "object"_a, py::return_value_policy::reference,
          "The table of an object's or type's struct.");
}

/// Functions of objects: modules, models and messages.
void bind_objects(py::module_ &m)
{
    m.def(
        "path",
        [](const AnyObject &object) {
            struct_of(object);
            return path_of(object.ptr());
        },
        "object"_a, "'flight.control.error', or the type's name for what has no name yet.");
    m.def(
        "name", [](const AnyInstance &object) { return instance_of(object)->name; }, "object"_a);
    m.def(
        "root",
        [](const AnyObject &object) -> InstanceOrNone {
            struct_of(object);
            PyObject *root = root_of(object.ptr());
            return root ? py::reinterpret_borrow<py::object>(root) : py::none();
        },
        "object"_a, "The module or model that a message is a part of, or None.");
    m.def(
        "field",
        [](const AnyPort &view) -> FieldOrNone {
            need(is_view(view.ptr()), "a message", view);
            const View *v = as_view(view.ptr());
            return referenced(v->member ? v->member->field : nullptr);
        },
        "view"_a, "The field of its owner that is this message, or None.");
    m.def(
        "row",
        [](const AnyObject &object, const std::string &name, std::size_t index) -> Row {
            struct_of(object);
            const Member *member = as_object(object.ptr())->type->find(name);
            PyObject *row =
                row_of(object.ptr(), *member, index, as_object(object.ptr())->memory + member->field->offset);
            if (!row) {
                throw py::error_already_set();
            }
            return py::reinterpret_steal<py::object>(row);
        },
        "object"_a, "name"_a, "index"_a, "A row of an array of structs, also one beyond those that count.");
}

/// What an object holds, and where that is from.
void bind_contents(py::module_ &m)
{
    const auto names_where = [](std::vector<bool> sim::Instance::*marks, bool parameters) {
        return [marks, parameters](const AnyInstance &object) {
            const auto instance = instance_of(object);
            std::vector<std::string> names;
            for (std::uint32_t i = 0; i < instance->type().n; i++) {
                const FledgeField &field = instance->type().fields[i];
                const bool of_these =
                    parameters ? field.group == FLEDGE_PAR : field.group == FLEDGE_OUT || field.group == FLEDGE_MEM;
                if (of_these && (*instance.*marks)[i]) {
                    names.emplace_back(field.name);
                }
            }
            return names;
        };
    };
    m.def("given", names_where(&sim::Instance::given, true), "object"_a,
          "The names of the parameters that the user gave.");
    m.def("bare", names_where(&sim::Instance::bare, true), "object"_a,
          "The names of those that the user gave without a unit.");
    m.def("assigned", names_where(&sim::Instance::given, false), "object"_a,
          "The names of outputs and memory that the user set.");
    m.def(
        "memory",
        [](const AnyObject &object) {
            struct_of(object);
            const Object &o = *as_object(object.ptr());
            return py::bytes(reinterpret_cast<const char *>(o.memory), o.type->table->size);
        },
        "object"_a, "A copy of an object's bytes.");
    m.def(
        "maker",
        [](const AnyInstance &object) {
            const char *const names[] = {"itself", "record", "computer", "model"};
            return names[static_cast<int>(instance_of(object)->maker)];
        },
        "object"_a, "What makes the outputs of a module: itself, a record, or a computer or model in its place.");
}

/// What Python gives a module or model: functions, and its context.
void bind_scripts(py::module_ &m)
{
    m.def(
        "script",
        [](const AnyInstance &object) -> ScriptOrNone {
            instance_of(object);
            return py::reinterpret_steal<py::object>(script_of(*as_root(object.ptr())));
        },
        "object"_a, "(update, reset or None) of a module whose update is in Python, or None.");
    m.def(
        "give_script",
        [](const AnyInstance &object, const Typed<py::object, "Any"> &update, const Typed<py::object, "Any"> &reset) {
            give_script(*instance_of(object), update.ptr(), reset.ptr());
        },
        "object"_a, "update"_a, "reset"_a, "Give a flight module other functions in Python; reset may be None.");
    m.def(
        "set_flies", set_flies, "on"_a,
        "Say whether this thread runs Python that flies on a target, too, whose arrays have Python's numbers. Returns "
        "what it was.");
    m.def(
        "context",
        [](const AnyInstance &object) -> ReferenceOrNone {
            instance_of(object);
            PyObject *context = as_root(object.ptr())->context;
            return context ? py::reinterpret_borrow<py::object>(context) : py::none();
        },
        "object"_a, "The weak reference given to set_context(), or None.");
    m.def(
        "set_context",
        [](const AnyInstance &object, Reference reference) {
            instance_of(object);
            // A plain reference would close a cycle, and these objects take no part in garbage collection.
            need(PyWeakref_Check(reference.ptr()), "a weak reference", reference);
            Py_XSETREF(as_root(object.ptr())->context, reference.release().ptr());
        },
        "object"_a, "reference"_a);
}

} // namespace

void bind_tables(py::module_ &m)
{
    bind_struct(m);
    bind_field(m);
    bind_libraries(m);
    bind_objects(m);
    bind_contents(m);
    bind_scripts(m);
}

} // namespace fledge::core
