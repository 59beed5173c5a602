# SPDX-License-Identifier: Apache-2.0
"""Campaigns of bit flips: in the closed loop, in the middle of a manoeuvre, single bits of the registers and the memory
of a flight computer are inverted, each in a flight of its own from one snapshot. The outcomes are classified.

    campaign = Campaign("nadir_spin", at=30 * s, duration=30 * s)
    outcomes = campaign.fly(1000, seed=1)
"""
from __future__ import annotations

import multiprocessing
import os
import random
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from fledge.emulator.board import Board, load
from fledge.errors import Failure, SetupError
from fledge.objects.si import time_ns

EFFECTS = {
    "no effect": "all that flight wrote into its registers is the same, at all instants",
    "wrong output": "some of it was another; flight went on",
    "recovered by watchdog": "the computer was reset, and flight went on",
    "hang": "flight no longer answered at the end",
    "trap": "the processor stood in its error mode at the end",
}
PLACES = ("integer register", "float register", "control register", "code", "data", "stack")


class Flip(NamedTuple):
    """One bit, and when: between two instructions of flight, counted from the snapshot."""
    place: str                  # of PLACES
    where: str | int            # "%f3", "window 17" (word of the file of windows), or an address
    bit: int                    # 0, the lowest, to 31; of a byte of memory to 7
    instruction: int

    @property
    def text(self) -> str:
        """In words, for a file."""
        return f"0x{self.where:08x}" if isinstance(self.where, int) else self.where


class Outcome(NamedTuple):
    flip: Flip
    effect: str                 # of EFFECTS
    first: float | None         # [s] the first instant of flight with another output, or without any
    missed: int                 # instants without an answer
    resets: int                 # of the computer
    corrected: int              # errors that the EDAC corrected


class Campaign:
    """What all flights of a campaign have in common: a mission on a board, its state at the time `at`, and the flight
    from there without a flip. The flips come within `duration`; each flight goes on for `after`, in which a watchdog
    may find what has happened.

    edac: whether the RAM has check bits, and the memory controller uses them.
    """

    def __init__(self, mission: str, scenario: str | None = None, *, at: Any = 60.0, duration: Any = 60.0,
                 after: Any = 20.0, edac: bool = False, engine: str = "translator", **parameters: Any) -> None:
        self.at = time_ns(at, "flips: at")
        self.middle = self.at + time_ns(duration, "flips: duration")
        self.end = self.middle + time_ns(after, "flips: after")
        if not 0 < self.at < self.middle <= self.end:
            raise SetupError("flips: at and duration must be more than 0 s")
        self.edac = edac
        from fledge.targets.leon3.board import BOARD

        with TemporaryDirectory() as scratch:
            file = Path(scratch) / "board.toml"
            text, n = re.subn(r"(?m)^edac(\s*)= \w+",
                              rf"edac\1= {'true' if edac else 'false'}", BOARD.read_text("utf-8"))
            if n != 1:
                raise Failure(f"{BOARD}: expected one line edac = ..., found {n}")
            file.write_text(text, encoding="utf-8")
            self.board = load(mission, scenario, engine=engine, board=file, folder=scratch, **parameters)
        self.name = self.board.sim.name
        self.board.sim.run(until=self.at / 1e9, progress=False)
        if edac:
            self.board.core.enable_edac()
        self.areas = self._areas()
        self.start = self.board.snapshot()
        self.first = self.board.core.instructions
        self.nominal = self.board.in_flight.record()
        self.board.sim.run(until=self.middle / 1e9, progress=False)
        self.instructions = self.board.core.instructions - self.first
        self.board.sim.run(until=self.end / 1e9, progress=False)

    def _areas(self):
        """(name, from, to) of what the program uses of its memory."""
        place = self.board.address
        return [("code", self.board.core.entry, place("leon3_data_load")),
                ("data", place("leon3_data"), place("leon3_bss_end")),
                ("stack", place("leon3_stack_end") - 4096, place("leon3_stack_end"))]

    def flip(self, seed: int, i: int) -> Flip:
        """The i-th flip of a seed: half of them in registers, half in memory, each bit as likely as any other of its
        half, at an instruction of flight."""
        draw = random.Random(f"{seed} {i}")
        instruction = draw.randrange(self.instructions)
        if draw.random() < 0.5:
            words = [("integer register", f"%g{k}") for k in range(1, 8)]
            words += [("integer register", f"window {k}") for k in range(128)]
            words += [("float register", f"%f{k}") for k in range(32)]
            words += [("control register", f"%{k}") for k in ("y", "psr", "wim", "tbr", "pc", "npc", "fsr")]
            place, where = draw.choice(words)
            return Flip(place, where, draw.randrange(32), instruction)
        at = draw.randrange(sum(to - begin for _, begin, to in self.areas))
        for place, begin, to in self.areas:
            if at < to - begin:
                break
            at -= to - begin
        return Flip(place, begin + at, draw.randrange(8), instruction)

    def one(self, flip: Flip) -> Outcome:
        """Fly with one flip."""
        core = self.board.core
        self.board.restore(self.start)
        before = core.resets, core.corrected
        answers = self.board.in_flight.record()
        core.plan_flip(self.first + flip.instruction, flip.where, flip.bit)
        self.board.sim.run(until=self.end / 1e9, progress=False)
        first = next((t for (t, ours), (_, theirs) in zip(answers, self.nominal, strict=True) if ours != theirs), None)
        missed = [answer is None for _, answer in answers]
        resets = core.resets - before[0]
        if core.failed:
            effect = "trap"
        elif missed[-1]:
            effect = "hang"
        elif resets:
            effect = "recovered by watchdog"
        else:
            effect = "no effect" if first is None else "wrong output"
        return Outcome(flip, effect, None if first is None else first / 1e9, sum(missed), resets,
                       core.corrected - before[1])

    def fly(self, n: int, seed: int = 0, workers: int | None = None,
            progress: Callable[[int], None] = lambda done: None) -> list[Outcome]:
        """The flips 0 to n - 1 of a seed, on all processors. The outcomes do not depend on how many there are."""
        if n < 1:
            raise SetupError(f"flips: expected at least 1, found {n}")
        outcomes: list[Any] = [None] * n
        for done, (i, outcome) in enumerate(_spread(self, n, seed, workers or len(os.sched_getaffinity(0))), 1):
            outcomes[i] = outcome
            progress(done)
        return outcomes


_campaign: Any = None       # of this process' children, which begin as copies of it


def _spread(campaign, n, seed, workers) -> Iterator[tuple[int, Outcome]]:
    global _campaign
    _campaign = campaign
    if workers <= 1:
        yield from (_work((seed, i)) for i in range(n))
        return
    with ProcessPoolExecutor(min(workers, n), multiprocessing.get_context("fork"), _begin) as pool:
        waiting = [pool.submit(_work, (seed, i)) for i in range(n)]
        try:
            for one in as_completed(waiting):
                yield one.result()
        finally:
            pool.shutdown(cancel_futures=True)


def _begin():
    _campaign.board.core.renew_engine()


def _work(job):
    seed, i = job
    return i, _campaign.one(_campaign.flip(seed, i))


# --- reports ---------------------------------------------------------------------------------------

def table(outcomes: Sequence[Outcome]) -> list[str]:
    """Lines: for each place, how many flips had which effect."""
    counts = Counter((one.flip.place, one.effect) for one in outcomes)
    width = [max(len(effect), 6) for effect in EFFECTS]

    def line(name: str, cells: Sequence[Any]) -> str:
        return f"{name:16}  " + "  ".join(f"{cell:>{w}}" for cell, w in zip(cells, (*width, 6)))

    lines = [line("", [*EFFECTS, "all"])]
    for place in PLACES:
        row = [counts[place, effect] for effect in EFFECTS]
        if sum(row):
            lines.append(line(place, [*row, sum(row)]))
    total = [sum(counts[place, effect] for place in PLACES) for effect in EFFECTS]
    return [*lines, line("all", [*total, sum(total)])]


def csv(outcomes: Sequence[Outcome]) -> str:
    """One line for each flip."""
    rows = ["place,where,bit,instruction,effect,first,missed,resets,corrected"]
    rows += [f"{f.place},{f.text},{f.bit},{f.instruction},{o.effect},{'' if o.first is None else o.first},{o.missed},"
             f"{o.resets},{o.corrected}" for o in outcomes for f in (o.flip,)]
    return "\n".join([*rows, ""])


def plot(campaigns: Mapping[str, Sequence[Outcome]], title: str, path: Path) -> Path:
    """A bar for each place, with the shares of the effects; a panel for each campaign."""
    import matplotlib.style
    from matplotlib.figure import Figure

    from fledge.plot import STYLE, TITLE

    colours = dict(zip(EFFECTS, ("#c3d5e8", "#d1622b", "#5a9367", "#8c6bb1", "#a6394a")))
    with matplotlib.style.context(STYLE):
        figure = Figure(figsize=(7.2, 0.8 + 2.2 * len(campaigns)), layout="constrained")
        panels = figure.subplots(len(campaigns), 1, sharex=True, squeeze=False).flatten()
        figure.suptitle(title, **TITLE)
        for axes, (name, outcomes) in zip(panels, campaigns.items()):
            counts = Counter((one.flip.place, one.effect) for one in outcomes)
            total = {place: sum(counts[place, effect] for effect in EFFECTS) for place in PLACES}
            shown = [place for place in reversed(PLACES) if total[place]]
            left = [0.0] * len(shown)
            for effect, colour in colours.items():
                share = [100.0 * counts[place, effect] / total[place] for place in shown]
                axes.barh([f"{place} ({total[place]})" for place in shown], share, left=left, color=colour,
                          label=effect)
                left = [a + b for a, b in zip(left, share)]
            axes.set_title(name)
        panels[-1].set_xlabel("flips [%]")
        panels[0].legend(loc="lower center", bbox_to_anchor=(0.4, 1.12), ncols=len(EFFECTS), fontsize=8, frameon=False)
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path)
    return path
