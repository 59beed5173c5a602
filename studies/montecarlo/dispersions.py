# SPDX-License-Identifier: Apache-2.0
"""What differs between the runs of a campaign, declared beside the mission, in dispersions.py:

    def release(d):
        \"\"\"Released at any attitude, tumbling, with mass properties that flight does not know.\"\"\"
        d.duration = 10 * minute
        d.every    = 2 * s

        d["world.craft.sigma_BN"]   = d.attitude()
        d["world.craft.omega_BN_B"] = d.normal(0, 0.5 * deg / s)
        d["world.craft.I_B[0, 0]"]  = d.nominal + d.normal(0, 10 * kg * m**2)
        d["world.wheels.J"]         = d.nominal * d.uniform(0.95, 1.05)
        d["flight.camera.mode"]     = d.choice("SURVEY", "STARE")
        d.orbit("world.craft", altitude=d.nominal + d.normal(0, 2 * km), Omega=d.uniform(0, 360 * deg))
        d.fault("world.gyro", kind=d.choice("NONE", "BIAS", "DEAD"), begin=d.uniform(1 * minute, 5 * minute))
        d.command(d.packets.mode("IDLE"), at=d.uniform(1 * minute, 5 * minute))

        error = d.retain("flight.tracking.error.sigma_BR")
        d.check(error.norm().final < 1e-3, "the attitude did not settle")

Every public function of the file that takes `d` is a campaign; the first line of its docstring is
its purpose. Each run is fixed by the campaign's seed and the run's index alone, and each element of
a parameter is drawn from a stream of its own: a line more changes no other line's draws.
"""

from __future__ import annotations

import struct as packing
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from fledge import _core
from fledge.errors import SetupError, did_you_mean, listed, refuse_misspelt, suggesting
from fledge.objects.si import enumerator, enumerator_names, time_ns, to_number, to_si
from fledge.mission.field_path import FieldPath, index_text, names_of
from fledge.montecarlo.requirements import FormulaCheck, Reported, Requirement, Variable
from fledge.requirements.declared import Requirement as Declared, Requirements, signal
from fledge.requirements.formula import Formula, Signal, time_text
from fledge.requirements.judge import watched
from fledge.world.attributes import given_orbit
from fledge.world.bodies import ANGLE, LENGTH, dot

if TYPE_CHECKING:
    import numpy as np

    from fledge.commands import Packets
    from fledge.mission.simulation import Simulation

_NUMBER = (0,) * 8
_TIME = (0, 0, 1, 0, 0, 0, 0, 0)
_INFINITY = float("inf")
SHAPE = ("a", "e", "p", "rp", "ra", "altitude")     # elements of the size and shape of an orbit, and the others
ANGLES = ("i", "Omega", "omega", "f")


# --- draws -----------------------------------------------------------------------------------------

class Draw:
    """A distribution: made by uniform(), normal(), choice() and attitude() of `d`."""

    def __init__(self, kind: str, numbers: tuple[Any, ...] = (), low: Any = None, high: Any = None,
                 scale: str = "", stride: int = 1) -> None:
        self.kind, self.numbers, self.low, self.high, self.scale, self.stride = kind, numbers, low, high, scale, stride

    def _scaled(self, scale: str) -> Draw:
        if self.scale or self.kind == "attitude":
            raise SetupError(f"{self!r} cannot be joined with the nominal value"
                             + (" twice" if self.scale else ": it is an attitude of its own"))
        return Draw(self.kind, self.numbers, self.low, self.high, scale)

    def __repr__(self) -> str:
        cut = ([f"low={_short(self.low)}"] if self.low is not None else []) + (
            [f"high={_short(self.high)}"] if self.high is not None else [])
        text = f"{self.kind}({', '.join([*map(_short, self.numbers), *cut])})"
        return {"": "", "about": "nominal + ", "relative": "nominal * "}[self.scale] + text


def _short(value: Any) -> str:
    from fledge.units import Quantity

    if isinstance(value, Quantity):
        unit = value._unit()
        return _short(value.value) + (f" {unit}" if unit else "")
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(_short, value))}]"
    return f"{value:.6g}" if isinstance(value, (int, float)) else repr(value)


class Marginal(NamedTuple):
    """How one dispersed number is distributed, in SI: as the kernel's Distribution. declared: the path of its line in
    dispersions.py; whole: it is rounded"""
    kind: str
    a: float
    b: float
    low: float
    high: float
    scale: str
    choices: tuple[float, ...]
    nominal: float
    whole: bool
    declared: str


class _Nominal:
    """`d.nominal`: the value that the mission's own files give."""

    def __add__(self, draw: Draw) -> Draw:
        return self._join(draw, "about", "+")

    def __mul__(self, draw: Draw) -> Draw:
        return self._join(draw, "relative", "*")

    __radd__, __rmul__ = __add__, __mul__

    def _join(self, draw: Any, scale: str, sign: str) -> Draw:
        if not isinstance(draw, Draw):
            raise SetupError(f"d.nominal {sign} {draw!r}: expected something drawn, as in "
                             f"d.nominal {sign} d.normal({'0, 1 * m' if sign == '+' else '1, 0.05'})")
        return draw._scaled(scale)

    def __repr__(self) -> str:
        return "nominal"


class _Command(NamedTuple):
    """Commands of which each run sends one. packets: of each; names: in words; at: [s] unless it is drawn"""
    process: str
    packets: list[list[bytes]]
    names: list[str]
    at: float


# --- d ---------------------------------------------------------------------------------------------

@suggesting()
class Dispersions:
    """The declarations of a campaign: `d`, which its function fills."""

    def __init__(self, simulation: Simulation) -> None:
        self.simulation = simulation
        self.modes: list[str] = _core.mode_names(simulation.kernel)     # "flight.mode.SAFE" of each
        self._plan = _core.CampaignPlan()
        self._duration: int | None = None           # [ns]
        self._every: int | None = None              # [ns]
        self.draws: dict[str, Draw] = {}            # by path, as declared
        self.marginals: dict[str, Marginal] = {}    # by path of each dispersed element
        self.faults: list[str] = []                 # "world.gyro.faults[0]" of each that fault() planned
        # Path of each drawn number that is no parameter, of an orbit or a command -> its nominal value.
        self.composed: dict[str, float] = {}
        self.labels: dict[str, dict[float, str]] = {}   # of these, names of numbers: path -> number -> name
        self.commands: dict[str, _Command] = {}     # "flight.commands[0]" of each that command() planned
        self._parameter_columns: dict[str, str] = {}    # axes of a sweep that the mission takes
        self._columns: dict[str, str] = {}          # path of each dispersed element of a parameter -> unit
        self._composed_columns: dict[str, str] = {}     # the same of `composed`
        self.retained: dict[str, Variable | Reported] = {}    # by path, and with " raw" behind it
        self.requirements: list[Requirement] = []

    def __setattr__(self, name: str, value: Any) -> None:
        refuse_misspelt(self, name, ("duration", "every"))
        object.__setattr__(self, name, value)

    @property
    def columns(self) -> dict[str, str]:
        """The path of each dispersed number -> its unit, in the order of the draws."""
        return {**self._parameter_columns, **self.drawn}

    @property
    def drawn(self) -> dict[str, str]:
        """The same of those that the kernel draws: all but the axes of a sweep that the mission takes."""
        return {**self._columns, **self._composed_columns}

    # --- times ---

    @property
    def duration(self) -> Any:
        """The duration of each run: set as a time, read in s; None before. Setting it raises SetupError unless > 0."""
        return None if self._duration is None else self._duration / 1e9

    @duration.setter
    def duration(self, value: Any) -> None:
        self._duration = _positive(value, "d.duration")

    @property
    def every(self) -> Any:
        """The time between two samples of the retained variables: set as a time, read in s; default: a 200th of the
        duration. The least `r.every` of the requirements that are asked for counts, if it is shorter."""
        return None if self._duration is None and self._every is None else self._sampling() / 1e9

    @every.setter
    def every(self, value: Any) -> None:
        self._every = _positive(value, "d.every")

    def _sampling(self) -> int:
        own = self._every or max((self._duration or 0) // 200, 1)
        return min([own, *(requirement.declared.every for requirement in self.requirements
                           if isinstance(requirement, FormulaCheck) and requirement.declared.every)])

    # --- distributions ---

    nominal = _Nominal()

    def uniform(self, low: Any, high: Any) -> Draw:
        """Anything between two values: `d.uniform(9 * N, 11 * N)`, `d.nominal * d.uniform(0.9, 1.1)`.

        Of a whole number, each between the two, and they themselves, has the same probability.
        """
        return Draw("uniform", (low, high))

    def normal(self, mean: Any, sigma: Any, *, low: Any = None, high: Any = None) -> Draw:
        """Normal with a mean and a standard deviation; truncated, if low or high are given: draws
        outside are drawn again. `d.nominal + d.normal(0, 2 * deg, low=-6 * deg, high=6 * deg)`.

        A list gives each element of an array its own number. Draws of a whole number are rounded.
        """
        return Draw("normal", (mean, sigma), low, high)

    def choice(self, *values: Any) -> Draw:
        """One of some values, each with equal probability: `d.choice("SAFE", "SCIENCE")`, `d.choice(1 * N, 5 * N)`."""
        return Draw("choice", values)

    def attitude(self) -> Draw:
        """Any attitude with equal probability, for an MRP."""
        return Draw("attitude")

    def __setitem__(self, path: str, draw: Draw) -> None:
        """Disperse a parameter of any instance: all its elements, those of a row, or one."""
        if not isinstance(draw, Draw):
            raise SetupError(f"{path}: expected something drawn, such as d.normal(...), d.uniform(...), "
                             f"d.choice(...) or d.attitude(); found {_short(draw)}")
        target = FieldPath(self.simulation, path)
        if target.of_mode:
            raise SetupError(
                f"{path} is no parameter, and only these can be dispersed; disperse what the events look at")
        if target.group != "par":
            raise SetupError(f"{path} is no parameter, and only these can be dispersed; {_core.path(target.owner)} has "
                             + listed([f.name for f in _core.struct(target.owner).fields
                                       if f.group == "par" and f.type != "char" and not f.spare]))
        counted = [f.name for f in _core.struct(target.holder).fields if f.count == target.field.name]
        if counted:
            raise SetupError(f"{path} is how many rows of {', '.join(counted)} count, and cannot be dispersed")
        # Of whole inertias the upper triangles are drawn; the kernel keeps them symmetric.
        across = {e: e - e % 9 + e % 3 * 3 + e % 9 // 3 if "inertia" in target.field.rule else e
                  for e in target.elements}
        drawn = [k for k, e in enumerate(target.elements) if not (across[e] < e and across[e] in across)]
        names = target.names()
        for k in drawn:
            mirror = target.full + index_text(across[target.elements[k]], target.field.shape)
            if names[k] in self._columns or mirror in self._columns:
                raise SetupError(f"{names[k]} is dispersed twice")
        choice = draw.kind in ("choice", "grid")
        if target.field.type == "enum" and not choice:
            raise SetupError(f"{path} = {draw!r}: {target.field.ctype} is an enumeration; draw it by d.choice(...), of "
                             + ", ".join(enumerator_names(target.field).values()))
        shown = f"{path} = {draw!r}" if choice else ""
        choices = [self._choice(value, target, draw.scale, shown) for value in draw.numbers] if choice else []
        if choice and not choices:
            raise SetupError(f"{path} = {draw!r}: name what to choose from")
        columns = [self._numbers(value, target, draw) for value in draw.numbers] if not choice else []
        columns = columns or [[0.0] * len(target.elements)] * 2
        columns += [self._numbers(draw.low, target, draw, -_INFINITY),
                    self._numbers(draw.high, target, draw, _INFINITY)]
        groups: dict[tuple[float, ...], list[int]] = {}  # elements with the same numbers
        for k in drawn:
            groups.setdefault(tuple(column[k] for column in columns), []).append(k)
        for (a, b, low, high), group in groups.items():
            self._plan.disperse(self.simulation.kernel, target.full, [target.elements[k] for k in group],
                                _core.Distribution(draw.kind, a, b, low, high, draw.scale, choices, draw.stride))
            self._columns.update((names[k], target.unit) for k in group)
        for (a, b, low, high), group in groups.items():
            self.marginals.update((names[k], Marginal(
                draw.kind, a, b, low, high, draw.scale, tuple(choices), FieldPath(self.simulation, names[k]).value(),
                target.field.type not in ("f64", "f32"), target.path)) for k in group)
        self.draws[target.path] = draw

    def _choice(self, value: Any, target: FieldPath, scale: str, shown: str) -> float:
        """A value of a choice as a number."""
        field = target.field
        if field.type == "enum":
            return float(enumerator(field.ctype, field.enumerators, value, shown))
        relative = scale == "relative"
        return to_number(value, shown, "-" if relative else field.unit, _NUMBER if relative else field.dims)

    def _numbers(self, value: Any, target: FieldPath, draw: Draw, default: float | None = None) -> list[Any]:
        """A number for each element, in the parameter's unit; factors have none."""
        n = len(target.elements)
        if value is None:
            return [default] * n
        relative = draw.scale == "relative"
        shown = f"{target.path} = {draw!r}"
        value = to_si(value, shown, "-" if relative else target.field.unit,
                      _NUMBER if relative else target.field.dims, "a number, or one for each element")
        if isinstance(value, (int, float)):
            return [float(value)] * n
        shape = _shape(value)
        if shape != target.shape:
            raise SetupError(f"{shown}: expected a number, or an array of shape {target.shape}; found one of shape "
                             f"{shape}")
        return [float(x) for x in _flat(value)]

    # --- orbits and faults ---

    def orbit(self, path: str, **elements: Draw) -> None:
        """Disperse elements of the orbit that the mission gives a spacecraft:

            d.orbit("world.craft", altitude=d.nominal + d.normal(0, 2 * km), i=d.normal(97.4 * deg, 0.1 * deg))

        The elements are those of Orbit: i, Omega, omega, f, and of a, e, p, rp, ra and altitude one or two; the
        mission's orbit gives what is left: a, p and altitude keep its e, e keeps its a, rp and ra each other.
        altitude is that of the periapsis. A drawn orbit that is none, or enters the body, is a failure of that run,
        or an error at once if a bounded draw may give it. Raises SetupError.
        """
        craft = self._craft(path)
        orbit = given_orbit(craft)
        if orbit is None:
            raise SetupError(f"d.orbit({path!r}): the mission gives it no orbit=Orbit(...) as its initial state; "
                             f"disperse {path}.r_BN_N and {path}.v_BN_N, or give it one")
        self._check_elements(path, elements)
        shape = _shape_of(set(elements) & set(SHAPE), path)
        nominal = {"a": orbit.a, "e": orbit.e, "p": orbit.p, "rp": orbit.p / (1 + orbit.e),
                   "ra": orbit.p / (1 - orbit.e) if orbit.e < 1 else _INFINITY,
                   "altitude": orbit.p / (1 + orbit.e) - orbit.body.radius,
                   "i": orbit.i, "Omega": orbit.Omega, "omega": orbit.omega, "f": orbit.f}
        order = [*shape, *ANGLES]
        distributions = {name: _distribution(f"{path}.orbit.{name}", name, draw) for name, draw in elements.items()}
        body, axes = orbit.body, orbit.frame or [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
        relative = _core.orbit_state(body.mu, orbit.p, orbit.e, orbit.i, orbit.Omega, orbit.omega, orbit.f)
        turned = [dot(part, column) for part in relative for column in zip(*axes)]
        origin = [float(x) - y for x, y in zip([*craft.r_BN_N, *craft.v_BN_N], turned)]
        paths = {f"{path}.orbit.{name}": name for name in elements}
        self._plan.orbit(self.simulation.kernel, path, list(paths),
                         [_core.Distribution(*arguments) for arguments in distributions.values()], ", ".join(shape),
                         [nominal[name] for name in order], [order.index(name) for name in elements], body.mu,
                         body.radius, body.radius if body.surface is None else body.surface,
                         [x for axis in axes for x in axis], origin)
        for shown, name in paths.items():
            self._compose(shown, elements[name], distributions[name], nominal[name],
                          "" if name == "e" else "rad" if name in ANGLES else "m")

    def _craft(self, path: str) -> Any:
        """The spacecraft at a path. Raises SetupError if there is none."""
        crafts = [_core.path(craft) for craft in self._crafts()]
        process, _, name = path.partition(".")
        found = {p.name: p for p in self.simulation.processes}.get(process)
        craft = found.instances.get(name) if found else None
        if craft is None:
            raise SetupError(f"d.orbit({path!r}): there is no such spacecraft{did_you_mean(path, crafts).rstrip(';')} "
                             f"there {'is' if len(crafts) == 1 else 'are'} {listed(crafts)}")
        if path not in crafts:
            raise SetupError(f"d.orbit({path!r}): it is no spacecraft but {_core.struct(craft).name}; there are "
                             + listed(crafts))
        return craft

    def _check_elements(self, path: str, elements: Mapping[str, Draw]) -> None:
        """Raise SetupError unless these elements of an orbit can be dispersed, each once."""
        known = (*SHAPE, *ANGLES)
        for name, draw in elements.items():
            if name not in known:
                raise SetupError(f"d.orbit({path!r}): an orbit has no element '{name}'{did_you_mean(name, known)} "
                                 f"it has {listed(known)}")
            if not isinstance(draw, Draw) or draw.kind == "attitude":
                raise SetupError(f"d.orbit({path!r}, {name}=...): expected a number drawn, such as d.normal(...), "
                                 f"d.uniform(...) or d.choice(...); found {_short(draw)}")
            if f"{path}.orbit.{name}" in self._composed_columns:
                raise SetupError(f"{path}.orbit.{name} is dispersed twice")
        if not elements:
            raise SetupError(f"d.orbit({path!r}): name what to draw, of {listed(known)}")

    def _crafts(self) -> list[Any]:
        """All spacecraft."""
        return [instance for process in self.simulation.processes for instance in process.instances.values()
                if _core.struct(instance).name == "Spacecraft"]

    def fault(self, path: str, **fields: Any) -> None:
        """Plan one more fault of a sensor or actuator, and disperse it:

            d.fault("world.gyro", kind=d.choice("NONE", "BIAS", "DRIFT"), channels=d.choice(1, 2, 4),
                    size=d.normal(0, 0.01 * deg / s), begin=d.uniform(1 * minute, 5 * minute))

        The fields are those of `faults` (docs/sensors.md): kind, channels, size, begin, lasts; each is drawn, or a
        constant for all runs. With "NONE" among the kinds some runs have no fault. Raises SetupError.
        """
        takers = {f"{p.name}.{name}": instance for p in self.simulation.processes
                  for name, instance in p.instances.items()
                  if any(f.name == "n_faults" for f in _core.struct(instance).fields)}
        if path not in takers:
            raise SetupError(f"d.fault({path!r}): no model of that name takes faults; these do: "
                             + listed(list(takers)))
        owner = takers[path]
        if "kind" not in fields:
            raise SetupError(f'd.fault({path!r}): name its kind, as in kind="BIAS" or kind=d.choice("NONE", "BIAS")')
        known = [f.name for field in _core.struct(owner).fields if field.name == "faults" for f in field.struct.fields]
        planned = [{name: getattr(fault, name) for name in known} for fault in owner.faults]
        self.faults.append(f"{path}.faults[{len(planned)}]")
        for name in fields:
            if name not in known:
                raise SetupError(f"d.fault({path!r}): a fault has no '{name}'{did_you_mean(name, known)} it has "
                                 + listed(known))
        constants = {name: value for name, value in fields.items() if not isinstance(value, Draw)}
        owner.faults = [*planned, constants]
        for name, value in fields.items():
            if isinstance(value, Draw):
                self[f"{path}.faults[{len(planned)}].{name}"] = value

    @property
    def packets(self) -> Packets:
        """The commands of the flight software, for command(). Of several processes ask
        `d.simulation.NAME.commands.packets`, because this raises SetupError."""
        flights = self.simulation.flights
        if len(flights) != 1:
            raise SetupError(f"d.packets: there are {listed([f.name for f in flights])}; name one, as in "
                             f"d.simulation.{flights[0].name}.commands.packets")
        return flights[0].commands.packets

    def command(self, packets: Any, at: Any) -> None:
        """Send a command at a time, in each run:

            d.command(d.packets.mode("SAFE"), at=d.uniform(1 * minute, 5 * minute))
            d.command(d.choice(None, d.packets.mode("SAFE"), d.packets.write("flight.control", K=2.0)), at=90 * s)

        packets: what `d.packets` gives, or a choice of some, of which None is no command; at: a time after the start,
        drawn or not. Flight executes it at its next instant, as commands of a scenario. Raises SetupError.
        """
        draw = packets if isinstance(packets, Draw) else Draw("choice", (packets,))
        if draw.kind != "choice" or draw.scale:
            raise SetupError(f"d.command: expected packets, or d.choice(...) of some; found {draw!r}")
        sent = [[] if choice is None else [choice] if isinstance(choice, bytes) else choice for choice in draw.numbers]
        if not all(isinstance(choice, list) and all(isinstance(packet, bytes) for packet in choice) for choice in sent):
            raise SetupError("d.command: expected packets, as d.packets.mode(...) gives them")
        known = [packets for packets in sent if packets]
        process = next((p for p in self.simulation.flights if known and
                        known[0][0][:2] == packing.pack(">H", p.commands.dictionary.stream)), None)
        if process is None:
            raise SetupError("d.command: " + ("these packets are of no flight software of this mission" if known else
                                              "name a command"))
        if process.commands.dictionary.frames:
            raise SetupError(f"d.command: {process.name} takes commands in frames, which a draw cannot make; command a "
                             "mission whose flight takes packets")
        place = f"{process.name}.commands[{sum(name.startswith(f'{process.name}.') for name in self.commands)}]"
        dictionary = process.commands.dictionary
        names = [" and ".join(map(dictionary.command, packets)) for packets in known]
        which = [float(known.index(packets) + 1) if packets else 0.0 for packets in sent]
        time = 0.0 if isinstance(at, Draw) else _positive(at, f"{place}.at") / 1e9
        self._command(place, _Command(process.name, known, names, time),
                      {"which": Draw("choice", tuple(which)), **({"at": at} if isinstance(at, Draw) else {})})

    def _command(self, place: str, command: _Command, draws: Mapping[str, Draw]) -> None:
        """draws: "which", and "at" unless that is the same in all runs."""
        if "at" in draws and (draws["at"].scale or draws["at"].kind == "attitude"):
            raise SetupError(f"{place}.at = {draws['at']!r}: expected a time drawn, as in d.uniform(1 * s, 5 * s)")
        numbers = {name: _distribution(f"{place}.{name}", name, draw) for name, draw in draws.items()}
        distributions = {name: _core.Distribution(*of) for name, of in numbers.items()}
        self._plan.command(self.simulation.kernel, command.process, place, command.packets, distributions["which"],
                           distributions.get("at", command.at))
        self.commands[place] = command
        self.labels[f"{place}.which"] = {float(i): name for i, name in enumerate(["none", *command.names])}
        for name, draw in draws.items():
            self._compose(f"{place}.{name}", draw, numbers[name], 0.0, "s" if name == "at" else "")

    def _compose(self, path: str, draw: Draw, numbers: tuple[Any, ...], nominal: float, unit: str) -> None:
        """A drawn number that is no parameter."""
        kind, a, b, low, high, scale, choices, _ = numbers
        self.draws[path], self.composed[path], self._composed_columns[path] = draw, nominal, unit
        self.marginals[path] = Marginal(kind, a, b, low, high, scale, tuple(choices), nominal, False, path)

    # --- retained variables and requirements ---

    @property
    def shown(self) -> list[Variable]:
        """The variables that were retained by name, without the qualities that requirements read."""
        return [variable for variable in self.retained.values()
                if isinstance(variable, Variable) and not variable.hidden]

    @property
    def reported(self) -> list[Reported]:
        """What is retained of events, commands and packets, in the order of the plan."""
        return [variable for variable in self.retained.values() if isinstance(variable, Reported)]

    def watch(self, simulation: Simulation) -> tuple[_core.Judge, list[list[int]]]:
        """Let a judge look at these in a simulation of the mission, at the samples, as `watched` does."""
        return watched(simulation, [reported.signal for reported in self.reported], self._sampling())

    def retain(self, *paths: str, raw: bool = False) -> Any:
        """Keep fields of inputs and outputs of each run: `error = d.retain("flight.tracking.error.sigma_BR")`.

        Returns a Variable for each, for check(). Where a message was never written, its fields are NaN; raw: the zeros
        that its memory holds. Raises SetupError for what is no field of an input or output.
        """
        if not paths:
            raise SetupError('d.retain: name at least one field, as in d.retain("flight.tracking.error.sigma_BR")')
        variable = [self._retain(path, raw) for path in paths]
        for single in variable:
            single.hidden = False
        return variable[0] if len(variable) == 1 else variable

    def _retain(self, path: str, raw: bool) -> Variable:
        target = FieldPath(self.simulation, path)
        if target.port is None:
            raise SetupError(f"{path} is no field of an input or output, and only these are retained; "
                             f"{_core.path(target.owner)} has "
                             + listed(names_of(_core.struct(target.owner), ("in", "out"))))
        key = target.path + " raw" * raw
        if key not in self.retained:
            self._plan.retain(self.simulation.kernel, target.port, target.offset + target.width * target.elements[0],
                              len(target.elements), target.stored, raw)
            self.retained[key] = Variable(target, key, lambda: self._duration)
        variable = self.retained[key]
        assert isinstance(variable, Variable)
        return variable

    def signal(self, path: str) -> Signal:
        """A field as a signal of formulas (fledge.requirements), looked at at the retained samples; a mode too. Raises
        SetupError on an unknown path."""
        return signal(self.simulation, path)

    def require(self, *ids: str) -> None:
        """A run that does not fulfil these requirements of the mission's requirements.py has failed. Raises SetupError
        on an unknown one, and on one without a formula."""
        own = Requirements(self.simulation)
        for id in ids:
            requirement = own.of(id)
            if requirement.formula is None:
                raise SetupError(f"d.require: {requirement.id} is shown by {requirement.method}, and has no formula")
            self._check_formula(requirement, requirement.text)

    def _check_formula(self, declared: Declared, message: str) -> None:
        assert declared.formula is not None
        for comparison in declared.formula.comparisons:
            for signal in comparison.signal.reported:
                report = Reported(signal)
                if report.path not in self.retained:
                    self._plan.watch(len(report.elements), report.happened)
                    self.retained[report.path] = report
            for field in comparison.signal.fields:
                self._retain(field.path, False)
                if field.has_quality:
                    self._retain(f"{field.port}.head.quality", False)
        self.requirements.append(FormulaCheck(declared, message))

    def check(self, requirement: Any, message: str = "") -> None:
        """A run that does not fulfil this has failed: `d.check(error.norm().final < 1e-3, "it did not settle")`, or a
        formula: `d.check(always(d.signal("world.wheels.speeds.Omega").max_abs() < 600))`.

        It has also failed if the message was not good at any sample of that time, unless the variable is raw; a formula
        also where it is unknown. Raises SetupError for what is neither.
        """
        if isinstance(requirement, Formula):
            return self._check_formula(Declared(str(requirement), message, requirement), message)
        if not isinstance(requirement, Requirement):
            raise SetupError("d.check: expected a comparison of something retained with a constant, as in "
                             f"error.norm().final < 1e-3; found {requirement!r}")
        requirement.message = message
        variable = requirement.variable
        if not variable.raw and variable.field_path.has_quality:
            requirement.quality = self._retain(f"{variable.field_path.port}.head.quality", False)
        self.requirements.append(requirement)

    # --- sweeps ---

    def sweep(self, axes: Mapping[str, Sequence[Any]], parameters: Sequence[str], points: int, dispersed: bool) -> None:
        """Make the campaign a sweep: fledge.montecarlo.Sweep. parameters: the axes that the mission itself takes."""
        if not dispersed:
            self._plan.clear_draws()
            self.draws, self.composed, self._columns, self._composed_columns = {}, {}, {}, {}
        self._plan.points, stride = points, 1
        for path, values in axes.items():
            if path in parameters:
                self._parameter_columns[path] = ""
            else:
                self._sweep(path, values, stride)
            stride *= len(values)

    def _sweep(self, path: str, values: Sequence[Any], stride: int) -> None:
        """Give a parameter the values of an axis. Those of a whole array are what an assignment takes: a number may
        stand for a multiple of the identity."""
        import numpy as np

        target = FieldPath(self.simulation, path)
        field, shape = target.field, target.field.shape
        if not shape or target.path != target.full or target.group != "par":
            self[path] = Draw("grid", tuple(values), stride=stride)
            return
        before = getattr(target.holder, field.name).copy()
        rows = []
        try:
            for value in values:
                setattr(target.holder, field.name, value)
                rows.append([float(x) for x in np.ravel(getattr(target.holder, field.name))])
        finally:
            setattr(target.holder, field.name, before)
        number = int if field.type == "enum" else float
        for k in target.elements:
            mirrored = "inertia" in field.rule and k % 3 < k % 9 // 3
            if not mirrored and any(row[k] != before.flat[k] for row in rows):
                self[target.full + index_text(k, shape)] = Draw("grid", tuple(number(row[k]) for row in rows),
                                                                stride=stride)

    # --- chosen points ---

    def choose(self, values: Mapping[str, Sequence[float]]) -> None:
        """Make the campaign one whose runs have these numbers, in place of draws: path of a dispersed element, or of
        any parameter's -> its number in each run, in SI. Each run has the random streams of the first."""
        marginals = self.marginals
        self._plan.clear_draws()
        self.draws, self.composed, self._columns, self._composed_columns = {}, {}, {}, {}
        self._plan.points = len(next(iter(values.values())))
        orbits: dict[str, dict[str, Draw]] = {}
        commands: dict[str, dict[str, Draw]] = {}
        for path, numbers in values.items():
            place, _, name = path.rpartition(".")
            if place in self.commands:
                commands.setdefault(place, {})[name] = Draw("grid", tuple(map(float, numbers)))
                continue
            if ".orbit." in path:
                orbits.setdefault(place.removesuffix(".orbit"), {})[name] = Draw("grid", tuple(map(float, numbers)))
                continue
            kind = int if FieldPath(self.simulation, path).field.type == "enum" else float
            self[path] = Draw("grid", tuple(map(kind, numbers)))
        for craft, elements in orbits.items():
            self.orbit(craft, **elements)
        for place, draws in commands.items():
            self._command(place, self.commands[place], draws)
        self.marginals = marginals

    # --- the whole ---

    def measures(self) -> list[Variable]:
        """A number over time for each retained variable and for each requirement."""
        by_text: dict[str, Variable] = {}
        for variable in [*(variable.summary for variable in self.shown),
                         *(requirement.variable
                           for requirement in self.requirements if not isinstance(requirement, FormulaCheck))]:
            by_text.setdefault(variable.measure_text, variable)
        return list(by_text.values())

    def _finished(self) -> Any:
        """The complete plan. Raises SetupError if something is missing."""
        if self._duration is None:
            raise SetupError("d.duration is not given: how long does each run fly?")
        if not self.columns:
            raise SetupError('nothing is dispersed: say what differs, as in d["world.craft.sigma_BN"] = d.attitude()')
        self._plan.duration, self._plan.every, self._plan.runs = self._duration, self._sampling(), 1
        self._plan.check(self.simulation.kernel)
        for requirement in self.requirements:
            if isinstance(requirement, FormulaCheck) and requirement.formula.reach > self._duration:
                raise SetupError(f"{requirement!r} looks {time_text(requirement.formula.reach)} ahead, which is longer "
                                 f"than a run of {self.duration:g} s")
            part = requirement.variable.samples(self.ns)
            if part.start >= part.stop:
                raise SetupError(f"d.check({requirement!r}): there is no sample in that time, with one every "
                                 f"{self.every:g} s for {self.duration:g} s")
        return self._plan

    @property
    def ns(self) -> np.ndarray:
        """The times of the samples [ns]."""
        import numpy as np

        return np.arange((self._duration or 0) // self._sampling() + 1) * self._sampling()

    def __repr__(self) -> str:
        lines = ["dispersions" + (f", {self.duration:g} s" if self._duration else "")]
        lines += [f"  {path} = {draw!r}" for path, draw in self.draws.items()]
        lines += [f"  retain {variable.path}" for variable in self.shown]
        lines += [f"  check {requirement!r}" for requirement in self.requirements]
        return "\n".join(lines)


def _distribution(shown: str, name: str, draw: Draw) -> tuple[Any, ...]:
    """The arguments of a Distribution of an orbit's element, or of a command's time, in SI."""
    unit, dims = (("-", _NUMBER) if draw.scale == "relative" or name in ("e", "which") else
                  ("s", _TIME) if name == "at" else ("rad", ANGLE) if name in ANGLES else ("m", LENGTH))
    declared = f"{shown} = {draw!r}"
    numbers = [to_number(x, declared, unit, dims) for x in draw.numbers]
    low, high = (x if limit is None else to_number(limit, declared, unit, dims)
                 for limit, x in ((draw.low, -_INFINITY), (draw.high, _INFINITY)))
    listing = draw.kind in ("choice", "grid")
    return (draw.kind, *([0.0, 0.0] if listing else numbers), low, high, draw.scale, numbers if listing else [],
            draw.stride)


def _shape_of(given: set[str], path: str) -> tuple[str, str]:
    """The two elements that give an orbit its size and shape, of those that are drawn."""
    for shape in (("a", "e"), ("p", "e"), ("altitude", "e"), ("rp", "ra"), ("rp", "e")):
        if given <= set(shape):
            return shape
    raise SetupError(f"d.orbit({path!r}): draw of the size and shape a and e, p and e, altitude and e, rp and ra, rp "
                     f"and e, or one of these; found {listed(sorted(given))}")


def _positive(value: Any, what: str) -> int:
    ns = time_ns(value, what)
    if ns <= 0:
        raise SetupError(f"{what} must be > 0, found {ns / 1e9:g} s")
    return ns


def _shape(value: Any) -> tuple[int, ...]:
    return (len(value), *_shape(value[0])) if isinstance(value, (list, tuple)) and len(value) else ()


def _flat(value: Any) -> list[Any]:
    if isinstance(value, (list, tuple)):
        return [x for item in value for x in _flat(item)]
    return [value]
