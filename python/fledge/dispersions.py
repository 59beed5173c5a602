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

        error = d.retain("flight.tracking.error.sigma_BR")
        d.check(error.norm().final < 1e-3, "the attitude did not settle")

Every public function of the file that takes `d` is a campaign; the first line of its docstring says
what it shows. Each run is fixed by the campaign's seed and the run's index alone, and each element of
a parameter is drawn from a stream of its own: a line more changes no other line's draws.
"""

import math
import re

from fledge import _core
from fledge._hooks import strip
from fledge.process import _time

SetupError = _core.SetupError

_NUMBER = (0,) * 8
_INFINITY = math.inf


# --- paths -----------------------------------------------------------------------------------------

class _Place:
    """The field behind a path, and which of its elements are meant.

    owner: the module or model; port: the input or output that the field is a part of, or None; offset:
    of the field in it; elements: flat indices; shape: of what they are together.
    """

    def __init__(self, simulation, path):
        self.path = " ".join(path.split())
        match = re.fullmatch(r"(\w+(?:\.\w+)*)((?:\[[\d, ]+\])*)", self.path)
        names = match[1].split(".") if match else []
        if len(names) < 3:
            raise SetupError(f"'{path}': expected process.instance.name, as in world.craft.I_B or "
                             "world.craft.I_B[0, 0]")
        processes = {p.name: p for p in (simulation.world, simulation.flight)}
        if names[0] not in processes:
            raise SetupError(f"{path}: there is no process '{names[0]}'; there are {', '.join(processes)}")
        process = processes[names[0]]
        if names[1] not in process._instances:
            raise SetupError(f"{path}: {process._unknown(names[1])}")
        self.owner = process._instances[names[1]]
        self.port, self.offset = None, 0
        struct, at = _core.struct(self.owner), ".".join(names[:2])
        for i, name in enumerate(names[2:], 3):
            self.field = _member(struct, name, at, path)
            at = f"{at}.{name}"
            if self.field.type != "struct":
                break
            if self.port is None:
                self.port = at
            else:
                self.offset += self.field.offset
            struct = self.field.struct
        else:
            raise SetupError(f"{path} is a whole message; name one of its fields: {', '.join(_names(struct))}")
        if i < len(names):
            raise SetupError(f"{path}: {at} is a number or array, and has no '{names[i]}'")
        if self.field.type != "f64":
            raise SetupError(f"{path} is of type {self.field.ctype}; only floating-point numbers are meant here")
        if self.port is not None:
            self.offset += self.field.offset
        self.full = at
        self.elements, self.shape = self._select(match[2])

    def _select(self, text):
        """The flat elements and shape of "[0, 1]" or "[2]" of the rows that count."""
        shape = self.field.shape
        if shape and self.field.count and self.port is None:
            shape = (int(getattr(self.owner, self.field.count)), *shape[1:])
        indices = [int(i) for i in re.findall(r"\d+", text)]
        if len(indices) > len(shape) or any(i >= n for i, n in zip(indices, shape)):
            what = f"has shape {shape}" if shape else "is a single number"
            raise SetupError(f"{self.path}: {self.full} {what}; there is no element "
                             f"[{', '.join(map(str, indices))}]")
        rest = self.field.shape[len(indices):] if indices else shape
        n = math.prod(rest)
        first = 0
        for i, size in zip(indices, self.field.shape):
            first = first * size + i
        return list(range(first * n, first * n + n)), tuple(rest)

    def names(self):
        """The path of each element: "world.craft.I_B[0, 1]"."""
        sizes = self.field.shape
        return [self.full + _index(e, sizes) for e in self.elements]

    @property
    def unit(self):
        return "" if self.field.unit in ("", "-") else self.field.unit


def _index(element, shape):
    index = []
    for n in reversed(shape):
        element, i = divmod(element, n)
        index.append(str(i))
    return f"[{', '.join(reversed(index))}]" if index else ""


def _names(struct, groups=("", "in", "out", "par")):
    return [f.name for f in struct.fields if f.group in groups and not f.spare]


def _member(struct, name, owner, path):
    for field in struct.fields:
        if field.name == name and not field.spare:
            return field
    from difflib import get_close_matches

    near = get_close_matches(name, _names(struct), 1)
    raise SetupError(f"{path}: {owner} has no '{name}'" + (f"; did you mean '{near[0]}'?" if near else ";")
                     + f" it has {', '.join(_names(struct))}")


def _port(simulation, path):
    process, instance, port = path.split(".")
    return getattr(getattr(getattr(simulation, process), instance), port)


# --- what is drawn ---------------------------------------------------------------------------------

class Draw:
    """What a parameter is drawn from: made by uniform(), normal() and attitude() of `d`."""

    def __init__(self, kind, numbers=(), low=None, high=None, scale=""):
        self.kind, self.numbers, self.low, self.high, self.scale = kind, numbers, low, high, scale

    def _scaled(self, scale):
        if self.scale or self.kind == "attitude":
            raise SetupError(f"{self!r} cannot be joined with the nominal value"
                             + (" twice" if self.scale else ": it is an attitude of its own"))
        return Draw(self.kind, self.numbers, self.low, self.high, scale)

    def __repr__(self):
        cut = ([f"low={_short(self.low)}"] if self.low is not None else []) + (
            [f"high={_short(self.high)}"] if self.high is not None else [])
        text = f"{self.kind}({', '.join([*map(_short, self.numbers), *cut])})"
        return {"": "", "about": "nominal + ", "relative": "nominal * "}[self.scale] + text


def _short(value):
    from fledge.units import Quantity

    if isinstance(value, Quantity):
        unit = value._unit()
        return _short(value.value) + (f" {unit}" if unit else "")
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(_short, value))}]"
    return f"{value:.6g}" if isinstance(value, (int, float)) else repr(value)


class _Nominal:
    """`d.nominal`: the value that the mission's own files give."""

    def __add__(self, draw):
        return self._join(draw, "about", "+")

    def __mul__(self, draw):
        return self._join(draw, "relative", "*")

    __radd__, __rmul__ = __add__, __mul__

    def _join(self, draw, scale, sign):
        if not isinstance(draw, Draw):
            raise SetupError(f"d.nominal {sign} {draw!r}: expected something drawn, as in "
                             f"d.nominal {sign} d.normal({'0, 1 * m' if sign == '+' else '1, 0.05'})")
        return draw._scaled(scale)

    def __repr__(self):
        return "nominal"


# --- what is kept, and what it must fulfil ---------------------------------------------------------

class Series:
    """A retained variable over time, or a number made of it, for checks and plots.

    `.norm()`, `.max_abs()` and `[i]` make a number of an array; `.after(t)`, `.before(t)` and `.final`
    keep a part of its time. Comparing a number with a constant makes a requirement: it must hold at
    every sample of that time.
    """

    def __init__(self, place, duration, measure="", start=0, end=None):
        self._place, self._duration = place, duration
        self._measure, self._start, self._end = measure, start, end

    def _with(self, **changes):
        other = object.__new__(Series)
        other.__dict__.update(self.__dict__)
        other.__dict__.update({f"_{k}": v for k, v in changes.items()})
        return other

    # --- numbers ---

    def norm(self):
        """The root of the sum of the elements' squares."""
        return self._reduced("norm", "norm()")

    def max_abs(self):
        """The largest magnitude of the elements."""
        return self._reduced("max_abs", "max_abs()")

    def __getitem__(self, index):
        index = index if isinstance(index, tuple) else (index,)
        shape = self._place.shape
        measure = self._reduced(index, "[...]")
        if len(index) != len(shape) or not all(isinstance(i, int) and 0 <= i < n for i, n in zip(index, shape)):
            raise SetupError(f"{self._place.path}{list(index)}: expected {len(shape)} whole numbers below {shape}")
        return measure

    def _reduced(self, measure, what):
        if not self._place.shape or self._measure:
            raise SetupError(f"{self!r}: {what} is for arrays")
        return self._with(measure=measure)

    # --- times ---

    def after(self, t):
        """From a time on."""
        return self._with(start=self._within(t, "after"))

    def before(self, t):
        """Until a time."""
        return self._with(end=self._within(t, "before"))

    @property
    def final(self):
        """At the end of the run."""
        return self._with(start=None)

    def _within(self, t, what):
        ns = _time(t, f"{self!r}: {what}")
        if not 0 <= ns <= (self._duration() or ns):
            raise SetupError(f"{self!r}: {what}({ns / 1e9:g} s) is not within the run")
        return ns

    # --- requirements ---

    def _compare(self, comparison, limit):
        place = self._place
        if place.shape and not self._measure:
            raise SetupError(f"{self!r} has shape {place.shape}: compare an element, norm() or max_abs()")
        value = strip(limit, repr(self), place.field.unit, place.field.dims, "a number")
        if not isinstance(value, (int, float)) or not math.isfinite(value):
            raise SetupError(f"{self!r} {comparison} {limit!r}: expected a finite number")
        return Requirement(self, comparison, float(value))

    def __lt__(self, limit):
        return self._compare("<", limit)

    def __le__(self, limit):
        return self._compare("<=", limit)

    def __gt__(self, limit):
        return self._compare(">", limit)

    def __ge__(self, limit):
        return self._compare(">=", limit)

    __hash__ = object.__hash__

    # --- values ---

    @property
    def path(self):
        """The variable's path, as it was retained."""
        return self._place.path

    @property
    def unit(self):
        return self._place.unit

    def port(self, simulation):
        """The input or output that holds it, in this simulation or another of the same mission."""
        return _port(simulation, self._place.port)

    @property
    def measure_text(self):
        """ "norm(flight.tracking.error.sigma_BR)" """
        if isinstance(self._measure, tuple):
            return f"{self.path}[{', '.join(map(str, self._measure))}]"
        return f"{self._measure}({self.path})" if self._measure else self.path

    @property
    def when(self):
        """The part of the time, in words."""
        if self._start is None:
            return "at the end"
        parts = ([f"after {self._start / 1e9:g} s"] if self._start else []) + (
            [f"before {self._end / 1e9:g} s"] if self._end is not None else [])
        return " and ".join(parts)

    def values(self, result):
        """(runs, samples): its number in each run at each sample, whatever its part of the time."""
        import numpy as np

        values = result.retained[self.path]
        if self._measure == "norm":
            return np.sqrt(np.sum(np.square(values.reshape(*values.shape[:2], -1)), axis=2))
        if self._measure == "max_abs":
            return np.max(np.abs(values.reshape(*values.shape[:2], -1)), axis=2)
        return values[(slice(None), slice(None), *self._measure)] if self._measure else values

    def samples(self, ns):
        """Which of the samples at these times belong to its part of the time: a slice."""
        import numpy as np

        if self._start is None:
            return slice(len(ns) - 1, len(ns))
        end = len(ns) if self._end is None else int(np.searchsorted(ns, self._end, "right"))
        return slice(int(np.searchsorted(ns, self._start, "left")), end)

    def __repr__(self):
        return " ".join(filter(None, [self.measure_text, self.when]))


class Requirement:
    """A number that must stay on one side of a limit; `message` says what it means if it does not."""

    def __init__(self, series, comparison, limit):
        self.series, self.comparison, self.limit, self.message = series, comparison, limit, ""

    def __bool__(self):
        raise TypeError(f"{self!r} is only known when the campaign has flown; hand it to d.check()")

    def worst(self, result):
        """(values, times [s], whether they hold): of each run, where it comes closest to the limit or
        passes it furthest. NaN, and not held, for runs that were not flown to their end."""
        import numpy as np

        part = self.series.samples(result.ns)
        values = self.series.values(result)[:, part]
        # argmin and argmax take the first NaN there is, and no NaN holds.
        at = np.argmax(values, axis=1) if self.comparison in ("<", "<=") else np.argmin(values, axis=1)
        worst = values[np.arange(len(values)), at]
        holds = {"<": np.less, "<=": np.less_equal, ">": np.greater, ">=": np.greater_equal}[self.comparison]
        return worst, result.ns[part][at] / 1e9, holds(worst, self.limit)

    def failure(self, value, time):
        """What to say of a run that does not fulfil it."""
        unit = f" {self.series.unit}" if self.series.unit else ""
        text = f"{self.series.measure_text} is {value:.4g}{unit} at {time:g} s, not {self.comparison} {self.limit:g}{unit}"
        return f"{self.message}: {text}" if self.message else text

    def __repr__(self):
        unit = f" {self.series.unit}" if self.series.unit else ""
        return f"{self.series!r} {self.comparison} {self.limit:g}{unit}"


# --- d ---------------------------------------------------------------------------------------------

class Dispersions:
    """What a campaign's function fills: `d`."""

    def __init__(self, simulation):
        self._simulation = simulation
        self._plan = _core.CampaignPlan()
        self._duration = self._every = None
        self.draws = {}         # path -> Draw, as declared
        self.columns = {}       # path of each dispersed element -> its unit, in the order of a run's draws
        self.retained = {}      # path -> Series of the whole variable
        self.requirements = []

    # --- times ---

    @property
    def duration(self):
        """How long each run flies, a time."""
        return None if self._duration is None else self._duration / 1e9

    @duration.setter
    def duration(self, value):
        self._duration = _positive(value, "d.duration")

    @property
    def every(self):
        """The time between two samples of what is retained; a 200th of the duration unless given."""
        return None if self._duration is None and self._every is None else self._sampling() / 1e9

    @every.setter
    def every(self, value):
        self._every = _positive(value, "d.every")

    def _sampling(self):
        return self._every or max(self._duration // 200, 1)

    # --- distributions ---

    nominal = _Nominal()

    def uniform(self, low, high):
        """Anything between two values: `d.uniform(9 * N, 11 * N)`, `d.nominal * d.uniform(0.9, 1.1)`."""
        return Draw("uniform", (low, high))

    def normal(self, mean, sigma, *, low=None, high=None):
        """Normal with a mean and a standard deviation; truncated, if low or high are given: draws
        outside are drawn again. `d.nominal + d.normal(0, 2 * deg, low=-6 * deg, high=6 * deg)`.

        A list gives each element of an array its own number.
        """
        return Draw("normal", (mean, sigma), low, high)

    def attitude(self):
        """Any attitude with equal probability, for an MRP."""
        return Draw("attitude")

    def __setitem__(self, path, draw):
        """Disperse a parameter of any instance: all its elements, those of a row, or one."""
        if not isinstance(draw, Draw):
            raise SetupError(f"{path}: expected something drawn, such as d.normal(...), d.uniform(...) or "
                             f"d.attitude(); found {_short(draw)}")
        place = _Place(self._simulation, path)
        if place.field.group != "par":
            raise SetupError(f"{path} is no parameter, and only these can be dispersed; {_core.path(place.owner)} has "
                             + ", ".join(f.name for f in _core.struct(place.owner).fields
                                         if f.group == "par" and f.type == "f64" and not f.spare))
        # Of a whole inertia the upper triangle is drawn; the kernel keeps it symmetric.
        inertia = "inertia" in place.field.rule
        kept = [k for k, e in enumerate(place.elements) if not (inertia and len(place.elements) == 9 and e // 3 > e % 3)]
        names = place.names()
        for k in kept:
            e = place.elements[k]
            if {names[k], place.full + _index(e % 3 * 3 + e // 3, (3, 3)) if inertia else names[k]} & self.columns.keys():
                raise SetupError(f"{names[k]} is dispersed twice")
        numbers = [self._numbers(value, place, draw) for value in draw.numbers] or [[0.0] * len(place.elements)] * 2
        numbers += [self._numbers(draw.low, place, draw, -_INFINITY), self._numbers(draw.high, place, draw, _INFINITY)]
        groups = {}  # elements with the same numbers
        for k in kept:
            groups.setdefault(tuple(one[k] for one in numbers), []).append(k)
        for (a, b, low, high), group in groups.items():
            self._plan.disperse(self._simulation._core, place.full, [place.elements[k] for k in group], draw.kind, a, b,
                                low, high, draw.scale)
            self.columns.update((names[k], place.unit) for k in group)
        self.draws[place.path] = draw

    def _numbers(self, value, place, draw, default=None):
        """A number for each element, in the parameter's unit; factors have none."""
        n = len(place.elements)
        if value is None:
            return [default] * n
        relative = draw.scale == "relative"
        shown = f"{place.path} = {draw!r}"
        value = strip(value, shown, "-" if relative else place.field.unit,
                      _NUMBER if relative else place.field.dims, "a number, or one for each element")
        if isinstance(value, (int, float)):
            return [float(value)] * n
        found = _shape(value)
        if found != place.shape:
            raise SetupError(f"{shown}: expected a number, or an array of shape {place.shape}; found one of shape {found}")
        return [float(x) for x in _flat(value)]

    # --- what is kept ---

    def retain(self, *paths):
        """Keep fields of inputs and outputs of each run: `error = d.retain("flight.tracking.error.sigma_BR")`.

        Returns a Series for each, for check().
        """
        if not paths:
            raise SetupError('d.retain: name at least one field, as in d.retain("flight.tracking.error.sigma_BR")')
        series = [self._retain(path) for path in paths]
        return series[0] if len(series) == 1 else series

    def _retain(self, path):
        place = _Place(self._simulation, path)
        if place.port is None:
            raise SetupError(f"{path} is no field of an input or output, and only these are retained; "
                             f"{_core.path(place.owner)} has "
                             + ", ".join(_names(_core.struct(place.owner), ("in", "out"))))
        if place.path not in self.retained:
            self._plan.retain(self._simulation._core, place.port, place.offset + 8 * place.elements[0],
                              len(place.elements))
            self.retained[place.path] = Series(place, lambda: self._duration)
        return self.retained[place.path]

    def check(self, requirement, message=""):
        """A run that does not fulfil this has failed: `d.check(error.norm().final < 1e-3, "it did not settle")`."""
        if not isinstance(requirement, Requirement):
            raise SetupError("d.check: expected a comparison of something retained with a constant, as in "
                             f"error.norm().final < 1e-3; found {requirement!r}")
        requirement.message = message
        self.requirements.append(requirement)

    # --- the whole ---

    def _finished(self):
        """The plan, complete. Raises SetupError on what is missing."""
        if self._duration is None:
            raise SetupError("d.duration is not given: how long does each run fly?")
        if not self.draws:
            raise SetupError('nothing is dispersed: say what differs, as in d["world.craft.sigma_BN"] = d.attitude()')
        self._plan.duration, self._plan.every, self._plan.runs = self._duration, self._sampling(), 1
        self._plan.check(self._simulation._core)
        for requirement in self.requirements:
            part = requirement.series.samples(self.ns)
            if part.start >= part.stop:
                raise SetupError(f"d.check({requirement!r}): there is no sample in that time, with one every "
                                 f"{self.every:g} s for {self.duration:g} s")
        return self._plan

    @property
    def ns(self):
        """The times of the samples [ns]."""
        import numpy as np

        return np.arange(self._duration // self._sampling() + 1) * self._sampling()

    def __repr__(self):
        lines = ["dispersions" + (f", {self.duration:g} s" if self._duration else "")]
        lines += [f"  {path} = {draw!r}" for path, draw in self.draws.items()]
        lines += [f"  retain {path}" for path in self.retained]
        lines += [f"  check {requirement!r}" for requirement in self.requirements]
        return "\n".join(lines)


def _positive(value, what):
    ns = _time(value, what)
    if ns <= 0:
        raise SetupError(f"{what} must be > 0, found {ns / 1e9:g} s")
    return ns


def _shape(value):
    return (len(value), *_shape(value[0])) if isinstance(value, (list, tuple)) and len(value) else ()


def _flat(value):
    if isinstance(value, (list, tuple)):
        return [x for one in value for x in _flat(one)]
    return [value]
