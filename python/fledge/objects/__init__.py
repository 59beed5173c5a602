# SPDX-License-Identifier: Apache-2.0
"""Modules, models and messages: C structs as Python objects. The objects themselves are in `_core`.

    hooks.py     functions that `_core` calls: conversion to SI, enumerations, wires, texts
    lookup.py    the names in fledge.flight and fledge.world
    measured.py  a field as one number, for conditions and requirements
    script.py    modules whose update is in Python
    project.py   the libraries of a user's own project
    vector.py    arrays with norm()
"""

from typing import Any

from fledge import _core

# The types of all modules, models and messages, and functions of one of them: the table of its struct;
# "flight.control"; "control"; the names of the parameters that the user gave; the bytes of its struct.
Module, Model, Message, Condition = _core.Module, _core.Model, _core.Message, _core.Condition
struct, path, name, given, memory = _core.struct, _core.path, _core.name, _core.given, _core.memory
load_library = _core.load_library  # of a .so with its name; returns name -> type

Object = Any  # a module, model or message
