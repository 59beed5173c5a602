# SPDX-License-Identifier: Apache-2.0
"""A board at a serial line of this machine, whose program it has already (`fledge load`). A target without a folder: it
is named by its line (fledge/serial_line.py)."""
from __future__ import annotations

import os
import re
from pathlib import Path

from fledge.errors import Failure
from fledge.serial_line import BEGIN, devices, name_of, read
from fledge.targets.target import Target

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from typing import Any

    from matplotlib.figure import Figure

    from fledge.targets.flown import Flown
    from fledge.targets.job import Part


class Serial(Target):
    """A board at a line. elf: the program that it has, if that is to be checked. pace: simulated seconds per second; 0:
    the world waits for the board."""

    about = "a board at a serial line"
    cpu_of = "line too"

    def __init__(self, word: str, elf: Path | str | None = None, baud: int | None = None, pace: float = 0.0) -> None:
        self.device, self.options = read(word)
        if baud is not None:
            read(f"{BEGIN}{self.device}?baud={baud}")
            self.options["baud"] = str(baud)
        self.name = name_of(word)
        self.elf, self.pace = Path(elf) if elf else None, pace
        self.process = ""       # that flies there
        self.build_id = ""

    def check(self, part: Part) -> None:
        super().check(part)
        if self.process not in ("", part.process):
            raise Failure(f"{BEGIN}{self.device}: one board flies one process; name it, as in "
                          f"{part.process}={BEGIN}{self.device}")
        self.process = part.process
        if self.elf:
            self._check_program(part, self.elf)
        if not os.path.exists(self.device):
            raise Failure(f"there is no device {self.device}: is the board connected, and switched on? There "
                          f"{'are ' + ', '.join(names) if (names := devices()) else 'is no serial device'}")

    def _check_program(self, part: Any, file: Path) -> None:
        from fledge import elf

        program = elf.read(file)
        if program.kind != elf.EXECUTABLE:
            raise Failure(f"{file} is no linked program; name the one that was loaded into the board")
        if not program.build_id:
            raise Failure(f"{file} has no build id, by which the board's program is known; link it with "
                          "-Wl,--build-id, and load it again")
        if part.mission.folder.encode() + b"\0" not in file.read_bytes():
            raise Failure(f"{file} ({program.processor}) is the program of another mission: it has no "
                          f"{part.mission.folder}; build the board's program of {part.mission.title}, and load it")
        self.build_id = program.build_id

    def build(self, part: Part) -> Path:
        self.check(part)
        return self.elf or Path(self.device)

    def command(self, built: Path, record: str) -> list[str]:
        return []

    def node_options(self, built: Path, record: str) -> list[str]:
        options = {**self.options, **({"pace": f"{self.pace:g}"} if self.pace else {}),
                   **({"build": self.build_id} if self.build_id else {})}
        query = "&".join(f"{name}={value}" for name, value in options.items())
        return ["--line", f"{self.device}?{query}" if query else self.device, "--line-record", record]

    def reason(self, log: str) -> str:
        """The messages of its node about the line or the board."""
        lines = re.findall(rf"^{re.escape(self.process)}: fledge_board_node: (.*{re.escape(self.device)}\b.*)$", log,
                           re.MULTILINE)
        return lines[-1] if lines else ""

    def flown(self, built: Path, record: Path, figures: dict[str, str]) -> Flown:
        flight = super().flown(built, record, figures)
        flight.code, flight.memory = (int(figures[key]) if key in figures else None
                                      for key in ("program_bytes", "data_bytes"))
        flight.line = {key.removeprefix("line_"): int(text) for key, text in figures.items()
                       if key.startswith("line_")}
        return flight


def summary(line: Mapping[str, int], ticks: int) -> str:
    """What a line carried and lost in a flight."""
    per = max(ticks, 1)
    faults = [f"{line.get(key, 0)} {what}" for key, what in (
        ("resent", "frames sent again"), ("damaged", "damaged"), ("cuts", "cuts"), ("resets", "resets"))]
    return (f"{line.get('bytes_sent', 0) / per:.0f} bytes a step to the board, {line.get('bytes_taken', 0) / per:.0f} "
            f"back; the longest answer took {line.get('longest_ns', 0) / 1e6:.3g} ms; {', '.join(faults)}")


def lateness(line: Mapping[str, int]) -> list[tuple[str, int]]:
    """(by how much, how many answers) of a paced flight, the earliest first; none of one that was not."""
    matches = [re.fullmatch(r"late_(under|over)_(\d+)_ms", key) for key in line]
    bins = sorted(((int(match[2]), match[1] == "over", line[match[0]]) for match in matches if match))
    return [(f"{'over' if over else 'under'} {ms} ms", n) for ms, over, n in bins]


def plot(line: Mapping[str, int], title: str) -> Figure:
    """The histogram."""
    from fledge.plot import drawn

    bins = lateness(line)
    with drawn((8.4, 3.6), "late", title) as figure:
        axes = figure.subplots()
        axes.bar([what for what, _ in bins], [n for _, n in bins], 0.9, color="C0")
        axes.set(yscale="log", xlabel="late after the clock", ylabel="steps", ylim=(0.7, None))
        axes.tick_params("x", labelrotation=30)
    return figure


def late_lines(bins: list[tuple[str, int]]) -> Iterable[str]:
    """The histogram as lines of text."""
    most = max((n for _, n in bins), default=0) or 1
    for what, n in bins:
        yield f"{what:>13}  {n:8}  {'#' * -(-n * 40 // most)}".rstrip()
