// SPDX-License-Identifier: Apache-2.0
// The module `_core`: the libraries of flight modules and world models that it holds, and the simulation.
#include "core/extension.h"

#include "core/errors.h"
#include "sim/error.h"

#include <utility>

namespace py = pybind11;

PYBIND11_MODULE(_core, m)
{
    using namespace fledge::core;
    m.doc() = "Objects on C memory and the simulation's kernel. Use the package fledge instead.";
    if (!add_exceptions(m.ptr()) || !add_base_types(m.ptr())) {
        throw py::error_already_set();
    }
    py::register_exception_translator([](std::exception_ptr error) {
        if (!set_error(error)) {
            std::rethrow_exception(std::move(error)); // to pybind11's own
        }
    });
    bind_tables(m);
    bind_functions(m);
    bind_prototypes(m);
    bind_simulation(m);
    bind_judge(m);
    bind_sky(m);
    bind_world(m);
    bind_fmu(m);
    bind_campaign(m);
    bind_composition(m);
    bind_batch(m);
    bind_records(m);
}
