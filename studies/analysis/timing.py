# SPDX-License-Identifier: Apache-2.0
"""The longest observed path of each task of flight on a board, with its inputs: by a search over scenarios, seeds and
the dispersions of a campaign.

    found = Search("mars_orbiter", ["safe", "pointing"]).search(runs=40)
    found.longest["sensing", "safe"].share      # of the task's period

Half of the runs are drawn as those of the campaign are. Each of the others begins at the longest path so far of a task,
those with the least margin first, and changes a part of its draws. Runs are independent of how many processes fly them.

The program is flight's own, but each task is a function of its own: the emulator stops where it begins and ends. A path
includes what interrupts it.
"""

from __future__ import annotations

import csv
import ctypes
import hashlib
import io
import json
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fledge import objects
from fledge.analysis.bound import Program, known
from fledge.columns import columns
from fledge.errors import Failure, RunError, SetupError
from fledge.mission.field_path import FieldPath
from fledge.montecarlo import Campaign, disperse
from fledge.pool import Died, Work, anywhere, in_order, open_pool
from fledge.profile.board import Memory
from fledge.targets import TARGETS, Job, build
from fledge.targets.leon3 import board as boards

if TYPE_CHECKING:
    from fledge.export.read import Module
    from fledge.mission.simulation import Simulation
    from fledge.targets import Part

# The compiler would put a task into its only caller.
APART = ["-fno-inline-functions-called-once", "-fno-inline-small-functions", "-fno-ipa-sra", "-fno-ipa-cp"]
TICK = "all of an instant"      # from the tick to flight's answer
BEAT = 0.1      # [s] from interrupt to interrupt of the timer: BEAT_US of targets/leon3/board.c
STEP = 0.3      # of the deviation of the draws so far: how far a local change goes


@dataclass
class Longest:
    """The longest path of a task in a mode: its time and period [s], and where it was.

    run: its index; scenario, seed; t: [s] the instant; draws: path -> number of the dispersions; inputs: path ->
    numbers of the messages that its modules read
    """
    task: str
    mode: str
    period: float
    time: float
    cycles: int
    run: int
    scenario: str
    seed: int
    t: float
    draws: dict[str, float]
    inputs: dict[str, Any] = field(default_factory=dict)
    bound: int | None = None        # [cycles] that no path exceeds; None: it was not computed, or is not known

    @property
    def share(self) -> float:
        """Of the period."""
        return self.time / self.period

    @property
    def margin(self) -> float:
        """[%] of the period that is left."""
        return 100 * (1 - self.share)


@dataclass
class Result:
    """The longest paths: (task, mode) -> Longest. stack, heap: [bytes] used at most in any run; stack_size: the whole
    stack; runs: how many were flown; died: of each run whose process died, which and how"""
    longest: dict[tuple[str, str], Longest]
    stack: int
    stack_size: int
    heap: int
    runs: int
    died: list[str] = field(default_factory=list)
    unbounded: list[str] = field(default_factory=list)      # why a task has no bound


@dataclass
class Run:
    """One of the search. index: of the campaign's draws; changed: those that are not as drawn."""
    scenario: int
    index: int
    changed: dict[str, float] = field(default_factory=dict)


# The longest ones; the stack, its size, the heap [bytes].
Paths = tuple[dict[tuple[str, str], Longest], int, int, int]


class Search(Work[Run, Paths]):
    """A mission on a board, ready for runs. Raises SetupError or Failure if it cannot fly there."""

    def __init__(self, mission: str, scenarios: Sequence[str | None] = (None,), campaign: str | None = None,
                 duration: float | None = None, seed: int = 0, process: str | None = None,
                 folder: Path | str | None = None, **parameters: Any) -> None:
        target: Any = TARGETS.ready(["leon3"], "profile")[0]
        self.target, self.seed = target, seed
        self._built: tempfile.TemporaryDirectory[str] | None = None
        self._declared = anywhere(mission), tuple(scenarios), campaign, duration, seed, process, parameters
        self.jobs = [Job(mission, scenario, duration, seed, folder=folder, parameters=parameters)
                     for scenario in scenarios]
        if process is None and len(self.jobs[0].parts) > 1:
            raise Failure(f"{self.jobs[0].title} has several flight processes; choose one with --process: "
                          + ", ".join(part.process for part in self.jobs[0].parts))
        self.parts = [job.part(process) if process else job.parts[0] for job in self.jobs]
        first = self.parts[0]
        self.folder = self.jobs[0].start.mission.folder
        self.campaign = Campaign(mission, campaign) if campaign or (
            self.jobs[0].start.mission.folder / "dispersions.py").exists() else None
        # The parameters of flight are compiled into the program.
        self.dispersed = [path for path in (self.campaign.dispersions.drawn if self.campaign else ())
                          if not path.startswith(f"{first.process}.")]
        self.fixed = set(self.campaign.dispersions.composed) if self.campaign else set()
        self.programs = [boards.program(part.folder / f"timing{i}", part.mission.name,
                                        [*part.sources(), *boards.FLIGHT], part.includes(), APART, self.target.board)
                         for i, part in enumerate(self.parts)]
        self.facts = {"program of flight": ", ".join(map(self._code, self.programs))}
        self.tables = [part.tables() for part in self.parts]
        self.clock = boards.read_board(self.target.board)["clock"]
        self.mode_at = _mode_place(first) if first.mission.modes else None

    def _code(self, program: Path) -> str:
        """A digest of the code of a program."""
        from fledge.emulator import Board

        board = Board(self.target.board, program)
        entry = board.core.entry
        return hashlib.sha256(board.peek(entry, board.address("leon3_data_load") - entry)).hexdigest()[:12]

    @property
    def recipe(self) -> tuple[Callable[..., Search], tuple[Any, ...]]:
        return Search._elsewhere, self._declared

    @classmethod
    def _elsewhere(cls, mission: str, scenarios: Sequence[str | None], campaign: str | None, duration: float | None,
                   seed: int, process: str | None, parameters: dict[str, Any]) -> Search:
        """The same on a worker, which builds the programs anew."""
        folder = tempfile.TemporaryDirectory()      # until the search is dropped
        search = cls(mission, scenarios, campaign, duration, seed, process, folder.name, **parameters)
        search._built = folder
        return search

    def fly(self, run: Run) -> Paths:
        """The longest paths of one run."""
        try:
            return self._fly(run)
        except SetupError:
            if not run.changed:
                raise
            return {}, 0, 1, 0      # the changed numbers contradict each other, as some inertias

    def _fly(self, run: Run) -> Paths:
        from fledge.emulator import Board

        part, job = self.parts[run.scenario], self.jobs[run.scenario]
        sim = job.begun()
        sim.plots = False
        if self.campaign:
            self.campaign.plan.seed = self.seed
            disperse(self.campaign.nominal, sim, self.campaign.plan, run.index)
            for path, value in run.changed.items():
                _set(sim, path, value)
        else:
            sim.seed = self.seed + run.index
        draws = {path: FieldPath(sim, path).value() for path in self.dispersed if path not in self.fixed}
        board = Board(self.target.board, self.programs[run.scenario])
        board.fly(sim, self.tables[run.scenario], part.process)
        board.in_flight.script = [(entry.t, entry.packet) for entry in part.script]
        longest = _Watch(self, part, board, run, job, draws).fly(job.duration)
        memory = Memory(board)
        low, high = map(board.address, ("leon3_stack", "leon3_stack_end"))
        return longest, memory.stack(), high - low, memory.heap()

    def bound(self, result: Result) -> None:
        """Set the bound of each task beside its longest path."""
        project = None if self.folder.is_relative_to(build.ROOT) else self.folder
        programs = [Program(program, known(project)) for program in self.programs]
        cycles: dict[str, int] = {}
        for task in self.parts[0].mission.tasks:
            try:
                cycles[task.title] = max(self._interrupted(program, program.longest(f"run_{task.name}"))
                                         for program in programs)
            except Failure as error:
                result.unbounded.append(f"{task.title}: {error}")
        for path in result.longest.values():
            path.bound = cycles.get(path.task)

    def _interrupted(self, program: Program, cycles: int) -> int:
        """[cycles] With one interrupt of a tick, and those of the timer that ends any sleep."""
        return cycles + (2 + int(cycles / self.clock / BEAT)) * program.interrupt()

    def search(self, runs: int, jobs: int | None = None, progress: Callable[[int], Any] = lambda done: None,
               scheduler: str | None = None) -> Result:
        """Fly so many runs, so many at a time, or on the workers of a Dask scheduler."""
        import numpy as np

        if runs < 1:
            raise SetupError(f"runs must be >= 1, found {runs}")
        total, random = Result({}, 0, 0, 0, 0), np.random.default_rng(self.seed)
        origin: dict[tuple[str, str], Run] = {}     # of each longest path
        free = [path for path in self.dispersed if path not in self.fixed]
        seen: dict[str, list[float]] = {path: [] for path in free}

        def local(n: int) -> Iterator[Run]:
            hardest = sorted(total.longest, key=lambda key: total.longest[key].margin)
            for k in range(n):
                key = hardest[k % len(hardest)]
                best, draws = origin[key], total.longest[key].draws
                some = map(str, random.permutation(free)[:max(1, len(free) // 2)]) if free else ()
                changed = {path: float(np.clip(draws[path] + STEP * np.std(seen[path]) * random.standard_normal(),
                                               min(seen[path]), max(seen[path]))) for path in some}
                yield Run(best.scenario, best.index if free else runs + k, {**best.changed, **changed})

        def keep(run: Run, paths: dict[tuple[str, str], Longest], stack: int, size: int, heap: int) -> None:
            total.stack, total.heap = max(total.stack, stack), max(total.heap, heap)
            total.stack_size = max(total.stack_size, size)
            for key, longest in paths.items():
                for path in free if key[0] == TICK else ():
                    seen[path].append(longest.draws[path])
                if key not in total.longest or longest.cycles > total.longest[key].cycles:
                    total.longest[key], origin[key] = longest, run

        drawn = [Run(i % len(self.jobs), i // len(self.jobs)) for i in range((runs + 1) // 2)]
        left = runs - len(drawn)
        with open_pool(jobs, scheduler) as pool:
            for batch in (lambda: drawn, lambda: list(local((left + 1) // 2)), lambda: list(local(left // 2))):
                if total.died and not total.longest:
                    raise RunError(total.died[0])
                items = batch()
                flown = pool.fly(self, items, lambda: progress(total.runs))
                with closing(flown):
                    for run, result in zip(items, in_order(flown)):
                        total.runs += 1
                        if isinstance(result, Died):
                            total.died.append(f"run {run.index} of {self.jobs[run.scenario].scenario}: {result.text}")
                        else:
                            keep(run, *result)
                progress(total.runs)
        return total


class _Watch:
    """The tasks of a flight on a board, as they begin and end."""

    def __init__(self, search: Search, part: Part, board: Any, run: Run, job: Job, draws: dict[str, float]) -> None:
        self.search, self.part, self.board, self.draws = search, part, board, draws
        self.run, self.job = run, job
        self.found: dict[tuple[str, str], Longest] = {}
        self.begins = {}
        for task in part.mission.tasks:
            names = [name for name in board.core.symbols() if name.partition(".")[0] == f"run_{task.name}"]
            if not names:
                raise Failure(f"the compiler has left no function of the task {task.title}")
            self.begins[board.address(names[0])] = task
        self.ends: dict[int, Any] = {}
        self.begun: tuple[Any, int] | None = None
        self.t = -1

    def fly(self, duration: float) -> dict[tuple[str, str], Longest]:
        """Fly for a time [s]; returns the longest path of each task in each mode."""
        board = self.board
        flight, link, period = board.in_flight, board._link, self.part.step()
        tick = flight.tick
        for place in self.begins:
            board.breakpoint(place)
        board.on_stop = self._stopped

        def counted(t: int) -> bool:
            self.t = t
            before, mode = link.cycles, self._mode() if t >= 0 else ""
            answered = tick(t)
            if t > 0:       # the first one also begins the record
                self._keep(TICK, mode, period, link.cycles - before, [])
            return answered

        flight.tick = counted
        board.sim.run(until=duration, progress=False)
        return self.found

    def _mode(self) -> str:
        if self.search.mode_at is None or not self.board._link.ticks:
            return ""
        mission = self.part.mission
        index = int.from_bytes(self.board.peek(self.board._link.mission() + self.search.mode_at, 4), "big")
        return mission.mode_titles[mission.modes[index]] if index < len(mission.modes) else ""

    def _stopped(self, reason: str) -> None:
        core = self.board.core
        registers = core.registers()
        place = registers["%pc"]
        if self.begun and self.ends.get(place) is self.begun[0]:
            task, cycles = self.begun
            self.begun = None
            self._keep(task.title, self._mode(), task.period, core.cycles - cycles, task.run)
        if place in self.begins:
            after = registers["%o7"] + 8
            if after not in self.ends:
                self.ends[after] = self.begins[place]
                self.board.breakpoint(after)
            self.begun = self.begins[place], core.cycles

    def _keep(self, task: str, mode: str, period: int, cycles: int, modules: Sequence[Module]) -> None:
        key = task, mode
        if self.t <= 0 or key in self.found and self.found[key].cycles >= cycles:
            return
        self.found[key] = Longest(
            task, mode, period / 1e9, cycles / self.search.clock, cycles, self.run.index, self.job.scenario,
            self.search.seed, self.t / 1e9, self.draws, {path: numbers for module in modules
                                                         for path, numbers in self._inputs(module.name)})

    def _inputs(self, module: str) -> Iterator[tuple[str, Any]]:
        """(path, numbers) of each field that a module has read."""
        process = self.part.process
        instance = self.board.sim.process(process).instances.get(module)
        variable = self.board.in_flight.modules._found.get(module)
        for port in objects.struct(instance).fields if instance is not None and variable is not None else ():
            if port.group == "in" and port.type == "struct":
                message = getattr(variable, port.name)
                for member in port.struct.fields:
                    if not member.spare and member.type not in ("struct", "char") and not port.shape:
                        value = getattr(message, member.name)
                        yield (f"{process}.{module}.{port.name}.{member.name}",
                               value.tolist() if hasattr(value, "tolist") else value)


def _set(sim: Simulation, path: str, value: float) -> None:
    """Set one number of a parameter, an initial state or an array."""
    import numpy as np

    target = FieldPath(sim, path)
    before = getattr(target.holder, target.field.name)
    if target.field.type.startswith("f"):
        whole, element = np.array(before, float), target.elements[0]
        whole.flat[element] = value
        if "inertia" in target.field.rule:      # symmetric: of these the upper triangle is drawn
            whole.flat[element - element % 9 + element % 3 * 3 + element % 9 // 3] = value
        setattr(target.holder, target.field.name, whole if whole.shape else float(whole))


def _mode_place(part: Part) -> int:
    """[bytes] Where the mode in force lies in the mission's memory, the same on all computers."""
    text = (f'#include "{part.mission.name}.h"\n#include <stddef.h>\n'
            f"const unsigned fledge_mode_place = offsetof({part.mission.struct()}, mode.current);\n")
    part.written     # the header
    folder = part.folder / "timing_mode"
    folder.mkdir(parents=True, exist_ok=True)
    source = (folder / "mode.c").resolve()
    source.write_text(text, encoding="utf-8")
    library = build.program(folder, "mode.so", [source], part.includes(), flags=["-fPIC"], link=["-shared"],
                            entry="fledge_mode_place")
    return int(ctypes.c_uint.in_dll(ctypes.CDLL(str(library.resolve())), "fledge_mode_place").value)


# --- reports ---------------------------------------------------------------------------------------

def text(result: Result) -> list[str]:
    """Lines: the margin of each task in each mode, the least first; then stack and heap."""
    shown = bool(result.unbounded) or any(path.bound for path in result.longest.values())
    rows = [("task", "mode", "period", "longest", *(("bound", "ratio") if shown else ()), "margin", "run", "at",
             "scenario")]
    rows += [(path.task, path.mode or "-", f"{1e3 * path.period:g} ms", f"{1e6 * path.time:,.1f} us",
              *(_bounded(path) if shown else ()), f"{path.margin:.3f} %", str(path.run), f"{path.t:g} s", path.scenario)
             for path in sorted(result.longest.values(), key=lambda path: path.margin)]
    return [*columns(rows, right={*range(2, 7 + 2 * shown)}, indent="  "),
            f"  stack    {result.stack:,} of {result.stack_size:,} bytes were used, "
            f"{100 * (1 - result.stack / result.stack_size):.1f} % are left",
            f"  heap     {result.heap:,} bytes", *(f"  died     {run}" for run in result.died),
            *(f"  no bound {reason}" for reason in result.unbounded)]


def _bounded(path: Longest) -> tuple[str, str]:
    if path.bound is None:
        return "-", "-"
    return f"{1e6 * path.time * path.bound / path.cycles:,.1f} us", f"{path.bound / path.cycles:.2f}"


def as_csv(result: Result) -> str:
    """A line for each task and mode."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["task", "mode", "period [s]", "longest [s]", "longest [cycles]", "bound [cycles]", "margin [%]",
                     "scenario", "seed", "run", "at [s]"])
    for path in result.longest.values():
        writer.writerow([path.task, path.mode, path.period, repr(path.time), path.cycles, path.bound,
                         f"{path.margin:.6f}",
                         path.scenario, path.seed, path.run, path.t])
    return out.getvalue()


def as_json(result: Result) -> str:
    """The same with the draws and inputs of each."""
    from dataclasses import asdict

    return json.dumps({"runs": result.runs, "stack": result.stack, "stack_size": result.stack_size, "heap": result.heap,
                       "unbounded": result.unbounded,
                       "longest": [{**asdict(path), "margin": path.margin} for path in result.longest.values()]},
                      indent=1) + "\n"
