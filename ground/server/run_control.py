# SPDX-License-Identifier: Apache-2.0
"""The control of a run in which spacecraft fly: its speed, pauses, steps, and faults that an operator injects."""
from __future__ import annotations

import re
from abc import ABC, abstractmethod
from math import inf
from time import monotonic
from typing import TYPE_CHECKING, Any

from fledge.commands.fields import place_of
from fledge.errors import SetupError

if TYPE_CHECKING:
    from fledge.cosim.steering import Steering
    from fledge.mission.simulation import Simulation

AHEAD = 200_000_000     # [ns] of wall time that one turn may take
LEAST = 10_000_000      # [ns] of wall time that one turn flies at least, for a turn costs far more than a short flight
LATE = 0.5              # [s] behind its speed: what the simulation cannot keep up with is not made good


class RunControl(ABC):
    """What browsers can do with a run."""

    @property
    @abstractmethod
    def paused(self) -> bool:
        """Whether it stands still, or will after its step."""

    @property
    def past(self) -> float:
        """[s] until which the run repeats an earlier one."""
        return 0.0

    @property
    def reached(self) -> float:
        """[s] to which all of the run has come, as far as is known here."""
        return 0.0

    def repeats(self, received: float = inf) -> str:
        """That the run repeats an earlier one and has not come to its end yet, or its telemetry has been received up
        to a time [s] before: that, in words; empty: it does not."""
        return ""

    @abstractmethod
    def command(self, action: str, seconds: float = 0.0, speed: float | None = None) -> None:
        """pause, go, step, or rewind to the instant `seconds`. Raises SetupError."""

    @abstractmethod
    def describe(self, problem: str = "") -> dict[str, Any]:
        """The state for browsers. problem: why the run has ended."""

    @abstractmethod
    def faults(self) -> list[dict[str, Any]]:
        """The parameters of the world that may be changed: first the planned faults of units, those of the most faulty
        unit in front; then what else these units have."""

    @abstractmethod
    def inject(self, path: str, value: Any) -> str:
        """Set a parameter of the simulation, as "world.wheels.friction" or "world.wheels.faults", checked as in a
        mission; in words, what it was. Raises SetupError."""


class Pace(RunControl):
    """Of a simulation that the server itself flies: how far it may go now."""

    paused = False

    def __init__(self, sim: Simulation, speed: float) -> None:
        self.sim = sim
        self.speed = speed
        self._end: int | None = None    # [ns] of steps
        self._anchor()

    def until(self) -> int | None:
        """[ns] of simulated time up to which to fly; None: stand still for now."""
        t = max(int(self.sim.time_ns), 0)
        if self.paused and (self._end is None or t >= self._end):
            self._end = None
            self._anchor()
            return None
        if self.speed == 0:
            due = t + 10**9
        else:
            behind = monotonic() - self._begun - (t - self._t) / 1e9 / self.speed
            if behind > LATE:
                self._anchor()
            due = self._t + int((monotonic() - self._begun) * 1e9 * self.speed)
            due = min(due, t + max(int(AHEAD * self.speed), 1)) if due >= t + LEAST * self.speed else t
        if self._end is not None:
            due = min(due, self._end)
        return due if due > t else None

    def command(self, action: str, seconds: float = 0.0, speed: float | None = None) -> None:
        _check(action, seconds, speed)
        if speed is not None:
            self.speed = speed
        if action == "step":
            self._end = max(int(self.sim.time_ns), 0) + round(seconds * 1e9)
        self.paused = action != "go"
        if action == "pause":
            self._end = None
        self._anchor()

    def describe(self, problem: str = "") -> dict[str, Any]:
        t = max(int(self.sim.time_ns), 0)
        wall = monotonic() - self._begun
        real = (t - self._t) / 1e9 / wall if wall > 0 else 0.0
        standing = self.paused and self._end is None
        return {"state": "ended" if problem else "paused" if standing else "running", "speed": self.speed,
                "real_speed": 0.0 if standing or problem else real, "t_ns": str(t), "text": problem}

    def faults(self) -> list[dict[str, Any]]:
        from fledge.objects import struct

        rows: list[tuple[int, dict[str, Any]]] = []
        for process in self.sim.processes:
            for name, instance in process.instances.items() if process not in self.sim.flights else ():
                fields = [field for field in struct(instance).fields if field.group == "par" and not field.spare]
                takes_faults = any(field.name == "faults" and field.struct for field in fields)
                for field in fields:
                    row = {"path": f"{process.name}.{name}.{field.name}", "unit": field.unit, "meaning": field.doc,
                           "value": _plain(field, getattr(instance, field.name))}
                    if takes_faults and field.name == "faults":
                        row |= self._planned(field, row["value"])
                        rows.append((-1 - len(row["value"]), row))
                    else:
                        rows.append((0 if takes_faults else 1, row))
        return [row for _, row in sorted(rows, key=lambda rank: rank[0])]

    def _planned(self, field: Any, faults: list[dict[str, Any]]) -> dict[str, Any]:
        """What a person must know to plan faults, and an example: one that begins now."""
        from fledge.objects.si import enumerator_names

        members = {member.name: member for member in field.struct.fields}
        kinds = [kind for number, kind in enumerator_names(members["kind"]).items() if number]
        words = ", ".join(f"{name} [ns]" if member.unit == "ns" else name for name, member in members.items())
        example = {"kind": kinds[-1], "begin": max(int(self.sim.time_ns), 0)}
        return {"meaning": f"planned faults: a list of {words}; kinds: {', '.join(kinds)}",
                "example": [*faults, example]}

    def inject(self, path: str, value: Any) -> str:
        steps = re.findall(r"\w+|\[\d+\]", path)
        if "".join(steps) != path.replace(".", "") or len(steps) < 3 or any(
                step.startswith("_") for step in steps):
            raise SetupError(f"a fault is of a parameter by its path, as world.wheels.friction; found '{path}'")
        names = [process.name for process in self.sim.processes]
        parts = place_of(self.sim.processes, names, steps[0], "process", self.sim.name)[1].instances
        holder: Any = place_of(list(parts.values()), list(parts), steps[1], "part", steps[0])[1]
        try:
            for step in steps[2:-1]:
                holder = holder[int(step[1:-1])] if step.startswith("[") else getattr(holder, step)
            if steps[-1].startswith("["):
                place = int(steps[-1][1:-1])
                before = holder[place]
                holder[place] = value
            else:
                before = getattr(holder, steps[-1])
                setattr(holder, steps[-1], value)
        except (AttributeError, IndexError, TypeError, ValueError) as error:
            raise SetupError(f"{path}: {error}") from None
        return f"{before}"

    def _anchor(self) -> None:
        self._t, self._begun = max(int(self.sim.time_ns), 0), monotonic()


class Steered(RunControl):
    """Of a co-simulation, of which the server is a program."""

    def __init__(self, steering: Steering) -> None:
        self._steering = steering

    @property
    def paused(self) -> bool:
        return bool(self._steering.state.get("paused"))

    def repeats(self, received: float = inf) -> str:
        state = self._steering.state
        t, past = min(float(state.get("t") or 0.0), received), float(state.get("past") or 0.0)
        return f"the run repeats an earlier one until {past:g} s" if 0 < past > t else ""

    @property
    def past(self) -> float:
        return float(self._steering.state.get("past") or 0.0)

    @property
    def reached(self) -> float:
        return float(self._steering.state.get("t") or 0.0)

    def command(self, action: str, seconds: float = 0.0, speed: float | None = None) -> None:
        t = float(self._steering.state.get("t") or 0.0)
        _check("go" if action == "rewind" else action, seconds, speed)
        if action == "rewind" and not self._steering.state.get("rewinds"):
            raise SetupError("the run keeps no record to go back in: write keep_every = 60 into the co-simulation's "
                             "file")
        if action == "rewind" and not 0 <= seconds <= t:
            raise SetupError(f"a run goes back to an instant from 0 s to {t:g} s; found {seconds:g} s")
        if speed is not None:
            self._steering.pace(float(speed))
        if action == "step":
            self._steering.until(t + seconds)
        elif action == "rewind":
            self._steering.rewind(float(seconds))
        elif action == "pause":
            self._steering.pause()
        else:
            self._steering.go()

    def describe(self, problem: str = "") -> dict[str, Any]:
        state = self._steering.state
        t, wall = float(state.get("t") or 0.0), float(state.get("wall") or 0.0)
        return {"state": "ended" if problem else "paused" if state.get("paused") else "running",
                "speed": state.get("pace", 0.0), "real_speed": t / wall if wall > 0 else 0.0,
                "t_ns": str(round(t * 1e9)), "text": problem or self.repeats() or state.get("refused", ""),
                "rewinds": bool(state.get("rewinds"))}

    def faults(self) -> list[dict[str, Any]]:
        return []

    def inject(self, path: str, value: Any) -> str:
        """A co-simulation's faults are those of its own programs. Raises SetupError."""
        raise SetupError("a co-simulation's parameters are those of its programs: faults can be injected where the "
                         "server flies the mission itself")


def _check(action: str, seconds: float, speed: float | None) -> None:
    if speed is not None and not 0 <= speed <= 1e6:
        raise SetupError(f"a speed is from 0 (as fast as possible) to 1e6 times real time; found {speed:g}")
    if action == "step" and not 0 < seconds <= 1e7:
        raise SetupError(f"a step is of more than 0 s, up to 1e7 s; found {seconds:g}")
    if action not in ("pause", "go", "step"):
        raise SetupError(f"a run can pause, go and step; found '{action}'")


def _plain(field: Any, value: Any) -> Any:
    """A parameter for JSON: enumerators by their names; of structs in a list, the members that are not 0."""
    from fledge.objects import struct
    from fledge.objects.si import enumerator_names

    if isinstance(value, tuple):
        return [{member.name: _plain(member, part) for member in struct(element).fields
                 if (part := getattr(element, member.name))} for element in value]
    if isinstance(value, int):
        return enumerator_names(field).get(value, value)
    return value.tolist() if hasattr(value, "tolist") else value if isinstance(value, (float, str)) else str(value)
