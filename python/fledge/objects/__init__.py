# SPDX-License-Identifier: Apache-2.0
"""Modules, models and messages: C structs as Python objects. The objects themselves are in `_core`.

    hooks.py    what `_core` calls: conversion to SI, enumerations, wires, texts for people
    lookup.py   the names in fledge.flight and fledge.world
    project.py  the libraries of a user's own project
    vector.py   the arrays that fields of objects are read as
"""
