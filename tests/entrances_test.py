# SPDX-License-Identifier: Apache-2.0
"""Each folder has a file that opens with an example of its use: C and C++ compile, Python runs, commands are parsed.

An example is the indented text behind a line `Example:` in the comment at the head of a header, or in the docstring at
the head of a module. In C and C++ it is the body of a function, unless a line of it is a single {. In Python, each line
that begins with `$ ./fledge` is a command.
"""

import ast
import re
import runpy
import shlex
import shutil
import subprocess
import textwrap
from collections import defaultdict
from pathlib import Path
from sysconfig import get_paths
from typing import NamedTuple

import pytest

from fledge.errors import Failure
from tests.needs import skip_without
from tests.tree import ROOT, files

SUFFIXES = {".h", ".c", ".cpp", ".py"}
PRODUCT = {"ccsds", "cosim", "emulator", "flight", "fmi", "ground", "introspect", "options", "python", "record",
           "registers", "sim", "studies", "targets", "world"}
# Folders that are no entrance, and why.
WITHOUT = {
    "emulator/tools": "is one program",
    "ground/database/xtce": "is behind ground/database/xtce.h",
    "ground/server/handlers": "is behind the server",
    "flight/math/tools": "finds the coefficients of flight/math by hand",
    "targets/bare/examples": "are examples",
    "targets/cfs/inc": "is the interface of NASA's cFE",
    "targets/micropython/interpreter": "is what the interpreter includes",
}
# Examples in Python of which only the imports run, and why.
NOT_RUN = {
    "cosim/bindings/python": "a node waits for a controller",
    "cosim/python": "so does this one",
    "emulator/python": "it builds flight for another processor",
    "studies/falsify": "it flies a thousand runs",
    "studies/flips": "so does this one",
}


class Example(NamedTuple):
    path: Path
    text: str


def head(path: Path) -> str:
    """The comment at the head of a file in C or C++, or the docstring of a module, without its marks."""
    text = (ROOT / path).read_text(encoding="utf-8")
    if path.suffix == ".py":
        return ast.get_docstring(ast.parse(text)) or ""
    lines = []
    for line in text.split("\n")[1:]:
        if not (mark := re.match(r"/\*\*? ?|//+ ?| \*/$| \* ?|$", line)):
            break
        lines.append(re.sub(r" *\*/$", "", line[mark.end():]))
    return "\n".join(lines)


def example_of(path: Path) -> str:
    """The example in a file; "": it has none."""
    lines = head(path).split("\n")
    if "Example:" not in lines:
        return ""
    block = []
    for line in lines[lines.index("Example:") + 1:]:
        if line and not line.startswith("    "):
            break
        block.append(line)
    return textwrap.dedent("\n".join(block)).strip("\n")


def folders() -> dict[str, list[Path]]:
    """Folder -> its files in C, C++ and Python; tests apart."""
    sources = defaultdict(list)
    for path in files():
        if path.suffix in SUFFIXES and path.parts[0] in PRODUCT and not path.stem.endswith("_test") \
                and not {"testing", "templates", "oracle"} & {*path.parts}:
            sources[path.parent.as_posix()].append(path)
    return sources


EXAMPLES = {folder: examples for folder, paths in folders().items()
            if (examples := [Example(path, text) for path in paths if (text := example_of(path))])}
OF = {kind: [example for examples in EXAMPLES.values() for example in examples if example.path.suffix in suffixes]
      for kind, suffixes in {"native": {".h", ".c", ".cpp"}, "python": {".py"}}.items()}


def path_of(example: Example) -> str:
    return str(example.path)


def is_c(example: Example) -> bool:
    return "#pragma once" not in (ROOT / example.path).read_text(encoding="utf-8")


def source(example: Example, name: str) -> str:
    """A source with the example, after its includes."""
    included = [line for line in example.text.split("\n") if line.startswith("#include")]
    lines = [line for line in example.text.split("\n") if line not in included]
    body = "\n".join(lines)
    if "{" not in lines:
        body = f"void {name}(void);\nvoid {name}(void)\n{{\n{textwrap.indent(body, '    ')}\n}}"
    if not is_c(example):
        body = f"namespace {name}_ {{\nusing namespace fledge;\n{body}\n}}"
    return "\n".join([f'#include "{example.path}"', *included, body, ""])


def compiled(compiler: list[str], text: str) -> str:
    """The compiler's messages about a source; "": none."""
    folders = [ROOT, ROOT / "python/fledge", ROOT / "targets/cfs/inc"]
    libraries = ["/usr/include/eigen3", get_paths()["include"]]
    warnings = "-Wall -Wextra -Werror -Wno-unused -Wno-missing-field-initializers -Wno-psabi".split()
    done = subprocess.run([*compiler, "-fsyntax-only", *warnings, *(f"-I{folder}" for folder in folders),
                           *(f"-isystem{folder}" for folder in libraries), "-"], input=text, capture_output=True,
                          text=True)
    return done.stderr if done.returncode else ""


def test_every_folder_has_an_example():
    there = set(folders()) - set(WITHOUT)
    assert sorted(there - set(EXAMPLES)) == []
    assert sorted(set(WITHOUT) - set(folders())) == []


def test_examples_are_short():
    assert [f"{example.path}: {n} lines" for examples in EXAMPLES.values() for example in examples
            if (n := example.text.count("\n") + 1) > 20] == []


@pytest.mark.parametrize("example", [example for example in OF["native"] if is_c(example)], ids=path_of)
def test_an_example_in_c_compiles(example):
    errors = compiled(["gcc", "-std=c99", "-pedantic", "-x", "c"], source(example, "example"))
    assert not errors, errors


def test_the_examples_in_cpp_compile():
    """Together, as their headers share most of what they include; messages name the file of each."""
    in_cpp = [example for example in OF["native"] if not is_c(example)]
    errors = compiled(["g++", "-std=c++20", "-x", "c++"], "".join(
        f'#line 1 "example of {example.path}"\n{source(example, f"example_{i}")}' for i, example in enumerate(in_cpp)))
    assert not errors, errors


@pytest.fixture(scope="module")
def record(tmp_path_factory):
    """The run.mcap of the examples."""
    import fledge

    path = tmp_path_factory.mktemp("record") / "run.mcap"
    sim = fledge.load("nadir_spin")
    sim.record(sim.flight.tracking, sim.world.craft)
    sim.archive(path)
    sim.run(60)
    sim.close_archive()
    return path


@pytest.mark.parametrize("example", [example for example in OF["python"] if "$ ./fledge" not in example.text],
                         ids=path_of)
def test_an_example_in_python_runs(example, record, tmp_path, monkeypatch):
    text = example.text
    if example.path.parent.as_posix() in NOT_RUN:
        text = ast.unparse([node for node in ast.parse(text).body if isinstance(node, (ast.Import, ast.ImportFrom))])
        monkeypatch.syspath_prepend(ROOT / example.path.parent)
    monkeypatch.chdir(tmp_path)
    shutil.copy(record, "run.mcap")
    Path("example.py").write_text(text)
    try:
        runpy.run_path("example.py")
    except Failure as error:
        if named := re.search(r"apt-get install (.*)", str(error)):
            skip_without(*named[1].split())
        raise


@pytest.mark.parametrize("example", [example for example in OF["python"] if "$ ./fledge" in example.text], ids=path_of)
def test_an_example_of_a_command_is_parsed(example):
    from fledge.cli import parsed
    from fledge.mission import missions
    from fledge.targets import TARGETS

    for line in example.text.split("\n"):
        options = parsed(shlex.split(line.removeprefix("$ ./fledge")))
        assert getattr(options, "mission", "nadir_spin") in missions()
        assert {*(getattr(options, "on", None) or "desktop").split(",")} <= {*TARGETS}
