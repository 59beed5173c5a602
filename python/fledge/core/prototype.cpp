// SPDX-License-Identifier: Apache-2.0
#include "core/prototype.h"

#include "core/extension.h"
#include "core/script.h"
#include "sim/error.h"
#include "sim/scripted_model.h"

#include <pybind11/stl.h>

#include <algorithm>

namespace py = pybind11;
using namespace py::literals;

namespace fledge::core {

namespace {

/// A table, and all that it points to.
struct Declared {
    FledgeStruct table{};
    std::vector<FledgeField> fields;
    std::deque<std::string> texts;
    std::deque<std::vector<FledgeEnumerator>> enumerators;
    std::deque<FledgeEnum> enums;

    const char *keep(const py::handle &text) { return texts.emplace_back(py::cast<std::string>(text)).c_str(); }

    const FledgeEnum *keep_enum(const py::handle &e)
    {
        std::vector<FledgeEnumerator> &values = enumerators.emplace_back();
        for (const py::handle value : e.attr("values")) {
            values.push_back(
                {keep(value.attr("name")), py::cast<std::int64_t>(value.attr("value")), keep(value.attr("doc"))});
        }
        enums.push_back(
            {keep(e.attr("name")), keep(e.attr("doc")), static_cast<std::uint32_t>(values.size()), values.data()});
        return &enums.back();
    }
};

/// The flag of each clause in a comment.
const std::pair<const char *, std::uint32_t> clauses[] = {{"required", FLEDGE_REQUIRED}, {"optional", FLEDGE_OPTIONAL},
                                                          {"assumed", FLEDGE_ASSUMED},   {"initial", FLEDGE_INITIAL},
                                                          {"non-zero", FLEDGE_NON_ZERO}, {"inertia", FLEDGE_INERTIA}};

/// A field of introspect's model. structs: name -> type of what fields are.
FledgeField field_from(Declared &kept, const py::handle &f, const py::dict &structs)
{
    FledgeField field{};
    field.name = kept.keep(f.attr("name"));
    field.offset = py::cast<std::uint32_t>(f.attr("offset"));
    field.size = py::cast<std::uint32_t>(f.attr("size"));
    // Type and Group have their members in the order of sim/table.h.
    const auto place = [&](const char *of) {
        const py::object member = f.attr(of);
        return py::cast<int>(py::list(py::type::of(member)).attr("index")(member));
    };
    field.type = static_cast<FledgeType>(place("type"));
    field.group = static_cast<FledgeGroup>(place("group"));
    for (const auto &[word, flag] : clauses) {
        if (f.attr("clauses").contains(word)) {
            field.flags |= flag;
        }
    }
    if (py::cast<bool>(f.attr("is_spare"))) {
        field.flags |= FLEDGE_SPARE;
    }
    if (const py::object bounds = f.attr("bounds"); !bounds.is_none()) {
        const auto end = [&](const char *name, std::uint32_t has, const char *open, std::uint32_t is_open) {
            const py::object x = bounds.attr(name);
            field.bounds |= (x.is_none() ? 0u : has) | (py::cast<bool>(bounds.attr(open)) ? is_open : 0u);
            return x.is_none() ? 0.0 : py::cast<double>(x);
        };
        field.lo = end("lo", FLEDGE_HAS_LO, "lo_open", FLEDGE_LO_OPEN);
        field.hi = end("hi", FLEDGE_HAS_HI, "hi_open", FLEDGE_HI_OPEN);
    }
    for (const py::handle n : f.attr("shape")) {
        field.shape[field.ndim++] = py::cast<std::uint32_t>(n);
    }
    const auto or_null = [&](const char *name) {
        const py::object text = f.attr(name);
        return text.is_none() ? nullptr : kept.keep(text);
    };
    field.count = or_null("count");
    field.distinct = or_null("distinct");
    if (const py::object sub = f.attr("struct"); !sub.is_none()) {
        const py::object type = structs[sub.attr("name")];
        field.sub = find_type(reinterpret_cast<PyTypeObject *>(type.ptr()))->table;
    }
    if (const py::object e = f.attr("enum"); !e.is_none()) {
        field.values = kept.keep_enum(e);
    }
    const py::object unit = f.attr("unit");
    field.unit = unit.is_none() ? "" : kept.keep(unit.attr("text"));
    for (std::size_t i = 0; i < std::size(field.dims) && !unit.is_none(); i++) {
        field.dims[i] = py::cast<std::int8_t>(py::tuple(unit.attr("dims"))[i]);
    }
    field.ctype = kept.keep(f.attr("ctype"));
    field.doc = kept.keep(f.attr("doc"));
    return field;
}

using StructTypes = Typed<py::dict, "dict[str, Any]">;

/// The type of an introspect Struct. structs: name -> type of what its fields are; schema: of a message, else None.
Typed<py::object, "Any"> declare(const py::handle &s, const StructTypes &structs,
                                 const Typed<py::object, "str | None"> &schema)
{
    const FledgeStruct &table = table_from(s, structs, schema);
    // A message is that of a header with the same content, so that C and Python exchange it.
    const Type *type = schema.is_none() ? make_prototype_type(table) : type_of(table, "prototype");
    if (!type) {
        throw py::error_already_set();
    }
    return py::reinterpret_borrow<py::object>(reinterpret_cast<PyObject *>(type->python));
}

Typed<py::object, "Any"> make(const py::handle &python, const py::handle &cls,
                              const Typed<py::dict, "dict[str, Any]"> &keywords)
{
    const Type &type = *find_type(reinterpret_cast<PyTypeObject *>(python.ptr()));
    auto instance = std::make_shared<sim::Instance>(*type.table);
    give_class(*instance, cls.ptr());
    PyObject *object = new_object(type, std::move(instance), keywords.ptr());
    if (!object) {
        throw py::error_already_set();
    }
    return py::reinterpret_steal<py::object>(object);
}

double draw(py::handle object, bool normal)
{
    auto *model = dynamic_cast<sim::ScriptedModel *>(instance_of(object)->model());
    if (!model || !as_root(object.ptr())->runs) {
        throw sim::SetupError(path_of(object.ptr()) +
                              ": random numbers are for its own update and reset, while they run");
    }
    return normal ? model->random.normal() : model->random.uniform();
}

} // namespace

const FledgeStruct &table_from(const py::handle &s, const py::dict &structs, const py::handle &schema)
{
    static std::deque<Declared> all; // types live until the interpreter ends
    Declared &kept = all.emplace_back();
    for (const py::handle f : s.attr("fields")) {
        kept.fields.push_back(field_from(kept, f, structs));
    }
    FledgeStruct &table = kept.table;
    table.name = kept.keep(s.attr("name"));
    table.doc = kept.keep(s.attr("doc"));
    table.header = kept.keep(s.attr("header"));
    table.folder = kept.keep(s.attr("folder"));
    const auto kind = py::cast<std::string>(s.attr("kind").attr("value"));
    table.kind = kind == "model" ? FLEDGE_MODEL : kind == "module" ? FLEDGE_MODULE : FLEDGE_MESSAGE;
    table.size = py::cast<std::uint32_t>(s.attr("size"));
    table.align = py::cast<std::uint32_t>(s.attr("align"));
    table.hash = py::cast<std::uint64_t>(s.attr("hash"));
    table.n = static_cast<std::uint32_t>(kept.fields.size());
    table.fields = kept.fields.data();
    table.schema = schema.is_none() ? nullptr : kept.keep(schema);
    return table;
}

bool is_class_name(PyObject *name)
{
    static PyObject *const itself = PyUnicode_InternFromString("__class__");
    return name == itself;
}

PyObject *class_of_object(PyObject *self)
{
    PyObject *cls = class_of(*as_root(self)->instance);
    return Py_NewRef(cls ? cls : reinterpret_cast<PyObject *>(Py_TYPE(self)));
}

PyObject *attribute_of_class(PyObject *self, PyObject *name)
{
    PyObject *cls = class_of(*as_root(self)->instance);
    PyObject *found = cls ? _PyType_Lookup(reinterpret_cast<PyTypeObject *>(cls), name) : nullptr;
    const descrgetfunc bind = found ? Py_TYPE(found)->tp_descr_get : nullptr;
    return bind ? bind(found, self, cls) : Py_XNewRef(found);
}

void bind_prototypes(py::module_ &m)
{
    m.def("declare", declare, "struct"_a, "structs"_a, "schema"_a);
    m.def("make_prototype", make, "python"_a, "cls"_a, "keywords"_a);
    m.def(
        "class_of", [](const AnyInstance &object) -> Typed<py::object, "type | None"> {
            PyObject *cls = class_of(*instance_of(object));
            return cls ? py::reinterpret_borrow<py::object>(cls) : py::none();
        },
        "object"_a, "The class of a prototype; None for other modules and models.");
    m.def("draw", draw, "object"_a, "normal"_a, "The next normal, or uniform, number of a prototype of the world.");
}

} // namespace fledge::core
