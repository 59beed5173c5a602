# SPDX-License-Identifier: Apache-2.0
"""Modules, models and messages: C structs as Python objects. The objects themselves are in `_core`.

    hooks.py     functions that `_core` calls: conversion to SI, enumerations, wires, texts
    lookup.py    the names in fledge.flight and fledge.world
    measured.py  a field as one number, for conditions and requirements
    script.py    modules whose update is in Python
    project.py   the libraries of a user's own project
    vector.py    arrays with norm()
    weak.py      references that do not keep an object alive

Example:

    from fledge import flight as fsw
    from fledge.units import N, m, s

    control = fsw.MrpFeedback(K=2.5 * N * m, P=45 * N * m * s)     # an MrpFeedback of C
    control.P[0, 0] = 50                                          # in SI
    control.error.sigma_BR = [0.1, 0, 0]
"""

from typing import Any

from fledge import _core

# The types of all modules, models and messages, and functions of one of them: the table of its struct;
# "flight.control"; "control"; the names of the parameters that the user gave; the bytes of its struct.
Module = _core.Module
Model = _core.Model
Message = _core.Message
Condition = _core.Condition
struct, path, name, given, memory = _core.struct, _core.path, _core.name, _core.given, _core.memory
load_library = _core.load_library  # of a .so with its name; returns name -> type

Object = Any  # a module, model or message
