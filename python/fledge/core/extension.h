// SPDX-License-Identifier: Apache-2.0
// The pieces of the extension `_core`, and how pybind11's side gets at the objects of object.h.
#pragma once

#include "core/object.h"
#include "core/typed.h"
#include "sim/crash.h"
#include "sim/health.h"

#include <optional>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <tuple>

namespace fledge::core {

using AnyInstance = Typed<pybind11::object, "Module | Model">;
using AnyPort = Typed<pybind11::object, "Message">; ///< an input or output
using AnyObject = Typed<pybind11::object, "Module | Model | Message">;

/// (kind, path, first [s] or None, count, text) of a finding.
using HealthRow = std::tuple<const char *, std::string, std::optional<double>, std::uint64_t, std::string>;
std::vector<HealthRow> health_rows(const std::vector<sim::Finding> &findings);

void bind_tables(pybind11::module_ &m);      ///< libraries, types and fields, as Python sees them
void bind_functions(pybind11::module_ &m);   ///< those of flight/math
void bind_prototypes(pybind11::module_ &m);  ///< modules and models that are classes in Python
void bind_simulation(pybind11::module_ &m);  ///< the kernel
void bind_judge(pybind11::module_ &m);       ///< formulas on signals
void bind_world(pybind11::module_ &m);       ///< what models take besides parameters
void bind_fmu(pybind11::module_ &m);         ///< models that are FMUs
void bind_campaign(pybind11::module_ &m);    ///< dispersed runs
void bind_composition(pybind11::module_ &m); ///< a simulation as JSON
void bind_batch(pybind11::module_ &m);       ///< clones that are stepped together
void bind_sky(pybind11::module_ &m);         ///< ephemerides, orientations, gravity fields
void bind_records(pybind11::module_ &m);     ///< the container of records
void bind_cosim(pybind11::module_ &m);       ///< a process as a node of many programs

/// Of each extension with a kernel of its own, whose handlers know what that runs.
inline void bind_crashes(pybind11::module_ &m)
{
    m.def("report_crashes", &sim::report_crashes, pybind11::arg("command"), pybind11::arg("run"),
          "What a crash in a run tells: the command that shows it, and the one of a run, whose index follows.");
    m.def("limit_updates", &sim::limit_updates, pybind11::arg("limit"), "[ns] of wall time; 0: none");
}

/// Lets a loop that runs without Python's lock handle signals and call Python now and then. After a Python exception
/// the loop must end; the thread that has the lock throws the exception again.
class Poll {
public:
    /// Handle signals, then call f. False if the loop must end: f returned false, or raised an exception.
    template <class F> bool operator()(F &&f)
    {
        pybind11::gil_scoped_acquire gil;
        try {
            if (!error_ && PyErr_CheckSignals() != 0) {
                throw pybind11::error_already_set();
            }
            return !error_ && f();
        } catch (pybind11::error_already_set &) {
            error_ = std::current_exception();
            return false;
        }
    }

    void rethrow() const
    {
        if (error_) {
            std::rethrow_exception(error_);
        }
    }

private:
    std::exception_ptr error_;
};

inline std::vector<std::uint8_t> octets(const pybind11::bytes &bytes)
{
    const std::string_view view = bytes;
    return {view.begin(), view.end()};
}

/// The enumerator at the place of its name. `names` ends with a null pointer.
template <class T> T named(const char *const *names, const std::string &name)
{
    int i = 0;
    while (names[i] != name) {
        if (!names[++i]) {
            throw pybind11::value_error("unknown name " + name);
        }
    }
    return static_cast<T>(i);
}

/// Python's names of ExecRelation, and of Judge::Relation.
inline constexpr const char *relations[] = {"<", "<=", ">", ">=", "==", "!=", nullptr};

/// The instance of a module or model. Throws TypeError for anything else.
std::shared_ptr<sim::Instance> instance_of(pybind11::handle object);

/// The object that wraps an instance, as a new reference.
pybind11::object object_of(std::shared_ptr<sim::Instance> instance);

} // namespace fledge::core
