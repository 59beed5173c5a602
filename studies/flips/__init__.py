# SPDX-License-Identifier: Apache-2.0
"""Campaigns of bit flips: in the closed loop, in the middle of a manoeuvre, bits of the registers and the memory of a
flight computer are inverted, each in a flight of its own from one snapshot. The outcomes are classified and measured.

Example:

    from fledge.emulator.flips import Campaign
    from fledge.units import s

    campaign = Campaign("nadir_spin", at=30 * s, duration=30 * s)
    outcomes = campaign.fly(1000, seed=1)
"""
from __future__ import annotations

import hashlib
import math
import random
import re
from bisect import bisect_right
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from itertools import accumulate
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, NamedTuple

from fledge import objects
from fledge.columns import columns
from fledge.emulator.board import load
from fledge.errors import Failure, RunError, SetupError
from fledge.mission.field_path import port
from fledge.montecarlo.campaign import declare
from fledge.montecarlo.report import confidence
from fledge.objects.measured import unit_after
from fledge.objects.si import time_ns
from fledge.pool import Died, Work, anywhere, open_pool

if TYPE_CHECKING:
    import numpy as np

EFFECTS = {
    "no effect": "all that flight wrote into its registers is the same, at all instants",
    "wrong output": "some of it was another; flight went on",
    "recovered by watchdog": "the computer was reset, and flight went on",
    "hang": "flight no longer answered at the end",
    "trap": "the processor stood in its error mode at the end",
}
PLACES = ("integer register", "float register", "control register", "code", "data", "stack")


class Flip(NamedTuple):
    """One bit, or several, and when: between two instructions of flight, counted from the snapshot, or at a time."""
    place: str                  # of PLACES
    where: str | int            # "%f3", "window 17" (word of the file of windows), or an address
    bit: int                    # 0, the lowest, to 31; of a byte of memory to 7
    instruction: int | None = None
    time: int | None = None     # [ns] of the simulation
    bits: int = 1               # so many from `bit` upwards, all in one word

    @property
    def text(self) -> str:
        """In words, for a file."""
        return f"0x{self.where:08x}" if isinstance(self.where, int) else self.where

    @property
    def single(self) -> list[tuple[str | int, int]]:
        """(register or address of a byte, bit) of each bit."""
        if isinstance(self.where, str):
            return [(self.where, self.bit + i) for i in range(self.bits)]
        first = 8 * (3 - self.where % 4) + self.bit     # in the word, which is big-endian
        return [(self.where - self.where % 4 + 3 - k // 8, k % 8) for k in range(first, first + self.bits)]


class Measure(NamedTuple):
    """A recorded field: an outcome has its largest distance from the flight without a flip."""
    path: str
    unit: str                   # "deg" of an attitude: the angle between both


class Outcome(NamedTuple):
    flip: Flip
    effect: str                 # of EFFECTS
    first: float | None         # [s] the first instant of flight with another output, or without any
    missed: int                 # instants without an answer
    resets: int                 # of the computer
    corrected: int              # errors that the EDAC corrected
    deviations: tuple[float, ...]   # for each Measure of the campaign, at any instant; inf: it was no number


class Campaign:
    """What all flights of a campaign have in common: a mission on a board, its state at the time `at`, and the flight
    from there without a flip. The flips come within `duration`; each flight goes on for `after`, in which a watchdog
    may find what has happened.

    edac: whether the RAM has check bits, and the memory controller uses them.
    bits: how many bits, side by side in one word, each flip inverts.
    rates: flips per bit and day, of registers and of memory. Then flips come at any time, as they do in space, where a
    computer may sleep most of it. None: each bit of both is as likely, at any instruction.
    """

    def __init__(self, mission: str, scenario: str | None = None, *, at: Any = 60.0, duration: Any = 60.0,
                 after: Any = 20.0, edac: bool = False, bits: int = 1, rates: Sequence[float] | None = None,
                 engine: str = "translator", **parameters: Any) -> None:
        self.at = time_ns(at, "flips: at")
        self.middle = self.at + time_ns(duration, "flips: duration")
        self.end = self.middle + time_ns(after, "flips: after")
        if not 0 < self.at < self.middle <= self.end:
            raise SetupError("flips: at and duration must be more than 0 s")
        if not 1 <= bits <= 32:
            raise SetupError(f"flips: a flip inverts 1 to 32 bits of a word; found {bits}")
        if rates and not (len(rates) == 2 and all(0 <= rate < math.inf for rate in rates) and any(rates)):
            raise SetupError("flips: expected the rates of registers and of memory, in flips per bit and day, both at "
                             f"least 0 and one more; found {', '.join(map(str, rates))}")
        self.edac, self.bits, self.rates = edac, bits, rates
        # What makes the same campaign elsewhere.
        self.given = anywhere(mission), scenario, {
            "at": at, "duration": duration, "after": after, "edac": edac, "bits": bits, "rates": rates,
            "engine": engine, **parameters}
        self.died: list[str] = []       # of each flip of fly() whose process died, which and how
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
        self.measures = self._record(mission, parameters)
        self.board.sim.run(until=self.at / 1e9)
        if edac:
            self.board.core.enable_edac()
        self.survey()
        entry = self.board.core.entry
        code = self.board.peek(entry, self.board.address("leon3_data_load") - entry)
        self.program = hashlib.sha256(code).hexdigest()[:12]
        self.start = self.board.snapshot()
        self.first, self.epoch = self.board.core.instructions, self.board._link.epoch
        self.nominal = self.board.in_flight.record()
        self.board.sim.run(until=self.middle / 1e9)
        self.instructions = self.board.core.instructions - self.first
        self.board.sim.run(until=self.end / 1e9)
        self.undisturbed = self._values()

    def _record(self, mission: str, parameters: dict[str, Any]) -> list[Measure]:
        """Record the fields of an outcome: the attitude of each spacecraft, those that the mission's campaign retains
        and requires, and all numbers that leave the computer. Returns their Measures."""
        sim = self.board.sim
        paths = [f"{process.name}.{name}.state.sigma_BN" for process in sim.processes
                 for name, instance in process.instances.items() if objects.struct(instance).name == "Spacecraft"]
        if (sim.mission.folder / "dispersions.py").exists():
            paths += [variable.field_path.recorded for variable in declare(mission, None, parameters)[1].shown]
        carried = [objects.path(view) for _, view in self.board.in_flight.carried]
        ports = dict.fromkeys([*(".".join(path.split(".")[:3]) for path in paths), *carried])
        self.log = sim.record(*(port(sim, path) for path in ports))
        numbers = [name for name in self.log.names if self.log.field(name).type != "char"]
        paths += [name for name in numbers if ".".join(name.split(".")[:3]) in carried]
        return [Measure(path, "deg" if _is_attitude(path) else self.log.field(path).unit)
                for path in dict.fromkeys(paths)]

    def survey(self) -> None:
        """Find where a flip may begin."""
        self.registers, self.areas = self._registers(), self._areas()
        self.ends = list(accumulate(len(starts) for *_, starts in self.registers))
        self.n_registers = self.ends[-1]
        self.n_memory = sum(n for *_, n in self.areas)

    def _values(self) -> list[np.ndarray]:
        return [self.log[measure.path][self.log.time_of(measure.path) >= self.at / 1e9].astype(float)
                for measure in self.measures]

    def _registers(self) -> list[tuple[str, str, list[int]]]:
        """(place, name, the lowest bits that a flip may begin at) of each register: of the bits that exist."""
        words = [("integer register", f"%g{k}") for k in range(1, 8)]
        words += [("integer register", f"window {k}") for k in range(128)]
        words += [("float register", f"%f{k}") for k in range(32)]
        words += [("control register", f"%{k}") for k in ("y", "psr", "wim", "tbr", "pc", "npc", "fsr")]
        registers = []
        for place, name in words:
            bits = {bit for bit in range(32) if place != "control register" or self._exists(name, bit)}
            registers.append((place, name, [bit for bit in sorted(bits)
                                            if bits.issuperset(range(bit, bit + self.bits))]))
        return registers

    def _exists(self, register: str, bit: int) -> bool:
        """Whether a bit of a register is more than a constant."""
        core = self.board.core
        before = core.registers()[register]
        core.flip(register, bit)
        differs = core.registers()[register] != before
        core.set_register(register, before)
        return differs

    def _areas(self) -> list[tuple[str, int, int]]:
        """(place, address, the number of bits at which a flip may begin) of each area of the program's memory."""
        place = self.board.address
        return [(name, begin, (to - begin) // 4 * (33 - self.bits)) for name, begin, to in (
            ("code", self.board.core.entry, place("leon3_data_load")),
            ("data", place("leon3_data"), place("leon3_bss_end")),
            ("stack", place("leon3_stack_end") - 4096, place("leon3_stack_end")))]

    @property
    def per_day(self) -> float | None:
        """Flips per day in all that is drawn from, by the rates."""
        if not self.rates:
            return None
        return self.n_registers * self.rates[0] + self.n_memory * self.rates[1]

    def flip(self, seed: int, i: int) -> Flip:
        """The i-th flip of a seed."""
        draw = random.Random(f"{seed} {i}")
        instruction = time = None
        if self.rates:
            time = draw.randrange(self.at, self.middle)
        else:
            instruction = draw.randrange(self.instructions)
        of_registers, of_memory = self.rates or (1.0, 1.0)
        share = self.n_registers * of_registers / (self.n_registers * of_registers + self.n_memory * of_memory)
        if draw.random() < share:
            at = draw.randrange(self.n_registers)
            k = bisect_right(self.ends, at)
            place, name, starts = self.registers[k]
            return Flip(place, name, starts[at - self.ends[k]], instruction, time, self.bits)   # counted from its end
        at = draw.randrange(self.n_memory)
        for place, begin, n in self.areas:
            if at < n:
                break
            at -= n
        word, bit = divmod(at, 33 - self.bits)
        return Flip(place, begin + 4 * word + 3 - bit // 8, bit % 8, instruction, time, self.bits)

    def outcome(self, flip: Flip) -> Outcome:
        """Fly with one flip."""
        core = self.board.core
        self.board.restore(self.start)
        before = core.resets, core.corrected
        answers = self.board.in_flight.record()
        core.plan_flip(None if flip.instruction is None else self.first + flip.instruction,
                       None if flip.time is None else self.epoch + flip.time, flip.single)
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
                       core.corrected - before[1],
                       tuple(map(deviation, self.measures, self._values(), self.undisturbed)))

    def fly(self, n: int, seed: int = 0, workers: int | None = None,
            progress: Callable[[int], None] = lambda done: None, scheduler: str | None = None) -> list[Outcome]:
        """The flips 0 to n - 1 of a seed, on all processors, or on the workers of a Dask scheduler. The outcomes do not
        depend on how many there are. A flip whose process died has none: `died` has which, and how."""
        if n < 1:
            raise SetupError(f"flips: expected at least 1, found {n}")
        outcomes: dict[int, Outcome] = {}
        died: dict[int, str] = {}
        with open_pool(workers, scheduler) as pool:
            flown = pool.fly(_Flips(self, seed), range(n), lambda: progress(len(outcomes) + len(died)))
            with closing(flown):
                for i, outcome in flown:
                    if isinstance(outcome, Died):
                        flip = self.flip(seed, i)
                        died[i] = f"flip {i}, {flip.place} {flip.text}, bit {flip.bit}: {outcome.text}"
                    else:
                        outcomes[i] = outcome
        progress(n)
        self.died = [died[i] for i in sorted(died)]
        if not outcomes:
            raise RunError(self.died[0])
        return [outcomes[i] for i in sorted(outcomes)]


class _Flips(Work[int, Outcome]):
    """The flips of a seed as the work of a pool."""

    def __init__(self, campaign: Campaign, seed: int) -> None:
        self.campaign, self.seed = campaign, seed
        assert campaign.board.sim.mission
        self.folder = campaign.board.sim.mission.folder
        self.facts = {"program of flight": campaign.program}

    @property
    def recipe(self) -> tuple[Callable[..., _Flips], tuple[Any, ...]]:
        return _Flips.made, (self.seed, *self.campaign.given)

    @classmethod
    def made(cls, seed: int, mission: str, scenario: str | None, options: dict[str, Any]) -> _Flips:
        return cls(Campaign(mission, scenario, **options), seed)

    def begin(self) -> None:
        self.campaign.board.core.renew_engine()

    def fly(self, item: int) -> Outcome:
        return self.campaign.outcome(self.campaign.flip(self.seed, item))


def _is_attitude(path: str) -> bool:
    return re.fullmatch(r"sigma_[A-Z]\w*", path.rpartition(".")[2]) is not None


def deviation(measure: Measure, values: np.ndarray, undisturbed: np.ndarray) -> float:
    """How far samples of a field, (n, ...), are at most from those of another flight, in the unit of the Measure."""
    import numpy as np

    from fledge import attitude

    same = (values == undisturbed) | np.isnan(values) & np.isnan(undisturbed)
    if same.all():
        return 0.0
    with np.errstate(all="ignore"):
        if _is_attitude(measure.path):
            apart = np.degrees(attitude.angle(attitude.relative(values, undisturbed)))
            apart = np.where(same.all(axis=-1), 0.0, apart)
        else:
            apart = np.where(same, 0.0, np.abs(values - undisturbed))
    return float(np.where(np.isfinite(apart), apart, np.inf).max())


# --- reports ---------------------------------------------------------------------------------------

def table(outcomes: Sequence[Outcome]) -> list[str]:
    """Lines: for each place, how many flips had which effect."""
    counts = Counter((outcome.flip.place, outcome.effect) for outcome in outcomes)
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


def shares(outcomes: Sequence[Outcome], per_day: float | None = None) -> list[str]:
    """Lines: of each effect its share, with the interval that holds the true one with 95 % confidence, and how many of
    it a day brings. per_day: flips, of Campaign."""
    counts = Counter(outcome.effect for outcome in outcomes)
    rows: list[tuple[str, ...]] = [("", "%", "95 % confidence", *(["per day", "95 % confidence"] if per_day else []))]
    for effect in EFFECTS:
        bounds = confidence(counts[effect], len(outcomes))
        row = [effect]
        for scale, form in [(100.0, ".1f")] + ([(per_day, ".2g")] if per_day else []):
            row += [f"{scale * counts[effect] / len(outcomes):{form}}",
                    " to ".join(f"{scale * bound:{form}}" for bound in bounds)]
        rows.append(tuple(row))
    return columns(rows, range(1, 5))


def severity(outcomes: Sequence[Outcome], measures: Sequence[Measure]) -> list[str]:
    """Lines: how far each measure was at most from that of the flight without a flip: the median, the 95th percentile
    and the most of all outcomes with an effect."""
    import numpy as np

    lines = []
    for effect in list(EFFECTS)[1:]:
        deviations = np.array([outcome.deviations for outcome in outcomes if outcome.effect == effect])
        if len(deviations):
            rows: list[tuple[str, ...]] = [(f"{effect} ({len(deviations)})", "median", "95 %", "most", "")]
            ranks = [math.ceil(p * len(deviations)) - 1 for p in (0.5, 0.95, 1.0)]
            rows += [(f"  {measure.path}", *(f"{x:.3g}" for x in np.sort(column)[ranks]),
                      unit_after(measure.unit).strip())
                     for measure, column in zip(measures, deviations.T)]
            lines += columns(rows, range(1, 4))
    return lines


def csv(outcomes: Sequence[Outcome], measures: Sequence[Measure]) -> str:
    """One line for each flip."""
    rows = ["place,where,bit,bits,instruction,time,effect,first,missed,resets,corrected,"
            + ",".join(f"{measure.path} [{measure.unit}]" for measure in measures)]
    for o in outcomes:
        f = o.flip
        cells = (f.place, f.text, f.bit, f.bits, f.instruction, None if f.time is None else f.time / 1e9, o.effect,
                 o.first, o.missed, o.resets, o.corrected, *(f"{x:.6g}" for x in o.deviations))
        rows.append(",".join("" if cell is None else str(cell) for cell in cells))
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
            counts = Counter((outcome.flip.place, outcome.effect) for outcome in outcomes)
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
