# SPDX-License-Identifier: Apache-2.0
"""What makes the models of a library: a row for each interface, whichever folder it is in."""
import re

from introspect.emit import EMITTERS
from introspect.model import Kind
from introspect.testing import read_this


def test_every_model_has_its_class_and_its_table():
    world = read_this().library("world")
    ((file, text),) = EMITTERS["models"](world).items()
    assert file == "world_models.cpp"
    interfaces = {s.name: s.header for s in world.structs if s.kind is Kind.MODEL}
    assert "Spacecraft" in interfaces
    assert re.findall(r"\{&fledge_struct_(\w+), make_model<(\w+), (\w+)>\},", text) == [
        (name, f"{name}Model", name) for name in interfaces]
    assert f"fledge::sim::model_version, {len(interfaces)}u, types," in text
    for header in interfaces.values():
        assert f'#include "{header.removesuffix(".h")}_model.h"' in text


def test_a_library_without_models_has_none():
    ((file, text),) = EMITTERS["models"](read_this().library("flight")).items()
    assert file == "flight_models.cpp" and "fledge_models" not in text
