# SPDX-License-Identifier: Apache-2.0
"""Missions, benches and the examples in the documents name an enumerator where a field is an enumeration."""
import ast
import re

import pytest

from fledge import _core, flight, world
from tests.tree import ROOT


def enumerations():
    """The names of the fields that are enumerations in every struct that has them."""
    kinds = {}
    for types in (flight.TYPES, world.TYPES):
        for field in (field for type_ in types.values() for field in _core.struct(type_).fields):
            kinds.setdefault(field.name, set()).add(field.type == "enum")
    return {name for name, kind in kinds.items() if kind == {True}}


NAMES = enumerations()


def name_of(node):
    """The field that an expression reads: quality of x.head.quality, of log["x.head.quality"], and of rows of it."""
    while isinstance(node, ast.Subscript) and not isinstance(getattr(node.slice, "value", None), str):
        node = node.value
    if isinstance(node, ast.Subscript):
        return node.slice.value.rpartition(".")[2]
    return node.attr if isinstance(node, ast.Attribute) else ""


def bare(text):
    """The lines that compare an enumeration with a number, or set it to one."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Compare):
            values = [node.left, *node.comparators]
            names = [name_of(value) for value in values]
        elif isinstance(node, ast.Assign):
            names, values = [name_of(target) for target in node.targets], [node.value]
        elif isinstance(node, ast.keyword):
            names, values, node = [node.arg], [node.value], node.value
        else:
            continue
        numbers = [value for value in values if isinstance(value, ast.Constant) and type(value.value) is int]
        if numbers and NAMES & set(names):
            yield node.lineno, ast.unparse(node)


def examples(page):
    """The blocks of Python in a page."""
    return re.findall(r"^```python[^\n]*\n(.*?)^```", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("folder", ["missions", "bench", "python/fledge/templates"])
def test_the_scripts_of_a_folder_name_enumerators(folder):
    scripts = sorted((ROOT / folder).rglob("*.py"))
    assert len(scripts) > 2
    assert {str(path.relative_to(ROOT)): lines for path in scripts
            if (lines := list(bare(path.read_text(encoding="utf-8"))))} == {}


def test_the_examples_of_the_documents_name_enumerators():
    blocks = [(page.name, block) for page in sorted((ROOT / "docs").glob("*.md")) for block in examples(page)]
    assert len(blocks) > 40
    assert [(name, lines) for name, block in blocks if (lines := list(bare(block)))] == []


@pytest.mark.parametrize("text", ["x.head.quality == 3", "log['a.head.quality'][-1] < 3", "x.head.quality = 2",
                                  "fsw.FieldOnBoard(model=2)", "0 != log['fix.state.finding']"])
def test_a_bare_number_is_found(text):
    assert len(list(bare(text))) == 1 and not list(bare(re.sub(r"\d", "fsw.Quality.GOOD", text)))
