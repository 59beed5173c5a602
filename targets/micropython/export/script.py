# SPDX-License-Identifier: Apache-2.0
"""The Python of a mission that flies under MicroPython: flight.py or mission.py, and what these import of the mission,
of the missions beside it and of the project. What the target does not have is refused with file and line, as far as
the source shows it."""
from __future__ import annotations

import ast
import importlib.util
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fledge.errors import listed
from fledge.export.read import ExportError
from fledge.objects import project
from fledge.objects.computed import Computed

# What the interpreter has, and of Fledge.
MODULES = {"array", "fledge", "math"}
FLEDGE = {"fledge.flight", "fledge.units", "fledge.world"}
NAMES = {"Orbit", "Quantity", "SetupError", "flight", "units", "world"}     # of `fledge` itself
INSTEAD = {
    "numpy": "lists with units are arrays there, and math has the functions",
    "scipy": "lists with units are arrays there, and math has the functions",
    "dataclasses": "a dict or a plain class does the same",
    "enum": "names of enumerations are texts, as in source=\"SENSED\"",
    "typing": "put the import under `if TYPE_CHECKING:`; annotations are not evaluated",
    "random": "dispersions belong into dispersions.py or the scenario",
    **dict.fromkeys(("os", "sys", "pathlib", "subprocess", "io", "json", "csv", "pickle"),
                    "a flight computer has no files; write the numbers into the script"),
    **dict.fromkeys(("time", "datetime"), "flight's time is the t of a tick; durations have units"),
}


COMPUTED = "fledge_computed.py"     # functions of fledge.world, with the results that they had here


@dataclass
class Scripts:
    """The files of a program, by the names by which it imports them."""
    module: str                     # that has build()
    whole: bool                     # build(sim) builds all processes; else build(f)
    files: dict[str, Path | str] = field(default_factory=dict)     # nadir_spin/flight.py -> the file, or its text
    names: set[str] = field(default_factory=set)    # of attributes and imports: Quality of fsw.Quality.GOOD


def read_scripts(sim: Any) -> Scripts:
    """The Scripts of a simulation that a mission's folder made. Raises ExportError."""
    mission = sim.mission
    if not mission:
        raise ExportError(f"{sim.name}: MicroPython flies a mission's folder; this one was made without files")
    package = mission.name if mission.name not in MODULES else f"{mission.name}_mission"
    entry = "mission" if mission.several else "flight"
    scripts = Scripts(f"{package}.{entry}", mission.several)
    _Reader(package, mission.roots, scripts).take(f"{package}/{entry}.py", mission.folder / f"{entry}.py")
    given = _given(mission, scripts.files[f"{package}/{entry}.py"])
    choices = [line for flight in sim.flights for line in _choices(flight, mission.several)]
    if given or choices:
        scripts.module = f"{package}.given"
        uses = ["from fledge import flight as fsw", "from fledge.units import ns"] if choices else []
        scripts.files[f"{package}/given.py"] = "\n".join(
            [f"from .{entry} import build as _build", *uses, "", "", "def build(it):",
             f"    _build({', '.join(filter(None, ('it', given)))})", *choices, ""])
    files = {str(path) for path in scripts.files.values() if isinstance(path, Path)}
    if results := [path for path in mission.computed if path.file in files]:
        scripts.files[COMPUTED] = _computed(results)
    return scripts


def _choices(flight: Any, several: bool) -> Iterator[str]:
    """The lines that make what connections in world.py, which does not fly, added to a process."""
    if flight.command_choices:
        yield "    f = " + (f"it.process({flight.name!r})" if several else "it")
    for choice in flight.command_choices:
        outputs = ", ".join((f"{mode}=" if mode else "") + f"f.{output}" for output, mode in choice.outputs)
        age = f".stale_after({choice.stale_after} * ns)" if choice.stale_after else ""
        period, offset, priority = choice.task
        yield f"    f.{choice.name} = fsw.{choice.type}()"
        yield f"    f.connect((fsw.{choice.rule}({outputs}) >> f.{choice.name}.chosen){age})"
        yield (f"    f.task({choice.name!r}, every={period} * ns, offset={offset} * ns, priority={priority}, "
               f"run=[f.{choice.name}])")


def _computed(results: Sequence[Computed]) -> str:
    """The Python of functions that give these results, one at each call."""
    functions: dict[str, list[str]] = {}
    for result in results:
        functions.setdefault(result.function, []).append(_literal(result.result))
    return "def _in_turn(*results):\n    left = iter(results)\n    return lambda *_, **__: next(left)\n\n\n" + "".join(
        f"{name} = _in_turn({', '.join(literals)})\n" for name, literals in functions.items())


def _literal(value: Any) -> str:
    if isinstance(value, dict):
        return f"{{{', '.join(f'{key!r}: {_literal(item)}' for key, item in value.items())}}}"
    value = value.tolist() if hasattr(value, "tolist") else value
    return f"({''.join(f'{_literal(item)}, ' for item in value)})" if isinstance(value, (list, tuple)) else repr(value)


def _given(mission: Any, file: Path | str) -> str:
    """The parameters that the user gave and that its build() takes, as arguments."""
    tree = ast.parse(Path(file).read_text(encoding="utf-8"))
    arguments = next(node.args for node in tree.body if isinstance(node, ast.FunctionDef) and node.name == "build")
    known = [argument.arg for argument in (*arguments.args[1:], *arguments.kwonlyargs)]
    for name, value in mission.parameters.items():
        if name in known and not isinstance(value, (bool, int, float, str)):
            raise ExportError(f"{mission.name}: the parameter {name} must be a number or a text there; found {value!r}")
    return ", ".join(f"{name}={value!r}" for name, value in mission.parameters.items() if name in known)


class _Reader:
    """Follows the imports from one file."""

    def __init__(self, package: str, roots: list[Path], scripts: Scripts) -> None:
        self.package, self.roots, self.files, self.names = package, roots, scripts.files, scripts.names

    def take(self, name: str, path: Path) -> None:
        if name in self.files:
            return
        self.files[name] = path
        try:
            tree = ast.parse(path.read_text(encoding="utf-8"), str(path))
        except SyntaxError as error:
            raise ExportError(f"{path}, line {error.lineno}: {error.msg}") from None
        for inner in ast.walk(tree):
            if isinstance(inner, (ast.Attribute, ast.alias)):
                self.names.add(inner.attr if isinstance(inner, ast.Attribute) else inner.name)
        here = name.removesuffix(".py").split("/")[:-1]
        for node in imports(tree):
            if isinstance(node, ast.Import):
                for alias in node.names:
                    self.absolute(alias.name, [], path, node)
            elif node.level:
                base = here[:len(here) - node.level + 1]
                if not base:
                    raise refusal(path, node, "this import goes beyond the mission")
                self.relative([*base, *(node.module.split(".") if node.module else [])],
                              [alias.name for alias in node.names], path, node)
            else:
                self.absolute(node.module or "", [alias.name for alias in node.names], path, node)

    def relative(self, parts: list[str], names: list[str], path: Path, node: ast.stmt) -> None:
        """`from .a import b`, in the mission's package: parts are those of a."""
        file = self.module(parts)
        for name in names:
            file |= self.module([*parts, name])
        if not file and len(parts) > 1:
            raise refusal(path, node, f"there is no {'/'.join(parts[1:])}.py in {' or '.join(map(str, self.roots))}")

    def module(self, parts: list[str]) -> bool:
        """Take a module of the mission's package, and the packages that it is in."""
        for root in self.roots:
            base = root.joinpath(*parts[1:])
            file = base.with_suffix(".py") if len(parts) > 1 else base / "__init__.py"
            if not file.is_file():
                file = base / "__init__.py"
            if file.is_file():
                for i in range(2, len(parts)):
                    above = root.joinpath(*parts[1:i]) / "__init__.py"
                    if above.is_file():
                        self.take("/".join([*parts[:i], "__init__.py"]), above)
                self.take("/".join([*parts, "__init__.py"]) if file.name == "__init__.py"
                          else "/".join(parts) + ".py", file)
                return True
        return False

    def absolute(self, name: str, names: list[str], path: Path, node: ast.stmt) -> None:
        top = name.partition(".")[0]
        if top == "__future__":
            self.files.setdefault("__future__.py", "annotations = None\n")
        elif top == "fledge":
            if "*" in names:
                raise refusal(path, node, f"the target cannot import * from {name}: import names")
            wrong = [name for name in names if name not in NAMES] if name == "fledge" else []
            if wrong or name not in {"fledge", *FLEDGE}:
                raise refusal(path, node, f"fledge{f'.{wrong[0]}' if wrong else name[6:]} is not on the target, which "
                              f"has {listed(sorted(NAMES))} of fledge")
        elif name not in MODULES:
            if not self.own(name, names):
                raise refusal(path, node, f"{name} is not on the target: " + INSTEAD.get(
                    top, "it has fledge, fledge.flight, fledge.units, fledge.world and math, and Python files of the "
                    "mission and its project"))

    def own(self, name: str, names: list[str]) -> bool:
        """Whether it is the project's own Python; then it is taken."""
        places = [folder for folder in (project.folder(), self.roots[0]) if folder]
        for dotted in (name, *(f"{name}.{part}" for part in names)):
            try:
                spec = importlib.util.find_spec(dotted)
            except (ImportError, ValueError):
                continue
            file = Path(spec.origin) if spec and spec.origin and spec.origin.endswith(".py") else None
            if not file or not any(file.resolve().is_relative_to(place.resolve()) for place in places):
                if dotted == name:
                    return False
                continue
            end = "/__init__.py" if file.name == "__init__.py" else ".py"
            self.take(dotted.replace(".", "/") + end, file)
        return True


def imports(tree: ast.AST) -> Iterator[ast.Import | ast.ImportFrom]:
    """The imports that the target executes, wherever they stand: not those for type checkers, and not those whose
    failure the script handles."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, (ast.Import, ast.ImportFrom)):
            yield node
        elif isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test):
            for statement in node.orelse:
                yield from imports(ast.Module([statement], []))
        elif isinstance(node, ast.Try) and any("ImportError" in ast.dump(handler.type) or "ModuleNotFound" in ast.dump(
                handler.type) for handler in node.handlers if handler.type):
            for branch in (*node.handlers, *node.orelse, *node.finalbody):
                yield from imports(branch)
        else:
            yield from imports(node)


def refusal(path: Path, node: ast.stmt, text: str) -> ExportError:
    return ExportError(f"{path}, line {node.lineno}: {text}")


def placed(text: str, files: Mapping[str, Path | str]) -> str:
    """A message of the target with the paths of the files that the user has in place of those in the program."""
    for name, path in files.items():
        if isinstance(path, Path):
            text = text.replace(f"{name}, line", f"{path}, line")
    return text
