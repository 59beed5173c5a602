# SPDX-License-Identifier: Apache-2.0
"""What the tables of a script refuse; that they say what the headers say, objects_test.py in targets/micropython
shows by the objects that are made of them."""

from types import SimpleNamespace

import pytest

from fledge.export import ExportError
from fledge.targets.micropython.export.tables import type_tables, visible


def struct(*shapes, names=None):
    fields = [SimpleNamespace(name=name, shape=shape, spare=False, type="f64", unit="m", dims=(1,) + 7 * (0,), count="",
                              offset=0, group="par", required=False, ctype="double")
              for name, shape in zip(names or [f"x{i}" for i in range(len(shapes))], shapes)]
    return SimpleNamespace(name="Large", fields=fields)


@pytest.mark.parametrize("old, message", [
    (struct((2, 2, 2, 2)), r"Large.x0 has shape \(2, 2, 2, 2\)"), (struct((), (65536,)), r"Large.x1 has shape"),
    (struct(*255 * [()]), "Large has 255 fields")])
def test_what_the_tables_have_no_room_for_is_refused(old, message):
    with pytest.raises(ExportError, match=message):
        visible(old)
    assert len(visible(struct(*254 * [(65535, 1, 1)]))) == 254


def test_a_name_that_several_types_have_is_there_once():
    lines = type_tables({"A": struct((), ()), "B": struct((3,), ())}, {}, set())
    assert sum(line.count('"x0\\0"') for line in lines) == 1
    assert [line for line in lines if line.endswith("/* x1 */")] == 2 * [
        "    {0u, 3u, 0u, {0u}, FLEDGE_F64, SCRIPT_PAR, 0u, 0u, 0u, SCRIPT_NO_FIELD}, /* x1 */"]


def test_names_beyond_their_room_are_refused():
    many = {f"T{i}": struct(*200 * [()], names=[f"a_rather_long_name_of_a_field_{i}_{k}" for k in range(200)])
            for i in range(12)}
    with pytest.raises(ExportError, match="the modules have 1 units and [0-9]+ bytes of names"):
        type_tables(many, {}, set())
