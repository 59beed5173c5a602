# SPDX-License-Identifier: Apache-2.0
"""A scenario of a mission on a target: a hash of all that its verdicts depend on, and its results."""
from __future__ import annotations

import dataclasses
import functools
import hashlib
import json
import math
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fledge.disk import ROOT, sources

FILE = "flight.json"        # of the results, in the folder of a flight

# Besides the package, what makes the targets but the desktop; `_core` is built of the rest.
TARGETS = ("ccsds", "cosim", "emulator", "flight", "introspect", "options", "record", "registers", "sim", "targets",
           "world")
SOURCES = {".py", ".c", ".h", ".cpp", ".S", ".ld", ".toml", ".txt"}


@dataclass(frozen=True)
class Flight:
    """What is flown. mission: as the user names it; coverage: "object", the lines and branches that run on the board,
    "mcdc", what decides, or "", none; folder: for its files."""
    mission: str
    scenario: str
    target: str
    seed: int
    parameters: dict[str, Any]
    coverage: str
    folder: Path

    @property
    def title(self) -> str:
        return f"{self.scenario} on {self.target}"

    def hash(self, mission: Path) -> str:
        """Of all that the results depend on. mission: its folder; its files must have been loaded."""
        facts = repr((self.scenario, self.target, self.seed, sorted(self.parameters.items()), self.coverage))
        return hashlib.sha256(f"{_fledge(self.target != 'desktop')}{_files(mission)}{facts}".encode()).hexdigest()[:16]


@functools.cache
def _fledge(with_targets: bool) -> str:
    """A hash of Fledge's sources and of its extension."""
    from fledge.mission.provenance import extension

    others = {path for folder in TARGETS * with_targets for path in (ROOT / folder).rglob("*")}
    files = [path for path in sorted({*sources(), *others}) if path.suffix in SOURCES
             and not {"testing", "web"} & set(path.parts) and "_test." not in path.name]
    return _digest(ROOT, [*files, extension()])


def _files(mission: Path) -> str:
    """A hash of a mission's files: of all in its folder but tests and texts, and those of other missions and of the
    project that it has loaded."""
    from fledge.objects import project

    own = [path for path in sorted(mission.rglob("*")) if path.is_file() and "__pycache__" not in path.parts
           and path.suffix not in (".md", ".mcap", ".part") and "_test." not in path.name]
    # Names, not pairs: pairs are allocated, which may start a garbage collection, and that deletes the modules of old
    # simulations.
    loaded = sorted({Path(file) for name in list(sys.modules) if name.startswith("_mission_")
                     and (file := getattr(sys.modules.get(name), "__file__", None))
                     and not Path(file).is_relative_to(mission)})
    folder = project.folder()
    theirs = [path for name in ("flight", "world") for path in sorted((folder / name).rglob("*"))
              if path.suffix in SOURCES] if folder else []
    return _digest(mission.parent, [*own, *loaded, *theirs])


def _digest(base: Path, paths: Iterable[Path]) -> str:
    digest = hashlib.sha256()
    for path in paths:
        name = path.relative_to(base) if path.is_relative_to(base) else path.name
        digest.update(f"{name}\0".encode() + hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()


# --- results ---------------------------------------------------------------------------------------

@dataclass
class Shown:
    """What a flight shows of a requirement. margin, low and high, its bounds: in `unit`, > 0 where it holds; at: [s]
    when the margin was least; where: the comparison that decided, and `limit`, its limit; reason: why it is
    unknown; figure: an SVG, or ""."""
    id: str
    verdict: str
    margin: float | None = None
    low: float | None = None
    high: float | None = None
    unit: str = ""
    at: float | None = None
    where: str = ""
    reason: str = ""
    limit: float | None = None
    figure: str = ""


@dataclass
class Flown:
    """The results of a flight.

    error: why it failed, or "" if it came to its end and its scenario's checks hold
    time: [s] flown; wall: [s] that it took; record: relative to the report's folder; same: whether flight put out the
    bits of the desktop, None where that is the desktop itself
    coverage: file -> the counts of coverage.py, {} without --coverage
    before: whether it comes from the report before
    """
    scenario: str
    target: str
    seed: int
    hash: str
    error: str = ""
    time: float = 0.0
    wall: float = 0.0
    record: str = ""
    same: bool | None = None
    shown: list[Shown] = field(default_factory=list)
    coverage: dict[str, Any] = field(default_factory=dict)
    before: bool = False

    @property
    def title(self) -> str:
        return f"{self.scenario} on {self.target}"

    @property
    def speed(self) -> float:
        """Times real time."""
        return self.time / self.wall if self.wall else 0.0

    def of(self, id: str) -> Shown | None:
        return next((shown for shown in self.shown if shown.id == id), None)

    def as_json(self) -> str:
        return dumps(dataclasses.asdict(self))

    @classmethod
    def read(cls, path: Path) -> Flown | None:
        """The results in a file; None if there are none that this version can read."""
        try:
            data = json.loads(path.read_text(encoding="utf-8"))
            shown = [Shown(**{**shown, **{name: number(shown[name]) for name in ("margin", "low", "high", "limit")}})
                     for shown in data.pop("shown")]
            return cls(**data, shown=shown)
        except (OSError, ValueError, TypeError, KeyError):
            return None


def dumps(data: Mapping[str, Any]) -> str:
    """JSON in which numbers that are not finite are texts: "inf"."""
    def plain(x: Any) -> Any:
        if isinstance(x, float) and not math.isfinite(x):
            return str(x)
        if isinstance(x, dict):
            return {key: plain(value) for key, value in x.items()}
        return [plain(item) for item in x] if isinstance(x, (list, tuple)) else x

    return json.dumps(plain(data), indent=1, ensure_ascii=False) + "\n"


def number(x: Any) -> float | None:
    """A number of such JSON."""
    return None if x is None else float(x)
