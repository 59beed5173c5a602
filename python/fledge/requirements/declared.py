# SPDX-License-Identifier: Apache-2.0
"""The requirements that a mission declares in its requirements.py."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from fledge.errors import SetupError, did_you_mean, listed, refuse_misspelt, suggesting
from fledge.disk import shown
from fledge.mission.field_path import FieldPath
from fledge.mission.folder import MissionFiles, functions_of
from fledge.objects.si import time_ns
from fledge.objects.wires import caller
from fledge.requirements.formula import Comparison, Formula, Signal, time_text
from fledge.requirements.judge import BECOMES, CODES, Judged, Outcome
from fledge.requirements.telemetered import Sent

if TYPE_CHECKING:
    from fledge.mission.simulation import Simulation
    from fledge.records.series import Records

METHODS = ("test", "analysis", "inspection", "demonstration")


@dataclass
class Requirement:
    """id; text: what shall be, in words; formula: of the method "test"; shown_by: the scenarios that show it;
    evidence: where to find the proof, of other methods; group: the title of its function; file, line: where it is."""
    id: str
    text: str
    formula: Formula | None = None
    method: str = "test"
    rationale: str = ""
    parent: str = ""
    evidence: str = ""
    shown_by: tuple[str, ...] = ()
    group: str = ""
    file: str = ""
    line: int = 0
    every: int = field(default=0, repr=False)   # [ns] between two samples; 0: each instant
    skew: str = field(default="", repr=False)   # what a comparison joins that is not of one time, and the remedy

    @property
    def place(self) -> str:
        """ "requirements.py, line 12" """
        return f"{self.file}, line {self.line}"


@suggesting()
class Declaration:
    """What a function of requirements.py fills: `r`."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._every = 0
        self._group = ""
        self._found: dict[str, Requirement] = {}

    def __setattr__(self, name: str, value: Any) -> None:
        refuse_misspelt(self, name, ("every",))
        object.__setattr__(self, name, value)

    @property
    def every(self) -> float:
        """[s] Between two samples of the signals, of the requirements that follow; 0: at each instant."""
        return self._every / 1e9

    @every.setter
    def every(self, value: Any) -> None:
        self._every = time_ns(value, "r.every")
        if self._every < 0:
            raise SetupError(f"r.every must be >= 0, found {value!r}")

    def signal(self, path: str) -> Signal:
        """The numbers of a field of an input or output: `r.signal("flight.tracking.error.sigma_BR")`."""
        return signal(self._simulation, path)

    def mode(self, process: str = "flight") -> Signal:
        """The mode of a process, to be compared with the name of one: `r.mode() == "SAFE"`."""
        return signal(self._simulation, f"{process}.mode")

    def event(self, process: str, name: str) -> Formula:
        """True at a sample up to which this event of a process has fired since the sample before."""
        known = self._simulation.process(process).events
        if name not in known:
            raise SetupError(f"r.event: {process} has no event '{name}'{did_you_mean(name, known)} it has "
                             + listed(list(known)))
        text = f"{process}.{name}"
        return Comparison(Signal("event", text=text, event=(process, "event", name)), "==", 1.0, f"{text} fires")

    def command(self, process: str, name: str = "", became: str = "executed") -> Formula:
        """True at a sample up to which a command has become so since the sample before: "executed", "accepted" or
        "refused". name: its function, as "mode" or "write"; "": of any."""
        flight = self._simulation.process(process)
        if not hasattr(type(flight), "commands"):
            raise SetupError(f"r.command: {process} is no process of flight, and only these have commands")
        for what, found, known in (("command", name, ["", *CODES]), ("such state", became, BECOMES)):
            if found not in known:
                raise SetupError(f"r.command: there is no {what} '{found}'{did_you_mean(found, known)} there are "
                                 + listed([text for text in known if text]))
        text = f"a command{name and f' {name}'} of {process}"
        return Comparison(Signal("event", text=text, event=(process, "command", name, became)), "==", 1.0,
                          f"{text} is {became}")

    def packet(self, process: str, name: str) -> Formula:
        """True at a sample up to which a packet of telemetry was sent since the sample before. name: of the dictionary:
        the path of an output, "housekeeping", "reports", "texts", "events", ..."""
        return Sent(self._simulation, "r.packet", process).packet(name)

    def telemetry(self, process: str, path: str) -> Signal:
        """Numbers of the newest packet, as the ground has them: `r.telemetry("flight", "housekeeping.mode")`, or the
        path of a field of an output. Before the first packet they are unknown."""
        return Sent(self._simulation, "r.telemetry", process).number(path)

    def require(self, id: str, text: str, formula: Formula | None = None, *, method: str = "test", rationale: str = "",
                parent: str = "", evidence: str = "", shown_by: str | Iterable[str] = ()) -> None:
        """Declare a requirement; see Requirement. shown_by: scenarios; none: all. Raises SetupError."""
        file, line = caller()
        requirement = Requirement(str(id), str(text), formula, method, rationale, parent, evidence,
                                  (shown_by,) if isinstance(shown_by, str) else tuple(shown_by), self._group,
                                  str(shown(file)), line, self._every)
        name = requirement.id
        if not name or any(sign.isspace() or not sign.isprintable() or sign in "/\\," for sign in name):
            raise SetupError(f"r.require({id!r}): an id has no spaces, commas and slashes")
        if name in self._found:
            raise SetupError(f"r.require: two requirements have the id {name}; the other one is in "
                             f"{self._found[name].place}")
        if method not in METHODS:
            raise SetupError(f"{name}: there is no method '{method}'{did_you_mean(method, METHODS)} there are "
                             + listed(METHODS))
        if isinstance(formula, Signal) or not isinstance(formula, (Formula, type(None))):
            raise SetupError(f"{name}: expected a formula, such as always(error < 1 * deg); found {formula!r}")
        if (formula is None) == (method == "test"):
            raise SetupError(f"{name}: a requirement that is shown by test needs a formula, and others have none")
        known = self._simulation.mission.scenarios if self._simulation.mission else {}
        for scenario in requirement.shown_by:
            if scenario not in known:
                raise SetupError(f"{name}: the mission has no scenario '{scenario}'{did_you_mean(scenario, known)} "
                                 f"it has {listed(list(known))}")
        requirement.skew = _skew(self._simulation, formula, self._every) if formula is not None else ""
        self._found[name] = requirement


def _skew(simulation: Simulation, formula: Formula, every: int) -> str:
    """Which outputs of different rates a comparison joins at instants at which only the faster one is new; "" if
    none."""
    for comparison in formula.comparisons:
        periods: dict[str, int] = {}    # [ns] by port
        for path in comparison.signal.fields:
            if path.port is not None and path.group == "out" and not path.of_mode:
                process, instance, _ = path.port.split(".", 2)
                own = [task.period for task in simulation.process(process).tasks if instance in task.run]
                periods |= {path.port: min(own)} if own else {}
        if not periods:
            continue
        (fast, least), (slow, most) = (choose(periods.items(), key=lambda item: item[1]) for choose in (min, max))
        if least < most and (every == 0 or every % most):
            return (f"it joins {slow}, written every {most / 1e9:g} s, with {fast}, every {least / 1e9:g} s: at some "
                    f"samples the first is older; r.every = {most / 1e9:g} * s takes those at which both are new")
    return ""


def signal(simulation: Simulation, path: str) -> Signal:
    """A field of an input or output as a signal. Raises SetupError."""
    target = FieldPath(simulation, path)
    if target.port is None:
        raise SetupError(f"{path} is no field of an input or output, and only these are signals")
    return Signal.of_field(target)


class Requirements:
    """Those of a simulation's mission. False if there are none. Raises MissionError with file and line."""

    def __init__(self, simulation: Simulation) -> None:
        self.simulation = simulation
        self.all: list[Requirement] = []
        mission = simulation.mission
        if not mission or not (mission.folder / "requirements.py").exists():
            return
        files = MissionFiles(mission)
        with files:
            module = files.execute("requirements")
            declaration = Declaration(simulation)
            for function in functions_of(module).values():
                declaration._group = (function.__doc__ or function.__name__).strip().partition("\n")[0].rstrip(".")
                declaration._every = 0
                files.call(function, declaration)
        files.forget()
        self.all = list(declaration._found.values())

    def __bool__(self) -> bool:
        return bool(self.all)

    def of(self, id: str) -> Requirement:
        """That one. Raises SetupError."""
        for requirement in self.all:
            if requirement.id == id:
                return requirement
        known = [requirement.id for requirement in self.all]
        raise SetupError(f"there is no requirement '{id}'{did_you_mean(id, known)} there are "
                         + listed(known, most=12))

    def for_scenario(self, scenario: str) -> list[Requirement]:
        """Those with a formula that a scenario shows."""
        return [requirement for requirement in self.all if requirement.formula is not None
                and (not requirement.shown_by or scenario in requirement.shown_by)]

    def _chosen(self, only: Sequence[str] | None) -> list[Requirement]:
        chosen = self.all if only is None else [self.of(id) for id in only]
        return [requirement for requirement in chosen if requirement.formula is not None]

    def watch(self, only: Sequence[str] | None = None, stop: bool = False, traces: bool = False) -> Judged:
        """Judge the runs of the simulation from now on. only: ids; stop: a run ends at the first violation with
        errors.Stopped; traces: keep the numbers that are compared."""
        judged = Judged(self._chosen(only), self.simulation, traces=traces)
        judged.watch(stop)
        return judged

    def judge(self, records: Records, only: Sequence[str] | None = None, end: Any = None) -> list[Outcome]:
        """Judge a Log or an Archive. end: when the run ended, a time; None: at the last sample."""
        return self.judged(records, only, end).outcomes()

    def judged(self, records: Records, only: Sequence[str] | None = None, end: Any = None,
               traces: bool = False) -> Judged:
        """The same with the numbers that were compared."""
        judged = Judged(self._chosen(only), traces=traces)
        judged.play(records, None if end is None else time_ns(end, "end"))
        return judged

    def refuse_longer(self, duration: int, requirements: Iterable[Requirement]) -> None:
        """Raise SetupError for a formula with a window that reaches beyond a run of `duration` [ns]."""
        for requirement in requirements:
            if requirement.formula is not None and requirement.formula.reach > duration:
                raise SetupError(f"{requirement.place}: {requirement.id} looks "
                                 f"{time_text(requirement.formula.reach)} ahead, which is longer "
                                 f"than the run of {time_text(duration)}")
