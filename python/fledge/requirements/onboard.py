# SPDX-License-Identifier: Apache-2.0
"""Requirements that fly: formulas compiled to the tables of flight/services/requirement_monitor.h.

Example: preset.py of a mission whose flight.py has `f.judge = fsw.RequirementMonitor()`

    from fledge.requirements import fly

    def preset(sim):
        fly(sim, "PNT-1", "PNT-2")

A formula of margins at each sample becomes operations in postfix order. Times become numbers of samples: a window of
`last` later samples is known last + 1 samples later, when a sample shows that it is whole, as the simulation's judge
has it (sim/temporal.cpp); operands that are known earlier are delayed.
"""
from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from fledge import _core
from fledge.commands.protocol import NUMBERS
from fledge.errors import SetupError
from fledge.requirements.declared import Requirement, Requirements
from fledge.requirements.formula import Comparison, Formula, Node, Signal, time_text
from fledge.requirements.judge import unit_of
from fledge.units import ns

if TYPE_CHECKING:
    from fledge.commands.dictionary import Dictionary
    from fledge.mission.process import Process
    from fledge.mission.simulation import Simulation

MONITOR = "RequirementMonitor"
REQUIREMENTS, NODES, MEMORY, NUMBERS_MOST, VALUES, VECTOR = 8, 128, 4096, 64, 16, 16     # as the headers have them
NO_END = 2**32 - 1
_RELATIONS = ["<", "<=", ">", ">=", "==", "!="]
_WINDOWS = ("always", "eventually", "until")

Row = dict[str, Any]        # the fields of a FormulaNode that are not 0


def fly(simulation: Simulation, *requirements: str | Requirement) -> None:
    """Let these requirements, by their ids or themselves, be judged on board too, by the mission's RequirementMonitor,
    in this order; before the first run. Raises SetupError for what flight cannot judge."""
    path, monitor, process = _monitor(simulation)
    if simulation.time_ns >= 0:
        raise SetupError("fly: before the first run, as in preset.py")
    if len(requirements) > REQUIREMENTS:
        raise SetupError(f"fly: {MONITOR} judges up to {REQUIREMENTS} requirements; found {len(requirements)}")
    nodes: list[Row] = []
    memory = 0
    known = Requirements(simulation)
    for row in monitor.requirements:
        row.on = 0
    for row, given in zip(monitor.requirements, requirements):
        requirement = known.of(given) if isinstance(given, str) else given
        compiled = Compiled(requirement, process, path, memory)
        if len(requirement.id.encode()) > 15:
            raise SetupError(f"{requirement.place}: {requirement.id}: on board an id has up to 15 bytes")
        row.id, row.every, row.first = requirement.id, requirement.every * ns, len(nodes)
        row.n, row.on = len(compiled.rows), 1
        nodes, memory = nodes + compiled.rows, compiled.memory
        if len(nodes) > NODES:
            raise SetupError(f"{requirement.place}: up to {requirement.id} flight needs {len(nodes)} operations, and "
                             f"{MONITOR} has {NODES}: fly fewer requirements, or shorter formulas")
    for place, node in enumerate(nodes):
        for name, value in node.items():
            setattr(monitor.nodes[place], name, value * ns if name == "time" else value)


def flyable(simulation: Simulation) -> Iterator[tuple[Requirement, Compiled | None, str]]:
    """Of each of its requirements the operations on board, or why it cannot fly; also of a mission without a monitor,
    whose first flight software would have one in its fastest task."""
    try:
        path, _, process = _monitor(simulation)
    except SetupError:
        path, process = "", simulation.flights[0]
    for requirement in Requirements(simulation).all:
        try:
            yield requirement, Compiled(requirement, process, path), ""
        except SetupError as error:
            yield requirement, None, str(error).partition(f" {requirement.id} ")[2]


def _monitor(simulation: Simulation) -> tuple[str, Any, Process]:
    for process in simulation.processes:
        for name, instance in process.instances.items():
            if getattr(instance, "requirements", None) is not None and _core.struct(instance).name == MONITOR:
                return f"{process.name}.{name}", instance, process
    raise SetupError(f"no flight software has a {MONITOR}: compose one in flight.py, as in "
                     f"f.judge = fsw.{MONITOR}(), and put it into a task")


class Compiled:
    """The operations of a requirement. rows: of them; memory: [numbers] up to which all have what they remember"""

    def __init__(self, requirement: Requirement, process: Process, path: str, memory: int = 0) -> None:
        self.requirement, self._process, self._path, self.memory = requirement, process, path, memory
        self.rows: list[Row] = []
        self._dictionary: Dictionary = process.commands.dictionary
        formula = requirement.formula
        if formula is None:
            raise self._refused(f"is shown by {requirement.method}, and has no formula to fly")
        self._check_instants()
        self._mixed = unit_of(formula) is None
        self._numbers = self._numbers_most = self._margins = 0
        self._front(formula)
        if self._numbers_most > NUMBERS_MOST:
            raise self._refused(f"has {self._numbers_most} numbers that wait for their operation, and flight has room "
                                f"for {NUMBERS_MOST}: compare fewer at once")

    def _refused(self, text: str) -> SetupError:
        return SetupError(f"{self.requirement.place}: {self.requirement.id} {text}")

    def _check_instants(self) -> None:
        """Refuse samples at which flight has no instant."""
        every, monitor = self.requirement.every, self._path.partition(".")[2]
        moded = {task for _, tasks in self._process.modes for task in tasks}
        periods = [task.period for task in self._process.tasks
                   if (monitor in task.run or not monitor) and task.name not in moded and not task.offset]
        if not periods:
            raise self._refused(f"needs {self._path or MONITOR} in a task without offset that is in no mode's list")
        if every <= 0 or not any(every % period == 0 for period in periods):
            raise self._refused("is judged at " + ("each instant of the simulation" if not every else
                                                   f"each {time_text(every)}")
                                + f", and flight judges each {time_text(min(periods))}: let r.every be that or a "
                                "multiple")

    # --- margins ---

    def _front(self, formula: Formula) -> None:
        """A part of which only the value at the first sample counts: by what has come so far."""
        kind = formula.kind
        if not any(part.kind in _WINDOWS for part in formula.walk()):
            self._margin(formula)
            self._remember("FIRST", 2)
        elif (settled := self._settled(formula)) is not None:
            self._front(settled)
        elif kind in ("once", "begins"):        # no sample comes before
            self._front(formula.operands[0])
        elif kind not in _WINDOWS:
            for operand in formula.operands:
                self._front(operand)
            self._add(kind.upper(), margins=1 - len(formula.operands))
        else:
            delay = self._operands(formula)
            window = {"first": -(-formula.begin // self.requirement.every), "delay": delay,
                      "last": NO_END if formula.end is None else formula.end // self.requirement.every}
            self._window(formula, "SO_FAR", 4 if kind == "until" else 2, window)

    def _settled(self, formula: Formula) -> Formula | None:
        """Of eventually_[a,b] always f, and of always_[a,b] eventually f: the inner one from the last sample of the
        window on, whose margin is the largest, or the least, of them. None of others."""
        every, inner = self.requirement.every, formula.operands[0]
        if {formula.kind, inner.kind} != {"always", "eventually"} or formula.end is None or inner.end is not None:
            return None
        last = formula.end // every
        if last < -(-formula.begin // every):
            return None
        return Node(inner.kind, inner.operands, str(formula), formula.mathematics, last * every + inner.begin)

    def _margin(self, formula: Formula) -> int:
        """A part of which each sample's value counts. Returns by how many samples it is late."""
        kind, every = formula.kind, self.requirement.every
        if isinstance(formula, Comparison):
            self._signal(formula.signal)
            self._pop(1)
            self._add("COMPARE", margins=1, number=formula.limit, first=_RELATIONS.index(formula.relation),
                      scale=abs(formula.limit) or 1.0 if self._mixed and formula.measured else 1.0)
            return 0
        if kind == "clock":
            self._add("CLOCK", margins=1, time=formula.begin)
            return 0
        if kind in _WINDOWS:
            if formula.end is None:
                raise self._refused(f"needs the future without a bound, by '{formula}': give that window an end")
            first, last = -(-formula.begin // every), formula.end // every
            if first > last:
                raise self._refused(f"has a window without a sample, '{formula}': r.every is {time_text(every)}")
            delay = self._operands(formula)
            self._window(formula, "", 4 * (last - first + 1), {"last": last - first + 1, "delay": delay})
            return delay + last + 1
        delay = self._operands(formula)
        if kind in ("once", "begins"):
            self._remember(kind.upper(), 2, delay=delay)
        else:
            self._add(kind.upper(), margins=1 - len(formula.operands))
        return delay

    def _operands(self, formula: Formula) -> int:
        """The operands, all as late as the latest of them."""
        places = []
        for operand in formula.operands:
            delay = self._margin(operand)
            places.append((len(self.rows), delay))
        latest = max(delay for _, delay in places)
        for place, delay in reversed(places):
            if delay < latest:
                self._remember("DELAY", 2 * (latest - delay), place, last=latest - delay)
        return latest

    def _window(self, formula: Formula, so_far: str, memory: int, window: Row) -> None:
        """always, until, or eventually: not always not."""
        end = "_" + so_far if so_far else ""
        if formula.kind == "until":
            self._remember(f"UNTIL{end}", memory, margins=-1, **window)
            return
        turned = formula.kind == "eventually"
        if turned:
            self._add("NOT")
        self._remember(f"ALWAYS{end}", memory, **window)
        if turned:
            self._add("NOT")

    def _remember(self, operation: str, memory: int, at: int | None = None, margins: int = 0, **row: Any) -> None:
        if self.memory + memory > MEMORY:
            raise self._refused(f"remembers {self.memory + memory} numbers, with those flown before it, of {MEMORY} on "
                                f"board, for samples each {time_text(self.requirement.every)}: let r.every be longer, "
                                "or windows shorter")
        row = {"place": self.memory, **row}
        self.memory += memory
        if at is None:
            self._add(operation, margins, **row)
        else:
            self.rows.insert(at, {"operation": f"FORMULA_{operation}", **row})

    def _add(self, operation: str, margins: int = 0, **row: Any) -> None:
        self._margins += margins
        if self._margins > VALUES:
            raise self._refused(f"has more than {VALUES} parts that wait for others: write fewer in a row")
        self.rows.append({"operation": f"FORMULA_{operation}", **row})

    # --- numbers ---

    def _signal(self, signal: Signal) -> None:
        n = math.prod(signal.operands[0].shape if signal.operands else signal.shape)
        if n > VECTOR:
            raise self._refused(f"reads {n} numbers at once, '{signal.text}': flight computes with up to {VECTOR}")
        if signal.operation == "source":
            self._read(signal, n)
        elif signal.operation == "constant":
            for number in signal.numbers:
                self._push(1)
                self._add("CONSTANT", number=number)
        elif signal.event:
            event = "the event " * (signal.event[1] == "event")
            raise self._refused(f"reads {event}{signal.text}, and flight judges numbers of its outputs only")
        else:
            for operand in signal.operands:
                self._signal(operand)
            self._pop(sum(math.prod(operand.shape) for operand in signal.operands))
            self._push(math.prod(signal.shape))
            self._add(_OPERATIONS[signal.operation], n=n, number=signal.number,
                      first=max(signal.place, 0))

    def _read(self, signal: Signal, n: int) -> None:
        field = signal.field
        assert field is not None
        own = field.path.partition(".")[0] == self._process.name
        if field.of_mode and own:
            self._push(1)
            self._add("MODE")
            return
        if not own or field.group != "out":
            raise self._refused(f"reads {field.path}, which is no output of {self._process.name}: flight judges what "
                                "its own outputs say")
        place = next(i for i, output in enumerate(self._dictionary.outputs) if output.path == field.port)
        self._push(n)
        self._add("READ", output=place, offset=field.offset + field.width * field.elements[0],
                  type=NUMBERS.index(field.stored.type), n=n, first=int(field.has_quality))

    def _push(self, n: int) -> None:
        self._numbers += n
        self._numbers_most = max(self._numbers_most, self._numbers)

    def _pop(self, n: int) -> None:
        self._numbers -= n


_OPERATIONS = {"element": "ELEMENT", "norm": "NORM", "max_abs": "MAX_ABS", "abs": "MAGNITUDE", "+": "SUM",
               "-": "DIFFERENCE", "scaled": "SCALED", "angle": "ANGLE", "turned": "TURNED"}
