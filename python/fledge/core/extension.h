// SPDX-License-Identifier: Apache-2.0
// The pieces of the extension `_core`, and how pybind11's side gets at the objects of object.h.
#pragma once

#include "core/object.h"

#include <pybind11/pybind11.h>

namespace fledge::core {

void bind_tables(pybind11::module_ &m);     ///< libraries, types and fields, as Python sees them
void bind_simulation(pybind11::module_ &m); ///< the kernel
void bind_world(pybind11::module_ &m);      ///< what models take besides parameters
void bind_campaign(pybind11::module_ &m);   ///< dispersed runs
void bind_sky(pybind11::module_ &m);        ///< ephemerides, orientations, gravity fields
void bind_cosim(pybind11::module_ &m);      ///< a process as a node of many programs

/// The instance of a module or model. Throws TypeError for anything else.
std::shared_ptr<sim::Instance> instance_of(pybind11::handle object);

/// The object that wraps an instance, as a new reference.
pybind11::object object_of(std::shared_ptr<sim::Instance> instance);

} // namespace fledge::core
