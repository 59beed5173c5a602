// SPDX-License-Identifier: Apache-2.0
#include "core/script.h"

#include "core/errors.h"
#include "core/extension.h"
#include "core/value.h"
#include "sim/health.h"
#include "sim/text.h"

#include <pybind11/stl.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <span>
#include <utility>

namespace py = pybind11;

namespace fledge::core {

namespace {

thread_local const sim::Instance *now_running;
thread_local bool now_flies;

using Shared = std::shared_ptr<PyObject>;

Shared shared(PyObject *object)
{
    return {Py_XNewRef(object), [](PyObject *p) {
                const py::gil_scoped_acquire gil; // a simulation may end without it
                Py_XDECREF(p);
            }};
}

/// Calls a Python function with the module, at the cost of Python's lock. Copies share the function.
class Call {
public:
    /// cls: the class of a prototype whose method it is, or null.
    explicit Call(PyObject *function, PyObject *cls = nullptr) : function_(shared(function)), class_(shared(cls)) {}

    PyObject *function() const { return function_.get(); }
    PyObject *cls() const { return class_.get(); }

    void operator()(sim::Instance &instance, Tick tick)
    {
        const py::gil_scoped_acquire gil;
        const auto t = py::float_(tick_seconds(tick.t)), dt = py::float_(tick_seconds(tick.dt));
        const py::object m = object_of(instance.shared_from_this());
        // State outside of the memory shows where an update changes it. To look costs more than the update, so
        // that it happens at the updates 1, 2, 4, 8, ...
        const bool looks = cls() && std::has_single_bit(++updates_);
        const py::object before = looks ? call_hook("outside_state", cls()) : py::none();
        run(m, &tick, {m.ptr(), t.ptr(), dt.ptr()});
        if (looks) {
            const py::object changed =
                call_hook("changed_outside", cls(), before, py::str(instance.path), py::str(at(tick)));
            if (!changed.is_none()) {
                throw sim::RunError(py::str(changed));
            }
        }
    }
    /// The reset of a world model: it may publish, for this time.
    void begin(sim::Instance &instance, Tick tick) const
    {
        const py::gil_scoped_acquire gil;
        const auto t = py::float_(tick_seconds(tick.t));
        const py::object m = object_of(instance.shared_from_this());
        run(m, &tick, {m.ptr(), t.ptr()}, "at its reset");
    }
    /// What a model of air says of a place: see prototype.Model.
    void air_at(sim::Instance &instance, double t, std::span<const double, 3> place, std::span<double> answer) const
    {
        const py::gil_scoped_acquire gil;
        const py::object m = object_of(instance.shared_from_this());
        const py::float_ time(t);
        const py::tuple r_BN_N = py::make_tuple(place[0], place[1], place[2]);
        const std::string when = "at " + sim::format_time(std::llround(1e9 * t));
        const py::object answered = run(m, nullptr, {m.ptr(), time.ptr(), r_BN_N.ptr()}, when.c_str());
        PyObject *numbers = hook("air_numbers");
        if (!numbers) {
            throw py::error_already_set();
        }
        const auto found =
            py::reinterpret_borrow<py::object>(numbers)(py::str(instance.path + ".air_at()"), py::str(when), answered)
                .cast<std::array<double, 6>>();
        std::copy(found.begin(), found.end(), answer.begin());
    }
    void operator()(sim::Instance &instance) const { outside_update(instance, "at its reset"); }
    void outside_update(sim::Instance &instance, const char *when) const
    {
        const py::gil_scoped_acquire gil;
        const py::object m = object_of(instance.shared_from_this());
        run(m, nullptr, {m.ptr()}, when);
    }

private:
    static std::string at(Tick tick) { return "at " + sim::format_time(tick.t); }

    /// when: for the text of an error; null: at the time of the tick.
    py::object run(py::handle m, const Tick *tick, std::initializer_list<PyObject *> arguments,
                   const char *when = nullptr) const
    {
        Root &root = *as_root(m.ptr());
        const sim::Instance *const outer = std::exchange(now_running, root.instance.get());
        const bool outer_flies = set_flies(!cls());
        root.runs = true;
        root.tick = tick;
        PyObject *done = PyObject_Vectorcall(function_.get(), arguments.begin(), arguments.size(), nullptr);
        root.runs = false;
        root.tick = nullptr;
        set_flies(outer_flies);
        now_running = outer;
        if (done) {
            return py::reinterpret_steal<py::object>(done);
        }
        const bool interrupted = !PyErr_ExceptionMatches(PyExc_Exception);
        py::error_already_set error;
        PyObject *explain = interrupted ? nullptr : hook("script_failed");
        if (!explain) {
            throw error;
        }
        const py::str text = py::reinterpret_borrow<py::object>(explain)(root.instance->path, when ? when : at(*tick),
                                                                         error.value(), error.trace());
        py::raise_from(error, run_error(), std::string(text).c_str());
        throw py::error_already_set();
    }

    template <class... Arguments> static py::object call_hook(const char *name, const Arguments &...arguments)
    {
        PyObject *function = hook(name);
        if (!function) {
            throw py::error_already_set();
        }
        return py::reinterpret_borrow<py::object>(function)(py::handle(arguments)...);
    }

    Shared function_, class_;
    std::uint64_t updates_ = 0;
};

/// The output of a module that a view is; null with an exception set.
Head *output_of(PyObject *self, PyObject *port, const char *what)
{
    const Root &root = *as_root(self);
    if (!root.tick) {
        PyErr_Format(setup_error(), "%s.%s() is for its own update in Python, while it runs", path_of(self).c_str(),
                     what);
        return nullptr;
    }
    if (!is_view(port) || as_view(port)->owner != self || as_view(port)->member->field->group != FLEDGE_OUT) {
        PyErr_Format(setup_error(), "%s.%s: expected an output of the module; found %s. It has %s",
                     path_of(self).c_str(), what, is_view(port) ? path_of(port).c_str() : Py_TYPE(port)->tp_name,
                     sim::format_list(sim::field_names(*root.type->table, FLEDGE_OUT)).c_str());
        return nullptr;
    }
    return reinterpret_cast<Head *>(as_view(port)->memory);
}

} // namespace

const sim::Instance *running()
{
    return now_running;
}

bool flies()
{
    return now_flies;
}

bool set_flies(bool on)
{
    return std::exchange(now_flies, on);
}

PyObject *take_script(Root &root, PyObject *keywords)
{
    PyObject *rest = keywords ? PyDict_Copy(keywords) : PyDict_New();
    PyObject *given[3] = {};
    const char *const names[] = {"update", "reset", "turns"};
    bool any = false;
    for (int i = 0; rest && i < 3; i++) {
        if ((given[i] = Py_XNewRef(PyDict_GetItemString(rest, names[i])))) {
            any = true;
            PyDict_DelItemString(rest, names[i]);
        }
    }
    if (any && root.instance->model()) {
        PyErr_Format(PyExc_TypeError, "%s is a model of the world: update= and reset= are for flight modules",
                     root.type->table->name);
        Py_CLEAR(rest);
    } else if (any) {
        const auto or_none = [](PyObject *p) { return p ? p : Py_None; };
        PyObject *check = hook("check_script");
        PyObject *done = check ? PyObject_CallFunction(check, "sOOO", root.type->table->name, or_none(given[0]),
                                                       or_none(given[1]), or_none(given[2]))
                               : nullptr;
        if (!done) {
            Py_CLEAR(rest);
        } else {
            if (or_none(given[0]) != Py_None) {
                root.instance->script.update = Call(given[0]);
            }
            if (or_none(given[1]) != Py_None) {
                root.instance->script.reset = Call(given[1]);
            }
            Py_DECREF(done);
        }
    }
    for (PyObject *object : given) {
        Py_XDECREF(object);
    }
    return rest;
}

void give_class(sim::Instance &instance, PyObject *cls)
{
    const auto method = [&](const char *name) {
        PyObject *found = PyObject_GetAttrString(cls, name);
        if (!found) {
            PyErr_Clear(); // it may be left out
        }
        return py::reinterpret_steal<py::object>(found);
    };
    const py::object update = method("update"), reset = method("reset"), prepare = method("prepare");
    instance.script.update = Call(update.ptr(), cls);
    instance.script.shares = false; // prototypes that would are refused
    if (reset && instance.model()) {
        instance.script.begin = [call = Call(reset.ptr(), cls)](sim::Instance &self, Tick t) { call.begin(self, t); };
    } else if (reset) {
        instance.script.reset = Call(reset.ptr(), cls);
    }
    if (const py::object air = method("air_at"); air && instance.model()) {
        instance.script.at_place = [call = Call(air.ptr(), cls)](sim::Instance &self, double t, auto place,
                                                                 std::span<double> answer) {
            call.air_at(self, t, place, answer);
        };
    }
    if (prepare && instance.model()) {
        instance.script.prepare = [call = Call(prepare.ptr(), cls)](sim::Instance &self) {
            try {
                call.outside_update(self, "before the run");
            } catch (py::error_already_set &error) {
                const py::gil_scoped_acquire gil;
                if (!error.matches(run_error())) {
                    throw;
                }
                throw sim::SetupError(py::str(error.value()));
            }
        };
    }
}

PyObject *class_of(const sim::Instance &instance)
{
    const Call *update = instance.script.update ? instance.script.update.target<Call>() : nullptr;
    return update ? update->cls() : nullptr;
}

void give_script(sim::Instance &instance, PyObject *update, PyObject *reset)
{
    instance.script.update = Call(update);
    instance.script.reset = reset == Py_None ? decltype(instance.script.reset)() : Call(reset);
}

PyObject *script_of(const Root &root)
{
    const sim::Script &script = root.instance->script;
    if (!script.update) {
        Py_RETURN_NONE;
    }
    const Call *reset = script.reset ? script.reset.target<Call>() : nullptr;
    return PyTuple_Pack(2, script.update.target<Call>()->function(), reset ? reset->function() : Py_None);
}

PyObject *publish(PyObject *self, PyObject *arguments, PyObject *keywords)
{
    static const char *names[] = {"", "quality", nullptr};
    PyObject *port, *quality = nullptr;
    if (!PyArg_ParseTupleAndKeywords(arguments, keywords, "O|O:publish", const_cast<char **>(names), &port, &quality)) {
        return nullptr;
    }
    Head *head = output_of(self, port, "publish");
    if (!head) {
        return nullptr;
    }
    *head = head_next(*head, as_root(self)->tick->t, QUALITY_GOOD);
    if (quality) {
        PyObject *view = PyObject_GetAttrString(port, "head");
        const int failed = view ? PyObject_SetAttrString(view, "quality", quality) : -1;
        Py_XDECREF(view);
        if (failed) {
            return nullptr;
        }
    }
    const std::string what =
        head->quality == QUALITY_GOOD ? sim::not_finite(*as_view(port)->type->table, as_view(port)->memory) : "";
    if (!what.empty()) {
        PyErr_Format(PyExc_ValueError, "%s says GOOD, but its %s", path_of(port).c_str(), what.c_str());
        return nullptr;
    }
    Py_RETURN_NONE;
}

PyObject *held(PyObject *self, PyObject *port)
{
    Head *head = output_of(self, port, "held");
    if (!head) {
        return nullptr;
    }
    *head = head_held(*head);
    Py_RETURN_NONE;
}

} // namespace fledge::core
