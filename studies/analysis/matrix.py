# SPDX-License-Identifier: Apache-2.0
"""The faults of a mission: each unit of the world by each kind of fault. A mission may say more in its faults.py, in
one function that takes `m`:

    def matrix(m):
        m.begin = [200 * s, 50 * minute]                        # default: the middle of each mode's first stay
        m.fault("world.gyro", "BIAS", size=0.1 * deg / s)       # in place of the usual one; several are several faults
        m.without("world.css", "DELAY", "BIAS")                 # not flown; without kinds: none of the unit
        m.detects("flight.sun.status.faulty")                   # flight reports a problem here
        m.isolates("flight.sun.status.faulty", {"world.adc_a": 0b01, "world.adc_b": 0b10})
        m.nominal("FDP-4")                                      # not judged: a requirement for where nothing fails
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from fledge import mission as missions, objects
from fledge.errors import SetupError, did_you_mean, listed, refuse_misspelt
from fledge.mission.field_path import FieldPath
from fledge.mission.folder import MissionFiles, functions_of
from fledge.objects.si import enumerator_names
from fledge.pool import anywhere
from fledge.requirements import Requirements

if TYPE_CHECKING:
    from fledge.mission.simulation import Simulation

FILE = "faults.py"

# What a channel gives at most, where the model has no limit of its own, in the unit of the channel: a number, or the
# name of a parameter. A usual bias is a tenth of it, a usual drift a tenth in a minute. 1: of any other model.
LIMITS: dict[str, float | str] = {
    "Accelerometer": 1.0, "CoarseSunSensors": "current", "ControlMomentGyros": 1.0, "CraftSensor": 10.0,
    "GpsReceiver": 10e3, "Gyro": 0.1, "GyroElectronics": "bits", "Magnetometer": 100e-6, "Navigation": 0.1,
    "ReactionWheels": "u_max", "StarTracker": 1.0, "StarTrackerElectronics": "bits", "SunSensor": 1.0,
    "SunSensorConverter": "bits", "Thrusters": "F", "TorqueRods": "m_max", "WheelConverter": 100.0}
SHARE, DELAY = 0.1, 1.0


class Fault(NamedTuple):
    """A fault to be flown. fields: of the model's `faults`, as assigned, without the times"""
    unit: str
    kind: str
    fields: Mapping[str, Any] = {}

    @property
    def details(self) -> str:
        """Its fields in words."""
        return ", ".join(f"{name} {value:.4g}" if isinstance(value, float) else f"{name} {value}"
                         for name, value in self.fields.items())

    def __str__(self) -> str:
        return f"{self.unit} {self.kind}" + (f" ({self.details})" if self.fields else "")


class Matrix:
    """The units and faults of a mission: `m`, which the function of its faults.py completes.

    parameters: of the mission. Raises SetupError, with the line of the mission's file.
    """

    def __init__(self, mission: str | os.PathLike[str], seed: int = 0, **parameters: Any) -> None:
        self._given = mission, seed, parameters
        sim = self.simulation = self.load()
        self.begin: Any = None      # times; None: the middle of each mode's first stay
        self.lasts: Any = 0         # a time; 0: for ever
        self.units = {objects.path(instance): instance for process in sim.processes for instance in process
                      if _takes_faults(instance)}
        self._own: dict[tuple[str, str], list[Fault]] = {}
        self._without: set[tuple[str, str]] = set()
        self.detecting: list[str] = []
        self.isolating: dict[str, dict[str, int]] = {}
        self.named: dict[str, dict[int, str]] = {}      # path -> what its bits mean, of flight's tables
        self.left_out: set[str] = set()     # ids of requirements
        self._tables()
        assert sim.mission
        if (sim.mission.folder / FILE).exists():
            with MissionFiles(sim.mission) as files:
                known = functions_of(files.execute(FILE.removesuffix(".py")))
                if len(known) != 1:
                    raise SetupError(f"{sim.mission.folder / FILE}: expected one function that takes m, as in "
                                     f"def matrix(m); found {listed(list(known))}")
                files.call(*known.values(), self)
                files.forget()

    def __setattr__(self, name: str, value: Any) -> None:
        refuse_misspelt(self, name, ("begin", "lasts"))
        object.__setattr__(self, name, value)

    def _tables(self) -> None:
        """What a table of flight's units isolates: the unit of the world that has its load of the power unit."""
        sim = self.simulation
        powered = {target.rpartition(".")[0] for _, target, *_ in sim.wires if target.endswith(".power")}
        loads = {path: 1 << unit.load for path, unit in self.units.items() if path in powered and hasattr(unit, "load")}
        for process in sim.flights:
            for instance in process:
                if objects.struct(instance).name == "FaultProtection":
                    path = f"{objects.path(instance)}.table.faulted"
                    self.named[path] = {place: row.name or f"unit {place}" for place, row in enumerate(instance.units)}
                    self.isolating[path] = {
                        unit: 1 << place for unit, load in loads.items()
                        for place, row in enumerate(instance.units) if row.loads & load}

    def load(self) -> Simulation:
        """A fresh simulation of the mission."""
        mission, seed, parameters = self._given
        return missions.load(mission, seed, **parameters)

    @property
    def recipe(self) -> tuple[Any, ...]:
        """The arguments of made() that give the same in another process, but for the faults that are flown."""
        mission, seed, parameters = self._given
        return anywhere(mission), seed, parameters, {name: getattr(self, name) for name in (
            "detecting", "isolating", "named", "left_out")}

    @classmethod
    def made(cls, mission: str, seed: int, parameters: dict[str, Any], declared: dict[str, Any]) -> Matrix:
        matrix = cls(mission, seed, **parameters)
        vars(matrix).update(declared)
        return matrix

    # --- declarations of a mission ---

    def fault(self, unit: str, kind: str, **fields: Any) -> None:
        """Fly this fault of a unit in place of the usual one of its kind. fields: of `faults` (docs/sensors.md) but for
        begin and lasts."""
        kind, = self._kinds(unit, [kind])
        self._own.setdefault((unit, kind), []).append(Fault(unit, kind, fields))
        self._try(self._own[unit, kind][-1])

    def without(self, unit: str, *kinds: str) -> None:
        """Leave kinds of faults of a unit out, or all."""
        self._without |= {(unit, kind) for kind in self._kinds(unit, kinds)}

    def detects(self, *paths: str) -> None:
        """Outputs of flight that report a problem when they differ from those of the undisturbed flight."""
        for path in paths:
            self._number(path)
            self.detecting.append(path)

    def isolates(self, path: str, units: Mapping[str, int]) -> None:
        """An output of flight whose bits are the units that it does not use any more. units: those of the world, by
        path, each with its bits."""
        self._number(path)
        for unit, bits in units.items():
            self.unit(unit)
            if not isinstance(bits, int) or bits <= 0:
                raise SetupError(f"m.isolates({path!r}): {unit}: expected bits, a whole number > 0; found {bits!r}")
        self.isolating[path] = {**self.isolating.get(path, {}), **units}

    def nominal(self, *ids: str) -> None:
        """Requirements for flights in which nothing fails, as that no unit is isolated: they are not judged here."""
        self.left_out |= {Requirements(self.simulation).of(id).id for id in ids}

    def _number(self, path: str) -> None:
        """Refuse a path that is no whole number of an output of flight."""
        target = FieldPath(self.simulation, path)
        if target.group != "out" or target.port is None or not path.startswith(
                tuple(f"{process.name}." for process in self.simulation.flights)):
            raise SetupError(f"{path} is no output of flight")
        if target.field.type.startswith("f"):
            raise SetupError(f"{path}: expected a whole number, which differs by itself; it has the type "
                             f"{target.field.type}")

    # --- the faults ---

    def unit(self, path: str) -> Any:
        """The model at a path. Raises SetupError if it takes no faults."""
        if path not in self.units:
            raise SetupError(f"there is no unit '{path}' that takes faults{did_you_mean(path, self.units)} there are "
                             + listed(list(self.units)))
        return self.units[path]

    def _kinds(self, unit: str, wanted: Sequence[str] = ()) -> list[str]:
        """The kinds of fault of a unit, or those of them that are wanted."""
        known = list(_kinds_of(self.unit(unit)))
        for kind in wanted:
            if kind not in known:
                raise SetupError(f"{unit} has no fault of the kind '{kind}'{did_you_mean(kind, known)} it has "
                                 + listed(known))
        return list(wanted) or known

    def faults(self, units: Sequence[str] = (), kinds: Sequence[str] = ()) -> list[Fault]:
        """All faults, or those of some units and kinds. Raises SetupError on one that does not exist."""
        units = units or list(self.units)
        known = list(dict.fromkeys(kind for unit in units for kind in self._kinds(unit)))
        for kind in kinds:
            if kind not in known:
                raise SetupError(f"there is no kind of fault '{kind}'{did_you_mean(kind, known)} there are "
                                 + listed(known))
        chosen = [fault for unit in units for kind in self._kinds(unit)
                  if (not kinds or kind in kinds) and (unit, kind) not in self._without
                  for fault in self._own.get((unit, kind), [self._usual(unit, kind)])]
        if not chosen:
            raise SetupError(f"the mission {self.simulation.name} has no fault to fly: "
                             + ("no model takes `faults`" if not self.units else "all are left out"))
        return chosen

    def _usual(self, unit: str, kind: str) -> Fault:
        """The fault of a kind, large enough to matter."""
        if "bits" in _fields(self.unit(unit)):
            return Fault(unit, kind, {"bits": 2})       # of a memory: one more than its code corrects
        named = LIMITS.get(objects.struct(self.unit(unit)).name, 1.0)
        if isinstance(named, float):
            limit = named
        elif named == "bits":
            limit = 2.0 ** self.unit(unit).bits
        else:
            import numpy as np

            limit = float(np.max(getattr(self.unit(unit), named))) or 1.0
        sizes = {"HIGH": limit, "LOW": limit, "BABBLE": limit, "BIAS": SHARE * limit, "DRIFT": SHARE * limit / 60,
                 "DELAY": DELAY}
        return Fault(unit, kind, {"size": sizes[kind]} if kind in sizes else {})

    def _try(self, fault: Fault) -> None:
        """Refuse a fault at once that the model would refuse later."""
        owner, before = self.unit(fault.unit), _planned(self.unit(fault.unit))
        try:
            owner.faults = [{"kind": fault.kind, **fault.fields}]
        finally:
            owner.faults = before

    def scenario(self, name: str) -> str:
        """A scenario, by its name. Raises SetupError if there is none."""
        assert self.simulation.mission
        known = self.simulation.mission.scenarios
        if name not in known:
            raise SetupError(f"the mission {self.simulation.name} has no scenario '{name}'{did_you_mean(name, known)} "
                             f"it has {listed(list(known))}")
        return name


def _takes_faults(instance: Any) -> bool:
    struct = objects.struct(instance)
    return isinstance(instance, objects.Model) and struct.name != "FaultPanel" and any(
        f.name == "faults" and f.group == "par" for f in struct.fields)


def _fields(owner: Any) -> dict[str, Any]:
    """The fields of a fault of a model, by name."""
    return {f.name: f for field in objects.struct(owner).fields if field.name == "faults" for f in field.struct.fields
            if not f.spare}


def _kinds_of(owner: Any) -> dict[str, int]:
    """Name -> number of each kind of fault of a model; without their common prefix, and without "no fault"."""
    return {name: number for number, name in enumerator_names(_fields(owner)["kind"]).items() if number}


def _planned(owner: Any) -> list[dict[str, Any]]:
    return [{name: getattr(fault, name) for name in _fields(owner)} for fault in owner.faults]


def plant(sim: Simulation, ns: int, faults: Sequence[Fault], lasts: int) -> None:
    """Have the faults in the models from a time [ns] on, also where the scenario has just assigned others."""
    for fault in faults:
        process, _, instance = fault.unit.partition(".")
        owner: Any = getattr(sim.process(process), instance)
        known = _fields(owner)
        planned = _planned(owner)
        number = _kinds_of(owner)[fault.kind]
        if not any(row["kind"] == number and row["begin"] == ns for row in planned):
            times = {"begin": ns, **({"lasts": lasts} if "lasts" in known else {})}     # whole numbers are [ns]
            owner.faults = [*planned, {"kind": fault.kind, **fault.fields, **times}]
