// SPDX-License-Identifier: Apache-2.0
// World models that are FMUs: their types, made at run time, and what their fields are in the FMU.
#include "core/extension.h"
#include "core/prototype.h"

#include "fmi/importer/fmu_model.h"
#include "sim/error.h"

#include <pybind11/stl.h>

#include <cstring>
#include <deque>

namespace py = pybind11;
using namespace py::literals;

namespace fledge::core {

namespace {

using importer::FmuField;
using importer::FmuPlan;
using importer::FmuPort;

template <class T> T member(const py::handle &object, const char *name)
{
    return py::cast<T>(object.attr(name));
}

FmuField fmu_field_from(const py::handle &f)
{
    return {static_cast<importer::Kind>(member<int>(f, "kind")),
            member<std::vector<std::uint32_t>>(f, "references"),
            static_cast<FledgeType>(member<int>(f, "type")),
            member<std::uint32_t>(f, "offset"),
            member<std::uint32_t>(f, "n"),
            member<double>(f, "factor"),
            member<double>(f, "shift"),
            member<bool>(f, "discrete")};
}

std::vector<FmuPort> ports_from(const py::handle &ports)
{
    std::vector<FmuPort> all;
    for (const py::handle port : ports) {
        all.push_back({member<std::string>(port, "name"), member<std::uint32_t>(port, "offset"),
                       member<std::size_t>(port, "first"), member<std::size_t>(port, "n"),
                       member<bool>(port, "headed")});
    }
    return all;
}

/// From a Plan of fledge.fmi.interface.
void set_fmu(const AnyInstance &object, const Typed<py::object, "Any"> &given)
{
    auto *model = dynamic_cast<importer::FmuModel *>(instance_of(object)->model());
    if (!model) {
        throw py::type_error("expected the model of an FMU, found " + std::string(py::repr(object)));
    }
    const auto plan = std::make_shared<FmuPlan>();
    plan->file = {member<std::string>(given, "file"),
                  member<std::string>(given, "library"),
                  member<std::string>(given, "resources"),
                  member<std::string>(given, "token"),
                  member<int>(given, "version"),
                  member<bool>(given, "event_mode"),
                  member<bool>(given, "saves"),
                  member<bool>(given, "single"),
                  member<std::vector<std::uint32_t>>(given, "clocks")};
    for (const py::handle f : given.attr("fields")) {
        plan->fields.push_back(fmu_field_from(f));
    }
    plan->parameters = member<std::size_t>(given, "parameters");
    plan->tunable = member<std::size_t>(given, "tunable");
    plan->inputs = ports_from(given.attr("inputs"));
    plan->outputs = ports_from(given.attr("outputs"));
    plan->counters = member<std::vector<std::uint32_t>>(given, "counters");
    plan->assumptions = member<std::vector<std::string>>(given, "assumptions");
    PyObject *keeps = member<py::object>(given, "keeps").release().ptr();
    plan->keeps = std::shared_ptr<const void>(keeps, [](const void *kept) {
        if (Py_IsInitialized() == 0) {
            return; // a simulation that outlived the interpreter
        }
        const py::gil_scoped_acquire gil;
        Py_DECREF(const_cast<PyObject *>(static_cast<const PyObject *>(kept)));
    });
    plan->image = member<std::string>(given, "image");
    std::memcpy(instance_of(object)->memory(), plan->image.data(), plan->image.size());
    model->set_plan(plan);
}

/// The bytes of an input before anything is given for it.
py::bytes starts(const AnyPort &port)
{
    const FledgeField &field = *as_view(port.ptr())->member->field;
    const auto *model = dynamic_cast<importer::FmuModel *>(as_root(root_of(port.ptr()))->instance->model());
    return model && model->plan() ? model->plan()->image.substr(field.offset, field.size)
                                  : std::string(field.size, '\0');
}

Typed<py::object, "Any"> declare_fmu(const py::handle &s, const Typed<py::dict, "dict[str, Any]"> &structs)
{
    static std::deque<sim::ModelType> all; // as the types
    const py::none schema;
    const FledgeStruct &table = table_from(s, structs, schema);
    const auto create = [](void *interface) -> std::unique_ptr<sim::Model> {
        return std::make_unique<importer::FmuModel>(interface);
    };
    const Type *type = type_of(table, "world", &all.emplace_back(sim::ModelType{&table, create}));
    if (!type) {
        throw py::error_already_set();
    }
    return py::reinterpret_borrow<py::object>(reinterpret_cast<PyObject *>(type->python));
}

} // namespace

void bind_fmu(py::module_ &m)
{
    m.def("declare_fmu", declare_fmu, "struct"_a, "structs"_a, "The type of the models of an FMU.");
    m.def("starts", starts, "input"_a, "What it holds before a wire or feed: the starts of an FMU, else zeros.");
    m.def("set_fmu", set_fmu, "object"_a, "plan"_a, "What the fields of a model of an FMU are there.");
}

} // namespace fledge::core
