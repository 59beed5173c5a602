// SPDX-License-Identifier: Apache-2.0
// A flight module whose update is the user's, in Python: `fsw.SunSlew(update=slew, reset=begin)`.
#pragma once

#include "core/object.h"

namespace fledge::core {

/// Take `update`, `reset` and `turns` out of the keywords of a new module or model, and give the functions to the
/// module. `turns`, a limit on targets, is only checked. Returns the other keywords, a new reference; null with an
/// exception set.
PyObject *take_script(Root &root, PyObject *keywords);

/// Give an instance the functions of a prototype's class, found by their names.
void give_class(sim::Instance &instance, PyObject *cls);

/// The class of a prototype, borrowed; null for other modules and models.
PyObject *class_of(const sim::Instance &instance);

/// Give a flight module other functions; reset may be None.
void give_script(sim::Instance &instance, PyObject *update, PyObject *reset);

/// Its functions (update, reset or None), or None: a new reference.
PyObject *script_of(const Root &root);

/// The module whose function of the user's runs in this thread, or null.
const sim::Instance *running();

/// Whether this thread runs Python that flies on a target, too: a function of a module, or a procedure.
bool flies();

/// Say so. Returns what it was.
bool set_flies(bool on);

/// m.publish(m.reference, quality="GOOD") and m.held(m.reference)
PyObject *publish(PyObject *self, PyObject *arguments, PyObject *keywords);
PyObject *held(PyObject *self, PyObject *port);

} // namespace fledge::core
