# SPDX-License-Identifier: Apache-2.0
"""A flight: a scenario of a mission, exported once for all targets, and its duration."""
from __future__ import annotations

import math
import re
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fledge import export
from fledge.objects import project
from fledge.targets import build
from fledge.targets.rehearsal import rehearse

if TYPE_CHECKING:
    from registers.description import Board
    import numpy as np


class Job:
    """A mission's scenario before its run. All files go into `folder`, the exported ones into its c/.

    scenario: its name; None: the mission's first. duration: [s]; None: as long as the scenario runs. The desktop
    rehearses the scenario: its changes of flight between its runs go to targets as parameters from the ground.
    boards: files of boards that the messages pass; none: a board that carries them whole. free: take no scenario.
    parameters: of the mission, as fledge.load() takes them.
    """

    def __init__(self, mission: str, scenario: str | None = None, duration: float | None = None, seed: int = 0,
                 boards: Sequence[Path | str] = (), folder: Path | str | None = None, free: bool = False,
                 parameters: dict[str, Any] | None = None) -> None:
        self.asked, self.parameters = mission, parameters or {}     # as other programs are to load it
        self.seed, self.boards = seed, [Path(path).resolve() for path in boards]
        play = rehearse(mission, scenario, duration, seed, free, self.parameters)
        self.scenario, self.duration, self.loads = play.name, play.duration, play.loads
        self.start, self.mission, self.whole = play.start, play.mission, play.whole
        self.flight: str = play.sim.flight.name
        self.folder = Path(folder) if folder else Path("runs") / self.mission.title / "fly"
        self.outputs = [export.host.topic(m.path) for m in self.mission.outputs]
        changed = list(dict.fromkeys(load.path for load in self.loads))
        self.files = (export.emit_board(self.mission, self.boards, parameters=changed)
                      | export.emit_host(self.mission))
        self.rounds = any(field.carries for board in self.described() for snorkel in board.snorkels
                          for field in snorkel.fields)      # some numbers pass as counts

    @cached_property
    def written(self) -> list[Path]:
        """The paths of all exported files, which this writes."""
        return export.write(self.mission, self.folder / "c", self.files)

    def board_files(self) -> list[Path]:
        """The files of the given boards, or that of the mission's own board, which this writes."""
        return self.boards or [path.resolve() for path in self.written if path.suffix == ".toml"]

    def exchange(self, target: str) -> Path:
        """The path for the record of what the world and flight read of each other; it is written where boards may
        round, delay or lose messages."""
        return self.folder / f"{target}.exchange.mcap"

    def write_loads(self) -> Path:
        """The file of the parameters from the ground, for the node of the board."""
        ids = list(export.board.blocks(self.mission))
        n = len(self.mission.inputs) + len(self.mission.outputs)
        text = "".join(f"{load.after} {n + ids.index(load.path)} {load.block.hex()}\n" for load in self.loads)
        return export.write_files({"loads.txt": text}, self.folder)[0]

    def bounds(self) -> list[tuple[str, float, float, str]]:
        """(field, how much it may differ from the desktop's, [s] from when on, "file:line") by the files of the
        boards."""
        return [(one.field, one.at_most, one.after, f"{board.file}:{one.line}") for board in self.described()
                for one in board.bounds if one.scenario in (None, self.scenario)]

    def described(self) -> list[Board]:
        """The boards that were given, as data."""
        texts = [(path, path.read_text(encoding="utf-8")) for path in self.boards]
        return export.board.read(self.mission, texts) if texts else []

    @property
    def roots(self) -> list[Path]:
        """The folders with headers and sources of modules."""
        own = project.folder()
        return [*([own] if own else []), build.ROOT]

    def sources(self) -> list[Path]:
        """All sources of flight: the exported ones, those of its modules, and flight/math."""
        written = [path.resolve() for path in self.written if path.suffix == ".c"]
        return [*written, *build.module_sources(self.mission, self.roots), *build.math_sources()]

    def includes(self) -> list[Path]:
        return [(self.folder / "c").resolve(), *self.roots]

    def tables(self) -> Path:
        """The mission and its boards as data for the outside: a shared object for this machine."""
        return build.program(self.folder / "tables", f"{self.mission.name}.so", self.sources(), self.includes(),
                             flags=["-fPIC"], link=["-shared", "-Wl,-z,defs"], entry="fledge_mission")

    def fields(self) -> list[str]:
        """The names of all numbers that flight puts out: "flight.tracking.error.sigma_BR"."""
        return [re.sub(r"\[\d+\]", "", f"{m.path}.{name}") for m in self.mission.outputs
                for name, _, _ in export.leaves(m.struct.fields)]

    def is_instant(self, t: np.ndarray) -> np.ndarray:
        """Of an array of times [ns], which are flight's: on the grid of any of its tasks."""
        import numpy as np

        found = np.zeros(len(t), bool)
        for task in self.mission.tasks:
            found |= (t >= task.offset) & ((t - task.offset) % task.period == 0)
        return found

    def step(self) -> int:
        """[ns] The widest grid that has all of flight's instants."""
        return math.gcd(*(n for task in self.mission.tasks for n in (task.period, task.offset)))
