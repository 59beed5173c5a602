# SPDX-License-Identifier: Apache-2.0
"""One mission on several targets, in the same closed loop: exported, built, flown, and compared with the desktop.

Each target has a folder in targets/, of Fledge or of a project, and its name: targets/leon3 is the target `leon3` and
the package fledge.targets.leon3, whose __init__.py has its class. Here is what they share:

    target.py     the class of all targets
    rehearsal.py  a scenario on the desktop: its set-up, its duration, and what it changes between its runs
    job.py        what is flown: a mission's scenario, exported, and for how long
    build.py      builds C by ninja, and measures the size of programs
    loop.py       the programs of one flight: controller, world, and the node of the target's board
    flight.py     a flight of a job on its targets; flown.py: its results
    comparison.py a job on several targets, each compared with the desktop
    playback.py   a target's flight in the place of flight
    table.py      the table that `fledge fly` prints
    serial.py     a board at a serial line
    probe.py      a program into a board, by openocd; remote.py: onto another computer, by ssh

Until a flight begins, the standard library alone is imported: the launcher asks the classes what to install, and Fledge
may not be built yet.

Example:

    $ ./fledge fly nadir_spin --on desktop,linux,leon3 --for 10min
"""
from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from importlib import import_module
from pathlib import Path

from fledge.errors import Failure, did_you_mean, listed
from fledge.disk import ROOT
from fledge.targets.target import Target

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from typing import Any

PLACES = [Path(place, "targets") for place in (ROOT, os.environ.get("FLEDGE_PROJECT")) if place]
__path__ = [str(Path(__file__).parent), *map(str, PLACES)]


class Targets(Mapping[str, Target]):
    """Name -> target; the desktop comes first. The names are those of the folders; a class is imported when it is asked
    for."""

    def __init__(self, places: Iterable[Path]) -> None:
        folders = {path.parent.name.replace("_", "-"): path.parent for place in places
                   for path in place.glob("*/__init__.py")}
        self.folders = {name: folders[name] for name in sorted(folders, key=lambda name: (name != "desktop", name))}
        self._targets: dict[str, Target] = {}

    def __getitem__(self, name: str) -> Target:
        """Raises Failure where a folder has no class, or where its class cannot be imported."""
        if name not in self._targets:
            target = self._class(self.folders[name])()
            if unknown := [use for use in target.uses if use not in self]:
                raise Failure(f"{self.folders[name]}: it uses {' and '.join(unknown)}, and there is no such target")
            target.used = [self[use] for use in target.uses]
            self._targets[name] = target
        return self._targets[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.folders)

    def __len__(self) -> int:
        return len(self.folders)

    def __contains__(self, name: object) -> bool:
        return name in self.folders     # without its class

    def _class(self, folder: Path) -> type[Target]:
        file = folder / "__init__.py"
        try:
            module = import_module(f"fledge.targets.{folder.name}")
        except Exception as error:
            raise Failure(f"{file}: {type(error).__name__}: {error}") from error
        if not file.samefile(module.__file__ or ""):
            raise Failure(f"{folder}: Fledge has {module.__file__} by this name; give the folder another one")
        for var in vars(module).values():
            if isinstance(var, type) and issubclass(var, Target) and var.__module__ == module.__name__:
                return var
        raise Failure(f"{file} has no class that derives from fledge.targets.Target; docs/targets.md shows one")

    def known(self, names: Iterable[str]) -> list[str]:
        """Those of the names that are names of targets."""
        return [name for name in names if name in self]

    def expect(self, names: Iterable[str], command: str) -> None:
        """Raises Failure, which begins with the command, if there is no such target."""
        for name in names:
            if name not in self:
                if name in ("serial", "ssh"):
                    raise Failure(f"{command}: {name} needs what it is at: "
                                  f"{'serial:/dev/ttyACM0' if name == 'serial' else 'ssh:USER@HOST'}")
                near = did_you_mean(name, self)
                known = listed(list(self)) if near != ";" else "; ".join(
                    f"{target.name}, {target.about}" for target in self.values())
                raise Failure(f"{command}: there is no target '{name}'{near} there are {known}")

    def ready(self, names: Iterable[str], command: str) -> list[Target]:
        """The targets of these names, once all is built that any flight there needs. Raises Failure, which begins with
        the command, if there is no such target, or if one needs what is not installed."""
        targets: list[Target] = []
        for name in names:
            self.expect([name], command)
            targets.append(self[name])
            if missing := targets[-1].missing():
                raise Failure(f"{command}: {name} needs {' and '.join(missing)}, not installed here; as root, run: "
                              f"apt-get install {' '.join(self._packages(targets[-1], missing))}")
        for part in dict.fromkeys(used for target in targets for used in target.with_used()):
            part.prepare()
        return targets

    def _packages(self, target: Target, missing: Iterable[str]) -> list[str]:
        """The packages of Debian that have what is missing: compilers of this machine, and what targets list."""
        import re

        files = [self.folders[used.name] / "packages.txt" for used in target.with_used()]
        native = {"gcc": "g++", "ninja": "ninja-build"}     # g++ brings the C library's headers, too
        return list(dict.fromkeys([*(native[package] for package in missing if package in native), *(
            name for file in files if file.is_file()
            for name in re.findall(r"^[^#|\s]+", file.read_text(encoding="utf-8"), re.M))]))


def boards() -> dict[str, Path]:
    """Name -> file of all boards that openocd can load (probe.py); one of a project takes the place of another."""
    return {path.stem.replace("_", "-"): path for place in PLACES for path in sorted(place.glob("*/boards/*.toml"))}


TARGETS = Targets(PLACES)

_LAZY = {"Flown": "flown", "Job": "job", "Part": "job", "fly": "flight", "procedure": "micropython.procedures"}
__all__ = ["TARGETS", "Target", *_LAZY]


def __getattr__(name: str) -> Any:
    if name not in _LAZY:
        raise AttributeError(f"fledge.targets has no '{name}'")
    return getattr(import_module(f"fledge.targets.{_LAZY[name]}"), name)
