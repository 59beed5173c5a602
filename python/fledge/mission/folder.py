# SPDX-License-Identifier: Apache-2.0
"""Missions: folders with flight.py (what flies), world.py (the truth) and scenarios.py.

    sim = fledge.load("nadir_spin")         # from a project, ./missions, Fledge's own missions, or a path
    sim.scenarios["scenario"]()             # records, runs, checks and plots

flight.py has build(f), world.py has build(w, f). load() executes both afresh, so that two simulations
share nothing. Their further arguments, as in build(f, wheels=4), are parameters of the mission:
load("my_mission", wheels=3). A mission of several spacecraft or computers has a mission.py with build(sim), which
makes the processes and builds each, and imports of the other files what it needs. In scenarios.py every public
function that takes a simulation is a scenario, and the first line of its docstring describes it. The files may import
from one another, `from .flight import TURN`, and from other missions: `from .single_spiral.world import build`.
"""

from __future__ import annotations

import itertools
import os
import re
import sys
import types
import weakref
from collections.abc import Callable
from typing import TYPE_CHECKING, Any
from pathlib import Path

from fledge import folders
from fledge.errors import CompositionError, SetupError, did_you_mean, nearest
from fledge.disk import shown
from fledge.mission import flying
from fledge.mission.simulation import Simulation
from fledge.objects.computed import Computed, recorded
from fledge.objects.plausible import check, check_kept, check_read
from fledge.units import Quantity

if TYPE_CHECKING:
    from fledge.mission.process import Process

# The arguments of build(), or preset(), by file.
_TAKES = {"flight": "f", "world": "w, f", "mission": "sim", "view": "view", "preset": "sim", "requirements": "r"}
FLYING = {"flight", "mission"}      # what a target executes, with what they import
_package = itertools.count(1)


class MissionError(SetupError):
    """A mission's file cannot be executed. The text has its line; `cause` is the exception itself."""

    def __init__(self, text: str, cause: BaseException | None) -> None:
        super().__init__(text)
        self.cause = cause


class Mission:
    """A mission's folder. `name`, `folder`, and `scenarios` by name once it is loaded."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.name = folder.name
        self.scenarios: dict[str, Any] = {}
        self.functions: set[str] = set()        # the names of those in scenarios.py
        self.parameters: dict[str, Any] = {}
        self.computed: list[Computed] = []     # for flight, by its scripts

    @property
    def several(self) -> bool:
        """Whether its mission.py makes the processes."""
        return (self.folder / "mission.py").exists()

    @property
    def roots(self) -> list[Path]:
        """The folders from which its files import `from .NAME`, in this order: its own, then those of missions."""
        return list(dict.fromkeys([self.folder, self.folder.parent, *folders.of_missions()]))

    def metadata(self) -> dict[str, str]:
        """The parameters that the user gave, for records; {} if none."""
        given = ", ".join(f"{name}={value!r}" for name, value in self.parameters.items())
        return {"parameters": given} if given else {}

    def summaries(self) -> dict[str, str]:
        """Name -> first line of the docstring, of the mission (under "") and of each scenario.

        It executes nothing.
        """
        return folders.summaries(self.folder)

    def __repr__(self) -> str:
        return f"<mission {self.name} in {self.folder}>"


def functions_of(module: types.ModuleType) -> dict[str, types.FunctionType]:
    """The public functions with one argument that a file defines, by name."""
    return {name: function for name, function in vars(module).items()
            if isinstance(function, types.FunctionType) and function.__module__ == module.__name__
            and not name.startswith("_") and function.__code__.co_argcount == 1}


def missions() -> dict[str, Mission]:
    """All missions by name."""
    return {name: Mission(folder) for name, folder in folders.missions().items()}


def find(name: str | os.PathLike[str]) -> Mission:
    """The mission of that name, or in that folder. Raises SetupError that lists those found."""
    folder = Path(name)
    if folders.is_mission(folder):
        return Mission(folder.resolve())
    known = missions()
    if str(name) in known:
        return known[str(name)]
    places = list(dict.fromkeys(folders.of_missions()))
    for there in (folder, *(place / folder for place in places)):
        if there.is_dir():
            raise SetupError(f"there is no mission in {shown(there)}: the folder is there, but neither flight.py, what "
                             "flies, nor mission.py is in it")
    if os.sep in str(name):
        raise SetupError(f"there is no mission in {name}: there is no such folder")
    raise SetupError(f"there is no mission '{name}'{did_you_mean(str(name), known)} there are "
                     f"{', '.join(known) or 'none'} (looked in {', '.join(map(str, places))})")


def load(name: str | os.PathLike[str], seed: int = 0, **parameters: Any) -> Simulation:
    """A simulation of a mission, ready to run.

    name: of a mission, or the path of its folder; seed: of all random streams; parameters: further arguments
    of the mission's build functions.
    Raises SetupError for an unknown mission or parameter, MissionError for an error in its files.
    """
    return _load(name, seed, parameters)


def without_preset(name: str | os.PathLike[str], **parameters: Any) -> Simulation:
    """The same without what its preset.py does, for a target that runs the other files itself."""
    return _load(name, 0, parameters, preset=False)


def _load(name: str | os.PathLike[str], seed: int, parameters: dict[str, Any], preset: bool = True) -> Simulation:
    if own := folders.project():
        from fledge.mission.provenance import compare_with_project

        compare_with_project(own)
    mission = find(name)
    simulation = Simulation(mission.name, seed, empty=mission.several)
    simulation.mission = mission
    mission.parameters = dict(parameters)
    with recorded() as mission.computed, MissionFiles(mission) as files:
        builds: list[tuple[Any, list[Any]]]
        if mission.several:
            for name in ("flight", "world"):
                if (mission.folder / f"{name}.py").exists():
                    files.execute(name)
            builds = [(files.execute("mission", "build").build, [simulation])]
        else:
            builds = [(files.execute("flight", "build").build, [simulation.flight])]
            if (mission.folder / "world.py").exists():
                builds.append((files.execute("world", "build").build, [simulation.world, simulation.flight]))
            for file, (build, _) in zip(("flight", "world"), builds):
                _refuse_names(file, build)
        if parameters:
            _refuse_unsuitable(mission, parameters, builds)
        for build, arguments in builds:
            flown = None if mission.several or len(arguments) == 1 else _composed(arguments[1])
            taken = _parameters(build, len(arguments)) if parameters else {}
            try:
                files.call(build, *arguments, **{name: parameters[name] for name in taken if name in parameters})
            except MissionError as error:
                lacking = _required(simulation, arguments[1:])
                raise MissionError("\n  ".join([str(error), *lacking]), error.cause) from None
            if flown is not None and (made := _composed(arguments[1]) - flown):
                raise SetupError(f"{mission.folder / 'world.py'} makes {', '.join(sorted(made))}: what flies is "
                                 "composed in flight.py, which targets take; world.py joins the world to it")
        if (mission.folder / "scenarios.py").exists():
            scenarios = files.execute("scenarios")
            mission.scenarios = functions_of(scenarios)
            mission.functions = {name for name, value in vars(scenarios).items()
                                 if isinstance(value, types.FunctionType) and value.__module__ == scenarios.__name__}
        check(simulation.processes)
        wires = simulation.wires
        for process in simulation.processes:
            check_read(process, wires)
        for flight in simulation.flights:
            check_kept(flight, wires)
        if preset and (mission.folder / "preset.py").exists():
            files.call(files.execute("preset", "preset").preset, simulation)
    weakref.finalize(simulation, files.forget)
    return simulation


def _required(simulation: Simulation, flights: Any) -> list[str]:
    """What these processes lack, which may be why composing the next one has failed, with its places."""
    return [f"{file}, line {line}: {text}" for file, line, text in simulation.problems
            if " is required" in text and text.startswith(tuple(f"{flight.name}."
                                                                for flight in flights))] if flights else []


def _parameters(build: Callable[..., Any], taken: int) -> dict[str, Any]:
    """The arguments of a build function after the first `taken`: name -> default."""
    import inspect

    return {p.name: p.default for p in list(inspect.signature(build).parameters.values())[taken:]
            if p.kind in (p.POSITIONAL_OR_KEYWORD, p.KEYWORD_ONLY)}


def _composed(process: Process) -> set[str]:
    """The names of what a process runs. Its events are not among them, because a world's file may look at both; nor is
    what chooses among commands for the world, which exports add too."""
    chooses = {choice.name for choice in process.command_choices}
    return {f"{process.name}.{name}" for name in (*process.instances, *(task.name for task in process.tasks),
                                                  *(name for name, _ in process.modes)) if name not in chooses}


def _refuse_names(file: str, build: Callable[..., Any]) -> None:
    """Raise SetupError if a build function lacks arguments, takes parameters in their place, or calls them as those of
    the other file."""
    expected = _TAKES[file].split(", ")
    meant = {"f": "flight", "w": "world"}
    code: Any = getattr(build, "__code__", None)    # of a function
    if code is None:
        return
    takes = code.co_varnames[:code.co_argcount]
    defaults = len(getattr(build, "__defaults__", None) or ())
    first = [name for i, name in enumerate(takes) if i < len(takes) - defaults or name in meant]
    takes_more = code.co_flags & 4      # *args
    if len(first) < len(expected) and not takes_more:
        from inspect import signature

        own = [str(p) for p in signature(build).parameters.values() if p.name not in first]
        raise SetupError(f"{shown(code.co_filename)}, line {code.co_firstlineno}: build() gets {_TAKES[file]}, "
                         f"{' and '.join(meant[one] for one in expected)}, and then its parameters: write "
                         f"build({', '.join([*first, *expected[len(first):], *own])})")
    for name, given in zip(expected, takes):
        if given in {word for pair in meant.items() if pair[0] != name for word in pair}:
            raise SetupError(f"{shown(code.co_filename)}, line {code.co_firstlineno}: build() gets {_TAKES[file]}, "
                             f"{' and '.join(meant[one] for one in expected)}; it calls the "
                             f"{meant[name]} '{given}'")


def _refuse_unsuitable(mission: Mission, given: dict[str, Any], builds: Any) -> None:
    """Raise SetupError for a parameter that the mission does not have, and for a text where its default is a number."""
    known = {name: default for build, arguments in builds for name, default in
             _parameters(build, len(arguments)).items()}
    for name, value in given.items():
        if isinstance(value, str) and isinstance(known.get(name), (int, float, Quantity)):
            raise SetupError(f"the mission {mission.name}: its parameter {name} is a number, as {known[name]!r}; "
                             f"found the text {value!r}")
        if name not in known:
            raise SetupError(f"the mission {mission.name} has no parameter '{name}'; it has "
                             + (", ".join(f"{n}={d!r}" for n, d in known.items()) or "none"))


class MissionFiles:
    """A mission's files as the modules of a package of their own, made anew for each load."""

    def __init__(self, mission: Mission) -> None:
        self.mission = mission
        self.package = f"{flying.OWN}{mission.name}_{next(_package)}"

    def __enter__(self) -> MissionFiles:
        package = types.ModuleType(self.package)
        package.__path__ = list(map(str, self.mission.roots))
        sys.modules[self.package] = package
        return self

    def __exit__(self, kind: Any, *_: object) -> None:
        if kind:
            self.forget()

    def forget(self) -> None:
        for name in [n for n in list(sys.modules) if n == self.package or n.startswith(self.package + ".")]:
            del sys.modules[name]

    def execute(self, name: str, *functions: str) -> Any:
        """Run a file; it must define the functions."""
        path = self.mission.folder / f"{name}.py"
        module = types.ModuleType(f"{self.package}.{name}")
        module.__file__ = str(path)
        module.__package__ = self.package
        sys.modules[module.__name__] = module

        def run() -> None:
            text = folders.source(path)
            if name in FLYING:
                flying.execute(text, str(path), vars(module))
            else:
                exec(compile(text, str(path), "exec"), vars(module))

        self.call(run, path=path)
        for function in functions:
            if not callable(getattr(module, function, None)):
                own = [key for key, value in vars(module).items() if isinstance(value, types.FunctionType)]
                raise MissionError(f"{path}: expected a function {function}({_TAKES[name]})"
                                   + (f"; it has {near}()" if (near := nearest(function, own)) else ""), None)
        return module

    def call(self, function: Any, *arguments: Any, path: Path | None = None, **parameters: Any) -> Any:
        """Call a function; raises MissionError with the line of an exception."""
        try:
            return function(*arguments, **parameters)
        except Exception as error:
            path = path or function.__code__.co_filename
            raise MissionError(explain(error, self.mission.folder, path), error) from None


def explain(error: BaseException, folder: Path, path: str | os.PathLike[str] | None = None) -> str:
    """An exception as a user of the mission should see it: their file, their line, and the error.

    path: the file, if the traceback has none of its lines.
    """
    import traceback

    if isinstance(error, CompositionError):     # whose lines are those that composed it
        return str(error)
    if isinstance(error, SyntaxError) and error.filename:
        line = (error.text or "").strip()
        return f"{shown(error.filename)}, line {error.lineno}: {error.msg}" + (f"\n    {line}" if line else "")
    frames = [f for f in traceback.extract_tb(error.__traceback__) if Path(f.filename).is_relative_to(folder)]
    kind = "" if isinstance(error, (SetupError, AssertionError)) else f"{type(error).__name__}: "
    text = f"{kind}{error}{_advice(error)}" if str(error) else kind.rstrip(": ") or "an assertion does not hold"
    if not frames:
        return f"{shown(path)}: {text}" if path else text
    last = frames[-1]
    if text.startswith(f"{shown(last.filename)}, line "):   # a prototype's class, which names the line within it
        return text
    return f"{shown(last.filename)}, line {last.lineno}: {text}" + (f"\n    {last.line}" if last.line else "")


def _advice(error: BaseException) -> str:
    """What Python does not say of an error: where the name is that is not defined, and how lists get units."""
    from fledge.basilisk import WORDS

    if isinstance(error, NameError):
        from fledge import flight, units, world

        if error.name in units.UNITS:
            return f"; it is a unit: from fledge.units import {error.name}"
        for module, short in ((flight, "fsw"), (world, "world")):
            if error.name in dir(module):
                return f"; write {short}.{error.name}"
        if error.name in WORDS:
            return f"; here, Basilisk's is {WORDS[error.name]}"
        if error.name == "np":
            return "; write import numpy as np at the top"
    if isinstance(error, ModuleNotFoundError) and str(error.name).partition(".")[0] == "Basilisk":
        return "; Fledge does not use it: `from fledge import flight as fsw, world` (docs/from-basilisk.md)"
    if isinstance(error, ImportError) and str(error.name).startswith("fledge.") and error.name in sys.modules:
        wanted = str(error).removeprefix("cannot import name '").partition("'")[0]
        return f"; did you mean '{near}'?" if (near := nearest(wanted, dir(sys.modules[error.name]))) else ""
    if re.search(r"sigma_\w+: expected shape \(3\); found shape \(4\)", str(error)):
        return "; of a quaternion it is fledge.attitude.quaternion_to_mrp(...)"
    if isinstance(error, TypeError) and "can't multiply sequence" in str(error):
        return "; a list takes factors with a unit: [1, 2, 3] * (2.5 * N)"
    return ""
