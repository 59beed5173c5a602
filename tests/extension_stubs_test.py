# SPDX-License-Identifier: Apache-2.0
"""Stubs of extensions: they have the signatures of pybind11's docstrings, and no type in them is empty."""

import ast
import importlib
import os
import re
import sys
from types import ModuleType

import pytest

from tests.tree import ROOT

sys.path.insert(0, str(ROOT / "cmake"))
import extension_stubs                                  # noqa: E402

EXTENSIONS = ["_core", "_cosim", "_emulator", "_ground"]


def stub_of(signature, **members):
    """The stub of a module with the function f and the class Wheel."""
    def f():
        pass
    f.__doc__ = signature
    module = ModuleType("_made")
    module.Wheel = type("Wheel", (), {"__doc__": "", **members})
    module.f = f
    return extension_stubs.Stub(module)


@pytest.mark.parametrize("signature, line", [
    ("f(a: int, b: float = 2.5) -> str", "def f(a: int, b: float = ...) -> str: ..."),
    ("f(a: List[_made.Wheel]) -> List[_made.Wheel]", "def f(a: Sequence[Wheel]) -> list[Wheel]: ..."),
    ("f(a: Optional[_core.Struct] = None) -> Optional[Tuple[int, str]]",
     "def f(a: _core.Struct | None = ...) -> tuple[int, str] | None: ..."),
    ("f(*, a: Callable[[List[int]], None]) -> None", "def f(*, a: Callable[[list[int]], object] | None) -> None: ..."),
    ("f(a: handle, b: List[float[3]], c: Dict[str, int]) -> Dict[str, int]",
     "def f(a: object, b: Sequence[float], c: Mapping[str, int]) -> dict[str, int]: ..."),
    ("f(a: Union[int, str]) -> numpy.ndarray[numpy.float64]", "def f(a: int | str) -> NDArray[numpy.float64]: ..."),
    ("f(a: Module | None) -> list[tuple[Any, ...]]", "def f(a: Module | None) -> list[tuple[Any, ...]]: ..."),
    ("f(*args, **kwargs)\nOverloaded function.\n\n1. f() -> int\n\n2. f(a: int) -> str\n\nA text.\n",
     "@overload\ndef f() -> int: ...\n@overload\ndef f(a: int) -> str:\n    \"\"\"A text.\"\"\""),
])
def test_signatures_of_pybind11_become_types(signature, line):
    stub = stub_of(signature)
    assert line in stub.text and not stub.problems
    compile(stub.text, "stub", "exec")
    for word in ("Any", "Callable", "Sequence", "overload", "NDArray", "Module"):
        assert (word in line) == bool(re.search(rf"import .*\b{word}\b", stub.text))


@pytest.mark.parametrize("signature, problem", [
    ("f(a: int) -> list", "f: list says too little; give it a type, as core/typed.h does"),
    ("f(a: dict) -> int", "f(a): dict says too little; give it a type, as core/typed.h does"),
    ("f() -> object", "f: object says too little; give it a type, as core/typed.h does"),
    ("f(arg0: int) -> int", "f: an argument has no name"),
    ("f(a: fledge::sim::Wheel) -> int", "f: f(a: fledge::sim::Wheel) -> int: a type is bound later, or not at all"),
    ("f(a: Wheels) -> int", "f(a): Wheels is no type that a stub knows"),
])
def test_a_type_that_says_nothing_is_named(signature, problem):
    assert problem in stub_of(signature).problems


def test_words_of_later_versions_of_pybind11_become_types():
    stub = stub_of("f(a: Annotated[list[float], FixedSize(3)], b: Buffer, c: dict[str, int]) -> list[float]",
                   _pybind11_conduit_v1_=test_a_type_that_says_nothing_is_named)
    assert "def f(a: Sequence[float], b: Any, c: Mapping[str, int]) -> list[float]: ..." in stub.text
    assert not stub.problems and "conduit" not in stub.text


def test_a_type_that_says_nothing_ends_no_build(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "_made", stub_of("f(a: Wheels) -> list").module)
    extension_stubs.main("_made", tmp_path / "_made.pyi")
    assert "def f(a: Any) -> list: ..." in (tmp_path / "_made.pyi").read_text()
    assert "warning: _made.f(a): Wheels is no type that a stub knows\n" in capsys.readouterr().out


@pytest.mark.parametrize("name", EXTENSIONS)
def test_the_types_of_an_extension_say_something(name):
    assert not extension_stubs.Stub(importlib.import_module(name)).problems


@pytest.mark.parametrize("name", EXTENSIONS)
def test_the_stub_of_the_build_has_all_of_the_extension(name):
    stub = ROOT / "build" / os.environ.get("FLEDGE_PRESET", "release") / "introspect/stubs" / f"{name}.pyi"
    extension = importlib.import_module(name)
    members = {node.name: node for node in ast.parse(stub.read_text(encoding="utf-8")).body if hasattr(node, "name")}
    assert members.keys() == {var for var in vars(extension) if not var.startswith("__")}
    for node in members.values():
        if isinstance(node, ast.ClassDef):
            own = {var for var in vars(getattr(extension, node.name)) if not var.startswith("_")}
            assert own <= {getattr(member, "name", None) or getattr(member, "target", ast.Name("")).id
                           for member in node.body}


def test_objects_of_the_c_api_take_what_their_text_signatures_say():
    text = extension_stubs.Stub(importlib.import_module("_core")).text
    assert "    def update(self, t: float = ..., dt: float = ..., *, t_ns: int | None = ..., dt_ns: int | None = ...)" \
           " -> None:\n        \"\"\"Run the algorithm once" in text
    assert "    def publish(self, output: Message, /, quality: Any = ...) -> None:\n" in text
